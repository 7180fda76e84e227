"""The situation of a run: running, waiting, deadlock, fault, told apart and in the words of the net.

Asked at quiescence, when no message is under way, the joint marking and the process image decide:

- *deadlock*: no transition is firable and openable. Nothing that a machine or an operator does will change that;
- *waiting*: some transition is firable and an external gate of it is closed, because a machine is at work or a sensor
  has seen nothing;
- *held*: after a restart; nothing moves until an operator resumes, and nothing can be resumed while it is unknown what
  became of a command;
- *latched*: after an emergency stop, until an operator resets it; then it is held;
- *fault*: the driver reported one, or a command is overdue: sent longer ago than its limit and not completed. A net
  cannot tell a slow machine from a dead one; only time does, so a fault is never concluded from the marking.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

from firable.executor.links.link import called
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.token_player import TokenPlayer, Word
from firable.nets.net import Marking, Net
from firable.semantics.waiting import circle


class State(StrEnum):
    """What a run is doing."""

    RUNNING = "running"
    WAITING = "waiting"
    DEADLOCK = "deadlock"
    FAULT = "fault"
    PAUSED = "paused"
    HELD = "held"
    LATCHED = "latched"
    STOPPED = "stopped"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Blocked:
    """Why one transition does not fire: places that lack a token or hold one too many, and gates that are closed."""

    transition: str
    empty: tuple[str, ...]
    full: tuple[str, ...]
    gates: tuple[tuple[str, bool], ...]
    """Signals with the value that is wanted."""
    untaken: tuple[str, ...] = ()
    """Places whose command no machine is known to have, and which has no completion to wait for."""
    decided_by: str | None = None
    """The coordinator of a transition of which only a part is seen."""
    unready: tuple[str, ...] = ()
    """Where that is here, the controllers elsewhere that have not reported their parts as ready."""
    unread: tuple[str, ...] = ()
    """Sensors that nobody has read since the start, so that their gates are closed whatever they show."""
    is_barred: bool = False
    """Whether the operator, who ends the cycle, lets it fire no more."""

    def __str__(self) -> str:
        if self.is_barred:
            return f"{self.transition} is barred by the operator: no new work comes in"
        reasons = [f"a token on {place}" for place in self.empty]
        reasons += [f"{place} to become empty" for place in self.full]
        reasons += [f"{signal}" if wanted else f"not {signal}" for signal, wanted in self.gates]
        reasons += [f"{sensor} to be read" for sensor in self.unread]
        reasons += [f"the machine to take the command of {place}" for place in self.untaken]
        if not reasons and self.unready:
            return f"{self.transition} is ready here, and waits for {', '.join(self.unready)} to be ready"
        if not reasons and self.decided_by is not None:
            return f"{self.transition} is ready here, and is decided by {called(self.decided_by)}"
        return f"{self.transition} waits for {', '.join(reasons)}" if reasons else f"{self.transition} is enabled"


@dataclass(frozen=True, slots=True)
class Situation:
    """What a run is doing, and what waits for what."""

    state: State
    marking: tuple[str, ...]
    blocked: tuple[Blocked, ...] = ()
    message: str = ""
    is_emergency: bool = False
    """Whether it is an emergency stop that has ended the run, and no stop that somebody wanted to come."""
    is_held: bool = False
    """Whether the run is held, or was when it was stopped: its machines are in the middle of something."""

    @property
    def is_unsettled(self) -> bool:
        """Whether somebody has to look, though nothing has failed."""
        return self.is_emergency or self.is_held

    def __str__(self) -> str:
        lines = [f"{self.state}: {self.message}" if self.message else str(self.state)]
        return "\n  ".join([*lines, *map(str, self.blocked)])


def is_deadlock(player: TokenPlayer, word: Word) -> bool:
    """Whether no transition is firable and openable: `semantics.judgement.judge` on compiled transitions.

    It is asked at each quiescence, so it does not play by the reference; the tests hold it to what `judge` says.
    """
    return not any(c.openable and c.firable(word, player.places) for c in player.transitions.values())


def deadlocked(net: Net, marking: Marking) -> str:
    """A deadlock in words: whose tokens wait for each other in a circle, by their places, where there is one."""
    told = [wait.told(net.place(wait.place).description) for wait in circle(net, marking)]
    around = f"; in a circle, each waiting for the next: {'; '.join(told)}" if told else ""
    return f"no transition can fire any more, whatever the signals do{around}"


def blocked(
    player: TokenPlayer, word: Word, untaken: Collection[str] = (), unread: Collection[str] = ()
) -> Iterator[Blocked]:
    """What waits: the firable transitions with closed gates; in a deadlock, those that have some token to take.

    `untaken` are the places whose command is held back with its driver, `unread` the sensors that nobody has read yet.
    """
    net = player.net
    faults = {net.transitions[t].name for t in net.fault_transitions.values()}  # nobody waits for a timeout
    firable = [c for c in player.transitions.values() if c.name not in faults and c.firable(word, player.places)]
    shown = firable or [c for c in player.transitions.values() if c.takes & word]
    for compiled in shown:
        external = net.transition(compiled.name).external
        yield Blocked(
            compiled.name,
            net.names(compiled.needs & ~word & player.places),
            net.names(compiled.forbids & word & player.places),
            tuple(
                (gate.signal, gate.wanted)
                for gate in external
                if gate.signal not in unread and bool(word & player.signal_bit(gate.signal)) != gate.wanted
            ),
            tuple(place for place in net.transition(compiled.name).inputs if place in untaken),
            unread=tuple(dict.fromkeys(gate.signal for gate in external if gate.signal in unread)),
        )


def blocked_parts(controller: LocalController, untaken: Collection[str]) -> Iterator[Blocked]:
    """The same of one controller, as far as it knows: a part of a coordinated transition bears its name."""
    row_of = {part.name: row for row, part in controller.parts.items()}
    decided_by = {row: above.name for above in controller.above.values() for row in above.parts}
    for one in blocked(controller.player, controller.word, untaken, controller.unread):
        row = row_of.get(one.transition, one.transition)
        yield replace(one, transition=row, decided_by=decided_by.get(row))


def blocked_here(controllers: Iterable[LocalController], untaken: Collection[str]) -> tuple[Blocked, ...]:
    """The same of several controllers of one host: the parts of a transition that are here wait as one."""
    found: dict[str, Blocked] = {}
    for one in (each for controller in controllers for each in blocked_parts(controller, untaken)):
        had = found.get(one.transition, replace(one, empty=(), full=(), gates=(), untaken=(), unread=()))
        found[one.transition] = replace(
            had,
            empty=had.empty + one.empty,
            full=had.full + one.full,
            gates=had.gates + one.gates,
            untaken=had.untaken + one.untaken,
            unread=had.unread + one.unread,
        )
    return tuple(found.values())
