"""What is settled before a net is laid out: the order of lanes, the rows of transitions, the tracks of places.

Nothing of this need be there; then the layout finds it. It is there for two reasons. A layout file keeps the picture as
somebody knows it, while the net grows: what is new is put in beside what stood there. And a panel of a wrapped picture
keeps the rows of the whole, and the transitions that are global by what stands in another panel.

An arrangement speaks of lanes, rows and tracks, not of pixels: a place whose name has become longer pushes its
neighbours aside, and a file that somebody edits by hand is a list of names. Rejected: coordinates. One transition more
moves all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Owner = str | None


@dataclass(frozen=True)
class Arrangement:
    """Owners in the order of their lanes; for transitions their rows; for owners the places of each of their tracks.

    What it names and the net does not have is passed over; what it does not name, or what two of it cannot have
    together, the layout finds a place for.
    """

    lanes: tuple[Owner, ...] = ()
    rows: Mapping[str, float] = field(default_factory=dict)
    tracks: Mapping[Owner, tuple[tuple[str, ...], ...]] = field(default_factory=dict)
    participants: Mapping[str, frozenset[Owner]] = field(default_factory=dict)
    """Who takes part in a transition, where its arcs do not say so: folded away, or in another panel."""
