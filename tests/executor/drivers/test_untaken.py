"""Commands that a device does not take, as where a point is written wrong: told early, and when they are overdue."""

import asyncio
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd

from firable.decompose.splitting.cut import split
from firable.executor.drivers import kinds
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.device import Point, Value
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.nets.interchange import net_digest
from firable.nets.text import parse_net

NET = parse_net("""
firable: 1
cell: arm
controllers:
  a: {start: home, places: {home: , away: {send: {machine: A, command: MOVE}, until: there}}}
transitions:
  go:   {from: a.home, to: a.away}
  back: {from: a.away, to: a.home}
""")
BINDING = """
firable_bind: 1
cell: arm
devices:
  far: {driver: theirs, memory: far, timeout_s: 0.05, channels: {A: {command: out, taken: in, done: ok}}}
signals: {a.there: acknowledged}
commands: {a.away: {device: far, channel: A}}
"""
GIVEN = "'A MOVE' of 'a.away' (written at out, shown at in, ok)"


@pytest.fixture(autouse=True)
def theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    one = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [one])


async def far_end(*, takes: bool) -> tuple[MemoryEnd, list[Value]]:
    """A device that shows the number of a command, or knows nothing of it; and what was written to it."""
    far = MemoryEnd("far")
    written: list[Value] = []

    def take(point: Point, value: Value) -> None:
        written.append(value)
        if takes:
            far.show("in", str(value).partition(" ")[0])

    await far.start(take)
    return far, written


def host_of(driver: BoundDriver, told: list[str], overdue_seconds: float = 120.0) -> Host:
    return Host(
        split(NET),
        driver,
        Recorder(NET, net_digest(NET), None),
        Conduct(
            operator=lambda _: asyncio.sleep(60),
            tell=lambda _, sentence: told.append(sentence),
            overdue_seconds=overdue_seconds,
        ),
    )


def test_a_command_that_its_device_does_not_take_is_told_with_its_points_until_it_is_taken() -> None:
    async def main() -> None:
        far, written = await far_end(takes=False)
        told: list[str] = []
        driver = bound_driver(parse_binding(BINDING), NET)
        host = host_of(driver, told)
        ending = asyncio.create_task(host.main())
        sentence = f"far: has not taken {GIVEN}: are the points written as the device has them?"
        await until(lambda: sentence in told, "the sentence")
        assert driver.unreached == (f"far has not taken {GIVEN}",)
        assert f"far has not taken {GIVEN}" in host.situation().message
        await far.cut()
        await far.mend()
        await until(lambda: len(written) == 2 and not driver.devices["far"].unreached, "it is written again")
        await asyncio.sleep(0.3)
        assert told.count(sentence) == 1
        far.show("in", str(written[0]).partition(" ")[0])
        await until(lambda: not driver.unreached, "the command is taken")
        host.stop()
        await ending

    asyncio.run(main())


def test_a_request_by_a_bit_that_is_not_taken_is_told_also_where_the_line_was_cut_meanwhile() -> None:
    """It is not written again then, as its bit still stands."""

    async def main() -> None:
        far, written = await far_end(takes=False)
        far.values.update({"in": 0, "ok": 0})
        told: list[str] = []
        by_bit = BINDING.replace("{command: out,", "{request: out,").replace(
            "channel: A}", "channel: A, write: {code: 1}}"
        )
        host = host_of(bound_driver(parse_binding(by_bit), NET), told)
        ending = asyncio.create_task(host.main())
        await until(lambda: True in written, "the request")
        await far.cut()
        await asyncio.sleep(0.3)
        assert not [sentence for sentence in told if "has not taken" in sentence]
        await far.mend()
        await until(lambda: any(f"has not taken {GIVEN}" in sentence for sentence in told), "the sentence")
        host.stop()
        await ending

    asyncio.run(main())


@pytest.mark.parametrize("takes", [False, True])
def test_a_command_that_is_overdue_says_whether_its_machine_has_shown_that_it_took_it(takes: bool) -> None:
    async def main() -> None:
        await far_end(takes=takes)
        ended = await host_of(bound_driver(parse_binding(BINDING), NET), [], overdue_seconds=0.5).main()
        taken = "it counts as taken" if takes else "its machine has not shown that it took it"
        assert f"is overdue: {taken}, and 'a.there' has not come within 0.5 s" in ended.message

    asyncio.run(main())
