"""Timeouts that a promise keeps from firing: where a transition of a coordinator reads what the timeout changes.

While a controller has promised its part of a coordinated transition, what the part reads stays as it is (O1). A part
that *takes* the token of a timed place wants the completion 1 and the timeout wants it 0, so these never meet. One that
only reads does: while a decision is open, and for as long as the coordinator or the link is dead, the timeout cannot
take the token that the part wants there, put one on the fault place that it wants empty, nor clear a completion that it
reads, and a timer that it wants 0 is not set. Where the fault place stops a machine, the stop comes late. That is no
mistake of the split, and what is proved holds; whoever draws the line between controllers has to know of it.

Two that want tokens on two places of a controller that has one token never meet either: such a controller is a state
machine, of which every firing takes as many tokens as it gives (a place invariant with the weights 1).

Arcs are left out: two transitions of one machine that share a completion or a place hardly ever have their tokens at
the same time, and where they do, a coordinator decides them both. Cost: linear in the arcs and gates of the net.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator

from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, Severity
from firable.nets.net import Net, Transition


def blocked_timeouts(decomposition: Decomposition) -> Iterator[Diagnostic]:
    """Warnings of coordinated transitions beside which a timeout has to wait (F4015), in the order of the table."""
    net = decomposition.net
    timers = {net.transitions[t]: net.places[p].cleared[-1] for p, t in net.fault_transitions.items()}
    single = _with_one_token(net) if timers else frozenset()
    changing: dict[str, list[Transition]] = {}
    for timeout, timer in timers.items():
        for name in (*_changed(net, timeout), timer):
            changing.setdefault(name, []).append(timeout)
    for row in decomposition.coordinated if timers else ():
        transition = net.transition(row.name)
        gates = dict.fromkeys((*transition.permissive, *transition.inhibitive))
        gates |= dict.fromkeys(gate.signal for gate in transition.external)
        for timeout in dict.fromkeys(one for name in gates for one in changing.get(name, ())):
            needs, others, timer = _needs(transition), _needs(timeout), timers[timeout]
            if any(needs.get(name, value) != value for name, value in others.items() if name != timer):
                continue  # they never meet
            if _at_two_places(net, transition, timeout, single):
                continue
            common = [
                name for name in gates if timeout in changing.get(name, ()) and (name != timer or not needs[name])
            ]
            if common and timeout is not transition:
                yield _blocked(transition, timeout, common)


def _needs(transition: Transition) -> dict[str, bool]:
    """What a transition reads, and what it wants that to be."""
    needs = dict.fromkeys((*transition.inputs, *transition.permissive), True)
    needs |= dict.fromkeys((*transition.outputs, *transition.inhibitive), False)
    return needs | {gate.signal: gate.wanted for gate in transition.external}


def _with_one_token(net: Net) -> frozenset[str]:
    """The controllers whose places always have one token between them."""
    held = Counter(place.owner for place in net.places if place.marked)
    owners = {place.name: place.owner for place in net.places}
    moving = set[str | None]()
    for transition in net.transitions:
        taken, given = (Counter(owners[name] for name in some) for some in (transition.inputs, transition.outputs))
        moving |= {owner for owner in taken | given if taken[owner] != given[owner]}
    return frozenset(owner for owner, count in held.items() if owner is not None and count == 1 and owner not in moving)


def _at_two_places(net: Net, one: Transition, other: Transition, single: Collection[str]) -> bool:
    """Whether they want the one token of a controller on different places."""
    wanted, also = (
        {name for name, value in _needs(of).items() if value and name in net.place_index} for of in (one, other)
    )
    at = {net.place(name).owner: name for name in wanted}
    return any((owner := net.place(name).owner) in single and at.get(owner, name) != name for name in also)


def _changed(net: Net, timeout: Transition) -> frozenset[str]:
    """The places and signals that a firing changes."""
    cleared = (signal for place in timeout.outputs for signal in net.place(place).cleared)
    return frozenset((*timeout.inputs, *timeout.outputs, *cleared))


def _blocked(transition: Transition, timeout: Transition, common: list[str]) -> Diagnostic:
    told = " and ".join(f"'{name}'" for name in common)
    return Diagnostic(
        "F4015",
        f"'{timeout.name}' waits as long as '{transition.name}' is promised, which reads {told}",
        "read a place that no timeout moves, or leave a stop that must come in time to the machine's own controller",
        ("transitions", transition.name),
        severity=Severity.WARNING,
    )
