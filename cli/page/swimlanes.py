"""Runs of a protocol: a row for each event, in the lane of who takes it.

A run of the protocol is a run of a net of its own, whose places are promises, messages and a copy of the central net,
and belong to no controller. What is to be seen is who does what after what: so each event stands in words in the lane
of the controller that acts, of its coordinator, or of nobody where a message is lost or comes late. Beside it stand
the tokens that the controllers gain and lose, each in the lane of its owner; what the central net holds meanwhile is
told by the last event, or by the sentence below the run. The step record beside the net says who acts.

Rejected: owners for the places of the protocol's net. They would say where a message lies, not who acts, and a promise
would push the tokens of the cell out of sight. Of a long run the end tells what goes wrong; the head is folded away.
Where rounds that nothing disturbs are told as one line, that line is a row: its lanes show what all its events moved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from firable.cli.page.markup import Markup, tag, together
from firable.cli.page.runs import across, played, token
from firable.nets.drawing import Frame
from firable.nets.verdict import Witness

if TYPE_CHECKING:
    from firable.decompose.protocol.building import ProtocolNet
    from firable.decompose.protocol.directed import Line

TOLD_MAX: Final = 40
"""How many events a run may have and stand there whole."""
TAIL: Final = 12
"""How many events stand open of a run that is longer."""
_COORDINATOR: Final = "the coordinator"
_NOBODY: Final = "on the way"


def swimlanes(protocol: ProtocolNet, witness: Witness, lines: Sequence[Line] = ()) -> Markup | None:
    """A run of a protocol as markup, told in `lines` where there are any; None for a run of another net."""
    steps = played(protocol.net, witness)
    if steps is None:
        return None
    lanes = _lanes(protocol, steps)
    rows = list(_rows(protocol, steps, lines, lanes))
    n = len(rows) - len(witness.cycle)
    if witness.cycle:
        rows.insert(n, across("and then for ever again", lanes))
    hidden = 0 if len(rows) <= TOLD_MAX else len(rows) - TAIL
    end = steps[-1].after if steps else protocol.net.initial_marking
    head = tag("details", tag("summary", f"the first {hidden} events"), _table(rows[:hidden], lanes), cls="head")
    return together(head if hidden else None, _table(rows[hidden:], lanes, _end(protocol, end, lanes)))


def _table(rows: Sequence[Markup], lanes: Sequence[str], foot: Markup | None = None) -> Markup:
    table = tag(
        "table",
        tag("caption", "Each event in the lane of who acts, with the tokens that leave (○) and come (●)", cls="unseen"),
        tag("thead", tag("tr", tag("th", "event", scope="col"), *(tag("th", lane, scope="col") for lane in lanes))),
        tag("tbody", rows),
        tag("tfoot", foot) if foot else None,
        cls="strip lanes stack",
    )
    return tag("div", table, cls="wide", tabindex="0", role="region", aria_label="run, event by event")


def _actor(protocol: ProtocolNet, step: Frame) -> str:

    of = protocol.steps[step.fired[0]]
    return of.controller or of.coordinator or _NOBODY


def _lanes(protocol: ProtocolNet, steps: Sequence[Frame]) -> tuple[str, ...]:
    """Who acts in the run, in the order of the cell, coordinators first, and whose tokens change."""
    touched = {_actor(protocol, step) for step in steps}
    touched |= {lane for step in steps for lane, _ in _changes(protocol, step)}
    names = (
        _COORDINATOR,
        *protocol.parts.deciders,
        *(controller.name for controller in protocol.parts.net.controllers),
        _NOBODY,
    )
    return tuple(name for name in dict.fromkeys(names) if name in touched)


def _changes(protocol: ProtocolNet, step: Frame) -> list[tuple[str, Markup]]:
    """The tokens of controllers that change, each with its lane."""
    found, net = [], protocol.net
    for place in protocol.parts.net.places:
        p = net.place_index[place.name]
        before, after = step.before >> p & 1, step.after >> p & 1
        if before != after:
            found.append((place.owner or _COORDINATOR, token(place, comes=bool(after))))
    return found


def _rows(
    protocol: ProtocolNet, steps: Sequence[Frame], lines: Sequence[Line], lanes: Sequence[str]
) -> Iterator[Markup]:
    """A row for each line, and for each event that no line tells."""
    i = 0
    for line in lines:
        some = steps[i : i + line.events]
        i += line.events
        if line.leaps:
            yield _row(protocol, replace(some[-1], before=some[0].before), lanes, f"{some[0].number}-", line.text)
        else:
            yield from (_row(protocol, step, lanes) for step in some)
    yield from (_row(protocol, step, lanes) for step in steps[i:])


def _row(protocol: ProtocolNet, step: Frame, lanes: Sequence[str], since: str = "", text: str = "") -> Markup:
    cells: dict[str, list[Markup]] = {lane: [] for lane in lanes}
    cells[_actor(protocol, step)].append(tag("span", text or str(protocol.steps[step.fired[0]])))
    for lane, written in _changes(protocol, step):
        cells[lane].append(written)
    head = tag("th", tag("span", f"{since}{step.number}", cls="number"), scope="row")
    return tag("tr", head, *(tag("td", cells[lane], data_of=lane) for lane in lanes))


def _end(protocol: ProtocolNet, marking: int, lanes: Sequence[str]) -> Markup:
    from firable.nets.drawing.labels import local_name

    index = protocol.net.place_index
    cells = []
    for lane in lanes:
        held = [
            tag("span", local_name(place.name, place.owner), cls="held")
            for place in protocol.parts.net.places
            if (place.owner or _COORDINATOR) == lane and marking >> index[place.name] & 1
        ]
        cells.append(tag("td", held, data_of=lane))
    return tag("tr", tag("th", "at the end", scope="row"), *cells)
