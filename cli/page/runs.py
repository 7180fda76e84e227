"""Counterexamples drawn: a strip with a row for each step and a lane for each controller.

What an engineer asks of a run is who does what when, and what changed by it. So each step says in the lane of each
controller which tokens left and which came, and which command was sent; what does not change is not shown. The marking
at the end stands in the same lanes. The reference player fires the run once more for this; where it cannot, because
the run is of another kind (of a protocol: `swimlanes`), the steps are told without lanes. What machines and workpieces
do stands in words, in a lane of its own.

Rejected: the net drawn once for each step. The picture of a cell fills a screen; thirty of them are no strip, and the
eye would have to find the difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from firable.cli.page.markup import Markup, tag, together
from firable.nets.decomposition import Decomposition
from firable.nets.drawing import Frame
from firable.nets.drawing.labels import local_name
from firable.nets.machines.loop import PLANT, UNSENT
from firable.nets.net import Marking, Net, Place
from firable.nets.verdict import Witness
from firable.semantics.frames import frames
from firable.semantics.player import NotFirableError

STEPS_SHOWN_MAX: Final = 240
_LANES_MAX: Final = 8
_UNOWNED: Final = "without a controller"


@dataclass(frozen=True)
class _Drawn:
    """What a strip is drawn of."""

    net: Net
    cell: Net
    lanes: tuple[str, ...]
    decomposition: Decomposition | None

    def title(self, name: str) -> Markup:
        """A transition that fired: its name in the cell, or in words what a machine did."""
        own = next((one for one in (name, name.partition("/")[0]) if one in self.cell.transition_index), "")
        description = self.net.transition(name).description
        if not own and description:
            return tag("b", description)
        return together(tag("b", own or name), tag("span", description, cls="says") if description else None)


def strip(net: Net, witness: Witness, cell: Net, decomposition: Decomposition | None = None) -> Markup:
    """A witness as markup: its values where it has no run, else its steps in lanes, or its steps alone.

    `net` is what the run is of: the `cell` itself, or the cell with its machines.
    """
    if witness.assignment:
        return _values(witness)
    steps = played(net, witness)
    if steps is None:
        return together(_told(witness), _note(witness))
    lanes = _lanes(net, steps)
    n = len(witness.firings)
    drawn = _Drawn(net, cell, lanes, decomposition)
    rows = [*_rows(drawn, steps[:n])]
    if witness.cycle:
        rows.append(across("and then for ever again", lanes))
        rows += _rows(drawn, steps[n:])
    end = steps[-1].after if steps else net.initial_marking
    head = tag("tr", tag("th", "step", scope="col"), *(tag("th", lane, scope="col") for lane in lanes))
    table = tag(
        "table",
        tag("caption", "Each step with the tokens that leave (○) and come (●), by controller", cls="unseen"),
        tag("thead", head),
        tag("tbody", rows or [across("already in the initial marking", lanes)]),
        tag("tfoot", _end(net, end, lanes)),
        cls="strip stack",
    )
    return together(
        tag("div", table, cls="wide", tabindex="0", role="region", aria_label="run, step by step"), _note(witness)
    )


def _values(witness: Witness) -> Markup:
    rows = [tag("tr", tag("td", name, cls="code"), tag("td", str(int(value)))) for name, value in witness.assignment]
    head = tag("tr", tag("th", "name", scope="col"), tag("th", "value", scope="col"))
    return together(
        tag("p", "These values of the net's own names refute it:"),
        tag("table", tag("thead", head), tag("tbody", rows), cls="values"),
        _note(witness),
    )


def _note(witness: Witness) -> Markup | None:
    return tag("p", witness.note, cls="outcome") if witness.note else None


def _told(witness: Witness) -> Markup:
    """The steps of a run that is none of the net."""
    items = [tag("li", ", ".join(fired)) for fired in witness.firings[:STEPS_SHOWN_MAX]]
    more = len(witness.firings) - len(items)
    rest = tag("p", f"and {more:,} more steps") if more > 0 else None
    again = [tag("li", ", ".join(fired)) for fired in witness.cycle]
    cycle = together(tag("p", "and then for ever again"), tag("ol", again)) if again else None
    return together(tag("ol", items, cls="told"), rest, cycle)


def played(net: Net, witness: Witness) -> list[Frame] | None:
    """The steps of a run as the reference player fires it; None where it cannot."""
    try:
        return frames(net, (*witness.firings, *witness.cycle))
    except (KeyError, NotFirableError):
        return None


def _lane_of(place: Place) -> str:
    return place.owner or _UNOWNED


def _lanes(net: Net, steps: Sequence[Frame]) -> tuple[str, ...]:
    """All controllers, or of many those that the run touches."""
    names = [controller.name for controller in net.controllers]
    if any(place.owner is None for place in net.places):
        names.append(_UNOWNED)
    if len(names) <= _LANES_MAX:
        return tuple(names)
    changed = 0
    for step in steps:
        changed |= step.before ^ step.after
    touched = {_lane_of(place) for p, place in enumerate(net.places) if changed >> p & 1}
    return tuple(name for name in names if name in touched)


def _rows(drawn: _Drawn, steps: Sequence[Frame]) -> Iterator[Markup]:
    left_out = len(steps) - STEPS_SHOWN_MAX
    if left_out <= 0:
        yield from (_row(drawn, step) for step in steps)
        return
    yield from (_row(drawn, step) for step in steps[: STEPS_SHOWN_MAX // 2])
    yield across(f"{left_out:,} steps are left out here", drawn.lanes)
    yield from (_row(drawn, step) for step in steps[-(STEPS_SHOWN_MAX // 2) :])


def _row(drawn: _Drawn, step: Frame) -> Markup:
    names = tag("div", *map(drawn.title, step.fired))
    head = tag("th", tag("span", f"{step.number}", cls="number"), names, scope="row")
    parts = _parts(step.fired, drawn.decomposition)
    cells = (tag("td", _changes(drawn.net, step, lane, parts.get(lane, ())), data_of=lane) for lane in drawn.lanes)
    return tag("tr", head, *cells)


def _parts(fired: Iterable[str], decomposition: Decomposition | None) -> dict[str, tuple[str, ...]]:
    """The parts of the transitions that fired, by their controllers; a variant of a loop stands for its transition."""
    found: dict[str, tuple[str, ...]] = {}
    rows = {row.name: row for row in decomposition.coordinated} if decomposition else {}
    for name in fired:
        row = rows.get(name) or rows.get(name.partition("/")[0])
        for part in row.parts if row is not None and row.is_global else ():
            found[part.controller] = (*found.get(part.controller, ()), part.name)
    return found


def _changes(net: Net, step: Frame, lane: str, parts: tuple[str, ...]) -> list[Markup]:
    written = [tag("span", part, cls="part") for part in parts]
    for p, place in enumerate(net.places):
        before, after = step.before >> p & 1, step.after >> p & 1
        if _lane_of(place) != lane or before == after:
            continue
        if lane == PLANT:
            # Of what has one of several values only the new one is told, in words.
            written += [_word(place)] if after else []
            continue
        written.append(token(place, comes=bool(after)))
        # In a loop where commands are sent late, sending is a step of its own.
        if after and place.command is not None and f"{UNSENT}.{place.name}" not in net.place_index:
            written.append(tag("span", tag("span", "sends ", cls="unseen"), str(place.command), cls="sends"))
    return written


def _word(place: Place) -> Markup:
    return tag("span", tag("span", "● ", aria_hidden="true"), place.description or place.name, cls="fact")


def token(place: Place, *, comes: bool) -> Markup:
    """A token that comes to a place or leaves it."""
    word = "comes to " if comes else "leaves "
    sign = "●" if comes else "○"
    name = local_name(place.name, place.owner)
    hidden = tag("span", word, cls="unseen")
    return tag(
        "span",
        tag("span", sign, aria_hidden="true"),
        hidden,
        name,
        cls="comes" if comes else "leaves",
        title=place.description or None,
    )


def _end(net: Net, marking: Marking, lanes: tuple[str, ...]) -> Markup:
    cells = []
    for lane in lanes:
        news = marking & ~net.initial_marking if lane == PLANT else marking
        held = [place for p, place in enumerate(net.places) if news >> p & 1 and _lane_of(place) == lane]
        if lane == PLANT:
            cells.append(tag("td", map(_word, held), data_of=lane))
        else:
            names = [tag("span", local_name(place.name, place.owner), cls="held") for place in held]
            cells.append(tag("td", names, data_of=lane))
    return tag("tr", tag("th", tag("span", "●", cls="number", aria_hidden="true"), "at the end", scope="row"), *cells)


def across(words: str, lanes: Sequence[str]) -> Markup:
    """A row of words across all lanes."""
    return tag("tr", tag("td", words, colspan=str(len(lanes) + 1), cls="across"))
