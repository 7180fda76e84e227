"""Partitions of a hypergraph with few cut edges: exactly by z3 where it is small, else by a partitioner.

*Exactly*: z3's optimiser (nuZ) over one Boolean for each block and part. Minimised are, in this order, the cut
transitions, then the votes, and of a very small graph the weight of the largest part, each at the optimum of the ones
before it. What comes out of a search that ended is optimal, and only then is that said. Parts have no names, so block
i may only open part p if a block before it opened part p - 1: without that every partition would be met n! times.

*A partitioner*: Mt-KaHyPar (Gottesbüren, Heuer, Maas, Sanders, Schlag 2024, "Scalable High-Quality Hypergraph
Partitioning"), which minimises just this, cut hyperedges with a bound on the weight of the parts, in its deterministic
mode. It is kept by the group that wrote it, is under the MIT licence, and has wheels for Linux, macOS and Windows. It
is an extra of its own (`firable[split]`), since it is large and few need it.

Looked at and not taken: PyMetis (graphs only, and no wheel for Windows), KaHyPar (its predecessor, no wheel for
Windows), the communities of networkx (they maximise modularity and know no bound on sizes), and a search of our own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from typing import Any, Final

import z3

from firable.analysis.deadline import Deadline
from firable.decompose.splitting.hypergraph import Hypergraph, Partition
from firable.nets.diagnostics import Diagnostic, InputError

EXACT_MAX: Final = 400
"""The largest product of blocks and parts for which z3 is asked."""
BALANCED_MAX: Final = 100
"""The largest such product for which it is also asked for the best balance."""
_SEEDS: Final = range(1, 6)


@dataclass(frozen=True, slots=True)
class Found:
    """A partition, by which method, and whether fewer cut transitions are impossible within the bound on weights."""

    partition: Partition
    method: str
    optimal: bool = False


def partition(graph: Hypergraph, n_parts: int, slack: float, deadline: Deadline) -> Found:
    """A partition that cuts few transitions, into parts whose weights differ from the average by `slack` at most.

    Raises `InputError` F4004 where there is none, or none was found in time; `ModuleNotFoundError` for a graph that
    needs the partitioner where it is not installed.
    """
    if not 1 <= n_parts <= len(graph.blocks):
        message = f"{len(graph.blocks)} blocks that cannot be divided do not make {n_parts} controllers"
        raise InputError([Diagnostic("F4004", message, f"ask for 1 to {len(graph.blocks)}")])
    asked = _Asked(graph, n_parts, *graph.bounds(n_parts, slack))
    small = len(graph.blocks) * n_parts <= EXACT_MAX
    found = None
    if n_parts > 1 and (not small or find_spec("mtkahypar") is not None):
        found = _by_partitioner(asked)
    if small:
        found = _by_optimiser(asked, found, deadline) or found
    if found is None:
        message = f"no partition into {n_parts} controllers of {asked.low} to {asked.high} places and signals was found"
        raise InputError([Diagnostic("F4004", message, "allow more --slack, or more --max-seconds")])
    number = {part: i for i, part in enumerate(dict.fromkeys(found.partition))}  # by their first blocks
    return replace(found, partition=tuple(number[part] for part in found.partition))


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a partition has to keep: so many parts, none lighter or heavier than the bounds."""

    graph: Hypergraph
    n_parts: int
    low: int
    high: int

    def keeps(self, of: Sequence[int]) -> bool:
        sizes = self.graph.sizes(of, self.n_parts)
        return min(sizes) >= self.low and max(sizes) <= self.high

    def cost(self, of: Sequence[int]) -> tuple[int, int, int]:
        """What is to be small: the transitions that are cut, the votes, the heaviest part."""
        return len(self.graph.cut(of)), self.graph.votes(of), max(self.graph.sizes(of, self.n_parts))


@cache
def _partitioner() -> tuple[Any, Any]:
    """The module and its core, which is made once; one thread, so that nothing depends on how many there are."""
    import mtkahypar

    return mtkahypar, mtkahypar.initialize(1)


def _by_partitioner(asked: _Asked) -> Found | None:
    """The best of a few runs from different seeds, of those that keep the bounds."""
    module, core = _partitioner()
    graph = asked.graph
    context = core.context_from_preset(module.PresetType.DETERMINISTIC_QUALITY)
    context.logging = False
    context.set_partitioning_parameters(asked.n_parts, 0.03, module.Objective.CUT)
    context.set_individual_target_block_weights([asked.high] * asked.n_parts)
    edges = Counter(graph.edges)  # transitions that join the same blocks are one edge with their number as its weight
    best: tuple[int, ...] | None = None
    for seed in _SEEDS:
        module.set_seed(seed)
        made = core.create_hypergraph(
            context, len(graph.blocks), len(edges), list(map(list, edges)), list(graph.weights), list(edges.values())
        )
        result = made.partition(context)
        of = tuple(result.block_id(block) for block in range(len(graph.blocks)))
        if asked.keeps(of) and (best is None or asked.cost(of) < asked.cost(best)):
            best = of
    return None if best is None else Found(best, f"Mt-KaHyPar, the best of {len(_SEEDS)} runs")


def _by_optimiser(asked: _Asked, known: Found | None, deadline: Deadline) -> Found | None:
    """An optimal partition; None where the deadline came first, or there is none."""
    graph, parts = asked.graph, range(asked.n_parts)
    solver = z3.Optimize(ctx=z3.Context())
    at = [[z3.Bool(f"b{block}p{part}", solver.ctx) for part in parts] for block in range(len(graph.blocks))]
    for block, of_block in enumerate(at):
        solver.add(z3.PbEq([(one, 1) for one in of_block], 1))
        for part in range(1, asked.n_parts):
            opened = [at[before][part - 1] for before in range(block)]
            solver.add(z3.Implies(of_block[part], z3.Or(opened)) if opened else z3.Not(of_block[part]))
    heaviest = z3.Int("heaviest", solver.ctx)
    for part in parts:
        weight = z3.Sum([z3.If(of[part], w, 0) for of, w in zip(at, graph.weights, strict=True)])
        solver.add(weight >= asked.low, weight <= heaviest)
    solver.add(heaviest <= asked.high)
    cut, joined = [z3.IntVal(0, solver.ctx)], [z3.IntVal(0, solver.ctx)]
    for number, (edge, times) in enumerate(sorted(Counter(graph.edges).items())):
        meets = [z3.Bool(f"e{number}p{part}", solver.ctx) for part in parts]
        for part in parts:
            solver.add(meets[part] == z3.Or([at[block][part] for block in edge]))
        is_cut = z3.Bool(f"e{number}", solver.ctx)
        solver.add(is_cut == z3.Not(z3.AtMost(*meets, 1)))
        cut.append(z3.If(is_cut, times, 0))
        joined += [z3.If(one, times, 0) for one in meets]
    if known is not None:
        solver.add(z3.Sum(cut) <= asked.cost(known.partition)[0])
    solver.minimize(z3.Sum(cut))
    solver.minimize(z3.Sum(joined))
    if len(at) * asked.n_parts <= BALANCED_MAX:
        solver.minimize(heaviest)
    solver.set("timeout", deadline.left_milliseconds)
    if deadline.over or solver.check() != z3.sat:
        return None
    model = solver.model()
    of = tuple(next(part for part in parts if z3.is_true(model.eval(of_block[part]))) for of_block in at)
    if not asked.keeps(of):
        raise AssertionError("the optimiser gave no partition")
    return Found(of, "z3, of all partitions within these sizes", optimal=True)
