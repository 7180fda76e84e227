"""What the questions to a loop are made of: each condition of theirs decides the answer in some cell."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support.bench_cell import bench

from firable.analysis.loop.verdicts import check_loop
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.formula import parse_formula
from firable.nets.net import ExternalGate, Property, PropertyKind, Signal, TemporalProperty, Transition
from firable.nets.temporal import Logic, parse_temporal
from firable.nets.text import parse_net
from firable.nets.verdict import Status

STARTING = """\
firable: 1
cell: starting
controllers:
  c:
    start: [cold, a]
    inputs: [entry, hand]
    places:
      seen:
      cold:
      warm:
      a:
      clamp: {send: {machine: R, command: MOVE, to: TABLE}, until: at_table}
transitions:
  t: {from: c.a, to: c.clamp}
  t2: {from: c.clamp, to: c.a}
"""


def test_a_transition_fires_by_whichever_variant() -> None:
    net = catalogue_net("one_robot_timed")
    says = {
        t.name: TemporalProperty(t.name, Logic.LTL, parse_temporal(f"G not fires({t.name})")) for t in net.transitions
    }
    report = check_loop(replace(net, properties=tuple(says.values())), catalogue_plant("one_robot_timed"))
    assert {name for name in says if report.verdict(f"loop.property.{name}").status is not Status.VIOLATED} == set()


def test_what_holds_more_tokens_than_at_the_start_is_not_the_start() -> None:
    net = parse_net(STARTING)
    sees = Transition("sees", ("c.cold",), ("c.warm", "c.seen"))
    back = Transition("back", ("c.warm",), ("c.cold",))
    start = Property("restart", PropertyKind.ALWAYS_POSSIBLE, parse_formula("start"))
    net = replace(net, transitions=(sees, back, *net.transitions), properties=(start,))
    assert check_loop(net, bench()).verdict("loop.property.restart").status is Status.VIOLATED
    forgets = Transition("forgets", ("c.seen",), ())
    net = replace(net, transitions=(*net.transitions, forgets))
    assert check_loop(net, bench()).verdict("loop.property.restart").holds


@pytest.mark.parametrize(
    ("arcs", "expected"),
    [
        ({}, Status.VIOLATED),
        ({"permissive": ("c.warm",)}, Status.PROVED),
        ({"inhibitive": ("c.a",)}, Status.PROVED),
        ({"outputs": ("c.a",)}, Status.PROVED),
    ],
)
def test_a_gate_that_stays_closed_is_no_matter_of_a_transition_that_waits_for_places_too(
    arcs: dict[str, Any], expected: Status
) -> None:
    net = parse_net(STARTING)
    closed = replace(Transition("closed", ("c.cold",)), external=(ExternalGate("c.never"),), **arcs)
    net = replace(net, transitions=(*net.transitions, closed), signals=(*net.signals, Signal("c.never", "c")))
    plant = bench(judged="  c.never: {occupied: exit}\n")
    assert check_loop(net, plant).verdict("loop.gates-open").status is expected
