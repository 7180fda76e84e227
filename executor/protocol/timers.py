"""The times of one controller: how long each command under a time limit has been under way, and whether that is over.

Time is an input, like a signal: whoever hosts the controller says what its clock shows (`tick`), and asks when the
next time will be over (`deadline`). A time begins with the first tick after the token has entered and its command has
left the host, which says with each tick what has not (`held`): no machine is accused of a command that it has not had,
and the other times of its controller do not wait for it. It is over when its limit has gone by and the token is still
there without its completion. Then the timer is set in the process image, as a driver would set a sensor, and the fault
transition is a local one like any other.

A late tick is a late timeout and nothing worse: no proof says when a time is over. A clock that jumps makes timeouts
early or late, never wrong. Nothing of it is kept: after a restart each command is asked after first, and its time
begins anew when the controller is resumed; a time that ran on while a computer was down would accuse the machine.

Rejected: a timer of the host for each command, which sends a message when it rings. It can ring for a token that has
left, and come again after another has entered, and so needs numbers and a test of its own; here the token is looked at.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from math import inf
from types import MappingProxyType
from typing import Final

from firable.executor.protocol.token_player import TokenPlayer, Word
from firable.nets.net import Place

RESOLUTION_SECONDS: Final = 1e-6
"""So much too early is in time: a host that waits until a deadline may wake a rounding before it."""


class Timers:
    """The times of a subnet, none running."""

    def __init__(self, player: TokenPlayer) -> None:
        self.places: Mapping[str, Place] = MappingProxyType(
            {place.name: place for place in player.net.places if place.within is not None}
        )
        self.signals: Mapping[str, Place] = MappingProxyType(
            {place.within.timer: place for place in self.places.values() if place.within is not None}
        )
        """The places with a time limit, by their timers."""
        self._waits = MappingProxyType({name: self._bits(player, place) for name, place in self.places.items()})
        self.running: dict[str, float] = {}
        """When the time of each place will be over; minus infinity where it has not begun."""

    @staticmethod
    def _bits(player: TokenPlayer, place: Place) -> tuple[Word, Word]:
        token = 1 << player.net.place_index[place.name]
        return token, token | (player.signal_bit(place.completion) if place.completion is not None else 0)

    def enter(self, place: str) -> None:
        """A token has entered a place, and its command is sent: its time begins with the next tick."""
        if place in self.places:
            self.running[place] = -inf

    def unbegun(self, places: Iterable[str]) -> frozenset[str]:
        """Those of these places whose time would begin with the next tick."""
        found = frozenset(place for place, due in self.running.items() if due == -inf)
        return found.intersection(places) if found else found

    def begin_anew(self, word: Word) -> None:
        """Begin the time of every place that waits for its completion: after a restart."""
        self.running = {name: -inf for name in self.places if self.waits(name, word)}

    def waits(self, place: str, word: Word) -> bool:
        """Whether the token is there, and its completion has not come."""
        token, both = self._waits[place]
        return word & both == token

    def deadline(self, word: Word, held: Collection[str] = ()) -> float | None:
        """When the next time is over, by the clock of the ticks; minus infinity for at once, None for never.

        The commands of the places `held` have not left: times that have not begun do not begin there.
        """
        times = ((name, due) for name, due in self.running.items() if due != -inf or name not in held)
        return min((due for name, due in times if self.waits(name, word)), default=None)

    def over(self, now_seconds: float, word: Word, held: Collection[str] = ()) -> Iterator[str]:
        """The places whose time is over, each once; times that have not begun begin now, unless they are `held`."""
        for name, due in list(self.running.items()):
            limit = self.places[name].within
            if limit is None or not word & self._waits[name][0]:
                del self.running[name]
            elif not self.waits(name, word):
                continue  # another command may share the completion, and clear it before the token has gone on
            elif due == -inf:
                if name not in held:
                    self.running[name] = now_seconds + limit.seconds
            elif due <= now_seconds + RESOLUTION_SECONDS:
                del self.running[name]
                yield name
