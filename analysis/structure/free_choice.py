"""Free-choice nets: liveness by siphons, or at once by the rank of the incidence matrix; home markings by traps.

A net is (extended) free choice if places that share a consumer share all their consumers: whether one of several
transitions may fire does not depend on which. Sources: Desel and Esparza (1995, "Free Choice Petri Nets"); what they
call free choice is this class. Of a free-choice net that is 1-safe as an ordinary net:

- *liveness* (Commoner 1972, Hack 1972; their theorems 4.21 and 4.27): it is live iff every siphon contains a trap
  that is marked in M0;
- *rank theorem* (theorem 6.17): a connected net can be marked live and bounded iff it has a positive P-invariant, a
  positive T-invariant, and the rank of its incidence matrix is the number of its clusters less one. Then every
  minimal siphon is a trap (theorem 5.17), so it is live iff no siphon is empty in M0. A cluster is a place with its
  consumers, these with their inputs, and so on. All of this takes polynomial time, where the number of siphons is
  exponential; but if a unit cover for the positive invariants is not found, it says nothing;
- *home markings* (Best and Voss 1984; theorem 8.11): if it is live, there are home markings, and M0 is one of them,
  that is, the net is reversible, iff every trap is marked in M0.

The rank theorem is tried first. Home markings need one largest trap within the empty places.
"""

from __future__ import annotations

from collections.abc import Iterable

from firable.analysis.deadline import Deadline
from firable.analysis.structure.commoner import Commoner, commoner
from firable.analysis.structure.cover import cover
from firable.analysis.structure.linear import eliminate
from firable.analysis.structure.ordinary import Ordinary, markable
from firable.analysis.structure.siphons import trap_rules


def live_and_safe(of: Ordinary, deadline: Deadline) -> Commoner:
    """Whether a free-choice net that was proved 1-safe is live; every place of it has an arc."""
    if len(markable(of)) == of.n_places and _rank_theorem(of, deadline):
        return Commoner(holds=True)
    return commoner(of, deadline=deadline)


def empty_trap(of: Ordinary) -> frozenset[int]:
    """The largest trap that is not marked in M0; the empty set where all are."""
    return frozenset(trap_rules(of).largest(set(range(of.n_places)) - of.marked))


def _rank_theorem(of: Ordinary, deadline: Deadline) -> bool:
    """Whether each connected part has positive invariants and the rank is the number of clusters less one."""
    columns = [_column(inputs, outputs) for inputs, outputs in zip(of.inputs, of.outputs, strict=True)]
    rows: list[dict[int, int]] = [{} for _ in range(of.n_places)]
    for k, column in enumerate(columns):
        for p, change in column.items():
            rows[p][k] = change
    for equations_of, size in ((columns, of.n_places), (rows, len(columns))):
        if cover(equations_of, size, deadline=deadline).uncovered:
            return False
    n = of.n_places
    parts = _Classes(n + len(columns))
    clusters = _Classes(n + len(columns))
    for k, (inputs, outputs) in enumerate(zip(of.inputs, of.outputs, strict=True)):
        for p in inputs:
            clusters.join(p, n + k)
        for p in (*inputs, *outputs):
            parts.join(p, n + k)
    n_clusters: dict[int, int] = {}
    for node in range(n + len(columns)):
        if clusters.of(node) == node:
            n_clusters[parts.of(node)] = n_clusters.get(parts.of(node), 0) + 1
    equations: dict[int, list[dict[int, int]]] = {part: [] for part in n_clusters}
    for k, column in enumerate(columns):
        equations[parts.of(n + k)].append(column)
    for part, count in n_clusters.items():
        eliminated = eliminate(equations[part], deadline=deadline)
        if eliminated is None or eliminated.rank != count - 1:
            return False
    return True


def _column(inputs: Iterable[int], outputs: Iterable[int]) -> dict[int, int]:
    taken, put = set(inputs), set(outputs)
    return dict.fromkeys(taken - put, -1) | dict.fromkeys(put - taken, 1)


class _Classes:
    """Classes of numbers that are joined one after the other (union-find)."""

    def __init__(self, size: int) -> None:
        self.parent = list(range(size))

    def of(self, number: int) -> int:
        """The number that stands for its class."""
        while self.parent[number] != number:
            self.parent[number] = self.parent[self.parent[number]]
            number = self.parent[number]
        return number

    def join(self, a: int, b: int) -> None:
        """Make one class of two."""
        self.parent[self.of(a)] = self.of(b)
