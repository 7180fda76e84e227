"""`firable replay`: is this trace a trace of the net?"""

from __future__ import annotations

import shlex
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from firable.cli import text
from firable.cli.files import READ, WRITTEN
from firable.cli.finite import FiniteRange
from firable.cli.options import answer, format_option, load_net, write_text
from firable.cli.report import Report

if TYPE_CHECKING:
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.net import Net
    from firable.nets.verdict import Verdict
    from firable.semantics.trace import Trace

_TOLD_MAX = 40
_NOTHING_PLAYED: dict[str, Any] = {"firings": {}, "marking": [], "told": [], "recorded_on_this_net": True}
_NAME, _METHOD = "trace", "replay by the reference player"


@click.command(short_help="Play a trace by the reference player: is it one of the net?")
@click.argument("traces", metavar="TRACE...", type=READ, nargs=-1, required=True)
@click.option("--net", "of", metavar="NET", type=READ, help="The net, or the bundle, that the trace is of (required).")
@click.option(
    "--machines",
    metavar="PLANT",
    type=READ,
    help="Ask too whether the machines did what this plant file allows; catalogue:NAME for one of the catalogue.",
)
@click.option(
    "--latency",
    "latency_seconds",
    type=FiniteRange(min=0.0, min_open=True),
    help="With --machines: how many seconds after its change a signal is taken at the latest.  [default: 0.5]",
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=WRITTEN,
    help="Write the one trace that the traces of several hosts make.",
)
@format_option
def replay(
    traces: tuple[str, ...],
    of: str | None,
    machines: str | None,
    latency_seconds: float | None,
    output: str | None,
    format_: str,
) -> int:
    """Play TRACE, a log of `firable run` or a counterexample of `firable check`, token by token.

    Every firing must be firable with its gates open as recorded, every command sent exactly once, and the marking at
    the end the one shown. A trace that was cut off is unknown.

    Where a cell ran on several hosts, name the traces of all of them: they are joined by the rounds of their
    coordinator, and their clocks need not agree.

    With --machines, the signals and commands are held against the machines of a plant file, as a run does: the first
    signal, or the absence of one, that nothing explains is shown, with the places of the cell that it touches.
    """
    from firable.nets.loading import is_bundle

    if (bundle := next(filter(is_bundle, traces), None)) is not None:
        raise click.UsageError(
            f"'{bundle}' is a bundle and no trace: `firable replay TRACE --net {shlex.quote(bundle)}`"
        )
    if of is None:
        raise click.UsageError("Missing option '--net': say which net, or which bundle, the trace is of")
    if output == "-":
        raise click.UsageError("the trace cannot go to standard output, where the report goes: name a file")
    if latency_seconds is not None and machines is None:
        raise click.UsageError("--latency is of the machines: say which with --machines")
    return answer("replay", format_, lambda: _report(traces, of, machines, latency_seconds, output), _show)


def _report(
    files: tuple[str, ...], argument: str, machines: str | None, latency_seconds: float | None, output: str | None
) -> Report:
    from firable.nets.diagnostics import InputError
    from firable.nets.interchange import net_digest
    from firable.semantics.joining import join
    from firable.semantics.trace import Fired, read_trace

    loaded = load_net(argument)
    net = loaded.net
    read = [read_trace(file) for file in files]
    of_hosts = len(read) > 1 or bool(read[0].header.machines)
    try:
        trace = join(net, read) if of_hosts else read[0]
    except InputError as error:
        if error.diagnostics[0].code != "F5004":
            raise
        return Report(
            "replay",
            ", ".join(files),
            net,
            (_violated(net, error.diagnostics[0]),),
            run=_NOTHING_PLAYED,
            notes=loaded.notes,
        )
    if output is not None:
        write_text(output, "".join(f"{line}\n" for line in trace.lines()))
    firings = [event.transitions for event in trace.events if isinstance(event, Fired)]
    verdict, marking = _verdict(net, trace)
    same = not trace.header.digest or trace.header.digest == net_digest(net)
    return Report(
        "replay",
        ", ".join(files),
        net,
        (verdict, *(() if machines is None else (_machines(net, trace, verdict, machines, latency_seconds),))),
        notes=loaded.notes,
        files=(output,) if output else (),
        run={
            "firings": {name: sum(name in fired for fired in firings) for name in net.transition_index},
            "marking": list(marking),
            "told": [list(fired) for fired in firings] if len(firings) <= _TOLD_MAX and verdict.holds else [],
            "recorded_on_this_net": same,
        },
    )


def _verdict(net: Net, trace: Trace) -> tuple[Verdict, tuple[str, ...]]:
    from firable.nets.diagnostics import InputError
    from firable.nets.verdict import Status, Verdict
    from firable.semantics.replaying import replay as play

    name, method = _NAME, _METHOD
    try:
        done = play(net, trace)
    except InputError as error:
        return _violated(net, error.diagnostics[0]), ()
    statement = f"the trace is a trace of '{net.name}': {text.counted(done.firings, 'firing')}"
    if done.commands:
        statement += f", {text.counted(done.commands, 'command')}"
    if trace.header.start is not None:
        statement += f", from the marking that was taken over: {', '.join(trace.header.start.marking)}"
    status = Status.PROVED if done.complete else Status.UNKNOWN
    bound = "" if done.complete else "the trace was cut off; all its lines so far are of the net"
    return Verdict(name, status, statement, method, bound=bound), net.names(done.marking)


def _violated(net: Net, found: Diagnostic) -> Verdict:
    from firable.nets.verdict import Status, Verdict

    where = f"line {found.span.line}: " if found.span else ""
    hint = f"{where}{found.message}; {found.hint}"
    return Verdict(_NAME, Status.VIOLATED, f"the trace is a trace of '{net.name}'", _METHOD, code=found.code, hint=hint)


def _machines(net: Net, trace: Trace, judged: Verdict, argument: str, latency_seconds: float | None) -> Verdict:
    from firable.cli.loop import read_machines_of
    from firable.executor.operating.monitor import LATENCY_SECONDS, Monitor, watch
    from firable.nets.verdict import Status, Verdict

    latency = LATENCY_SECONDS if latency_seconds is None else latency_seconds
    name, method = "machines", f"markings of the closed loop that explain what was seen, latency {latency:g} s"
    statement = f"the machines did what '{argument}' allows, as far as signals show"
    monitor = Monitor(net, read_machines_of(argument, net), latency_seconds=latency)
    if bound := _unwatched(trace, judged):
        return Verdict(name, Status.UNKNOWN, statement, method, bound=bound)
    watched, bound = _watched(trace)
    found = watch(monitor, watched)
    if found is None:
        return Verdict(name, Status.UNKNOWN if bound else Status.PROVED, statement, method, bound=bound)
    hint = f"at {found.at_seconds:.2f} s: {found.message}; mend the plant file, or look at that machine"
    return Verdict(name, Status.VIOLATED, statement, method, subjects=found.places, hint=hint)


def _unwatched(trace: Trace, judged: Verdict) -> str:
    """Why nothing can be said of the machines; empty where something can."""
    from firable.nets.verdict import Status
    from firable.semantics.trace import Discipline

    if judged.status is Status.VIOLATED:
        return "the trace is none of the net"
    if trace.header.discipline is Discipline.STEP:
        return "a cell fires one transition at a time, and this is a trace of steps"
    if not (trace.header.signals and trace.header.commands):
        return "the trace records no signals and commands, by which machines show what they do"
    if trace.header.start is not None:
        return "the trace begins where a cell was taken over, and does not tell where its workpieces were then"
    return ""


def _watched(trace: Trace) -> tuple[Trace, str]:
    """The trace up to where its run was broken off, and what is to be said of the rest, if anything happens in it.

    There machines are stopped in the middle of their work, as no plant file tells of (`executor.operating.watching`).
    """
    from firable.semantics.trace import Noted

    broken = (
        k for k, e in enumerate(trace.events) if isinstance(e, Noted) and e.note in {"restarted", "emergency stop"}
    )
    if (at := next(broken, None)) is None:
        return trace, ""
    begun, rest = trace.events[:at], trace.events[at:]
    goes_on = any(not isinstance(event, Noted) for event in rest)
    bound = f"until {rest[0].at_seconds:.2f} s, where the run was broken off; of what followed no plant file tells"
    return replace(trace, events=begun, end=None), bound if goes_on else ""


def _show(report: Report) -> None:
    for note in report.notes:
        text.show_diagnostic(note)
    text.heading(report.net, report.input)
    if not report.run["recorded_on_this_net"]:
        click.echo("  recorded on another net, or another version of this one")
    if report.run["told"]:
        click.echo()
        for line in text.told_steps(report.net, report.run["told"]):
            click.echo(f"  {line}")
    text.show_verdicts(report.net, report.verdicts)
    if report.run["marking"]:
        click.echo(f"\n  in the end hold a token: {', '.join(report.run['marking'])}")
        marking = report.net.marking(report.run["marking"])
        from firable.semantics.player import Player

        if Player(report.net).deadlocked(marking):
            click.echo(f"  {click.style('deadlock', fg='red')}: nothing is firable here, whatever the gates")
