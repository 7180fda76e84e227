"""Running, waiting and deadlock are told apart."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples

from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
from firable.semantics.judgement import Judgement, judge
from firable.semantics.player import Player


@examples(50)
@given(dense_nets(signals=True), st.booleans(), st.booleans())
def test_a_net_waits_iff_another_valuation_would_let_it_run(net: Net, r: bool, s: bool) -> None:
    player, marking = Player(net), net.initial_marking
    some = any(player.enabled(marking, {"r": a, "s": b}) for a in (False, True) for b in (False, True))
    now = bool(player.enabled(marking, {"r": r, "s": s}))
    expected = Judgement.RUNNING if now else Judgement.WAITING if some else Judgement.DEADLOCK
    assert judge(player, marking, {"r": r, "s": s}) is expected


def test_a_gate_that_no_valuation_opens_is_a_deadlock_and_no_waiting() -> None:
    gates = (ExternalGate("s"), ExternalGate("s", wanted=False))
    net = Net("n", (Place("p", marked=True),), (Transition("t", ("p",), external=gates),), (Signal("s"),))
    assert judge(Player(net), 1, {"s": True}) is Judgement.DEADLOCK
