"""Time limits put on the places of a net, with the names that `within` gives; and drawn nets that have some."""

import random
from collections.abc import Iterable
from dataclasses import replace

from hypothesis import strategies as st

from firable.executor.simulation.drawn import drawn_net
from firable.nets.net import Net, Place, Signal, SignalKind, TimeLimit, Transition
from firable.nets.time_limits import fault_place, fault_transition, fault_transition_name, timer_name


def with_limits(net: Net, names: Iterable[str], milliseconds: int = 5000) -> Net:
    """The net in which the completions of these places have a time limit each, as `within` makes it."""
    limited = {name: TimeLimit(milliseconds, timer_name(name)) for name in names}
    places: list[Place] = []
    timers: list[Signal] = []
    faults: list[Transition] = []
    for place in net.places:
        places.append(replace(place, within=limited.get(place.name)))
        if place.name in limited:
            to = fault_place(places[-1])
            timers.append(Signal(timer_name(place.name), place.owner, SignalKind.TIMER))
            faults.append(fault_transition(places[-1], to.name, fault_transition_name(place.name)))
            places.append(to)
    return replace(
        net,
        places=tuple(places),
        signals=(*net.signals, *timers),
        transitions=(*net.transitions, *faults),
    )


def waiting(net: Net) -> list[str]:
    """The places that wait for a completion."""
    return [place.name for place in net.places if place.completion is not None]


def timed_nets() -> st.SearchStrategy[Net]:
    """Owned nets in which each place that waits for a completion has a time limit, and a way back from its fault place.

    Those without such a place are among them.
    """
    return st.randoms(use_true_random=False).map(drawn_timed_net)


def drawn_timed_net(draw: random.Random) -> Net:
    """An owned net with time limits, each fault place with a way back or to another place of its controller."""
    net = drawn_net(draw, "timed")
    names = waiting(net)
    timed = with_limits(net, names)
    back = []
    for name in names:
        if draw.random() < 0.8:
            own = [place.name for place in net.places if place.owner == net.place(name).owner]
            back.append(Transition(f"back-{name}", (f"{name}_fault",), (draw.choice([name, name, *own]),)))
    return replace(timed, transitions=(*timed.transitions, *back))
