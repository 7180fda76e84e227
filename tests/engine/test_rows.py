"""The two forms in which the engine takes a net: a row for each transition, and all of them end to end."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from support.dense_nets import dense_nets

from firable.analysis import _engine
from firable.analysis.compiled import flat, rows
from firable.nets.catalogue import family_net
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition

LIMITS: dict[str, Any] = {"max_markings": 10_000, "max_memory_bytes": 1 << 26, "max_seconds": None}
NOTHING = (b"", b"")


def graph_of(compiled: tuple[Any, Any, Any], *, step: bool) -> tuple[Any, ...]:
    graph = _engine.explore(*compiled, step=step, **LIMITS)
    return graph.n_markings, graph.n_edges, graph.markings_bytes(), graph.fired(), graph.contacts()


@given(net=dense_nets(signals=True))
def test_both_forms_are_the_same_net(net: Net) -> None:
    for step in (False, True):
        assert graph_of(flat(net), step=step) == graph_of(rows(net), step=step)


def test_the_forms_agree_on_gates_and_on_what_is_wanted_of_signals() -> None:
    gates = (ExternalGate("a"), ExternalGate("b", wanted=False))
    net = Net(
        "gated",
        tuple(Place(f"p{i}", marked=i % 2 == 0) for i in range(6)),
        (
            Transition("never", ("p0",), ("p1",), external=(ExternalGate("a"), ExternalGate("a", wanted=False))),
            Transition("t", ("p0",), ("p1",), ("p2",), ("p3",), gates),
            Transition("u", ("p2",), ("p3",), inhibitive=("p0",)),
            Transition("v", ("p4",), ("p5",), permissive=("p1", "p2"), external=(ExternalGate("b"),)),
        ),
        (Signal("a"), Signal("b")),
    )
    for step in (False, True):
        assert graph_of(flat(net), step=step) == graph_of(rows(net), step=step)


def test_the_diagram_and_the_search_by_stubborn_sets_take_both_forms() -> None:
    net = family_net("philosophers-4")
    counts = [
        _engine.explore_symbolically(*compiled, max_memory_bytes=1 << 24).reach().count()
        for compiled in (flat(net), rows(net))
    ]
    searches = [_engine.Stubborn(*compiled).deadlocks(**LIMITS).n_markings for compiled in (flat(net), rows(net))]
    assert counts[0] == counts[1]
    assert searches[0] == searches[1]


class Made:
    """A transition whose names are made anew each time that somebody asks for them, and kept by nobody."""

    permissive = inhibitive = external = ()

    def __init__(self, at: int) -> None:
        self.at = at

    @property
    def inputs(self) -> tuple[str, ...]:
        return (f"place {self.at}",)

    @property
    def outputs(self) -> tuple[str, ...]:
        return (f"place {self.at + 1}",)


def test_a_name_is_what_it_says_whatever_string_it_is() -> None:
    index = {f"place {at}": at for at in range(101)}
    transitions: Any = tuple(Made(at) for at in range(100))
    inputs, outputs, *_ = _engine.flat(index, {}, transitions)
    assert list(memoryview(inputs[1]).cast("I")) == list(range(100))
    assert list(memoryview(outputs[1]).cast("I")) == list(range(1, 101))


def test_a_net_that_a_program_makes_of_lists_and_sets_is_the_same() -> None:
    loose: Any = (["p"], {"q"}, ["r"], [], [ExternalGate("s", wanted=False)])
    strict = Transition("t", ("p",), ("q",), ("r",), (), (ExternalGate("s", wanted=False),))
    index = {"p": 0, "q": 1, "r": 2}
    transitions: Any = [Transition("t", *loose)]
    assert _engine.flat(index, {"s": 0}, transitions) == _engine.flat(index, {"s": 0}, (strict,))


def test_a_name_without_an_index_is_no_place_and_no_signal() -> None:
    index = {"p": 0}
    with pytest.raises(KeyError, match="'q'"):
        _engine.flat(index, {}, (Transition("t", ("p",), ("q",)),))
    with pytest.raises(KeyError, match="'s'"):
        _engine.flat(index, {}, (Transition("t", ("p",), (), external=(ExternalGate("s"),)),))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (4 * [NOTHING], "5 parts"),
        ([(bytes(4), b""), NOTHING, NOTHING, NOTHING, NOTHING], "different numbers"),
        ([(b"\1\0\0\0", b""), *4 * [(bytes(4), b"")]], "shorter"),
        ([(b"\0\0\0\0", bytes(4)), *4 * [(bytes(4), b"")]], "longer"),
    ],
)
def test_parts_that_do_not_fit_each_other_are_refused(parts: list[tuple[bytes, bytes]], words: str) -> None:
    five: Any = tuple(parts)
    with pytest.raises(ValueError, match=words):
        _engine.explore(1, five, [], **LIMITS)
    with pytest.raises(ValueError, match=words):
        _engine.explore_symbolically(1, five, [], max_memory_bytes=1 << 20)


def test_a_place_out_of_range_is_refused_in_either_form() -> None:
    one, four = (b"\1\0\0\0", b"\7\0\0\0"), 4 * [(bytes(4), b"")]
    five: Any = (one, *four)
    with pytest.raises(ValueError, match="place 7"):
        _engine.explore(3, five, [], **LIMITS)
    with pytest.raises(ValueError, match="place 7"):
        _engine.explore_symbolically(3, five, [], max_memory_bytes=1 << 20)
