"""The page of a running cell in a real browser: a net of 303 places, and a hundred firings a second.

The run is one of the executor, with its votes and rounds, in a process of its own; its machines are those of a dry run,
whose commands take so long that about as many transitions fire as the row says. The browser is Chromium without a
window, driven by Playwright; what it was told and when it drew is counted in the page, by a script that stands in it
before it loads. Times are by the clock, since a browser is many processes, and they are of this machine with both
programs on it: a figure of the page alone does not exist.

- *told*: firings in the frames that came, of those that the executor counted meanwhile; none may be lost, since a frame
  tells all that happened since the one before.
- *frames*: how many frames came a second; the server sends 20 at most, so that updates that are faster are joined.
- *drawn*: how often the browser drew a second; without anything to do it is 60.
- *behind*: from the moment of a frame at the server until it was drawn, of all but one in a hundred.
- *longest task*: how long the page did not listen to a click.
"""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from measuring import Table, against

from firable.cli.view.live import LivePage
from firable.decompose.splitting.cut import split
from firable.executor import Host
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.control import Endpoint, application, listening
from firable.executor.operating.recorder import Recorder
from firable.nets.catalogue import family_net

NET: Final = "manufacturing_cells-55"
TOKEN: Final = "the-token-of-this-benchmark"
WARM_SECONDS: Final = 12.0
SECONDS: Final = 10.0
COMMAND_SECONDS: Final = {"100": 0.25, "450": 0.06}
"""How long commands take, by about how many transitions then fire a second."""

COUNTING: Final = """
window.seen = {frames: 0, fired: 0, drawn: 0, behind: [], longest: 0, tasks: 0};
const parse = JSON.parse;
JSON.parse = (text, ...more) => {
  const told = parse(text, ...more);
  if (told && told.fired && told.at !== undefined) {
    seen.frames++;
    seen.fired += told.fired.length;
    seen.offset ??= performance.now() - told.at * 1000;
    const came = performance.now();
    seen.offset = Math.min(seen.offset, came - told.at * 1000);
    requestAnimationFrame(() => setTimeout(() => seen.behind.push(performance.now() - told.at * 1000)));
  }
  return told;
};
const draw = () => { seen.drawn++; requestAnimationFrame(draw); };
requestAnimationFrame(draw);
new PerformanceObserver((list) => {
  for (const task of list.getEntries()) { seen.tasks++; seen.longest = Math.max(seen.longest, task.duration); }
}).observe({type: "longtask"});
"""
RESET: Final = (
    "Object.assign(seen, {frames: 0, fired: 0, drawn: 0, behind: [], longest: 0, tasks: 0, since: performance.now()})"
)
READ: Final = """() => ({...seen, seconds: (performance.now() - seen.since) / 1000,
  late: seen.behind.sort((a, b) => a - b)[Math.floor(seen.behind.length * 0.99)] - seen.offset})"""


async def serve(command_seconds: float) -> None:
    """Run the net, and serve its page until this process is ended."""
    decomposition = split(family_net(NET))
    driver = DryRunDriver(decomposition.subnets, command_seconds)
    host = Host(decomposition, driver, Recorder(decomposition.net, NET, None), Conduct(overdue_seconds=600.0))
    endpoint = Endpoint("127.0.0.1", 0, TOKEN)
    firings = host.recorder.firings
    app = application(host, endpoint, lambda: str(sum(firings.values())).encode(), LivePage(host))
    async with listening(app, endpoint) as address:
        print(f"{address}/#token={TOKEN}", flush=True)
        await host.main()


def seen(command_seconds: float) -> Mapping[str, Any]:
    """What a browser saw of such a run in `SECONDS`."""
    from playwright.sync_api import sync_playwright

    with served(command_seconds) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=_chromium(), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.add_init_script(COUNTING)
        page.goto(address)
        page.locator(".events .fired").first.wait_for()
        time.sleep(WARM_SECONDS)
        counted = "async () => Number(await (await fetch('metrics', {headers: {Authorization: 'Bearer %s'}})).text())"
        before = page.evaluate(counted % TOKEN)
        page.evaluate(RESET)
        time.sleep(SECONDS)
        found = page.evaluate(READ)
        found["happened"] = page.evaluate(counted % TOKEN) - before
        browser.close()
    return dict(found)


@contextmanager
def served(command_seconds: float) -> Iterator[str]:
    """The address of such a run, in a process of its own, which ends whatever happens to who looks at it."""
    command = [sys.executable, __file__, str(command_seconds)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def _chromium() -> str | None:
    """The browser of the system, as the tests have it; None lets Playwright take its own."""
    found = map(shutil.which, ("chromium-headless-shell", "chromium", "google-chrome"))
    return next(filter(None, found), None)


def tables(repeat: int) -> list[Table]:
    """Runs of several paces."""
    del repeat  # a pace is held for a while, and not repeated
    rows = []
    for pace, command_seconds in COMMAND_SECONDS.items():
        found = seen(command_seconds)
        seconds = found["seconds"]
        rows.append(
            (
                pace,
                f"{found['happened'] / seconds:.0f}",
                against(0.97, found["fired"] / max(1, found["happened"]), at_least=True),
                f"{found['frames'] / seconds:.1f}",
                f"{found['drawn'] / seconds:.0f}",
                f"{found['late']:.0f} ms",
                f"{found['longest']:.0f} ms",
                f"{found['tasks'] / seconds:.1f}",
            )
        )
    net = family_net(NET)
    about = (
        f"`catalogue:{NET}`, {len(net.places)} places and {len(net.transitions)} transitions, run by the executor and "
        "followed by one page in Chromium on the same machine. *told* is the share of the firings that the page was "
        "told of; a firing at the edge of the time is counted by one side only."
    )
    columns = (
        *("firings a second, about", "measured", "told", "frames a second", "drawn a second"),
        *("behind (99 %)", "longest task", "tasks over 50 ms a second"),
    )
    return [Table("The page of a running cell", about, columns, tuple(rows))]


if __name__ == "__main__":
    if len(sys.argv) == 2:
        asyncio.run(serve(float(sys.argv[1])))
    else:
        print(json.dumps([table.rows for table in tables(1)], indent=1))
