"""The commands of the subnets are those of the net: what is sent on which place, and which signal ends it.

A command goes to a machine when its place goes from 0 to 1 by a local apply (O7), so that the subnet alone decides what
is sent. That it is sent after the apply, and not when the vote was given, is a matter of the protocol.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

from firable.decompose.proofs.obligation import Obligation, facts
from firable.decompose.proofs.sides import Sides
from firable.nets.net import Net


def commands(sides: Sides) -> Iterator[Obligation]:
    """The one obligation on commands and completions."""
    statement = "the subnets send the same commands on the same places, and wait for the same signals"
    made = [fact for subnet in sides.subnets for fact in _of(subnet)]
    yield facts("commands", statement, _of(sides.net), made)


def _of(net: Net) -> Iterator[str]:
    for place in net.places:
        if place.command is not None:
            sent = [place.command.machine, place.command.command, *map(list, place.command.parameters)]
            yield f"{place.name} sends {json.dumps(sent, ensure_ascii=True)}"
        if place.completion is not None:
            yield f"{place.name} waits until {place.completion}"
        if place.within is not None:
            yield f"{place.name} waits {place.within.milliseconds} ms, which {place.within.timer} tells"
    for signal in net.signals:
        yield f"{signal.name} is a {signal.kind.value}"
