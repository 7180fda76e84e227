"""The reachability graph of a net, explored by the engine and spoken of in the net's own names.

Everything that the explicit method decides is a question to this graph. The Rust engine finds the markings, breadth
first, and answers questions of graph theory; here markings get their names, state formulas become columns
(`columns.py`, loaded with numpy where the first is asked for), and a marking becomes a witness.

Every witness is replayed by the reference player before anyone sees it. The engine is fast and therefore not trusted:
a wrong path must become an internal error, never a counterexample that misleads an engineer.

Columns are computed part by part, because a column of Booleans for each place of ten million markings takes more memory
than the graph. Those of places are kept, packed, as far as they fit: questions are many, and of the same places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Any, Final

from firable.analysis import _engine
from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.compiled import engine_limits, flat
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.space import Derived, Witnesses
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import Formula, Or
from firable.nets.net import Fairness, Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import Bitwise, BooleanAlgebra
from firable.semantics.firing import Valuation, firable
from firable.semantics.player import FiringSet
from firable.semantics.trace import Discipline

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from firable.analysis.spaces.columns import Column, Places, Room

__all__ = [
    "Budget",
    "BudgetExceeded",
    "IncompleteGraph",
    "ReachabilityGraph",
    "explore",
]

_KEPT_SHARE: Final = 8
"""The columns that are kept take at most this part of the memory that the exploration may take."""
_FEW_MAX: Final = 2**22
_FEW_SHARE: Final = 0.5
"""So many markings are few, and are found in this part of the time that a technique has."""
_LARGE: Final = 8
"""So many parts make a disjunction large."""
_METHODS: Final = {
    Discipline.INTERLEAVING: "reachability graph, interleaving",
    Discipline.STEP: "reachability graph, synchronous steps",
}
REASONS: Final = {
    "markings": "the budget of markings is used up",
    "memory": "the budget of memory is used up",
    "time": "the time was over",
    "interrupted": "interrupted",
    "cancelled": "the answer is no longer needed",
}


@dataclass(frozen=True, slots=True)
class Budget:
    """How much an exploration may take before it ends as UNKNOWN: markings, bytes held by the engine, seconds."""

    markings: int = 20_000_000
    memory_bytes: int = 2 * 2**30
    seconds: float | None = None


@dataclass(frozen=True)
class ReachabilityGraph(Derived["Column"]):
    """The markings reachable from M0 under one discipline, numbered breadth first; M0 is 0.

    A marking with a lower number is never farther from M0, so the lowest number of a set is its shortest witness. What
    needs the whole graph raises `IncompleteGraph` where it is not `complete`, and what is not done when the `deadline`
    comes raises `BudgetExceeded`.
    """

    net: Net
    discipline: Discipline
    budget: Budget
    engine: _engine.Graph
    deadline: Deadline = NEVER
    _turns: list[Deadline] = field(default_factory=list, init=False, compare=False, repr=False)

    @cached_property
    def algebra(self) -> Bitwise[Column]:
        """The sets of markings as a Boolean algebra; true is all of them."""
        from firable.analysis.spaces.columns import constant

        return Bitwise(true=constant(self.n_markings, holds=True), false=self.none())

    @property
    def method(self) -> str:
        """The technique, in words."""
        return _METHODS[self.discipline]

    @property
    def complete(self) -> bool:
        """Whether every reachable marking was found and expanded."""
        return self.engine.complete

    @property
    def n_markings(self) -> int:
        """How many markings were found."""
        return self.engine.n_markings

    @property
    def n_edges(self) -> int:
        """How many edges were followed."""
        return self.engine.n_edges

    @property
    def cost(self) -> Cost:
        """What the exploration took."""
        return Cost(self.n_markings, self.n_edges, self.engine.seconds)

    @property
    def bound(self) -> str:
        """How far an incomplete exploration went, in words; empty where it is complete."""
        if self.complete:
            return ""
        reason = REASONS.get(self.engine.reason or "", str(self.engine.reason))
        return f"{self.n_markings:,} markings found, {self.n_edges:,} edges followed: {reason}"

    @property
    def _limits(self) -> dict[str, Any]:
        """What ends the engine's long work."""
        return engine_limits(self.moment)

    @cached_property
    def ascending(self) -> npt.NDArray[np.intp]:
        """The numbers of all markings, smallest marking first: the order in which a list of them is written."""
        from firable.analysis.spaces.columns import order

        return order(self._words)

    @cached_property
    def witnesses(self) -> Witnesses:
        """What replays every witness."""
        return Witnesses(self.net, self.discipline)

    def until(self, deadline: Deadline) -> ReachabilityGraph:
        """The same graph, for questions that end with another deadline."""
        return replace(self, deadline=deadline)

    @contextmanager
    def turn(self, share: float, most_seconds: float = inf, /) -> Iterator[Deadline]:
        """Let what passes over all markings meanwhile take at most this part of the time left, and so many seconds."""
        turn = self.moment.share(share).within(most_seconds)
        self._turns.append(turn)
        try:
            yield turn
        finally:
            self._turns.pop()

    @property
    def moment(self) -> Deadline:
        """When the question of this turn ends."""
        return self._turns[-1] if self._turns else self.deadline

    def require_complete(self) -> None:
        """Raise `IncompleteGraph` unless the whole graph is known."""
        if not self.complete:
            raise IncompleteGraph(self.bound)

    def marking(self, index: int) -> Marking:
        """The marking of this number, as a bit mask over the places."""
        return self.engine.marking(index)

    def markings(self, numbers: npt.NDArray[np.intp]) -> list[Marking]:
        """The markings of these numbers, as bit masks over the places."""
        from firable.analysis.spaces.columns import masks

        return masks(self._words[numbers])

    def names(self, index: int) -> tuple[str, ...]:
        """The places that hold a token in the marking of this number."""
        return self.net.names(self.marking(index))

    def index_of(self, marking: Marking) -> int | None:
        """The number of a marking, or None where it was not found."""
        return self.engine.find(marking)

    @cached_property
    def _words(self) -> npt.NDArray[np.uint64]:
        from firable.analysis.spaces.columns import words_of

        return words_of(self.engine.markings_bytes(), self.engine.words)

    @cached_property
    def _room(self) -> Room:
        from firable.analysis.spaces.columns import Room

        return Room(self.budget.memory_bytes // _KEPT_SHARE)

    @cached_property
    def _places(self) -> Places:
        from firable.analysis.spaces.columns import Places

        return Places(self._words, self._room)

    @cached_property
    def _satisfying(self) -> dict[Formula, Any]:
        return {}

    def satisfying(self, formula: Formula) -> Column:
        """The markings in which a state formula holds.

        Properties of a loop are disjunctions with what many of them share, that one of a hundred variants may fire: its
        column is kept where there is room.
        """
        from firable.analysis.spaces.columns import packed, restored

        if not isinstance(formula, Or) or not _is_large(formula):
            return super().satisfying(formula)
        large = tuple(filter(_is_large, formula.operands))
        if large:
            small = tuple(part for part in formula.operands if not _is_large(part))
            whole = self.algebra.disjunction(map(self.satisfying, large))
            return self.algebra.disjunction([whole, super().satisfying(Or(small))])
        if (kept := self._satisfying.get(formula)) is not None:
            return restored(kept, self.n_markings)
        found = super().satisfying(formula)
        if self._room.takes(column := packed(found)):
            self._satisfying[formula] = column
        return found

    def where(self, term: Callable[[BooleanAlgebra[Any], Valuation[Any]], Any]) -> Column:
        """The value of a Boolean term at every marking; `term` gets the algebra and the reader of places.

        Raises `BudgetExceeded`.
        """
        from firable.analysis.spaces.columns import COLUMNS, PART, unpacked

        result = self.none()
        for start in range(0, self.n_markings, PART):
            if start and self.moment.over:
                raise BudgetExceeded(REASONS["time"])
            part = result[start : start + PART]
            found = unpacked(term(COLUMNS, self._places.reader(start)))
            part[:] = found[: len(part)] if found.ndim else found
        return result

    def fullest(self, places: Sequence[int]) -> tuple[int, Column]:
        """The greatest number of tokens on places together, and the markings with as many; one pass over all markings.

        Raises `IncompleteGraph`, `BudgetExceeded`.
        """
        from firable.analysis.spaces.columns import fullest

        self.require_complete()
        return fullest(self._places, places, self.n_markings, self.moment)

    def some_may_fire(self, some: Iterable[int]) -> Column:
        """The markings in which one of some transitions may fire, in one pass over all markings."""
        openable = [t for t in some if self.net.transitions[t].openable]
        return self.where(lambda a, holds: a.disjunction(firable(a, self.net, t, holds) for t in openable))

    def none(self) -> Column:
        """The empty set of markings."""
        from firable.analysis.spaces.columns import constant

        return constant(self.n_markings, holds=False)

    @property
    def initial(self) -> Column:
        """The set of M0 alone."""
        found = self.none()
        found[0] = True
        return found

    @cached_property
    def deadlocks(self) -> Column:
        """The deadlocks among the markings that were expanded."""
        found = self.none()
        found[self.engine.deadlocks()] = True
        return found

    def alone(self, marking: Marking) -> Column:
        """The set of one marking; the empty set for one that was not found."""
        found = self.none()
        if (index := self.index_of(marking)) is not None:
            found[index] = True
        return found

    def contains(self, markings: Column, marking: Marking) -> bool:
        """Whether a marking is in a set; False for one that was not found."""
        index = self.index_of(marking)
        return index is not None and bool(markings[index])

    def count(self, markings: Column) -> int:
        """How many markings a set holds."""
        from firable.analysis.spaces.columns import size

        return size(markings)

    def successors(self, index: int) -> list[tuple[FiringSet, int]]:
        """What may fire in a marking, and the number of the marking after it."""
        return [(tuple(fired), target) for fired, target in self.engine.successors(index, **self._limits)]

    def expect(self, formulas: int) -> None:
        """Get ready for so many formulas of CTL, where they come to more than that takes.

        What is not ready when the turn ends is given up. Raises `IncompleteGraph`.
        """
        with suppress(BudgetExceeded):
            self.engine.expect(formulas, **self._limits)

    def before(self, targets: Column, by: Iterable[int] | None = None) -> Column:
        """The markings with an edge into the targets (EX); with `by`, an edge that fires one of these transitions."""
        bitmap = self.engine.before(targets.tobytes(), None if by is None else list(by), **self._limits)
        return _column(bitmap)

    def backward(self, targets: Column, within: Column | None = None, by: Iterable[int] | None = None) -> Column:
        """The markings from which a target can be reached (EF), going only through `within` (E[within U targets]).

        With `by`, by edges that fire one of these transitions.
        """
        if self.complete and targets.all() and not self.moment.over:
            return targets.copy()
        transitions = None if by is None else list(by)
        return _column(self.engine.backward(targets.tobytes(), _part(within), transitions, **self._limits))

    def forward(self, sources: Column) -> Column:
        """The markings that can be reached from one of some, those included."""
        return _column(self.engine.forward(sources.tobytes(), **self._limits))

    def one_of(self, markings: Column) -> Column:
        """The set of one marking of a set that is not empty, drawn at random, the same way each time.

        One that is chosen by where it stands may be the worst: of a chain, the one that all others are reached from.
        """
        from firable.analysis.spaces.columns import some

        found = self.none()
        found[some(markings)] = True
        return found

    def endless(self, within: Column | None = None) -> Column:
        """The markings from which a run can go on for ever inside `within` (EG over infinite runs only)."""
        return _column(self.engine.endless(_part(within), **self._limits))

    def bottom(self) -> Column:
        """The markings of the bottom component that is nearest to M0."""
        return _column(self.engine.bottom(**self._limits))

    def contacts(self) -> Sequence[int]:
        """For each transition, in how many markings found it is in contact."""
        return self.engine.contacts()

    def witness_of_contact(self, among: Sequence[int]) -> Witness | None:
        """A shortest firing sequence to a marking in contact at one of some transitions, which the engine has noted."""
        found = [index for t in among if (index := self.engine.contact_witness(t)) is not None]
        return self.witness_at(min(found)) if found else None

    def fired(self) -> Sequence[int]:
        """For each transition, on how many edges it fires."""
        return self.engine.fired()

    def live(self) -> Sequence[bool]:
        """For each transition, whether from every marking one can be reached in which it may fire."""
        return self.engine.live(**self._limits)

    def reversible(self) -> bool:
        """Whether M0 can be reached from every marking."""
        return self.engine.reversible(**self._limits)

    def home(self) -> Column:
        """The home markings: those that can be reached from every reachable marking."""
        return _column(self.engine.home_markings(**self._limits))

    def firable_together(self, pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of transitions, whether some marking found makes both firable by Eq. (1)."""
        return tuple(lowest is not None for lowest in self.engine.effective_conflicts(list(pairs), **self._limits))

    def fair_components(self, within: Column, fairness: Fairness) -> npt.NDArray[np.uint32]:
        """For each marking the component in which a fair run can go on for ever inside a set, or `NO_COMPONENT`.

        A run that meets all markings of such a component again and again, and fires all that fires in it, is fair.
        """
        from firable.analysis.spaces.columns import numbers

        return numbers(self.engine.fair(within.tobytes(), fairness.value, **self._limits))

    def edges(self) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint32]]:
        """The edges as compressed rows: the offset of each marking's row, and the targets."""
        from firable.analysis.spaces.columns import numbers, words_of

        offsets, targets = self.engine.edges(**self._limits)
        return words_of(offsets, 1)[:, 0], numbers(targets)

    def witness(self, targets: Column, note: str = "") -> Witness | None:
        """A shortest firing sequence from M0 into a set, replayed; None where no marking found is in it."""
        from firable.analysis.spaces.columns import first

        index = first(targets)
        return None if index is None else self.witness_at(index, note)

    def witness_at(self, index: int, note: str = "") -> Witness:
        """A shortest firing sequence from M0 to a marking, replayed by the reference player.

        Raises `WitnessError` where it does not replay.
        """
        firings = [tuple(fired) for fired in self.engine.path_to(index)]  # what was found is shown, however late it is
        return self.witnesses.replayed(firings, self.marking(index), note)


def _is_large(formula: Formula) -> bool:
    """Whether it is a large disjunction, or one with such a part."""
    return isinstance(formula, Or) and (len(formula.operands) >= _LARGE or any(map(_is_large, formula.operands)))


def explore(
    net: Net,
    discipline: Discipline | str = Discipline.INTERLEAVING,
    budget: Budget | None = None,
    *,
    deadline: Deadline = NEVER,
    progress: Callable[[int, int], object] | None = None,
    threads: int = 1,
    second_free: Callable[[], bool] | None = None,
) -> ReachabilityGraph:
    """The reachability graph of a net, external gates free, or as much of it as the budget allows.

    The `deadline` ends the exploration and, later, the questions to the graph; the seconds of the budget end the
    exploration alone. `progress` is told the markings and edges found so far, some twenty times a second, at first
    more often. Two `threads` share the large levels of interleaving, those that begin while `second_free` says that a
    processor is free for the second; they number the markings of a level in another order than one does, the same every
    time.

    Raises `InputError` F3004 where the budget of memory does not even hold the net.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    >>> graph = explore(net)
    >>> graph.n_markings, graph.n_edges, graph.names(1)
    (2, 1, ('q',))
    """
    discipline, budget = Discipline(discipline), budget or Budget()
    try:
        graph = _explored(net, discipline, budget, deadline, progress, threads, second_free)
    except BudgetExceeded:
        message = f"the budget of {budget.memory_bytes:,} bytes does not hold the net itself, let alone its markings"
        raise InputError(
            [Diagnostic("F3004", message, "give it a larger budget of memory, or the method `symbolic`")]
        ) from None
    return ReachabilityGraph(net, discipline, budget, graph, deadline)


def explore_few(net: Net, limits: Limits) -> ReachabilityGraph:
    """The markings of a net where they are few, in a part of the time that a technique has; questions have all of it.

    Raises `BudgetExceeded` where the memory that it has does not hold the net itself.
    """
    budget = Budget(_FEW_MAX, limits.memory_bytes)
    try:
        return explore(net, budget=budget, deadline=limits.deadline.share(_FEW_SHARE)).until(limits.deadline)
    except InputError as error:
        raise BudgetExceeded(error.diagnostics[0].message) from None


def _explored(
    net: Net,
    discipline: Discipline,
    budget: Budget,
    deadline: Deadline,
    progress: Callable[[int, int], object] | None,
    threads: int,
    second_free: Callable[[], bool] | None,
) -> _engine.Graph:
    if 8 * -(-len(net.places) // 64) * len(net.transitions) > budget.memory_bytes:
        raise BudgetExceeded(REASONS["memory"])  # the engine would find that out after it had taken them
    limits = engine_limits(deadline)
    limits["max_seconds"] = min((t for t in (limits["max_seconds"], budget.seconds) if t is not None), default=None)
    return _engine.explore(
        *flat(net),
        step=discipline is Discipline.STEP,
        max_markings=budget.markings,
        max_memory_bytes=budget.memory_bytes,
        threads=threads if discipline is Discipline.INTERLEAVING else 1,
        second_free=second_free,
        progress=progress,
        **limits,
    )


def _column(bitmap: bytes) -> Column:
    from firable.analysis.spaces.columns import column

    return column(bitmap)


def _part(within: Column | None) -> bytes | None:
    """Some markings as the engine takes them: where they are all, none of them need be looked up."""
    return None if within is None or within.all() else within.tobytes()
