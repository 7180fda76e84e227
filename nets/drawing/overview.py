"""The overview of a net: which controllers there are, where each of them stands, and who meets whom in what.

It is written like a score. Each controller is a line across the page, with its name, what it owns, and where its tokens
are; those under a coordinator stand below it, indented and in its colour. Each transition in which several take part is
a bar down the page, thick in the lines of those who do, with its name above it. What belongs to one controller alone is
counted and not drawn: that is looked for in the picture of the controller. Lines and bars each stand beside those that
they have to do with, in an order that follows the work. Where the bars are wider than the sheet, they go on below, with
the lines of those alone who take part there: so a picture of a hundred controllers is long, and never small.

The idea is that of drawing a hypergraph as parallel lines (Valdivia, Buono, Plaisant, Dufournaud, Fekete: Analyzing
Dynamic Hypergraphs with PAOH, 2021). Rejected: boxes joined by lines. A transition of four controllers would be six
lines, a conveyor that everybody meets the middle of a knot, and what a line stands for a number beside it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from firable.nets.drawing.arrangement import Owner
from firable.nets.drawing.colours import colours
from firable.nets.drawing.labels import local_name
from firable.nets.drawing.legend import ROW_HEIGHT, legend, legend_rows
from firable.nets.drawing.panels import panels
from firable.nets.drawing.part import everybody, owners_of
from firable.nets.drawing.rows import depths, followed, grown, lane_order
from firable.nets.drawing.shapes import BAR_HALF_HEIGHT
from firable.nets.drawing.sheet import MARGIN, TOP, least_width, opening, scoped
from firable.nets.drawing.styles import STYLE
from firable.nets.drawing.text import NAME, NOTE, Style, width_of
from firable.nets.drawing.xml import esc, ident, px
from firable.nets.layers import Layers
from firable.nets.net import Marking, Net

WIDTH_MAX: Final = 1300.0
"""How wide an overview gets before its bars go on below, in pixels: what a window shows."""
LINES_MAX: Final = 1000
"""How many controllers and shared transitions an overview shows at most."""
_LINE: Final = 22.0
_COLUMN: Final = 15.0
_INDENT: Final = 14.0
_NUMBER: Final = 46.0
_HELD: Final = 132.0
_PADDING: Final = 10.0
_SYSTEM_GAP: Final = 16.0
_LABEL: Final = Style("label", 6.7)
_LABEL_CHARACTERS: Final = 22
_HELD_CHARACTERS: Final = 20

_HEADS: Final = (
    ("places", "the places that it owns"),
    ("alone", "the transitions that are its own"),
    ("shared", "the transitions that it shares with others"),
)
_STYLE: Final = """
.label{font-size:10.5px;font-weight:600}
.held{font-size:11.5px}
""".strip()


@dataclass(frozen=True, slots=True)
class _Line:
    """A controller, or what nobody owns: how deep it stands under coordinators, its colour, and what it owns."""

    owner: Owner
    depth: int
    tint: int
    n_places: int
    n_alone: int
    n_shared: int


def draw_overview(
    net: Net,
    *,
    marking: Marking | None = None,
    firings: Sequence[Iterable[str]] = (),
    caption: str = "",
    width_max: float = WIDTH_MAX,
) -> str:
    """The controllers of a net and the transitions that they share, as SVG.

    `marking`, `firings` and `caption` are those of `draw_net`; bars that are wider than `width_max`, in pixels, go on
    below. Ids: `controller:robot` for the head of a line, `held:robot` for where its tokens are, `transition:G2` for a
    bar. What stands in a second system again bears its number behind its id: `controller:robot:2`.

    >>> draw_overview(Net("empty")).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    return "\n".join(_Writer(net, marking, firings, caption, width_max).lines()) + "\n"


def has_overview(net: Net) -> bool:
    """Whether an overview shows something of a net: several controllers own it, and not too many to look through."""
    owners = owners_of(net)
    n_lines = len(net.controllers) + (None in owners) + sum(len(some) > 1 for some in everybody(net).values())
    return len(owners) > 1 and n_lines <= LINES_MAX


class _Writer:
    """One overview."""

    def __init__(
        self,
        net: Net,
        marking: Marking | None,
        firings: Sequence[Iterable[str]],
        caption: str,
        width_max: float,
    ) -> None:
        self.net = net
        self.participants = everybody(net)
        self.staves = list(self._staves())
        self.line_of = {line.owner: i for i, line in enumerate(self.staves)}
        self.columns = self._columns()
        self.steps: dict[str, list[int]] = {}
        for k, fired in enumerate(firings, start=1):
            for name in fired:
                self.steps.setdefault(name, []).append(k)
        self.held: dict[Owner, list[str]] = {}
        for name in net.names(net.initial_marking if marking is None else marking):
            owner = net.place(name).owner
            self.held.setdefault(owner, []).append(local_name(name, owner))
        self.roles = {c.name: "coordinator" for c in net.controllers if c.coordinator}
        names = [self._name_width(line) for line in self.staves]
        self.numbers_x = MARGIN + _PADDING + max([0.0, *names]) + 4
        self.first_x = self.numbers_x + 3 * _NUMBER + 14 + _HELD
        self.caption = caption or net.description or self._counted()
        self.systems = self._systems(max(width_max - self.first_x - MARGIN, _COLUMN))
        broadest = max([0, *(len(columns) for columns, _ in self.systems)])
        right = self.first_x + broadest * _COLUMN + _PADDING
        self.width = max(right + MARGIN, least_width(net.name, self.caption), 480.0)
        self.right = self.width - MARGIN

    def _name_width(self, line: _Line) -> float:
        role = self.roles.get(line.owner or "", "")
        return _INDENT * line.depth + width_of(_called(line.owner), NAME) + width_of(role, NOTE)

    def _counted(self) -> str:
        net = self.net
        counts = (len(self.staves), "controllers"), (len(net.places), "places"), (len(net.transitions), "transitions")
        return f"Overview: {', '.join(f'{n:,} {of}' for n, of in counts)}, {len(self.columns):,} of them shared"

    def _staves(self) -> Iterator[_Line]:
        """The lines from above: those who meet stand together, and each coordinator above those under it."""
        net, layers = self.net, Layers(self.net)
        owners: list[Owner] = [controller.name for controller in net.controllers]
        owners += [None] if None in owners_of(net) else []
        index = {owner: i for i, owner in enumerate(owners)}
        taking = [frozenset(index[owner] for owner in some) for some in self.participants.values()]
        place = {owners[lane]: i for i, lane in enumerate(lane_order(taking, len(owners)))}
        n_places = Counter(place.owner for place in net.places)
        alone = Counter(owner for some in self.participants.values() if len(some) == 1 for owner in some)
        shared = Counter(owner for some in self.participants.values() if len(some) > 1 for owner in some)
        first: dict[str, int] = {}
        for owner in sorted((owner for owner in owners if owner is not None), key=place.__getitem__):
            for above in layers.up(owner):
                first.setdefault(above, place[owner])
        tint = -1

        def line(owner: Owner, depth: int) -> _Line:
            return _Line(owner, depth, tint, n_places[owner], alone[owner], shared[owner])

        waiting = [(layers.root, 0)]
        while waiting:
            name, depth = waiting.pop()
            tint += depth < 2  # what is under a coordinator below the root has its colour
            if name in index:
                yield line(name, max(0, depth - (layers.root not in index)))
            under = sorted(layers.children.get(name, ()), key=first.__getitem__)
            waiting += [(child, depth + 1) for child in reversed(under)]
        if None in index:
            tint += 1
            yield line(None, 0)

    def _columns(self) -> list[int]:
        """The transitions that are shared, each behind what it follows, and beside those that have to do with it."""
        deep = depths(self.net)
        names = [t.name for t in self.net.transitions]
        shared = [t for t, name in enumerate(names) if len(self.participants[name]) > 1]
        shared.sort(key=lambda t: (deep[t], t))
        meeting: dict[Owner, set[int]] = {}
        for i, t in enumerate(shared):
            for owner in self.participants[names[t]]:
                meeting.setdefault(owner, set()).add(i)
        of_owner = [frozenset(meeting[line.owner]) for line in self.staves if line.owner in meeting]
        return [shared[i] for i in grown(of_owner, len(shared), 0, followed(self.net, shared))] if shared else []

    def _taking(self, t: int) -> list[int]:
        """The lines of those who take part in a transition, from above."""
        return sorted(self.line_of[owner] for owner in self.participants[self.net.transitions[t].name])

    def _systems(self, room: float) -> list[tuple[list[int], list[int]]]:
        """The columns and the lines of each system; who meets nobody stands in the first."""
        users: list[set[int]] = [set() for _ in self.staves]
        for column, t in enumerate(self.columns):
            for i in self._taking(t):
                users[i].add(column)
        found: list[tuple[list[int], list[int]]] = []
        for some in panels([_COLUMN] * len(self.columns), room, 0.0, users) or [range(0)]:
            here = [i for i, used in enumerate(users) if used.intersection(some) or (not found and not used)]
            found.append((list(some), here))
        return found

    def lines(self) -> Iterator[str]:
        """The picture, line by line."""
        items = [("global", "transition: a part in each controller that shares it")] if self.columns else []
        items += [("fired", "fired, in these steps")] if self.steps.keys() & self._shared() else []
        rows = legend_rows(items, self.width) if items else []
        body: list[str] = []
        seen: set[Owner] = set()
        y = TOP
        for number, (columns, staves) in enumerate(self.systems, start=1):
            at = {i: k for k, i in enumerate(staves)}
            above = [self._label_room(c) - _LINE * at[self._taking(self.columns[c])[0]] for c in columns]
            y += max([18.0, *above])
            body += self._system(columns, at, y, number, seen)
            seen |= {self.staves[i].owner for i in staves}
            y += _LINE * len(staves) + max([0.0, *(self._step_room(c, at, len(staves)) for c in columns)])
            y += _SYSTEM_GAP
        height = y + 10 + ROW_HEIGHT * len(rows)
        style, name = f"{STYLE}\n{scoped('overview', _STYLE)}", self.net.name
        yield from opening(self.width, height, style, name, name, self.caption, self.net.description, scope="overview")
        yield from body
        yield from legend(rows, y - 16)
        yield "</svg>"

    def _shared(self) -> set[str]:
        return {self.net.transitions[t].name for t in self.columns}

    def _label_room(self, column: int) -> float:
        return width_of(_cut(self.net.transitions[self.columns[column]].name, _LABEL_CHARACTERS), _LABEL) + 6

    def _step_room(self, column: int, at: Mapping[int, int], n_lines: int) -> float:
        """How far the steps in which a transition has fired reach below the lines."""
        t = self.columns[column]
        steps = self.steps.get(self.net.transitions[t].name)
        if not steps:
            return 0.0
        return width_of(_steps(steps), NOTE) + 8 - _LINE * (n_lines - 1 - at[self._taking(t)[-1]])

    def _system(
        self, columns: Sequence[int], at: Mapping[int, int], y: float, number: int, seen: set[Owner]
    ) -> Iterator[str]:
        for k, (words, hint) in enumerate(_HEADS, start=1):
            x = px(self.numbers_x + k * _NUMBER)
            yield f'<text class="note" x="{x}" y="{px(y - 6)}" text-anchor="end">{words}<title>{hint}</title></text>'
        yield f'<text class="note" x="{px(self.first_x - _HELD)}" y="{px(y - 6)}">tokens on</text>'
        for i, k in at.items():
            yield from self._head(self.staves[i], y + k * _LINE, number, seen)
        for n, column in enumerate(columns):
            yield from self._bar(self.columns[column], self.first_x + (n + 0.5) * _COLUMN, y, at)

    def _head(self, line: _Line, y: float, number: int, seen: set[Owner]) -> Iterator[str]:
        """The line of a controller, with what is said of it at the left."""
        fill, stroke = colours(line.tint, line.owner)
        again = [str(number)] if line.owner in seen else []
        size = f'width="{px(self.right - MARGIN)}" height="{px(_LINE - 2)}"'
        baseline = y + _LINE / 2 + 4.5
        controller = next((c for c in self.net.controllers if c.name == line.owner), None)
        hint = " — ".join(filter(None, (_called(line.owner), controller.description if controller else "")))
        yield f"<g {ident('controller', line.owner or '', *again)}><title>{esc(hint)}</title>"
        yield (f'<rect class="line" x="{px(MARGIN)}" y="{px(y + 1)}" {size} rx="5" fill="{fill}" stroke="{stroke}"/>')
        x = MARGIN + _PADDING + _INDENT * line.depth
        role = self.roles.get(line.owner or "", "")
        role = role and f'<tspan class="note" dx="4" font-weight="400">{role}</tspan>'
        yield f'<text class="name" x="{px(x)}" y="{px(baseline)}">{esc(_called(line.owner))}{role}</text>'
        for k, count in enumerate((line.n_places, line.n_alone, line.n_shared), start=1):
            x = self.numbers_x + k * _NUMBER
            said = f"{count:,}" if count else "–"
            yield f'<text class="note" x="{px(x)}" y="{px(baseline - 0.5)}" text-anchor="end">{said}</text>'
        held = self.held.get(line.owner, [])
        x = self.first_x - _HELD
        yield (
            f'<text {ident("held", line.owner or "", *again)} class="held" x="{px(x)}" y="{px(baseline - 0.5)}">'
            f"{esc(where(held))}</text></g>"
        )

    def _bar(self, t: int, x: float, top: float, at: Mapping[int, int]) -> Iterator[str]:
        """A transition: thick in the lines of those who take part, tied together, its name above the first."""
        transition = self.net.transitions[t]
        steps = self.steps.get(transition.name, ())
        parts = [top + at[i] * _LINE for i in self._taking(t)]
        who = ", ".join(sorted(_called(owner) for owner in self.participants[transition.name]))
        number = f" (number {transition.number})" if transition.number is not None else ""
        told = filter(None, (f"{transition.name}{number}", transition.description, who))
        yield f"<g {ident('transition', transition.name)}><title>{esc(chr(10).join(told))}</title>"
        yield f'<path class="tie" d="M{px(x)} {px(parts[0] + _LINE / 2)}V{px(parts[-1] + _LINE / 2)}"/>'
        css = "fired" if steps else "bar"
        for y in parts:
            size = f'width="{px(2 * BAR_HALF_HEIGHT)}" height="{px(_LINE - 8)}"'
            yield f'<rect class="{css}" x="{px(x - BAR_HALF_HEIGHT)}" y="{px(y + 4)}" {size} rx="1.5"/>'
        name = esc(_cut(transition.name, _LABEL_CHARACTERS))
        yield f'<text class="label" transform="translate({px(x + 3.7)} {px(parts[0] - 1)}) rotate(-90)">{name}</text>'
        if steps:
            where_to = f"translate({px(x + 3.7)} {px(parts[-1] + _LINE + 1)}) rotate(-90)"
            yield f'<text class="step" text-anchor="end" transform="{where_to}">{_steps(steps)}</text>'
        yield "</g>"


def where(held: Sequence[str]) -> str:
    """Where the tokens of a controller are, in a few characters: on the first of these places, and on how many more.

    >>> where(["cv1", "cv2", "cv3"])
    'cv1 +2'
    """
    more = f" +{len(held) - 1:,}" if len(held) > 1 else ""
    return f"{_cut(held[0], _HELD_CHARACTERS - len(more))}{more}" if held else ""


def _called(owner: Owner) -> str:
    return "no controller" if owner is None else owner


def _cut(text: str, characters: int) -> str:
    return text if len(text) <= characters else f"{text[: characters - 1]}…"


def _steps(steps: Sequence[int]) -> str:
    return ", ".join(map(str, steps[:4])) + (", …" if len(steps) > 4 else "")
