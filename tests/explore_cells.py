"""The machines of the cells, each explored alone to its end and held to the proof of the protocol and the protocol net.

    python tests/explore_cells.py [CELL ...]

What may happen to a machine is said in `executor/simulation/alone.py` and `deciding.py`, and what is not told apart in
`likeness.py`. Every act is held to the actions of the parametric proof (`support/local_tie.py`), and those of
controllers to firings of the protocol net (`support/local_net_tie.py`); where a controller knows two rounds of one
group, the net says nothing, and the acts are counted in the line of the machine. Parts are free of promise as bundles
have them, and whatever is explored restarts as often as it likes. The exit status is 1 where a machine does not end, or
an act is none of the proof's. Of what is out of reach nothing is claimed.

It is no test of the suite, as it takes an hour of processors; the quick machines are (`test_alone.py`).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context

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
OUT_OF_REACH = {("two_robots_shared", "robots")}
"""One controller of two robots, of which either may be anywhere: what each has in `two_robots_separate`, multiplied."""
CONFIGURATIONS_MAX = 100_000
"""None of the others has as many."""


def machines(decomposition: Decomposition) -> Iterator[tuple[str, Callable[[], OneMachine]]]:
    """Each controller, and each coordinator for each of its groups."""
    for subnet in decomposition.subnets:
        yield subnet.name, partial(Alone, decomposition, subnet.name, Reach())
    for name in coordinators(decomposition):
        for group, names in enumerate(Coordinator(decomposition, name).groups):
            yield f"{name or 'coordinator'}: {' '.join(names)}", partial(Deciding, decomposition, name, group)


def explored(cell: str, name: str) -> tuple[str, bool]:
    """What to say of a machine after its exploration, and whether it is as it has to be."""
    decomposition = freed(split(catalogue_net(cell)))
    machine = dict(machines(decomposition))[name]()
    tie, net_tie = AloneTie(decomposition), LocalNetTie(protocol_net(decomposition))

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        net_tie(explorer, at, step, after)

    begun, budget = time.process_time(), Budget(crashes=1)
    try:
        space = explore(machine, budget, max_configurations=CONFIGURATIONS_MAX, watch=watch)
    except (AssertionError, ProtocolError) as failed:
        return f"{cell} {name}: NOT WHAT WAS PROVED: {failed}", False
    words = f"{cell} {name}: {space.configurations} configurations, {space.steps} acts"
    words += f", {net_tie.untold} of two rounds of a group, held to the actions alone" if net_tie.untold else ""
    return f"{words}{'' if space.complete else ', NOT ALL'}, {time.process_time() - begun:.0f} s", space.complete


def main(cells: list[str]) -> int:
    """Explore each machine of these cells, or of all, on all processors, and name what is not."""
    known = [(cell, name) for cell in cells or CELLS for name, _ in machines(freed(split(catalogue_net(cell))))]
    status = 0
    for cell, name in OUT_OF_REACH.intersection(known):
        sys.stdout.write(f"{cell} {name}: not explored, out of reach\n")
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(explored, *one) for one in known if one not in OUT_OF_REACH]):
            words, is_well = done.result()
            sys.stdout.write(f"{words}\n")
            sys.stdout.flush()
            status |= not is_well
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
