"""What a proof of the decomposition assumes of the cell: external gates that nobody can lock (O4).

What the coordinator decides is decided from votes taken at different instants, and fires later still. A promise holds
the places of a part as they are, and completion signals and timers too: only sending their command clears them, and a
controller that has promised sends none of these. A sensor it cannot hold. Eq. (8) of the whole then says "each gate was
true at its own vote", which is Eq. (8) of one instant only if the gate stays open until the transition fires. So for
each sensor, and for each gate that wants a signal to be 0, which a machine may end at any time, the assumption is
named, for a person to check on the cell. Where it may fail, the interlock belongs to the machine's own controller.

That holds of a local transition too if it is in the conflict component of a global one (O2): it is decided by the
coordinator, from a vote of its one part, and fires when the order comes. Only a local transition that its own
controller fires reads its gates and fires in one act, and assumes nothing; and so does one that wants a signal both 1
and 0, for which nobody ever votes. Rejected: to ask of the coordinator table alone, which names the global transitions
only.
"""

from __future__ import annotations

from dataclasses import dataclass

from firable.nets.decomposition import Decomposition
from firable.nets.net import SignalKind


@dataclass(frozen=True, slots=True)
class Assumption:
    """Once a gate of a coordinated transition is open at the vote of its owner, it stays open until that one fires."""

    transition: str
    signal: str
    wanted: bool

    def __str__(self) -> str:
        value = int(self.wanted)
        return f"'{self.signal}' stays {value} from the vote for '{self.transition}' until it fires"


def assumptions(decomposition: Decomposition) -> tuple[Assumption, ...]:
    """The assumptions O4 of a decomposition, in the order of the coordinated transitions."""
    net = decomposition.net
    return tuple(
        Assumption(row.name, gate.signal, gate.wanted)
        for row in decomposition.coordinated
        if net.transition(row.name).openable
        for gate in net.transition(row.name).external
        if not gate.wanted or net.signal(gate.signal).kind is SignalKind.SENSOR
    )
