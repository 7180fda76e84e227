"""Ownership: every place and signal is in one subnet, that of its owner, and every transition of a subnet is a part.

What two controllers owned would have two tokens, and what a subnet held as a copy could be older than the thing itself
(O3). So who owns what, which controllers there are, and that a part belongs to one transition, are facts that the
subnets and the net must agree on.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

from firable.decompose.proofs.obligation import Obligation, called, facts, repeated
from firable.decompose.proofs.sides import Sides
from firable.nets.net import Controller, Net, Place, Signal


def ownership(sides: Sides) -> Iterator[Obligation]:
    """The one obligation on who owns what."""
    net = sides.net
    central = [f"controller {_json(c)}" for c in net.controllers]
    central += [f"{c.name} has one subnet, without arbiters" for c in net.controllers]
    central += [f"{called(item.owner)} owns {item.name}" for item in _owned(net)]
    made = [f"controller {_json(c)}" for subnet in sides.subnets for c in subnet.controllers]
    of_the_net = {part for t in net.transitions for part in sides.parts[t.name]}
    for subnet in sides.subnets:
        made.append(f"{subnet.name} has {'other subnets' if subnet.arbiters else 'one subnet, without arbiters'}")
        made += [f"{subnet.name} owns {item.name}" for item in _owned(subnet)]
        made += [
            f"{called(item.owner)} owns {item.name} in the subnet of {subnet.name}"
            for item in _owned(subnet)
            if item.owner != subnet.name
        ]
        made += [
            f"{t.name} of {subnet.name} is a part of nothing"
            for t in subnet.transitions
            if (subnet.name, t.name) not in of_the_net
        ]
    every = [part for parts in sides.parts.values() for part in parts]
    made += [f"{part} of {controller} is a part twice" for controller, part in repeated(every)]
    statement = "each place and signal is owned once, in the subnet of its owner, and nothing else is in a subnet"
    yield facts("ownership", statement, central, made)


def _owned(net: Net) -> tuple[Place | Signal, ...]:
    return (*net.places, *net.signals)


def _json(of: Controller) -> str:
    return json.dumps([of.name, of.coordinator], ensure_ascii=True)
