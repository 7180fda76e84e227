"""Exploring the voting protocol of whole cells as a net of its own: without faults, with one of each kind, with many.

Two orders of places race for the decision diagram; the processor seconds are those of both, so that they say what
the answer cost and not who was first. Apart is told what finding all configurations took, and what the verdicts on
them took besides.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from measuring import MET, MISSED, Table, timed

from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.decompose.protocol.exploring import Exploration, explore_protocol
from firable.decompose.protocol.outages import fault_verdicts
from firable.decompose.protocol.variant import ANY_FAULTS, NO_FAULTS, ONE_OF_EACH, PROTOCOL, Faults
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Verdict

NETS: Final = ("one_robot", "two_robots_shared", "two_robots_separate")
KINDS: Final = {"no faults": NO_FAULTS, "one fault of each kind": ONE_OF_EACH, "any number of faults": ANY_FAULTS}
SECONDS_MAX: Final = 60.0


def explored(decomposition: Decomposition, faults: Faults) -> Exploration:
    """All configurations of the protocol."""
    return explore_protocol(decomposition, PROTOCOL, faults, limits=Limits(Deadline.after(4 * SECONDS_MAX)))


def decided(exploration: Exploration, faults: Faults) -> tuple[Verdict, ...]:
    """Every verdict on them."""
    return exploration.verdicts if faults == NO_FAULTS else fault_verdicts(exploration)


def tables(repeat: int) -> list[Table]:
    """One row for each net and kind of run."""
    rows = []
    for name in NETS:
        decomposition = freed(split(catalogue_net(name)))
        for kind, faults in KINDS.items():
            found, verdicts = [], []
            for _ in range(repeat):
                exploration, seconds = timed(partial(explored, decomposition, faults))
                found.append(seconds)
                verdicts.append(timed(partial(decided, exploration, faults)))
            net, whole = exploration.protocol.net, min(found) + min(seconds for _, seconds in verdicts)
            markings = exploration.space.n_markings
            rows.append(
                (
                    f"{name}, {kind}",
                    f"{len(net.places)} / {len(net.transitions)}",
                    f"{markings:,}" if markings < 10**9 else f"{float(markings):.1e}",
                    f"{min(found):.1f}",
                    f"{whole:.1f} (<= {SECONDS_MAX:g}: {MET if whole <= SECONDS_MAX else MISSED})",
                    "yes" if all(verdict.holds for verdict in verdicts[0][0]) else "no",
                )
            )
    return [
        Table(
            "The protocol of whole cells, explored",
            "The voting protocol of a split as a net of its own, as a bundle runs it, with the parts that are free of "
            "promise: its configurations in a decision diagram. Processor "
            "seconds of both orders that race, to find them, and to find them and decide every verdict.",
            ("net", "places / transitions", "configurations", "found, s", "with all verdicts, s", "all hold"),
            tuple(rows),
        )
    ]
