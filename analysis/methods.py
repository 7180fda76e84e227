"""The table of techniques that `check` may use, and what each of them can decide.

To add one: its file, which opens with the idea and its source, and one row here. A technique either *holds* all
markings, so that every verdict may be asked of it, or decides *goals*, or *knows* some verdicts at once from the
structure of the net, or decides *formulas* of a temporal logic. They are loaded when they are used, because solvers
take a second to load. Who knows may be asked twice, and may go on then where the time had ended.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

from firable.nets.temporal import Logic

if TYPE_CHECKING:  # the command line reads this table for its help, and so loads nothing with it
    from firable.analysis.goal import Finding, Limits
    from firable.analysis.question import Known
    from firable.analysis.spaces.space import StateSpace
    from firable.nets.formula import Formula
    from firable.nets.net import Net
    from firable.nets.temporal import Temporal

    GoalDecider = Callable[[Net], Callable[[Formula, Limits], Finding]]
    SpaceMaker = Callable[[Net, Limits], StateSpace[Any]]
    Knower = Callable[[Net], Callable[[Limits], Mapping[str, Known]]]
    FormulaDecider = Callable[[Net], Callable[[Temporal, Limits], Known]]


class Method(StrEnum):
    """What `--method` names."""

    AUTO = "auto"
    EXPLICIT = "explicit"
    STRUCTURE = "structure"
    SYMBOLIC = "symbolic"
    REDUCTION = "reduction"
    STATE_EQUATION = "state-equation"
    BOUNDED = "bounded"
    K_INDUCTION = "k-induction"
    PDR = "pdr"
    STUBBORN_SETS = "stubborn-sets"
    COMPACT = "compact"
    WALK = "walk"
    PARIKH = "parikh"
    PROJECTION = "projection"
    ON_THE_FLY = "on-the-fly"


F = TypeVar("F")


@dataclass(frozen=True, slots=True)
class Technique(Generic[F]):
    """A technique: what it is in words, and where its function of type `F` is (`module:function`)."""

    words: str
    at: str

    def load(self) -> F:
        """The function itself."""
        function: F = _named(self.at)
        return function


@dataclass(frozen=True, slots=True)
class Anew(Technique[F]):
    """A technique that begins anew each time that it is asked about a net: a function of the net and the rest."""

    def load(self) -> F:
        """What makes of a net what is asked."""
        function: Any = partial(partial, _named(self.at))
        made: F = function
        return made


def _named(at: str) -> Any:
    module, _, name = at.partition(":")
    return getattr(import_module(module), name)


SPACES: Final[dict[Method, Technique[SpaceMaker]]] = {
    Method.SYMBOLIC: Technique("decision diagram", "firable.analysis.spaces.symbolic:explore_symbolically"),
}

KNOWERS: Final[dict[Method, Technique[Knower]]] = {
    Method.STRUCTURE: Anew("theorems on net classes", "firable.analysis.structure.theorems:decide_by_class"),
    Method.REDUCTION: Technique(
        "walks and projections of the reduced net, at large", "firable.analysis.reduction.deciding:KnownByReduction"
    ),
    Method.STUBBORN_SETS: Anew("stubborn sets, at large", "firable.analysis.stubborn:known_firings"),
    Method.PROJECTION: Anew(
        "projections, one transition after the other", "firable.analysis.projection.refining:known_by_projection"
    ),
    Method.COMPACT: Anew("compact search of all markings", "firable.analysis.compact:known_by_counting"),
}

WORTH_ASKING: Final[dict[Method, frozenset[str]]] = {
    Method.REDUCTION: frozenset({"quasi-live", "deadlock-free"}),
    Method.STUBBORN_SETS: frozenset({"quasi-live", "deadlock-free"}),
    Method.PROJECTION: frozenset({"quasi-live"}),
    Method.COMPACT: frozenset({"contact-free", "deadlock-free", "quasi-live"}),
}
"""Which verdicts must be open for a technique to be asked what it knows: one of these, or any where it is not named."""

FIRST_KNOWERS: Final = {Method.REDUCTION: 0.5, Method.STRUCTURE: 0.6}
"""Whom `auto` asks, in this order, and for which part of the time that is left.

Stubborn sets and projections know what those on the reduced net know, and later.
"""

GOALS: Final[dict[Method, Technique[GoalDecider]]] = {
    Method.REDUCTION: Technique(
        "stubborn sets and a diagram on the reduced net", "firable.analysis.reduction.deciding:ByReduction"
    ),
    Method.STATE_EQUATION: Technique("state equation", "firable.analysis.structure.state_equation:StateEquation"),
    Method.PARIKH: Anew("Parikh vectors", "firable.analysis.structure.parikh:decide_by_parikh"),
    Method.PROJECTION: Anew("projection", "firable.analysis.projection.refining:decide_by_projection"),
    Method.BOUNDED: Anew("bounded model checking", "firable.analysis.induction.bounded:decide_by_bounded_search"),
    Method.K_INDUCTION: Anew("k-induction", "firable.analysis.induction.k_induction:decide_by_k_induction"),
    Method.PDR: Anew("property-directed reachability", "firable.analysis.induction.pdr:decide_by_pdr"),
    Method.STUBBORN_SETS: Anew("stubborn sets", "firable.analysis.stubborn:decide_by_stubborn_sets"),
    Method.WALK: Anew("random walk", "firable.analysis.walk:decide_by_walk"),
    Method.COMPACT: Anew("compact search", "firable.analysis.compact:decide_by_compact_search"),
}

FORMULAS: Final[dict[Logic, dict[Method, Technique[FormulaDecider]]]] = {
    Logic.LTL: {Method.ON_THE_FLY: Technique("on the fly", "firable.analysis.temporal.on_the_fly:LtlOnTheFly")},
    Logic.CTL: {Method.ON_THE_FLY: Technique("on the fly", "firable.analysis.temporal.by_parts:CtlByParts")},
}

GOAL_LANES: Final[tuple[tuple[Method, ...], ...]] = (
    (Method.REDUCTION, Method.PARIKH, Method.WALK, Method.STUBBORN_SETS, Method.BOUNDED),
    (Method.STATE_EQUATION, Method.PROJECTION, Method.K_INDUCTION, Method.PDR, Method.COMPACT),
)
"""How `auto` races them: what finds violations beside what proves; each lane in turns that grow."""

FORMULA_LANES: Final[tuple[tuple[Method, ...], ...]] = ((Method.ON_THE_FLY,),)
"""The same, for formulas that do not come down to goals."""
