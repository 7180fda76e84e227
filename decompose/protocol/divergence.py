"""Which runs of the protocol go on for ever while nothing fires, and that there are no others.

A bisimulation that does not see divergence would call a protocol correct that is busy for ever. This one can be: a
coordinator may repeat a request or an order for ever, a controller a yes that stands, and a coordinator may ask, give
up, and ask again for ever, where parts never promise all together. That there is no other way is shown by weights on
the places, such that every other hidden step lowers the weighted sum of tokens: a run that goes on for ever without
these would lower it for ever. The argument is transition by transition: it needs no exploration, takes linear time, and
can be checked with a pencil.
"""

from __future__ import annotations

from typing import Final

from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.draft import OUTSIDE
from firable.decompose.protocol.rounds import asked, committed, decided

REPEATING: Final = frozenset({"request", "repeat", "order", "give-up"})
"""The kinds of steps of which every endless hidden run has infinitely many."""

WEIGHTS: Final = {
    "request": 4,
    "vote": 2,
    "heard": 1,
    "promised": 1,
    "commit-order": 4,
    "abort-order": 4,
    "acknowledgement": 2,
    "noted": 1,
    "obeyed": 1,
}
"""The weights of the places of a part."""
OF_FREE: Final = WEIGHTS | {"stands": -3, "commit-order": 7}
"""Those of a part that is free of promise: a yes that stands weighs less than none, and an order makes up for it."""


def weights(protocol: ProtocolNet) -> dict[str, int]:
    """The weight of each place that has one; a round that is open weighs less than one that is not."""
    found = {}
    for t, its in protocol.parts.coordinated.items():
        found[asked(t)], found[committed(t)], found[decided(protocol.parts, t)] = -1, 1, 1
        for part in its:
            of = OF_FREE if part.free else WEIGHTS
            found.update({f"{kind}/{t}/{part.controller}": weight for kind, weight in of.items()})
    return found


def not_falling(protocol: ProtocolNet) -> tuple[str, ...]:
    """The hidden steps, other than those that repeat, that do not lower the weighted sum of tokens.

    None of them: then every run in which nothing fires, no fault happens, and nothing is repeated or given up any more,
    ends.
    """
    weight = weights(protocol)
    found = []
    for t in protocol.net.transitions:
        step = protocol.steps[t.name]
        if step.fires or step.kind in REPEATING | OUTSIDE:
            continue
        change = sum(weight.get(place, 0) for place in t.outputs) - sum(weight.get(place, 0) for place in t.inputs)
        if change >= 0:
            found.append(t.name)
    return tuple(found)
