"""Certificates: what shows that a claim about the runs of a net holds, apart from how it was found.

Each is data over the names of the net, small or large, that somebody who knows the firing rule, and nothing of the
technique that found it, can check:

- a *firing sequence* leads from M0 to a marking where the goal holds; with a cycle it is a run that goes on for ever;
- an *inductive invariant* is true of M0, kept by every firing, and excludes the goal. It is a conjunction of equations
  (weighted sums of tokens that no firing changes: P-invariants), of inequalities (such sums that no firing lowers, as
  the state equation gives them), and of clauses (some of these places holds a token, or some of those holds none). A
  trap that is marked in M0 is such a clause, so the argument of siphons and traps is an
  inductive invariant too, whose premises need no trust: the checker fires the transitions as they are;
- a *labelling* is that, with the invariant as a set of markings, listed or as a decision diagram: M0 is in it and every
  firing stays in it. With labels it shows any formula of CTL: each subformula "until" comes with a rank for each
  marking, which falls along some firing (or along every one), and each "always" with a set that is not left;
- *stubborn sets* are markings too, in each of which a set of transitions says which firings count: no goal is reached
  by them, nor then by those that are left out;
- a *reduction* is a list of rules by which the net becomes a smaller one that reaches the goal if the net itself does,
  and a certificate for that one;
- a *continuation* is a firing sequence and a certificate for the net that starts where it ends: from there the goal is
  never reached again;
- *progress* shows a response under fairness: ranks that no firing without the answer raises, and for each rank a
  transition that must fire at last, and lowers it;
- a set of markings, *unfolded*, shows a formula of LTL: a tableau of the negation has no run on it, and nothing that it
  follows leaves the set. The set is all that is written; the checker unfolds the tableau itself;
- a *theorem* names a class of nets, and what of its premises cannot be read off the arcs.

Where the invariant does not exclude the goal by itself, the absence of the goal may still be d-inductive within it: the
goal is not among the first d markings of any run, and after d markings without it comes another one (Sheeran, Singh
and Stålmarck 2000, "Checking safety properties using induction and a SAT-solver"). Rejected: a solver's proof object
(DRAT, Alethe), which shows that a formula is unsatisfiable but not that it speaks of this net.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

from firable.nets.formula import Constant, Formula
from firable.nets.net import Marking


@dataclass(frozen=True, slots=True)
class Equation:
    """The sum of the weights of the places that hold a token is `tokens` in every reachable marking."""

    weights: tuple[tuple[str, int], ...]
    tokens: int


@dataclass(frozen=True, slots=True)
class Inequality:
    """The sum of the weights, of either sign, of the places that hold a token is at least `tokens`."""

    weights: tuple[tuple[str, int], ...]
    tokens: int


@dataclass(frozen=True, slots=True)
class Clause:
    """Some place of `marked` holds a token, or some place of `empty` holds none."""

    marked: tuple[str, ...] = ()
    empty: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FiringSequence:
    """From M0 these transitions fire, one set of them after the other; then, if it is not empty, the cycle for ever."""

    firings: tuple[tuple[str, ...], ...]
    cycle: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class InductiveInvariant:
    """No firing changes the equations, none lowers the inequalities, the clauses are kept with them: no goal is left.

    With a `depth` above 0 they exclude it only together with that many markings before it in which it does not hold,
    and M0 and the markings after it, `depth` of them in each run, are free of it.
    """

    equations: tuple[Equation, ...] = ()
    clauses: tuple[Clause, ...] = ()
    depth: int = 0
    inequalities: tuple[Inequality, ...] = ()


@dataclass(frozen=True, slots=True)
class Markings:
    """A set of markings, one by one."""

    markings: tuple[Marking, ...]


@dataclass(frozen=True, slots=True)
class Diagram:
    """Sets of markings as a zero-suppressed decision diagram; the first of the `roots` is the set that is closed.

    `order` names the places, level 1 first. A row is a level and two numbers of rows before it: the markings in which
    the place of the level is empty, and those in which it holds a token, that token left out. The first row has number
    2; 0 is the empty set, 1 the empty marking alone; a level that is passed over is empty.
    """

    order: tuple[str, ...]
    rows: tuple[tuple[int, int, int], ...]
    roots: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Ranks:
    """Of listed markings: the rank of each in a subformula, -1 for none.

    Of an "until" the rank falls on the way to its end, where it is 0; of an "always" it is 0 where that holds.
    """

    ranks: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Back:
    """Of a diagram: an "until" of some run is found by going back from its end, by each of these in turn."""

    transitions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Rounds:
    """Of a diagram: an "until" of every run is found by going back so many times by one firing, from its end."""

    rounds: int


@dataclass(frozen=True, slots=True)
class Root:
    """Of a diagram: an "always" holds in the set of this root."""

    root: int


@dataclass(frozen=True, slots=True)
class Whole:
    """An "always" holds in all of the set."""


Label = Ranks | Back | Rounds | Root | Whole


@dataclass(frozen=True, slots=True)
class Labelling:
    """M0 is in the set, no firing leads out of it, and the claim holds of it.

    The labels are those of the fixpoints of the claim in negation normal form, inner ones first
    (`firable.analysis.evidence.checking.labelling`).
    """

    space: Markings | Diagram
    labels: tuple[Label, ...] = ()


@dataclass(frozen=True, slots=True)
class StubbornSets:
    """The goal holds in none of the markings, M0 is one of them, and whatever counts leads from them to them.

    What counts in a marking are the firable members of a set that is stubborn there for the goal
    (`firable.analysis.evidence.checking.stubborn`). `sets` are sets of transitions, bit t being transition t of the
    net; `chosen` gives for each marking the number of its set.
    """

    space: Markings
    sets: tuple[int, ...]
    chosen: tuple[int, ...]


class Rule(StrEnum):
    """The rules of a reduction, with what a step names of each.

    What each of them asks for and does is in `firable.analysis.evidence.checking.reductions`.
    """

    CONSTANT = "constant"  # places whose value never changes
    IRRELEVANT = "irrelevant"  # moves that the goal does not depend on
    UNNEEDED = "unneeded"  # places that no move needs
    COPY = "copy"  # two places: the first is always the second, or always its complement
    SUBSUMED = "subsumed"  # two moves: the second does what the first does, and needs no more
    EARLY = "early"  # a move that may as well be made at once
    FACTS = "facts"  # nothing: which literals are never true together is computed anew
    DEAD = "dead"  # moves that a fact forbids
    GATE = "gate"  # a move, and places whose value its other needs imply
    IMPLIED = "implied"  # a place whose value is implied wherever it is needed
    CLOSERS_EARLY = "closers-early"  # a place around which moves are made in one
    OPENERS_LATE = "openers-late"  # the same, by the other order
    ALWAYS = "always"  # a move that needs nothing: there is no deadlock


@dataclass(frozen=True, slots=True)
class Step:
    """One application of a rule.

    Moves are numbered: the transitions of the net by their indexes, then those that steps make of two, one by one.
    """

    rule: Rule
    moves: tuple[int, ...] = ()
    places: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reduction:
    """The net becomes smaller by the steps, and then falls apart; in one part the goal is never met.

    `part` names its places. `goal` speaks of them, and follows from the goal of the net wherever the net, with what the
    steps say of its places, meets it; `then` shows that it is never met. Where the goal is false after the steps, all
    three are missing.
    """

    steps: tuple[Step, ...]
    part: tuple[str, ...] = ()
    goal: Formula = field(default=Constant(value=False))
    then: InductiveInvariant | Labelling | StubbornSets | None = None


NeverCertificate = InductiveInvariant | Labelling | StubbornSets | Reduction
"""What shows that a goal is never met."""


@dataclass(frozen=True, slots=True)
class Continuation:
    """After these firings the goal is never reached: the certificate shows it of the net in the marking after them."""

    firings: tuple[tuple[str, ...], ...]
    then: NeverCertificate


@dataclass(frozen=True, slots=True)
class Progress:
    """A response: `ranks` gives each of the listed markings its place on the way to the answer, none where none is due.

    A place on the way is a sequence of numbers, compared from the left; `helpful` names, for a beginning of such a
    sequence, the transition that fairness makes fire at last (`firable.analysis.evidence.checking.progress`).
    """

    space: Markings
    ranks: tuple[tuple[int, ...], ...]
    helpful: tuple[tuple[tuple[int, ...], str], ...] = ()


class TheoremName(StrEnum):
    """The theorems that are taken from books; the premises are checked, the theorem is not."""

    MARKED_GRAPH = "marked-graph"
    FREE_CHOICE = "free-choice"
    ASYMMETRIC_CHOICE = "asymmetric-choice"


@dataclass(frozen=True, slots=True)
class Theorem:
    """A theorem on a class of contact-free nets; `contact` shows that the net is one.

    Where the premise is that every siphon contains a marked trap, one of the `traps` is in each; without any of them
    the checker asks for it by ranks (`firable.analysis.evidence.checking.siphons`).
    """

    name: TheoremName
    contact: NeverCertificate
    traps: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Unfolded:
    """A formula of LTL is decided anew, on the markings of this set, by a tableau that the checker makes."""

    space: Markings


Certificate = FiringSequence | NeverCertificate | Continuation | Progress | Theorem | Unfolded


def sets_of(certificate: Certificate | None) -> Iterator[Markings | Diagram]:
    """The sets of markings that a certificate rests on."""
    match certificate:
        case Labelling(space) | StubbornSets(space) | Progress(space) | Unfolded(space):
            yield space
        case Reduction(then=then) | Continuation(then=then) | Theorem(contact=then):
            yield from sets_of(then)
