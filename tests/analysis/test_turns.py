"""Verdicts that share what time is left: none keeps those behind it from being asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any, cast

import pytest

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.question import Answer, Question, unknown, yes
from firable.analysis.report import _formulas, _in_turn
from firable.analysis.spaces.reachability import explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.catalogue import family_net
from firable.nets.formula import Holds
from firable.nets.net import TemporalProperty
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import Logic, parse_temporal
from firable.nets.verdict import Cost, Status, Verdict, Witness
from firable.semantics.trace import Discipline


@dataclass
class Turns:
    """As much of a state space as takes turns, and who was asked with which part of the time."""

    deadline: Deadline
    complete: bool = True
    share: float = 1.0
    most_seconds: float = inf
    asked: list[tuple[str, float]] = field(default_factory=list)

    @contextmanager
    def turn(self, share: float, most_seconds: float = inf) -> Iterator[None]:
        self.share, self.most_seconds = share, most_seconds
        yield
        self.share, self.most_seconds = 1.0, inf

    def expect(self, formulas: int) -> None:
        self.asked.append((f"expect {formulas}", self.share))

    def ask(self, name: str, needs: float) -> Verdict:
        """Decided with so large a part of the time."""
        self.asked.append((name, self.share))
        answer = Answer(True) if self.share >= needs else unknown("time", "", "F3004")
        return Question(name, name).settle(answer, "", Discipline.INTERLEAVING, Cost())


def decided(turns: Turns, *, stated: bool = False, **needs: float) -> dict[str, bool]:
    asks = [partial(turns.ask, name, part) for name, part in needs.items()]
    verdicts = _in_turn(cast(StateSpace[Any], turns), *(([], asks) if stated else (asks, [])), {})
    assert [verdict.name for verdict in verdicts] == list(needs)
    return {verdict.name: verdict.status is Status.PROVED for verdict in verdicts}


def test_what_takes_long_is_asked_again_when_all_others_have_been() -> None:
    turns = Turns(Deadline.after(3600))
    assert decided(turns, long=0.45, short=0.1, never=2.0) == {"long": False, "short": True, "never": False}
    names = [name for name, _ in turns.asked]
    assert names == ["long", "short", "never", "long", "never"]
    first, again = turns.asked[:3], turns.asked[3:]
    assert len({share for _, share in first}) == 1
    # What is left then is shared out, and a part of it stays for other techniques.
    assert [share for _, share in again] == pytest.approx([1 / 3, 1 / 2])
    assert decided(Turns(Deadline.after(3600)), long=0.45, short=0.1) == {"long": True, "short": True}


def test_what_is_stated_shares_the_time_evenly() -> None:
    turns = Turns(Deadline.after(3600))
    assert decided(turns, stated=True, a=0.24, b=0.24, c=0.3, d=0.41) == {"a": True, "b": True, "c": True, "d": True}
    assert [share for _, share in turns.asked] == pytest.approx([1 / 4, 1 / 3, 0.4, 0.4, 1 / 2])


def test_the_space_gets_ready_for_the_formulas_before_the_first_thing_that_is_stated() -> None:
    turns = Turns(Deadline.after(3600))
    asks = [partial(turns.ask, name, 0.0) for name in ("of the net", "formula", "another")]
    _in_turn(cast(StateSpace[Any], turns), asks[:1], asks[1:], {}, 2)
    assert [name for name, _ in turns.asked] == ["of the net", "expect 2", "formula", "another"]
    turns = Turns(Deadline.after(3600), complete=False)
    _in_turn(cast(StateSpace[Any], turns), [], [partial(turns.ask, "formula", 0.0)], {}, 2)
    assert [name for name, _ in turns.asked] == ["formula"]


def test_a_graph_stores_its_edges_for_many_formulas_and_keeps_them_out_where_time_is_short() -> None:
    net = family_net("machines-12")
    few, many, late = explore(net), explore(net), explore(net)
    bare = few.engine.memory_bytes
    few.expect(2)
    many.expect(3)
    late.until(Deadline.after(0)).expect(3)
    assert few.engine.memory_bytes == late.engine.memory_bytes == bare
    assert many.engine.memory_bytes > bare + 4 * (many.n_edges or 0)
    targets = many.satisfying(Holds(net.places[0].name))
    assert (many.backward(targets) == few.backward(targets)).all()


def test_formulas_of_ctl_that_are_not_known_are_counted() -> None:
    net = family_net("machines-2")
    stated = (
        TemporalProperty("a", Logic.CTL, parse_temporal("AG EF start")),
        TemporalProperty("b", Logic.LTL, parse_temporal("G F start")),
    )
    net = replace(net, properties=stated)
    queries = [Query(name, QueryKind.CTL, parse_temporal("EG start")) for name in ("c", "d")]
    queries += [Query("goal", QueryKind.CTL, parse_temporal("EF deadlock")), Query("e", QueryKind.LIVE)]
    assert _formulas(net, queries, {}) == 3
    known = Question("query.c", "c").settle(yes(), "", Discipline.INTERLEAVING, Cost())
    assert _formulas(net, queries, {known.name: known}) == 2


def test_what_is_known_is_shown_in_the_end_where_that_does_not_take_long() -> None:
    turns = Turns(NEVER)
    known = Question("of", "of").settle(yes(), "known", Discipline.INTERLEAVING, Cost())
    run = Witness(marking=("p",))
    shown = Question("of", "of").settle(yes(run), "shown", Discipline.INTERLEAVING, Cost())
    seconds: list[float] = []

    def show(verdict: Verdict) -> Verdict:
        seconds.append(turns.most_seconds)
        return verdict

    for verdict, method in ((shown, "shown"), (known, "known"), (replace(shown, witness=None), "known")):
        verdicts = _in_turn(cast(StateSpace[Any], turns), [], [lambda: known], {"of": partial(show, verdict)})
        assert [verdict.method for verdict in verdicts] == [method]
    assert len(seconds) == 3
    assert max(seconds) < 60
    partly = cast(StateSpace[Any], Turns(NEVER, complete=False))
    assert _in_turn(partly, [], [lambda: known], {"of": partial(show, shown)}) == (known,)


def test_a_turn_on_a_graph_ends_what_passes_over_all_markings_and_leaves_the_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("firable.analysis.spaces.columns.PART", 1 << 12)
    graph = explore(family_net("machines-17"))
    with pytest.raises(BudgetExceeded), graph.turn(1.0, 0.0):
        graph.backward(graph.deadlocks)
    with pytest.raises(BudgetExceeded), graph.turn(1.0, 0.0):
        graph.satisfying(Holds(graph.net.places[0].name))
    with graph.turn(1.0), pytest.raises(BudgetExceeded), graph.turn(1.0, 0.0):
        graph.backward(graph.deadlocks)
    assert not graph.count(graph.backward(graph.deadlocks))
    timed = graph.until(Deadline.after(3600))
    with timed.turn(0.25) as outer, timed.turn(0.5) as inner, timed.turn(0.5, 10.0) as short:
        left = [turn.left_seconds for turn in (outer, inner, short)]
    assert left == [pytest.approx(of, abs=30) for of in (900, 450, 10)]


@pytest.mark.parametrize("turns", [Turns(NEVER), Turns(Deadline.after(3600), complete=False), Turns(Deadline.after(0))])
def test_nothing_is_asked_twice_where_more_time_is_none_or_would_not_help(turns: Turns) -> None:
    assert decided(turns, long=0.9, short=0.1) == {"long": False, "short": True}
    assert len(turns.asked) == 2


def test_a_turn_on_a_diagram_ends_with_its_part_of_the_time_and_leaves_the_rest() -> None:
    space = explore_symbolically(family_net("slotted_ring-10")).until(Deadline.after(3600))
    limits: list[float | None] = []

    class Engine:
        def limit(self, *, max_seconds: float | None, **_: object) -> None:
            limits.append(max_seconds)

    object.__setattr__(space, "engine", Engine())
    with pytest.raises(ZeroDivisionError), space.turn(0.25):
        raise ZeroDivisionError
    assert limits == [pytest.approx(900, abs=30), pytest.approx(3600, abs=30)]
    limits.clear()
    with space.turn(0.5), space.turn(0.5), space.turn(0.5, 10.0):
        pass
    assert limits == [pytest.approx(of, abs=30) for of in (1800, 900, 10, 900, 1800, 3600)]


def test_a_turn_on_a_diagram_ends_in_time_where_nothing_else_does() -> None:
    space = explore_symbolically(family_net("philosophers-100"))
    with pytest.raises(BudgetExceeded), space.turn(1.0, 0.0):
        space.backward(space.deadlocks)
    with space.turn(0.25):
        assert space.backward(space.deadlocks) == space.reach
