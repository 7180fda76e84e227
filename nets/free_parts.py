"""Parts that are said to be free of promise: what must be true of them before a net may run by that.

A part of which the yes stands until the firing is not asked, and promises nothing (docs/protocol-invariant.md). The
theorem demands that it disturbs nobody at its controller, which is read off the net (`firable.nets.knowledge`), and
that its vote is persistent, of which there must be a verdict that is PROVED and names evidence: an obligation where
arcs and units show it, else a document on the markings.

Rejected: to believe a verdict without evidence, since whoever edits a bundle can write one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from firable.nets.decomposition import Decomposition
from firable.nets.knowledge import knowledge
from firable.nets.verdict import Verdict

PERSISTENT: Final = "persistent."
"""The prefix of the verdict on the vote of a part."""


def unfounded(decomposition: Decomposition, verdicts: Mapping[str, Sequence[Verdict]]) -> Iterator[tuple[str, str]]:
    """The transition and what is wrong, for each part that is said to be free of promise without what that takes."""
    part_of = {(row.name, part.controller): part.name for row in decomposition.coordinated for part in row.parts}
    keeps = {(one.controller, name) for one in knowledge(decomposition) for name in one.undisturbing}
    if list(decomposition.free) != [pair for pair in part_of if pair in set(decomposition.free)]:
        yield "table", "the parts that are free of promise are not parts of the table, each once and in its order"
        return
    for transition, controller in decomposition.free:
        name = part_of[transition, controller]
        said = verdicts.get(f"{PERSISTENT}{name}", ())
        if (controller, name) not in keeps:
            yield transition, f"'{name}' is said to be free of promise, and disturbs others at '{controller}'"
        elif not said or not all(verdict.holds for verdict in said):
            yield transition, f"'{name}' is said to be free of promise, and its vote is not proved persistent"
        elif not all(verdict.evidence for verdict in said):
            yield transition, f"the vote on '{name}' is said to be persistent without evidence"
