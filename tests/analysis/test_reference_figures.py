"""Every figure that the reference data expect of one net, through the public API."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import pytest
from support.reference import Case, cases, load_net, local

from firable.analysis.check import check
from firable.analysis.report import report_on
from firable.analysis.spaces.equivalence import isomorphic
from firable.analysis.spaces.reachability import ReachabilityGraph, explore
from firable.analysis.verdicts.behaviour import Behaviour
from firable.analysis.verdicts.commands import entries
from firable.analysis.verdicts.starvation import eager_run, scan, starved
from firable.nets.net import Arbiter, ArbitrationRule, Net
from firable.semantics.arbitration import per_place_choice
from firable.semantics.complement import complement
from firable.semantics.conflict import conflicts
from firable.semantics.judgement import judge
from firable.semantics.player import Player

ELSEWHERE = {"error", "table", "dist", "nonpersistent"}
"""Keys that are the matter of another room."""

TABLE = {
    "conceptual1": (14, 23, 0, 0),
    "conceptual1_mc_late": (18, 29, 1, 4),
    "cell1": (40, 70, 0, 0),
    "cell1_mc_late": (76, 154, 1, 36),
    "cell1_mc_late_cap": (40, 70, 0, 0),
    "cell2_shared": (68, 136, 0, 0),
    "cell2_separate": (68, 136, 0, 0),
}
"""Markings, edges, deadlocks and doomed markings of the example cells."""

LIVE = {"conceptual1", "cell1", "cell1_mc_late_cap", "cell2_shared", "cell2_separate"}


@pytest.mark.parametrize("name", TABLE)
def test_the_cells_have_the_figures_of_the_semantics(name: str) -> None:
    figures = check(load_net(name)).figures
    assert (figures.markings, figures.edges, figures.deadlocks, figures.doomed) == TABLE[name]
    assert figures.live == (name in LIVE)
    assert figures.reversible == (name in LIVE)
    assert figures.contacts == {}


def test_the_one_robot_cell_has_no_effective_conflict_and_the_late_variant_has_one() -> None:
    safe, late = check(load_net("cell1")).figures, check(load_net("cell1_mc_late")).figures
    assert safe.effective_conflicts is not None
    assert late.effective_conflicts is not None
    assert safe.structural_conflicts is not None
    assert safe.structural_conflicts.by_input == (("G2", "G6"),)
    assert safe.effective_conflicts.all == ()
    assert late.effective_conflicts.all == (("G2", "G6"),)


def test_the_two_robot_cells_have_no_conflict_even_structurally() -> None:
    for name in ("cell2_shared", "cell2_separate"):
        conflicts = check(load_net(name)).figures.structural_conflicts
        assert conflicts is not None
        assert conflicts.all == ()


def test_the_capacity_place_restores_exactly_the_safe_markings() -> None:
    late, capped = explore(load_net("cell1_mc_late")), explore(load_net("cell1_mc_late_cap"))
    doomed = Behaviour(late).doomed
    safe = {frozenset(late.names(i)) for i in range(late.n_markings) if not doomed[i]}
    places = set(late.net.place_index)
    assert len(safe) == 40
    assert {frozenset(capped.names(i)) & places for i in range(capped.n_markings)} == safe


def with_arbiters(net: Net, order: Iterable[str], by: ArbitrationRule) -> Net:
    """The net with one arbiter for each of its conflict components, in one order over all transitions."""
    order = list(order)
    arbiters = []
    for c, component in enumerate(conflicts(net).components):
        members = {net.transitions[t].name for t in component}
        arbiters.append(Arbiter(f"a{c}", tuple(name for name in order if name in members), by))
    return replace(net, arbiters=tuple(arbiters))


class Expectation:
    """One method for each key of `expect`; each compares what the reference says with what the net does."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self.graph, self.steps = explore(net), explore(net, "step")
        self.report, self.step = report_on(self.graph), report_on(self.steps)
        self.player = Player(net)

    def markings(self, graph: ReachabilityGraph) -> set[frozenset[str]]:
        return {frozenset(map(local, graph.names(i))) for i in range(graph.n_markings)}

    def states(self, expected: int) -> None:
        assert self.report.figures.markings == expected

    def edges(self, expected: int) -> None:
        assert self.report.figures.edges == expected

    def deadlocks(self, expected: int) -> None:
        assert self.report.figures.deadlocks == expected

    def dead(self, expected: list[str]) -> None:
        assert list(self.report.figures.dead or ()) == expected

    def live(self, expected: bool) -> None:
        assert self.report.figures.live == expected

    def nonlive(self, expected: list[str]) -> None:
        assert list(self.report.figures.nonlive or ()) == expected

    def reversible(self, expected: bool) -> None:
        assert self.report.figures.reversible == expected

    def contacts(self, expected: Mapping[str, int]) -> None:
        assert self.report.figures.contacts == expected

    def selfloops(self, expected: list[str]) -> None:
        assert list(self.report.figures.self_loops) == expected

    def unowned(self, expected: list[str]) -> None:
        joined = {
            t.name for t in self.net.transitions if t.inputs or t.outputs or t.permissive or t.inhibitive or t.external
        }
        assert [t.name for t in self.net.transitions if t.name not in joined] == expected

    def structural(self, expected: Mapping[str, list[list[str]]]) -> None:
        self.pairs(self.report.figures.structural_conflicts, expected)

    def conflicts(self, expected: Mapping[str, list[list[str]]]) -> None:
        self.pairs(self.report.figures.effective_conflicts, expected)

    def pairs(self, found: Any, expected: Mapping[str, list[list[str]]]) -> None:
        assert {tuple(pair) for pair in expected.get("input", ())} == set(found.by_input)
        assert {tuple(pair) for pair in expected.get("output", ())} == set(found.by_output)

    def firable_m0(self, expected: list[str]) -> None:
        assert list(self.report.figures.firable_in_initial_marking) == expected

    def unreachable(self, expected: list[list[str]]) -> None:
        assert not self.markings(self.graph) & set(map(frozenset, expected))

    def races(self, expected: list[list[str]]) -> None:
        # The reference writes a pair in the order of replay; `gate_races` writes t -> u where t closes a gate of u.
        races = self.report.figures.gate_races
        assert races is not None
        assert [[u, t] for t, u in races] == expected

    def nonserialisable(self, expected: list[list[str]]) -> None:
        assert [list(step) for step in self.step.figures.nonserialisable or ()] == expected

    def eager_fired(self, expected: list[list[str]]) -> None:
        fired = [[self.net.transitions[t].name for t in step] for step, _ in self.steps.successors(0)]
        assert sorted(fired) == sorted(expected)

    def eager(self, expected: Mapping[str, int]) -> None:
        figures = self.step.figures
        found = {"states": figures.markings, "edges": figures.edges, "deadlocks": figures.deadlocks}
        assert {key: found[key] for key in expected} == expected

    def eager_markings(self, expected: list[list[str]]) -> None:
        assert self.markings(self.steps) == set(map(frozenset, expected))

    def priority(self, expected: Mapping[str, Any]) -> None:
        self.arbitrated(expected, ArbitrationRule.PRIORITY)

    def rotation(self, expected: Mapping[str, Any]) -> None:
        self.arbitrated(expected, ArbitrationRule.ROTATION)

    def arbitrated(self, expected: Mapping[str, Any], by: ArbitrationRule) -> None:
        net = with_arbiters(self.net, expected["order"], by)
        run = eager_run(net)
        assert [list(step) for step in run.first(len(expected["fired"]))] == expected["fired"]
        live = [t.name for t in net.transitions if t.name not in (self.report.figures.nonlive or ())]
        assert list(starved(run, live)) == expected.get("starved", [])
        assert list(check(net).verdict("starvation").subjects) == expected.get("starved", [])

    def per_place(self, expected: Mapping[str, list[str]]) -> None:
        index = self.net.transition_index
        orders = {place: [index[t] for t in order] for place, order in expected.items() if place != "fired"}
        fired = per_place_choice(orders, self.player.may_fire(self.net.initial_marking))
        assert [self.net.transitions[t].name for t in fired] == expected["fired"]

    def signals(self, expected: Mapping[str, Any]) -> None:
        full = {local(signal.name): signal.name for signal in self.net.signals}
        valuations = [{full[s]: bool(value) for s, value in at.items()} for at in expected["trace"]]
        fired = scan(self.net, valuations)
        assert [list(step) for step in fired] == expected["fired"]
        marking = self.net.initial_marking
        judged = []
        for valuation, step in zip(valuations, fired, strict=True):
            judged.append(str(judge(self.player, marking, valuation)))
            marking = self.player.fire(marking, [self.net.transition_index[name] for name in step])
        assert judged == expected.get("verdict", judged)

    def entries(self, expected: Mapping[str, Any]) -> None:
        place = next(place.name for place in self.net.places if local(place.name) == expected["place"])
        run = [[name] if isinstance(name, str) else name for name in expected["run"]]
        assert list(entries(self.net, run, place)) == expected["at"]

    def complement(self, expected: Mapping[str, Any]) -> None:
        place = next(place.name for place in self.net.places if local(place.name) == expected["place"])
        other = complement(self.net, place, flip_gates=expected["flip"])
        assert isomorphic(self.graph, explore(other)) == expected["isomorphic"]


GRAPH_CASES = [case for case in cases() if set(case.expect) - ELSEWHERE]


@pytest.mark.parametrize("case", GRAPH_CASES, ids=str)
def test_a_reference_case_has_the_expected_figures(case: Case) -> None:
    expectation = Expectation(case.net())
    for key, expected in case.expect.items():
        if key not in ELSEWHERE:
            getattr(expectation, key)(expected)


def test_every_key_of_the_reference_data_is_judged_somewhere() -> None:
    keys = {key for case in cases() for key in case.expect}
    assert keys <= {name for name in vars(Expectation) if not name.startswith("_")} | ELSEWHERE
    assert len(GRAPH_CASES) > 20
