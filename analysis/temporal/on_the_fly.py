"""LTL on the fly: the first run that refutes a formula ends the search, so most of a space need not be there.

The product of the net and the automaton of the negation is walked depth first by the engine, which ends at the first
component that is accepted (Couvreur 1999; the search, and what was rejected for it, stand in
`analysis/engine/src/lasso/mod.rs`). A formula that fails is refuted by what was met up to then; one that holds takes
all markings that the automaton can follow, which are often few: what cannot refute it any more has no state.

Which order of firings comes round soonest cannot be seen beforehand. So the order of the net and drawn ones are tried
in turn, with budgets that grow; all is counted in vertices, not seconds, so the same net gives the same run. Edges of
the automaton come in the order of their distance to acceptance, and those that lead to none are left out.

The run is judged by the definitions (`temporal.lasso.satisfies`) and replayed, as each of them is. Sets of markings
(`temporal.product`), which decide all formulas of a space that is there, keep their place: a fixed point on a diagram
sees 10^20 markings at once, where this sees one after the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from firable.analysis._engine import IncompleteGraph, Lasso, find_lasso
from firable.analysis.compiled import engine_limits, flat, nodes_of
from firable.analysis.goal import Limits
from firable.analysis.question import Known, no, yes
from firable.analysis.spaces.reachability import REASONS
from firable.analysis.spaces.space import WitnessError
from firable.analysis.temporal.automaton import Automaton, Edge, TimeEndedError, TooLargeError, automaton_of
from firable.analysis.temporal.lasso import Run, satisfies, witness_of
from firable.analysis.temporal.product import components, firings_of
from firable.analysis.temporal.rewriting import positive
from firable.nets.formula import And, Formula
from firable.nets.net import Net
from firable.nets.temporal import Temporal, negated
from firable.nets.verdict import Cost
from firable.semantics.trace import Discipline

METHOD: Final = "on the fly"
MARKS_MAX: Final = 64
"""How many untils an automaton may have to wait for at the same time."""
_VERTICES_MAX: Final = 2**32 - 2
_BUDGETS: Final = (2**14, 2**18, 2**22)
"""Vertices of a search in the order of the net and of one in a drawn order, in turn; then one without a bound."""

Turn = tuple[int | None, int]
"""A search: the seed of its order, None for that of the net, and how many vertices it may meet."""
Row = tuple[int, bool, list[int], bool, int, list[int]]
"""An edge of the engine: label, whether only the transitions listed are admitted, they, stutters, target, marks."""


def decide_ltl_on_the_fly(net: Net, formula: Temporal, limits: Limits, *, turns: Iterable[Turn] | None = None) -> Known:
    """Decide whether every maximal run from M0 satisfies a formula of LTL, under interleaving, gates free.

    `turns` are the searches that are tried, other than the usual ones. Raises `IncompleteGraph` where it is not
    decided, with how far was looked.

    Cost: for each vertex, a pair of a marking and a state of the automaton, the formulas at the state and the
    transitions that the last firing touched; 8 bytes a word of the marking and some 20 besides.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> net = catalogue_net("one_robot_mc_late")
    >>> [decide_ltl_on_the_fly(net, parse_temporal(text), Limits()).answer.holds for text in ("F start", "G F start")]
    [True, False]
    """
    try:
        automaton = automaton_of(positive(negated(formula)), deadline=limits.deadline)
    except (TooLargeError, TimeEndedError) as error:
        raise IncompleteGraph(str(error) or "the time ended before the automaton was there") from error
    if automaton.n_marks > MARKS_MAX:
        raise IncompleteGraph(f"{automaton.n_marks} untils at one time are more than {MARKS_MAX}")
    labels, rows = compiled(net, automaton)
    vertices = edges = 0
    seconds = 0.0
    for seed, most in turns or _turns():
        found = find_lasso(
            *flat(net),
            [nodes_of(net, label) for label in labels],
            rows,
            automaton.n_marks,
            seed=seed,
            max_vertices=most,
            max_memory_bytes=limits.memory_bytes,
            **engine_limits(limits.deadline),
        )
        vertices, edges, seconds = vertices + found.n_vertices, edges + found.n_edges, seconds + found.seconds
        if found.reason != "markings":
            return _known(net, formula, found, Cost(vertices, edges, seconds))
    raise IncompleteGraph(f"{vertices:,} pairs of a marking and a state of the automaton")


def _turns() -> Iterator[Turn]:
    for seed, most in enumerate(_BUDGETS, 1):
        yield None, most
        yield seed, most
    yield None, _VERTICES_MAX


def _known(net: Net, formula: Temporal, found: Lasso, cost: Cost) -> Known:
    if not found.complete:
        reason = REASONS.get(found.reason or "", found.reason)
        raise IncompleteGraph(f"{found.n_vertices:,} pairs of a marking and a state of the automaton: {reason}")
    if found.run is None:
        return Known(yes(), METHOD, cost)
    prefix, cycle = found.run
    run = Run(tuple((t,) for t in prefix), tuple((t,) for t in cycle))
    if satisfies(net, run, formula):
        raise WitnessError("the run does not refute the formula")
    end = "the cycle goes on for ever" if run.cycle else "the sequence ends in a deadlock"
    note = f"this run does not satisfy the formula: {end}"
    return Known(no(witness=witness_of(net, Discipline.INTERLEAVING, run, note)), METHOD, cost)


def compiled(net: Net, automaton: Automaton) -> tuple[list[Formula], list[list[Row]]]:
    """The labels and edges of an automaton as the engine takes them, without those that lead to no acceptance.

    The edges of each state are in the order of their distance to acceptance.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> labels, rows = compiled(catalogue_net("one_robot"), automaton_of(positive(parse_temporal("F G start"))))
    >>> len(labels), [[target for *_, target, _ in row] for row in rows]
    (2, [[1, 0], [1]])
    """
    distance = _distances(automaton)
    labels: dict[frozenset[Formula], int] = {}
    rows = []
    for edges in automaton.edges:
        row: list[Row] = []
        for edge in sorted(edges, key=lambda edge: distance.get(edge.target, -1)):
            by = firings_of(net, edge.fires, edge.spared)
            if edge.target not in distance or (edge.fires and not by):
                continue
            label = labels.setdefault(edge.atoms, len(labels))
            marks = sorted(edge.marks)
            admitted = (True, sorted(by or ())) if edge.fires else (False, _indexes(net, edge))
            row.append((label, *admitted, not edge.fires, edge.target, marks))
        rows.append(row)
    return [And(tuple(sorted(atoms, key=repr))) for atoms in labels], rows


def _indexes(net: Net, edge: Edge) -> list[int]:
    return sorted(net.transition_index[name] for name in edge.spared)


def _distances(automaton: Automaton) -> dict[int, int]:
    """For each state how many edges it is away from a part of the automaton that can accept; none where it leads there.

    A part can accept if its inner edges have each mark.
    """
    distance: dict[int, int] = {}
    for part in components([[edge.target for edge in edges] for edges in automaton.edges]):
        inner = [edge for state in part for edge in automaton.edges[state] if edge.target in part]
        if inner and all(any(mark in edge.marks for edge in inner) for mark in range(automaton.n_marks)):
            distance.update(dict.fromkeys(part, 0))
    before: dict[int, list[int]] = {}
    for state, edges in enumerate(automaton.edges):
        for edge in edges:
            before.setdefault(edge.target, []).append(state)
    for state in (todo := list(distance)):
        for source in before.get(state, ()):
            if source not in distance:
                distance[source] = distance[state] + 1
                todo.append(source)
    return distance
