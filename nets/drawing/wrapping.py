"""A net that is wider than the sheet, in panels below each other, each with some of its lanes.

A panel is a net of its own: the places and signals of its lanes, and of each transition the arcs that end there. It
keeps the rows of the whole, those that are empty in it left out, so that what happens earlier stands higher in each.
Which lanes go together `panels` decides. Rejected: to cut the rows as well. A line of machines would fill its sheets
better, and a place whose arcs are cut would be looked for on two of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from firable.nets.drawing.arrangement import Arrangement
from firable.nets.drawing.folding import Folded
from firable.nets.drawing.layout import arranged, layout
from firable.nets.drawing.panels import panels
from firable.nets.drawing.part import part_of
from firable.nets.drawing.shapes import Layout
from firable.nets.drawing.sheet import MARGIN
from firable.nets.net import Net

_LANE_GAP: Final = 14.0
_PANEL_GAP: Final = 20.0


@dataclass(frozen=True, slots=True)
class Panel:
    """A part of a picture: its net, laid out, how far down it stands, and its first lane's number among all.

    `again` are the transitions that a panel above it shows too.
    """

    net: Net
    where: Layout
    top: float
    first_lane: int
    again: frozenset[str]


def wrapped_panels(whole: Folded, given: Arrangement, width_max: float | None) -> list[Panel]:
    """The panels of a net, one where it is narrow enough or has a single lane."""
    given = replace(given, participants=whole.participants)
    where = layout(whole.net, given, whole.members)
    only = Panel(whole.net, where, 0.0, 0, frozenset())
    if width_max is None or where.width <= width_max or len(where.lanes) < 2:
        return [only]
    settled = arranged(whole.net, given)
    owners = [lane.owner for lane in where.lanes]
    # A transition in which nobody takes part stands in the first panel.
    taking = {name: some or frozenset(owners[:1]) for name, some in settled.participants.items()}
    users = [
        {owners.index(owner) for owner in taking if owner in owners}
        for taking in (settled.participants[t.name] for t in whole.net.transitions)
    ]
    room = width_max - where.lanes[0].x - MARGIN
    cut = panels([lane.width for lane in where.lanes], room, _LANE_GAP, users)
    found: list[Panel] = []
    top, seen = 0.0, set[str]()
    for some in cut:
        here = [owners[i] for i in some]
        net = part_of(whole.net, here, taking)
        laid = layout(net, replace(settled, lanes=tuple(here), tracks=given.tracks), whole.members)
        names = {t.name for t in net.transitions}
        found.append(Panel(net, laid, top, some.start, frozenset(names & seen)))
        seen |= names
        top += laid.bottom - laid.top + _PANEL_GAP
    return found
