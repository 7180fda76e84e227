"""A deadline: the moment after which a technique stops and hands out what it has found so far.

The moment comes by the clock, or because somebody no longer needs the answer: techniques that race each other share
a flag that the winner sets.

A limit of seconds for each question to a solver bounds nothing where there are thousands of questions. So several
techniques share one moment, and each of them asks whether it is over between two steps of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf
from threading import Event
from time import monotonic
from typing import Final

_MILLISECONDS_MAX: Final = 2**31 - 1  # the longest timeout of z3 that is safe to ask for, 24 days


@dataclass(frozen=True, slots=True)
class Deadline:
    """A moment of the monotonic clock, in seconds, or the setting of a flag; by default it never comes."""

    at_seconds: float = inf
    cancelled: Event | None = None

    @classmethod
    def after(cls, seconds: float, cancelled: Event | None = None) -> Deadline:
        """The moment that is so many seconds away, or the setting of the flag.

        >>> Deadline.after(0).over, Deadline().over
        (True, False)
        """
        return cls(monotonic() + seconds, cancelled)

    def within(self, seconds: float) -> Deadline:
        """The moment so many seconds away, or this one where it comes first; by the same flag.

        >>> Deadline.after(0).within(60).over, Deadline().within(60).over
        (True, False)
        """
        return Deadline(min(self.at_seconds, monotonic() + seconds), self.cancelled)

    def share(self, share: float) -> Deadline:
        """The moment at which so large a part of the time that is left has gone; this one where the clock sets no end.

        >>> Deadline.after(60).share(0).over, Deadline().share(0).over
        (True, False)
        """
        left = self.left_seconds
        return self if left is None else self.within(left * share)

    @property
    def over(self) -> bool:
        """Whether the moment has come."""
        return monotonic() >= self.at_seconds or self.is_cancelled

    @property
    def is_cancelled(self) -> bool:
        """Whether the flag was set: who was ended so had not all of the time."""
        return self.cancelled is not None and self.cancelled.is_set()

    @property
    def left_seconds(self) -> float | None:
        """The time left, not below 0; None where the clock sets no end."""
        return None if self.at_seconds == inf else max(0.0, self.at_seconds - monotonic())

    @property
    def left_milliseconds(self) -> int:
        """The time left for one question to a solver, at least 1: to z3, 0 is no limit."""
        left = self.at_seconds - monotonic()
        return _MILLISECONDS_MAX if left * 1000 >= _MILLISECONDS_MAX else max(1, ceil(left * 1000))


NEVER: Final = Deadline()
