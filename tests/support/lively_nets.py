"""Nets in which almost every transition fires, at odds with others: the most telling ones for orders of firing.

A net drawn arc by arc is mostly dead, and rings of steps touch each other in few places; neither notices a search that
leaves out an order which mattered. Here each transition is drawn firable at some reachable marking: its inputs and
permissive gates among the full places there, its outputs and inhibitive gates among the empty ones. So places are
shared by many in all four ways, and hundreds of markings are reached.

`lively_net` is for searches over seeds, thousands of nets in a few seconds, which is what it takes to meet a rare
fault; `lively_nets` is for properties, whose failures are shrunk.
"""

from __future__ import annotations

import random

from hypothesis import strategies as st

from firable.nets.formula import And, Formula, Holds, Not
from firable.nets.net import Marking, Net, Place, Transition

_GATES = 0.5
_FIRED = 0.6
_STARTED_ANEW = 0.3


def lively_nets(most_places: int = 9) -> st.SearchStrategy[Net]:
    """The nets of `lively_net` of at most so many places, with every choice left to hypothesis."""
    return st.randoms(use_true_random=False).map(lambda draw: lively_net(draw, most_places))


def lively_net(draw: random.Random, most_places: int = 12) -> Net:
    """From two thirds of `most_places` to all of them, half as many transitions to as many; half the places marked."""
    names = [f"p{i}" for i in range(draw.randint(2 * most_places // 3, most_places))]
    start = {place for place in names if draw.random() < 0.5}
    marking, transitions = start, []
    for _ in range(draw.randint(most_places // 2, most_places)):
        full = [place for place in names if place in marking]
        empty = [place for place in names if place not in marking]
        inputs, outputs = _some(draw, full), _some(draw, empty)
        permissive, inhibitive = (_gate(draw, among) for among in (full, empty))
        transitions.append((inputs, outputs, permissive, inhibitive))
        if draw.random() < _FIRED:
            marking = (marking - set(inputs)) | set(outputs)
        if draw.random() < _STARTED_ANEW:
            marking = start
    draw.shuffle(transitions)
    return Net(
        "lively",
        tuple(Place(name, marked=name in start) for name in names),
        tuple(Transition(f"t{i}", *parts) for i, parts in enumerate(transitions)),
    )


def _some(draw: random.Random, among: list[str]) -> tuple[str, ...]:
    return tuple(draw.sample(among, min(len(among), draw.choices((0, 1, 2), (1, 6, 2))[0])))


def _gate(draw: random.Random, among: list[str]) -> tuple[str, ...]:
    return (draw.choice(among),) if among and draw.random() < _GATES else ()


def part_of(draw: random.Random, net: Net, marking: Marking, count: int = 3) -> Formula:
    """A goal that is easily missed: a few places as they are in this marking."""
    some = draw.sample(range(len(net.places)), min(count, len(net.places)))
    literals = (Holds(net.places[p].name) if marking >> p & 1 else Not(Holds(net.places[p].name)) for p in some)
    return And(tuple(literals))
