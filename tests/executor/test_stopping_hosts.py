"""Four hosts are stopped in every order while one of them freezes or is killed: all end, and a restart goes on."""

from __future__ import annotations

import asyncio
from itertools import permutations
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from support.examples import some
from support.hosts import Cell, ended_within

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.links.link import COORDINATOR, Arrival
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.stopping import SETTLE_SECONDS
from firable.executor.protocol.messages import Message
from firable.nets.net import Place

SYSTEM = ("system", COORDINATOR)
FOUR = (SYSTEM, ("robot",), ("mc",), ("conveyor",))
LEASES_SECONDS = (1.0, 1.0, 3.0)
"""Which a link takes to notice that a host is frozen: before the others have waited long enough, or after."""
BEGUN_SECONDS = (2.1, 5.1, 5.98, 8.15)
PAUSES_SECONDS = (0.0, 0.003, 0.4, 1.3)


class Machines(DryRunDriver):
    """Machines that must not be given anything once they are stopped."""

    def send(self, place: Place, entry: int) -> None:
        assert not self.is_stopped, f"{place.name} is commanded after the stop"
        super().send(place, entry)


class Frozen:
    """A host whose process stands still: what it is told waits, and what it says is said when it goes on.

    It is alone meanwhile, so whether it acts then or later nobody can tell.
    """

    def __init__(self, cell: Cell, machines: tuple[str, ...], lease_seconds: float) -> None:
        self.link, self.exchange = cell.links[machines], cell.exchange
        assert self.link.listener is not None
        self.listener, self.send = self.link.listener, self.link.send
        self.heard: list[Arrival] = []
        self.said: list[tuple[str, str, Message]] = []
        self.link.listener = self
        self.standing = patch.object(self.link, "send", lambda *said: self.said.append(said))
        self.standing.start()
        asyncio.get_running_loop().call_later(lease_seconds, self.exchange.cut, self.link)

    def arrived(self, *heard: Any) -> None:
        self.heard.append(heard)

    def thaw(self) -> None:
        """It goes on: with what it was about to say, and with what has come meanwhile."""
        self.link.listener = self.listener
        self.standing.stop()
        self.exchange.mend(self.link)
        for said in self.said:
            self.send(*said)
        for heard in self.heard:
            self.listener.arrived(*heard)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.listener, name)  # that a peer is lost it would be told, too


class Site(Cell):
    """The cell on four hosts."""

    def start(self, machines: tuple[str, ...], shown: Any = None, **options: Any) -> None:
        super().start(machines, shown, **options)
        subnets = [subnet for subnet in self.decomposition.subnets if subnet.name in machines]
        self.hosts[machines].driver = Machines(subnets, self.seconds)


def is_open(cell: Cell, name: str) -> bool:
    """Whether an order for a controller is decided, and not known to be obeyed."""
    coordinator = cell.hosts[SYSTEM].coordinators[COORDINATOR]
    return any(
        opened.committed is not None and name in coordinator.ordered(opened) and name not in opened.acknowledged
        for opened in coordinator.rounds.values()
    )


async def stopped_in_time(cell: Cell, machines: tuple[str, ...]) -> Situation:
    situation = await ended_within(cell.tasks[machines], SETTLE_SECONDS + 0.5)
    driver = cell.hosts[machines].driver
    assert isinstance(driver, Machines)
    assert driver.is_stopped
    assert situation.state is State.STOPPED
    return situation


async def tried(folder: Path, victim: tuple[str, ...], how: str, order: tuple[tuple[str, ...], ...], i: int) -> None:
    """All hosts are stopped in this order; the turn of one of them is when it freezes, or is killed."""
    cell = Site(folder, FOUR, free=i % 2 == 0)
    await asyncio.sleep(BEGUN_SECONDS[i % 4])
    frozen, ends = None, dict[tuple[str, ...], asyncio.Task[Situation]]()
    for machines in order:
        if machines != victim:
            cell.hosts[machines].stop()
            ends[machines] = asyncio.create_task(stopped_in_time(cell, machines))
        elif how == "killed":
            await cell.kill(victim)
        else:
            frozen = Frozen(cell, victim, LEASES_SECONDS[i % 3])
        await asyncio.sleep(PAUSES_SECONDS[i // 4 % 4])
    for machines, ending in ends.items():
        situation = await ending
        if not situation.message and victim != SYSTEM:
            assert not any(is_open(cell, name) for name in machines if name), f"{machines} has left something open"
    if frozen is not None:
        frozen.thaw()
        cell.hosts[victim].stop()  # the request has waited for it
        await stopped_in_time(cell, victim)
    stood = cell.firings()
    for machines in FOUR:
        cell.start(machines, resume=True)
    await asyncio.sleep(40)
    ended = await cell.stop()
    assert {situation.message for situation in ended.values()} == {""}
    assert cell.replayed().firings > stood + 15


@pytest.mark.seeds
@pytest.mark.parametrize("how", ["frozen", "killed"])
@pytest.mark.parametrize("victim", FOUR, ids=lambda machines: machines[0])
def test_hosts_stopped_in_any_order_end_in_time_while_one_is_gone_and_lose_nothing(
    victim: tuple[str, ...], how: str, tmp_path: Path
) -> None:
    for i, order in some(enumerate(permutations(FOUR)), 2):
        folder = tmp_path / str(i)
        folder.mkdir()
        run_in_virtual_time(tried(folder, victim, how, order, i))
