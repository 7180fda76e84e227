"""What `firable draw` draws: a net, its reachability graph, its coordinator diagram, a run as a strip.

Pictures are made in `firable.nets.drawing`, which knows markings and decompositions and not how they are found. Here
they are found, by the rooms that know. Rejected: pictures that ask by themselves; one would import an engine.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from firable.cli.files import CATALOGUE
from firable.cli.text import counted

if TYPE_CHECKING:
    from firable.nets.drawing.arrangement import Arrangement
    from firable.nets.drawing.layered import Layouter
    from firable.nets.net import Marking, Net
    from firable.semantics.trace import Trace

WIDTH_MAX: Final = 2600.0
"""How wide the picture of a net gets before its lanes are wrapped, in pixels: what an A3 sheet holds."""
EXPLORED_MAX: Final = 200_000
"""How many markings are looked for in order to say how many there are, and which are doomed."""


def drawable(net: Net, controllers: Collection[str] = ()) -> None:
    """Refuse a net, or some controllers of it, that are too large for a picture of their places."""
    from firable.nets.drawing import NODES_MAX, has_overview
    from firable.nets.drawing.part import everybody, part_of

    refuse_unknown_controllers(net, controllers)
    part = part_of(net, controllers, everybody(net)) if controllers else net
    if (n_nodes := len(part.places) + len(part.transitions)) > NODES_MAX:
        overview = "; --what overview draws what they share" if has_overview(net) else ""
        raise click.UsageError(f"{_too_large(n_nodes, net)}{overview}")


def viewable(net: Net, controllers: Collection[str]) -> None:
    """Refuse a net of which nothing can be shown: it is too large for a picture, and so for an overview."""
    from firable.nets.drawing import NODES_MAX, has_overview

    if controllers:
        drawable(net, controllers)
    elif (n_nodes := len(net.places) + len(net.transitions)) > NODES_MAX and not has_overview(net):
        raise click.UsageError(_too_large(n_nodes, net))


def _too_large(n_nodes: int, net: Net) -> str:
    """Why no picture is drawn of so many places and transitions, and what to do about it."""
    from firable.nets.drawing import NODES_MAX
    from firable.nets.drawing.part import owners_of

    hint = "--controller NAME draws some of its controllers"
    if len(owners_of(net)) < 2:
        hint = "`firable split --suggest` proposes controllers for it, which are drawn one by one"
    why = "places and transitions make no picture that anybody can read"
    return f"{n_nodes:,} {why}; at most {NODES_MAX:,} are drawn: {hint}"


def refuse_unknown_controllers(net: Net, controllers: Collection[str]) -> None:
    """Refuse controllers that the net has not, and those that own nothing that could be drawn."""
    from firable.nets.drawing.part import owners_of

    names = [controller.name for controller in net.controllers]
    if unknown := [name for name in controllers if name not in names]:
        from firable.nets.diagnostics import with_meant

        raise click.UsageError(with_meant(f"the net has no controller '{unknown[0]}'", unknown[0], names))
    if bare := [name for name in controllers if name not in owners_of(net)]:
        raise click.UsageError(f"--controller {bare[0]}: it owns no place and no signal, so there is nothing to draw")


def kept_layout(net: Net, argument: str) -> Arrangement:
    """What the layout file beside a net says, where there is one; raises `InputError` as `read_layout` does.

    What it arranges and the net does not have is said on standard error.
    """
    from firable.cli.text import show_diagnostic
    from firable.nets.drawing.arrangement import Arrangement
    from firable.nets.drawing.layout_file import layout_path, read_layout, vanished
    from firable.nets.writing import stands

    path = layout_path(argument)
    if argument.startswith(CATALOGUE) or not stands(path) or not path.is_file():
        return Arrangement()
    given = read_layout(path)
    for note in vanished(given, net, str(path)):
        show_diagnostic(note)
    return given


def keep(net: Net, argument: str, given: Arrangement) -> None:
    """Write how a net is arranged into the layout file beside it."""
    from firable.nets.drawing.layout import arranged
    from firable.nets.drawing.layout_file import format_layout, layout_path
    from firable.nets.writing import write_whole

    if argument.startswith(CATALOGUE):
        raise click.UsageError("--keep-layout writes a file beside the net, and a net of the catalogue has none")
    write_whole(str(layout_path(argument)), format_layout(arranged(net, given)))


@dataclass(frozen=True)
class Shown:
    """What is to be seen on a net: its tokens, what has fired, and the line below the title; by default M0."""

    marking: Marking | None = None
    firings: Sequence[Sequence[str]] = ()
    caption: str = ""


def shown_on(net: Net, marking: str | None, trace: str | None) -> Shown:
    """The tokens that a marking or the end of a trace names; raises `InputError` F5004 where it is none of the net."""
    if trace is not None:
        from firable.semantics.replaying import replay as play
        from firable.semantics.trace import read_trace

        read = read_trace(trace)
        done = play(net, read)
        return Shown(done.marking, _fired(read), f"after {counted(done.firings, 'firing')} of {Path(trace).name}")
    if marking is None:
        return Shown()
    names = [name.strip() for name in marking.split(",") if name.strip()]
    if unknown := [name for name in names if name not in net.place_index]:
        from firable.nets.diagnostics import with_meant

        message = f"the net has no place '{unknown[0]}'"
        raise click.UsageError(with_meant(message, unknown[0], list(net.place_index)))
    return Shown(net.marking(names))


def net_picture(
    net: Net,
    shown: Shown,
    collapse: tuple[str, ...],
    controllers: tuple[str, ...],
    given: Arrangement,
    width: int | None,
    layout: str | None,
) -> str:
    """The net, or some controllers of it."""
    from firable.nets.drawing import draw_free, draw_net

    drawable(net, controllers)
    refuse_unknown(net, collapse)
    if layout is not None and layout != "lanes":
        placed = _layouter(layout)
        return draw_free(net, marking=shown.marking, firings=shown.firings, caption=shown.caption, layout=placed)
    return draw_net(
        net,
        marking=shown.marking,
        firings=shown.firings,
        caption=shown.caption,
        folded=collapse,
        owners=controllers or None,
        given=given,
        width_max=width or WIDTH_MAX,
    )


def overview_picture(net: Net, shown: Shown, width: int | None) -> str:
    """The controllers of a net, and the transitions that they share."""
    from firable.nets.drawing import draw_overview, has_overview
    from firable.nets.drawing.overview import LINES_MAX
    from firable.nets.drawing.overview import WIDTH_MAX as ENOUGH
    from firable.nets.drawing.part import owners_of

    if not has_overview(net):
        if len(owners_of(net)) < 2:
            raise click.UsageError("an overview shows what controllers share, and this net has no two of them")
        most = f"at most {LINES_MAX:,} controllers and transitions that they share are drawn"
        raise click.UsageError(f"the net is too large for an overview: {most}")
    return draw_overview(
        net,
        marking=shown.marking,
        firings=shown.firings,
        caption=shown.caption,
        width_max=width or ENOUGH,
    )


def refuse_unknown(net: Net, collapse: tuple[str, ...]) -> None:
    """Refuse to collapse what the net does not have, and what is not drawn otherwise then."""
    from firable.nets.drawing.folding import ALL, fold

    names = {ALL, *net.place_index, *(controller.name for controller in net.controllers)}
    if unknown := [name for name in collapse if name not in names]:
        from firable.nets.diagnostics import with_meant

        message = f"the net has no place and no controller '{unknown[0]}'"
        raise click.UsageError(with_meant(message, unknown[0], sorted(names)))
    if idle := [name for name in collapse if name != ALL and not fold(net, [name]).members]:
        message = f"--collapse {idle[0]}: no task of two places or more is named so, and nothing is drawn otherwise"
        raise click.UsageError(f"{message}; a task is what a controller does between being idle and being idle again")


def _layouter(name: str) -> Layouter:
    match name:
        case "dot":
            from firable.cli.graphviz import dot

            return dot
        case "elk":
            from firable.cli.elk import elk

            return elk
        case _:
            from firable.nets.drawing import layered

            return layered


def graph_picture(net: Net, discipline: str, max_markings: int, layout: str) -> str:
    """The reachability graph, or the part of it that is nearest to M0."""
    from firable.analysis.spaces.reachability import Budget, explore
    from firable.analysis.verdicts.behaviour import Behaviour
    from firable.nets.drawing import MarkingGraph, Step, draw_markings

    space = explore(net, discipline, Budget(markings=max(EXPLORED_MAX, max_markings)))
    drawn = min(space.n_markings, max_markings)
    steps, beyond = [], [0] * drawn
    for i in range(drawn):
        for fired, target in space.successors(i):
            if target < drawn:
                steps.append(Step(i, target, tuple(net.transitions[t].name for t in fired)))
            else:
                beyond[i] += 1
    numbers = range(drawn)
    deadlocks = frozenset(i for i in numbers if space.deadlocks[i])
    known = space.complete
    doomed = frozenset(i for i in numbers if Behaviour(space).doomed[i]) if known else frozenset[int]()
    markings = tuple(space.marking(i) for i in numbers)
    how = "one transition at a time" if discipline == "interleaving" else "in synchronous steps"
    told = [f"{counted(space.n_markings, 'marking')} and {counted(space.n_edges, 'edge')}, {how}"]
    if not known:
        told = [f"more than {EXPLORED_MAX:,} markings, {how}; which of them are doomed is not known"]
    if drawn < space.n_markings:
        told.append(f"drawn: the {drawn:,} nearest to M0")
    graph = MarkingGraph(markings, tuple(steps), deadlocks, doomed, tuple(beyond))
    return draw_markings(net, graph, caption="; ".join(told), layout=_layouter(layout))


def coordinator_picture(net: Net, width: int | None) -> str:
    """The coordinator diagram of the net's split; raises `InputError` where the net cannot be split."""
    from firable.decompose.splitting.cut import split
    from firable.nets.drawing import draw_coordinator

    drawable(net)
    return draw_coordinator(split(net)) if width is None else draw_coordinator(split(net), width_max=width)


def strip_picture(net: Net, trace: str, width: int | None) -> str:
    """The run of a trace, step by step; raises `InputError` F5004 where it is none of the net."""
    from firable.nets.drawing import draw_strip
    from firable.semantics.frames import frames
    from firable.semantics.replaying import replay as play
    from firable.semantics.trace import read_trace

    read = read_trace(trace)
    done = play(net, read)
    caption = f"{counted(done.firings, 'firing')} of {Path(trace).name}, step by step"
    draw = draw_strip if width is None else partial(draw_strip, width_max=width)
    start = None if read.header.start is None else net.marking(read.header.start.marking)
    return draw(net, frames(net, _fired(read), start), caption=caption, end=_end(net, done.marking))


def _fired(trace: Trace) -> list[tuple[str, ...]]:
    from firable.semantics.trace import Fired

    return [event.transitions for event in trace.events if isinstance(event, Fired)]


def _end(net: Net, marking: Marking) -> Sequence[str]:
    """What is to be said of the marking where a run ends: nothing, unless nothing can fire there."""
    from firable.cli.story import waits_told
    from firable.semantics.player import Player
    from firable.semantics.waiting import circle

    if not Player(net).deadlocked(marking):
        return ()
    waits = circle(net, marking)
    return ("Deadlock: no transition is firable.", *waits_told(net, waits))
