"""`firable timeline`: what a run did from when to when, as a picture and for other tools.

The extension of the file says which. What a format cannot carry is said, never dropped in silence.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from firable.cli.files import READ, WRITTEN
from firable.cli.finite import FiniteRange
from firable.cli.options import load_net, write_text
from firable.cli.text import counted

if TYPE_CHECKING:
    from firable.nets.net import Net
    from firable.semantics.course import Course
    from firable.semantics.trace import Trace

STAYS_MAX: Final = 20_000
"""How many stays of tokens are drawn: a browser takes seconds to show more."""

_WRITERS: Final = {".vcd": ("vcd", "vcd"), ".perfetto.json": ("perfetto", "perfetto"), ".xes": ("xes", "xes")}
"""The formats for other tools: their modules in `firable.cli.timeline`, and what writes them there."""


@click.command(short_help="Draw what the machines did in a run, from when to when.")
@click.argument("traces", metavar="TRACE...", type=READ, nargs=-1, required=True)
@click.option(
    "--net", "of", metavar="NET", type=READ, required=True, help="The net, or the bundle, that the trace is of."
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=WRITTEN,
    required=True,
    help="*.svg, *.vcd, *.perfetto.json or *.xes: the extension says which; - is an SVG on standard output.",
)
@click.option("--from", "since", type=FiniteRange(min=0.0), metavar="SECONDS", help="Draw from this time on.")
@click.option("--to", "until", type=FiniteRange(min=0.0), metavar="SECONDS", help="Draw up to this time.")
def timeline(traces: tuple[str, ...], of: str, output: str, since: float | None, until: float | None) -> int:
    """Draw TRACE, a log of `firable run`, as a timeline with a lane for each machine.

    A bar goes from a command to its completion, and is hatched while the machine then waits for others; ticks are
    transitions. Long runs are wrapped like lines of text. Where a cell ran on several hosts, name the traces of all.

    The same course is written as VCD for waveform viewers, as JSON for Perfetto, and as XES for process mining; what a
    format cannot carry is said.
    """
    from firable.cli.timeline.svg import draw_timeline

    suffix = next((end for end in (*_WRITERS, ".svg") if output.lower().endswith(end)), "")
    if not suffix and output != "-":
        raise click.UsageError(
            f"cannot tell the format of '{output}': name a file *.svg, *.vcd, *.perfetto.json or *.xes"
        )
    if suffix in _WRITERS and (since is not None or until is not None):
        raise click.UsageError("--from and --to are of the picture: other formats carry the whole run")
    net = load_net(of).net
    done = _course(net, traces)
    if suffix in _WRITERS:
        module, function = _WRITERS[suffix]
        writer = import_module(f"firable.cli.timeline.{module}")
        write_text(output, getattr(writer, function)(done))
        for lost in writer.NOT_CARRIED:
            click.echo(f"note: not carried: {lost}", err=True)
        return 0
    start, end = since or 0.0, done.end_seconds if until is None else until
    if start >= done.end_seconds > 0 or end <= start < done.end_seconds:
        raise click.UsageError(f"nothing is between {start:g} s and {end:g} s: the run ends at {done.end_seconds:g} s")
    shown = sum(s.entered_seconds <= end and (s.left_seconds is None or s.left_seconds >= start) for s in done.stays)
    if shown > STAYS_MAX:
        raise click.UsageError(
            f"{shown:,} steps of machines make no picture that anybody can read; at most {STAYS_MAX:,} are drawn: "
            "name a part of the run with --from and --to"
        )
    names = ", ".join(Path(file).name for file in traces)
    commands = sum(stay.sent_seconds is not None for stay in done.stays)
    caption = (
        f"{names}: {counted(len(done.firings), 'firing')}, {counted(commands, 'command')}, {done.end_seconds:.1f} s"
    )
    if not done.complete:
        caption += "; the trace was cut off"
    write_text(output, draw_timeline(done, caption=caption, since=start, until=end))
    return 0


def _course(net: Net, files: tuple[str, ...]) -> Course:
    """What a run did, by the traces of its hosts; `InputError` F5006 where no machine is seen at work."""
    from firable.nets.diagnostics import Diagnostic, InputError, Span
    from firable.semantics.course import course
    from firable.semantics.joining import join
    from firable.semantics.trace import read_trace

    read = [read_trace(file) for file in files]
    trace: Trace = join(net, read) if len(read) > 1 or read[0].header.machines else read[0]
    done = course(net, trace)
    if not trace.header.commands:
        hint = "draw the timeline of a log of `firable run`; `firable draw --trace` shows what steps these are"
        span = Span(files[0], 1, 1)
        raise InputError([Diagnostic("F5006", "the trace records no commands, so no machine is seen", hint, span=span)])
    if all(place.command is None for place in net.places):
        raise InputError(
            [Diagnostic("F5006", f"no place of '{net.name}' commands a machine", "nothing has a timeline")]
        )
    return done
