"""What a proof of the decomposition assumes of the cell: external gates that nobody can lock (O4).

A global transition is decided from votes taken at different instants. A promise holds the places of a part as they are,
and the completion signals too: only sending their command clears them, and a controller that has promised sends none
of these. A sensor it cannot hold. Eq. (8) of the whole then says "each gate was true at its own vote", which is Eq. (8)
of one instant only if the gate stays open until the transition fires. So for each sensor, and for each gate that wants
a signal to be 0, which a machine may end at any time, the assumption is named, for a person to check on the cell. Where
it may fail, the interlock belongs to the machine's own controller.

A local transition reads its gates and fires in one act, so it assumes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

from firable.nets.decomposition import Decomposition
from firable.nets.net import SignalKind


@dataclass(frozen=True, slots=True)
class Assumption:
    """Once the gate of a global transition is open at its owner's vote, it stays open until the transition fires."""

    transition: str
    signal: str
    wanted: bool

    def __str__(self) -> str:
        value = int(self.wanted)
        return f"'{self.signal}' stays {value} from the vote for '{self.transition}' until it fires"


def assumptions(decomposition: Decomposition) -> tuple[Assumption, ...]:
    """The assumptions O4 of a decomposition, in the order of the coordinator table."""
    net = decomposition.net
    return tuple(
        Assumption(row.name, gate.signal, gate.wanted)
        for row in decomposition.table
        for gate in net.transition(row.name).external
        if not gate.wanted or net.signal(gate.signal).kind is SignalKind.SENSOR
    )
