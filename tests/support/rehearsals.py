"""Single runs of the simulation, for tests that ask something of their own of them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import Effect, Keep
from firable.executor.simulation.faults import Faults
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.process import Process
from firable.executor.simulation.recovery import recover
from firable.executor.simulation.world import REAL, Machines, World
from firable.nets.decomposition import Decomposition

ORDERLY = ()
LOSING = ("loss", "reordering")
DOUBLING = ("duplication", "reordering")
BAD = ("loss", "duplication", "delay", "reordering")
NETWORKS: tuple[tuple[str, ...], ...] = (ORDERLY, LOSING, DOUBLING, BAD)
"""Kinds of faults that a network has."""


@lru_cache(maxsize=64)
def subject_of(decomposition: Decomposition) -> Subject:
    """What all runs of a decomposition share."""
    return Subject(decomposition)


def rehearsed(
    decomposition: Decomposition,
    seed: int,
    kinds: tuple[str, ...] = ORDERLY,
    steps: int = 300,
    machines: Machines = REAL,
) -> World:
    """A run that has gone so many steps through these kinds of faults, was judged all the time, and has recovered."""
    world = World(subject_of(decomposition), seed, Faults.drawn(seed, kinds), machines)
    world.begin()
    world.run(steps)
    recover(world)
    return world


def forgetting(whose: str, prefix: str) -> Machines:
    """Hosts whose stable storage loses what is written under keys that begin so, of "controllers" or "coordinators"."""

    class Forgetting(Process[Any]):
        """A process that keeps less."""

        def act(self, effects: Iterable[Effect]) -> bool:
            is_one = whose == ("controllers" if isinstance(self.machine, LocalController) else "coordinators")
            lost = (prefix,) if is_one else ()
            return super().act(e for e in effects if not (isinstance(e, Keep) and e.key.startswith(lost)))

    return Machines(process=Forgetting)
