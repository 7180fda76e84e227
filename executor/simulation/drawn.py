"""Random nets in which everything has an owner, for the split and the protocol: small, with every kind of gate.

A cell of the catalogue shows what somebody has built; these show what else the text of a net allows: competing
transitions of several controllers, gates on places of others, commands that share a completion, sensors wanted both
ways; with time limits, or in layers. The seed of a net names it for ever, so that a run on it is one command; it is
therefore no test's affair alone.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from firable.executor.simulation.machinery import reached
from firable.nets.net import (
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
from firable.nets.time_limits import fault_place, fault_transition, fault_transition_name, timer_name

Arcs = tuple[tuple[str, ...], tuple[str, ...]]


def owned_net(seed: int) -> Net:
    """The net of `drawn_net` that is drawn from a seed."""
    return drawn_net(random.Random(seed), f"random-{seed}")


def timed_net(seed: int) -> Net:
    """The first net that `drawn_timed_net` draws from a seed in which a place with a time limit can be marked."""
    draw = random.Random(seed)
    while not _is_timed_anywhere(net := drawn_timed_net(draw, f"timed-{seed}")):
        pass
    return net


def _is_timed_anywhere(net: Net) -> bool:
    """Whether a place with a time limit can be marked, external gates free."""
    limited = net.marking(place.name for place in net.places if place.within is not None)
    return any(marking & limited for marking in reached(net) or ())


def layered_net(seed: int) -> Net:
    """The net of a seed with its controllers in layers, each but the first under the one before it."""
    net = owned_net(seed)
    under = dict(zip((c.name for c in net.controllers[1:]), (c.name for c in net.controllers), strict=False))
    controllers = tuple(replace(c, under=under.get(c.name)) for c in net.controllers)
    return replace(net, name=f"layered-{seed}", controllers=controllers)


DRAWN: Final[Mapping[str, Callable[[int], Net]]] = MappingProxyType(
    {"drawn": owned_net, "drawn-timed": timed_net, "drawn-layered": layered_net}
)
"""The families of drawn nets, by what they are called where a net is named."""


def drawn_timed_net(draw: random.Random, title: str) -> Net:
    """A drawn net with time limits at all places that wait for a completion.

    Most of their fault places have a way back, or to another place of their controller.
    """
    net = drawn_net(draw, title)
    names = [place.name for place in net.places if place.completion is not None]
    timed = with_limits(net, names, draw.choice([100, 1000, 5000]))
    back = []
    for name in names:
        if draw.random() < 0.8:
            own = [place.name for place in net.places if place.owner == net.place(name).owner]
            back.append(Transition(f"back-{name}", (f"{name}_fault",), (draw.choice([name, name, *own]),)))
    return replace(timed, transitions=(*timed.transitions, *back))


def with_limits(net: Net, names: Iterable[str], milliseconds: int = 5000) -> Net:
    """The net in which the completions of these places have a time limit each, as `within` makes it."""
    limits = {name: TimeLimit(milliseconds, timer_name(name)) for name in names}
    places: list[Place] = []
    timers: list[Signal] = []
    faults: list[Transition] = []
    for place in net.places:
        places.append(replace(place, within=limits.get(place.name)))
        if place.name in limits:
            to = fault_place(places[-1])
            timers.append(Signal(timer_name(place.name), place.owner, SignalKind.TIMER))
            faults.append(fault_transition(places[-1], to.name, fault_transition_name(place.name)))
            places.append(to)
    signals, transitions = (*net.signals, *timers), (*net.transitions, *faults)
    return replace(net, places=tuple(places), signals=signals, transitions=transitions)


def drawn_net(draw: random.Random, title: str) -> Net:
    """A net of two or three controllers, with local and global transitions.

    It is marked so that its first transition can fire unless a gate keeps it, and no gate waits for the completion of a
    command that was never sent.
    """
    owners = ["a", "b", "c"][: draw.randint(2, 3)]
    names = [f"{draw.choice(owners)}.p{i}" for i in range(draw.randint(4, 8))]
    arcs = _arcs(draw, owners, names)
    filled = {name for inputs, _ in arcs for name in inputs if draw.random() < 0.6} | set(arcs[0][0])
    filled -= {name for _, outputs in arcs[::2] for name in outputs if draw.random() < 0.7} | set(arcs[0][1])

    signals: dict[str, Signal] = {}
    places = {}
    for name in names:
        owner, command, completion = name[0], None, None
        if draw.random() < 0.5:
            command = Command(owner.upper(), f"C{name[2:]}")
            if name not in filled and draw.random() < 0.6:
                completion = f"{owner}.done{draw.randint(1, 2)}"
                signals[completion] = Signal(completion, owner, SignalKind.COMPLETION)
        places[name] = Place(name, owner, name in filled, command, completion)
    for i in range(draw.randint(0, 2)):
        owner = draw.choice(owners)
        signals[f"{owner}.s{i}"] = Signal(f"{owner}.s{i}", owner)

    def transition(i: int, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Transition:
        others = [name for name in names if name not in inputs + outputs]
        gates = draw.sample(others, min(len(others), draw.choice([0, 0, 1, 2])))
        permissive = tuple(gate for gate in gates if draw.random() < 0.2)
        wanted = {done: True for name in inputs if (done := places[name].completion)}
        if signals and draw.random() < 0.3:
            wanted.setdefault(draw.choice(list(signals)), draw.random() < 0.5)
        inhibitive = tuple(gate for gate in gates if gate not in permissive)
        external = tuple(ExternalGate(signal, value) for signal, value in wanted.items())
        return Transition(f"t{i}", inputs, outputs, permissive, inhibitive, external)

    return Net(
        title,
        tuple(places.values()),
        tuple(transition(i, *both) for i, both in enumerate(arcs)),
        tuple(signals.values()),
        tuple(Controller(owner) for owner in owners),
    )


def _arcs(draw: random.Random, owners: list[str], names: list[str]) -> list[Arcs]:
    """Inputs and outputs of some transitions, most with a way back, so that the net goes on."""
    arcs: list[Arcs] = []
    for _ in range(draw.randint(2, 5)):
        owner = draw.choice(owners)
        own = [name for name in names if name.startswith(owner)]
        pool = own if len(own) > 1 and draw.random() < 0.4 else names
        joined = draw.sample(pool, draw.randint(2, min(4, len(pool))))
        cut = draw.randint(1, len(joined) - 1)
        arcs.append((tuple(joined[:cut]), tuple(joined[cut:])))
        if draw.random() < 0.7:
            arcs.append((arcs[-1][1], arcs[-1][0]))
    return arcs
