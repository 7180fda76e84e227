"""Commands: what is reported, what is not, and why."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets

from firable.analysis.check import check
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.verdicts.commands import (
    commands_agree,
    completions_apart,
    entries,
    machines_stopped,
    no_command_in_initial_marking,
)
from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.net import Command, ExternalGate, Marking, Net, Place, Signal, SignalKind, Transition
from firable.nets.verdict import Status, Weight, overall
from firable.semantics.player import Player
from firable.semantics.trace import Discipline


def line(*commands: str, machine: str = "M", ring: bool = False) -> Net:
    """A token that goes from `start` through a place for each command, and back where it is a ring."""
    names = ["start", *(f"p{i}" for i in range(len(commands)))]
    places = [Place(names[0], marked=True)]
    places += [Place(name, command=Command(machine, c)) for name, c in zip(names[1:], commands, strict=True)]
    moves = [Transition(f"t{i}", (names[i],), (names[i + 1],)) for i in range(len(commands))]
    if ring:
        moves.append(Transition("again", (names[-1],), (names[0],)))
    return Net("line", tuple(places), tuple(moves))


@pytest.mark.parametrize(
    ("net", "reported"),
    [
        (line("RUN"), ("p0",)),
        (line("RUN", ring=True), ("p0",)),
        (line("RUN", "STOP"), ()),  # STOP ends RUN, and as it comes after RUN it may be the stop
        (line("RUN", "STOP", ring=True), ()),
        (line("RUN", "RUN"), ("p0", "p1")),
        (line(), ()),
    ],
    ids=str,
)
def test_a_command_is_reported_if_no_other_one_ever_follows_or_precedes_it(net: Net, reported: tuple[str, ...]) -> None:
    verdict = machines_stopped(explore(net))
    assert verdict.subjects == reported
    assert verdict.weight is Weight.WARNING
    assert verdict.code == ("F3001" if reported else "")


def test_a_run_that_is_never_stopped_is_reported_beside_one_that_is() -> None:
    places = (
        Place("start", marked=True),
        Place("run", command=Command("M", "RUN")),
        Place("stop", command=Command("M", "STOP")),
        Place("jog", command=Command("M", "JOG")),
    )
    moves = (
        Transition("a", ("start",), ("run",)),
        Transition("b", ("run",), ("stop",)),
        Transition("c", ("start",), ("jog",)),
    )
    assert machines_stopped(explore(Net("n", places, moves))).subjects == ("jog",)


@pytest.mark.parametrize("name", [n for n in catalogue_names() if "conceptual" not in n and "robot" in n])
def test_of_the_cells_machines_only_the_outgoing_conveyor_is_never_stopped(name: str) -> None:
    assert machines_stopped(explore(catalogue_net(name))).subjects == ("conveyor.cv2_run",)


@pytest.mark.parametrize("name", reference_names())
def test_no_reference_net_sends_conflicting_commands(name: str) -> None:
    assert commands_agree(explore(load_net(name))).holds


def places_of(net: Net) -> dict[str, Command]:
    return {place.name: place.command for place in net.places if place.command is not None}


@examples(75)
@given(ring_nets(commands=True), st.sampled_from(Discipline))
def test_verdicts_on_commands_are_those_of_the_definitions(net: Net, discipline: Discipline) -> None:
    sent, graph = places_of(net), Player(net).reachable(step=discipline is Discipline.STEP)
    clashes = [
        (p, q)
        for marking in graph
        for p in set(net.names(marking)) & set(sent)
        for q in set(net.names(marking)) & set(sent)
        if sent[p].machine == sent[q].machine and sent[p] != sent[q]
    ]
    explored = explore(net, discipline)
    verdict = commands_agree(explored)
    assert set(verdict.subjects) == {place for pair in clashes for place in pair}
    assert verdict.code == ("F3003" if clashes else "")

    def entered(before: Marking, after: Marking) -> set[str]:
        return set(net.names(after & ~before)) & set(sent)

    def after(start: Marking) -> set[str]:
        seen, todo, found = {start}, [start], set()
        while todo:
            marking = todo.pop()
            for _, target in graph[marking]:
                found |= entered(marking, target)
                if target not in seen:
                    seen.add(target)
                    todo.append(target)
        return found

    follows = {(p, q) for m, edges in graph.items() for _, to in edges for p in entered(m, to) for q in after(to)}
    ever = {p for m, edges in graph.items() for _, to in edges for p in entered(m, to)}

    def answered(p: str) -> bool:
        same = {r for r in sent if (sent[r].machine, sent[r].command) == (sent[p].machine, sent[p].command)}
        others = {q for q in sent if sent[q].machine == sent[p].machine and sent[q].command != sent[p].command}
        return any((a, b) in follows or (b, a) in follows for a in same for b in others)

    commands = {(sent[p].machine, sent[p].command) for p in ever if not answered(p)}
    expected = {p for p in sent if (sent[p].machine, sent[p].command) in commands}
    assert set(machines_stopped(explored).subjects) == expected


def test_a_token_on_a_command_place_in_m0_warns_and_does_not_fail() -> None:
    net = Net("n", (Place("p", marked=True, command=Command("M", "RUN")),), (Transition("t"),))
    verdict = no_command_in_initial_marking(explore(net))
    assert (verdict.status, verdict.code, verdict.subjects) == (Status.VIOLATED, "F3002", ("p",))
    assert overall([verdict]) is Status.PROVED


def test_each_entry_is_counted_and_the_token_of_m0_is_none() -> None:
    net = line("RUN", ring=True)
    assert entries(net, [["t0"], ["again"], ["t0"]], "p0") == ("t0", "t0")
    assert entries(net, [["t0"], ["again"]], "start") == ("again",)
    assert entries(net, [], "start") == ()


def test_a_cut_off_graph_still_shows_a_machine_with_one_command_and_nothing_more() -> None:
    one, two = line(*["RUN"] * 9), line(*["RUN", "STOP"] * 5)
    assert machines_stopped(explore(one, budget=Budget(markings=3))).status is Status.VIOLATED
    assert machines_stopped(explore(two, budget=Budget(markings=3))).status is Status.UNKNOWN
    assert check(two, budget=Budget(markings=3), method="explicit").status is Status.UNKNOWN


def shared(*, together: bool) -> Net:
    """Arm and clamp, told by one completion signal; at work at the same time, or one after the other."""
    arm = Place("arm", command=Command("ARM", "MOVE"), completion="done")
    clamp = Place("clamp", command=Command("CLAMP", "CLOSE"), completion="done")
    done = (ExternalGate("done"),)
    start: tuple[Transition, ...]
    if together:
        start = (Transition("start", ("idle",), ("arm", "clamp")),)
        end = (Transition("end", ("arm", "clamp"), ("idle",), external=done),)
    else:
        start = (Transition("start", ("idle",), ("arm",)), Transition("next", ("arm",), ("clamp",), external=done))
        end = (Transition("end", ("clamp",), ("idle",), external=done),)
    places = (Place("idle", marked=True), arm, clamp)
    return Net("shared", places, (*start, *end), (Signal("done", kind=SignalKind.COMPLETION),))


@pytest.mark.parametrize("discipline", Discipline)
def test_a_completion_awaited_by_two_commands_at_once_is_violated_with_the_firings(discipline: Discipline) -> None:
    verdict = completions_apart(explore(shared(together=True), discipline))
    assert (verdict.status, verdict.weight, verdict.code) == (Status.VIOLATED, Weight.REQUIRED, "F3005")
    assert verdict.subjects == ("arm", "clamp")
    assert verdict.witness is not None
    assert verdict.witness.firings == (("start",),)


def test_commands_that_take_turns_may_share_a_completion() -> None:
    assert completions_apart(explore(shared(together=False))).status is Status.PROVED


def test_a_shared_completion_is_unknown_where_the_budget_ends_first() -> None:
    verdict = completions_apart(explore(shared(together=False), budget=Budget(markings=1)))
    assert verdict.status is Status.UNKNOWN
