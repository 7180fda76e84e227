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

from collections.abc import Callable, Iterable
from typing import Any, Protocol, TypeVar

from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import BooleanAlgebra
from firable.semantics.firing import Valuation
from firable.semantics.trace import Discipline

S = TypeVar("S")


class WitnessError(RuntimeError):
    """A witness does not replay: an error of firable, never of the net."""


class StateSpace(Protocol[S]):
    """The markings reachable from M0 under one discipline, external gates free.

    A set is a value of type `S`. What needs all reachable markings raises `IncompleteGraph` where the space is not
    `complete`, and `BudgetExceeded` where memory ends.
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
    def n_edges(self) -> int:
        """How many pairs of a marking and what fires in it."""
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

    def require_complete(self) -> None:
        """Raise `IncompleteGraph` unless every reachable marking is known."""
        ...

    def where(self, term: Callable[[BooleanAlgebra[Any], Valuation[Any]], Any]) -> S:
        """The markings in which a Boolean term holds; `term` gets the algebra and the reader of places."""
        ...

    def satisfying(self, formula: Formula) -> S:
        """The markings in which a state formula holds."""
        ...

    def marked(self, place: int) -> S:
        """The markings in which a place holds a token."""
        ...

    def may_fire(self, t: int) -> S:
        """The markings in which a transition is firable and some valuation opens its external gates."""
        ...

    def in_contact(self, t: int) -> S:
        """The markings in contact at a transition."""
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

    def backward(self, targets: S, within: S | None = None) -> S:
        """The markings from which a target can be reached (EF), going only through `within` (E[within U targets])."""
        ...

    def endless(self, within: S | None = None) -> S:
        """The markings from which a run can go on for ever inside `within` (EG over infinite runs only)."""
        ...

    def home(self) -> S:
        """The home markings: those that can be reached from every reachable marking."""
        ...

    def witness(self, targets: S, note: str = "") -> Witness | None:
        """A firing sequence from M0 into a set, shortest where the technique gives it, and replayed.

        None where no marking found is in the set. Raises `WitnessError` where it does not replay.
        """
        ...
