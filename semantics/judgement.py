"""Judging a running net: does it run, does it wait, or is it deadlocked?

A cell that stands still is not broken as long as some transition is firable: it waits for an external gate, a sensor
or a completion, to open. It is deadlocked only if no transition is firable and openable, which no signal can change.
So the judgement on deadlock uses Eq. (1)-(4) alone, and never the present values of the signals, with one exception
that is no value: gates that want a signal both 1 and 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from firable.nets.net import Marking
from firable.semantics.player import Player


class Judgement(StrEnum):
    """What a net does at one marking and one valuation of the signals."""

    RUNNING = "running"
    WAITING = "waiting"
    DEADLOCK = "deadlock"


def judge(player: Player, marking: Marking, signals: Mapping[str, bool]) -> Judgement:
    """Running: something is enabled; waiting: firable, but its gates are closed now; else deadlock.

    >>> from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
    >>> player = Player(Net("n", (Place("p", marked=True),), (Transition("t", ("p",), external=(ExternalGate("s"),)),),
    ...                     (Signal("s"),)))
    >>> [str(judge(player, 1, {"s": True})), str(judge(player, 1, {})), str(judge(player, 0, {"s": True}))]
    ['running', 'waiting', 'deadlock']
    """
    if player.enabled(marking, signals):
        return Judgement.RUNNING
    return Judgement.DEADLOCK if player.deadlocked(marking) else Judgement.WAITING
