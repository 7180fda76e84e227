"""Who decides: the coordinators of a net, their names as machines, and rounds that bear the name of one of them.

In a net with layers each coordinator that decides something is a machine of its own, and the controllers talk to it
directly: the vote of a layer is the AND of those below it, and an AND does not care through whose hands it passes. So a
cell goes on while the line is down, and what the line decides at a cell goes on while the cell's coordinator is.

A coordinator knows nothing of what the others have open, and need not: parts that could be promised to two of them do
not disturb each other (`firable.nets.contention`). But their rounds meet in the memory of a controller, so no two may
bear one name. The number of a round is that name: of n coordinators the first one numbers 0, n, 2n, the next one 1,
n + 1, 2n + 1. Rejected: pairs of a coordinator and a number. They say the same, and every message, every key of a
journal and every line of a trace that names a round would have to hold both.

The coordinator at the top has the empty name, which no controller has; it is there though it may decide nothing. One
below has that of its controller behind the word "coordinator": a blank is in no name of a net.
"""

from __future__ import annotations

from typing import Final

from firable.nets.decomposition import Decomposition
from firable.nets.layers import Layers

TOP: Final = ""
"""The machine of the coordinator at the top, which in one layer decides everything."""


def coordinator_at(at: str | None) -> str:
    """The machine of a coordinator, as rows and groups of a decomposition name it.

    >>> coordinator_at(None), coordinator_at("cell_a")
    ('', 'coordinator cell_a')
    """
    return TOP if at is None else f"coordinator {at}"


def controller_of(coordinator: str) -> str | None:
    """The controller whose name a coordinator bears; None of the one at the top.

    >>> controller_of(TOP), controller_of("coordinator cell_a")
    (None, 'cell_a')
    """
    return coordinator.partition(" ")[2] or None


def closed_key(coordinator: str) -> str:
    """The key in stable storage of what a controller knows to be closed of a coordinator's rounds.

    >>> closed_key(TOP), closed_key("coordinator cell_a")
    ('closed', 'closed/coordinator cell_a')
    """
    return f"closed/{coordinator}" if coordinator else "closed"


def coordinators(decomposition: Decomposition) -> tuple[str, ...]:
    """The machines of all coordinators, the one at the top first, then those that decide something, downwards."""
    deciding = {row.at for row in decomposition.coordinated}
    return (TOP, *(coordinator_at(name) for name in Layers(decomposition.net).coordinators() if name in deciding))
