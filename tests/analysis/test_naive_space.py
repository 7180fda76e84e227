"""The oracle of the state spaces is one itself, and says of the example cell what is known of it."""

from support.naive_space import Markings, NaiveSpace

from firable.analysis.spaces.space import StateSpace
from firable.nets.catalogue import catalogue_net
from firable.semantics.trace import Discipline


def space_of(name: str, discipline: Discipline = Discipline.INTERLEAVING) -> StateSpace[Markings]:
    return NaiveSpace(catalogue_net(name), discipline)  # the type checker holds it to the protocol


def test_the_example_cell_is_live_and_reversible() -> None:
    space = space_of("one_robot")
    assert (space.n_markings, space.n_edges) == (40, 70)
    assert not space.deadlocks
    assert space.count(space.home()) == space.n_markings == space.count(space.endless())


def test_a_marking_is_found_by_a_firing_sequence() -> None:
    space = space_of("one_robot")
    far = space.algebra.negation(space.initial)
    witness = space.witness(far, "away")
    assert witness is not None
    assert len(witness.firings) == 1
    assert space.contains(far, space.net.marking(witness.marking))
    assert space.witness(frozenset()) is None
