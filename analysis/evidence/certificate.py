"""Certificates: what shows that a claim about the reachable markings holds, apart from how it was found.

Each is data over the names of the net, small or large, that somebody who knows the firing rule, and nothing of the
technique that found it, can check:

- a *firing sequence* leads from M0 to a marking where the goal holds;
- an *inductive invariant* is true of M0, kept by every firing, and excludes the goal. It is a conjunction of equations
  (weighted sums of tokens that no firing changes: P-invariants), of inequalities (such sums that no firing lowers, as
  the state equation gives them), and of clauses (some of these places holds a token, or some of those holds none). A
  trap that is marked in M0 is such a clause, so the argument of siphons and traps is an
  inductive invariant too, whose premises need no trust: the checker fires the transitions as they are;
- a *closed marking set* is that, with the invariant as a list: M0 is in it and every firing stays in it. With a
  distance for each marking it shows more: where each marking has a successor that is nearer to the goal, the goal can
  be reached from everywhere, which is what liveness and reversibility say.

Where the invariant does not exclude the goal by itself, the absence of the goal may still be d-inductive within it: the
goal is not among the first d markings of any run, and after d markings without it comes another one (Sheeran, Singh
and Stålmarck 2000, "Checking safety properties using induction and a SAT-solver"). Rejected: a solver's proof object
(DRAT, Alethe), which shows that a formula is unsatisfiable but not that it speaks of this net.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    """From M0 these transitions fire, one set of them after the other, and then the goal holds."""

    firings: tuple[tuple[str, ...], ...]


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
class MarkingSet:
    """M0 is among these markings, no firing leads out of them, and the goal holds in none.

    With `distances`, one for each marking, another claim: the goal holds where the distance is 0, and elsewhere some
    firing leads to a marking whose distance is smaller by one; so it can be reached from every marking.
    """

    markings: tuple[Marking, ...]
    distances: tuple[int, ...] = ()


Certificate = FiringSequence | InductiveInvariant | MarkingSet
