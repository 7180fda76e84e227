"""The firing rule, one clause of SEMANTICS a test, and its evaluation in several algebras."""

from itertools import permutations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.ring_nets import ring_nets

from firable.nets.net import ExternalGate, Marking, Net, Place, Signal, Transition
from firable.semantics.algebra import BOOL, Bitwise
from firable.semantics.firing import firable, next_token
from firable.semantics.player import NotFirableError, Player, holds_in


def net_of(marked: str, empty: str, *transitions: Transition, signals: tuple[Signal, ...] = ()) -> Net:
    places = (*(Place(p, marked=True) for p in marked), *(Place(p) for p in empty))
    return Net("n", places, transitions, signals)


def fires(net: Net) -> list[str]:
    return [net.transitions[t].name for t in Player(net).firable(net.initial_marking)]


def test_an_empty_input_place_blocks_firing() -> None:
    assert fires(net_of("", "pq", Transition("t", ("p",), ("q",)))) == []


def test_a_filled_output_place_blocks_firing() -> None:
    assert fires(net_of("pq", "", Transition("t", ("p",), ("q",)))) == []


def test_a_permissive_gate_needs_a_token_and_leaves_it() -> None:
    net = net_of("pg", "q", Transition("t", ("p",), ("q",), permissive=("g",)))
    assert fires(net) == ["t"]
    assert net.names(Player(net).fire(net.initial_marking, [0])) == ("g", "q")
    assert fires(net_of("p", "gq", Transition("t", ("p",), ("q",), permissive=("g",)))) == []


def test_an_inhibitive_gate_needs_an_empty_place() -> None:
    assert fires(net_of("p", "gq", Transition("t", ("p",), ("q",), inhibitive=("g",)))) == ["t"]
    assert fires(net_of("pg", "q", Transition("t", ("p",), ("q",), inhibitive=("g",)))) == []


def test_a_transition_without_arcs_is_always_firable_and_changes_nothing() -> None:
    net = net_of("p", "", Transition("t"))
    assert fires(net) == ["t"]
    assert Player(net).fire(net.initial_marking, [0]) == net.initial_marking


def test_a_self_loop_never_fires_whether_full_or_empty() -> None:
    assert fires(net_of("p", "", Transition("t", ("p",), ("p",)))) == []
    assert fires(net_of("", "p", Transition("t", ("p",), ("p",)))) == []


def test_a_closed_external_gate_leaves_the_transition_firable_but_not_enabled() -> None:
    net = net_of("p", "", Transition("t", ("p",), external=(ExternalGate("s"),)), signals=(Signal("s"),))
    player = Player(net)
    assert player.firable(net.initial_marking) == (0,)
    assert player.enabled(net.initial_marking, {"s": False}) == ()
    assert player.enabled(net.initial_marking, {"s": True}) == (0,)
    assert not player.deadlocked(net.initial_marking)


def test_a_signal_wanted_both_ways_is_a_deadlock_although_firable() -> None:
    gates = (ExternalGate("s", True), ExternalGate("s", False))
    net = net_of("p", "", Transition("t", ("p",), external=gates), signals=(Signal("s"),))
    player = Player(net)
    assert player.firable(net.initial_marking) == (0,)
    assert player.may_fire(net.initial_marking) == ()
    assert player.deadlocked(net.initial_marking)


def test_firing_what_is_not_firable_is_refused() -> None:
    net = net_of("", "p", Transition("t", ("p",)))
    with pytest.raises(NotFirableError, match=r"'t' is not firable in \{\}"):
        Player(net).fire(0, [0])


def test_transitions_that_share_an_output_do_not_fire_together() -> None:
    net = net_of("ab", "p", Transition("t", ("a",), ("p",)), Transition("u", ("b",), ("p",)))
    with pytest.raises(NotFirableError, match="t, u conflict"):
        Player(net).fire(net.initial_marking, [0, 1])
    assert Player(net).steps(net.initial_marking) == {(0,), (1,)}


def test_a_step_over_signals_has_every_set_that_some_valuation_enables() -> None:
    gated = [
        Transition("t", ("a",), external=(ExternalGate("s", True),)),
        Transition("u", ("b",), external=(ExternalGate("s", False),)),
        Transition("v", ("c",), external=(ExternalGate("r", True),)),
    ]
    net = net_of("abc", "", *gated, signals=(Signal("s"), Signal("r")))
    assert Player(net).steps(net.initial_marking) == {(0,), (1,), (0, 2), (1, 2)}


@given(dense_nets())
def test_bool_word_and_column_algebras_agree(net: Net) -> None:
    markings = range(1 << len(net.places))
    everywhere = (1 << len(markings)) - 1
    words = Bitwise(true=everywhere, false=0)
    word_of = [sum((m >> p & 1) << m for m in markings) for p in range(len(net.places))]
    columns: Bitwise[Any] = Bitwise(true=np.True_, false=np.False_)
    column_of = [np.array([bool(m >> p & 1) for m in markings]) for p in range(len(net.places))]
    for t in range(len(net.transitions)):
        expected = [firable(BOOL, net, t, holds_in(m)) for m in markings]
        word = firable(words, net, t, word_of.__getitem__)
        assert [bool(word >> m & 1) for m in markings] == expected
        column = firable(columns, net, t, column_of.__getitem__)
        assert np.broadcast_to(column, len(markings)).tolist() == expected


@given(dense_nets(), st.integers(0, 31))
def test_next_token_is_minus_inputs_plus_outputs(net: Net, marking: int) -> None:
    player = Player(net)
    for t in player.firable(marking):
        masks = net.masks[t]
        assert player.fire(marking, [t]) == marking & ~masks.inputs | masks.outputs
        tokens = [next_token(BOOL, net, p, holds_in(marking), {t}.__contains__) for p in range(5)]
        assert sum(1 << p for p, token in enumerate(tokens) if token) == player.fire(marking, [t])


@given(dense_nets(), st.integers(0, 31))
def test_steps_are_exactly_the_maximal_sets_without_conflict(net: Net, marking: int) -> None:
    player = Player(net)
    enabled = player.may_fire(marking)
    subsets = [frozenset(t for i, t in enumerate(enabled) if bits >> i & 1) for bits in range(1 << len(enabled))]
    free = [s for s in subsets if player.conflicts.free(s)]
    maximal = {tuple(sorted(s)) for s in free if s and not any(s < other for other in free)}
    assert player.steps(marking) == maximal


def played(player: Player, marking: Marking, order: tuple[int, ...]) -> Marking | None:
    for t in order:
        if t not in player.firable(marking):
            return None
        marking = player.fire(marking, [t])
    return marking


@given(dense_nets(), st.integers(0, 31))
def test_a_step_is_serialisable_iff_some_order_replays_it(net: Net, marking: int) -> None:
    player = Player(net)
    for step in player.steps(marking):
        together = player.fire(marking, step)

        assert player.serialisable(step) == any(
            played(player, marking, order) == together for order in permutations(step)
        )


@examples(50)
@given(ring_nets(signals=True), st.data())
def test_a_set_is_a_step_iff_the_player_lists_it(net: Net, data: st.DataObject) -> None:
    player = Player(net)
    marking = data.draw(st.sampled_from(list(player.reachable(step=True))))
    steps = player.steps(marking)
    fired = tuple(data.draw(st.sets(st.integers(0, len(net.transitions) - 1)).map(sorted)))
    assert player.is_step(marking, fired) is (fired in steps)
    assert all(player.is_step(marking, step) for step in steps)


def test_a_step_is_recognised_among_many_signals() -> None:
    n = 60
    places = tuple(Place(f"p{i}", marked=True) for i in range(n))
    signals = tuple(Signal(f"s{i}") for i in range(n))
    moves = tuple(Transition(f"t{i}", (f"p{i}",), external=(ExternalGate(f"s{i}"),)) for i in range(n))
    net = Net("wide", places, (*moves, Transition("free", ("p0",))), signals)
    player = Player(net)
    assert player.is_step(net.initial_marking, (1, 5, n))
    assert not player.is_step(net.initial_marking, (1, 5))  # `free` could fire too
    assert not player.is_step(net.initial_marking, (0, n))  # they share p0
