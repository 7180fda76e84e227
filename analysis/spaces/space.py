"""What a state space is: sets of reachable markings, and what leads to what, behind one interface.

The verdicts ask questions of the kind "which markings are deadlocks", "from which of them can this transition fire
again". They do not care whether the markings stand in a table or in a decision diagram, so they are written once over
this interface, and each technique that holds all reachable markings is one file that implements it. Sets of markings
have a type `S` of their own for each technique, closed under the Boolean algebra that the firing rule is evaluated in:
`~s` is the complement *within the reachable markings*.

The rejected alternative, a symbolic copy of each verdict beside the explicit one, is how two methods of one tool come
to disagree on what a word means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any, Generic, Protocol, TypeVar

from firable.analysis.deadline import Deadline
from firable.analysis.spaces.bottoms import SEARCHES, Bottoms
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import BooleanAlgebra
from firable.semantics.firing import Valuation, firable, in_contact
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, NotFirableError, Player
from firable.semantics.trace import Discipline

S = TypeVar("S")


class WitnessError(RuntimeError):
    """A witness does not replay: an error of firable, never of the net."""


class StateSpace(Protocol[S]):
    """The markings reachable from M0 under one discipline, external gates free.

    A set is a value of type `S`. What needs all reachable markings raises `IncompleteGraph` where the space is not
    `complete`, and `BudgetExceeded` where memory or time ends. The second half follows from the first (`Derived`); a
    technique writes of it what it knows a quicker way for.
    """

    @property
    def net(self) -> Net:
        """The net."""
        ...

    @property
    def discipline(self) -> Discipline:
        """How transitions fire."""
        ...

    @property
    def method(self) -> str:
        """The technique, in words: what a verdict names as its method."""
        ...

    @property
    def complete(self) -> bool:
        """Whether every reachable marking was found."""
        ...

    @property
    def bound(self) -> str:
        """How far an incomplete search went, in words; empty where it is complete."""
        ...

    @property
    def cost(self) -> Cost:
        """What finding the markings took."""
        ...

    @property
    def n_markings(self) -> int:
        """How many markings were found, exactly."""
        ...

    @property
    def n_edges(self) -> int | None:
        """How many pairs of a marking and what fires in it; None where counting them took too long."""
        ...

    @property
    def algebra(self) -> BooleanAlgebra[S]:
        """The sets of markings as a Boolean algebra; true is all of them."""
        ...

    @property
    def initial(self) -> S:
        """The set of M0 alone."""
        ...

    @property
    def deadlocks(self) -> S:
        """The markings where no transition is firable and openable, among those that were expanded."""
        ...

    @property
    def deadline(self) -> Deadline:
        """When questions to the space end."""
        ...

    @property
    def moment(self) -> Deadline:
        """When the question whose turn it is ends: that of the turn, or the deadline where there is none."""
        ...

    def until(self, deadline: Deadline) -> StateSpace[S]:
        """The same space, for questions that end with another deadline."""
        ...

    def turn(self, share: float, most_seconds: float = inf, /) -> AbstractContextManager[Deadline]:
        """Let what is asked meanwhile take at most this part of the time that is left, and so many seconds.

        What asks for many things, each of them short, asks the `moment` of the turn itself.
        """
        ...

    def expect(self, formulas: int) -> None:
        """Get ready for so many formulas of CTL, where they come to more than that takes.

        Raises `IncompleteGraph` where the space is not whole.
        """
        ...

    def require_complete(self) -> None:
        """Raise `IncompleteGraph` unless every reachable marking is known."""
        ...

    def fullest(self, places: Sequence[int]) -> tuple[int, S]:
        """The greatest number of tokens on places together, and markings with as many, at least one of them.

        Places by index; one that stands twice counts twice. Raises `IncompleteGraph` where the space is not whole.
        """
        ...

    def where(self, term: Callable[[BooleanAlgebra[Any], Valuation[Any]], Any]) -> S:
        """The markings in which a Boolean term holds; `term` gets the algebra and the reader of places."""
        ...

    def alone(self, marking: Marking) -> S:
        """The set of one marking; the empty set for one that was not found."""
        ...

    def contains(self, markings: S, marking: Marking) -> bool:
        """Whether a marking is in a set; False for one that was not found."""
        ...

    def count(self, markings: S) -> int:
        """How many markings a set holds, exactly; 0 is the test for emptiness."""
        ...

    def before(self, targets: S, by: Iterable[int] | None = None) -> S:
        """The markings with an edge into the targets (EX); with `by`, an edge that fires one of these transitions."""
        ...

    def backward(self, targets: S, within: S | None = None, by: Iterable[int] | None = None) -> S:
        """The markings from which a target can be reached (EF), going only through `within` (E[within U targets]).

        With `by`, by edges that fire one of these transitions.
        """
        ...

    def endless(self, within: S | None = None) -> S:
        """The markings from which a run can go on for ever inside `within` (EG over infinite runs only)."""
        ...

    def forward(self, sources: S) -> S:
        """The markings that can be reached from one of some, those included."""
        ...

    def one_of(self, markings: S) -> S:
        """The set of one marking, whichever, of a set that is not empty."""
        ...

    def bottom(self) -> S:
        """The markings of one bottom component: they reach each other, and nothing leads out of them."""
        ...

    def witness(self, targets: S, note: str = "") -> Witness | None:
        """A firing sequence from M0 into a set, shortest where the technique gives it, and replayed.

        None where no marking found is in the set. Raises `WitnessError` where it does not replay.
        """
        ...

    # What follows from these.

    def satisfying(self, formula: Formula) -> S:
        """The markings in which a state formula holds."""
        ...

    def marked(self, place: int) -> S:
        """The markings in which a place holds a token."""
        ...

    def may_fire(self, t: int) -> S:
        """The markings in which a transition is firable and some valuation opens its external gates."""
        ...

    def some_may_fire(self, some: Iterable[int]) -> S:
        """The markings in which one of some transitions may fire."""
        ...

    def in_contact(self, t: int) -> S:
        """The markings in contact at a transition."""
        ...

    def contacts(self) -> Sequence[int]:
        """For each transition, in how many markings it is in contact."""
        ...

    def meet_contact(self) -> Sequence[int]:
        """The transitions that are in contact in some marking found, ascending."""
        ...

    def witness_of_contact(self, among: Sequence[int]) -> Witness | None:
        """A firing sequence to a marking in contact at one of some transitions, as `witness` gives it."""
        ...

    def fired(self) -> Sequence[int]:
        """For each transition, on how many edges it fires, or 1 for "some" where only that is known."""
        ...

    def live(self) -> Sequence[bool]:
        """For each transition, whether from every marking one can be reached in which it may fire."""
        ...

    def reversible(self) -> bool:
        """Whether M0 can be reached from every marking."""
        ...

    def home(self) -> S:
        """The home markings: those that can be reached from every reachable marking."""
        ...

    def bottom_after(self, markings: S) -> S:
        """The markings of a bottom component that can be reached from some marking of a set that is not empty."""
        ...

    @property
    def bottoms(self) -> Bottoms[S]:
        """The bottom components, as far as it is worth it to find them for the properties of the net."""
        ...

    def marked_together(self, pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of places, whether some marking found has a token on both."""
        ...

    def firable_together(self, pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of transitions, whether some marking found makes both firable by Eq. (1)."""
        ...


class Derived(Generic[S]):
    """The second half of a state space, from the first."""

    def turn(self: StateSpace[S], _: float, __: float = inf, /) -> AbstractContextManager[Deadline]:
        """No limit."""
        return nullcontext(self.deadline)

    @property
    def moment(self: StateSpace[S]) -> Deadline:
        """The deadline."""
        return self.deadline

    def expect(self: StateSpace[S], _: int) -> None:
        """There is nothing to get ready."""

    def satisfying(self: StateSpace[S], formula: Formula) -> S:
        """The markings in which a state formula holds."""
        return self.where(lambda algebra, holds: evaluate(algebra, self.net, formula, holds))

    def marked(self: StateSpace[S], place: int) -> S:
        """The markings in which a place holds a token."""
        return self.where(lambda _, holds: holds(place))

    def may_fire(self: StateSpace[S], t: int) -> S:
        """The markings in which a transition is firable and some valuation opens its external gates."""
        if not self.net.transitions[t].openable:
            return self.algebra.disjunction(())
        return self.where(lambda algebra, holds: firable(algebra, self.net, t, holds))

    def some_may_fire(self: StateSpace[S], some: Iterable[int]) -> S:
        """The markings in which one of some transitions may fire."""
        return self.algebra.disjunction(map(self.may_fire, some))

    def in_contact(self: StateSpace[S], t: int) -> S:
        """The markings in contact at a transition."""
        return self.where(lambda algebra, holds: in_contact(algebra, self.net, t, holds))

    def contacts(self: StateSpace[S]) -> Sequence[int]:
        """For each transition, in how many markings it is in contact."""
        return tuple(self.count(self.in_contact(t)) for t in range(len(self.net.transitions)))

    def meet_contact(self: StateSpace[S]) -> Sequence[int]:
        """The transitions that are in contact in some marking found, ascending."""
        return tuple(t for t, count in enumerate(self.contacts()) if count)

    def witness_of_contact(self: StateSpace[S], among: Sequence[int]) -> Witness | None:
        """A firing sequence to a marking in contact at one of some transitions, as `witness` gives it."""
        return self.witness(self.algebra.disjunction(self.in_contact(t) for t in among))

    def fired(self: StateSpace[S]) -> Sequence[int]:
        """For each transition, in how many markings it may fire."""
        return tuple(self.count(self.may_fire(t)) for t in range(len(self.net.transitions)))

    def live(self: StateSpace[S]) -> Sequence[bool]:
        """For each transition, whether from every marking one can be reached in which it may fire.

        It suffices to look at one bottom component where that is the only one, and else at each transition.
        """
        self.require_complete()
        transitions = range(len(self.net.transitions))
        if self.reversible():
            return tuple(fired > 0 for fired in self.fired())
        home = self.home()
        if self.count(home):
            return tuple(self.count(self.algebra.conjunction([home, self.may_fire(t)])) > 0 for t in transitions)
        return tuple(self.count(self.backward(self.may_fire(t))) == self.n_markings for t in transitions)

    def reversible(self: StateSpace[S]) -> bool:
        """Whether M0 can be reached from every marking."""
        self.require_complete()
        return self.count(self.backward(self.initial)) == self.n_markings

    def home(self: StateSpace[S]) -> S:
        """The home markings: the bottom component, where every marking leads into it."""
        bottom = self.bottom()
        return bottom if self.count(self.backward(bottom)) == self.n_markings else self.algebra.disjunction(())

    def bottom_after(self: StateSpace[S], markings: S) -> S:
        """The markings of a bottom component that can be reached from some marking of a set that is not empty."""
        while True:
            one = self.one_of(markings)
            after = self.forward(one)
            rest = self.algebra.conjunction([after, self.algebra.negation(self.backward(one, after))])
            if not self.count(rest):
                return after
            markings = rest  # from none of them can that one be reached again, so this ends

    @cached_property
    def bottoms(self: StateSpace[S]) -> Bottoms[S]:
        """The bottom components, as far as it is worth it to find them for the properties of the net."""
        return Bottoms(self, len(self.net.possibilities) // SEARCHES)

    def marked_together(self: StateSpace[S], pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of places, whether some marking found has a token on both."""
        marked = {p: self.marked(p) for p in sorted({p for pair in pairs for p in pair})}
        return tuple(self.count(self.algebra.conjunction([marked[p], marked[q]])) > 0 for p, q in pairs)

    def firable_together(self: StateSpace[S], pairs: Sequence[tuple[int, int]]) -> Sequence[bool]:
        """For each pair of transitions, whether some marking found makes both firable by Eq. (1)."""

        def by_eq_1(t: int) -> S:
            return self.where(lambda algebra, holds: firable(algebra, self.net, t, holds))

        where = {t: by_eq_1(t) for t in sorted({t for pair in pairs for t in pair})}
        return tuple(self.count(self.algebra.conjunction([where[t], where[u]])) > 0 for t, u in pairs)


@dataclass(frozen=True)
class Witnesses:
    """Firing sequences of a net under a discipline: played by the reference player, and put into the net's names."""

    net: Net
    discipline: Discipline

    @cached_property
    def player(self) -> Player:
        """The reference player."""
        return Player(self.net)

    def play(self, marking: Marking, firings: Iterable[FiringSet]) -> Marking:
        """Play a firing sequence from a marking; the marking after it.

        Raises `WitnessError` where it is none of the net.
        """
        for fired in firings:
            allowed = self.player.is_step(marking, fired) if self.discipline is Discipline.STEP else len(fired) == 1
            if not allowed or not all(self.net.transitions[t].openable for t in fired):
                raise WitnessError(f"{self.names(fired)} may not fire in {self.net.names(marking)}")
            try:
                marking = self.player.fire(marking, fired)
            except NotFirableError as error:
                raise WitnessError(str(error)) from error
        return marking

    def named(
        self, firings: Iterable[FiringSet], marking: Marking, cycle: Iterable[FiringSet] = (), note: str = ""
    ) -> Witness:
        """A firing sequence, the marking it ends in, and what is fired for ever after it, in the names of the net."""
        return Witness(
            tuple(self.names(fired) for fired in firings),
            tuple(self.names(fired) for fired in cycle),
            self.net.names(marking),
            note=note,
        )

    def replayed(self, firings: Sequence[FiringSet], reached: Marking, note: str = "") -> Witness:
        """The witness that a firing sequence from M0 is, which must end in the marking given.

        Raises `WitnessError` where it does not replay or ends elsewhere.
        """
        if self.play(self.net.initial_marking, firings) != reached:
            raise WitnessError("the firing sequence ends in another marking")
        return self.named(firings, reached, note=note)

    def names(self, fired: FiringSet) -> tuple[str, ...]:
        """The names of the transitions fired together."""
        return tuple(self.net.transitions[t].name for t in fired)
