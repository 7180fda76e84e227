"""How far each marking of a graph is from an end, on some way or on every one: the ranks of an "until".

Going back from the end, breadth first: a round follows the edges into what the round before brought, so each edge is
followed once (for "every", by counting the next markings that are not there yet: Dowling and Gallier 1984). Rejected:
the fixpoint as it is written, in which each round looks at all edges, and which for long ways is quadratic.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from firable.analysis._engine import BudgetExceeded
from firable.analysis.evidence.certificate import Ranks
from firable.analysis.evidence.producing.lacking import NO_TIME
from firable.analysis.spaces.columns import Column
from firable.analysis.spaces.reachability import ReachabilityGraph


class Distances:
    """The edges of a complete graph, turned round."""

    def __init__(self, graph: ReachabilityGraph) -> None:
        self.graph = graph
        offsets, targets = graph.edges()
        self._next: npt.NDArray[np.int64] = (offsets[1:] - offsets[:-1]).astype(np.int64)
        sources = np.repeat(np.arange(graph.n_markings, dtype=np.uint32), self._next)
        self._sources = sources[np.argsort(targets, kind="stable")]
        self._offsets = np.zeros(graph.n_markings + 1, dtype=np.int64)
        np.cumsum(np.bincount(targets, minlength=graph.n_markings), out=self._offsets[1:])

    def until(self, through: Column, end: Column, *, every: bool) -> npt.NDArray[np.int64]:
        """Of each marking how many firings the end is away, through a set, at least or at most; -1 for no way there.

        A marking of the end has 0, wherever it is. Raises `BudgetExceeded`.
        """
        ranks = np.where(end, 0, -1)
        found, left, rank = np.flatnonzero(end), self._next.copy(), 0
        while len(found):
            if self.graph.deadline.over:
                raise BudgetExceeded(NO_TIME)
            rank += 1
            before, times = np.unique(self._sources[self._edges_into(found)], return_counts=True)
            if every:
                left[before] -= times
                before = before[left[before] == 0]
            found = before[(ranks[before] < 0) & through[before]].astype(np.intp)
            ranks[found] = rank
        return ranks

    def written(self, ranks: npt.NDArray[np.int64]) -> Ranks:
        """Ranks as a label, in the order in which the markings are written."""
        return Ranks(tuple(ranks[self.graph.ascending].tolist()))

    def _edges_into(self, markings: npt.NDArray[np.intp]) -> npt.NDArray[np.int64]:
        """The numbers of the edges into some markings, which stand together."""
        begin = self._offsets[markings]
        many = self._offsets[markings + 1] - begin
        return np.repeat(begin - np.cumsum(many) + many, many) + np.arange(many.sum())
