"""A question about a net, and how its answer becomes a verdict.

The verdicts share their shape: a statement, a weight, a method (mostly the state space), a cost, and a way to be
unknown, which is that the budget ended first. That shape is written here once; each technique says only what it found.
An answer that needs the whole space asks for it, and the refusal becomes UNKNOWN with the bound reached, so that no
technique can conclude from a part by forgetting a check. A technique with another way to be unknown answers so itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.spaces.space import StateSpace
from firable.nets.verdict import Cost, Status, Verdict, Weight, Witness, spelled
from firable.semantics.trace import Discipline

_STATUS = {True: Status.PROVED, False: Status.VIOLATED, None: Status.UNKNOWN}
LARGER: Final = "give it a larger budget of markings, memory or time"
"""What helps where a budget has ended a search."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What was found: whether the statement holds (None: unknown), what it concerns, and the evidence.

    `hint` is for the engineer who reads it; of a violation it replaces the one of the question where it is not empty.
    `bound` and `code` belong to an unknown answer: how far was looked, and the code of what stood in the way.
    """

    holds: bool | None
    subjects: tuple[str, ...] = ()
    witness: Witness | None = None
    hint: str = ""
    bound: str = ""
    code: str = ""


@dataclass(frozen=True, slots=True)
class Known:
    """The answer to the question of a verdict by a technique that needs no state space, which one, and its cost."""

    answer: Answer
    method: str
    cost: Cost = field(default_factory=Cost)


@dataclass(frozen=True, slots=True)
class Question:
    """A property of a net that some technique decides; `code` and `hint` go with a violation.

    `method` is named where it is not the state space itself.
    """

    name: str
    statement: str
    weight: Weight = Weight.REQUIRED
    code: str = ""
    hint: str = ""
    method: str = ""

    def ask(self, space: StateSpace[Any], find: Callable[[], Answer]) -> Verdict:
        """The verdict: what `find` answers, or UNKNOWN where it needs more of the space than there is."""
        start = perf_counter()
        try:
            answer = find()
        except (IncompleteGraph, BudgetExceeded) as error:
            bound = space.bound or f"{spelled(space.n_markings)} markings: {error}"
            answer = unknown(bound, LARGER, "F3004")
        seconds = (space.cost.seconds or 0.0) + perf_counter() - start
        cost = Cost(space.n_markings, space.n_edges, seconds)
        return self.settle(answer, self.method or space.method, space.discipline, cost)

    def settle(self, answer: Answer, method: str, discipline: Discipline, cost: Cost) -> Verdict:
        """The verdict that an answer is, found by a method under a discipline at a cost."""
        violated = answer.holds is False
        return Verdict(
            self.name,
            _STATUS[answer.holds],
            self.statement,
            method,
            self.weight,
            answer.code or (self.code if violated else ""),
            answer.hint or (self.hint if violated else ""),
            answer.bound,
            answer.subjects,
            answer.witness,
            cost=cost,
            discipline=discipline.value,
        )


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


def unknown(bound: str, hint: str, code: str = "") -> Answer:
    """It is not known whether the statement holds."""
    return Answer(holds=None, hint=hint, bound=bound, code=code)
