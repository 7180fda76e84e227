"""What plans find is reachable, whatever the goal; what they do not find stays open, and they end when told to."""

from __future__ import annotations

import random
import signal
from itertools import product
from threading import Event, Timer, active_count

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.lively_nets import lively_nets
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets
from support.searched import distance_to, goals, played, satisfies
from support.small_text import net_of

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Finding, Limits
from firable.analysis.spaces.reachability import explore
from firable.analysis.structure.goal_rows import rows_of
from firable.analysis.structure.ordinary import ordinary
from firable.analysis.structure.parikh import decide_by_parikh
from firable.analysis.structure.programme import Programme
from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.catalogue.processes import philosophers
from firable.nets.formula import And, Compare, Count, Deadlock, Formula, Holds, Sign, parse_formula
from firable.nets.net import Net, Place, Transition

NETS = st.one_of(lively_nets(), ring_nets(signals=True), dense_nets(signals=True))


def found(net: Net, goal: str) -> list[str] | None:
    """The firings that lead into a goal, which were played and do; None where it is left open."""
    finding = shown(net, parse_formula(goal))
    return None if finding.witness is None else [name for (name,) in finding.witness.firings]


def shown(net: Net, goal: Formula) -> Finding:
    finding = decide_by_parikh(net, goal, Limits(Deadline.after(60)))
    assert finding.reachable in (True, None)
    if finding.reachable:
        assert satisfies(net, played(net, finding.witness), goal)
    else:
        assert finding.bound
        assert finding.witness is None
    return finding


@examples(50)
@given(st.data())
def test_what_is_found_is_reachable(data: st.DataObject) -> None:
    net = data.draw(NETS)
    graph = explore(net)
    for goal in (data.draw(goals(net)), Deadlock()):
        if shown(net, goal).reachable:
            assert distance_to(graph, goal) is not None


@pytest.mark.parametrize("name", reference_names())
def test_deadlocks_of_reference_nets_are_those_of_exploring(name: str) -> None:
    net = load_net(name)
    assert not shown(net, Deadlock()).reachable or distance_to(explore(net), Deadlock()) is not None


def test_the_deadlocks_of_the_catalogue_are_found() -> None:
    for name in catalogue_names():
        net = catalogue_net(name)
        graph = explore(net)
        if graph.complete:
            assert bool(shown(net, Deadlock()).reachable) is (distance_to(graph, Deadlock()) is not None), name


@examples(60)
@given(st.data())
def test_the_rows_of_a_goal_have_a_solution_at_a_marking_iff_the_goal_holds_there(data: st.DataObject) -> None:
    net = data.draw(dense_nets(signals=True))
    goal = data.draw(goals(net))
    assume(rows_of(net, goal).n_columns <= len(net.places) + 8)
    rows_are_the_goal(net, goal)


@pytest.mark.parametrize("sign", Sign)
@pytest.mark.parametrize(
    "of", ["tokens(a, b, b) {} tokens(c, d) + 1", "a or tokens(b, c, d) {} 1", "2 {} tokens(a, b)"]
)
def test_a_comparison_is_true_where_its_rows_are(sign: Sign, of: str) -> None:
    net, compared = net_of("a", "t: a b -> c d"), of.format(sign)
    for goal in (compared, f"not ({compared})", f"({compared}) or b and d", f"not c and not ({compared} and a)"):
        rows_are_the_goal(net, parse_formula(goal))


def rows_are_the_goal(net: Net, goal: Formula) -> None:
    rows, n = rows_of(net, goal), len(net.places)
    for marking in range(2**n):
        places = [marking >> p & 1 for p in range(n)]
        solved = any(
            all(sum(w * values[c] for c, w in weights.items()) >= least for weights, least in rows.rows)
            for values in (places + list(rest) for rest in product((0, 1), repeat=rows.n_columns - n))
        )
        assert solved is satisfies(net, marking, goal)


@pytest.mark.parametrize(
    "goal",
    [
        "p1.eating",
        "firable(p2_takes_right) and not start",
        "tokens(p1.eating, p2.eating, p3.eating, p4.eating) = 2",
        "tokens(p1.eating, p1.eating, p3.eating) != 0 and tokens(p1.eating) < tokens(p3.eating, p4.eating)",
        "not (p1.thinking or start) and (p3.eating or deadlock) and 2 > tokens(p1.eating, p3.eating)",
        "deadlock",
        "start",
    ],
)
def test_goals_of_all_kinds_are_found(goal: str) -> None:
    net = philosophers(4)
    assert found(net, goal) is not None
    assert found(net, f"({goal}) and not ({goal})") is None


def test_the_deadlock_of_many_philosophers_is_found_by_the_fewest_firings() -> None:
    assert len(found(philosophers(60), "deadlock") or ()) == 60


def test_a_transition_that_needs_what_nothing_of_the_plan_brings_takes_one_that_does() -> None:
    """`take` and `back` lend each other the token that neither has; a `long` way brings one."""
    net = net_of("p q", "take: x, p -> y, g", "back: y -> x", "long: q -> r", "way: r -> s", "here: s -> x")
    assert found(net, "g") == ["long", "way", "here", "take"]
    assert found(net_of("p", "take: x, p -> y, g", "back: y -> x"), "g") is None


KNOT = ("t: a -> x if b", "u: b -> y if a", "back: x -> a")
"""Each of two firings takes away what the other reads, and the state equation does not see what is read."""


def test_what_is_left_of_a_plan_that_is_stuck_is_planned_anew() -> None:
    path = found(net_of("a b", *KNOT, "way: a -> d", "round: d -> x"), "x and y")
    assert path is not None
    assert path[-3:] == ["u", "way", "round"]


def test_a_solution_of_the_state_equation_that_no_order_fires_leaves_the_goal_open() -> None:
    net = net_of("a b", *KNOT)
    assert distance_to(explore(net), parse_formula("x and y")) is None
    finding = shown(net, parse_formula("x and y"))
    assert "could be fired" in finding.bound
    assert "no solution" in shown(net, parse_formula("x and a")).bound


def test_a_firing_that_is_repeated_often_is_planned() -> None:
    """A counter of six bits: the last firing comes after all others, and the first fires 32 times."""
    net = net_of(
        "z0 z1 z2 z3 z4 z5",
        "t0: z0 -> o0",
        "t1: z1 o0 -> o1 z0",
        "t2: z2 o0 o1 -> o2 z0 z1",
        "t3: z3 o0 o1 o2 -> o3 z0 z1 z2",
        "t4: z4 o0 o1 o2 o3 -> o4 z0 z1 z2 z3",
        "t5: z5 o0 o1 o2 o3 o4 -> o5 z0 z1 z2 z3 z4",
    )
    assert len(found(net, "o0 and o1 and o2 and o3 and o4 and o5") or ()) == 63


def test_gates_are_kept_and_contact_blocks() -> None:
    gated = net_of("p q", "t: p -> g unless q", "u: q -> r", "v: g -> h if r")
    assert found(gated, "h and not q") == ["u", "t", "v"]
    assert found(net_of("p q", "t: p -> q"), "deadlock") == []
    assert found(net_of("p q", "t: p -> q"), "firable(t)") is None
    assert found(net_of("p q", "t: p -> q", "u: q -> r"), "firable(t)") == ["u"]


def test_a_transition_whose_gates_contradict_each_other_is_never_planned() -> None:
    assert found(net_of("p", "t: p -> q if p unless p", "u: p -> r"), "q") is None


def test_the_same_net_has_the_same_plan() -> None:
    first, second = (shown(philosophers(12), parse_formula("p3.eating and p7.eating")) for _ in range(2))
    assert first == second


def test_nothing_is_printed_by_the_solver(capfd: pytest.CaptureFixture[str]) -> None:
    assert found(philosophers(5), "deadlock")
    assert capfd.readouterr() == ("", "")


def test_a_programme_without_room_is_not_begun() -> None:
    finding = decide_by_parikh(philosophers(50), Deadlock(), Limits(memory_bytes=10_000))
    assert "memory" in finding.bound
    assert finding.reachable is None


def test_a_programme_that_the_solver_could_not_be_kept_from_in_time_is_not_begun() -> None:
    n = 130_000
    places = (Place("p", marked=True), Place("q"))
    net = Net("wide", places, tuple(Transition(f"t{i}", ("p",), ("q",)) for i in range(n)))
    assert "too large" in shown(net, Holds("q")).bound


def test_a_cut_ends_where_another_marking_begins() -> None:
    net = net_of("p", "t: p -> q")
    programme = Programme(ordinary(net), rows_of(net, Holds("q")), 16, 2**30)
    programme.start_from({0})
    assert programme.plan(NEVER) == {0: 1}
    programme.cut([0], [])
    assert programme.plan(NEVER) is None
    programme.start_from({0})
    assert programme.plan(NEVER) == {0: 1}


def test_the_rows_of_a_goal_are_not_made_where_the_time_is_over() -> None:
    with pytest.raises(BudgetExceeded, match="time"):
        rows_of(philosophers(5), Deadlock(), deadline=Deadline.after(0))


GONE = Event()
GONE.set()


@pytest.mark.parametrize("limits", [Limits(Deadline.after(0)), Limits(Deadline.after(60, GONE))])
def test_nothing_is_planned_where_the_time_is_over(limits: Limits) -> None:
    finding = decide_by_parikh(philosophers(5), Deadlock(), limits)
    assert (finding.reachable, finding.bound) == (None, "the time was over")


def split_market() -> tuple[Net, Formula]:
    """Tokens to be moved so that several sums are exactly one half: nobody knows how to do that fast."""
    draw, n = random.Random(1), 50
    places = tuple(Place(f"{side}{i}", marked=side == "p") for i in range(n) for side in "pq")
    sums = []
    for _ in range(6):
        weights = [draw.randrange(100) for _ in range(n)]
        half = tuple(f"q{i}" for i in range(n) for _ in range(weights[i]))
        sums.append(Compare(Count(half), Sign.EQUAL, Count(added=sum(weights) // 2)))
    transitions = tuple(Transition(f"t{i}", (f"p{i}",), (f"q{i}",)) for i in range(n))
    return Net("market", places, transitions), And(tuple(sums))


def test_a_solver_that_is_at_work_ends_where_somebody_else_has_won() -> None:
    before, won = active_count(), Event()
    timer = Timer(0.5, won.set)
    timer.start()
    finding = decide_by_parikh(*split_market(), Limits(Deadline(cancelled=won)))
    timer.join()
    assert (finding.reachable, finding.bound) == (None, "the time was over")
    assert active_count() == before


def test_a_solver_that_is_at_work_ends_by_the_clock() -> None:
    assert decide_by_parikh(*split_market(), Limits(Deadline.after(0.5))).bound == "the time was over"


@pytest.mark.usefixtures("interruptible")
def test_a_solver_that_is_at_work_ends_by_ctrl_c() -> None:
    before = active_count()
    timer = Timer(0.5, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        decide_by_parikh(*split_market(), Limits())
    timer.join()
    assert active_count() == before


def test_a_goal_far_down_one_line_is_found() -> None:
    n = 5_000
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n))
    net = Net("line", places, tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(n - 1)))
    witness = decide_by_parikh(net, Holds(f"p{n - 1}"), Limits()).witness
    assert witness is not None
    assert len(witness.firings) == n - 1
