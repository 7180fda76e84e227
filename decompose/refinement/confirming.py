"""Confirming the theorem on a net: both nets explored, and compared by weak and by branching bisimilarity.

The theorem needs no confirmation; its implementation does. On a net of the size of a cell both graphs are there in a
moment, and two decision procedures that know nothing of tasks say whether the nets behave alike, where the moves inside
tasks are hidden. Where they say that they do not, the fault is ours, and never the net's.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from firable.analysis.question import Question
from firable.analysis.spaces.equivalence import branching_bisimilar, weakly_bisimilar
from firable.analysis.spaces.reachability import Budget, explore
from firable.decompose.refinement.carrying import Correspondence
from firable.nets.verdict import Cost, Status, Verdict, Weight
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 5_000
WEAK_MARKINGS_MAX: Final = 2_000
"""Weak bisimilarity is decided on the saturated graph, which grows with the square of the markings."""


class TheoremError(RuntimeError):
    """Exploration contradicts what the theorem concludes: an error of firable, never of the net."""


def confirmed(
    correspondence: Correspondence, *, contact_free: bool, settles: bool, budget: Budget | None = None
) -> Iterator[Verdict]:
    """The verdicts of weak and of branching bisimilarity; UNKNOWN where the markings are too many to compare.

    Raises `TheoremError` where the nets differ, though the conceptual one is `contact_free`.
    """
    budget = budget or Budget(MARKINGS_MAX)
    graph, detailed = (explore(net, budget=budget) for net in (correspondence.conceptual, correspondence.detailed))
    markings, edges = graph.n_markings + detailed.n_markings, graph.n_edges + detailed.n_edges
    names = correspondence.transitions
    visible = {name: name for name in names.values()}
    whole = graph.complete and detailed.complete
    kind = "with explicit divergence" if settles else "but for endless runs inside a task"
    for name, statement, most in (
        ("bisimilar.weak", "conceptual and detailed net are weakly bisimilar, moves hidden", WEAK_MARKINGS_MAX),
        ("bisimilar.branching", f"they are branching bisimilar, {kind}", budget.markings),
    ):
        question = Question(name, statement, Weight.INFORMATION, method="partition refinement of both graphs")
        cost = Cost(markings, edges)
        if not whole or markings > most:
            yield Verdict(
                name, Status.UNKNOWN, statement, question.method, Weight.INFORMATION, "F3004",
                "the theorem does not need it; --max-markings sets how much is compared",
                f"{markings:,} markings", cost=cost, discipline=Discipline.INTERLEAVING.value,
            )  # fmt: skip
            continue
        alike = (
            weakly_bisimilar(graph, detailed, names, visible)
            if name == "bisimilar.weak"
            else branching_bisimilar(graph, detailed, names, visible, divergence=settles)
        )
        if not alike and contact_free:
            raise TheoremError(f"{correspondence.conceptual.name}: {statement}, says the theorem, and they are not")
        yield Verdict(
            name, Status.PROVED if alike else Status.VIOLATED, statement, question.method, Weight.INFORMATION,
            hint="" if alike else "only contact tells them apart: `firable check` shows where",
            cost=cost, discipline=Discipline.INTERLEAVING.value,
        )  # fmt: skip
