"""A campaign: many seeds on one net, and of each that fails the shortest run that fails in the same way.

A failing run is a net, a seed, the kinds of faults allowed and a number of steps; `firable rehearse` brings it back. It
is *shrunk* before it is shown: as long as something of the same kind still fails, kinds of faults and steps are left
out, and other seeds are tried. Rejected: deleting single choices of the run, as property testers do; a run of the
choices that are left is no longer named by a seed, and would have to be kept as a file.
"""

from __future__ import annotations

import random
import shlex
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Final

from firable.executor.protocol.messages import ProtocolError
from firable.executor.simulation.faults import KINDS, Faults
from firable.executor.simulation.judge import RunFailedError, Subject
from firable.executor.simulation.machinery import MachineError
from firable.executor.simulation.recovery import ProgressLostError, recover
from firable.executor.simulation.timekeeper import TimeLimitError
from firable.executor.simulation.world import REAL, Machines, World
from firable.nets.diagnostics import InputError

STEPS: Final = (50, 800)
"""The fewest and the most steps of a run that is not told how many; one in ten is longer."""
_LONGER: Final = 5
_SHRINKING_RUNS_MAX: Final = 600

_MEANINGS: Final = (
    (InputError, "no trace of the central net"),
    (MachineError, "a machine was given what no machine may be given"),
    (ProgressLostError, "progress is lost"),
    (ProtocolError, "a machine of the protocol was told what the protocol excludes"),
    (TimeLimitError, "a time limit is not kept"),
    (RunFailedError, "something moved that must not"),
)


@dataclass(frozen=True, slots=True)
class Run:
    """What names a run on a net; the kinds of its faults, and how long it is, are drawn if they are not told."""

    seed: int
    kinds: tuple[str, ...] | None = None
    steps: int | None = None

    @property
    def length(self) -> int:
        """How many steps it has before everything is mended."""
        if self.steps is not None:
            return self.steps
        draw = random.Random(f"{self.seed} steps")
        steps = draw.randint(*STEPS)
        return steps * _LONGER if draw.random() < 0.1 else steps


@dataclass(frozen=True, slots=True)
class Passed:
    """A run in which nothing was found, how often what happened in it, and which transitions fired."""

    run: Run
    counts: Counter[str]
    fired: frozenset[str]


@dataclass(frozen=True, slots=True)
class Failed:
    """A run in which something was found: of which kind, what it was, and what came before it."""

    run: Run
    kind: str
    message: str
    log: tuple[str, ...]

    def command(self, net: str) -> str:
        """The command that brings the run back; `net` is the net as the command line names it."""
        kinds = "" if self.run.kinds is None else f" --faults {','.join(self.run.kinds) or 'none'}"
        steps = "" if self.run.steps is None else f" --steps {self.run.steps}"
        return f"firable rehearse {shlex.quote(net)} --seed {self.run.seed}{kinds}{steps}"


def rehearse(subject: Subject, run: Run, machines: Machines = REAL) -> Passed | Failed:
    """Let a run happen, and mend everything in the end; the same arguments give the same result."""
    faults = Faults.drawn(run.seed, run.kinds)
    world = World(subject, run.seed, faults, machines)
    try:
        world.begin()
        world.run(run.length)
        recover(world)
    except Exception as error:  # whatever a machine does wrong ends the run, and is what was looked for
        kind = next((words for raised, words in _MEANINGS if isinstance(error, raised)), type(error).__name__)
        # What only shows when everything is mended has happened before; what shows earlier needs no more steps.
        suffered = tuple(each for each in KINDS if faults[each])
        failed = replace(run, kinds=suffered, steps=min(run.length, world.step))
        return Failed(failed, kind, str(error), tuple(world.told()))
    return Passed(run, world.counts + Counter(faults.intensities.keys()), frozenset(world.fired))


@dataclass(slots=True)
class Campaign:
    """What many runs came to."""

    runs: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    """How often what happened, and for each kind of fault, how many runs suffered it."""
    fired: set[str] = field(default_factory=set)
    failed: list[Failed] = field(default_factory=list)

    def take(self, result: Passed | Failed) -> None:
        """Count one run."""
        self.runs += 1
        match result:
            case Passed():
                self.counts += result.counts
                self.fired |= result.fired
            case Failed():
                self.failed.append(result)

    def join(self, other: Campaign) -> None:
        """Count the runs of another campaign, too."""
        self.runs += other.runs
        self.counts += other.counts
        self.fired |= other.fired
        self.failed += other.failed


def campaign(subject_of: Callable[[int], Subject], runs: Iterable[Run], machines: Machines = REAL) -> Campaign:
    """Let many runs happen; `subject_of` says for a seed which net it is on."""
    done = Campaign()
    for run in runs:
        done.take(rehearse(subject_of(run.seed), run, machines))
    return done


def shrunk(subject: Subject, failed: Failed, machines: Machines = REAL) -> Failed:
    """A run that fails in the same way with as few kinds of faults and as few steps as are found in a few seconds."""
    best, left = failed, _SHRINKING_RUNS_MAX

    def fails(run: Run) -> Failed | None:
        nonlocal left
        left -= 1
        found = rehearse(subject, run, machines) if left >= 0 else None
        return found if isinstance(found, Failed) and found.kind == failed.kind else None

    def least(kinds: tuple[str, ...], seeds: Iterable[int]) -> Failed | None:
        runs = (Run(seed, kinds, failed.run.length) for seed in seeds)
        return next((found for found in map(fails, runs) if found is not None), None)

    suffered = failed.run.kinds or ()
    for few in ((), *((kind,) for kind in suffered)):
        if (found := least(few, range(12))) is not None:
            best = found
            break
    else:
        for kind in suffered:
            kinds = tuple(each for each in best.run.kinds or () if each != kind)
            best = least(kinds, (best.run.seed, *range(8))) or best
    for seed in range(100):
        found = fails(Run(seed, best.run.kinds, best.run.length - 1))
        if found is not None and found.run.length < best.run.length:
            best = found
    steps = best.run.length
    while steps and (found := fails(replace(best.run, steps=steps * 3 // 4))) is not None:
        best, steps = found, found.run.length
    return best
