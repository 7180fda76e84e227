"""O3: what a transition takes, fills and reads is taken, filled and read by the part of its owner, and by no other.

A gate whose source is elsewhere makes its owner a participant: the owner votes, and while it has promised the place
stays as it is. A cached copy would be as old as its last message. Eq. (7) does not see this alone: a gate that repeats
what an arc says anyway may stand with the wrong controller, or with none, and change no value. So for each transition
every arc, gate and literal is a fact, with the controller at which it stands; who takes part is one, too, since a
participant without any would wait for a vote that nobody gives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from firable.decompose.proofs.obligation import Obligation, called, facts
from firable.decompose.proofs.sides import Sides
from firable.nets.net import Net, Transition


def reading(sides: Sides) -> Iterator[Obligation]:
    """O3 for each transition."""
    net = sides.net
    for transition in net.transitions:
        name = transition.name
        central = list(_touches(transition, _owner_in(net)))
        central += [f"{controller} takes part" for controller in dict.fromkeys(_owners(net, transition))]
        made: list[str] = []
        for key in sides.parts[name]:
            controller, part = key
            if (found := sides.part(key)) is None:
                made.append(f"{controller} has no {part}")
                continue
            subnet, t = found
            made.append(f"{controller} takes part")
            made += _touches(subnet.transitions[t], partial(_at, controller))
        statement = f"what '{name}' takes, fills and reads, its owner's part takes, fills and reads, and no other"
        yield facts(f"o3.{name}", statement, central, made, subjects=(name,))


def _touches(transition: Transition, owner: Callable[[str], str | None]) -> Iterator[str]:
    """Every arc, gate and literal of a transition, each with the controller at which it stands."""
    words = {"inputs": "takes", "outputs": "fills", "permissive": "wants", "inhibitive": "wants not"}
    for kind, word in words.items():
        places: tuple[str, ...] = getattr(transition, kind)
        yield from (f"{called(owner(place))} {word} {place}" for place in places)
    for gate in transition.external:
        yield f"{called(owner(gate.signal))} waits until {gate.signal} is {int(gate.wanted)}"


def _owner_in(net: Net) -> Callable[[str], str | None]:
    return lambda name: (net.place(name) if name in net.place_index else net.signal(name)).owner


def _at(controller: str, _name: str) -> str:
    return controller


def _owners(net: Net, transition: Transition) -> Iterator[str]:
    """The owner of everything that a transition touches."""
    places = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
    owner = _owner_in(net)
    yield from (called(owner(name)) for name in (*places, *(gate.signal for gate in transition.external)))
