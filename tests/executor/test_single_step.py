"""Single steps among several hosts, which take a while to hear of each other."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from support.layered_nets import shared_robot

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.single_step import VOTES_SECONDS
from firable.executor.protocol.deciders import coordinator_at
from firable.executor.protocol.messages import Message
from firable.nets.decomposition import Decomposition
from firable.nets.text import parse_net

SPLIT = split(
    parse_net("""\
firable: 1
cell: cell
controllers:
  a: {start: here, places: {here: , there: }}
  b: {start: here, places: {here: , there: }}
transitions:
  go: {from: [a.here, b.here], to: [a.there, b.there]}
  come: {from: [a.there, b.there], to: [a.here, b.here]}
""")
)
UNDER_WAY_SECONDS = 0.2


class Slow(InProcessLink):
    """A link whose messages are under way for a while."""

    def send(self, sender: str, receiver: str, message: Message) -> None:
        asyncio.get_running_loop().call_later(UNDER_WAY_SECONDS, super().send, sender, receiver, message)


Machines = tuple[str, ...]
TWO: tuple[Machines, ...] = ((COORDINATOR, "b"), ("a",))


def paused(
    operator: Callable[[Host], Awaitable[None]],
    decomposition: Decomposition = SPLIT,
    of: tuple[Machines, ...] = TWO,
) -> None:
    """Let an operator act on the first host, which is paused, beside the others."""

    async def main() -> None:
        exchange, hosts = Exchange(), []
        for machines in of:
            driver = DryRunDriver([subnet for subnet in decomposition.subnets if subnet.name in machines], 1.0)
            recorder = Recorder(decomposition.net, "", None, None, machines)
            link = Slow(exchange, Greeting("d", machines))
            hosts.append(Host(decomposition, driver, recorder, machines=machines, link=link, journal=MemoryJournal()))
        centre = hosts[0]
        centre.pause()
        tasks = [asyncio.create_task(host.main()) for host in hosts]
        await asyncio.sleep(5)
        await operator(centre)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_a_step_at_once_after_another_one_finds_what_that_has_enabled() -> None:
    async def operator(centre: Host) -> None:
        assert [await centre.step() for _ in range(6)] == ["go", "come"] * 3

    paused(operator)


def test_what_one_coordinator_has_decided_enables_what_another_one_decides_at_once() -> None:
    async def operator(centre: Host) -> None:
        assert [await centre.step() for _ in range(4)] == ["fill", "fetch", "back", None]

    paused(operator, split(shared_robot()), ((COORDINATOR, coordinator_at("cell"), "x"), ("r",), ("m",)))


def test_two_who_step_at_once_have_a_step_each() -> None:
    async def operator(centre: Host) -> None:
        first, second = await asyncio.gather(centre.step(), centre.step())
        assert (first, second) == ("go", "come")
        assert centre.recorder.firings == {"go": 1, "come": 1}

    paused(operator)


@pytest.mark.parametrize("after_seconds", [0.0, 0.1, 0.3, 0.5])
def test_a_stop_ends_a_step_that_waits_for_other_hosts_before_it_fires(after_seconds: float) -> None:
    async def operator(centre: Host) -> None:
        assert await centre.step() == "go"
        began = asyncio.get_running_loop().time()
        step = asyncio.create_task(centre.step())
        await asyncio.sleep(after_seconds)
        centre.stop()
        assert await step is None
        assert asyncio.get_running_loop().time() < began + after_seconds + VOTES_SECONDS / 4
        assert centre.recorder.firings == {"go": 1, "come": 0}

    paused(operator)


@pytest.mark.parametrize("after_seconds", [0.0, 0.1, 0.3, 0.5, 4 * UNDER_WAY_SECONDS])  # the last as votes come
def test_a_pause_ends_the_steps_that_were_asked_for_before_and_none_that_is_asked_for_after(
    after_seconds: float,
) -> None:
    async def operator(centre: Host) -> None:
        assert await centre.step() == "go"
        steps = [asyncio.create_task(centre.step()) for _ in range(3)]
        await asyncio.sleep(after_seconds)
        assert centre.pause()
        steps.append(asyncio.create_task(centre.step()))
        assert await asyncio.gather(*steps) == [None, None, None, "come"]
        await asyncio.sleep(2 * VOTES_SECONDS)
        assert centre.recorder.firings == {"go": 1, "come": 1}

    paused(operator)
