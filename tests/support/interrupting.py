"""Graphs that Ctrl-C has ended, without the moment at which it must come."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from firable.analysis.spaces.reachability import ReachabilityGraph


@dataclass(frozen=True)
class _Ended:
    """A graph of the engine that has ended so, whatever has ended it."""

    graph: Any
    reason: str

    def __getattr__(self, name: str) -> Any:
        return getattr(self.graph, name)


def ended(graph: ReachabilityGraph, reason: str = "interrupted") -> ReachabilityGraph:
    """The same graph, of which this is said to have ended it."""
    engine: Any = _Ended(graph.engine, reason)
    return replace(graph, engine=engine)
