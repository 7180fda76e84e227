"""The conflict relation is what its definition says, and costs no more than the net where many share one place."""

from itertools import combinations
from random import Random

import pytest

from firable.nets.net import Net, Place, Transition
from firable.semantics import conflict
from firable.semantics.conflict import conflicts, gate_races, structural_conflicts


def random_net(seed: int) -> Net:
    random = Random(seed)
    names = [f"p{i}" for i in range(random.randint(1, 6))]

    def some() -> tuple[str, ...]:
        return tuple(name for name in names if random.random() < 0.3)

    transitions = tuple(Transition(f"t{i}", some(), some(), some(), some()) for i in range(random.randint(0, 7)))
    return Net("random", tuple(map(Place, names)), transitions)


def hub(n: int) -> Net:
    """One place that n transitions empty and n others fill."""
    places = (Place("hub", marked=True), *(Place(f"p{i}") for i in range(n)))
    out = (Transition(f"a{i}", ("hub",), (f"p{i}",)) for i in range(n))
    back = (Transition(f"b{i}", (f"p{i}",), ("hub",)) for i in range(n))
    return Net("hub", places, (*out, *back))


@pytest.mark.parametrize("seed", range(60))
def test_rivals_pairs_and_components_are_those_of_the_definition(seed: int) -> None:
    net = random_net(seed)
    relation = conflicts(net)
    arcs = [(set(t.inputs), set(t.outputs)) for t in net.transitions]
    pairs = list(combinations(range(len(arcs)), 2))
    by_input = tuple((t, u) for t, u in pairs if arcs[t][0] & arcs[u][0])
    by_output = tuple((t, u) for t, u in pairs if arcs[t][1] & arcs[u][1])
    assert tuple(listed.pairs for listed in structural_conflicts(net)) == (by_input, by_output)
    for t in range(len(arcs)):
        assert relation.rivals[t] == {u for pair in by_input + by_output if t in pair for u in pair if u != t}
        assert relation.input_rivals[t] == {u for pair in by_input if t in pair for u in pair if u != t}
        others = {u for u in range(len(arcs)) if u == t or u in relation.rivals[t]}
        together = {relation.component_of[u] for u in others}
        assert together == ({-1} if others == {t} else {relation.component_of[t]})
    assert list(relation.rivals) == list(relation.rivals[:]) == [relation.rivals[t] for t in range(len(arcs))]


@pytest.mark.parametrize("seed", range(60))
def test_a_maximal_choice_has_no_conflict_and_leaves_out_none_without(seed: int) -> None:
    net = random_net(seed)
    relation = conflicts(net)
    order = list(range(len(net.transitions)))
    Random(seed).shuffle(order)
    granted = relation.maximal(order)
    assert relation.free(granted)
    assert not any(relation.rivals[t] & granted for t in granted)
    assert all(relation.rivals[t] & granted for t in order if t not in granted)


def test_the_races_among_some_are_the_races_of_the_net_between_them() -> None:
    for seed in range(40):
        net = random_net(seed)
        some = range(0, len(net.transitions), 2)
        assert list(gate_races(net, some)) == [(t, u) for t, u in gate_races(net) if t in some and u in some]


def test_of_very_many_pairs_the_first_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conflict, "PAIRS_MAX", 3)
    by_input, by_output = structural_conflicts(hub(3))
    assert (by_input.pairs, by_input.more) == (((0, 1), (0, 2), (1, 2)), False)
    assert (by_output.pairs, by_output.more) == (((3, 4), (3, 5), (4, 5)), False)
    by_input, by_output = structural_conflicts(hub(4))
    assert (by_input.pairs, by_input.more) == (((0, 1), (0, 2), (0, 3)), True)


def test_a_place_with_twenty_thousand_consumers_has_its_conflicts_in_one_component() -> None:
    relation = conflicts(hub(20_000))
    assert [len(component) for component in relation.components] == [20_000, 20_000]
    assert len(relation.maximal(range(40_000))) == 2
    assert all(listed.more for listed in structural_conflicts(hub(20_000)))
