"""Machines of the cells explored alone, to their end, each held to the proof of the protocol and to the protocol net.

    python tests/explore_cells.py [CELL ...]

What may happen to a machine is said in `executor/simulation/alone.py` and `deciding.py`, and what is not told apart in
`likeness.py`. Every act is held to the actions of the parametric proof (`support/local_tie.py`), and those of
controllers to firings of the protocol net (`support/local_net_tie.py`); where a controller knows two rounds of one
group, the net says nothing, and the acts are counted in the line of the machine.

`ENDS` names what is known to end. Each of these must end within its bound; else, or where an act is none of the
proof's, the exit status is 1. All other machines of the cells are named and not explored: nothing is claimed of them.

It is no test of the suite, as it takes some minutes on one processor; the quick ones are (`test_alone.py`).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from support.free_parts import freed
from support.local_net_tie import LocalNetTie
from support.standing_votes import AloneTie

from firable.decompose.protocol.building import protocol_net
from firable.decompose.splitting.cut import split
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import ProtocolError
from firable.executor.simulation.alone import Alone, OneMachine
from firable.executor.simulation.deciding import Deciding
from firable.executor.simulation.exploring import Explorer, explore
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.executor.simulation.surroundings import Reach
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition

CELLS = ("one_robot", "two_robots_shared", "two_robots_separate", "two_cells")


class End(NamedTuple):
    """A machine that is known to end, with parts free of promise as bundles have them."""

    cell: str
    machine: str
    """The name of a controller, or of a coordinator and the transitions of one of its groups."""
    configurations_max: int
    restarts: bool = True
    """Whether it restarts as often as it likes."""


ENDS = (
    End("one_robot", "system", 1000),
    End("one_robot", "robot", 2000),
    End("one_robot", "mc", 4000),
    End("two_cells", "line", 100),
    End("two_cells", "cell_a", 200),
    End("two_robots_shared", "system", 2000),
    End("one_robot", "coordinator: G1", 400),
    End("one_robot", "coordinator: G3", 400),
    End("one_robot", "coordinator: G7", 400),
    End("one_robot", "coordinator: G9", 400),
    End("two_cells", "conveyors", 4000, restarts=False),
    End("one_robot", "conveyor", 25_000),
)


def machines(decomposition: Decomposition) -> Iterator[tuple[str, Callable[[], OneMachine]]]:
    """Each controller, and each coordinator for each of its groups."""
    for subnet in decomposition.subnets:
        yield subnet.name, partial(Alone, decomposition, subnet.name, Reach())
    for name in coordinators(decomposition):
        for group, names in enumerate(Coordinator(decomposition, name).groups):
            yield f"{name or 'coordinator'}: {' '.join(names)}", partial(Deciding, decomposition, name, group)


def explored(decomposition: Decomposition, machine: Callable[[], OneMachine], end: End) -> tuple[str, bool]:
    """What to say of a machine after its exploration, and whether it is as it has to be."""
    tie, net_tie = AloneTie(decomposition), LocalNetTie(protocol_net(decomposition))

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        net_tie(explorer, at, step, after)

    begun, budget = time.process_time(), Budget(crashes=int(end.restarts))
    try:
        space = explore(machine(), budget, max_configurations=end.configurations_max, watch=watch)
    except (AssertionError, ProtocolError) as failed:
        return f"NOT WHAT WAS PROVED: {failed}", False
    words = f"{space.configurations} configurations, {space.steps} acts, {'all' if space.complete else 'NOT ALL'}"
    words += f", {net_tie.untold} of two rounds of a group, held to the actions alone" if net_tie.untold else ""
    return f"{words}, {time.process_time() - begun:.0f} s", space.complete


def main(cells: list[str]) -> int:
    """Explore what is known to end of these cells, or of all, and name the rest."""
    of = {cell: freed(split(catalogue_net(cell))) for cell in cells or CELLS}
    known = {(cell, name): machine for cell, parts in of.items() for name, machine in machines(parts)}
    status, here = 0, [end for end in ENDS if end.cell in of]
    for end in here:
        words, is_well = explored(of[end.cell], known[end.cell, end.machine], end)
        restarts = "any restarts" if end.restarts else "no restart of its own"
        sys.stdout.write(f"{end.cell} {end.machine}, {restarts}: {words}\n")
        sys.stdout.flush()
        status |= not is_well
    for cell, name in known:
        if all((cell, name) != (end.cell, end.machine) for end in here):
            sys.stdout.write(f"{cell} {name}: not explored to its end\n")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
