"""Where everything stands: controllers are lanes, transitions are rows across them, places stand on tracks in between.

The layout is that of a swimlane chart. A transition is a bar at one height, thick in the controllers that take part in
it, so a global transition shows its parts as the split gives them. A place has a track of its lane to itself for as far
as its arcs reach, so every arc is a vertical line: it has at most one bend, and arcs never cross each other, only bars.
A place stands in the gap between two rows where its arcs are shortest in all; where several leave it to one side, all
but the nearest pass on its left.

The alternative, layered drawing with arcs routed freely (Sugiyama; ELK, Graphviz), is the better picture for a net
without controllers, and the worse one for a cell, where "who takes part in this" is what the reader looks for.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from types import MappingProxyType
from typing import Final

from firable.nets.drawing.arrangement import Arrangement, Owner
from firable.nets.drawing.labels import local_name, place_words, transition_words
from firable.nets.drawing.part import taking_part
from firable.nets.drawing.rows import lane_order, rows_of
from firable.nets.drawing.shapes import (
    BAR_HALF_WIDTH,
    BYPASS_FIRST,
    BYPASS_STEP,
    LABEL_LEFT,
    STUB_LINE,
    WORDS_LINE,
    Bar,
    Edge,
    Kind,
    Lane,
    Layout,
    Spot,
    Stub,
)
from firable.nets.drawing.text import COMMAND, NAME, NOTE, Words, width_of
from firable.nets.net import ExternalGate, Net

FREE: Final = Arrangement()
"""An arrangement in which nothing is settled."""
_BYPASS_HALF_WIDTH: Final = 5.0
_ROW_HEIGHT: Final = 94.0
_WORDS_APART: Final = 21.0
"""From the last line of words to the middle of the bar below, whose first signal stands between."""
_EMPTY_ROW_HEIGHT: Final = 56.0
_EDGE_ROW_HEIGHT: Final = 34.0
_LANE_GAP: Final = 14.0
_LANE_PADDING: Final = 14.0
_HEADER_HEIGHT: Final = 52.0
_TITLE_HEIGHT: Final = 66.0
_MARGIN: Final = 24.0
_TRACKS_PERMUTED_MAX: Final = 5


def layout(net: Net, given: Arrangement = FREE, members: Mapping[str, Sequence[str]] = MappingProxyType({})) -> Layout:
    """Lay out a net; the same net, arranged in the same way, always gets the same layout.

    `members` are the places inside each macro place.
    """
    return _Layouter(net, given, members).layout()


def arranged(net: Net, given: Arrangement = FREE) -> Arrangement:
    """How a net is laid out, as an arrangement: what a layout file keeps, and what other pictures of the net follow."""
    laid = _Layouter(net, given, {})
    tracks: dict[Owner, list[tuple[str, ...]]] = {owner: [] for owner in laid.owners}
    for lane, places in zip(laid.lane_of_track, laid.tracks, strict=True):
        if places:
            tracks[laid.owners[lane]].append(tuple(net.places[p].name for p in places))
    rows = {t.name: float(row) for t, row in zip(net.transitions, laid.rows, strict=True)}
    participants = {t.name: laid.taking[i] for i, t in enumerate(net.transitions)}
    return Arrangement(tuple(laid.owners), rows, {owner: tuple(some) for owner, some in tracks.items()}, participants)


@dataclass(frozen=True, slots=True)
class _Gate:
    """An external gate and the track at which it is drawn."""

    gate: ExternalGate
    label: str
    track: int
    slot: int


class _Layouter:
    """The steps of the layout, each using those before it."""

    def __init__(self, net: Net, given: Arrangement, members: Mapping[str, Sequence[str]]) -> None:
        self.net, self.given, self.members = net, given, members
        owned = {place.owner for place in net.places} | {signal.owner for signal in net.signals}
        self.owners: list[Owner] = [c.name for c in net.controllers if c.name in owned]
        if None in owned or not self.owners:
            self.owners.append(None)
        taking = self.taking = [self._taking(t) for t in range(len(net.transitions))]
        self.is_global = [len(owners) > 1 for owners in taking]
        self.elsewhere = [sorted(str(owner) for owner in owners.difference(self.owners)) for owners in taking]
        participants = [
            frozenset(self.owners.index(owner) for owner in owners if owner in self.owners) or frozenset({0})
            for owners in taking
        ]
        order = self._order(participants)
        self.owners = [self.owners[lane] for lane in order]
        position = {lane: i for i, lane in enumerate(order)}
        self.participants = [frozenset(position[lane] for lane in lanes) for lanes in participants]
        self.rows = rows_of(net, [(min(lanes), max(lanes)) for lanes in self.participants], given.rows)
        self.row_count = max(self.rows, default=0)
        self.in_margin = self._in_margin()
        self.incident = self._incident()
        self.gaps = [self._gap(edges) for edges in self.incident]
        self.tracks = self._tracks()
        self.track_of = {p: track for track, places in enumerate(self.tracks) for p in places}
        self.gates = self._gates()
        self.attached: list[set[int]] = [{gate.track for gate in gates} for gates in self.gates]
        for p, edges in enumerate(self.incident):
            for t, _ in edges:
                self.attached[t].add(self.track_of[p])
        for t, tracks in enumerate(self.attached):
            reached = {self.lane_of_track[track] for track in tracks}
            tracks |= {self._spare(lane) for lane in self.participants[t] - reached}

    def _taking(self, t: int) -> frozenset[Owner]:
        """Who takes part in a transition: by its arcs and gates, unless it is given."""
        transition, net = self.net.transitions[t], self.net
        if transition.name in self.given.participants:
            return self.given.participants[transition.name]
        return taking_part(net, transition)

    def _order(self, participants: Sequence[frozenset[int]]) -> tuple[int, ...]:
        """The lanes in the order that is given, and behind them those that are new."""
        known = [owner for owner in self.given.lanes if owner in self.owners]
        if not known:
            return lane_order(participants, len(self.owners))
        return tuple(map(self.owners.index, [*known, *(owner for owner in self.owners if owner not in known)]))

    def _place_words(self, p: int) -> Words:
        place = self.net.places[p]
        return place_words(place, self.members.get(place.name, ()))

    def _words(self, t: int) -> Words:
        return transition_words(self.net.transitions[t], self.elsewhere[t], in_margin=t in self.in_margin)

    def _in_margin(self) -> frozenset[int]:
        """The global transitions whose words stand in the margin: those that have a row to themselves there."""
        wide = [t for t, is_global in enumerate(self.is_global) if is_global]
        there = Counter(self.rows[t] for t in wide)
        return frozenset(t for t in wide if there[self.rows[t]] == 1)

    def _incident(self) -> list[list[tuple[int, Kind]]]:
        found: list[list[tuple[int, Kind]]] = [[] for _ in self.net.places]
        for t, transition in enumerate(self.net.transitions):
            for kind, names in (
                (Kind.INPUT, transition.inputs),
                (Kind.OUTPUT, transition.outputs),
                (Kind.PERMISSIVE, transition.permissive),
                (Kind.INHIBITIVE, transition.inhibitive),
            ):
                for name in names:
                    found[self.net.place_index[name]].append((t, kind))
        return found

    def _gap(self, edges: Sequence[tuple[int, Kind]]) -> int:
        """The gap in which the edges are shortest, the upper one of several: gap g lies below row g."""
        rows = [self.rows[t] for t, _ in edges]

        def cost(gap: int) -> float:
            above = sum(row <= gap for row in rows)
            bypasses = max(0, above - 1) + max(0, len(rows) - above - 1)
            return sum(abs(row - gap - 0.5) for row in rows) + 0.6 * bypasses

        nearby = {gap for row in rows for gap in (row - 1, row)} or {0}
        return min(sorted(nearby), key=cost)

    def _extent(self, p: int) -> tuple[int, int]:
        rows = [self.rows[t] for t, _ in self.incident[p]]
        return min([*rows, self.gaps[p]]), max([*rows, self.gaps[p] + 1])

    def _tracks(self) -> list[list[int]]:
        """The places of each track, lane by lane; short ones first, so that chains of work share the first track."""
        tracks: list[list[int]] = []
        self.lane_of_track: list[int] = []
        for lane, owner in enumerate(self.owners):
            here = self._kept_tracks(owner)
            settled = {p for track in here for p in track}
            mine = [p for p, place in enumerate(self.net.places) if place.owner == owner and p not in settled]
            mine.sort(key=lambda p: (self._extent(p)[1] - self._extent(p)[0], self._extent(p)[0], p))
            for p in mine:
                free = (track for track in here if not any(self._overlap(p, other) for other in track))
                track = next(free, None)
                if track is None:
                    here.append([p])
                else:
                    track.append(p)
            here = here or [[]]
            tracks += here
            self.lane_of_track += [lane] * len(here)
        ordered = self._ordered(tracks)
        for lane in sorted(self._lanes_with_bare_parts(), reverse=True):
            last = max(i for i, of in enumerate(self.lane_of_track) if of == lane)
            if ordered[last]:
                ordered.insert(last + 1, [])
                self.lane_of_track.insert(last + 1, lane)
        return ordered

    def _kept_tracks(self, owner: Owner) -> list[list[int]]:
        """The tracks that are given, without the places that would meet others there by now."""
        found: list[list[int]] = []
        index = self.net.place_index
        for names in self.given.tracks.get(owner, ()):
            track: list[int] = []
            for p in (index[name] for name in names if name in index and self.net.places[index[name]].owner == owner):
                if not any(self._overlap(p, other) for other in track):
                    track.append(p)
            found += [track] if track else []
        return found

    def _lanes_with_bare_parts(self) -> set[int]:
        """The lanes in which a transition has a part but no place: such a part gets a track without places."""
        found: set[int] = set()
        for t, lanes in enumerate(self.participants):
            reached = {
                self.owners.index(self.net.places[p].owner)
                for p, edges in enumerate(self.incident)
                if any(u == t for u, _ in edges)
            }
            found |= lanes - reached
        return found

    def _overlap(self, p: int, q: int) -> bool:
        (p_first, p_last), (q_first, q_last) = self._extent(p), self._extent(q)
        return p_first < q_last and q_first < p_last

    def _ordered(self, tracks: list[list[int]]) -> list[list[int]]:
        """The tracks of each lane in the order with the fewest crossings of bars, improved lane by lane."""
        order = list(range(len(tracks)))
        for lane in range(len(self.owners)):
            mine = [i for i, track in enumerate(order) if self.lane_of_track[track] == lane]
            if not 1 < len(mine) <= _TRACKS_PERMUTED_MAX or self.owners[lane] in self.given.tracks:
                continue
            first, last = mine[0], mine[-1] + 1
            candidates = ([*order[:first], *some, *order[last:]] for some in permutations(order[first:last]))
            here = [p for track in order[first:last] for p in tracks[track]]
            order = min(candidates, key=partial(self._crossings, tracks=tracks, here=here))
        return [tracks[track] for track in order]

    def _crossings(self, order: Sequence[int], tracks: Sequence[Sequence[int]], here: Sequence[int]) -> int:
        """How many bars the edges of the places of one lane cross; to the others its order makes no difference."""
        position = {p: i for i, track in enumerate(order) for p in tracks[track]}
        reach: dict[int, list[int]] = {}
        for p, edges in enumerate(self.incident):
            for t, _ in edges:
                reach.setdefault(t, []).append(position[p])
        crossings = 0
        for p in here:
            first, last = self._extent(p)
            touched = {t for t, _ in self.incident[p]}
            crossings += sum(
                first < self.rows[t] < last and min(at) < position[p] < max(at)
                for t, at in reach.items()
                if t not in touched
            )
        return crossings

    def layout(self) -> Layout:
        """Turn rows, gaps and tracks into pixels."""
        net = self.net
        occupied = set(self.gaps)
        y_of_row = [_TITLE_HEIGHT + _HEADER_HEIGHT]
        for gap in range(self.row_count + 1):
            empty = _EMPTY_ROW_HEIGHT if 0 < gap < self.row_count else _EDGE_ROW_HEIGHT
            y_of_row.append(y_of_row[-1] + (max(_ROW_HEIGHT, self._room(gap)) if gap in occupied else empty))
        bypass = self._bypasses()
        lanes, centre, margin, width = self._columns(bypass)
        places = tuple(
            Spot(
                centre[self.track_of[p]],
                (y_of_row[self.gaps[p]] + y_of_row[self.gaps[p] + 1]) / 2,
                self._place_words(p),
                place.name in self.members,
            )
            for p, place in enumerate(net.places)
        )
        edges = tuple(
            Edge(p, t, kind, places[p].x - (BYPASS_FIRST + (n - 1) * BYPASS_STEP if n else 0.0), n)
            for p, t, kind, n in bypass
        )
        stubs = tuple(
            Stub(t, gate.gate, gate.label, centre[gate.track], gate.slot)
            for t, gates in enumerate(self.gates)
            for gate in gates
        )
        bars = tuple(self._bar(t, y_of_row[self.rows[t]], edges, centre) for t in range(len(net.transitions)))
        return Layout(lanes, places, bars, edges, stubs, margin, _TITLE_HEIGHT, y_of_row[-1], width)

    def _room(self, gap: int) -> float:
        """The height of a gap in which no words of a place touch the signals at the bars below, on its track."""
        slots: dict[int, int] = {}
        for t, gates in enumerate(self.gates):
            for gate in gates if self.rows[t] == gap + 1 else ():
                slots[gate.track] = max(slots.get(gate.track, 0), gate.slot)
        beside = [p for p, of in enumerate(self.gaps) if of == gap and self.track_of[p] in slots]
        halves = (len(self._place_words(p)) * WORDS_LINE / 2 + slots[self.track_of[p]] * STUB_LINE for p in beside)
        return 2 * (max(halves, default=0.0) + _WORDS_APART)

    def _bypasses(self) -> list[tuple[int, int, Kind, int]]:
        found = []
        for p, edges in enumerate(self.incident):
            gap = self.gaps[p]
            above = sorted((e for e in edges if self.rows[e[0]] <= gap), key=lambda e: -self.rows[e[0]])
            below = sorted((e for e in edges if self.rows[e[0]] > gap), key=lambda e: self.rows[e[0]])
            found += [(p, t, kind, n) for side in (above, below) for n, (t, kind) in enumerate(side)]
        return found

    def _columns(
        self, bypass: Sequence[tuple[int, int, Kind, int]]
    ) -> tuple[tuple[Lane, ...], list[float], float, float]:
        """The lanes, the centre of each track, the width of the labels on the left, and of the drawing."""
        net = self.net
        left = [BAR_HALF_WIDTH] * len(self.tracks)
        right = [BAR_HALF_WIDTH] * len(self.tracks)
        for p, _, _, n in bypass:
            track = self.track_of[p]
            left[track] = max(left[track], BYPASS_FIRST + (n - 1) * BYPASS_STEP + 8 if n else 0)
        for p, place in enumerate(net.places):
            track = self.track_of[p]
            extra = 12 if place.command else 0
            widest = max(
                width_of(text, style) + (extra if style is COMMAND else 0) for text, style in self._place_words(p)
            )
            right[track] = max(right[track], LABEL_LEFT + widest)
        for gate in (gate for gates in self.gates for gate in gates):
            right[gate.track] = max(right[gate.track], BAR_HALF_WIDTH + 14 + width_of(gate.label, COMMAND))
        wide = self.in_margin
        for t in range(len(net.transitions)):
            if t not in wide:
                track = max(self.attached[t])
                lines = self._words(t)
                right[track] = max(right[track], BAR_HALF_WIDTH + 8 + max(width_of(*line) for line in lines))
        margin = max((width_of(*line) for t in wide for line in self._words(t)), default=0.0)
        x = _MARGIN + (margin + 24 if wide else 0.0)
        lanes, centre = [], []
        for lane, owner in enumerate(self.owners):
            start = x
            x += _LANE_PADDING
            for track in (track for track, of in enumerate(self.lane_of_track) if of == lane):
                centre.append(x + left[track])
                x += left[track] + right[track] + 10
            title = width_of(owner or "", NAME) * 1.25 + 2 * _LANE_PADDING
            controller = next((c for c in net.controllers if c.name == owner), None)
            note = width_of(controller.description, NOTE) + 2 * _LANE_PADDING if controller else 0.0
            x = max(x + _LANE_PADDING - 10, start + title, start + note)
            lanes.append(Lane(owner, start, x - start))
            x += _LANE_GAP
        return tuple(lanes), centre, margin, x - _LANE_GAP + _MARGIN

    def _gates(self) -> list[list[_Gate]]:
        """The external gates of each transition."""
        found: list[list[_Gate]] = []
        for t, transition in enumerate(self.net.transitions):
            slots: dict[int, int] = {}
            gates = []
            for gate in transition.external:
                track = self._track_of_gate(t, gate)
                slot = slots[track] = slots.get(track, -1) + 1
                gates.append(_Gate(gate, local_name(gate.signal, self.net.signal(gate.signal).owner), track, slot))
            found.append(gates)
        return found

    def _track_of_gate(self, t: int, gate: ExternalGate) -> int:
        """A completion or timer stands at the place of its command, another gate at its owner's first track."""
        transition, owner = self.net.transitions[t], self.net.signal(gate.signal).owner
        for name in transition.inputs:
            if gate.signal in self.net.place(name).cleared:
                return self.track_of[self.net.place_index[name]]
        lane = self.owners.index(owner)
        names = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
        there = [self.track_of[self.net.place_index[name]] for name in names if self.net.place(name).owner == owner]
        return min(there, default=self._spare(lane))

    def _spare(self, lane: int) -> int:
        """The last track of a lane: the one without places, where a part of the lane has none."""
        return max(track for track, of in enumerate(self.lane_of_track) if of == lane)

    def _bar(self, t: int, y: float, edges: Sequence[Edge], centre: Sequence[float]) -> Bar:
        """The bar: one segment for neighbouring tracks of a lane, unless the line of another edge passes between."""
        reach = {track: (centre[track] - BAR_HALF_WIDTH, centre[track] + BAR_HALF_WIDTH) for track in self.attached[t]}
        for edge in edges:
            if edge.transition == t and edge.bypass:
                track = self.track_of[edge.place]
                reach[track] = (min(reach[track][0], edge.x - _BYPASS_HALF_WIDTH), reach[track][1])
        passing = [edge.x for edge in edges if self._passes(edge, self.rows[t])]
        segments: list[tuple[float, float]] = []
        last = -1
        for track, (start, end) in sorted(reach.items()):
            together = last >= 0 and self.lane_of_track[last] == self.lane_of_track[track]
            if together and not any(segments[-1][0] < x < end for x in passing):
                segments[-1] = (segments[-1][0], end)
            else:
                segments.append((start, end))
            last = track
        return Bar(y, tuple(segments), self.is_global[t], t in self.in_margin, self._words(t))

    def _passes(self, edge: Edge, row: int) -> bool:
        """Whether the line of an edge passes a row without ending there."""
        end, gap = self.rows[edge.transition], self.gaps[edge.place]
        return gap < row < end if end > gap else end < row <= gap
