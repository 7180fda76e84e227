"""What the state equation and traps refute is not reachable, and what they rest on is inductive, marking by marking."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.inductive import check_finding, holds
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets
from support.whole_nets import formulas

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Clause, InductiveInvariant
from firable.analysis.goal import Limits
from firable.analysis.structure.inequalities import AtLeast, Refuter
from firable.analysis.structure.state_equation import StateEquation, decide_by_state_equation
from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, Not, parse_formula
from firable.nets.net import Net, Place, Transition
from firable.semantics.player import Player


@st.composite
def nets_with_goals(draw: st.DrawFn) -> tuple[Net, list[Formula]]:
    net = draw(st.one_of(ring_nets(), dense_nets()))
    drawn = formulas([p.name for p in net.places], [t.name for t in net.transitions])
    return net, draw(st.lists(drawn, min_size=1, max_size=3))


@examples(40)
@given(nets_with_goals())
def test_what_is_refuted_is_not_reachable_and_the_certificate_is_an_inductive_invariant(
    drawn: tuple[Net, list[Formula]],
) -> None:
    net, goals = drawn
    decide = StateEquation(net)
    for goal in goals:
        check_finding(net, goal, decide(goal, Limits()))


@pytest.mark.parametrize("name", reference_names())
def test_every_pair_of_places_never_marked_together_in_a_reference_net_is_refuted_or_left_open(name: str) -> None:
    net = load_net(name)
    reachable = Player(net).reachable()
    for other in net.places[1:4]:
        goal = And((Holds(net.places[0].name), Holds(other.name)))
        found = decide_by_state_equation(net, goal, Limits())
        assert found.reachable is None or not any(holds(net, goal, marking) for marking in reachable)


def test_the_cell_is_free_of_deadlock_by_units_and_traps_alone() -> None:
    assert decide_by_state_equation(load_net("cell1"), Deadlock(), Limits()).reachable is False
    assert decide_by_state_equation(load_net("cell1_mc_late"), Deadlock(), Limits()).reachable is None


def test_a_trap_refutes_what_the_state_equation_alone_cannot() -> None:
    """Each of two tokens is taken only while the other is there: the sums allow that both are gone."""
    net = Net(
        "n",
        (Place("p", marked=True), Place("q", marked=True)),
        (Transition("t", ("p",), permissive=("q",)), Transition("u", ("q",), permissive=("p",))),
    )
    goal = And((Not(Holds("p")), Not(Holds("q"))))
    found = decide_by_state_equation(net, goal, Limits())
    assert found.reachable is False
    check_finding(net, goal, found)
    assert found.certificate == InductiveInvariant(clauses=(Clause(marked=("p", "q")),))


def test_a_place_that_no_token_can_come_to_keeps_transitions_dead() -> None:
    net = Net("n", (Place("p", marked=True), Place("q"), Place("r")), (Transition("t", ("p", "q"), ("r",)),))
    found = decide_by_state_equation(net, Firable("t"), Limits())
    assert found.reachable is False
    check_finding(net, Firable("t"), found)
    assert decide_by_state_equation(net, Holds("r"), Limits()).reachable is False


def test_a_goal_that_nothing_satisfies_needs_no_constraint() -> None:
    found = decide_by_state_equation(Net("n", (Place("p"),)), Constant(value=False), Limits())
    assert found.reachable is False


def test_a_limit_or_a_flag_leaves_the_goal_undecided() -> None:
    net, flag = load_net("cell1"), Event()
    assert decide_by_state_equation(net, Deadlock(), Limits(Deadline.after(0))).bound == "the time was over"
    assert decide_by_state_equation(net, Deadlock(), Limits(Deadline(cancelled=flag))).reachable is False
    flag.set()
    assert decide_by_state_equation(net, Deadlock(), Limits(Deadline(cancelled=flag))).reachable is None


def test_an_inequality_excludes_what_a_sum_that_only_grows_cannot_come_back_to() -> None:
    """A token that moved from p to q cannot come back; nothing but the direction of the arc says so."""
    net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)), Transition("u", ("q",))))
    goal = And((Holds("p"), Holds("q")))
    found = decide_by_state_equation(net, goal, Limits())
    check_finding(net, goal, found)
    assert found.reachable is False
    assert isinstance(found.certificate, InductiveInvariant)
    assert found.certificate.inequalities


@pytest.mark.parametrize("name", reference_names())
def test_what_was_learnt_of_one_goal_excludes_nothing_of_another(name: str) -> None:
    net = load_net(name)
    decide, reachable = StateEquation(net), Player(net).reachable()
    goals: list[Formula] = [And((Holds(a.name), Holds(b.name))) for a in net.places[:3] for b in net.places[3:9]]
    for goal in [*goals, Deadlock(), *map(Not, goals[:3])]:
        found = decide(goal, Limits())
        if decide_by_state_equation(net, goal, Limits()).reachable is False:
            assert found.reachable is False
        assert found.reachable is None or not any(holds(net, goal, marking) for marking in reachable)


def test_who_is_ended_goes_on_where_that_was_and_takes_no_solver_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that is interrupted where it does nothing refuses the next question."""
    net = load_net("fig2b")
    goal, decide, flag = parse_formula("c0.Machine and not c0.Task"), StateEquation(net), Event()
    asked: list[Refuter] = []
    inequality = Refuter.inequality

    def ended(self: Refuter, full: Iterable[int], empty: Iterable[int], deadline: Deadline) -> AtLeast | None:
        asked.append(self)
        found = inequality(self, full, empty, deadline)
        if len(asked) == 1:
            flag.set()
            self.solver.ctx.interrupt()
        return found if len(asked) > 1 else None

    monkeypatch.setattr(Refuter, "inequality", ended)
    assert decide(goal, Limits(Deadline(cancelled=flag))).reachable is None
    assert decide(goal, Limits()).reachable is False
    assert len(set(map(id, asked))) == 2
    assert decide(goal, Limits(Deadline.after(0))).reachable is None
    assert decide(goal, Limits()).reachable is False
