"""The transition relations have exactly the edges that the reference player plays.

The nets of a small scope are in `tests/conformance`; here are gates, models and size.
"""

from collections.abc import Callable, Iterator

import pytest
from hypothesis import given
from support.dense_nets import dense_nets
from support.examples import examples

from firable.analysis.induction.encoding import Relation, interleaving_relation, step_relation
from firable.analysis.induction.smt import Answer, Term, Terms, decide, value
from firable.nets.net import ExternalGate, Marking, Net, Place, Signal, Transition
from firable.semantics.player import FiringSet, Player

Edge = tuple[Marking, FiringSet, Marking]
Encoder = Callable[[Net, Terms | None], Relation]
DISCIPLINES = [(interleaving_relation, False), (step_relation, True)]


def played(net: Net, *, step: bool) -> set[Edge]:
    """Every edge from every marking, reachable or not."""
    player = Player(net)
    return {
        (marking, fired, after)
        for marking in range(1 << len(net.places))
        for fired, after in player.successors(marking, step=step)
    }


def solved(relation: Relation) -> Iterator[Edge]:
    """The edges of all models of the relation, found one by one."""
    found: list[Term] = []
    terms = relation.terms
    while (decision := decide([relation.term, *found])).answer is Answer.SAT:
        before, fired, after = edge = relation.edge(decision.assignment)
        yield edge
        seen = [relation.is_marking(before), relation.is_firing(fired), relation.is_marking(after, after=True)]
        found.append(terms.negation(terms.conjunction(seen)))
    assert decision.answer is Answer.UNSAT


@pytest.mark.parametrize(("encode", "step"), DISCIPLINES)
@given(net=dense_nets(signals=True))
@examples(15)
def test_models_of_a_relation_are_the_edges_of_the_player(encode: Encoder, step: bool, net: Net) -> None:
    found = list(solved(encode(net, None)))
    assert len(set(found)) == len(found)
    assert set(found) == played(net, step=step)


def test_a_model_names_one_valuation_that_allows_the_firing() -> None:
    gated = Transition("t", ("p",), external=(ExternalGate("r"), ExternalGate("s", wanted=False)))
    relation = interleaving_relation(Net("n", (Place("p", marked=True),), (gated,), (Signal("r"), Signal("s"))))
    decision = decide([relation.term, relation.initial()])
    assert decision.assignment == {"p": True, "p'": False, "fires(t)": True, "r": True, "s": False}
    assert relation.edge(decision.assignment) == (1, (0,), 0)


def test_transition_that_wants_a_signal_both_ways_never_fires() -> None:
    torn = Transition("t", ("p",), external=(ExternalGate("s"), ExternalGate("s", wanted=False)))
    net = Net("n", (Place("p", marked=True),), (torn,), (Signal("s"),))
    for encode, _ in DISCIPLINES:
        assert decide([encode(net, None).term]).answer is Answer.UNSAT


def test_relation_grows_linearly_with_the_net() -> None:
    def size(n: int) -> int:
        places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n + 1))
        net = Net("chain", places, tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(n)))
        terms = Terms()
        interleaving_relation(net, terms)
        return len(terms._known)

    assert size(800) < 2.2 * size(400)


def test_step_and_interleaving_differ_where_transitions_fire_together() -> None:
    places = (Place("p", marked=True), Place("q", marked=True))
    net = Net("n", places, (Transition("t", ("p",)), Transition("u", ("q",))))
    both = {"p": True, "q": True, "p'": False, "q'": False, "fires(t)": True, "fires(u)": True}
    assert value(step_relation(net).term, both)
    assert not value(interleaving_relation(net).term, both)
