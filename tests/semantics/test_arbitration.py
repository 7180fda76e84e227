"""Arbitration grants maximal sets, by the three rules."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firable.nets.diagnostics import InputError
from firable.nets.net import Arbiter, ArbitrationRule, Net, Place, Transition
from firable.semantics.arbitration import Arbitration, per_place_choice


def chooser(among: tuple[str, ...], by: ArbitrationRule) -> Net:
    """One place, three transitions that want its token."""
    transitions = tuple(Transition(name, ("p",)) for name in "tuv")
    return Net("n", (Place("p", marked=True),), transitions, arbiters=(Arbiter("a", among, by),))


def winners(net: Net, rounds: int, enabled: tuple[int, ...] = (0, 1, 2)) -> str:
    arbitration = Arbitration.of(net)
    turns, won = arbitration.first_turns, ""
    for _ in range(rounds):
        granted, turns = arbitration.decide(enabled, turns)
        won += "".join(net.transitions[t].name for t in granted)
    return won


def test_priority_always_grants_the_first() -> None:
    assert winners(chooser(("v", "t"), ArbitrationRule.PRIORITY), 3) == "vvv"


def test_rotation_turns_past_the_last_winner() -> None:
    assert winners(chooser(("t", "u", "v"), ArbitrationRule.ROTATION), 7) == "tuvtuvt"


def test_rotation_passes_over_who_is_not_enabled() -> None:
    assert winners(chooser(("t", "u", "v"), ArbitrationRule.ROTATION), 4, (0, 2)) == "tvtv"


def test_a_specified_order_may_name_one_twice() -> None:
    assert winners(chooser(("t", "t", "u"), ArbitrationRule.ORDER), 6) == "ttuttu"


def test_an_uncontested_grant_does_not_turn_the_rotation() -> None:
    arbitration = Arbitration.of(chooser(("t", "u", "v"), ArbitrationRule.ROTATION))
    assert arbitration.decide([0], arbitration.first_turns)[1] == arbitration.first_turns


def test_who_wins_beside_the_conflict_does_not_turn_the_rotation() -> None:
    # t and u want p; z, which would compete with x for r, is not enabled, so x has beaten nobody.
    shapes = {"t": ("p",), "x": ("r",), "u": ("p", "q"), "z": ("q", "r")}
    transitions = tuple(Transition(name, inputs) for name, inputs in shapes.items())
    rotation = Arbiter("a", tuple(shapes), ArbitrationRule.ROTATION)
    arbitration = Arbitration.of(Net("n", tuple(map(Place, "pqr")), transitions, arbiters=(rotation,)))
    assert arbitration.decide([0, 1, 2], arbitration.first_turns) == ((0, 1), (1,))


def two_contests(among: tuple[str, ...], by: ArbitrationRule) -> Arbitration:
    """t and u want p, v and x want q; y, which wants both, makes one component of them."""
    shapes = {"t": ("p",), "u": ("p",), "v": ("q",), "x": ("q",), "y": ("p", "q")}
    transitions = tuple(Transition(name, inputs) for name, inputs in shapes.items())
    return Arbitration.of(Net("n", tuple(map(Place, "pq")), transitions, arbiters=(Arbiter("a", among, by),)))


def won(arbitration: Arbitration, rounds: int, enabled: tuple[int, ...]) -> list[str]:
    turns, won = arbitration.first_turns, []
    for _ in range(rounds):
        granted, turns = arbitration.decide(enabled, turns)
        won.append("".join("tuvxy"[t] for t in granted))
    return won


def test_one_that_is_not_named_turns_nothing_when_it_wins() -> None:
    arbitration = two_contests(("t", "u"), ArbitrationRule.ROTATION)
    assert won(arbitration, 4, (0, 1, 2, 3, 4)) == ["tv", "uv", "tv", "uv"]


def test_of_several_who_win_in_one_step_none_turns_past_one_who_loses() -> None:
    assert won(two_contests(("t", "u", "v"), ArbitrationRule.ROTATION), 4, (0, 1, 2, 3)) == ["tv", "uv", "tv", "uv"]
    in_rotation = won(two_contests(("t", "u", "v", "x"), ArbitrationRule.ROTATION), 5, (0, 1, 2, 3))
    assert in_rotation == ["tv", "uv", "tx", "uv", "tx"]


def test_one_named_twice_has_both_its_turns_where_another_wins_beside_it() -> None:
    arbitration = two_contests(("t", "t", "v", "u"), ArbitrationRule.ORDER)
    assert won(arbitration, 6, (0, 1, 2, 3)) == ["tv", "tv", "uv"] * 2


@given(st.data())
def test_whoever_is_named_and_stays_enabled_wins_before_the_sequence_is_through(data: st.DataObject) -> None:
    by = data.draw(st.sampled_from([ArbitrationRule.ORDER, ArbitrationRule.ROTATION]))
    names = st.lists(st.sampled_from("tuvxy"), min_size=2, max_size=6, unique=by is ArbitrationRule.ROTATION)
    among = data.draw(names.filter(lambda drawn: len(set(drawn)) > 1))
    enabled = tuple(sorted(data.draw(st.frozensets(st.integers(0, 4)))))
    served = "".join(won(two_contests(tuple(among), by), len(among), enabled))
    assert {name for name in among if "tuvxy".index(name) in enabled} <= set(served)


def test_a_conflict_over_an_output_does_not_turn_the_rotation() -> None:
    transitions = (Transition("t", ("p",), ("s",)), Transition("u", ("q",), ("s",)))
    rotation = Arbiter("a", ("t", "u"), ArbitrationRule.ROTATION)
    arbitration = Arbitration.of(Net("n", tuple(map(Place, "pqs")), transitions, arbiters=(rotation,)))
    assert arbitration.decide([0, 1], arbitration.first_turns) == ((0,), (0,))


def test_a_component_without_an_arbiter_is_not_called_as_the_arbiter_of_another() -> None:
    transitions = tuple(Transition(f"t{i}", ("p" if i < 2 else "q",)) for i in range(4))
    arbiter = Arbiter("conflict-2", ("t0", "t1"), ArbitrationRule.PRIORITY)
    arbitration = Arbitration.of(Net("n", tuple(map(Place, "pq")), transitions, arbiters=(arbiter,)))
    assert [group.name for group in arbitration.groups] == ["conflict-2", "conflict-conflict-2"]


def test_components_without_an_arbiter_are_numbered_from_one_and_decided_in_the_order_of_the_file() -> None:
    places = (Place("p"), Place("q"))
    transitions = tuple(Transition(t, (p,)) for t, p in (("t", "p"), ("u", "p"), ("v", "q"), ("w", "q")))
    arbitration = Arbitration.of(Net("n", places, transitions, arbiters=(Arbiter("a", ("u", "t")),)))
    assert [group.name for group in arbitration.groups] == ["a", "conflict-2"]
    assert arbitration.decide([0, 1, 2, 3], arbitration.first_turns)[0] == (1, 2)


def test_an_arbiter_over_two_components_is_refused() -> None:
    places = (Place("p"), Place("q"))
    transitions = tuple(Transition(t, (p,)) for t, p in (("t", "p"), ("u", "p"), ("v", "q"), ("w", "q")))
    net = Net("n", places, transitions, arbiters=(Arbiter("a", ("t", "u", "v")),))
    with pytest.raises(InputError, match="F2013") as refusal:
        Arbitration.of(net)
    assert refusal.value.diagnostics[0].hint == "leave out v, or check the arcs"


def test_two_arbiters_of_one_component_are_refused() -> None:
    transitions = tuple(Transition(t, ("p",)) for t in "tuvw")
    arbiters = (Arbiter("a", ("t", "u")), Arbiter("b", ("v", "w")))
    with pytest.raises(InputError, match="'b' and 'a' decide the same conflict component"):
        Arbitration.of(Net("n", (Place("p"),), transitions, arbiters=arbiters))


def test_an_arbiter_for_each_place_fires_nothing_on_a_cycle() -> None:
    assert per_place_choice({"x": [0, 1], "y": [1, 2], "z": [2, 0]}, [0, 1, 2]) == ()
    assert per_place_choice({"x": [0, 1], "y": [1, 2]}, [0, 1, 2]) == (0,)  # a chain loses the third


arcs = st.frozensets(st.sampled_from("pqrs"), max_size=2).map(lambda names: tuple(sorted(names)))


@given(st.lists(st.tuples(arcs, arcs), max_size=6), st.sampled_from(ArbitrationRule), st.data())
def test_what_is_granted_is_conflict_free_and_maximal(
    shapes: list[tuple[tuple[str, ...], tuple[str, ...]]], rule: ArbitrationRule, data: st.DataObject
) -> None:
    transitions = tuple(Transition(f"t{i}", *shape) for i, shape in enumerate(shapes))
    net = Net("n", tuple(map(Place, "pqrs")), transitions)
    arbiters = []
    for component in Arbitration.of(net).conflicts.components:
        among = data.draw(st.permutations([net.transitions[t].name for t in component]))
        arbiters.append(Arbiter(f"a{component[0]}", tuple(among), rule))
    arbitration = Arbitration.of(Net("n", net.places, net.transitions, arbiters=tuple(arbiters)))
    turns = arbitration.first_turns
    for _ in range(4):
        enabled = data.draw(st.frozensets(st.sampled_from(range(len(shapes)))) if shapes else st.just(frozenset()))
        granted, turns = arbitration.decide(enabled, turns)
        assert set(granted) <= enabled
        assert arbitration.conflicts.free(granted)
        assert all(arbitration.conflicts.rivals[t] & set(granted) for t in enabled - set(granted))
