"""A moment of a net, told to the page: its tokens and signals, and of each transition whether it may fire, or what it
waits for.

The server remembers nothing between two requests: the page says at which marking and valuation it is, and keeps the
moments that it came from. So undo is going back to one, and two windows do not disturb each other. What may fire is
asked of the reference player (`firable.semantics.player`), once for each request, which for some hundred transitions
takes milliseconds; why a transition may not is told in the words of a run (`Blocked`).

Gates are *free* as the analysis has them, or as the switches say. A firing clears the completion signals and timers of
the places entered, as the token player of the executor does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from firable.cli.story import waits_told
from firable.cli.view.site import refusal
from firable.executor.operating.situation import Blocked
from firable.nets.drawing.part import everybody, owners_of
from firable.nets.net import Marking, Net
from firable.semantics.player import Player
from firable.semantics.waiting import circle


@dataclass(frozen=True)
class Moment:
    """A marking, the signals that are 1, and whether gates are free."""

    marking: Marking
    signals: frozenset[str] = frozenset()
    free: bool = False

    def valuation(self) -> Mapping[str, bool]:
        """The signals as the player reads them."""
        return dict.fromkeys(self.signals, True)


def moment_of(net: Net, asked: Mapping[str, Any]) -> Moment:
    """The moment that a request names; raises `InputError` F5070 where it names what the net has not."""
    match asked:
        case {"marking": list(marking), "signals": list(signals), "free": bool(free)} if _known(
            marking, net.place_index
        ) and _known(signals, net.signal_index):
            return Moment(net.marking(marking), frozenset(signals), free)
    raise refusal("the page speaks of a marking that the net cannot have")


def begin(net: Net, *, free: bool = False) -> Moment:
    """M0, with all signals 0."""
    return Moment(net.initial_marking, free=free)


def told(player: Player, now: Moment) -> dict[str, Any]:
    """A moment as the page shows it; in a deadlock also who waits for whom."""
    net = player.net
    firable = frozenset(player.may_fire(now.marking))
    enabled = firable if now.free else firable & frozenset(player.enabled(now.marking, now.valuation()))
    return {
        "marking": list(net.names(now.marking)),
        "signals": sorted(now.signals, key=net.signal_index.__getitem__),
        "free": now.free,
        "transitions": {
            transition.name: {"may": "fire"}
            if t in enabled
            else {"may": "wait" if t in firable else "not", **waits(net, t, now)}
            for t, transition in enumerate(net.transitions)
        },
        "deadlock": not firable,
        **({} if firable else {"circle": list(waits_told(net, circle(net, now.marking)))}),
    }


def fired(player: Player, now: Moment, name: str) -> tuple[Moment, dict[str, Any]]:
    """The moment after a transition has fired, and what that did; raises `InputError` F5070 where it may not fire."""
    net = player.net
    t = net.transition_index.get(name)
    may_fire = player.may_fire(now.marking) if now.free else player.enabled(now.marking, now.valuation())
    if t is None or t not in may_fire:
        raise refusal(f"'{name}' cannot fire now")
    marking = player.fire(now.marking, (t,))
    came = net.names(marking & ~now.marking)
    cleared = frozenset(signal for place in came for signal in net.place(place).cleared)
    sent = [str(command) for place in came if (command := net.place(place).command) is not None]
    return Moment(marking, now.signals - cleared, now.free), {"fired": [name], "sent": sent}


def waits(net: Net, t: int, now: Moment) -> dict[str, Any]:
    """What a transition that may not fire waits for: names for the picture, and a sentence."""
    masks, transition = net.masks[t], net.transitions[t]
    if not transition.openable:
        return {"why": f"{transition.name} can never fire: it wants one signal both 1 and 0"}
    if loops := transition.self_loops:
        return {"why": f"{transition.name} can never fire: {loops[0]} is both its input and its output"}
    empty = net.names((masks.inputs | masks.permissive) & ~now.marking)
    full = net.names((masks.outputs | masks.inhibitive) & now.marking)
    closed = tuple(
        (gate.signal, gate.wanted)
        for gate in transition.external
        if not now.free and (gate.signal in now.signals) != gate.wanted
    )
    return {
        "empty": list(empty),
        "full": list(full),
        "closed": [signal for signal, _ in closed],
        "near": bool(masks.inputs & now.marking),
        "why": str(Blocked(transition.name, empty, full, closed)),
    }


def _known(names: list[Any], index: Mapping[str, int]) -> bool:
    return all(isinstance(name, str) and name in index for name in names)


def structure(net: Net) -> dict[str, Any]:
    """What the page has to know of a net beside its picture: names, words and owners, and no rule."""
    owners, taking = owners_of(net), everybody(net)
    return {
        "name": net.name,
        "description": net.description,
        "controllers": [controller.name for controller in net.controllers],
        "places": [
            {
                "name": place.name,
                "says": place.description,
                "owner": place.owner,
                "machine": None if place.command is None else place.command.machine,
                "command": None if place.command is None else str(place.command),
                "completion": place.completion,
            }
            for place in net.places
        ],
        "transitions": [
            {"name": t.name, "says": t.description, "owners": [owner for owner in owners if owner in taking[t.name]]}
            for t in net.transitions
        ],
        "signals": [
            {
                "name": signal.name,
                "owner": signal.owner,
                "kind": signal.kind.value,
                "gates": [t.name for t in net.transitions for gate in t.external if gate.signal == signal.name],
            }
            for signal in net.signals
        ],
    }
