"""Every technique of the table that decides goals or formulas, against the oracle; one that is added is held to it too.

Not to decide is allowed here; what a technique must decide is said by the tests of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.lively_nets import lively_nets
from support.naive_space import NaiveSpace
from support.ring_nets import ring_nets
from support.temporal_formulas import ctl_formulas, ltl_formulas
from support.timed_nets import timed_nets
from support.whole_nets import formulas

from firable.analysis._engine import IncompleteGraph
from firable.analysis.check import check
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Finding, Limits
from firable.analysis.methods import FORMULAS, GOALS, SPACES, Method
from firable.analysis.report import report_on
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.spaces.space import Witnesses
from firable.analysis.temporal.queries import answer
from firable.nets.formula import Deadlock, Formula
from firable.nets.net import Net
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import Logic
from firable.nets.verdict import Status
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in

SMALL_NETS = st.one_of(lively_nets(), dense_nets(signals=True), ring_nets(signals=True), timed_nets())
SECONDS = 1.0  # a bounded search goes on as long as it may where there is nothing to find


def limits() -> Limits:
    return Limits(Deadline.after(SECONDS), 2**28)


def decide_as_the_oracle(method: Method, net: Net, goals: Sequence[Formula]) -> None:
    """One who is asked all goals, the first of them twice, and at first with hardly any time."""
    decide = GOALS[method].load()(net)
    decides_as_the_oracle(net, goals[0], decide(goals[0], Limits(Deadline.after(0.002, Event()), 2**28)))
    for goal in goals:
        decides_as_the_oracle(net, goal, decide(goal, limits()))


def decides_as_the_oracle(net: Net, goal: Formula, found: Finding) -> None:
    if found.reachable is None:
        assert found.bound, "what is not decided says how far was looked"
        return
    oracle = NaiveSpace(net)
    assert found.reachable == bool(oracle.satisfying(goal))
    if found.reachable:
        assert found.witness is not None
        end = Witnesses(net, oracle.discipline).play(
            net.initial_marking, [tuple(net.transition_index[t] for t in fired) for fired in found.witness.firings]
        )
        assert net.names(end) == found.witness.marking
        assert evaluate(BOOL, net, goal, holds_in(end))


@pytest.mark.parametrize("method", GOALS)
@examples(12)
@given(net=SMALL_NETS, data=st.data())
def test_a_technique_decides_goals_as_the_oracle_does(method: Method, net: Net, data: st.DataObject) -> None:
    goal = data.draw(formulas([place.name for place in net.places], [t.name for t in net.transitions]))
    decide_as_the_oracle(method, net, (goal, Deadlock()))


@pytest.mark.parametrize(("logic", "method"), [(logic, method) for logic in Logic for method in FORMULAS[logic]])
@examples(15)
@given(net=SMALL_NETS, data=st.data())
def test_a_technique_decides_formulas_as_the_oracle_does(
    logic: Logic, method: Method, net: Net, data: st.DataObject
) -> None:
    drawn = ltl_formulas if logic is Logic.LTL else ctl_formulas
    judge = FORMULAS[logic][method].load()(net)  # who is asked twice may remember
    for _ in range(2):
        formula = data.draw(drawn([place.name for place in net.places], [t.name for t in net.transitions]))
        try:
            found = judge(formula, limits())
        except IncompleteGraph:
            continue
        query = Query("q", QueryKind(logic), formula)
        assert answer(NaiveSpace(net), query).status is (Status.PROVED if found.answer.holds else Status.VIOLATED)


@pytest.mark.parametrize("method", [method for method in Method if method not in (Method.AUTO, Method.EXPLICIT)])
@examples(6)
@given(net=SMALL_NETS)
def test_check_by_one_technique_never_contradicts_exploration(method: Method, net: Net) -> None:
    known = {verdict.name: verdict for verdict in report_on(explore(net)).verdicts}
    for verdict in check(net, budget=Budget(seconds=SECONDS), method=method).verdicts:
        if verdict.status is not Status.UNKNOWN:
            assert verdict.status is known[verdict.name].status, verdict
        elif method in SPACES:
            assert known[verdict.name].status is Status.UNKNOWN, verdict


@pytest.mark.parametrize("method", SPACES)
def test_a_technique_that_holds_all_markings_gives_the_figures_of_exploration(method: Method) -> None:
    from firable.nets.catalogue import catalogue_names, catalogue_net

    for name in catalogue_names():
        net = catalogue_net(name)
        mine, other = check(net, method=method).figures.to_json(), check(net, method="explicit").figures.to_json()
        del mine["bytes_per_marking"], other["bytes_per_marking"]
        assert mine == other, name
