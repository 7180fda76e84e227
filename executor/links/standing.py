"""Whether a host lets anything move, as others are told: who wonders why a cell stands may sit at another host.

It is news for people, and nothing follows from it. A host that is paused promises nothing, one that is held reports
nothing as ready, and the protocol knows no more of either than that. A link tells it as it does who is there: of who
is connected, when he is and when it changes.
"""

from __future__ import annotations

from enum import StrEnum


class Standing(StrEnum):
    """What keeps everything on a host standing, if anything does."""

    GOING = "going"
    PAUSED = "paused"
    HELD = "held"
    LATCHED = "latched"

    @property
    def phrase(self) -> str:
        """What is said of a machine there."""
        return _PHRASES[self]


_PHRASES = {
    Standing.GOING: "goes on",
    Standing.PAUSED: "is paused",
    Standing.HELD: "is held until it is resumed",
    Standing.LATCHED: "is latched by an emergency stop, until it is reset and resumed",
}
