"""Running a host to its end: on an event loop, in real time or in virtual, obeying signals and an operator elsewhere.

The endpoint serves within the event loop of the run and as long as it lasts (`control.py`), on every host alike: what
may be done to a whole run may be done to one controller, and an emergency stop there needs neither the coordinator nor
a link.
"""

from __future__ import annotations

import asyncio
import gc
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.driver import Driver, Quality
from firable.executor.operating.host import Host
from firable.executor.operating.log import FROZEN, UNHANDLED
from firable.executor.operating.situation import Situation
from firable.executor.operating.uncut import STOP_SECONDS, Guard, Patience, ended_by_signals
from firable.executor.own_time import OwnTimeLoop
from firable.nets.net import Net

if TYPE_CHECKING:  # these need the extra `serve`
    from firable.executor.operating.control import Endpoint, Page
    from firable.executor.operating.metrics import Metrics


@dataclass(frozen=True)
class Service:
    """An operator's endpoint, who is told its address, and the page that it serves besides."""

    endpoint: Endpoint
    served: Callable[[str], None] = lambda _: None
    page: Callable[[Host], Page] | None = None
    """What makes the page of a run, where it has one."""


def figures_for(net: Net, service: Service | None, machines: Collection[str] = ()) -> Metrics | None:
    """What counts for the endpoint, where there is one: of the places of these controllers, or of all."""
    if service is None:
        return None
    from firable.executor.operating.metrics import Metrics

    return Metrics(net, machines)


def patience_with(driver: Driver) -> Patience:
    """How long the end of a driver is waited for: as long as its devices may take, and then some."""
    own = (
        3 * max((d.timeout_s for d in driver.binding.document.devices.values()), default=0.0)
        if isinstance(driver, BoundDriver)
        else 0.0
    )
    return Patience(STOP_SECONDS + own)


def demand_no_loop() -> None:
    """Raise `RuntimeError` within an event loop: a run has one of its own, and would hold that one up to its end."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return
    message = "a run has an event loop of its own: begin it outside of any, or on a thread, where no signal ends it"
    raise RuntimeError(message)


def demand_address(service: Service | None) -> None:
    """Raise `InputError` F5061 where the address of an endpoint is not to be had, before a run has touched a file."""
    if service is not None:
        from firable.executor.operating.control import sockets_of

        for one in asyncio.run(sockets_of(service.endpoint)):
            one.close()


def run_to_the_end(host: Host, *, virtual: bool = False) -> Situation:
    """Run a host on an event loop of its own; Ctrl-C or a request to terminate ends it in order."""
    if virtual:
        situation: Situation = run_in_virtual_time(terminable(host))
        return situation
    service, figures = host.conduct.service, host.figures
    if service is None or figures is None:
        work = terminable(host)
    else:
        page = None if service.page is None else service.page(host)  # before the loop begins, which it would hold up
        work = _serving(host, service, figures, page)
    allow_all_descriptors()
    guard = Guard(host.patience.seconds)
    try:
        with _short_collections(), asyncio.Runner(loop_factory=partial(_loop_for, host)) as runner:
            try:
                ended = runner.run(work)
            finally:
                guard.begin()  # a thread of a driver or a disk that hangs keeps the event loop from being closed
    finally:
        guard.end()
    return ended


def allow_all_descriptors() -> None:
    """Let this process have as many files and connections as the system gives it, and not the thousand of a shell.

    Where there are none left no device is reached again; and Zenoh, which anybody can have open one for each connection
    to its address, before any certificate is shown, hears nobody any more until it is started again.
    """
    try:
        import resource
    except ModuleNotFoundError:  # a system without such limits
        return
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):  # a system may say that there is no bound, and allow less
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def _loop_for(host: Host) -> asyncio.AbstractEventLoop:
    """A loop in its own time; where there is a link, one that its threads may work on while it sleeps."""
    if host.is_whole:
        loop = OwnTimeLoop()
    else:
        from firable.executor.links.lending import LendingLoop

        loop = LendingLoop()
    loop.listening.thawed = partial(_tell_thawed, host, loop)
    if host.tell is not None or host.log is not None:
        loop.set_exception_handler(partial(_left, host))
    return loop


def _left(host: Host, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Have an error told in a line, which asyncio would write to the terminal with all its calls.

    What runs beside the host is awaited, and its errors end the run: this is what libraries let fall.
    """
    if loop.is_closed():  # nobody would hear of it
        loop.default_exception_handler(context)
        return
    loop.call_soon_threadsafe(host.told, UNHANDLED, unhandled(context))


def unhandled(context: Mapping[str, Any]) -> str:
    """An error that nobody has handled, in a sentence with the place where it was raised.

    >>> unhandled({"message": "Exception in callback", "exception": ValueError("no number")})
    'an error that nobody has handled: Exception in callback: ValueError: no number'
    """
    error = context.get("exception")
    told = ["an error that nobody has handled", str(context.get("message", "")).rstrip(".")]
    if isinstance(error, BaseException):
        told += [type(error).__name__, str(error)]
        if calls := traceback.extract_tb(error.__traceback__):
            told.append(f"{'/'.join(Path(calls[-1].filename).parts[-2:])}, line {calls[-1].lineno}")
    return ": ".join(filter(None, told))


def _tell_thawed(host: Host, loop: OwnTimeLoop, seconds: float) -> None:
    sentence = f"this process did not run for {seconds:.1f} s; its time limits stood still meanwhile"
    loop.call_soon(host.told, FROZEN, sentence)


@contextmanager
def _short_collections() -> Iterator[None]:
    """Let the garbage collector look at what the run makes, and not at all that is loaded.

    Now and then it looks at everything, which takes tens of milliseconds, in which no signal is read.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


async def terminable(host: Host) -> Situation:
    """The host, which Ctrl-C or a request to terminate ends in order: no machine is left on."""
    with ended_by_signals(host.patience):
        return await host.main()


class Inputs:
    """The figures of what driver and link of a host read, brought up to date when somebody asks for them."""

    def __init__(self, host: Host, figures: Metrics) -> None:
        self.host = host
        self.figures = figures
        self.counted: Counter[str] = Counter()
        """What the figures have of the changes that were coalesced."""
        self.damaged = 0
        """What they have of what came damaged."""

    def look(self) -> None:
        """Take what was read since the last look."""
        for signal, reading in self.host.driver.readings().items():
            self.figures.input_read(signal, good=reading.quality is Quality.GOOD)
        now = self.host.coalesced.up_to_now(self.host.driver)
        for signal, new in (now - self.counted).items():
            self.figures.inputs_coalesced(signal, new)
        self.counted = now
        damaged = self.host.link.damaged if self.host.link is not None else 0
        self.figures.came_damaged(damaged - self.damaged)
        self.damaged = damaged


async def _serving(host: Host, service: Service, figures: Metrics, page: Page | None = None) -> Situation:
    from firable.executor.operating.control import serving

    inputs = Inputs(host, figures)

    def text() -> bytes:
        inputs.look()
        return figures.text()

    host.served = True
    async with serving(host, service.endpoint, text, page) as address:
        service.served(address)
        return await terminable(host)
