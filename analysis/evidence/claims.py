"""Claims: statements about the behaviour of a net, each of a kind that some certificate can show.

A verdict is a word of this program; a claim says the same with quantifiers, so that somebody who knows the firing rule
knows what is to be shown. Most are formulas of CTL over state formulas, with names for the patterns that have methods
of their own. What a verdict comes down to in claims is said in `firable.analysis.evidence.meaning`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from firable.nets.formula import And, Constant, Formula, Holds, Not, Or, Start, format_formula, parse_formula
from firable.nets.net import Fairness, Marking, Net
from firable.nets.queries import QueryKind
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Logic,
    Temporal,
    TemporalNot,
    format_temporal,
    negated,
)


class ClaimKind(StrEnum):
    """What is claimed; `goal` and `then` are state formulas but where a logic is named."""

    NEVER = "never"  # the goal holds in no reachable marking: AG not goal
    REACHABLE = "reachable"  # it holds in one: EF goal
    ALWAYS_POSSIBLE = "always_possible"  # from every reachable marking one can be reached where it holds: AG EF goal
    LOST = "lost"  # from some reachable marking none can be reached where it holds: EF AG not goal
    FIRES = "fires"  # some run meets the goal and fires each of these transitions afterwards
    LATER = "later"  # some run meets the goal, and at that moment or later meets `then`
    IN_ORDER = "in_order"  # some run meets the goal, then fires these transitions, each later than the one before it
    CTL = "ctl"  # the goal, a formula of CTL, holds in M0
    LTL = "ltl"  # the goal, a formula of LTL, holds of every maximal run
    NOT_LTL = "not_ltl"  # it does not hold of some maximal run
    LEADS_TO = "leads_to"  # every maximal and fair run that meets the goal meets `then` at that moment or later
    NOT_LEADS_TO = "not_leads_to"  # some does not
    ORDERED = "ordered"  # every step can be replayed by some order of single firings
    UNORDERED = "unordered"  # some cannot
    LIVE = "live"  # from every reachable marking every transition can fire again
    HOME = "home"  # some marking can be reached from every reachable marking


_PATTERNS: Final = {
    ClaimKind.NEVER: "never ({})",
    ClaimKind.REACHABLE: "({}) is reachable, external gates free",
    ClaimKind.ALWAYS_POSSIBLE: "from every reachable marking ({}) can be reached, external gates free",
    ClaimKind.LOST: "from some reachable marking ({}) can never be reached again",
    ClaimKind.CTL: "CTL: {}",
    ClaimKind.LTL: "LTL: {}",
    ClaimKind.NOT_LTL: "a run does not satisfy LTL: {}",
}
STATE_GOALS: Final = frozenset(ClaimKind) - {ClaimKind.CTL, ClaimKind.LTL, ClaimKind.NOT_LTL}
"""The kinds whose goal is a state formula."""

TRUE: Final = Constant(value=True)
FALSE: Final = Constant(value=False)


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement about the runs of a net.

    >>> from firable.nets.formula import parse_formula
    >>> str(Claim(ClaimKind.NEVER, parse_formula("deadlock")))
    'never (deadlock)'
    >>> str(Claim(ClaimKind.FIRES, fires=("t1", "t2")))
    'a run fires t1, t2'
    >>> str(Claim(ClaimKind.FIRES, parse_formula("p"), fires=("t1",)))
    'a run meets (p) and then fires t1'
    """

    kind: ClaimKind
    goal: Temporal = TRUE
    then: Formula = TRUE
    fairness: Fairness = Fairness.NONE
    fires: tuple[str, ...] = ()

    def __str__(self) -> str:
        goal = format_temporal(self.goal)
        fires = "fires" if self.goal == TRUE else f"meets ({goal}) and then fires"
        match self.kind:
            case ClaimKind.FIRES:
                shown = ", ".join(self.fires[:8]) + (f" and {len(self.fires) - 8} more" if len(self.fires) > 8 else "")
                return f"a run {fires} {shown}"
            case ClaimKind.IN_ORDER:
                return f"a run {fires} {', and later '.join(self.fires)}"
            case ClaimKind.LATER:
                return f"a run meets ({goal}) and then or later ({format_formula(self.then)})"
            case ClaimKind.LEADS_TO | ClaimKind.NOT_LEADS_TO:
                runs = {Fairness.NONE: "run"}.get(self.fairness, f"{self.fairness}ly fair run")
                every, ends = ("every", "meets") if self.kind is ClaimKind.LEADS_TO else ("some", "never meets")
                return f"{every} {runs} that meets ({goal}) {ends} ({format_formula(self.then)}) after it"
            case ClaimKind.LIVE:
                return "from every reachable marking every transition can fire again, external gates free"
            case ClaimKind.ORDERED | ClaimKind.UNORDERED:
                quantor = "every step can" if self.kind is ClaimKind.ORDERED else "some step cannot"
                return f"{quantor} be replayed by some order of single firings"
            case ClaimKind.HOME:
                return "some marking can be reached from every reachable marking"
        return _PATTERNS[self.kind].format(goal)

    @property
    def state_goal(self) -> Formula:
        """The goal, which must be a state formula; `ValueError` where it is none."""
        if not isinstance(self.goal, Formula):
            raise ValueError(f"'{format_temporal(self.goal)}' is no state formula")
        return self.goal


NEVER_FALSE: Final = Claim(ClaimKind.NEVER, FALSE)
"""What needs nothing to show it, so that no evidence has it."""


def tidy(formula: Formula) -> Formula:
    """The formula as it is read back from its text: equal to every other that is written the same."""
    return parse_formula(format_formula(formula))


def as_ctl(claim: Claim) -> Temporal | None:
    """The formula of CTL that says the same; None where there is none.

    >>> from firable.nets.formula import Start
    >>> format_temporal(as_ctl(Claim(ClaimKind.LOST, Start())))
    'EF AG not start'
    """
    match claim.kind:
        case ClaimKind.NEVER:
            return ForAll(Globally(Not(claim.state_goal)))
        case ClaimKind.REACHABLE:
            return Exists(Eventually(claim.goal))
        case ClaimKind.ALWAYS_POSSIBLE:
            return ForAll(Globally(Exists(Eventually(claim.goal))))
        case ClaimKind.LOST:
            return Exists(Eventually(ForAll(Globally(Not(claim.state_goal)))))
        case ClaimKind.CTL:
            return claim.goal
    return None


def temporal_claim(logic: Logic | QueryKind, formula: Temporal, *, proved: bool) -> Claim:
    """The claim that a formula of a logic holds in M0, or that it does not."""
    if logic.value == Logic.CTL.value:
        return Claim(ClaimKind.CTL, formula if proved else negation_in_ctl(formula))
    return Claim(ClaimKind.LTL if proved else ClaimKind.NOT_LTL, formula)


def negation_in_ctl(formula: Temporal) -> Temporal:
    """The negation of a formula of CTL, as a claim says it.

    >>> from firable.nets.temporal import parse_temporal
    >>> format_temporal(negation_in_ctl(parse_temporal("not AF p")))
    'AF p'
    """
    return formula.operand if isinstance(formula, Not | TemporalNot) else negated(formula)


def is_marking(net: Net, marking: Marking) -> Formula:
    """The state formula "this is the marking": `start` of M0, else all places as they are."""
    if marking == net.initial_marking:
        return Start()
    literals = tuple(Holds(p.name) if marking >> i & 1 else Not(Holds(p.name)) for i, p in enumerate(net.places))
    return literals[0] if len(literals) == 1 else And(literals)


def marking_of(net: Net, formula: Formula) -> Marking | None:
    """The marking that `is_marking` made a formula of; None for any other formula.

    >>> from firable.nets.net import Place
    >>> net = Net("n", (Place("p"), Place("q", marked=True)))
    >>> [marking_of(net, is_marking(net, marking)) for marking in range(4)], marking_of(net, Holds("p"))
    ([0, 1, 2, 3], None)
    """
    if formula == Start():
        return net.initial_marking
    literals = formula.operands if isinstance(formula, And) else (formula,)
    if len(literals) != len(net.places):
        return None
    marking = 0
    for operand in literals:
        if isinstance(operand, Holds):
            marking |= 1 << net.place_index[operand.place]
    return marking if formula == is_marking(net, marking) else None


def without_start(net: Net, formula: Formula) -> Formula:
    """The formula with `start` spelled out, so that it means the same of the net with another initial marking."""
    spelled = And(tuple(Holds(p.name) if p.marked else Not(Holds(p.name)) for p in net.places))

    def changed(part: Formula) -> Formula:
        match part:
            case Start():
                return spelled
            case Not(operand):
                return Not(changed(operand))
            case And(operands):
                return And(tuple(map(changed, operands)))
            case Or(operands):
                return Or(tuple(map(changed, operands)))
        return part

    return changed(formula)
