"""Verdicts settled one by one: who is asked what they know, and who goes on when asked again."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Event
from time import sleep
from typing import TYPE_CHECKING, ClassVar

import pytest

from firable.analysis import check as checking
from firable.analysis import settling
from firable.analysis._engine import IncompleteGraph
from firable.analysis.check import check
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Finding, Limits
from firable.analysis.methods import Anew, Method, Technique
from firable.analysis.question import Known, unknown, yes
from firable.analysis.settling import Settling
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.temporal.queries import question_of
from firable.analysis.walk import Walks
from firable.nets.catalogue import catalogue_net
from firable.nets.formula import Formula, parse_formula
from firable.nets.net import Net
from firable.nets.queries import Query, parse_query
from firable.nets.temporal import Logic, Temporal, parse_temporal
from firable.nets.verdict import Cost, Status, Verdict
from firable.semantics.trace import Discipline

if TYPE_CHECKING:
    from firable.analysis.methods import FormulaDecider, Knower

NET = catalogue_net("one_robot")
MEMORY_BYTES = 1 << 20


class Slow:
    """Knows whether the net is live when it is asked for the third time."""

    made: ClassVar[list[Slow]] = []

    def __init__(self, net: Net) -> None:
        assert net is NET
        self.asked = 0
        self.made.append(self)

    def __call__(self, limits: Limits) -> Mapping[str, Known]:
        assert limits.memory_bytes == MEMORY_BYTES
        self.asked += 1
        return {"live": Known(yes(), "slowly")} if self.asked == 3 else {}


def forgetful(net: Net, limits: Limits) -> Mapping[str, Known]:
    assert net is NET
    FORGETFUL.append(limits)
    return {}


FORGETFUL: list[Limits] = []
ASKED: dict[Method, Technique[Knower]] = {
    Method.REDUCTION: Technique("slow", f"{__name__}:Slow"),
    Method.STRUCTURE: Anew("forgetful", f"{__name__}:forgetful"),
}


def test_who_goes_on_is_asked_again_with_the_time_that_is_left_and_who_begins_anew_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Slow.made.clear()
    FORGETFUL.clear()
    monkeypatch.setattr(settling, "KNOWERS", ASKED)
    monkeypatch.setattr(settling, "WORTH_ASKING", {})
    one = Settling(NET, (), MEMORY_BYTES, Event())
    one.learn_on({"live"}, NEVER)
    assert Slow.made == []
    for of in (*ASKED, *ASKED):
        one.learn(of, {"live"}, NEVER)
    assert ([slow.asked for slow in Slow.made], len(FORGETFUL)) == ([2], 2)
    one.learn_on({"live"}, Deadline.after(0))
    assert not one.found
    one.learn_on({"live"}, NEVER)
    one.learn_on({"live"}, NEVER)  # it is known
    assert ([slow.asked for slow in Slow.made], len(FORGETFUL)) == ([3], 2)
    assert one.found["live"].method == "slowly"


def test_what_is_open_when_all_others_have_done_is_asked_of_who_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    Slow.made.clear()
    monkeypatch.setattr(settling, "KNOWERS", ASKED | {Method.COMPACT: ASKED[Method.STRUCTURE]})
    monkeypatch.setattr(settling, "WORTH_ASKING", {})
    monkeypatch.setattr(checking, "SPACES", {})
    monkeypatch.setattr(checking, "GOAL_LANES", ())
    live = check(NET, budget=Budget(5, MEMORY_BYTES, seconds=60)).verdict("live")
    assert (live.status, live.method) == (Status.PROVED, "slowly")
    assert [slow.asked for slow in Slow.made] == [3]


GOALS_MET: list[tuple[Formula, float | None]] = []


def by_hard_work(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Decides what is easy at once, and what is hard (it names `mc.free`) never."""
    GOALS_MET.append((goal, limits.deadline.left_seconds))
    while "mc.free" in str(goal) and not limits.deadline.over:
        sleep(0.01)
    return Finding(None if "mc.free" in str(goal) else False, "hard work")


def settling_of(*texts: str) -> tuple[Settling, list[Verdict]]:
    queries = tuple(parse_query(text, f"q{at}") for at, text in enumerate(texts))
    return Settling(NET, queries, MEMORY_BYTES, Event()), [asked(query) for query in queries]


def asked(query: Query) -> Verdict:
    return question_of(query).settle(unknown("not asked yet", ""), "", Discipline.INTERLEAVING, Cost())


def by_one_technique(monkeypatch: pytest.MonkeyPatch) -> list[list[Method]]:
    GOALS_MET.clear()
    monkeypatch.setattr(settling, "GOALS", {Method.PDR: Anew("hard work", f"{__name__}:by_hard_work")})
    return [[Method.PDR]]


def test_one_that_is_hard_does_not_take_the_time_of_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    lanes = by_one_technique(monkeypatch)
    one, verdicts = settling_of("EF mc.free", "AG not mc.free", "EF start", "AG start")
    monkeypatch.setattr(settling, "_TURN_SECONDS", 0.05)
    one.ask_in_turns(verdicts, (), lanes, Deadline.after(1.0))
    assert one.found.keys() == {"query.q2", "query.q3"}
    turns = [left for goal, left in GOALS_MET if "mc.free" in str(goal) and left is not None]
    assert max(turns[:2]) <= 0.05, "in the first turn"
    assert max(turns) > 0.1, "in the last one"
    assert len(turns) > 4
    assert [line.partition(":")[0] for line in sorted(one.course)] == [verdict.name for verdict in verdicts]


def test_where_there_is_no_time_nobody_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    lanes = by_one_technique(monkeypatch)
    one, verdicts = settling_of("EF mc.free", "AG not mc.free", "EF start")
    for once in (False, True):
        one.ask_in_turns(verdicts, (), lanes, Deadline.after(0), once=once)
    assert not GOALS_MET


@pytest.mark.parametrize("texts", [("EF mc.free",), ("EF mc.free", "AG not mc.free")])
def test_who_has_one_turn_has_no_more_than_that(monkeypatch: pytest.MonkeyPatch, texts: tuple[str, ...]) -> None:
    lanes = by_one_technique(monkeypatch)
    monkeypatch.setattr(settling, "_TURN_SECONDS", 0.1)
    one, verdicts = settling_of(*texts)
    one.ask_in_turns(verdicts, (), lanes, Deadline.after(60), once=True)
    assert max(left for _, left in GOALS_MET if left is not None) <= 0.1
    assert not one.found


def test_without_a_limit_the_last_turn_is_as_long_as_the_techniques_try(monkeypatch: pytest.MonkeyPatch) -> None:
    lanes = by_one_technique(monkeypatch)
    monkeypatch.setattr(settling, "_TURN_SECONDS_MAX", 0.1)
    monkeypatch.setattr(settling, "_TURN_SECONDS", 0.05)
    one, verdicts = settling_of("EF mc.free", "AG not mc.free")
    one.ask_in_turns(verdicts, (), lanes, NEVER, (0.3, 0.4))
    longest = [left for _, left in GOALS_MET if left is not None]
    assert 0.35 < max(longest) <= 0.4


def test_a_goal_is_decided_once_whoever_comes_down_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    lanes = by_one_technique(monkeypatch)
    one, verdicts = settling_of("EF robot.grasp_cv1", "not EF robot.grasp_cv1", "(EF robot.grasp_cv1) or EF start")
    for verdict in verdicts:
        one.ask(verdict, (), lanes, NEVER)
    assert [one.found[verdict.name].status for verdict in verdicts] == [
        Status.VIOLATED,
        Status.PROVED,
        Status.VIOLATED,
    ]
    assert len(GOALS_MET) == 2


@pytest.mark.parametrize("walks", [True, False])
def test_what_is_nearby_is_met_by_a_short_walk_where_walks_are_allowed(
    monkeypatch: pytest.MonkeyPatch, walks: bool
) -> None:
    lanes = [*by_one_technique(monkeypatch), *([[Method.WALK]] if walks else [])]
    one, (far, near, never) = settling_of("AG not mc.free", "EF mc.machining", "EF (mc.free and mc.machining)")
    one.ask(near, (), lanes, NEVER)
    assert (one.found[near.name].status, len(GOALS_MET)) == ((Status.PROVED, 0) if walks else (Status.VIOLATED, 1))
    if walks:
        assert one.found[near.name].method == "random walk"
        assert one.found[near.name].witness is not None
        one.ask(never, (), lanes, Deadline.after(0.1))
        assert never.name not in one.found, "a walk concludes nothing"
        one.ask(far, (), lanes, NEVER)
        assert one.found[far.name].status is Status.VIOLATED


def test_a_walk_that_was_cut_short_is_walked_again_and_one_that_met_nothing_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lanes = [*by_one_technique(monkeypatch), [Method.WALK]]
    walked: list[Formula] = []
    decide = Walks.decide

    def slow(self: Walks, goal: Formula, limits: Limits, *, firings: int) -> Finding:
        walked.append(goal)
        while limits.deadline.left_seconds:
            sleep(0.01)
        return decide(self, goal, limits, firings=0 if limits.deadline.over else firings)

    monkeypatch.setattr(Walks, "decide", slow)
    one, (near, never) = settling_of("EF mc.machining", "EF (robot.grasp_cv1 and mc.machining and robot.free)")
    one.ask(near, (), lanes, Deadline.after(0.05))
    assert near.name not in one.found
    one.ask(near, (), lanes, NEVER)
    assert (one.found[near.name].method, len(walked)) == ("random walk", 2)
    for _ in range(2):
        assert one._nearby("never", walked[0], Limits()) is not None
    goal = parse_formula("robot.grasp_cv1 and mc.machining and robot.free")
    for _ in range(2):
        assert one._nearby(never.name, goal, Limits()) is None
    assert walked.count(goal) == 1


class Forgets:
    """Judges formulas of CTL on one net, and counts how often it is made."""

    made: ClassVar[list[Net]] = []

    def __init__(self, net: Net) -> None:
        self.made.append(net)

    def __call__(self, formula: Temporal, limits: Limits) -> Known:
        assert (formula, limits.deadline.left_seconds) == (parse_temporal("AG EF start"), None)
        return Known(yes(), "easily")


def test_who_judges_formulas_is_made_once_of_a_net_and_has_all_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    Forgets.made.clear()
    table: dict[Logic, dict[Method, Technique[FormulaDecider]]] = {
        logic: {Method.ON_THE_FLY: Technique("forgets", f"{__name__}:Forgets")} for logic in Logic
    }
    monkeypatch.setattr(settling, "FORMULAS", table)
    one, verdicts = settling_of("AG EF start", "AG EF start")
    for verdict in verdicts:
        one.ask(verdict, (), [[Method.ON_THE_FLY]], NEVER, None)
    assert {one.found[verdict.name].method for verdict in verdicts} == {"easily"}
    assert Forgets.made == [NET]


WAITED: list[Limits] = []
WAITED_SECONDS: list[float | None] = []


def in_vain(net: Net, formula: Temporal, limits: Limits) -> Known:
    """Judges no formula, however long it has; one that names `mc.free` it gives up at once."""
    WAITED.append(limits)
    WAITED_SECONDS.append(limits.deadline.left_seconds)
    while "mc.free" not in str(formula) and not limits.deadline.over:
        sleep(0.001)
    raise IncompleteGraph("in vain")


def by_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    WAITED.clear()
    WAITED_SECONDS.clear()
    table: dict[Logic, dict[Method, Technique[FormulaDecider]]] = {
        logic: {Method.ON_THE_FLY: Anew("in vain", f"{__name__}:in_vain")} for logic in Logic
    }
    monkeypatch.setattr(settling, "FORMULAS", table)


def test_formulas_that_had_turns_in_vain_begin_with_a_longer_one_unless_one_had_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    by_nobody(monkeypatch)
    monkeypatch.setattr(settling, "_TURN_SECONDS", 0.25)
    one, (first, second) = settling_of("AG EF mc.free", "AG AF mc.free")
    lanes = [[Method.ON_THE_FLY]]
    for verdicts, more, most in (
        ([first], 0, 0.25),
        ([first], 0.25, 1.0),
        ([first, second], 0, 0.25),
        ([first, second], 0.25, 1.0),
    ):
        WAITED_SECONDS.clear()
        one.ask_in_turns(verdicts, (), lanes, Deadline.after(3600), None, once=True)
        assert len(WAITED_SECONDS) == len(verdicts)
        assert all(left is not None and more < left <= most for left in WAITED_SECONDS)


def test_queries_alone_are_asked_on_beside_the_search_and_end_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    by_nobody(monkeypatch)
    memory = 1 << 28

    def held(self: object, ends: object, limits: Limits) -> ReachabilityGraph:
        spaces.append(limits)
        while len(WAITED) < 2:
            sleep(0.001)
        return explore(NET)

    spaces: list[Limits] = []
    monkeypatch.setattr(checking, "FIRST_MARKINGS", 1)
    monkeypatch.setattr(checking, "SPACES", {})
    monkeypatch.setattr(checking._Check, "_held_explicitly", held)
    report = check(NET, budget=Budget(memory_bytes=memory), queries=[parse_query("AG AF start", "q")], of_the_net=False)
    assert report.verdict("query.q").status is not Status.UNKNOWN
    short, long, _ = WAITED_SECONDS  # and once more where the space is there
    assert short is not None
    assert long is not None
    assert short <= 0.25
    assert long > 5, "it is as long as anybody tries without a limit of time"
    assert [limits.memory_bytes for limits in WAITED] == [memory // 4, memory // 4, memory]
    assert [limits.memory_bytes for limits in spaces] == [memory - memory // 4]
    assert WAITED[1].deadline.over, "what is no longer needed is ended"


def by_ctrl_c(*_: object, **__: object) -> Known:
    raise KeyboardInterrupt


def test_runs_are_followed_for_formulas_of_ltl_as_far_as_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    one, _ = settling_of("ltl F start", "ltl G F robot.grasp_cv1", "AF start", "ltl G (robot.free -> F mc.machining)")
    one.follow_runs(NEVER, 3)
    assert one.found.keys() == {"query.q0"}
    one.follow_runs(Deadline.after(0), 1_000)
    assert one.found.keys() == {"query.q0"}
    with monkeypatch.context() as patch:
        patch.setattr(settling, "decide_ltl_on_the_fly", by_ctrl_c)
        one.follow_runs(NEVER, 1_000)
    assert one.interrupted.is_set(), "by Ctrl-C"
    assert one.found.keys() == {"query.q0"}
    one.follow_runs(NEVER, 1_000)
    assert one.found.keys() == {"query.q0", "query.q1", "query.q3"}
    assert {verdict.method for verdict in one.found.values()} == {"on the fly"}
