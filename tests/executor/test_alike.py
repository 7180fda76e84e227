"""Controllers that take part alike are not told apart by a coordinator, and so not by its exploration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import combinations

import pytest
from support.alone_acts import decomposition_of, group_of

from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import TOP
from firable.executor.protocol.messages import Effect, Firing, Keep, Sending, Taken, ToCoordinator
from firable.executor.simulation.deciding import Deciding, in_order
from firable.executor.simulation.exploring import explore
from firable.executor.simulation.repertoire import Budget
from firable.executor.simulation.snapshots import clone, frozen

CRASH = Budget(crashes=1)


def exchanged(machine: Coordinator, one: str, other: str) -> Coordinator:
    """A coordinator that knows of each of two controllers what it knew of the other one."""
    called = {one: other, other: one}
    made = clone(machine)
    made.ready = {c: machine.ready[called.get(c, c)] for c in made.ready}
    made.seen = {c: machine.seen[called.get(c, c)] for c in made.seen}
    made.lately = {c: machine.lately[called.get(c, c)] for c in made.lately}
    for opened in made.rounds.values():
        opened.acknowledged = {called.get(c, c) for c in opened.acknowledged}
        opened.votes = {called.get(c, c): vote for c, vote in opened.votes.items()}
    return made


def known(machine: Coordinator) -> object:
    """All that a coordinator knows, whoever voted first: nothing goes by that, and it forgets it."""
    for opened in machine.rounds.values():
        opened.votes = dict(sorted(opened.votes.items()))
    return frozen(machine)


def said(effects: list[Effect], one: str = "", other: str = "") -> set[Effect]:
    """What was said, if two controllers were each the other one."""
    called = {one: other, other: one}
    return {
        effect
        if isinstance(effect, Firing | Keep | Sending | Taken)
        else replace(effect, controller=called.get(effect.controller, effect.controller))
        for effect in effects
    }


@cache
def explored(cell: str, t: str) -> Deciding:
    """The coordinator of a cell explored to the end about the group of a transition; only looked at and copied.

    With a crash where the group is small.
    """
    decomposition = decomposition_of(cell)
    explorer = Deciding(decomposition, TOP, group_of(decomposition, t))
    assert explore(explorer, CRASH if cell == "one_robot" else Budget()).complete
    return explorer


def met(explorer: Deciding) -> Iterator[tuple[Coordinator, ToCoordinator]]:
    """Coordinators that an exploration has met, with nothing of other groups, and everything that may arrive."""
    for number in sorted(n for n in explorer.reached if isinstance(explorer.machine(n), Coordinator)):
        machine = explorer.coordinator(explorer.spread_out(number))
        for message in explorer.hearing.messages(machine):
            yield machine, message


def hold_alike(explorer: Deciding, of: type[Coordinator] = Coordinator) -> int:
    """Hold what follows from each message to what does where two controllers that are alike are exchanged.

    Of the machines met, as one of `of` would do it. Returns how many were held.
    """
    count = 0
    for machine, message in met(explorer):
        for alike in explorer.hearing.alike:
            for one, other in combinations(alike, 2):
                first, second = clone(machine), exchanged(machine, one, other)
                first.__class__ = second.__class__ = of
                told = {one: other, other: one}.get(message.controller, message.controller)
                effects, then = first.receive(message), second.receive(replace(message, controller=told))
                first.__class__ = second.__class__ = Coordinator
                assert known(exchanged(first, one, other)) == known(second), f"{one} is not known as {other} would be"
                assert said(effects, one, other) == said(then), f"{one} is not answered as {other} would be"
                count += 1
    return count


@pytest.mark.parametrize(("cell", "t", "alike"), [("one_robot", "G4", 2), ("free two_robots_shared", "G5", 3)])
def test_whatever_arrives_a_coordinator_does_not_tell_controllers_apart_that_take_part_alike(
    cell: str, t: str, alike: int
) -> None:
    explorer = explored(cell, t)
    assert [len(names) for names in explorer.hearing.alike] == [alike]
    assert hold_alike(explorer) > 1000


def test_whatever_is_forgotten_between_configurations_is_found_out_again() -> None:
    decomposition = decomposition_of("one_robot")
    spaces, met = [], []
    for most in (10, 1_000_000):
        explorer = Deciding(decomposition, TOP, group_of(decomposition, "G4"))
        explorer.passing_max = most
        spaces.append(explore(explorer))
        met.append(explorer.met)
    assert spaces[0] == spaces[1]
    assert met[0] > met[1], "what was forgotten is met again"


def test_a_coordinator_that_prefers_a_controller_is_found() -> None:
    class Prefers(Coordinator):
        def receive(self, message: ToCoordinator) -> list[Effect]:
            asked = [n for n, opened in self.rounds.items() if not opened.decided]
            return [] if message.controller == "mc" and asked else super().receive(message)

    explorer = explored("one_robot", "G4")
    with pytest.raises(AssertionError, match="is not answered as"):
        hold_alike(explorer, of=Prefers)


@pytest.mark.parametrize(("cell", "t"), [("one_robot", "G4"), ("free two_robots_shared", "G5")])
def test_those_that_are_alike_come_in_one_order_whoever_of_them_is_known_for_what(cell: str, t: str) -> None:
    explorer = explored(cell, t)
    (alike,) = explorer.hearing.alike
    different = 0
    for machine in {id(machine): machine for machine, _ in met(explorer)}.values():
        ordered = clone(machine)
        in_order(ordered, alike)
        for one, other in combinations(alike, 2):
            again = exchanged(machine, one, other)
            different += known(clone(again)) != known(clone(machine))
            in_order(again, alike)
            assert {c: again.ready[c] for c in alike} == {c: ordered.ready[c] for c in alike}
            assert frozen(list(again.rounds.values())) == frozen(list(ordered.rounds.values()))
    assert different > 20
