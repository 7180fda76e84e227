"""Who waits for whom in a deadlock: circles of tokens, told by the net alone."""

from __future__ import annotations

import random

import pytest
from support.examples import seeds
from support.lively_nets import lively_net

from firable.analysis.spaces.reachability import explore
from firable.nets.catalogue import catalogue_net
from firable.nets.net import ExternalGate, Marking, Net, Place, Signal, Transition
from firable.nets.verdict import Wait
from firable.semantics.waiting import circle


def test_philosophers_wait_in_one_circle_for_the_fork_of_their_neighbour() -> None:
    net = catalogue_net("philosophers-5")
    found = circle(net, net.marking(f"p{i}.left" for i in range(1, 6)))
    assert [wait.place for wait in found] == [f"p{i}.left" for i in range(1, 6)]
    assert [wait.lacks for wait in found] == ["p2.fork", "p3.fork", "p4.fork", "p5.fork", "p1.fork"]
    assert [wait.holder for wait in found] == ["p2.left", "p3.left", "p4.left", "p5.left", "p1.left"]


def test_a_full_output_place_is_waited_for_too() -> None:
    # Each carrier wants to the place where the other one stands.
    net = Net(
        "swap",
        (Place("a", marked=True), Place("b", marked=True)),
        (Transition("to_b", ("a",), ("b",)), Transition("to_a", ("b",), ("a",))),
    )
    assert circle(net, net.initial_marking) == (
        Wait("a", "to_b", "b", wanted=False, holder="b", by=("to_a",)),
        Wait("b", "to_a", "a", wanted=False, holder="a", by=("to_b",)),
    )


@pytest.mark.parametrize(
    "never",
    [
        Transition("never", ("a",), ("a",)),
        Transition("never", ("a",), ("b",), permissive=("b",)),
        Transition("never", ("a", "b"), (), inhibitive=("a",)),
        Transition("never", ("b",), ("a",), external=(ExternalGate("s"), ExternalGate("s", wanted=False))),
    ],
)
def test_nobody_waits_for_what_can_never_fire(never: Transition) -> None:
    ways = (Transition("to_b", ("a",), ("b", "c")), Transition("to_a", ("b",), ("a",)))
    places = (Place("a", marked=True), Place("b", marked=True), Place("c"))
    net = Net("swap", places, (never, *ways), signals=(Signal("s"),))
    found = circle(net, net.initial_marking)
    assert [wait.transition for wait in found] == ["to_b", "to_a"]
    assert [wait.by for wait in found] == [("to_a",), ("to_b",)]


def test_a_token_that_nothing_takes_waits_in_no_circle() -> None:
    net = Net("end", (Place("a"), Place("b", marked=True)), (Transition("t", ("a",), ("b",)),))
    assert circle(net, net.initial_marking) == ()


@pytest.mark.seeds
def test_each_sentence_of_a_circle_is_true_of_the_marking() -> None:
    told = 0
    for seed in seeds(200):
        net = lively_net(random.Random(seed), 8)
        space = explore(net)
        witness = space.witness(space.deadlocks)
        if witness is not None:
            told += _is_true(net, net.marking(witness.marking))
    assert told > 50


def _is_true(net: Net, marking: Marking) -> bool:
    """Whether there is a circle; asserts each of its sentences."""
    found, marked = circle(net, marking), net.names(marking)
    for wait, after in zip(found, (*found[1:], *found[:1]), strict=True):
        transition = net.transition(wait.transition)
        needed, full = {*transition.inputs, *transition.permissive}, {*transition.outputs, *transition.inhibitive}
        assert wait.place in marked
        assert wait.place in transition.inputs
        assert wait.lacks in (needed if wait.wanted else full)
        assert (wait.lacks in marked) is not wait.wanted
        assert wait.holder == after.place
        assert wait.by[0] == after.transition
        assert wait.holder in net.transition(wait.by[0]).inputs
        if wait.wanted:
            assert wait.lacks in net.transition(wait.by[-1]).outputs
    return bool(found)
