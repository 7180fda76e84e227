"""`firable draw`: pictures of a net and of what it does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import click

from firable.cli.choice import OneOf
from firable.cli.files import READ, WRITTEN
from firable.cli.options import load_net, net_argument, write_text

_OF: Final[Mapping[str, tuple[str, ...]]] = {
    "marking": ("net", "overview"),
    "trace": ("net", "overview", "strip"),
    "collapse": ("net",),
    "controller": ("net",),
    "keep_layout": ("net",),
    "width": ("net", "overview", "coordinator", "strip"),
    "discipline": ("graph",),
    "max_markings": ("graph",),
    "layout": ("net", "graph"),
}
"""Of which pictures each option is."""


@click.command(short_help="Draw a net, an overview, its coordinator, its reachability graph or a run, as SVG.")
@net_argument
@click.option(
    "-o",
    "--output",
    metavar="FILE.svg",
    type=WRITTEN,
    default="-",
    help="The file to write; - is standard output.  [default: -]",
)
@click.option(
    "--what",
    type=OneOf(["net", "overview", "coordinator", "graph", "strip"]),
    default="net",
    show_default=True,
    help="The net; its controllers and what they share; who decides what over whom; its reachability graph; a run of "
    "it, a small picture for each step.",
)
@click.option(
    "--marking", metavar="PLACES", help="Show the tokens on these places, separated by commas, instead of M0."
)
@click.option(
    "--trace",
    metavar="FILE",
    type=READ,
    help="Show the marking where this trace ends, and which step fired what; the run of a strip.",
)
@click.option(
    "--collapse",
    metavar="NAME",
    multiple=True,
    help="Draw a task as one place: the task that a place is in, those of a controller, or `all`; repeatable.",
)
@click.option(
    "--controller",
    metavar="NAME",
    multiple=True,
    help="Draw this controller alone, with its parts of the transitions that it shares; repeatable.",
)
@click.option(
    "--keep-layout", is_flag=True, help="Keep how the picture is arranged in a file beside NET, for the next time."
)
@click.option(
    "--width",
    type=click.IntRange(400, 100_000),
    default=None,
    metavar="PIXELS",
    help="Wrap what is wider than so many pixels.  [default: 2600 of a net, 1300 of an overview, 1900 of a "
    "coordinator, 1500 of a strip]",
)
@click.option(
    "--discipline",
    type=OneOf(["interleaving", "step"]),
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
    type=OneOf(["lanes", "layered", "dot", "elk"]),
    default=None,
    help="Place what is drawn in lanes (a net), by distance from the start, or by Graphviz or ELK where these are "
    "installed.  [default: lanes of a net, layered of a graph]",
)
def draw(
    net: str,
    output: str,
    what: str,
    marking: str | None,
    trace: str | None,
    collapse: tuple[str, ...],
    controller: tuple[str, ...],
    keep_layout: bool,
    width: int | None,
    discipline: str | None,
    max_markings: int | None,
    layout: str | None,
) -> int:
    """Draw NET in the conventions of the field: a lane for each controller, transitions as bars across them.

    Circles are places and bars transitions; permissive gates are dashed with a black dot at the transition, inhibitive
    ones with a hollow circle; external gates are stubs; a small arrow leads from a place to its command. Lanes that are
    wider than the sheet are wrapped, and --collapse draws what a controller does for one task as one place, a double
    circle; of a large net --controller draws some controllers alone. A layout file beside NET (cell.layout.yaml of
    cell.firable.yaml) says how the picture is arranged.

    --what overview draws each controller as a line, with where its tokens are, and each transition that several share
    as a bar across their lines. --what coordinator draws the split over the controllers: for each global transition who
    decides it, the part of each controller, what it waits for, and what competes. --what strip draws the run of a
    --trace, as `firable check --trace-dir` and `firable run` write them: a small picture for each step, of the places
    that matter.

    --what graph draws the reachability graph: its markings by what is different from M0, the firings between them,
    deadlocks and doomed markings marked. Of a large net the markings nearest to M0 are drawn, and the picture says how
    many there are.
    """
    from firable.cli import pictures

    given = {
        "marking": marking,
        "trace": trace,
        "collapse": collapse or None,
        "controller": controller or None,
        "keep_layout": keep_layout or None,
        "width": width,
        "discipline": discipline,
        "max_markings": max_markings,
        "layout": layout,
    }
    for name, value in given.items():
        if value is not None and what not in _OF[name]:
            wanted = " or ".join(f"--what {one}" for one in _OF[name])
            raise click.UsageError(f"--{name.replace('_', '-')} is of {wanted}, not of --what {what}")
    if output != "-" and not output.lower().endswith(".svg"):
        raise click.UsageError(f"a picture is SVG, and '{output}' is not named like one: name a file *.svg")
    if marking is not None and trace is not None:
        raise click.UsageError("--marking and --trace both say which tokens to show: leave one out")
    loaded = load_net(net).net
    match what:
        case "graph":
            limit = max_markings or 100
            if layout == "lanes":
                raise click.UsageError("--layout lanes is of --what net: markings have no lanes")
            picture = pictures.graph_picture(loaded, discipline or "interleaving", limit, layout or "layered")
        case "overview":
            picture = pictures.overview_picture(loaded, pictures.shown_on(loaded, marking, trace), width)
        case "coordinator":
            picture = pictures.coordinator_picture(loaded, width)
        case "strip":
            if trace is None:
                raise click.UsageError("--what strip draws the run of a trace: add --trace FILE")
            picture = pictures.strip_picture(loaded, trace, width)
        case _:
            if layout not in {None, "lanes"} and (collapse or controller or keep_layout or width):
                raise click.UsageError(
                    f"--collapse, --controller, --keep-layout and --width are of lanes: leave out --layout {layout}"
                )
            if controller and keep_layout:
                raise click.UsageError("--keep-layout keeps how the whole net is arranged: leave out --controller")
            kept = pictures.kept_layout(loaded, net)
            shown = pictures.shown_on(loaded, marking, trace)
            picture = pictures.net_picture(loaded, shown, collapse, controller, kept, width, layout)
            if keep_layout:
                pictures.keep(loaded, net, kept)
    write_text(output, picture)
    return 0
