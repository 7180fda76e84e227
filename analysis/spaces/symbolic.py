"""The symbolic state space: all reachable markings as a decision diagram, however many there are.

A net of independent parts has as many markings as the product of those of its parts, and a diagram as large as their
sum. So where the explicit graph ends at 10^8 markings, this one goes on to 10^1000, if the net has a good order of
places; the Rust engine (`analysis/engine/src/symbolic`) looks for one, and gives up within its budget where there is
none. The search is saturation (Ciardo, Lüttgen, Siminiscu 2001), which finds all markings or none: there is no part of
a space to draw wrong conclusions from.

Sets of markings are values with `&`, `|` and `^`, so that the one text of the firing rule is evaluated on them as on
everything else. Only what is asked of all transitions at once goes to the engine's own copy of the rule, since a set
for each of them would be quadratic in the length of the net.

Interleaving only: a maximal step is a choice of a set of transitions, and the relation "one after the other" that
saturation lives on does not hold of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import Any

from firable.analysis import _engine
from firable.analysis._engine import BudgetExceeded, MarkingSet
from firable.analysis.compiled import engine_limits, flat
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.space import Derived, Witnesses
from firable.nets.formula import And, Deadlock, Firable, Formula, Holds, Not, Or, Start
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import Bitwise, BooleanAlgebra
from firable.semantics.firing import Valuation
from firable.semantics.formulas import evaluate
from firable.semantics.trace import Discipline

METHOD = "decision diagram, interleaving"
EDGES_SHARE = 0.1
"""The part of the time left that counting edges may take."""


@dataclass(frozen=True)
class SymbolicSpace(Derived[MarkingSet]):
    """The markings reachable from M0 under interleaving, all of them, as a decision diagram.

    What is not done when the `deadline` comes, or memory ends, raises `BudgetExceeded`. The numbers of markings and of
    edges (pairs of a marking and a transition that may fire in it) are exact, and counted once; a number of edges that
    was `counted` is known to the same space with another deadline.
    """

    net: Net
    engine: _engine.Diagram
    n_markings: int
    deadline: Deadline = NEVER
    counted: dict[str, int] = field(default_factory=dict, compare=False, repr=False)
    _turns: list[Deadline] = field(default_factory=list, init=False, compare=False, repr=False)
    discipline: Discipline = Discipline.INTERLEAVING
    method: str = METHOD
    complete: bool = True
    bound: str = ""

    def until(self, deadline: Deadline) -> SymbolicSpace:
        """The same space, for questions that end with another deadline; so do those to this one from now on."""
        self.engine.limit(**engine_limits(deadline))
        return replace(self, deadline=deadline)

    @property
    def moment(self) -> Deadline:
        """When the question of this turn ends."""
        return self._turns[-1] if self._turns else self.deadline

    @contextmanager
    def turn(self, share: float, most_seconds: float = inf, /) -> Iterator[Deadline]:
        """Let what is asked meanwhile take at most this part of the time left: one fixpoint may take all of it."""
        turn = self.moment.share(share).within(most_seconds)
        self._turns.append(turn)
        self.engine.limit(**engine_limits(turn))
        try:
            yield turn
        finally:
            self._turns.pop()
            self.engine.limit(**engine_limits(self.moment))

    def require_complete(self) -> None:
        """It always is: an incomplete search makes no space."""

    @cached_property
    def reach(self) -> MarkingSet:
        """All reachable markings."""
        return self.engine.reach()

    @cached_property
    def none(self) -> MarkingSet:
        """The empty set of markings."""
        return self.engine.empty()

    @cached_property
    def algebra(self) -> Bitwise[MarkingSet]:
        """The sets of markings as a Boolean algebra; true is all of them."""
        return Bitwise(true=self.reach, false=self.none)

    @property
    def cost(self) -> Cost:
        """What finding the markings took."""
        return Cost(self.n_markings, self.n_edges, self.engine.seconds)

    @cached_property
    def n_edges(self) -> int | None:
        """How many pairs of a marking and what fires in it, or None where to count them takes too long.

        That may be far longer than the search: a number as long as the net for each of the diagram's nodes. As it is
        told with every verdict and decides none, it may take but a part of the time that is left.
        """
        if "edges" not in self.counted:
            try:
                with self.turn(EDGES_SHARE):
                    self.counted["edges"] = self.reach.edges()
            except BudgetExceeded:
                return None
        return self.counted["edges"]

    @cached_property
    def initial(self) -> MarkingSet:
        """The set of M0 alone."""
        return self.engine.initial()

    @cached_property
    def deadlocks(self) -> MarkingSet:
        """The markings where no transition is firable and openable."""
        return self.reach - self.engine.firable(self.reach)

    @cached_property
    def witnesses(self) -> Witnesses:
        """What replays every witness."""
        return Witnesses(self.net, self.discipline)

    @cached_property
    def _holding(self) -> dict[int, MarkingSet]:
        return {}

    def marked(self, place: int) -> MarkingSet:
        """The markings in which a place holds a token."""
        if place not in self._holding:
            self._holding[place] = self.engine.having(self.reach, [place], [])
        return self._holding[place]

    def where(self, term: Callable[[BooleanAlgebra[Any], Valuation[Any]], Any]) -> MarkingSet:
        """The markings in which a Boolean term holds; `term` gets the algebra and the reader of places."""
        found: MarkingSet = term(self.algebra, self.marked)
        return found

    def satisfying(self, formula: Formula) -> MarkingSet:
        """The markings in which a state formula holds."""
        match formula:
            case Deadlock():
                return self.deadlocks
            case Start():
                return self.initial
            case Firable(name):
                return self.may_fire(self.net.transition_index[name])
            case Not(operand):
                return self.algebra.negation(self.satisfying(operand))
            case And(operands):
                full, empty, others = _literals(self.net, operands)
                within = self.engine.having(self.reach, full, empty) if full or empty else self.reach
                return self.algebra.conjunction([within, *map(self.satisfying, others)])
            case Or(operands):
                return self.algebra.disjunction(map(self.satisfying, operands))
        return self.where(lambda algebra, holds: evaluate(algebra, self.net, formula, holds))

    def alone(self, marking: Marking) -> MarkingSet:
        """The set of one marking; the empty set for one that is not reachable."""
        places = range(len(self.net.places))
        full, empty = [p for p in places if marking >> p & 1], [p for p in places if not marking >> p & 1]
        return self.engine.having(self.reach, full, empty)

    def contains(self, markings: MarkingSet, marking: Marking) -> bool:
        """Whether a marking is in a set; False for one that is not reachable."""
        return markings.contains([i for i in range(len(self.net.places)) if marking >> i & 1])

    def fullest(self, places: Sequence[int]) -> tuple[int, MarkingSet]:
        """The greatest number of tokens on places together, and a marking with as many; one pass over the diagram."""
        marked = self.engine.greatest(self.reach, list(places)) or []
        full = set(marked)
        return sum(place in full for place in places), self.engine.single(marked)

    def count(self, markings: MarkingSet) -> int:
        """How many markings a set holds, exactly."""
        return markings.count()

    def before(self, targets: MarkingSet, by: Iterable[int] | None = None) -> MarkingSet:
        """The markings with an edge into the targets (EX); with `by`, an edge that fires one of these transitions."""
        return self.engine.before(targets, None if by is None else sorted(set(by)))

    def backward(
        self, targets: MarkingSet, within: MarkingSet | None = None, by: Iterable[int] | None = None
    ) -> MarkingSet:
        """The markings from which a target can be reached (EF), going only through `within` (E[within U targets]).

        With `by`, by firings of these transitions alone.
        """
        return self.engine.backward(targets, within, None if by is None else sorted(set(by)))

    def endless(self, within: MarkingSet | None = None) -> MarkingSet:
        """The markings from which a run can go on for ever inside `within` (EG over infinite runs only)."""
        return self.engine.endless(self.reach if within is None else within)

    def forward(self, sources: MarkingSet) -> MarkingSet:
        """The markings that can be reached from one of some, those included."""
        return self.engine.forward(sources)

    def one_of(self, markings: MarkingSet) -> MarkingSet:
        """The set of one marking of a set that is not empty."""
        return self.engine.single(markings.any() or [])

    def bottom(self) -> MarkingSet:
        """The markings of one bottom component; a deadlock where there is one."""
        return self.bottom_after(self.deadlocks or self.initial)

    def reversible(self) -> bool:
        """Whether M0 can be reached from every marking."""
        return self.backward(self.initial) == self.reach

    def home(self) -> MarkingSet:
        """The home markings: those that can be reached from every reachable marking."""
        if self.reversible():
            return self.reach
        bottom = self.bottom()
        return bottom if self.backward(bottom) == self.reach else self.none

    def live(self) -> Sequence[bool]:
        """For each transition, whether from every marking one can be reached in which it may fire.

        That is so where it may fire in each bottom component, as every run can be led into one of them.
        """
        if self.deadlocks:
            return (False,) * len(self.net.transitions)
        live = [True] * len(self.net.transitions)
        left = self.reach
        while left and any(live):
            bottom = self.bottom_after(self.initial & left or left)
            live = [before and here for before, here in zip(live, self._fire_in(bottom), strict=True)]
            left -= self.backward(bottom)
        return live

    def may_fire(self, t: int) -> MarkingSet:
        """The markings in which a transition is firable and some valuation opens its external gates."""
        return self.engine.having(self.reach, *self._test(t)) if self.net.transitions[t].openable else self.none

    def fired(self) -> Sequence[int]:
        """For each transition, 1 where it may fire in some marking."""
        return tuple(map(int, self._fire_in(self.reach)))

    def _fire_in(self, markings: MarkingSet) -> list[bool]:
        fires = self.engine.which(markings, [self._test(t) for t in range(len(self.net.transitions))])
        return [fires[t] and transition.openable for t, transition in enumerate(self.net.transitions)]

    def _test(self, t: int) -> tuple[list[int], list[int]]:
        """Eq. (1) of a transition: the places that must be full, and those that must be empty."""
        transition, index = self.net.transitions[t], self.net.place_index
        full = [index[place] for place in (*transition.inputs, *transition.permissive)]
        return full, [index[place] for place in (*transition.outputs, *transition.inhibitive)]

    def contacts(self) -> Sequence[int]:
        """For each transition, in how many markings it is in contact."""
        counts = [0] * len(self.net.transitions)
        tests = [(t, test) for t in self.meet_contact() for test in self._contact_tests(t)]
        found = self.engine.counts(self.in_any_contact, [test for _, test in tests])
        for (t, _), count in zip(tests, found, strict=True):
            counts[t] += count
        return tuple(counts)

    @cached_property
    def in_any_contact(self) -> MarkingSet:
        """The markings in contact at some transition."""
        return self.engine.in_contact(self.reach)

    def meet_contact(self) -> Sequence[int]:
        """The transitions that are in contact in some marking, ascending; asked for all at once, without their sets."""
        if not self.in_any_contact:
            return ()
        tests = [(t, test) for t in range(len(self.net.transitions)) for test in self._contact_tests(t)]
        met = self.engine.which(self.in_any_contact, [test for _, test in tests])
        return sorted({t for (t, _), here in zip(tests, met, strict=True) if here})

    def witness_of_contact(self, among: Sequence[int]) -> Witness | None:
        """A firing sequence to a marking in contact at one of some transitions, as `witness` gives it."""
        if set(among) >= set(self.meet_contact()):
            return self.witness(self.in_any_contact)
        return super().witness_of_contact(among)

    def _contact_tests(self, t: int) -> list[tuple[list[int], list[int]]]:
        """What must be full and empty for contact: one output place outside I(t) full, and those before it empty.

        So no marking in contact passes two of the tests.
        """
        transition, index = self.net.transitions[t], self.net.place_index
        full = [index[place] for place in (*transition.inputs, *transition.permissive)]
        empty = [index[place] for place in transition.inhibitive]
        outside = [index[place] for place in transition.outputs if place not in transition.inputs]
        return [([*full, place], [*empty, *outside[:at]]) for at, place in enumerate(outside)]

    def marked_together(self, pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of places, whether some marking has a token on both; all in one pass, without their sets."""
        return self.engine.which(self.reach, [([p, q], []) for p, q in pairs])

    def firable_together(self, pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of transitions, whether some marking makes both firable by Eq. (1)."""
        tests = [self._test(t) for t in range(len(self.net.transitions))]
        both = [([*tests[t][0], *tests[u][0]], [*tests[t][1], *tests[u][1]]) for t, u in pairs]
        return self.engine.which(self.reach, both)

    def witness(self, targets: MarkingSet, note: str = "") -> Witness | None:
        """A firing sequence from M0 into a set, replayed; a shortest one where few layers of a search lead there.

        Raises `WitnessError` where it does not replay, `BudgetExceeded` where none is found of a set that is not empty.
        """
        if not targets:
            return None
        found = self.engine.path_to(targets)
        if found is None:
            raise BudgetExceeded("the search for a firing sequence was given up")
        firings, marked, _ = found
        return self.witnesses.replayed([(t,) for t in firings], sum(1 << place for place in marked), note)


def _literals(net: Net, operands: Sequence[Formula]) -> tuple[list[int], list[int], list[Formula]]:
    """Of a conjunction: the places that must be full, those that must be empty, and the other operands."""
    full, empty, others = list[int](), list[int](), list[Formula]()
    for operand in operands:
        match operand:
            case Holds(place):
                full.append(net.place_index[place])
            case Not(Holds(place)):
                empty.append(net.place_index[place])
            case _:
                others.append(operand)
    return full, empty, others


def explore_symbolically(
    net: Net, limits: Limits | None = None, *, orders: Sequence[Sequence[int]] | None = None
) -> SymbolicSpace:
    """All reachable markings of a net under interleaving, external gates free.

    Who knows good orders of the places gives the indexes of the places for each, from the lowest level of the diagram
    to the highest; else the engine makes some. Where there are several, they race each other, by two threads where the
    limits allow two. Raises `BudgetExceeded` where the limits of memory or time end the search before it has found all.

    >>> from firable.nets.catalogue.families import family_net
    >>> space = explore_symbolically(family_net("philosophers_either-100"))
    >>> space.n_markings == 3**100, space.count(space.deadlocks)
    (True, 2)
    """
    limits = limits or Limits()
    diagram = _engine.explore_symbolically(
        *flat(net),
        max_memory_bytes=limits.memory_bytes,
        threads=limits.threads,
        second_free=limits.second_free,
        orders=None if orders is None else [list(order) for order in orders],
        **engine_limits(limits.deadline),
    )
    reach = diagram.reach()
    return SymbolicSpace(net, diagram, reach.count(), limits.deadline)
