"""How `check` chooses: exploring first, racing where that does not suffice, one technique where it is named."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from threading import Event
from time import sleep
from typing import Any

import pytest
from support.interrupting import ended

from firable.analysis import check as module
from firable.analysis._engine import IncompleteGraph
from firable.analysis.check import AGAIN, check
from firable.analysis.goal import Limits
from firable.analysis.methods import GOALS, KNOWERS, SPACES, Method
from firable.analysis.race import Contestant, Outcome, race
from firable.analysis.report import CheckReport, report_on
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import WitnessError
from firable.analysis.spaces.symbolic import SymbolicSpace, explore_symbolically
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.processes import philosophers
from firable.nets.diagnostics import InputError
from firable.nets.formula import Holds
from firable.nets.net import Net, Property, PropertyKind
from firable.nets.queries import parse_query
from firable.nets.verdict import Status
from firable.semantics.trace import Discipline


@pytest.mark.parametrize("method", [*GOALS, *SPACES, *KNOWERS])
def test_a_technique_without_synchronous_steps_refuses_them(method: Method) -> None:
    with pytest.raises(InputError) as refused:
        check(catalogue_net("one_robot"), "step", method=method)
    assert [d.code for d in refused.value.diagnostics] == ["F3006"]


def test_a_space_that_is_named_and_is_not_found_in_time_says_so_of_all_that_it_leaves_open() -> None:
    report = check(philosophers(200), budget=Budget(seconds=0), method="symbolic")
    left = [verdict for verdict in report.verdicts if verdict.status is Status.UNKNOWN]
    assert {verdict.name for verdict in left} >= {"contact-free", "deadlock-free", "live"}
    assert {verdict.bound for verdict in left} == {"decision diagram gave up: the time was over"}
    assert not any("markings" in verdict.hint for verdict in left)


def test_few_markings_are_explored_and_nothing_else_is_tried() -> None:
    report = check(catalogue_net("one_robot"))
    assert report.course == ("explored: 40 markings, 70 edges",)
    assert {verdict.method for verdict in report.verdicts if verdict.name == "deadlock-free"} == {
        "reachability graph, interleaving"
    }


def test_a_net_with_more_markings_than_the_first_look_is_decided_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    net = catalogue_net("one_robot_mc_late")
    explored = check(net)
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    raced = check(net)
    assert [(v.name, v.status) for v in raced.verdicts] == [(v.name, v.status) for v in explored.verdicts]
    assert raced.course[0] == "the first 5 markings are not all"
    assert "was the first to hold all markings: 76 markings, 154 edges" in raced.course[-1]


@pytest.mark.parametrize(("asked", "winner"), [(200, "decision diagram"), (0, "explicit engine")])
def test_a_graph_waits_for_sets_where_it_would_be_searched_often(
    asked: int, winner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The diagram begins when the graph is there; where nothing is waited for, it does not come to its end."""
    there = Event()

    def explored(net: Net, discipline: Discipline, budget: Budget, **by: Any) -> ReachabilityGraph:
        graph = explore(net, discipline, budget, **by)
        if graph.complete:
            sleep(0.2)
            there.set()
        return graph

    def in_a_diagram(net: Net, limits: Limits) -> SymbolicSpace:
        assert there.wait(60)
        if not asked and limits.deadline.cancelled is not None:
            assert limits.deadline.cancelled.wait(60)
        return explore_symbolically(net, limits)

    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(module, "explore", explored)
    monkeypatch.setattr("firable.analysis.spaces.symbolic.explore_symbolically", in_a_diagram)
    again = tuple(Property(f"p{i}", PropertyKind.ALWAYS_POSSIBLE, Holds("robot.free")) for i in range(asked))
    report = check(replace(catalogue_net("one_robot"), properties=again), of_the_net=False)
    assert f"{winner} was the first to hold all markings: 40 markings, 70 edges" in report.course
    assert all(verdict.holds for verdict in report.verdicts)


def test_a_graph_that_is_whole_as_ctrl_c_comes_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, **by: Any) -> Outcome[Any]:
        return replace(race(*arguments, **by), interrupted=True)

    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(module, "race", interrupted)
    report = check(catalogue_net("one_robot"))
    assert "interrupted" in report.course
    assert report.figures.markings == 40
    assert report.verdict("deadlock-free").holds


def test_synchronous_steps_are_explored_whatever_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    assert check(catalogue_net("one_robot"), "step").figures.complete


def test_a_budget_that_holds_no_space_leaves_unknown_what_no_goal_decides() -> None:
    report = check(catalogue_net("one_robot"), budget=Budget(markings=3), method="explicit")
    assert report.status is Status.UNKNOWN
    assert report.verdict("live").status is Status.UNKNOWN
    assert report.verdict("live").bound == "3 markings found, 3 edges followed: the budget of markings is used up"


def test_queries_are_answered_after_the_properties_of_the_net() -> None:
    queries = (parse_query("AG EF robot.free", "again"), parse_query("G not robot.free", "never"))
    report = check(catalogue_net("one_robot"), queries=queries)
    assert [verdict.name for verdict in report.verdicts[-2:]] == ["query.again", "query.never"]
    assert [verdict.status for verdict in report.verdicts[-2:]] == [Status.PROVED, Status.VIOLATED]


def test_what_theorems_know_is_not_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    report = check(catalogue_net("one_robot"), method="structure")
    live = report.verdict("live")
    assert (live.status, live.method) == (Status.PROVED, "theorem of Commoner on asymmetric-choice nets")
    assert report.verdict("effective-conflicts").status is Status.UNKNOWN
    assert report.course[-1] == (
        "theorems on net classes: contact-free, deadlock-free, doomed-markings, live, quasi-live"
    )


def test_an_interrupted_report_is_made_of_what_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[Any, ...]] = []

    def interrupted(*arguments: Any, **by: Any) -> CheckReport:
        calls.append(arguments)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return report_on(*arguments, **by)

    monkeypatch.setattr("firable.analysis.check.report_on", interrupted)
    report = check(catalogue_net("one_robot"))
    assert "interrupted" in report.course
    assert len(calls) == 2
    assert report.verdict("deadlock-free").status is Status.PROVED  # known from the exploration


@pytest.mark.parametrize(("reason", "is_again"), [("interrupted", True), ("markings", False)])
def test_what_an_interruption_leaves_unknown_is_no_matter_of_the_budget(
    monkeypatch: pytest.MonkeyPatch, reason: str, *, is_again: bool
) -> None:
    def early(*of: Any, **by: Any) -> ReachabilityGraph:
        return ended(explore(*of, **by), reason)

    calls: list[int] = []

    def interrupted(*of: Any, **by: Any) -> CheckReport:
        calls.append(len(calls))
        if len(calls) == 1:
            raise KeyboardInterrupt
        return report_on(*of, **by)

    monkeypatch.setattr("firable.analysis.check.explore", early)
    monkeypatch.setattr("firable.analysis.check.report_on", interrupted)
    report = check(catalogue_net("one_robot"), budget=Budget(markings=5), method="explicit")
    assert report.verdict("live").status is Status.UNKNOWN
    assert (report.verdict("live").hint == AGAIN) is is_again


def test_ctrl_c_is_told_to_who_asks_of_other_nets_of_which_nothing_is_begun_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    explored: list[int] = []

    def early(net: Net, discipline: Discipline, budget: Budget, **by: Any) -> ReachabilityGraph:
        explored.append(budget.markings)
        return ended(explore(net, discipline, replace(budget, markings=min(5, budget.markings)), **by))

    monkeypatch.setattr("firable.analysis.check.explore", early)
    interrupted = Event()
    first = check(catalogue_net("one_robot"), interrupted=interrupted)
    assert interrupted.is_set()
    assert first.verdict("live").bound == "5 markings found, 6 edges followed: interrupted"
    second = check(catalogue_net("one_robot_mc_late"), interrupted=interrupted)
    assert explored == [module.FIRST_MARKINGS, 1]
    assert second.course == ("interrupted",)
    assert (second.verdict("live").bound, second.verdict("live").hint) == ("interrupted", AGAIN)
    assert second.verdict("self-loops").holds, "nobody has to explore anything for that"


def test_interrupted_twice_ends_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any, **__: Any) -> CheckReport:
        raise KeyboardInterrupt

    monkeypatch.setattr("firable.analysis.check.report_on", interrupted)
    with pytest.raises(KeyboardInterrupt):
        check(catalogue_net("one_robot"))


def test_what_no_space_holds_follows_from_a_deadlock_that_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(module._Check, "_held_explicitly", _gives_up)
    monkeypatch.setattr(module, "SPACES", {})
    report = check(catalogue_net("one_robot_mc_late"))
    for name in ("live", "reversible", "doomed-markings"):
        verdict = report.verdict(name)
        assert verdict.status is Status.VIOLATED
        assert verdict.method.startswith("follows from deadlock-free: ")
        assert verdict.witness is not None


def _gives_up(*_: object) -> None:
    raise IncompleteGraph("no room")


def test_who_is_left_alone_works_by_two_threads() -> None:
    told: list[tuple[str, int, bool]] = []

    def runs(name: str, limits: Limits) -> None:
        assert limits.second_free is not None
        told.append((name, limits.threads, limits.second_free()))

    idle = Event()
    contestants: list[Contestant[Any]] = [Contestant(name, partial(runs, name)) for name in "ab"]
    one, other = module._by_two_when_alone(contestants, idle.is_set)
    other.run(Limits())
    one.run(Limits())  # the other one has ended, but something else works
    idle.set()
    one.run(Limits())
    assert told == [("b", 2, False), ("a", 2, False), ("a", 2, True)]


def test_two_queries_of_one_name_are_refused() -> None:
    queries = (parse_query("AG EF robot.free", "again"), parse_query("G not robot.free", "again"))
    with pytest.raises(InputError) as refused:
        check(catalogue_net("one_robot"), queries=queries)
    assert [d.code for d in refused.value.diagnostics] == ["F2001"]


def test_an_unknown_verdict_says_so_where_the_time_was_over_before_anybody_was_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    outcome: Outcome[Any] = Outcome(None, "", ())
    monkeypatch.setattr("firable.analysis.settling.race", lambda *_: outcome)
    report = check(catalogue_net("one_robot"), method="pdr")
    assert report.verdict("deadlock-free").bound == "no technique was asked any more"


def test_an_unknown_verdict_says_how_far_the_budget_led_and_not_where_the_race_began(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whoever is told of the first markings alone allows a few more, and comes no further."""
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(module, "SPACES", {})
    monkeypatch.setattr(module, "FIRST_KNOWERS", {})
    monkeypatch.setattr(module, "KNOWERS", {})
    for budget in (Budget(20, seconds=5), Budget(5, seconds=5)):
        bound = check(catalogue_net("one_robot"), budget=budget).verdict("home-markings").bound
        assert bound.startswith(f"{budget.markings} markings found")
        assert bound.endswith("the budget of markings is used up")


def test_what_the_explicit_engine_has_found_is_kept_where_its_budget_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """A violation is one whatever markings are left, and nothing is proved by some of them."""
    monkeypatch.setattr(module, "SPACES", {})
    for lanes in ("GOAL_LANES", "FORMULA_LANES", "_FIRST_LANES", "_DEADLOCK_LANES"):
        monkeypatch.setattr(module, lanes, ())
    monkeypatch.setattr("firable.analysis.settling.Settling.learn", lambda *_: None)
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    net, budget = catalogue_net("one_robot_mc_late"), Budget(60)
    explored, raced = check(net, budget=budget, method="explicit"), check(net, budget=budget)
    for name in ("deadlock-free", "machine-never-stopped", "property.no_deadlock"):
        assert raced.verdict(name).status is Status.VIOLATED
        assert raced.verdict(name).witness == explored.verdict(name).witness
    assert raced.verdict("live").status is Status.VIOLATED, "it follows"
    for name in ("contact-free", "home-markings"):
        assert raced.verdict(name).status is Status.UNKNOWN
    told = next(line for line in raced.course if line.startswith("explored, and not all: "))
    assert "deadlock-free" in told


@pytest.mark.parametrize("first_markings", [5, 200_000], ids=["raced", "explored"])
def test_of_the_net_itself_nothing_is_asked_where_nobody_wants_to_know(
    monkeypatch: pytest.MonkeyPatch, first_markings: int
) -> None:
    monkeypatch.setattr(module, "FIRST_MARKINGS", first_markings)
    net = catalogue_net("one_robot")
    whole, part = check(net), check(net, of_the_net=False)
    assert {of.name for of in part.verdicts} == {f"property.{of.name}" for of in net.properties}
    assert [(of.name, of.status) for of in part.verdicts] == [
        (of.name, of.status) for of in whole.verdicts if of.name.startswith("property.")
    ]
    assert (part.figures.markings, part.figures.complete) == (whole.figures.markings, True)
    assert (part.figures.live, part.figures.structural_conflicts) == (None, None)


@pytest.mark.parametrize("text", ["EF (robot.put_mc and mc.machining)", "AG EF deadlock"])
def test_where_nothing_is_left_to_ask_the_search_for_all_markings_ends(
    monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """It would else go on for as long as it is given; of the net itself, or with another question, it does."""
    monkeypatch.setattr(module, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(module, "SPACES", {})
    begun: list[bool] = []

    def endless(_: Any, __: Any, limits: Limits) -> None:
        while not limits.deadline.over:
            sleep(0.01)
        begun.append(limits.deadline.left_seconds == 0)
        raise IncompleteGraph("ended")

    monkeypatch.setattr("firable.analysis.check._Check._held_explicitly", endless)
    net = replace(catalogue_net("one_robot"), properties=())
    asked = parse_query(text, "asked")
    found = check(net, queries=[asked], of_the_net=False, budget=Budget(seconds=600)).verdict("query.asked")
    assert found.status is not Status.UNKNOWN
    hard = parse_query("AF EG start", "hard")
    monkeypatch.setattr("firable.analysis.settling.Settling.ask", lambda *_, **__: None)
    assert (
        check(net, queries=[hard], of_the_net=False, budget=Budget(seconds=0.5)).verdict("query.hard").status
        is Status.UNKNOWN
    )
    assert begun == [False, True]


def test_a_formula_that_is_known_and_bare_is_shown_by_all_markings_which_must_say_the_same() -> None:
    net = catalogue_net("one_robot_mc_late")
    query = parse_query("EF EG not start", "q")
    graph = explore(net)
    whole = report_on(graph, [query], of_the_net=False).verdict("query.q")
    assert (whole.status, whole.witness is None) == (Status.PROVED, False)
    bare = replace(whole, witness=None, method="by hearsay")
    shown = report_on(graph, [query], {"query.q": bare}, of_the_net=False).verdict("query.q")
    assert (shown.witness, shown.method) == (whole.witness, whole.method)
    kept = report_on(graph, [query], {"query.q": replace(whole, method="seen")}, of_the_net=False).verdict("query.q")
    assert kept.method == "seen"
    part = explore(net, budget=Budget(5))
    assert report_on(part, [query], {"query.q": bare}, of_the_net=False).verdict("query.q") == bare
    wrong = replace(bare, status=Status.VIOLATED)
    with pytest.raises(WitnessError, match="by hearsay does not"):
        report_on(graph, [query], {"query.q": wrong}, of_the_net=False)


def test_of_many_markings_formulas_of_ltl_are_followed_first(monkeypatch: pytest.MonkeyPatch) -> None:
    net, query = catalogue_net("one_robot"), parse_query("ltl G F robot.grasp_cv1", "q")
    assert check(net, queries=[query]).verdict("query.q").method == "reachability graph, interleaving"
    monkeypatch.setattr(module, "FEW_MARKINGS", 30)
    followed = check(net, queries=[query])
    assert followed.verdict("query.q").method == "on the fly"
    assert check(net, queries=[query], method="explicit").verdict("query.q").method.startswith("reachability graph")
    assert check(net, queries=[query], budget=Budget(20, seconds=0)).verdict("query.q").method != "on the fly"
