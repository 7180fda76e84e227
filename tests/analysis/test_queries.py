"""Queries of each kind, and their verdicts."""

from itertools import product as all_pairs

import pytest
from hypothesis import given
from support.dense_nets import dense_nets
from support.naive_space import NaiveSpace
from support.ring_nets import ring_nets

import firable.analysis.temporal.queries as queries
from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.temporal.automaton import TimeEndedError, TooLargeError, automaton_of
from firable.analysis.temporal.queries import answer, as_goal
from firable.analysis.temporal.rewriting import positive
from firable.analysis.verdicts.goals import goals_of
from firable.analysis.verdicts.properties import decide_stated
from firable.decompose import split
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.net import ExternalGate, Net, Place, Signal, TemporalProperty, Transition
from firable.nets.queries import parse_query
from firable.nets.right_to_run import required_verdicts
from firable.nets.temporal import Logic, parse_temporal
from firable.nets.text import parse_net
from firable.nets.verdict import Status, Verdict, Weight

CELL = catalogue_net("one_robot")
LATE = catalogue_net("one_robot_mc_late")


def ask(net: Net, text: str, **limits: int) -> Verdict:
    return answer(explore(net, budget=Budget(**limits)), parse_query(text))


@pytest.mark.parametrize(
    ("net", "text", "status"),
    [
        (CELL, "AG EF start", Status.PROVED),
        (LATE, "AG EF start", Status.VIOLATED),
        (LATE, "EF deadlock", Status.PROVED),
        (CELL, "AG not deadlock", Status.PROVED),
        (CELL, "live", Status.PROVED),
        (LATE, "live", Status.VIOLATED),
        (LATE, "quasi_live", Status.PROVED),
        (CELL, "stable_marking", Status.VIOLATED),
        (CELL, "one_safe", Status.PROVED),
    ],
)
def test_the_example_cell_is_asked(net: Net, text: str, status: Status) -> None:
    verdict = ask(net, text)
    assert verdict.status is status
    assert verdict.name == "query.query"


def test_a_bound_is_found_and_shown() -> None:
    verdict = ask(CELL, "bound tokens(robot.free, robot.free, mc.free)")
    assert verdict.status is Status.PROVED
    assert verdict.statement.endswith("is 3")
    assert verdict.witness is not None
    assert verdict.witness.firings == ()


@given(ring_nets())
def test_the_bound_is_the_most_tokens_of_any_marking(net: Net) -> None:
    graph, diagram = explore(net), explore_symbolically(net)
    for places in all_pairs("ab", "ba", "ab"):
        on = [net.place_index[place] for place in places]
        most, markings = NaiveSpace(net).fullest(on)
        bound, column = graph.fullest(on)
        assert (bound, frozenset(graph.marking(int(at)) for at in column.nonzero()[0])) == (most, markings)
        bound, one = diagram.fullest(on)
        assert (bound, one.count()) == (most, 1)
        assert any(diagram.contains(one, marking) for marking in markings)


@given(ring_nets(signals=True))
def test_liveness_is_that_of_ctl(net: Net) -> None:
    space = explore(net)
    names = [transition.name for transition in net.transitions]
    for kind, formula in (("live", "AG EF firable({})"), ("quasi_live", "EF firable({})")):
        each = [answer(space, parse_query(formula.format(name))).status is Status.PROVED for name in names]
        verdict = answer(space, parse_query(kind))
        assert verdict.status is (Status.PROVED if all(each) else Status.VIOLATED)
        assert set(verdict.subjects) == {name for name, holds in zip(names, each, strict=True) if not holds}


def ordinary_is_safe(net: Net) -> bool:
    """Whether the net without the contact rule keeps one token on every place."""
    start = tuple(int(place.marked) for place in net.places)
    todo, seen = [start], {start}
    for tokens in todo:
        for t in net.transitions:
            at = net.place_index
            if not t.openable or not all(tokens[at[p]] for p in (*t.inputs, *t.permissive)):
                continue
            if any(tokens[at[p]] for p in t.inhibitive):
                continue
            change = [(p.name in t.outputs) - (p.name in t.inputs) for p in net.places]
            after = tuple(now + by for now, by in zip(tokens, change, strict=True))
            if max(after) > 1:
                return False
            if after not in seen:
                seen.add(after)
                todo.append(after)
    return True


@given(dense_nets(signals=True))
def test_one_safe_speaks_of_the_net_without_the_contact_rule(net: Net) -> None:
    verdict = ask(net, "one_safe")
    if any(t.self_loops for t in net.transitions):
        assert verdict.status is Status.UNKNOWN
    else:
        assert verdict.status is (Status.PROVED if ordinary_is_safe(net) else Status.VIOLATED)


def test_a_contact_that_no_valuation_opens_is_none() -> None:
    both = (ExternalGate("s"), ExternalGate("s", wanted=False))
    net = Net("n", (Place("p", marked=True),), (Transition("t", (), ("p",), external=both),), (Signal("s"),))
    assert ask(net, "one_safe").status is Status.PROVED


def test_a_stable_place_is_named() -> None:
    net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", (), ("q",)),))
    assert ask(net, "stable_marking").subjects == ("p",)


@pytest.mark.parametrize("text", ["AG EF start", "G F start", "AG not deadlock", "live", "stable_marking", "one_safe",
                                  "bound tokens(robot.free)", "AF start", "F deadlock"])  # fmt: skip
def test_without_all_markings_nothing_is_proved(text: str) -> None:
    verdict = ask(CELL, text, markings=10)
    assert verdict.status is Status.UNKNOWN
    assert (verdict.code, verdict.bound != "") == ("F3004", True)


def test_one_marking_decides_what_one_marking_can() -> None:
    assert ask(CELL, "EF not start", markings=10).status is Status.PROVED
    for text in ("AG start", "G start"):
        assert ask(CELL, text, markings=10).status is Status.VIOLATED


@pytest.mark.parametrize("text", ["EF p", "AG not p", "G p"])
def test_a_goal_decides_what_it_can(text: str) -> None:
    assert as_goal(parse_temporal(text)) is not None
    assert as_goal(parse_temporal(f"{text} and X p" if text == "G p" else f"{text} and EX p")) is None


def test_the_time_ends_a_search_for_a_run() -> None:
    verdict = answer(explore(CELL).until(Deadline.after(0)), parse_query("G F X start"))
    assert (verdict.status, verdict.code) == (Status.UNKNOWN, "F3004")


@pytest.mark.parametrize(
    ("text", "status"),
    [
        ("EG not deadlock", Status.PROVED),
        ("E[not deadlock U not start]", Status.PROVED),
        ("AF deadlock", Status.VIOLATED),
        ("A[start U deadlock]", Status.VIOLATED),
    ],
)
def test_what_is_decided_stays_so_where_the_time_ends_before_it_is_shown(text: str, status: Status) -> None:
    space, query = NaiveSpace(CELL), parse_query(text)
    assert answer(space, query).witness is not None
    verdict = answer(space.until(Deadline.after(0)), query)
    assert (verdict.status, verdict.witness) == (status, None)


def test_an_automaton_that_is_too_large_is_not_made() -> None:
    formula = positive(parse_temporal(" and ".join(f"F (p{i} and X q{i})" for i in range(5))))
    with pytest.raises(TooLargeError, match="states"):
        automaton_of(formula, states_max=100)
    with pytest.raises(TooLargeError, match="alternatives"):
        automaton_of(formula, states_max=5)
    with pytest.raises(TimeEndedError):
        automaton_of(formula, deadline=Deadline.after(0))


def test_a_net_states_properties_in_both_logics() -> None:
    text = catalogue_path("one_robot_mc_late").read_text("utf-8").rstrip()
    added = "  back: {ctl: AG EF start}\n  once: {ltl: G F start}\n"
    added += "  never_two: {ltl: G not deadlock}\n  some: {ctl: EF deadlock}\n"
    assert "\nproperties:\n" in text
    net = parse_net(f"{text}\n{added}")
    space = explore(net)
    verdicts = {verdict.name: verdict for verdict in (decide_stated(space, of) for of in net.properties)}
    for name in ("back", "once", "never_two"):
        verdict = verdicts[f"property.{name}"]
        assert (verdict.status, verdict.weight) == (Status.VIOLATED, Weight.REQUIRED)
        assert verdict.witness is not None
    assert verdicts["property.some"].status is Status.PROVED
    assert {"property.back", "property.some"} <= set(required_verdicts(split(net)))


@pytest.mark.parametrize(("name", "wanted"), [("never_two", False), ("some", True)])
def test_a_property_that_is_a_goal_is_one(name: str, wanted: bool) -> None:
    formulas = {"never_two": ("ltl", "G not deadlock"), "some": ("ctl", "EF deadlock")}
    logic, text = formulas[name]
    net = Net("n", properties=(TemporalProperty(name, Logic(logic), parse_temporal(text)),))
    found = goals_of(net, f"property.{name}")
    assert found is not None
    question, (goal,) = found
    assert question.name == f"property.{name}"
    assert goal.wanted is wanted
    assert NaiveSpace(net).satisfying(goal.formula) == {0}
    other = Net("n", properties=(TemporalProperty(name, Logic.CTL, parse_temporal("AG EF start")),))
    assert goals_of(other, f"property.{name}") is None


@pytest.mark.parametrize("text", ["AG EF start", "EG not deadlock", "AF deadlock", "EF deadlock"])
def test_what_is_known_is_not_lost_where_the_time_ends_over_what_shows_it(
    monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    def too_long(*_: object) -> None:
        raise BudgetExceeded("the time was over")

    space, query = explore(LATE, deadline=Deadline.after(60)), parse_query(text)
    expected = answer(space, query)
    for name in ("shown", "refuted"):
        monkeypatch.setattr(queries, name, too_long)
    monkeypatch.setattr(ReachabilityGraph, "witness", too_long)
    found = answer(space, query)
    assert (found.status, found.witness) == (expected.status, None)
    assert "too long" in found.hint
