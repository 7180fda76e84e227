"""The host of a controller that fires a transition alone, and that of another one and the coordinator."""

import asyncio

import pytest

from firable.decompose import split
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import Journal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import PROTOCOL_VERSION, Greeting
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import Situation
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Place
from firable.nets.text import parse_net

SPLIT = split(
    parse_net("""\
firable: 1
cell: cell
controllers:
  a: {start: free, places: {free: , lamp: {send: {machine: A, command: OPEN}}, over: }}
  b: {start: idle, places: {idle: , has: }}
transitions:
  alone: {from: a.free, to: a.lamp}
  hand: {from: [a.lamp, b.idle], to: [a.over, b.has]}
""")
)


class Counting(DryRunDriver):
    """Machines that count what they are given."""

    sent = 0

    def send(self, place: Place, entry: int) -> None:
        super().send(place, entry)
        self.sent += 1


class Hosts:
    """The host of a, which fires a transition alone, and that of b and the coordinator."""

    def __init__(self) -> None:
        self.exchange = Exchange()
        self.driver = Counting([SPLIT.subnet("a")], 1.0)

    def host(
        self, machines: tuple[str, ...], journal: Journal, digest: str = "d", version: int = PROTOCOL_VERSION
    ) -> Host:
        """A host that is not started yet, with the bundle of this digest and this version of the protocol."""
        link = InProcessLink(self.exchange, Greeting(digest, machines, version))
        driver = self.driver if machines == ("a",) else DryRunDriver([SPLIT.subnet("b")], 1.0)
        recorder = Recorder(SPLIT.net, "", None, None, machines)
        return Host(SPLIT, driver, recorder, machines=machines, link=link, journal=journal)


async def refusal(task: asyncio.Task[Situation]) -> Diagnostic:
    """With what a run ends, in time, that is refused."""
    await asyncio.wait([task], timeout=30)
    assert task.done()
    with pytest.raises(InputError) as refused:
        await task
    (problem,) = refused.value.diagnostics
    return problem
