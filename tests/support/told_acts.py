"""What is told of an act of one machine: acts between which this does not differ are told once.

An exploration meets the same act with other numbers of reports, other commands and other times in thousands. What the
proof knows of it is little. So it is written out here first, as a value, and only from this value it is told in the
words of the proof; what is not in it cannot be left out by mistake.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import closed_key
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Message,
    Report,
    Sending,
    ToController,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.exploring import Explorer

Closed = dict[str, tuple[int, frozenset[int]]]
"""Of each coordinator, below which round all of its are closed, and which others."""


@dataclass(frozen=True, slots=True)
class Held:
    """What is told of a controller, and nothing else: acts between which this does not differ are told once."""

    name: str
    marked: tuple[str, ...]
    """Its places and signals that hold."""
    promises: tuple[tuple[int, frozenset[str]], ...]
    closed_below: tuple[tuple[str, int], ...]
    obeyed: tuple[tuple[str, tuple[int, frozenset[int]]], ...]
    """As far as it is kept."""

    @classmethod
    def of(cls, explorer: Explorer, number: int) -> Self:
        """What the controller of this number holds."""
        machine, kept = explorer.machine(number), explorer.machines[number].kept
        assert isinstance(machine, LocalController)
        signals = (s.name for s in machine.subnet.signals if machine.word & machine.player.signal_bit(s.name))
        return cls(
            machine.name,
            (*machine.subnet.names(machine.marking), *signals),
            tuple((n, promise.promised) for n, promise in machine.promises.items()),
            tuple((name, above.closed_below) for name, above in machine.above.items()),
            tuple((name, _obeyed(kept.get(closed_key(name)))) for name in machine.above),
        )


def said(effects: tuple[Effect, ...]) -> tuple[object, ...]:
    """What an act does, as far as it is told: of the numbers of reports only which is the last."""
    last = newest(effects)
    return tuple(each for effect in effects if (each := _told_of(effect, last)) is not None)


def decided_by(machine: Coordinator) -> tuple[object, ...]:
    """What is told of a coordinator but for the votes of free parts, and these of transitions that are asked for."""
    asked = {t for opened in machine.rounds.values() for t in opened.transitions}
    rounds = tuple(
        (n, o.transitions, o.decided, o.committed, frozenset(o.votes.items()), frozenset(o.acknowledged))
        for n, o in machine.rounds.items()
    )
    ready = ((c, frozenset(t for t in names if c in machine.free.get(t, ()))) for c, names in machine.ready.items())
    return machine.name, rounds, frozenset(ready), frozenset(asked), machine.epoch


def heard_in(message: Message | None) -> tuple[object, ...]:
    """What is told of a message that a coordinator hears, but for the report in it, which is looked at each time."""
    promised, number = getattr(message, "promised", None), getattr(message, "round", -1)
    told = message.readiness if isinstance(message, ToCoordinator) else None
    return type(message), getattr(message, "controller", ""), number, promised, told and (told.transitions, told.epoch)


def ordering(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    return tuple(replace(effect, seen=0) for effect in effects if isinstance(effect, VoteRequest | Decision | Hello))


def newest(effects: Iterable[Effect]) -> dict[str, int]:
    """The sequence number of the last report to each coordinator."""
    told = [effect for effect in effects if isinstance(effect, ToCoordinator)]
    return {
        each: max(report.readiness.sequence for report in told if report.coordinator == each)
        for each in {report.coordinator for report in told}
    }


def _told_of(effect: Effect, last: dict[str, int]) -> tuple[object, ...] | None:
    match effect:
        case Firing():
            return Firing, effect.transition
        case Sending():
            return Sending, effect.place
        case Report() | Vote() | Acknowledgement():
            round_, promised = getattr(effect, "round", -1), getattr(effect, "promised", ())
            isnewest = effect.readiness.sequence == last[effect.coordinator]
            return type(effect), effect.coordinator, round_, promised, effect.readiness.transitions, isnewest
    return None


def met(message: ToController) -> tuple[object, ...]:
    """What is told of a message that arrives."""
    what = getattr(message, "transitions", getattr(message, "committed", None))
    return type(message), getattr(message, "round", -1), what, message.closed_below, message.coordinator


def _obeyed(kept: object) -> tuple[int, frozenset[int]]:
    match kept:
        case [int(below), [*numbers]]:
            return below, frozenset(int(str(number)) for number in numbers)
    return 0, frozenset()
