"""The graph in the net's own names: columns, witnesses that replay, budgets that end as UNKNOWN."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.lively_nets import lively_nets
from support.reference import load_net
from support.ring_nets import ring_nets

from firable.analysis.check import check
from firable.analysis.spaces import columns, reachability
from firable.analysis.spaces.columns import first
from firable.analysis.spaces.reachability import Budget, IncompleteGraph, explore
from firable.analysis.spaces.space import WitnessError
from firable.nets.formula import parse_formula
from firable.nets.net import Net, Place, Transition
from firable.nets.verdict import Status
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in
from firable.semantics.trace import Discipline


@examples(50)
@given(ring_nets(signals=True), st.sampled_from(Discipline))
def test_columns_agree_with_single_markings(net: Net, discipline: Discipline) -> None:
    graph, player = explore(net, discipline), Player(net)
    markings = [graph.marking(i) for i in range(graph.n_markings)]
    for p in range(len(net.places)):
        assert list(graph.marked(p)) == [bool(m >> p & 1) for m in markings]
    for t in range(len(net.transitions)):
        assert list(graph.may_fire(t)) == [t in player.may_fire(m) for m in markings]
    for text in ("start", "deadlock", "true", "false", "a and not b", "firable(t0) or b"):
        formula = parse_formula(text)
        assert list(graph.satisfying(formula)) == [evaluate(BOOL, net, formula, holds_in(m)) for m in markings]
    assert [graph.index_of(m) for m in markings] == list(range(len(markings)))
    assert list(graph.deadlocks) == [player.deadlocked(m) for m in markings]


def test_columns_do_not_depend_on_the_size_of_their_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = explore(load_net("cell1_mc_late"))
    whole = graph.satisfying(parse_formula("firable(G2) or deadlock"))
    monkeypatch.setattr(columns, "PART", 7)
    assert np.array_equal(graph.satisfying(parse_formula("firable(G2) or deadlock")), whole)


@examples(50)
@given(lively_nets(), st.sampled_from([8, 1 << 31, 1 << 32]), st.data())
def test_columns_that_are_kept_are_those_that_are_computed_anew(net: Net, share: int, data: st.DataObject) -> None:
    """Large disjunctions are, within others or alone, and places are, where there is room; it makes no difference."""
    graph = explore(net)
    with patch.object(reachability, "_KEPT_SHARE", share):
        assert graph.count(graph.marked(0)) == sum(graph.marking(i) & 1 for i in range(graph.n_markings))
    atoms = [*(f"firable({t.name})" for t in net.transitions), *(place.name for place in net.places)]
    for _ in range(4):
        large, small = (data.draw(st.lists(st.sampled_from(atoms), min_size=n, max_size=9)) for n in (8, 1))
        for text in (" or ".join(large), f"not ({' or '.join(small)}) or ({' or '.join(large)})"):
            formula = parse_formula(text)
            found = [evaluate(BOOL, net, formula, holds_in(graph.marking(i))) for i in range(graph.n_markings)]
            assert [graph.satisfying(formula).tolist() for _ in range(2)] == [found, found]


def test_columns_reach_over_more_than_64_places() -> None:
    n = 150
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n))
    moves = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{(i + 1) % n}",)) for i in range(n))
    graph = explore(Net("ring", places, moves))
    assert graph.n_markings == n
    for i in (0, 63, 64, 127, 128, 149):
        assert list(graph.marked(i)) == [j == i for j in range(n)]
    assert graph.witness_at(149).marking == ("p149",)


def test_a_sequence_that_is_none_of_the_net_is_an_internal_error() -> None:
    graph, stepwise = explore(load_net("cell1")), explore(load_net("cell1"), "step")
    index = graph.net.transition_index
    start = graph.net.initial_marking
    with pytest.raises(WitnessError):
        graph.witnesses.play(start, [(index["G2"],)])
    with pytest.raises(WitnessError):
        graph.witnesses.play(start, [(index["G1"], index["G2"])])
    with pytest.raises(WitnessError):
        stepwise.witnesses.play(start, [()])
    assert graph.witnesses.play(start, [(index["G1"],)]) == graph.marking(1)


@pytest.mark.parametrize("budget", [Budget(markings=10), Budget(memory_bytes=9_000), Budget(seconds=0.0)])
def test_a_budget_that_ends_early_gives_unknown_with_its_bound_and_no_figure_of_the_whole(budget: Budget) -> None:
    n = 14
    places = tuple(Place(f"{x}{i}", marked=x == "p") for i in range(n) for x in "pq")
    moves = [Transition(f"t{i}", (f"p{i}",), (f"q{i}",)) for i in range(n)]
    moves += [Transition(f"u{i}", (f"q{i}",), (f"p{i}",)) for i in range(n)]
    report = check(Net("wide", places, tuple(moves)), budget=budget, method="explicit")
    assert report.status is Status.UNKNOWN
    figures = report.figures
    assert not figures.complete
    assert figures.markings < 2**n
    assert (figures.deadlocks, figures.doomed, figures.home, figures.live, figures.reversible) == (None,) * 5
    assert (figures.dead, figures.nonlive, figures.contacts, figures.effective_conflicts) == (None,) * 4
    structure = {"self-loops", "structural-conflicts", "gate-races", "output-signals-in-M0"}
    structure |= {"conflicting-commands", "shared-completions", "machine-never-stopped"}  # the net commands nothing
    for verdict in report.verdicts:
        if verdict.name in structure:
            assert verdict.status is Status.PROVED
        elif verdict.status is Status.UNKNOWN:
            assert verdict.code == "F3004"
            # Starvation runs the net by itself, and tells the bound of that where the time is over before it begins.
            run_ended = verdict.name == "starvation" and verdict.bound == "0 steps of the run"
            assert f"{figures.markings:,} markings" in verdict.bound or (run_ended and budget.seconds == 0)
        else:
            # All transitions fired within ten markings, or none was expanded: nothing else can be known.
            assert (verdict.name, verdict.status) == ("quasi-live", Status.PROVED)


def test_a_violation_found_within_the_budget_is_a_violation() -> None:
    net = load_net("local_output_conflict")
    report = check(net, budget=Budget(markings=2), method="explicit")
    assert not report.figures.complete
    verdict = report.verdict("effective-conflicts")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert verdict.witness.firings == ()


def test_what_needs_the_whole_graph_is_refused_on_a_part() -> None:
    graph = explore(load_net("cell1"), budget=Budget(markings=5))
    with pytest.raises(IncompleteGraph):
        graph.require_complete()
    with pytest.raises(IncompleteGraph):
        graph.backward(graph.deadlocks)


def test_the_first_of_an_empty_set_is_none() -> None:
    assert first(np.zeros(3, dtype=np.bool_)) is None
    assert first(np.zeros(0, dtype=np.bool_)) is None
    assert first(np.array([False, True, True])) == 1


def test_the_figures_and_verdicts_of_a_report_are_json() -> None:
    import json

    report = check(load_net("local_output_conflict"), "step")
    data = json.loads(json.dumps(report.figures.to_json()))
    assert data["contacts"] == {"G": 1, "l": 1}
    assert data["effective_conflicts"] == {"by_input": [], "by_output": [["G", "l"]]}
    assert report.verdict("deadlock-free") in report.verdicts
    with pytest.raises(KeyError):
        report.verdict("no such verdict")


def test_a_room_is_full_at_some_time() -> None:
    room = columns.Room(10)
    assert [room.takes(np.zeros(size, np.uint8)) for size in (8, 3, 2, 1, 0)] == [True, False, True, False, True]
