"""Whether gate races may form a cycle in a step: told without looking at each pair, and the same as by looking."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.lively_nets import lively_nets

from firable.analysis.verdicts import conflicts as module
from firable.analysis.verdicts.conflicts import races_may_cycle
from firable.nets.net import Net, Place, Transition
from firable.semantics.conflict import conflicts, gate_races, jointly_openable


def cycles(pairs: set[tuple[int, int]]) -> bool:
    """Whether a relation has a cycle: its closure holds a pair of equals."""
    closure = set(pairs)
    while more := {(t, v) for t, u in closure for w, v in pairs if u == w} - closure:
        closure |= more
    return any(t == u for t, u in closure)


@given(st.one_of(dense_nets(signals=True), lively_nets()))
def test_a_cycle_of_races_is_seen_exactly_where_there_is_one(net: Net) -> None:
    rivals = conflicts(net).rivals
    pairs = {(t, u) for t, u in gate_races(net) if u not in rivals[t] and jointly_openable(net, (t, u))}
    assert races_may_cycle(net) is cycles(pairs)


def readers_and_closers(count: int) -> Net:
    """Each of many transitions takes the token that each of many others reads; nobody closes what a closer reads."""
    places = (Place("gate", marked=True), *(Place(f"p{i}", marked=True) for i in range(count)))
    reading = (Transition(f"read{i}", (f"p{i}",), (), ("gate",)) for i in range(count))
    closing = (Transition(f"close{i}", ("gate",)) for i in range(count))
    return Net("n", places, (*reading, *closing))


def test_races_without_a_cycle_of_gates_are_not_paired(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_RACES_MAX", 0)
    assert not races_may_cycle(readers_and_closers(5_000))


def test_too_many_pairs_to_look_at_may_be_a_cycle(monkeypatch: pytest.MonkeyPatch) -> None:
    swap = (Transition("t", ("p",), ("r",), ("q",)), Transition("u", ("q",), ("s",), ("p",)))
    net = Net("n", tuple(Place(name, marked=name in "pq") for name in "pqrs"), swap)
    assert races_may_cycle(net)
    one_of_them = Net("n", net.places, (swap[0], Transition("u", ("q", "p"), ("s",), ("p",))))
    assert not races_may_cycle(one_of_them)
    monkeypatch.setattr(module, "_RACES_MAX", 0)
    assert races_may_cycle(net)
