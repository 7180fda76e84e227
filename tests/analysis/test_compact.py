"""The verdicts of a compact search: what it knows at once, goals, and the way `check` comes to it."""

from __future__ import annotations

import random

import pytest
from support.lively_nets import lively_net

from firable.analysis import check as checking
from firable.analysis.check import check
from firable.analysis.compact import METHOD, decide_by_compact_search, known_by_counting
from firable.analysis.goal import Limits
from firable.analysis.report import report_on
from firable.analysis.spaces.reachability import Budget, explore
from firable.nets.catalogue import family_net
from firable.nets.formula import Deadlock
from firable.nets.net import Net, Place, Transition
from firable.nets.verdict import Status


def test_what_a_compact_search_knows_is_what_exploration_finds() -> None:
    for seed in range(200):
        net = lively_net(random.Random(seed))
        verdicts = {verdict.name: verdict for verdict in report_on(explore(net)).verdicts}
        known = known_by_counting(net, Limits())
        assert set(known) == {"contact-free", "deadlock-free", "quasi-live"}
        for name, of in known.items():
            verdict, answer = verdicts[name], of.answer
            assert answer.holds is (verdict.status is Status.PROVED), (seed, name)
            assert answer.subjects == verdict.subjects, (seed, name)
            if verdict.witness is not None:
                assert answer.witness is not None
                assert len(answer.witness.firings) == len(verdict.witness.firings)
                if name == "deadlock-free":
                    assert answer.witness.note == verdict.witness.note


def test_what_the_budget_leaves_open_is_not_known() -> None:
    net = family_net("machines-18")
    tight = Limits(memory_bytes=100_000)
    assert set(known_by_counting(net, tight)) == {"quasi-live"}, "each transition fired before memory ended"
    found = decide_by_compact_search(net, Deadlock(), tight)
    assert found.reachable is None
    assert "memory" in found.bound


def test_a_net_too_wide_for_keys_is_not_decided() -> None:
    places = (Place("p0", marked=True), *(Place(f"p{i}") for i in range(1, 70)))
    net = Net("chain", places, tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(69)))
    assert known_by_counting(net, Limits()) == {}
    assert "more than 60 places" in decide_by_compact_search(net, Deadlock(), Limits()).bound


def test_check_by_a_compact_search_alone_decides_what_needs_no_graph() -> None:
    report = check(family_net("philosophers-6"), method="compact")
    violated = report.verdict("deadlock-free")
    assert (violated.status, violated.method) == (Status.VIOLATED, METHOD)
    assert violated.witness is not None
    assert report.verdict("contact-free").status is Status.PROVED
    assert report.verdict("quasi-live").status is Status.PROVED


def test_a_compact_search_holds_more_than_the_graph_in_the_same_memory() -> None:
    net, memory_bytes = family_net("machines-16"), 800_000
    graph = explore(net, budget=Budget(memory_bytes=memory_bytes))
    assert graph.engine.reason == "memory"
    known = known_by_counting(net, Limits(memory_bytes=memory_bytes))
    assert [known[name].answer.holds for name in ("contact-free", "deadlock-free", "quasi-live")] == [True] * 3


@pytest.mark.parametrize(("budget", "comes_to_it"), [(Budget(markings=1000), True), (Budget(seconds=0.0), False)])
def test_check_comes_to_a_compact_search_where_the_graph_had_no_room(
    monkeypatch: pytest.MonkeyPatch, budget: Budget, comes_to_it: bool
) -> None:
    monkeypatch.setattr(checking, "SPACES", {})
    monkeypatch.setattr(checking, "FIRST_KNOWERS", {})
    report = check(family_net("interlocked-7"), budget=budget)
    assert any(line.startswith("compact search of all markings") for line in report.course) is comes_to_it
    verdict = report.verdict("contact-free")
    assert (verdict.status is Status.PROVED) is comes_to_it
    assert (verdict.method == METHOD) is comes_to_it
