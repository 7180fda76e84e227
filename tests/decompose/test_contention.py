"""What two coordinators may not both decide without being in conflict: parts that could be promised, and disturb."""

from __future__ import annotations

from dataclasses import replace

import pytest

from firable.decompose.proofs.proving import prove
from firable.decompose.splitting.cut import split
from firable.decompose.verification.recut import Cut, check_cut
from firable.nets.contention import Contention, contentions
from firable.nets.knowledge import reasons
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition

LINE = Controller("line", coordinator=True)
CONTROLLERS = (LINE, Controller("cell"), Controller("r", under="cell"), Controller("m", under="cell"), Controller("x"))
WITHIN = Transition("within", ("r.p", "m.p"), ("r.q", "m.q"))
"""Decided by the cell, unless something lifts it."""


def over(*, r: str = "r.s", gates: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())) -> Transition:
    """Decided by the line: a token from r.s and x, under gates."""
    return Transition("over", (r, "x.p"), ("x.q",), *gates)


def line_and_cell(over: Transition, *more: Transition, within: Transition = WITHIN) -> Net:
    names = {"r": "pqsuw", "m": "pqw", "x": "pq"}
    places = tuple(Place(f"{c}.{p}", c, marked=p in "ps") for c, its in names.items() for p in its)
    return Net("n", places, (within, over, *more), controllers=CONTROLLERS)


def decided(net: Net) -> dict[str, str | None]:
    """Who decides, once proved, and found again by the second text of the definitions."""
    decomposition = split(net)
    assert {verdict.name for verdict in prove(decomposition).verdicts if not verdict.holds} == set()
    check_cut(decomposition)
    return {row.name: row.at for row in decomposition.coordinated}


@pytest.mark.parametrize(
    ("gates", "found"),
    [
        (((), ()), []),
        ((("r.p",), ()), [Contention("within", "over", "r.p")]),
        (((), ("r.q",)), [Contention("within", "over", "r.q")]),
        ((("m.p",), ()), [Contention("within", "over", "m.p")]),
        ((("r.q",), ()), []),  # full only when the other part was fired: they are never promised together
        (((), ("r.p",)), []),
        ((("r.u",), ()), []),
    ],
)
def test_who_moves_what_another_one_reads_is_decided_with_it(
    gates: tuple[tuple[str, ...], tuple[str, ...]], found: list[Contention]
) -> None:
    net = line_and_cell(over(gates=gates))
    assert list(contentions(net, ("within", "over"))) == found
    assert decided(net) == {"within": None if found else "cell", "over": None}


def test_what_contends_with_the_lifted_is_lifted_too() -> None:
    """`beside` contends with `within` alone, and would be decided by the cell; the line decides all three."""
    beside = Transition("beside", ("r.w",), ("m.w",), (), ("m.q",))
    assert decided(line_and_cell(over(), beside)) == {"within": "cell", "over": None, "beside": "cell"}
    lifted = line_and_cell(over(gates=(("r.p",), ())), beside)
    assert decided(lifted) == dict.fromkeys(("within", "over", "beside"))


def test_reason_names_who_is_in_the_way() -> None:
    (lifted,) = [r for r in reasons(split(line_and_cell(over(gates=(("r.p",), ()))))) if r.lifted_from]
    assert (lifted.transition, lifted.lifted_from, lifted.rival, lifted.place) == ("within", "cell", "over", "r.p")


def commanding(*, asks: bool) -> Net:
    """Both transitions send a command of `r` that one signal completes; with `asks` the line's reads that signal."""
    net = line_and_cell(over())
    moves = Transition("over", ("r.s", "x.p"), ("r.u", "x.q"), external=(ExternalGate("r.at"),) if asks else ())
    places = tuple(
        replace(place, command=Command("R", "GO"), completion="r.at") if place.name in {"r.q", "r.u"} else place
        for place in net.places
    )
    return replace(
        net, places=places, transitions=(WITHIN, moves), signals=(Signal("r.at", "r", SignalKind.COMPLETION),)
    )


def test_two_commands_that_one_signal_completes_do_not_contend_and_one_that_waits_for_it_does() -> None:
    assert list(contentions(commanding(asks=False), ("within", "over"))) == []
    assert decided(commanding(asks=False)) == {"within": "cell", "over": None}
    assert list(contentions(commanding(asks=True), ("within", "over"))) == [Contention("within", "over", "r.at")]
    assert decided(commanding(asks=True)) == {"within": None, "over": None}


LOWER = (
    *(Controller("r", under="cell"), Controller("m", under="cell")),
    *(Controller("cell", under="line"), Controller("x", under="line"), Controller("line")),
)
"""The same under a coordinator more, and listed in another order."""


@pytest.mark.parametrize("controllers", [CONTROLLERS, LOWER], ids=["in two layers", "in three layers"])
@pytest.mark.parametrize(
    "net",
    [
        line_and_cell(over(gates=(("r.p",), ()))),
        line_and_cell(over(gates=((), ("r.q",)))),
        line_and_cell(over(r="r.p")),
        line_and_cell(Transition("over", ("r.s", "x.p"), ("r.q", "x.q"))),
        commanding(asks=True),
    ],
    ids=["takes what is read", "fills what is read", "takes the same", "fills the same", "clears what is read"],
)
def test_left_below_it_is_refuted(net: Net, controllers: tuple[Controller, ...]) -> None:
    transitions = net.transitions if controllers is CONTROLLERS else net.transitions[::-1]
    decomposition = split(replace(net, controllers=controllers, transitions=transitions))
    rows = tuple(replace(row, at="cell") if row.name == "within" else row for row in decomposition.coordinated)
    edited = replace(decomposition, coordinated=rows)
    assert [verdict.name for verdict in prove(edited).verdicts if not verdict.holds] == ["o8", "o8-apart"]


def test_the_highest_coordinator_is_the_same_by_its_name() -> None:
    decomposition = split(line_and_cell(over(gates=(("r.p",), ()))))
    rows = tuple(replace(row, at="line") if row.name == "within" else row for row in decomposition.coordinated)
    assert prove(replace(decomposition, coordinated=rows)).holds


def test_nothing_is_asked_of_one_layer() -> None:
    net = line_and_cell(over(gates=(("r.p",), ())))
    flat = replace(net, controllers=tuple(replace(controller, under=None) for controller in net.controllers))
    assert not Cut(flat).in_layers
    assert not any(verdict.name.startswith("o8") for verdict in prove(split(flat)).verdicts)
