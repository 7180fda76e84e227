"""Faults: what a simulated run may suffer, and how much of each, drawn from its seed.

*Swarm testing* (Groce et al., ISSTA 2012): a run does not suffer a little of everything, for then each fault is always
hidden by others. Each kind is left out of most runs, and how much of it there is is drawn besides. Every kind
draws from a source of its own, named by the seed and the kind; so a run that is told its kinds suffers as much of each
as where they were drawn, and a failure is shrunk by naming fewer.

Rejected: one list of probabilities for all runs. With a crash every few steps no round is ever closed, and what goes
wrong only behind a closed round is never seen.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Self

KINDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "loss": "a message is lost",
        "duplication": "a message comes once more, much later",
        "delay": "a message is held back for long",
        "reordering": "messages of one link overtake each other",
        "partition": "a controller is cut off from its coordinators, and comes back",
        "crash": "a process is killed, and restarted later",
        "torn": "a process is killed between a commit to its disk and what was to leave behind it",
        "unsynced": "writes wait for a common sync; a crash keeps only the first of them",
        "disk": "a write to the disk fails, which ends the process",
        "drift": "the clocks of the hosts run at different speeds",
        "jump": "a clock jumps ahead",
        "standstill": "a clock stands still for a while, and goes on from there",
        "slow": "a process lets its inputs wait, and fires late",
        "late": "a machine takes long",
        "stuck": "a machine does not end its command until it is mended",
        "queued": "the line to a machine is down, and its driver keeps the command",
        "flapping": "a sensor changes again and again",
        "stale": "a machine completes once more, or completes an earlier command",
        "forgetful": "a machine cannot say what has become of a command",
        "pause": "the operator pauses and resumes",
        "step": "the operator steps",
        "stop": "the operator stops everything, and starts it again",
        "leave": "the operator stops one host, and starts it again; some stay after all",
        "emergency": "an emergency stop at one host, whose process stays, and is reset later",
    }
)
"""Each kind of fault, and what it does. To add one: a row here, and where `Faults` is asked for it."""

_SHARE: Final = 0.35
"""Of the runs, how many suffer a kind."""


@dataclass(frozen=True, slots=True)
class Faults:
    """How much of each kind a run suffers: 0 nothing, 1 as much as ever."""

    intensities: Mapping[str, float]

    @classmethod
    def drawn(cls, seed: int, kinds: Iterable[str] | None = None) -> Self:
        """The faults of the run of a seed: some of these kinds of each, or else of kinds that are drawn, too."""
        amounts = {kind: _amount(seed, kind) for kind in KINDS}
        if kinds is None:
            return cls({kind: amount for kind, (amount, chosen) in amounts.items() if chosen})
        return cls({kind: amounts[kind][0] for kind in KINDS if kind in set(kinds)})

    @classmethod
    def none(cls) -> Self:
        """No faults."""
        return cls({})

    def __getitem__(self, kind: str) -> float:
        """How much of a kind."""
        return self.intensities.get(kind, 0.0)


def _amount(seed: int, kind: str) -> tuple[float, bool]:
    draw = random.Random(f"{seed} {kind}")
    return draw.random(), draw.random() < _SHARE
