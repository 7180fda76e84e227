"""`firable draw`: pictures of a net and of what it does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from firable.cli.options import load_net, net_argument, write_text
from firable.cli.text import counted

if TYPE_CHECKING:
    from firable.nets.net import Net

NODES_MAX: Final = 600
"""How many places and transitions are drawn: lines are laid out to cross little, at a cost that grows with the cube."""
EXPLORED_MAX: Final = 200_000
"""How many markings are looked for in order to say how many there are, and which are doomed."""


def drawable(net: Net) -> None:
    """Refuse a net that is too large for a picture."""
    if (n_nodes := len(net.places) + len(net.transitions)) > NODES_MAX:
        raise click.UsageError(
            f"{n_nodes:,} places and transitions make no picture that anybody can read; at most {NODES_MAX:,} are drawn"
        )


@click.command(short_help="Draw a net, or its reachability graph, as SVG.")
@net_argument
@click.option(
    "-o", "--output", metavar="FILE.svg", default="-", help="The file to write; - is standard output.  [default: -]"
)
@click.option(
    "--what",
    type=click.Choice(["net", "graph"]),
    default="net",
    show_default=True,
    help="The net, or its reachability graph.",
)
@click.option(
    "--marking", metavar="PLACES", help="Show the tokens on these places, separated by commas, instead of M0."
)
@click.option("--trace", metavar="FILE", help="Show the marking where this trace ends, and which step fired what.")
@click.option(
    "--discipline",
    type=click.Choice(["interleaving", "step"]),
    default=None,
    help="Of the graph: fire one transition at a time, or maximal sets of them.  [default: interleaving]",
)
@click.option(
    "--max-markings",
    type=click.IntRange(1, 400),
    default=None,
    help="Of the graph: draw so many markings, those nearest to M0.  [default: 100]",
)
@click.option(
    "--layout",
    type=click.Choice(["layered", "dot"]),
    default=None,
    help="Of the graph: place it by firable itself, or by Graphviz where it is installed.  [default: layered]",
)
def draw(
    net: str,
    output: str,
    what: str,
    marking: str | None,
    trace: str | None,
    discipline: str | None,
    max_markings: int | None,
    layout: str | None,
) -> int:
    """Draw NET in the conventions of the field: a lane for each controller, transitions as bars across them.

    Circles are places and bars transitions; permissive gates are dashed with a black dot at the transition, inhibitive
    ones with a hollow circle; external gates are stubs; a small arrow leads from a place to its command.

    --what graph draws the reachability graph instead: its markings by what is different from M0, the firings between
    them, deadlocks and doomed markings marked. Of a large net the markings nearest to M0 are drawn, and the picture
    says how many there are.
    """
    if what == "net" and not (discipline is None and max_markings is None and layout is None):
        raise click.UsageError("--discipline, --max-markings and --layout are of the graph: add --what graph")
    if what == "graph" and not (marking is None and trace is None):
        raise click.UsageError("--marking and --trace show tokens in the net: leave out --what graph")
    if marking is not None and trace is not None:
        raise click.UsageError("--marking and --trace both say which tokens to show: leave one out")
    loaded = load_net(net).net
    if what == "graph":
        write_text(output, _graph(loaded, discipline or "interleaving", max_markings or 100, layout or "layered"))
    else:
        write_text(output, _net(loaded, marking, trace))
    return 0


def _net(net: Net, marking: str | None, trace: str | None) -> str:
    from firable.nets.drawing import draw_net

    drawable(net)
    if trace is not None:
        from firable.semantics.replaying import replay as play
        from firable.semantics.trace import Fired, read_trace

        read = read_trace(trace)
        done = play(net, read)
        firings = [event.transitions for event in read.events if isinstance(event, Fired)]
        caption = f"after {counted(done.firings, 'firing')} of {Path(trace).name}"
        return draw_net(net, marking=done.marking, firings=firings, caption=caption)
    shown = None
    if marking is not None:
        names = [name.strip() for name in marking.split(",") if name.strip()]
        if unknown := [name for name in names if name not in net.place_index]:
            from firable.nets.diagnostics import did_you_mean

            hint = did_you_mean(unknown[0], list(net.place_index))
            raise click.UsageError(f"the net has no place '{unknown[0]}'. {hint}".strip())
        shown = net.marking(names)
    return draw_net(net, marking=shown)


def _graph(net: Net, discipline: str, max_markings: int, layout: str) -> str:
    from firable.analysis.spaces.reachability import Budget, explore
    from firable.analysis.verdicts.behaviour import Behaviour
    from firable.cli.graphviz import dot
    from firable.nets.drawing import MarkingGraph, Step, draw_markings, layered

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
    return draw_markings(net, graph, caption="; ".join(told), layout=dot if layout == "dot" else layered)
