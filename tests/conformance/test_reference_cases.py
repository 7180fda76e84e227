"""Every expectation of every reference case, through the public interface.

A key of `expect` is checked by the function of its name here; a key without one fails, so that a case added to
`tests/reference` is tested or noticed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pytest
from support.reference import Case, cases, local

from firable.analysis.report import self_loops
from firable.analysis.spaces.columns import Column
from firable.analysis.spaces.equivalence import isomorphic
from firable.analysis.spaces.reachability import ReachabilityGraph, explore
from firable.analysis.verdicts.behaviour import Behaviour
from firable.analysis.verdicts.commands import entries
from firable.analysis.verdicts.conflicts import ConflictAnalysis, Pair, Steps
from firable.analysis.verdicts.starvation import eager_run, scan, starved
from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.protocol.variant import named
from firable.decompose.splitting.cut import split, unowned
from firable.decompose.splitting.persistence import nonpersistent
from firable.nets.diagnostics import InputError
from firable.nets.net import Arbiter, ArbitrationRule, Marking, Net
from firable.nets.verdict import Status
from firable.semantics.arbitration import per_place_choice
from firable.semantics.complement import complement
from firable.semantics.judgement import judge
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

Names = list[str]
Sets = set[frozenset[str]]


@dataclass(frozen=True)
class Subject:
    """The net of a case, and what is computed of it once."""

    net: Net

    @cached_property
    def graph(self) -> ReachabilityGraph:
        return explore(self.net)

    @cached_property
    def steps(self) -> ReachabilityGraph:
        return explore(self.net, Discipline.STEP)

    @cached_property
    def behaviour(self) -> Behaviour[Column]:
        return Behaviour(self.graph)

    @cached_property
    def player(self) -> Player:
        return Player(self.net)

    @property
    def n_deadlocks(self) -> int:
        return int(self.graph.deadlocks.sum())

    def shown(self, marking: Marking) -> frozenset[str]:
        return frozenset(map(local, self.net.names(marking)))

    def markings(self, graph: ReachabilityGraph) -> Sets:
        return {self.shown(graph.marking(i)) for i in range(graph.n_markings)}

    def fired(self, transitions: tuple[int, ...]) -> frozenset[str]:
        return frozenset(self.net.transitions[t].name for t in transitions)

    def place(self, name: str) -> str:
        return next(place.name for place in self.net.places if local(place.name) == name)

    def arbitrated(self, order: Names, rule: ArbitrationRule) -> Net:
        """The net with an arbiter of this rule for each conflict component, in the order given."""
        arbiters = tuple(
            Arbiter(f"a{c}", tuple(name for name in order if self.net.transition_index[name] in component), rule)
            for c, component in enumerate(self.player.conflicts.components)
        )
        return Net(
            self.net.name, self.net.places, self.net.transitions, self.net.signals, self.net.controllers, arbiters
        )


def sets(rows: list[Names]) -> Sets:
    return set(map(frozenset, rows))


def unordered(pairs: tuple[Pair, ...] | list[Names]) -> Sets:
    return {frozenset(pair) for pair in pairs}


def check_conflicts(subject: Subject, expected: Mapping[str, list[Names]]) -> None:
    found = ConflictAnalysis(subject.graph).effective
    assert unordered(found.by_input) == unordered(expected.get("input", []))
    assert unordered(found.by_output) == unordered(expected.get("output", []))


def check_structural(subject: Subject, expected: Mapping[str, list[Names]]) -> None:
    found = ConflictAnalysis(subject.graph).structural
    assert unordered(found.by_input) == unordered(expected.get("input", []))
    assert unordered(found.by_output) == unordered(expected.get("output", []))


def check_races(subject: Subject, expected: list[Names]) -> None:
    # The data name the order that replays, the gated transition first; a race (t, u) says that t closes a gate of u.
    assert {(u, t) for t, u in ConflictAnalysis(subject.graph).races} == {tuple(pair) for pair in expected}


def check_eager(subject: Subject, expected: Mapping[str, int]) -> None:
    found = {
        "states": subject.steps.n_markings,
        "edges": subject.steps.n_edges,
        "deadlocks": int(subject.steps.deadlocks.sum()),
    }
    assert {key: found[key] for key in expected} == expected


def check_priority(subject: Subject, expected: Mapping[str, Any]) -> None:
    run = eager_run(subject.arbitrated(expected["order"], ArbitrationRule.PRIORITY))
    assert list(map(sorted, run.first(len(expected["fired"])))) == list(map(sorted, expected["fired"]))
    if "starved" in expected:
        assert sorted(starved(run, subject.behaviour.live)) == sorted(expected["starved"])


def check_rotation(subject: Subject, expected: Mapping[str, Any]) -> None:
    run = eager_run(subject.arbitrated(expected["order"], ArbitrationRule.ROTATION))
    assert list(map(sorted, run.first(len(expected["fired"])))) == list(map(sorted, expected["fired"]))
    if "starved" in expected:
        assert sorted(starved(run, subject.behaviour.live)) == sorted(expected["starved"])


def check_per_place(subject: Subject, expected: Mapping[str, Names]) -> None:
    index = subject.net.transition_index
    orders = {place: [index[t] for t in order] for place, order in expected.items() if place != "fired"}
    enabled = subject.player.may_fire(subject.net.initial_marking)
    assert subject.fired(per_place_choice(orders, enabled)) == frozenset(expected["fired"])


def check_signals(subject: Subject, expected: Mapping[str, Any]) -> None:
    full = {local(signal.name): signal.name for signal in subject.net.signals}
    # A signal that no gate reads is none of the net's, and changes nothing.
    valuations = [{full.get(name, name): bool(value) for name, value in of.items()} for of in expected["trace"]]
    fired = scan(subject.net, valuations)
    assert list(map(sorted, fired)) == list(map(sorted, expected["fired"]))
    if "verdict" in expected:
        marking, verdicts = subject.net.initial_marking, []
        for valuation, step in zip(valuations, fired, strict=True):
            verdicts.append(judge(subject.player, marking, valuation).value)
            marking = subject.player.fire(marking, (subject.net.transition_index[name] for name in step))
        assert verdicts == expected["verdict"]


def check_entries(subject: Subject, expected: Mapping[str, Any]) -> None:
    run = [[fired] if isinstance(fired, str) else fired for fired in expected["run"]]
    assert list(entries(subject.net, run, subject.place(expected["place"]))) == expected["at"]


def check_complement(subject: Subject, expected: Mapping[str, Any]) -> None:
    other = complement(subject.net, subject.place(expected["place"]), flip_gates=expected["flip"])
    assert isomorphic(subject.graph, explore(other)) is expected["isomorphic"]


def check_table(subject: Subject, expected: Mapping[str, Names]) -> None:
    assert {row.name: [part.name for part in row.parts] for row in split(subject.net).table} == expected


def check_nonpersistent(subject: Subject, expected: Mapping[str, Names]) -> None:
    assert {part: sorted(by) for part, by in nonpersistent(split(subject.net)).items()} == expected


def decided(holds: bool) -> Status:
    return Status.PROVED if holds else Status.VIOLATED


def check_dist(subject: Subject, expected: Mapping[str, Mapping[str, Any]]) -> None:
    decomposition = split(subject.net)
    for variant, wanted in expected.items():
        found = explore_protocol(decomposition, *named(variant))
        if "refines" in wanted:
            assert found.refines is decided(wanted["refines"]), variant
        if "wrong" in wanted:
            spelled = {frozenset(filter(None, marking.strip("{}").split(","))) for marking in wanted["wrong"]}
            assert {frozenset(map(local, marking)) for marking in found.wrong} == spelled, variant
        if "complete" in wanted:
            assert found.complete.status is decided(wanted["complete"]), variant
        assert not set(wanted) - {"refines", "wrong", "complete"}


CHECKS: dict[str, Callable[[Subject, Any], None]] = {
    "states": lambda subject, expected: equal(subject.graph.n_markings, expected),
    "edges": lambda subject, expected: equal(subject.graph.n_edges, expected),
    "deadlocks": lambda subject, expected: equal(subject.n_deadlocks, expected),
    "dead": lambda subject, expected: equal(sorted(subject.behaviour.dead), sorted(expected)),
    "live": lambda subject, expected: equal(not subject.behaviour.nonlive, expected),
    "nonlive": lambda subject, expected: equal(sorted(subject.behaviour.nonlive), sorted(expected)),
    "reversible": lambda subject, expected: equal(subject.behaviour.reversible, expected),
    "contacts": lambda subject, expected: equal(subject.behaviour.contacts, expected),
    "selfloops": lambda subject, expected: equal(sorted(self_loops(subject.net)), sorted(expected)),
    "unowned": lambda subject, expected: equal(sorted(unowned(subject.net)), sorted(expected)),
    "structural": check_structural,
    "conflicts": check_conflicts,
    "firable_m0": lambda subject, expected: equal(
        subject.fired(subject.player.firable(subject.net.initial_marking)), frozenset(expected)
    ),
    "unreachable": lambda subject, expected: equal(subject.markings(subject.graph) & sets(expected), set()),
    "races": check_races,
    "nonserialisable": lambda subject, expected: equal(
        set(map(frozenset, Steps(subject.steps).nonserialisable)), sets(expected)
    ),
    "eager_fired": lambda subject, expected: equal(
        {subject.fired(fired) for fired, _ in subject.steps.successors(0)}, sets(expected)
    ),
    "eager": check_eager,
    "eager_markings": lambda subject, expected: equal(subject.markings(subject.steps), sets(expected)),
    "priority": check_priority,
    "rotation": check_rotation,
    "per_place": check_per_place,
    "signals": check_signals,
    "entries": check_entries,
    "complement": check_complement,
    "table": check_table,
    "nonpersistent": check_nonpersistent,
    "dist": check_dist,
}


def equal(found: object, expected: object) -> None:
    assert found == expected


def expectations() -> list[Any]:
    return [pytest.param(case, key, id=f"{case}: {key}") for case in cases() for key in case.expect if key != "error"]


@pytest.mark.parametrize(("case", "key"), expectations())
def test_a_reference_case_comes_out_as_expected(case: Case, key: str) -> None:
    assert key in CHECKS, f"no check for the key '{key}'"
    CHECKS[key](Subject(case.net()), case.expect[key])


def refused(case: Case) -> None:
    """Read the net, and split it if it is to be split: some place of it has an owner."""
    net = case.net()
    if any(place.owner for place in net.places):
        split(net)


def malformed() -> list[Case]:
    return [case for case in cases() if case.expect.get("error")]


@pytest.mark.parametrize("case", malformed(), ids=str)
def test_a_malformed_reference_net_is_refused(case: Case) -> None:
    with pytest.raises(InputError) as caught:
        refused(case)
    assert all(diagnostic.hint for diagnostic in caught.value.diagnostics)


def test_each_malformed_reference_net_has_a_code_of_its_own() -> None:
    codes = []
    for case in malformed():
        with pytest.raises(InputError) as caught:
            refused(case)
        codes.append(caught.value.diagnostics[0].code)
    assert len(codes) == len(set(codes)) > 0
