"""Edits that one family alone refutes, or each of several: none is left out because another one sees it, too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from firable.decompose.proofs.proving import prove
from firable.decompose.splitting.cut import split
from firable.nets.decomposition import ArbitrationGroup, Decomposition, Part
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Signal,
    SignalKind,
    TimeLimit,
    Transition,
)

NET = Net(
    "light",
    (Place("a.off", "a", marked=True), Place("a.on", "a"), Place("b.ok", "b", marked=True), Place("b.rest", "b")),
    (
        Transition("up", ("a.off",), ("a.on",), ("b.ok",), number=1),
        Transition("down", ("a.on",), ("a.off",), ("b.ok",), number=2),
        Transition("dim", ("a.on",)),
        Transition("tire", ("b.ok",), ("b.rest",)),
    ),
    controllers=(Controller("a"), Controller("b")),
)
"""Both of its global transitions read one place of `b`; `dim` is in conflict with one of them, and local."""


def refuted(decomposition: Decomposition) -> set[str]:
    return {verdict.name for verdict in prove(decomposition).verdicts if not verdict.holds}


def with_row(name: str, parts: tuple[Part, ...]) -> Decomposition:
    whole = split(NET)
    rows = tuple(replace(row, parts=parts) if row.name == name else row for row in whole.coordinated)
    return replace(whole, coordinated=rows)


def with_b(b: Net) -> Decomposition:
    whole = split(NET)
    return replace(whole, subnets=(whole.subnet("a"), b))


def test_the_net_is_proved_as_it_is_split() -> None:
    assert refuted(split(NET)) == set()


def test_one_part_of_two_transitions_is_refuted_though_it_moves_nothing() -> None:
    """One vote would be counted for both; no equation sees it, since both read the same."""
    shared = with_row("down", (Part("a", "t1-21"), Part("b", "t2-12")))
    b = split(NET).subnet("b")
    subnets = (shared.subnet("a"), replace(b, transitions=tuple(t for t in b.transitions if t.name != "t2-22")))
    assert refuted(replace(shared, subnets=subnets)) == {"ownership"}


def test_place_that_its_subnet_says_nobody_owns_is_refuted() -> None:
    b = split(NET).subnet("b")
    assert refuted(with_b(replace(b, places=(replace(b.places[0], owner=None), *b.places[1:])))) == {"ownership"}


def test_subnet_with_an_arbiter_of_its_own_is_refuted() -> None:
    """Conflicts are decided by the groups of the table."""
    b = split(NET).subnet("b")
    assert refuted(with_b(replace(b, arbiters=(Arbiter("own", ("t2-12", "tire")),)))) == {"ownership"}


def test_subnet_that_calls_its_controller_a_coordinator_is_refuted() -> None:
    b = split(NET).subnet("b")
    assert refuted(with_b(replace(b, controllers=(Controller("b", coordinator=True),)))) == {"ownership"}


def test_transition_that_no_subnet_has_is_refuted_though_nothing_can_hold_it_back() -> None:
    whole = split(NET)
    idle = replace(NET, transitions=(*NET.transitions, Transition("idle")))
    assert refuted(replace(whole, net=idle)) == {"eq7.idle", "eq8.idle"}


def test_row_that_is_missing_is_refuted_of_its_transition_and_where_that_competes() -> None:
    whole = split(NET)
    assert [row.name for row in whole.coordinated] == ["up", "down", "dim"]
    without = {row.name: tuple(r for r in whole.coordinated if r is not row) for row in whole.coordinated}
    found = {name: refuted(replace(whole, coordinated=rows)) for name, rows in without.items()}
    assert {name for name in found["up"] if name.startswith("o2.")} == {"o2.up"}
    assert {name for name in found["down"] if name.startswith("o2.")} == {"o2.down", "o2.a.on"}
    assert found["dim"] == {"o2.a.on", "arbitration"}


@pytest.mark.parametrize(
    "edit",
    [
        lambda _: (),
        lambda group: (group, replace(group, name="again")),
        lambda group: (replace(group, controller="a"),),
        lambda group: (replace(group, sequence=group.sequence[1:], rest=group.rest[1:]),),
        lambda group: (replace(group, sequence=group.sequence[:-1], rest=group.rest[:-1]),),
    ],
    ids=["by no group", "by two", "by a controller, though one has a row", "not the first", "not the last"],
)
def test_group_that_does_not_decide_for_all_that_compete_is_refuted_where_they_do(
    edit: Callable[[ArbitrationGroup], tuple[ArbitrationGroup, ...]],
) -> None:
    whole = split(NET)
    (group,) = whole.groups
    found = refuted(replace(whole, groups=edit(group)))
    assert {name for name in found if name.startswith("o2.")} == {"o2.a.on"}


def test_row_is_demanded_of_a_transition_in_which_another_takes_part_by_a_signal_alone() -> None:
    ends = (Place("a.p", "a", marked=True), Place("a.q", "a"))
    reads = Transition("read", ("a.p",), ("a.q",), external=(ExternalGate("b.s"),))
    whole = split(Net("watch", ends, (reads,), (Signal("b.s", "b"),), (Controller("a"), Controller("b"))))
    assert refuted(whole) == set()
    (row,) = whole.coordinated
    assert "o2.read" in refuted(replace(whole, coordinated=()))
    assert refuted(replace(whole, coordinated=(replace(row, parts=row.parts[:1]),))) >= {"eq8.read", "o3.read"}


def test_part_that_nobody_has_is_refuted_of_what_it_takes_part_in() -> None:
    found = refuted(with_row("up", (Part("a", "t1-11"), Part("b", "t2-12"), Part("b", "nothing"))))
    assert {"eq7.up", "eq8.up", "o3.up"} <= found


REPEATING = Net(
    "press",
    (
        Place("a.p", "a", marked=True),
        *(Place(f"b.{name}", "b", marked=name in {"in", "ok"}) for name in ("in", "out", "ok", "no")),
    ),
    (Transition("G", ("a.p", "b.in"), ("b.out",), ("b.ok", "b.in"), ("b.no", "b.out"), (ExternalGate("b.s"),)),),
    (Signal("b.s", "b"),),
    (Controller("a"), Controller("b")),
)
"""Two of the gates of its transition say what its arcs say anyway."""


@pytest.mark.parametrize(
    ("kind", "lacking", "families"),
    [
        ("inputs", "b.in", {"eq9-10", "o3"}),  # which a gate still reads
        ("outputs", "b.out", {"eq9-10", "o3"}),
        ("permissive", "b.ok", {"eq7", "o3"}),
        ("permissive", "b.in", {"o3"}),
        ("inhibitive", "b.no", {"eq7", "o3"}),
        ("inhibitive", "b.out", {"o3"}),
        ("external", ExternalGate("b.s"), {"eq8", "o3"}),
    ],
)
def test_arc_or_gate_that_a_part_lacks_is_refuted_of_what_it_reads(
    kind: str, lacking: object, families: set[str]
) -> None:
    whole = split(REPEATING)
    (part,) = whole.subnet("b").transitions
    left: dict[str, Any] = {kind: tuple(one for one in getattr(part, kind) if one != lacking)}
    b = replace(whole.subnet("b"), transitions=(replace(part, **left),))
    found = refuted(replace(whole, subnets=(whole.subnet("a"), b)))
    assert {name.partition(".")[0] for name in found} == families


@pytest.mark.parametrize("kind", ["permissive", "inhibitive", "external"])
def test_gate_that_a_part_reads_from_a_copy_is_refuted_of_what_it_reads(kind: str) -> None:
    """A copy is as old as its last message."""
    whole = split(REPEATING)
    a, b = whole.subnets
    (here,), (there,) = a.transitions, b.transitions
    read = getattr(there, kind)[0]
    kept: dict[str, Any] = {kind: getattr(there, kind)[1:]}
    moved: dict[str, Any] = {kind: (read,)}
    copies = tuple(replace(place, owner=None) for place in b.places if place.name == read)
    signals = tuple(replace(signal, owner=None) for signal in b.signals if kind == "external")
    a = replace(a, transitions=(replace(here, **moved),), places=(*a.places, *copies), signals=signals)
    found = refuted(replace(whole, subnets=(a, replace(b, transitions=(replace(there, **kept),)))))
    assert {"o3.G", "ownership"} <= found


def test_what_nobody_owns_is_not_what_a_controller_of_the_name_none_owns() -> None:
    whole = split(
        Net(
            "none",
            (Place("None.p", "None", marked=True),),
            (Transition("t", ("None.p",), external=(ExternalGate("None.s"),)),),
            (Signal("None.s", "None"),),
            (Controller("None"),),
        )
    )
    assert refuted(whole) == set()
    nobodys = replace(whole.net, signals=(Signal("None.s"),))
    assert {"o3.t", "ownership"} <= refuted(replace(whole, net=nobodys))


SENDING = Net(
    "mill",
    (
        Place("a.idle", "a", marked=True),
        Place("a.show", "a", command=Command("LAMP", "ON")),
        Place("a.run", "a", command=Command("M", "RUN", (("n", "1"),)), completion="a.done"),
        Place("a.turn", "a", command=Command("M", "TURN"), completion="a.turned", within=TimeLimit(5, "a.late")),
    ),
    (
        Transition("start", ("a.idle",), ("a.show",), external=(ExternalGate("a.door"),)),
        Transition("run", ("a.show",), ("a.run",)),
        Transition("turn", ("a.run",), ("a.turn",), external=(ExternalGate("a.done"),)),
        Transition("end", ("a.turn",), ("a.idle",), external=(ExternalGate("a.turned"),)),
        Transition(
            "late", ("a.turn",), ("a.idle",), external=(ExternalGate("a.turned", wanted=False), ExternalGate("a.late"))
        ),
    ),
    (
        Signal("a.door", "a"),
        *(Signal(f"a.{name}", "a", SignalKind.COMPLETION) for name in ("done", "turned")),
        Signal("a.late", "a", SignalKind.TIMER),
    ),
    (Controller("a"),),
)


@pytest.mark.parametrize(
    ("name", "edit"),
    [
        ("a.show", {"command": None}),
        ("a.idle", {"command": Command("LAMP", "OFF")}),
        ("a.run", {"command": Command("OTHER", "RUN", (("n", "1"),))}),
        ("a.run", {"command": Command("M", "OTHER", (("n", "1"),))}),
        ("a.run", {"command": Command("M", "RUN", (("n", "2"),))}),
        ("a.run", {"completion": None}),
        ("a.turn", {"within": TimeLimit(6, "a.late")}),
    ],
)
def test_command_that_a_subnet_sends_or_ends_otherwise_is_refuted_of_commands(name: str, edit: dict[str, Any]) -> None:
    whole = split(SENDING)
    assert refuted(whole) == set()
    (a,) = whole.subnets
    changed = replace(a, places=tuple(replace(p, **edit) if p.name == name else p for p in a.places))
    assert refuted(replace(whole, subnets=(changed,))) == {"commands"}


def test_signal_that_is_a_completion_in_its_subnet_alone_is_refuted_of_commands() -> None:
    """It would be cleared by a command, and the sensor by nobody."""
    whole = split(SENDING)
    (a,) = whole.subnets
    door, *others = a.signals
    changed = replace(a, signals=(replace(door, kind=SignalKind.COMPLETION), *others))
    assert refuted(replace(whole, subnets=(changed,))) == {"commands"}


def jobs(*transitions: Transition) -> Net:
    """Of four jobs two take turns, and the others come after them."""
    free = tuple(Place(f"a.{name}", "a", marked=True) for name in ("free", "one", "two", "three", "four"))
    return Net(
        "jobs",
        (*free, Place("a.done", "a")),
        transitions,
        controllers=(Controller("a"), Controller("b")),
        arbiters=(Arbiter("next", ("one", "two"), ArbitrationRule.ORDER),),
    )


TAKING = jobs(*(Transition(name, ("a.free", f"a.{name}")) for name in ("one", "two", "three", "four")))
FILLING = jobs(*(Transition(name, (f"a.{name}",), ("a.done",)) for name in ("one", "two", "three", "four")))


@pytest.mark.parametrize("net", [TAKING, FILLING], ids=["for an input", "for an output"])
def test_group_that_decides_in_another_order_is_refuted_of_what_it_lists_and_of_what_it_grants(net: Net) -> None:
    whole = split(net)
    (group,) = whole.groups
    assert refuted(whole) == set()
    for edited in (
        replace(group, sequence=group.sequence[::-1]),
        replace(group, rest=group.rest[::-1]),
        replace(group, by=ArbitrationRule.PRIORITY),
    ):
        assert refuted(replace(whole, groups=(edited,))) == {"arbitration", f"arbitration.{group.name}"}


def test_group_that_another_controller_would_decide_is_refuted_of_what_it_lists() -> None:
    whole = split(TAKING)
    assert [group.controller for group in whole.groups] == ["a"]
    elsewhere = tuple(replace(group, controller="b") for group in whole.groups)
    assert refuted(replace(whole, groups=elsewhere)) == {"arbitration"}


def test_who_wins_is_refuted_where_subnets_meet_at_an_output_instead_of_an_input() -> None:
    """What is granted is the same, and a rotation would never turn."""
    whole = split(TAKING)
    a, b = whole.subnets
    filling = tuple(replace(t, inputs=t.inputs[1:], outputs=t.inputs[:1]) for t in a.transitions)
    found = refuted(replace(whole, subnets=(replace(a, transitions=filling), b)))
    assert f"arbitration.{whole.groups[0].name}" in found
