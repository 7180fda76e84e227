"""Firing: Eq. (1)-(4) once, the two disciplines, arbitration, conflicts, traces, complement of a place.

What a program imports from here: a `Player` plays the tokens of a net by the firing rule, raising `NotFirableError`
where it forbids; `Discipline` names the two ways to fire. `read_trace` and `replay` judge a trace that something else
wrote (`Replay` is what it did), and a `Trace` of an own run is written by its `lines`. `Arbitration` chooses among the
enabled transitions as the arbiters of the net do. `judge` gives the `Judgement` on a net that stands still.

    from firable.semantics import Player

    player = Player(net)
    marking = player.fire(net.initial_marking, player.firable(net.initial_marking)[:1])

The rule itself is in `firable.semantics.firing`, over the Boolean algebras of `firable.semantics.algebra`. The function
`complement` is imported from the module of its name.
"""

from firable.semantics.arbitration import Arbitration
from firable.semantics.judgement import Judgement, judge
from firable.semantics.player import NotFirableError, Player
from firable.semantics.replaying import Replay, replay
from firable.semantics.trace import Discipline, Trace, read_trace

__all__ = [
    "Arbitration",
    "Discipline",
    "Judgement",
    "NotFirableError",
    "Player",
    "Replay",
    "Trace",
    "judge",
    "read_trace",
    "replay",
]
