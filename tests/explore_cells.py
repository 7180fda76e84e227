"""The machines of the cells explored alone, each held to the proof of the protocol and to the protocol net.

    python tests/explore_cells.py [CELL ...]

Every controller and, group by group, every coordinator of the cells of the catalogue, with parts free of promise as
bundles have them and without; what may happen to them is said in `executor/simulation/alone.py` and `deciding.py`, and
what is not told apart, which of a controller is all that coordinators have closed, in `likeness.py`. Every act is held
to the actions of the parametric proof (`support/local_tie.py`), and those of controllers to firings of the protocol net
(`support/local_net_tie.py`). Each machine is explored with any number of restarts of its own, where that ends within
`MOST` configurations, else without; a line says how many configurations and acts there were, and whether that was all
of them. The exit status is 1 where a machine does something else than was proved, or does not end though it has to.

It is no test of the suite, as it takes most of an hour on one processor; the quick ones are (`test_alone.py`).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

from support.free_parts import freed
from support.local_net_tie import LocalNetTie
from support.local_tie import LocalTie

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
MOST = 20_000
MOST_DECIDING = 400
OPEN: frozenset[tuple[str, str]] = frozenset()
"""The machines that come to no end within `MOST` configurations, with or without restarts: cell and machine."""


def machines(decomposition: Decomposition) -> Iterator[tuple[str, Callable[[], OneMachine]]]:
    """Each controller, and each coordinator for each of its groups."""
    for subnet in decomposition.subnets:
        yield subnet.name, partial(Alone, decomposition, subnet.name, Reach())
    for name in coordinators(decomposition):
        for group, names in enumerate(Coordinator(decomposition, name).groups):
            whole = name or "coordinator"
            yield f"{whole}: {' '.join(names)}", partial(Deciding, decomposition, name, group)


def explored(cell: str, *, free: bool) -> Iterator[tuple[str, bool]]:
    """Explore the machines of a cell; a line for each, and whether it is as it has to be."""
    decomposition = split(catalogue_net(cell))
    decomposition = freed(decomposition) if free else decomposition
    ties = LocalTie(decomposition), LocalNetTie(protocol_net(decomposition))

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        for tie in ties:
            tie(explorer, at, step, after)

    for name, machine in machines(decomposition):
        for crashes in (1, 0):
            begun, untold = time.process_time(), ties[1].untold
            where = f"{cell} {'free' if free else 'promising'} {name}, {'restarts' if crashes else 'no restart'}"
            try:
                explorer = machine()
                most = MOST_DECIDING if isinstance(explorer, Deciding) else MOST
                space = explore(explorer, Budget(crashes=crashes), max_configurations=most, watch=watch)
            except (AssertionError, ProtocolError) as failed:
                yield f"{where}: NOT WHAT WAS PROVED: {failed}", False
                break
            seconds = time.process_time() - begun
            end = "all" if space.complete else "NOT ALL"
            words = f"{space.configurations} configurations, {space.steps} acts, {end}, {seconds:.0f} s"
            beside = ties[1].untold - untold
            words += f", {beside} of two rounds of a group, held to the actions alone" if beside else ""
            yield f"{where}: {words}", space.complete or crashes > 0 or (cell, name) in OPEN
            if space.complete:
                break


def main(cells: list[str]) -> int:
    """Explore the machines of these cells, or of all."""
    status = 0
    for cell in cells or CELLS:
        for free in (True, False):
            for words, is_well in explored(cell, free=free):
                sys.stdout.write(words + "\n")
                sys.stdout.flush()
                status |= not is_well
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
