"""Every verdict of `check` against its definition, played out by the reference player on small generated nets."""

from __future__ import annotations

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.reference import cases
from support.ring_nets import ring_nets

from firable.analysis.check import check
from firable.analysis.report import CheckReport, report_on
from firable.analysis.spaces.reachability import Budget, IncompleteGraph, explore
from firable.analysis.verdicts.conflicts import Steps
from firable.nets.net import Marking, Net, Place, Transition
from firable.nets.verdict import Status, Witness
from firable.semantics.conflict import gate_races, jointly_openable
from firable.semantics.player import FiringSet, Player
from firable.semantics.trace import Discipline

Graph = dict[Marking, list[tuple[FiringSet, Marking]]]
DISCIPLINES = st.sampled_from(Discipline)
NETS = st.one_of(dense_nets(signals=True), ring_nets(signals=True), ring_nets())


def closure(graph: Graph, start: Marking) -> set[Marking]:
    """The markings reachable from one, itself included."""
    seen, todo = {start}, [start]
    while todo:
        for _, target in graph[todo.pop()]:
            if target not in seen:
                seen.add(target)
                todo.append(target)
    return seen


def distance(graph: Graph, start: Marking, targets: set[Marking]) -> int:
    """The length of a shortest firing sequence to a target."""
    level, seen, steps = {start}, {start}, 0
    while not level & targets:
        level = {target for marking in level for _, target in graph[marking]} - seen
        seen |= level
        steps += 1
        assert level, "no target can be reached"
    return steps


def always_ends(graph: Graph) -> set[Marking]:
    """The markings all of whose runs end in a deadlock, as the least fixpoint."""
    ends: set[Marking] = set()
    while more := {m for m, edges in graph.items() if m not in ends and all(target in ends for _, target in edges)}:
        ends |= more
    return ends


def played(player: Player, witness: Witness, *, step: bool) -> Marking:
    """The marking that the witness ends in, found by the successors of the player alone."""
    marking = player.net.initial_marking
    for names in witness.firings:
        label = tuple(sorted(player.net.transition_index[name] for name in names))
        marking = dict(player.successors(marking, step=step))[label]
    assert player.net.names(marking) == witness.marking
    return marking


class Truth:
    """What the definitions say of a net, by brute force."""

    def __init__(self, net: Net, discipline: Discipline) -> None:
        self.net, self.step = net, discipline is Discipline.STEP
        self.player = Player(net)
        self.graph: Graph = self.player.reachable(step=self.step)
        self.reach = {marking: closure(self.graph, marking) for marking in self.graph}
        self.report: CheckReport = check(net, discipline)

    def names(self, transitions: list[int]) -> tuple[str, ...]:
        return tuple(self.net.transitions[t].name for t in transitions)

    def shortest(self, name: str, targets: set[Marking]) -> None:
        """The verdict is violated with a shortest witness into the targets if there are any, else proved."""
        verdict = self.report.verdict(name)
        assert verdict.status is (Status.VIOLATED if targets else Status.PROVED)
        if targets:
            assert verdict.witness is not None
            assert played(self.player, verdict.witness, step=self.step) in targets
            assert len(verdict.witness.firings) == distance(self.graph, self.net.initial_marking, targets)


@examples(125)
@given(NETS, DISCIPLINES)
def test_figures_and_witnesses_are_those_of_the_definitions(net: Net, discipline: Discipline) -> None:
    truth = Truth(net, discipline)
    graph, reach, player, report = truth.graph, truth.reach, truth.player, truth.report
    figures, indexes = report.figures, range(len(net.transitions))
    assert figures.complete
    assert figures.markings == len(graph)
    assert figures.edges == sum(map(len, graph.values()))

    in_contact = {t: {m for m in graph if t in player.in_contact(m)} for t in indexes}
    assert figures.contacts == {net.transitions[t].name: len(ms) for t, ms in in_contact.items() if ms}
    truth.shortest("contact-free", set().union(*in_contact.values()))

    deadlocks = {m for m, edges in graph.items() if not edges}
    assert figures.deadlocks == len(deadlocks)
    truth.shortest("deadlock-free", deadlocks)

    doomed = always_ends(graph)
    assert figures.doomed == len(doomed)
    truth.shortest("doomed-markings", doomed)

    enabling = {t: {m for m in graph if t in player.may_fire(m)} for t in indexes}
    dead = [t for t in indexes if not enabling[t]]
    assert figures.dead == truth.names(dead) == report.verdict("quasi-live").subjects
    lost = {t: {m for m in graph if not reach[m] & enabling[t]} for t in indexes}
    nonlive = [t for t in indexes if lost[t]]
    assert figures.nonlive == truth.names(nonlive) == report.verdict("live").subjects
    shown = [t for t in nonlive if t not in dead] or nonlive
    truth.shortest("live", lost[shown[0]] if shown else set())

    stranded = {m for m in graph if net.initial_marking not in reach[m]}
    assert figures.reversible == (not stranded)
    truth.shortest("reversible", stranded)
    home = {m for m in graph if all(m in reach[other] for other in graph)}
    assert figures.home == len(home)
    sinks = {m for m in graph if all(m in reach[other] for other in reach[m])}
    truth.shortest("home-markings", set() if home else sinks)


@examples(125)
@given(NETS, DISCIPLINES)
def test_conflicts_and_races_are_those_of_the_definitions(net: Net, discipline: Discipline) -> None:
    truth = Truth(net, discipline)
    player, figures = truth.player, truth.report.figures
    for attribute, sides in (
        ("by_input", [t.inputs for t in net.transitions]),
        ("by_output", [t.outputs for t in net.transitions]),
    ):
        structural = {(t, u) for t, u in combinations(range(len(sides)), 2) if set(sides[t]) & set(sides[u])}
        effective = {
            (t, u)
            for t, u in structural
            if jointly_openable(net, (t, u)) and any({t, u} <= set(player.firable(m)) for m in truth.graph)
        }
        assert set(getattr(figures.structural_conflicts, attribute)) == {truth.names(list(p)) for p in structural}
        assert figures.effective_conflicts is not None
        assert set(getattr(figures.effective_conflicts, attribute)) == {truth.names(list(p)) for p in effective}
    assert figures.gate_races is not None
    assert set(figures.gate_races) == {truth.names(list(pair)) for pair in gate_races(net)}
    if discipline is Discipline.INTERLEAVING:
        assert figures.nonserialisable is None
        return
    unordered = {
        truth.names(list(fired)): marking
        for marking, edges in truth.graph.items()
        for fired, _ in edges
        if not any_order_replays(player, marking, fired)
    }
    assert set(figures.nonserialisable or ()) == set(unordered)
    places = {m for m, edges in truth.graph.items() for f, _ in edges if not any_order_replays(player, m, f)}
    truth.shortest("steps-serialisable", places)


def any_order_replays(player: Player, marking: Marking, fired: FiringSet) -> bool:
    """Whether some order of single firings replays the step, by trying them all."""
    return not fired or any(
        t in player.may_fire(marking)
        and any_order_replays(player, player.fire(marking, (t,)), tuple(u for u in fired if u != t))
        for t in fired
    )


@pytest.mark.parametrize("discipline", Discipline)
def test_an_isolated_transition_fires_for_ever_so_nothing_is_doomed(discipline: Discipline) -> None:
    case = next(case for case in cases() if case.id == "c02")
    assert check(case.net(), discipline).figures.doomed == 0


def test_the_note_of_a_contact_names_the_full_places_outside_the_inputs() -> None:
    places = tuple(Place(name, marked=name != "r") for name in "pqr")
    verdict = check(Net("n", places, (Transition("t", ("p",), ("p", "q", "r")),))).verdict("contact-free")
    assert verdict.witness is not None
    assert verdict.witness.note == "the inputs of t are there and q is full"


@pytest.mark.parametrize("discipline", Discipline)
def test_two_transitions_that_close_each_others_gates_make_a_step_without_an_order(discipline: Discipline) -> None:
    places = tuple(Place(name, marked=name in "ab") for name in "abxy")
    swap = (Transition("t", ("a",), ("x",), ("b",)), Transition("u", ("b",), ("y",), ("a",)))
    report = check(Net("swap", places, swap), discipline)
    assert report.figures.gate_races == (("t", "u"), ("u", "t"))
    if discipline is Discipline.STEP:
        assert report.figures.nonserialisable == (("t", "u"),)
        assert report.verdict("steps-serialisable").subjects == ("t + u",)
    else:
        with pytest.raises(KeyError):
            report.verdict("steps-serialisable")


def test_nothing_is_concluded_on_steps_from_a_part_of_the_graph() -> None:
    places = tuple(Place(name, marked=name in "ab") for name in "abxyz")
    late = (
        Transition("t", ("x",), ("z",), ("y",)),
        Transition("u", ("y",), (), ("x",)),
        Transition("v", ("a",), ("x",)),
        Transition("w", ("b",), ("y",)),
    )
    net = Net("late", places, late)
    part = explore(net, Discipline.STEP, Budget(markings=1))
    assert not part.complete
    with pytest.raises(IncompleteGraph):
        _ = Steps(part).nonserialisable
    report = report_on(part)
    assert report.figures.nonserialisable is None
    assert report.verdict("steps-serialisable").status is Status.UNKNOWN
    assert check(net, Discipline.STEP).figures.nonserialisable == (("t", "u"),)
