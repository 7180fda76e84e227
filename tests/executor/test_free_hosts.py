"""Hosts of a cell of which parts are free of promise: traces join, and who is halted obeys no order on votes."""

import asyncio
from collections import Counter
from pathlib import Path
from unittest.mock import ANY, Mock

import pytest
from support.free_parts import freed
from support.hosts import ALL_IN_ONE, ONE_EACH, TOGETHER, Cell

from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.journal.journal import MemoryJournal
from firable.executor.operating.acts import Acts
from firable.executor.operating.items import CommandTaken
from firable.executor.operating.recorder import Recorder
from firable.executor.protocol.messages import Acknowledgement, Decision, Report, Sending
from firable.nets.decomposition import Decomposition
from firable.nets.net import Command, Controller, Net, Place, Transition
from firable.semantics.joining import APPLIED, STANDS
from firable.semantics.trace import CommandSent, Noted, read_trace

CONVEYOR = ("conveyor",)


@pytest.mark.parametrize("of", [ONE_EACH, TOGETHER, ALL_IN_ONE], ids=["one each", "together", "all in one"])
def test_hosts_with_free_parts_run_a_cell_and_their_traces_join_to_one_of_the_net(
    of: tuple[tuple[str, ...], ...], tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, of, free=True)
        await asyncio.sleep(60)
        await cell.stop()
        assert cell.replayed().firings == cell.firings() > 50

    run_in_virtual_time(main())


@pytest.mark.parametrize("after", [3.0, 5.1, 6.0])
@pytest.mark.parametrize("dies", ONE_EACH, ids=lambda machines: machines[0] or "coordinator")
def test_a_host_with_free_parts_that_is_killed_and_started_anew_loses_and_doubles_nothing(
    dies: tuple[str, ...], after: float, tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, free=True)
        await asyncio.sleep(after)
        await cell.kill(dies)
        await asyncio.sleep(5)
        cell.start(dies)
        await asyncio.sleep(5)
        stood = cell.firings()
        assert cell.hosts[dies].resume()
        await asyncio.sleep(60)
        await cell.stop()
        assert cell.replayed().firings > stood + 30

    run_in_virtual_time(main())


# --- One host with the controller `b`, and a coordinator elsewhere


def _net() -> Net:
    """`G` takes a token of `a` and one of `b`, and commands a machine of `b`, whose end nobody awaits."""
    machine = Command("M", "GO")
    places = (
        Place("a.p", "a", marked=True),
        Place("a.q", "a"),
        Place("b.p", "b", marked=True),
        Place("b.q", "b", command=machine),
    )
    return Net(
        "n",
        places,
        (Transition("G", ("a.p", "b.p"), ("a.q", "b.q")), Transition("H", ("a.q", "b.q"), ("a.p", "b.p"))),
        controllers=(Controller("a"), Controller("b")),
    )


class OneHost:
    """The acts of the host of `b`, and what they told; every part is free of promise."""

    def __init__(self) -> None:
        self.decomposition: Decomposition = freed(split(_net()))
        assert set(self.decomposition.free) == {(t, c) for t in "GH" for c in "ab"}
        recorder = Recorder(_net(), "", None, machines=("b",))
        self.noted: list[str] = []
        recorder.observers.append(lambda event: self.noted.append(event.note) if isinstance(event, Noted) else None)
        self.left: list[tuple[str, str]] = []
        self.acts = Acts(
            self.decomposition,
            ("b",),
            MemoryJournal(),
            recorder,
            None,
            lambda: None,
            lambda controller, transition: self.left.append((controller, transition)),
            Counter(),
        )
        self.acts.start()

    def leaving(self) -> list[object]:
        self.acts.group()
        assert self.acts.commit() == []  # it is kept in memory
        self.acts.stored()
        return list(self.acts.let_go())

    def order(self, number: int, transition: str, epoch: int = 0) -> None:
        self.acts.hear("b", Decision("b", number, transition, 0, -1, epoch))

    @property
    def marking(self) -> tuple[str, ...]:
        controller = self.acts.controllers["b"]
        return controller.subnet.names(controller.marking)


def test_a_halted_host_obeys_no_order_on_votes_that_stand_until_it_goes_on() -> None:
    host = OneHost()
    assert any(isinstance(each, Report) and each.readiness.transitions == {"G"} for each in host.leaving())
    host.acts.halted = True
    host.order(0, "G")
    host.order(0, "G")  # it is repeated, as nobody acknowledges it
    assert host.leaving() == []
    assert host.marking == ("b.p",)
    host.acts.go_on()
    left = host.leaving()
    assert [each.place for each in left if isinstance(each, Sending)] == ["b.q"]
    assert any(isinstance(each, Acknowledgement) for each in left)
    assert host.marking == ("b.q",)


@pytest.mark.parametrize("is_told", [True, False], ids=["told before", "started anew"])
def test_a_vote_that_is_said_again_to_a_new_epoch_before_its_order_is_obeyed_is_no_new_one(is_told: bool) -> None:
    """The first that a restarted coordinator is heard to say may be an order; of two votes one would seem unused."""
    host = OneHost()
    host.leaving()
    assert host.noted == [STANDS]
    if not is_told:
        host.acts.standing["b"].clear()
    host.order(0, "G", epoch=1)
    said = [each.readiness.transitions for each in host.leaving() if isinstance(each, Report | Acknowledgement)]
    assert said == [{"G"}, frozenset()]
    assert host.noted == [STANDS, APPLIED]


def test_the_firing_of_a_free_part_gives_up_what_its_tokens_leave_behind() -> None:
    host = OneHost()
    host.leaving()
    host.order(0, "G")
    (sending,) = (each for each in host.leaving() if isinstance(each, Sending))
    assert host.left == [("b", "G")]
    host.acts.hear("b", CommandTaken(sending.place, sending.entry))
    host.leaving()
    host.order(1, "H")
    host.order(1, "H")  # a copy fires nothing, and leaves nothing behind
    host.leaving()
    assert host.left == [("b", "G"), ("b", "H")]


@pytest.mark.parametrize("after", [2.1, 8.1, 12.1])
@pytest.mark.parametrize("how", ["paused", "emergency stop", "stopped by the operator"])
def test_nothing_is_commanded_at_a_host_that_is_halted_or_stops(how: str, after: float, tmp_path: Path) -> None:
    """The others decide on what the conveyor has said before: a pause lets that wait, and an end obeys it."""
    given: list[str] = []

    async def main() -> None:
        cell = Cell(tmp_path, free=True)
        await asyncio.sleep(after)
        host = cell.hosts[CONVEYOR]
        host.driver.send = Mock(side_effect=lambda place, _: given.append(place.name))  # type: ignore[method-assign]
        if how == "paused":
            host.pause()
        elif how == "emergency stop":
            host.emergency_stop("a person in the cell")
        else:
            host.stop()
        await asyncio.sleep(1.9)
        assert how != "paused" or any(isinstance(message, Decision) for message in host.acts.withheld.values())
        ended = await cell.stop()
        assert [each.message for each in ended.values()] == ["" if how != "emergency stop" else ANY] * len(ended)

    run_in_virtual_time(main())
    assert given == []
    events = read_trace(tmp_path / "conveyor.trace").events
    notes = [event.note if isinstance(event, Noted) else "" for event in events]
    since = notes.index(how)
    assert APPLIED in notes[:since]
    assert how != "paused" or APPLIED not in notes[since : notes.index("stopped by the operator")]
    issued = [event.place for event in events[since:] if isinstance(event, CommandSent)]
    assert issued == [e.data["place"] for e in events[since:] if isinstance(e, Noted) and e.note == "kept back"]


def test_what_a_halted_host_was_told_is_applied_when_it_goes_on(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, free=True)
        await asyncio.sleep(5.1)
        cell.hosts[CONVEYOR].pause()
        await asyncio.sleep(10)
        stood = cell.firings()
        cell.hosts[CONVEYOR].resume()
        await asyncio.sleep(30)
        await cell.stop()
        assert cell.replayed().firings > stood + 10

    run_in_virtual_time(main())
