"""A question about a net, and how its answer becomes a verdict.

The verdicts of the explicit method share their shape: a statement, a weight, the graph as method and cost, and one way
to be unknown, which is that the budget ended first. That shape is written here once; each technique says only what
it found. An answer that needs the whole graph asks for it, and the refusal becomes UNKNOWN with the bound reached, so
that no technique can conclude from a part by forgetting a check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from time import perf_counter

from firable.analysis.reachability import BudgetExceeded, IncompleteGraph, ReachabilityGraph
from firable.nets.verdict import Cost, Status, Verdict, Weight, Witness
from firable.semantics.trace import Discipline

METHOD = {
    Discipline.INTERLEAVING: "reachability graph, interleaving",
    Discipline.STEP: "reachability graph, synchronous steps",
}


@dataclass(frozen=True, slots=True)
class Answer:
    """What was found: whether the statement holds, what it concerns, and the evidence.

    `hint` is for the engineer who reads a violation; it replaces the one of the question where it is not empty.
    """

    holds: bool
    subjects: tuple[str, ...] = ()
    witness: Witness | None = None
    hint: str = ""


@dataclass(frozen=True, slots=True)
class Question:
    """A property of a net that some technique decides; `code` and `hint` go with a violation."""

    name: str
    statement: str
    weight: Weight = Weight.REQUIRED
    code: str = ""
    hint: str = ""

    def ask(self, graph: ReachabilityGraph, find: Callable[[], Answer]) -> Verdict:
        """The verdict: what `find` answers, or UNKNOWN where it needs more of the graph than there is."""
        start = perf_counter()
        try:
            answer = find()
        except (IncompleteGraph, BudgetExceeded) as error:
            return Verdict(
                self.name,
                Status.UNKNOWN,
                self.statement,
                METHOD[graph.discipline],
                self.weight,
                "F3004",
                "give it a larger budget of markings, memory or time",
                graph.bound or f"{graph.n_markings:,} markings: {error}",
                cost=self._cost(graph, start),
            )
        return Verdict(
            self.name,
            Status.PROVED if answer.holds else Status.VIOLATED,
            self.statement,
            METHOD[graph.discipline],
            self.weight,
            "" if answer.holds else self.code,
            "" if answer.holds else answer.hint or self.hint,
            subjects=answer.subjects,
            witness=answer.witness,
            cost=self._cost(graph, start),
        )

    @staticmethod
    def _cost(graph: ReachabilityGraph, start: float) -> Cost:
        return Cost(graph.n_markings, graph.n_edges, graph.engine.seconds + perf_counter() - start)


def listed(names: Iterable[str], most: int = 8) -> str:
    """Names for a sentence, the first few of many."""
    names = tuple(names)
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def yes(witness: Witness | None = None) -> Answer:
    """The statement holds."""
    return Answer(holds=True, witness=witness)


def no(subjects: tuple[str, ...] = (), witness: Witness | None = None, hint: str = "") -> Answer:
    """The statement does not hold."""
    return Answer(holds=False, subjects=subjects, witness=witness, hint=hint)
