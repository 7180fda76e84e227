"""Formulas that are put together from goals are decided by goals, as the whole state space decides them."""

from __future__ import annotations

import random

import pytest
from support.evidence_examples import LOOP
from support.lively_nets import lively_net, part_of
from support.naive_space import NaiveSpace

from firable.analysis import check as module
from firable.analysis._engine import IncompleteGraph
from firable.analysis.check import check
from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Finding
from firable.analysis.verdicts.combined import combined, is_combined
from firable.nets.catalogue import catalogue_net
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.queries import Query, QueryKind, parse_query
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Temporal,
    all_of,
    any_of,
    negated,
    parse_temporal,
)
from firable.nets.verdict import Status


def formula_of(draw: random.Random, net: Net, depth: int) -> Temporal:
    if depth == 0:
        state: Formula = part_of(draw, net, draw.getrandbits(len(net.places)), 3)
        return draw.choice((state, Exists(Eventually(state)), ForAll(Globally(state))))
    operands = tuple(formula_of(draw, net, depth - 1) for _ in range(2))
    return draw.choice((all_of, any_of))(operands) if draw.random() < 0.7 else negated(operands[0])


@pytest.mark.parametrize("chunk", range(4))
def test_what_goals_say_together_is_what_the_whole_space_says(chunk: int) -> None:
    for seed in range(40 * chunk, 40 * (chunk + 1)):
        draw = random.Random(seed)
        net = lively_net(draw, 8)
        space = NaiveSpace(net)

        def reached(goal: Formula, space: NaiveSpace = space) -> Finding:
            return Finding(space.count(space.satisfying(goal)) > 0, "playing")

        queries = tuple(Query(f"q{k}", QueryKind.CTL, formula_of(draw, net, k % 4)) for k in range(8))
        report = check(net, queries=queries)
        for query in queries:
            assert query.formula is not None
            assert is_combined(query.formula, branching=True)
            holds, _ = combined(net, query.formula, reached)
            assert holds is (report.verdict(f"query.{query.name}").status is Status.PROVED)


def test_a_part_that_nobody_decides_matters_only_where_the_others_leave_it_open() -> None:
    net = catalogue_net("one_robot")

    def nobody(_: Formula) -> None:
        return None

    for text, expected in (
        ("robot.free or EF not robot.free", True),
        ("not robot.free and EF not robot.free", False),
        ("robot.free and EF not robot.free", None),
        ("not (robot.free and EF not robot.free)", None),
    ):
        holds, shown = combined(net, parse_temporal(text), nobody)
        assert holds is expected
        assert (shown is None) is (expected is None)


@pytest.mark.parametrize("text", ["b", "a and b", "G a and b"])
def test_what_fails_in_the_initial_marking_is_refuted_by_a_run_from_there(text: str) -> None:
    query = Query("q", QueryKind.LTL, parse_temporal(text))
    report = check(LOOP, method="k-induction", queries=[query])
    assert report.verdict("query.q").status is Status.VIOLATED
    shown = {one.record.name: one.shown for one in check_document(evidence_of_report(report, [query]))}
    assert shown["query.q"]


def test_disjunctions_of_linear_time_are_not_taken_apart() -> None:
    assert is_combined(parse_temporal("G p and G q"), branching=False)
    assert not is_combined(parse_temporal("G p or G q"), branching=False)
    assert not is_combined(parse_temporal("not G p"), branching=False)
    assert not is_combined(parse_temporal("EF p and AF q"), branching=True)


def test_where_no_space_is_held_queries_are_put_together_or_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def gives_up(*_: object) -> None:
        raise IncompleteGraph("no room")

    texts = ("EF deadlock and not AG robot.free", "EF deadlock or AF robot.free", "live", "quasi_live", "one_safe")
    net = catalogue_net("one_robot_mc_late")
    queries = tuple(parse_query(text, f"q{k}") for k, text in enumerate(texts))
    expected = [check(net, queries=queries).verdict(f"query.q{k}").status for k in range(len(texts))]
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(module._Check, "_held_explicitly", gives_up)
    monkeypatch.setattr(module, "SPACES", {})
    report = check(net, queries=queries)
    found = [report.verdict(f"query.q{k}").status for k in range(len(texts))]
    assert found == expected
    assert report.verdict("query.q2").method.startswith("follows from live: ")
