"""`firable draw`: the net as a picture."""

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


def drawable(net: Net) -> None:
    """Refuse a net that is too large for a picture."""
    if (n_nodes := len(net.places) + len(net.transitions)) > NODES_MAX:
        raise click.UsageError(
            f"{n_nodes:,} places and transitions make no picture that anybody can read; at most {NODES_MAX:,} are drawn"
        )


@click.command(short_help="Draw a net as SVG.")
@net_argument
@click.option(
    "-o", "--output", metavar="FILE.svg", default="-", help="The file to write; - is standard output.  [default: -]"
)
@click.option(
    "--marking", metavar="PLACES", help="Show the tokens on these places, separated by commas, instead of M0."
)
@click.option("--trace", metavar="FILE", help="Show the marking where this trace ends, and which step fired what.")
def draw(net: str, output: str, marking: str | None, trace: str | None) -> int:
    """Draw NET in the conventions of the field: a lane for each controller, transitions as bars across them.

    Circles are places and bars transitions; permissive gates are dashed with a black dot at the transition, inhibitive
    ones with a hollow circle; external gates are stubs; a small arrow leads from a place to its command.
    """
    from firable.nets.drawing import draw_net

    if marking is not None and trace is not None:
        raise click.UsageError("--marking and --trace both say which tokens to show: leave one out")
    loaded = load_net(net).net
    drawable(loaded)
    if trace is not None:
        from firable.semantics.replaying import replay as play
        from firable.semantics.trace import Fired, read_trace

        read = read_trace(trace)
        done = play(loaded, read)
        firings = [event.transitions for event in read.events if isinstance(event, Fired)]
        caption = f"after {counted(done.firings, 'firing')} of {Path(trace).name}"
        write_text(output, draw_net(loaded, marking=done.marking, firings=firings, caption=caption))
        return 0
    shown = None
    if marking is not None:
        names = [name.strip() for name in marking.split(",") if name.strip()]
        if unknown := [name for name in names if name not in loaded.place_index]:
            from firable.nets.diagnostics import did_you_mean

            hint = did_you_mean(unknown[0], list(loaded.place_index))
            raise click.UsageError(f"the net has no place '{unknown[0]}'. {hint}".strip())
        shown = loaded.marking(names)
    write_text(output, draw_net(loaded, marking=shown))
    return 0
