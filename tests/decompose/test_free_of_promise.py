"""Parts that may leave out the promise: no run of the protocol goes wrong without it, and each condition is needed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import pytest
from hypothesis import given
from support.examples import examples
from support.free_parts import parts_of
from support.owned_nets import owned_nets
from support.promising import Promising
from support.reference import load_net

from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import persistence
from firable.decompose.verification.free_parts import _against
from firable.nets.diagnostics import InputError
from firable.nets.knowledge import undisturbing
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.nets.verdict import Status

SMALL = ["local_conflict", "local_gate", "local_output_conflict", "no_trouble", "read_before_order", "remote_gate"]


def goes_wrong(net: Net, free: Collection[str]) -> bool:
    follows = Promising(split(net), free).follows()
    assert follows is not None
    return not follows


@pytest.mark.parametrize("name", SMALL)
def test_small_nets_go_right_without_the_promises_that_may_be_left_out(name: str) -> None:
    net = load_net(name)
    assert not goes_wrong(net, ())
    assert not goes_wrong(net, persistence(split(net)).free_of_promise)


@given(owned_nets())
@examples(25)
def test_no_run_goes_wrong_without_the_promises_that_may_be_left_out(net: Net) -> None:
    try:
        decomposition = split(net)
    except InputError:
        return
    assert Promising(decomposition, persistence(decomposition).free_of_promise).follows(3000) is not False


A, B = Controller("a"), Controller("b")


def of(transitions: tuple[Transition, ...], marked: str) -> Net:
    names = dict.fromkeys(name for t in transitions for name in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive))
    places = tuple(Place(name, name[0], name in marked.split()) for name in names)
    return Net("n", places, transitions, controllers=(A, B))


def test_a_part_whose_yes_a_local_transition_takes_back_must_promise() -> None:
    """`G` reads a gate that the local `l` closes: a yes from before is stale."""
    net = of((Transition("G", ("b.p",), ("b.q",), ("a.g",)), Transition("l", ("a.g",), ("a.h",))), "a.g b.p")
    assert "t1-11" in undisturbing(split(net))
    assert persistence(split(net)).free_of_promise == ("t2-12",)
    assert goes_wrong(net, ("t1-11",))
    assert not goes_wrong(net, ("t2-12",))


def test_a_persistent_part_that_another_reads_must_promise() -> None:
    """`l` reads the empty output of `G`: before the order comes, it sees it empty, though `G` has fired."""
    net = of((Transition("G", ("b.p",), ("a.x",)), Transition("l", ("a.m",), ("a.n",), (), ("a.x",))), "b.p a.m")
    decomposition = split(net)
    assert persistence(decomposition).of("t1-11").holds
    assert "t1-11" not in undisturbing(decomposition)
    assert goes_wrong(net, ("t1-11",))


def test_an_order_that_overtakes_needs_the_promise_though_no_reachable_marking_does() -> None:
    """`r` reads `a.x` empty and `a.y` full, never both in the central net: `G` fills the one before `H` the other."""
    net = of(
        (
            Transition("G", ("b.p",), ("a.x", "b.q")),
            Transition("H", ("b.q",), ("a.y",)),
            Transition("r", ("a.y",), ("a.z",), (), ("a.x",)),
        ),
        "b.p",
    )
    decomposition = split(net)
    found = persistence(decomposition)
    assert all(verdict.holds for verdict in found.verdicts)
    assert "t1-11" not in found.free_of_promise
    assert goes_wrong(net, ("t1-11",))
    assert not goes_wrong(net, found.free_of_promise)


def test_a_part_that_clears_a_completion_which_another_reads_must_promise() -> None:
    """`v` waits for the completion of `a.x`: before the order of the second `G` comes, it sees that of the first."""
    done = (ExternalGate("a.at"),)
    bare = of(
        (
            Transition("G", ("a.p", "b.p"), ("a.x", "b.q")),
            Transition("H", ("a.x", "b.q"), ("a.p", "b.p")),
            Transition("v", ("a.y",), ("a.z",)),
        ),
        "a.p b.p a.y",
    )
    sends = {"a.x": Place("a.x", "a", command=Command("A", "GO"), completion="a.at")}
    places = tuple(sends.get(place.name, place) for place in bare.places)
    start, end, reader = bare.transitions
    crossing = (start, replace(end, external=done))
    for reads in ((), ("a.x",)):
        v = replace(reader, permissive=reads, external=done)
        signals = (Signal("a.at", "a", SignalKind.COMPLETION),)
        net = replace(bare, places=places, transitions=(*crossing, v), signals=signals)
        free = persistence(split(net)).free_of_promise
        assert ("t1-11" in free) == bool(reads)
        assert goes_wrong(net, ("t1-11",)) == (not reads)
        assert not goes_wrong(net, free)


def kept_open() -> Net:
    """`l` would close the gate that `G` reads, and is kept from it by the completion that `G` waits for, alone."""
    places = (
        Place("a.i", "a", marked=True),
        Place("a.p", "a", command=Command("m", "GO"), completion="a.done"),
        *(Place("a.r", "a"), Place("a.g", "a", marked=True), Place("a.h", "a")),
        *(Place("b.p", "b", marked=True), Place("b.q", "b")),
    )
    done, undone = ExternalGate("a.done"), ExternalGate("a.done", wanted=False)
    transitions = (
        Transition("start", ("a.i",), ("a.p",)),
        Transition("G", ("a.p", "b.p"), ("a.r", "b.q"), ("a.g",), external=(done,)),
        Transition("l", ("a.g",), ("a.h",), external=(undone,)),
    )
    signals = (Signal("a.done", "a", kind=SignalKind.COMPLETION),)
    return Net("kept open", places, transitions, signals, (A, B))


def test_a_part_whose_gate_is_kept_open_by_a_completion_alone_promises() -> None:
    """Its yes is persistent; but the net of the protocol has no signals, and there it would be taken back."""
    decomposition = split(kept_open())
    found = persistence(decomposition)
    assert found.of("t1-11").holds
    assert found.free_of_promise == ("t2-12",)
    subnet = decomposition.subnet("a")
    assert list(_against(subnet, subnet.transition("t1-11"))) == [
        "'a.done' alone keeps 'l' from closing its gate 'a.g'"
    ]
    assert explore_protocol(parts_of(decomposition, "t2-12")).refines is Status.PROVED
    assert explore_protocol(parts_of(decomposition, "t1-11")).refines is Status.VIOLATED
