"""Nets of two places and two transitions, all arcs, gates and markings, up to names: three texts, one meaning.

One in two of them, drawn, in a test run, and every one in a campaign; of smaller nets always every one.

The reference player gives the edges of every marking, under both disciplines. The engine's graph from every initial
marking must be their closure, with the same numbers; the SMT encoding must have exactly these edges as its models,
which z3 decides: the relation and the list of edges differ nowhere.
"""

from collections.abc import Iterator, Mapping
from functools import cache

import pytest
from support.examples import some
from support.small_scope import Shape, all_nets, net_with

from firable.analysis.induction.encoding import Relation, interleaving_relation, step_relation
from firable.analysis.induction.smt import Answer, Term, Terms, decide
from firable.analysis.spaces.reachability import explore
from firable.nets.net import Marking
from firable.semantics.player import FiringSet, Player
from firable.semantics.trace import Discipline

Edges = Mapping[Marking, list[tuple[FiringSet, Marking]]]

SCOPE = [(p, t, 0, 1) for p in range(3) for t in range(3) if (p, t) != (2, 2)] + [(2, 2, c, 8) for c in range(8)]


@cache
def edges_of(n_places: int, shapes: tuple[Shape, ...], *, step: bool) -> Edges:
    """The edges of every marking of a net, played once for the engine and the encoding."""
    player = Player(net_with(n_places, shapes))
    return {m: sorted(player.successors(m, step=step)) for m in range(1 << n_places)}


def closure(edges: Edges, initial: Marking) -> set[Marking]:
    seen, todo = {initial}, [initial]
    while todo:
        for _, successor in edges[todo.pop()]:
            if successor not in seen:
                seen.add(successor)
                todo.append(successor)
    return seen


def nets_of(n_places: int, n_transitions: int, chunk: int, chunks: int) -> list[tuple[Shape, ...]]:
    """One in two of a chunk, all where there are no chunks."""
    return some(all_nets(n_places, n_transitions, chunk, chunks), 1 if chunks == 1 else 2)


@pytest.mark.seeds
@pytest.mark.parametrize(("n_places", "n_transitions", "chunk", "chunks"), SCOPE)
def test_the_engine_explores_what_the_reference_player_plays(
    n_places: int, n_transitions: int, chunk: int, chunks: int
) -> None:
    seen = 0
    for shapes in nets_of(n_places, n_transitions, chunk, chunks):
        nets = [net_with(n_places, shapes, initial) for initial in range(1 << n_places)]
        for discipline in Discipline:
            edges = edges_of(n_places, shapes, step=discipline is Discipline.STEP)
            for initial, net in enumerate(nets):
                graph = explore(net, discipline)
                found = {
                    graph.marking(i): sorted((fired, graph.marking(j)) for fired, j in graph.successors(i))
                    for i in range(graph.n_markings)
                }
                expected = {marking: edges[marking] for marking in closure(edges, initial)}
                assert found == expected, (shapes, initial, discipline)
                assert graph.n_edges == sum(map(len, expected.values()))
                seen += 1
    assert seen > 0


@pytest.mark.seeds
@pytest.mark.parametrize("discipline", Discipline)
@pytest.mark.parametrize(("n_places", "n_transitions", "chunk", "chunks"), SCOPE)
def test_the_encoding_has_exactly_the_edges_of_the_reference_player(
    n_places: int, n_transitions: int, chunk: int, chunks: int, discipline: Discipline
) -> None:
    step = discipline is Discipline.STEP
    relation_of = step_relation if step else interleaving_relation
    for together in batches(nets_of(n_places, n_transitions, chunk, chunks)):
        # Some hundred nets in one question: is there an edge of one of them that the other side does not have?
        terms = Terms()
        differing = []
        for shapes in together:
            net = net_with(n_places, shapes)
            relation = relation_of(net, terms)
            differing.append(terms.differ(relation.term, listed(relation, edges_of(n_places, shapes, step=step))))
        assert decide([terms.disjunction(differing)]).answer is Answer.UNSAT


def listed(relation: Relation, edges: Edges) -> Term:
    """One of these edges is taken."""
    return relation.terms.disjunction(
        relation.terms.conjunction(
            [relation.is_marking(before), relation.is_firing(fired), relation.is_marking(after, after=True)]
        )
        for before, leaving in edges.items()
        for fired, after in leaving
    )


def batches(nets: list[tuple[Shape, ...]], size: int = 400) -> Iterator[list[tuple[Shape, ...]]]:
    yield from (nets[i : i + size] for i in range(0, len(nets), size))
