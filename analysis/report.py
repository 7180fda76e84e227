"""The report of `check`: everything that the state space of a net decides, as verdicts and figures.

One question after the other to the same space, each with a part of the time that is left, so that none keeps those
behind it from being asked. Those for which that was too little have what is left then, but for a part that is for other
techniques. The verdicts say what holds, with their evidence; the figures are the numbers and sets behind them, for
tables, tests and comparisons. A figure that needs the whole space is None where the budget ended first: an unknown
number is not zero.

The tables below hold the verdicts in the order of the report. To add one: its technique in a file of its own, one row
here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from types import MappingProxyType
from typing import Any, Final, TypeVar

from firable.analysis.deadline import Deadline
from firable.analysis.goal import Finding
from firable.analysis.question import Answer, Question
from firable.analysis.spaces.reachability import BudgetExceeded, IncompleteGraph, ReachabilityGraph
from firable.analysis.spaces.space import StateSpace, WitnessError
from firable.analysis.temporal.queries import answer, as_goal, decide_temporal
from firable.analysis.verdicts import behaviour as behaviour_of
from firable.analysis.verdicts import conflicts as conflict
from firable.analysis.verdicts.behaviour import Behaviour
from firable.analysis.verdicts.commands import (
    commands_agree,
    completions_apart,
    machines_stopped,
    no_command_in_initial_marking,
)
from firable.analysis.verdicts.conflicts import ConflictAnalysis, Pairs, Steps
from firable.analysis.verdicts.properties import decide_stated
from firable.analysis.verdicts.starvation import starvation_free
from firable.nets.formula import Formula
from firable.nets.net import Net, Property, TemporalProperty
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import Logic
from firable.nets.verdict import Status, Verdict, Weight, Witness, overall
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Figures:
    """The numbers and sets behind the verdicts, by the names of the net; None is unknown, as the budget ended, or as
    nobody asked for verdicts on the net itself.

    `deadlocks`, `doomed`, `home` and the values of `contacts` count markings. `nonserialisable` holds the steps of a
    step graph that no order replays; it is None for an interleaving graph, which has no steps. `cut_short` names the
    figures that hold only the first of very many pairs.
    """

    markings: int
    edges: int | None
    complete: bool
    bytes_per_marking: float | None
    deadlocks: int | None = None
    doomed: int | None = None
    home: int | None = None
    reversible: bool | None = None
    live: bool | None = None
    dead: tuple[str, ...] | None = None
    nonlive: tuple[str, ...] | None = None
    contacts: Mapping[str, int] | None = None
    self_loops: tuple[str, ...] = ()
    firable_in_initial_marking: tuple[str, ...] = ()
    structural_conflicts: Pairs | None = None
    effective_conflicts: Pairs | None = None
    gate_races: tuple[tuple[str, str], ...] | None = None
    cut_short: tuple[str, ...] = ()
    nonserialisable: tuple[tuple[str, ...], ...] | None = None

    def to_json(self) -> dict[str, Any]:
        """The figures as JSON data; unknown ones are null."""
        data: dict[str, Any] = {}
        for name in (one.name for one in fields(self)):
            value = getattr(self, name)
            if isinstance(value, Pairs):
                value = {
                    "by_input": [list(pair) for pair in value.by_input],
                    "by_output": [list(pair) for pair in value.by_output],
                }
            elif isinstance(value, Mapping):
                value = dict(value)
            elif isinstance(value, tuple):
                value = [list(item) if isinstance(item, tuple) else item for item in value]
            data[name] = value
        return data


@dataclass(frozen=True)
class CheckReport:
    """What `check` found of a net under one discipline; `space` is there for further questions.

    `course` tells, in words, which techniques were tried and why the verdicts name the ones they name. `findings` are,
    for the verdicts that came down to goals, these goals with what was found of them: what evidence is made from.
    """

    net: Net
    discipline: Discipline
    figures: Figures
    verdicts: tuple[Verdict, ...]
    space: StateSpace[Any]
    course: tuple[str, ...] = ()
    findings: Mapping[str, Sequence[tuple[Formula, Finding]]] = field(default_factory=dict)

    @property
    def status(self) -> Status:
        """The status of all required verdicts together."""
        return overall(self.verdicts)

    def verdict(self, name: str) -> Verdict:
        """The verdict of this name; `KeyError` where there is none."""
        for verdict in self.verdicts:
            if verdict.name == name:
                return verdict
        raise KeyError(name)

    def _repr_html_(self) -> str:
        """In a notebook: every verdict, the runs of those that must hold and do not, and who waits for whom."""
        from firable.analysis.cures.finding import with_circle
        from firable.nets.drawing import draw_strip
        from firable.nets.notebook import told_apart, verdicts_html
        from firable.semantics.frames import frames

        def strip(verdict: Verdict, witness: Witness) -> str:
            run = frames(self.net, witness.firings)
            return draw_strip(self.net, run, caption=verdict.statement, width_max=_NOTEBOOK_WIDTH_PIXELS)

        pictures = {
            verdict.name: strip(verdict, verdict.witness)
            for verdict in told_apart(self.verdicts, _PICTURES_MAX)
            if verdict.witness is not None
        }
        told = (with_circle(self.net, verdict) for verdict in self.verdicts)
        return verdicts_html(f"{self.net.name}, {self.discipline}", told, pictures)


def report_on(
    space: StateSpace[Any],
    queries: Sequence[Query] = (),
    known: Mapping[str, Verdict] = MappingProxyType({}),
    *,
    of_the_net: bool = True,
) -> CheckReport:
    """Decide every verdict of this room, and the queries, on a state space that was explored before.

    Of temporal properties and of queries the verdicts that are `known`, by name, are taken as they are; of a formula
    of CTL that no run shows yet the space is asked for one in the end, and whether it says the same. The verdicts on
    the net itself are left out, with their figures, where not `of_the_net`. Raises `WitnessError` where it does not.
    """
    behaviour, conflicts = Behaviour(space), ConflictAnalysis(space)
    steps = _steps(space)

    def on_property(of: Property | TemporalProperty) -> Verdict:
        seen = known.get(f"property.{of.name}") if isinstance(of, TemporalProperty) else None
        return seen or decide_stated(space, of)

    def on_query(query: Query) -> Verdict:
        return known.get(f"query.{query.name}") or answer(space, query)

    on_the_net: list[Callable[[], Verdict]] = [
        *(partial(decide, behaviour) for decide in _ON_BEHAVIOUR),
        partial(self_loop_free, space),
        *(partial(decide, conflicts) for decide in _ON_CONFLICTS),
        *([] if steps is None else [partial(conflict.steps_serialisable, steps)]),
        *(partial(decide, space) for decide in _ON_SPACE),
        partial(starvation_free, behaviour),
    ]
    stated: list[Callable[[], Verdict]] = [
        *(partial(on_property, of) for of in space.net.properties),
        *(partial(on_query, query) for query in queries),
    ]
    asked = on_the_net if of_the_net else []
    formulas = _formulas(space.net, queries, known)
    verdicts = _in_turn(space, asked, stated, _shows(space, queries, known), formulas)
    found = figures(behaviour, conflicts, steps) if of_the_net else Figures(**_size(space))
    return CheckReport(space.net, space.discipline, found, verdicts, space)


def _in_turn(
    space: StateSpace[Any],
    on_the_net: Sequence[Callable[[], Verdict]],
    stated: Sequence[Callable[[], Verdict]],
    shows: Mapping[str, Callable[[], Verdict]],
    formulas: int = 0,
) -> tuple[Verdict, ...]:
    """What is answered, in the order of the questions; of what is known, what `shows` it, where there is time.

    So many of what is stated are formulas of CTL.
    """
    asks, verdicts = [*on_the_net, *stated], []
    for later, ask in zip(range(len(asks), 0, -1), asks, strict=True):
        if later == len(stated) and formulas and space.complete:
            with space.turn(_READY_SHARE):
                space.expect(formulas)
        with space.turn(_TURN_SHARE if later > len(stated) else _even_share(space.deadline, later)):
            verdicts.append(ask())
    if not space.complete:
        return tuple(verdicts)
    if space.deadline.left_seconds is not None:
        late = [i for i, verdict in enumerate(verdicts) if verdict.status is Status.UNKNOWN and verdict.code == "F3004"]
        for left, i in zip(range(len(late), 0, -1), late, strict=True):
            if not space.deadline.over:
                with space.turn(1 / (left + 1)):
                    verdicts[i] = asks[i]()
    bare = [i for i, verdict in enumerate(verdicts) if verdict.name in shows]
    for left, i in zip(range(len(bare), 0, -1), bare, strict=True):
        with space.turn(1 / (left + 1), _SHOWING_SECONDS_MAX):
            shown = shows[verdicts[i].name]()
        if shown.status not in {verdicts[i].status, Status.UNKNOWN}:
            raise WitnessError(f"of {shown.name} {shown.method} says {shown.status}, and {verdicts[i].method} does not")
        verdicts[i] = shown if shown.witness is not None else verdicts[i]
    return tuple(verdicts)


def _even_share(deadline: Deadline, later: int) -> float:
    """The part of the time of a verdict on what is stated: one is as good as another, and many may be too many.

    Of the net, it is one fixed point that takes the time of all.
    """
    left = deadline.left_seconds or 0.0
    return min(_TURN_SHARE, max(1 / later, _TURN_SECONDS_MIN / left)) if left else _TURN_SHARE


def _formulas(net: Net, queries: Sequence[Query], known: Mapping[str, Verdict]) -> int:
    """How many formulas of CTL, stated or asked, are not known and need more than the markings of a goal."""
    stated = (of for of in net.properties if isinstance(of, TemporalProperty) and of.logic is Logic.CTL)
    asked = (query for query in queries if query.kind is QueryKind.CTL)
    named = [*((f"property.{of.name}", of.formula) for of in stated)]
    named += [(f"query.{query.name}", query.formula) for query in asked if query.formula is not None]
    return sum(name not in known and as_goal(formula) is None for name, formula in named)


def _shows(
    space: StateSpace[Any], queries: Sequence[Query], known: Mapping[str, Verdict]
) -> dict[str, Callable[[], Verdict]]:
    """What asks the space, by name, about the formulas of CTL that are known and that no run shows."""
    temporal = [of for of in space.net.properties if isinstance(of, TemporalProperty) and of.logic is Logic.CTL]
    shows = {f"property.{of.name}": partial(decide_temporal, space, of) for of in temporal}
    shows |= {f"query.{query.name}": partial(answer, space, query) for query in queries if query.kind is QueryKind.CTL}
    return {name: show for name, show in shows.items() if name in known and known[name].witness is None}


_SHOWING_SECONDS_MAX: Final = 5.0
"""How long a run is looked for that shows a verdict which is known."""
_TURN_SHARE: Final = 0.4
"""The part of the time left that one verdict may take before the others have been asked for."""
_READY_SHARE: Final = 0.4
"""The part of the time left that it may take to get ready for many formulas."""
_TURN_SECONDS_MIN: Final = 1.0
"""How long one on what is stated may take even if all cannot: with less, none would come to its end."""
_FIGURE_SHARE: Final = 0.1
"""The same of a figure, most of which are known from the verdicts."""
_NOTEBOOK_WIDTH_PIXELS: Final = 900
_PICTURES_MAX: Final = 3
_ON_BEHAVIOUR: Final[tuple[Callable[[Behaviour[Any]], Verdict], ...]] = (
    behaviour_of.contact_free,
    behaviour_of.deadlock_free,
    behaviour_of.no_doomed,
    behaviour_of.quasi_live,
    behaviour_of.all_live,
    behaviour_of.reversible,
    behaviour_of.home_markings,
)
_ON_CONFLICTS: Final[tuple[Callable[[ConflictAnalysis[Any]], Verdict], ...]] = (
    conflict.structural_conflict_free,
    conflict.effective_conflict_free,
    conflict.race_free,
)
_ON_SPACE: Final[tuple[Callable[[StateSpace[Any]], Verdict], ...]] = (
    commands_agree,
    completions_apart,
    machines_stopped,
    no_command_in_initial_marking,
)


def self_loops(net: Net) -> tuple[str, ...]:
    """The transitions with a place that is both input and output: it would have to hold a token and hold none."""
    return tuple(t.name for t in net.transitions if t.self_loops)


def _steps(space: StateSpace[Any]) -> Steps | None:
    return Steps(space) if isinstance(space, ReachabilityGraph) and space.discipline is Discipline.STEP else None


def self_loop_free(space: StateSpace[Any]) -> Verdict:
    """No place is both input and output of a transition."""
    question = Question(
        "self-loops",
        "no place is both input and output of one transition",
        Weight.WARNING,
        hint="the transition is dead; if it only reads the place, write a permissive gate",
    )
    found = self_loops(space.net)
    return question.ask(space, lambda: Answer(not found, found))


def _size(space: StateSpace[Any]) -> dict[str, Any]:
    """The figures that need no question."""
    held = space.engine.bytes_per_marking if isinstance(space, ReachabilityGraph) else None
    firable = Player(space.net).firable(space.net.initial_marking)
    return {
        "markings": space.n_markings,
        "edges": space.n_edges,
        "complete": space.complete,
        "bytes_per_marking": held,
        "self_loops": self_loops(space.net),
        "firable_in_initial_marking": tuple(space.net.transitions[t].name for t in firable),
    }


def figures(behaviour: Behaviour[Any], conflicts: ConflictAnalysis[Any], steps: Steps | None) -> Figures:
    """The figures of a state space, each None where the budget ended before it was known."""
    space = behaviour.space
    whole = space.complete

    def known(figure: Callable[[], T]) -> T | None:
        try:
            with space.turn(_FIGURE_SHARE):
                return figure()
        except (IncompleteGraph, BudgetExceeded):
            return None

    nonlive = known(lambda: behaviour.nonlive)
    return Figures(
        **_size(space),
        deadlocks=known(lambda: space.count(space.deadlocks)) if whole else None,
        doomed=known(lambda: space.count(behaviour.doomed)),
        home=known(lambda: behaviour.home),
        reversible=known(lambda: behaviour.reversible),
        live=None if nonlive is None else not nonlive,
        dead=known(lambda: behaviour.dead) if whole else None,
        nonlive=nonlive,
        contacts=known(lambda: MappingProxyType(behaviour.contacts)) if whole else None,
        structural_conflicts=conflicts.structural,
        effective_conflicts=known(lambda: conflicts.effective) if whole else None,
        gate_races=conflicts.races,
        cut_short=(
            *(("structural_conflicts",) if conflicts.structural.more else ()),
            *(("gate_races",) if conflicts.more_races else ()),
        ),
        nonserialisable=None if steps is None else known(lambda: steps.nonserialisable),
    )
