"""CTL without all markings: local evaluation, simpler formulas and goals say what sets of markings say."""

from dataclasses import replace
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.ring_nets import ring_nets
from support.temporal_formulas import ctl_formulas

import firable.analysis.check as checking
import firable.analysis.temporal.by_parts as by_parts
from firable.analysis._engine import IncompleteGraph, evaluate_locally
from firable.analysis.check import check
from firable.analysis.compiled import flat
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.temporal.by_parts import decide_ctl_by_parts
from firable.analysis.temporal.ctl import Ctl
from firable.analysis.temporal.local import METHOD, decide_ctl_on_the_fly
from firable.analysis.temporal.sets import Sets
from firable.analysis.temporal.simplifying import implied, simplified
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import Constant, Formula
from firable.nets.net import Net, Place, TemporalProperty, Transition
from firable.nets.queries import parse_query
from firable.nets.temporal import Logic, Temporal, format_temporal, parse_temporal
from firable.nets.verdict import Status, Verdict

FOREVER = Net(
    "ring", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",)))
)
ENDING = Net("end", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
MEMORY = 2**28


@st.composite
def asked(draw: st.DrawFn, leaves: int = 6) -> tuple[Net, Temporal]:
    """A net and a formula over its names."""
    net = draw(st.one_of(ring_nets(), dense_nets()))
    places, transitions = [place.name for place in net.places], [transition.name for transition in net.transitions]
    return net, draw(ctl_formulas(places, transitions, leaves))


def over_sets(net: Net, formula: Temporal) -> bool:
    graph = explore(net)
    return graph.contains(Ctl(Sets(graph)).of(formula), net.initial_marking)


def locally(net: Net, text: str) -> bool | None:
    return decide_ctl_on_the_fly(net, parse_temporal(text), Limits()).answer.holds


@examples(38)
@given(asked(), st.sampled_from([1, 2, 5, 256]))
def test_a_local_value_is_that_over_sets_however_little_a_search_may_meet(
    question: tuple[Net, Temporal], first: int
) -> None:
    net, formula = question
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("firable.analysis.temporal.local._FIRST", first)
        found = decide_ctl_on_the_fly(net, formula, Limits()).answer.holds
    assert found is over_sets(net, formula), format_temporal(formula)


@examples(30)
@given(asked())
def test_a_simpler_formula_holds_in_the_same_markings_and_implies_its_state_formula(
    question: tuple[Net, Temporal],
) -> None:
    net, formula = question
    graph = explore(net)
    ctl, simpler = Ctl(Sets(graph)), simplified(formula)
    before, after, needed = ctl.of(formula), ctl.of(simpler), ctl.of(implied(simpler))
    assert before.tolist() == after.tolist(), format_temporal(simpler)
    assert not ctl.sets.space.count(ctl.sets.both(after, ctl.sets.outside(needed)))


@examples(15)
@given(asked())
def test_constants_of_the_net_leave_a_formula_its_markings(question: tuple[Net, Temporal]) -> None:
    net, formula = question
    graph = explore(net)
    ctl = Ctl(Sets(graph))

    def known(state: Formula) -> Formula:
        holding = graph.count(ctl.of(state))
        return Constant(holding > 0) if holding in {0, graph.n_markings} else state

    assert ctl.of(formula).tolist() == ctl.of(simplified(formula, known)).tolist()


@examples(13)
@given(asked())
def test_goals_and_local_evaluation_together_say_what_sets_say(question: tuple[Net, Temporal]) -> None:
    net, formula = question
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(by_parts, "_GLANCE", 0.0)  # else the first look decides
        limits = Limits(Deadline.after(60.0))
        assert decide_ctl_by_parts(net, formula, limits).answer.holds is over_sets(net, formula)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("EF AF E[p U EF q]", "EF q"),
        ("AG EG AG p", "AG p"),
        ("AF EF p", "EF p"),
        ("A[p U EF q]", "EF q"),
        ("EF (p or AX q)", "EF p or EF AX q"),
        ("not EG (p and AF q)", "AF (not p or EG not q)"),
        ("E[false U q]", "q"),
        ("AX (p and EX q)", "AX p and AX EX q"),
        ("EG AX true", "true"),
        ("AX false", "deadlock"),
        ("not A[p U q] and true", "not A[p U q]"),
        ("AF A[p U q]", "AF q"),
    ],
)
def test_one_operator_swallows_another(text: str, expected: str) -> None:
    assert format_temporal(simplified(parse_temporal(text))) == expected


def test_in_a_deadlock_nothing_is_next_and_an_until_is_its_end() -> None:
    texts = ("AF q", "AF AX false", "AG EX true", "EG p", "EF EG q", "A[p U q]", "EF (q and EX true)")
    assert [locally(ENDING, text) for text in texts] == [True, True, False, False, True, True, False]


def test_a_run_that_comes_round_fails_an_until_of_each_run() -> None:
    texts = ("AF (p and q)", "EG (p or q)", "AG AF q", "A[p U p and q]", "AG (p -> AX q)")
    assert [locally(FOREVER, text) for text in texts] == [False, True, True, False, True]


def test_what_is_not_decided_within_its_markings_is_open() -> None:
    net = family_net("machines-40")
    with pytest.raises(IncompleteGraph, match="markings"):
        decide_ctl_on_the_fly(net, parse_temporal("AG EF start"), Limits(), markings=1000)
    with pytest.raises(IncompleteGraph):
        decide_ctl_on_the_fly(net, parse_temporal("AG EF start"), Limits(memory_bytes=1000))


def test_it_ends_with_its_deadline_and_where_nobody_needs_it() -> None:
    net, formula, cancelled = family_net("machines-40"), parse_temporal("AG EF start"), Event()
    cancelled.set()
    for deadline in (Deadline.after(0.0), Deadline(cancelled=cancelled)):
        with pytest.raises(IncompleteGraph):
            decide_ctl_on_the_fly(net, formula, Limits(deadline))
        with pytest.raises(IncompleteGraph):
            decide_ctl_by_parts(net, formula, Limits(deadline))


@pytest.mark.parametrize(
    ("labels", "nodes"),
    [
        ([], []),
        ([], [("label", [0])]),
        ([[(2, [])]], [("label", [0]), ("not", [1])]),
        ([[(2, [])]], [("label", [0]), ("EU", [0])]),
        ([[(1, [7])]], [("label", [0])]),
        ([[(2, [])]], [("label", [0]), *(("not", [i]) for i in range(1000))]),
    ],
)
def test_the_engine_refuses_what_is_no_formula(
    labels: list[list[tuple[int, list[int]]]], nodes: list[tuple[str, list[int]]]
) -> None:
    with pytest.raises(ValueError, match=r"node|label|place|levels"):
        evaluate_locally(
            *flat(ENDING), labels, nodes, first=1, max_markings=10, max_memory_bytes=MEMORY, max_seconds=None
        )


def test_a_state_formula_that_can_never_hold_decides_what_no_search_could() -> None:
    # 40 machines have more markings than can be met, and no machine is in two places.
    net = family_net("machines-40")
    first, second = (place.name for place in net.places[:2])
    text = f"AG EX (AF not ({first} and {second}) and EX not ({first} and {second}))"
    with pytest.raises(IncompleteGraph):
        decide_ctl_on_the_fly(net, parse_temporal(text), Limits(), markings=1000)
    assert decide_ctl_by_parts(net, parse_temporal(text), Limits(Deadline.after(60.0))).answer.holds


def test_next_markings_are_asked_one_by_one_but_not_of_the_start() -> None:
    limits = Limits(Deadline.after(60.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(by_parts, "decide_ctl_on_the_fly", _never)
        assert decide_ctl_by_parts(FOREVER, parse_temporal("AX EF p"), limits).answer.holds
        assert not decide_ctl_by_parts(ENDING, parse_temporal("EX EF p"), limits).answer.holds
        with pytest.raises(IncompleteGraph):
            decide_ctl_by_parts(FOREVER, parse_temporal("EX not EF start"), limits)


def _never(*_: object) -> None:
    raise IncompleteGraph("never")


def verdict_of(net: Net, text: str, method: str = "auto", budget: Budget | None = None) -> Verdict:
    return check(net, budget=budget, method=method, queries=[parse_query(text, "asked")]).verdict("query.asked")


def test_by_its_name_it_decides_formulas_of_ctl() -> None:
    verdict = verdict_of(catalogue_net("one_robot"), "AG AF start", method="on-the-fly")
    assert (verdict.status, verdict.method) == (Status.VIOLATED, METHOD)


def test_auto_asks_it_where_no_technique_holds_all_markings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(checking, "SPACES", {})
    verdict = verdict_of(family_net("machines-40"), "EX AF EX not start", budget=Budget(markings=100, seconds=20.0))
    assert (verdict.status, verdict.method) == (Status.PROVED, METHOD)


def test_sets_of_markings_that_are_there_show_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "FIRST_MARKINGS", 5)
    again = TemporalProperty("again", Logic.CTL, parse_temporal("AG AF start"))
    verdict = check(replace(catalogue_net("one_robot"), properties=(again,))).verdict("property.again")
    assert (verdict.status, verdict.witness is not None) == (Status.VIOLATED, True)
