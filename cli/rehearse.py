"""`firable rehearse`: the whole executor of a cell through faults, from seeds; each run judged by the semantics."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import cache
from itertools import takewhile
from multiprocessing import parent_process
from typing import TYPE_CHECKING

import click

from firable.cli import text
from firable.cli.files import READ
from firable.cli.options import answer, format_option, is_given, load_net
from firable.cli.report import Report

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

    from firable.executor.simulation.campaign import Campaign, Run
    from firable.executor.simulation.judge import Subject
    from firable.nets.verdict import Verdict

_OF = {"--seeds": "seeds", "--from": "first", "--jobs": "jobs"}
_CHUNK = 50
_SEEDS_PER_NET = 10
_FAILURES_MAX = 5
_LOOK_SECONDS = 0.2  # between two looks whether Ctrl-C was pressed


@click.command(short_help="Run a cell's controllers through crashes and faults, many times, from seeds.")
@click.argument("net", metavar="NET", type=READ)
@click.option(
    "--seeds", type=click.IntRange(min=1), default=1000, show_default=True, metavar="N", help="How many runs."
)
@click.option("--from", "first", type=click.IntRange(min=0), default=0, metavar="SEED", help="The first of the seeds.")
@click.option("--seed", type=click.IntRange(min=0), metavar="SEED", help="One run alone, and what happened in it.")
@click.option(
    "--faults",
    metavar="KINDS",
    help="These kinds of faults in every run, with commas between, or 'none'; else they are drawn.",
)
@click.option("--steps", type=click.IntRange(min=0), metavar="N", help="How long a run is before everything is mended.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, show_default=True, metavar="N", help="Processes.")
@format_option
def rehearse(
    net: str,
    seeds: int,
    first: int,
    seed: int | None,
    faults: str | None,
    steps: int | None,
    jobs: int,
    format_: str,
) -> int:
    """Run the controllers and the coordinator of NET many times, through faults that a seed draws.

    The machines of the protocol are those that run the cell; network, disks, clocks, machines and operator are
    simulated. Parts that a bundle of NET would run free of promise are free here, too; of a bundle, as it says.
    Messages are lost and overtaken, processes killed and restarted, writes lost, machines late. Each run
    must be a trace of NET with every command sent once, and must go on when everything is mended in the end. A run
    that fails is made shorter and printed as the command that brings it back.

    NET may also be 'drawn': then seeds draw nets as well, small ones with every kind of gate; 'drawn-timed' are those
    with time limits, 'drawn-layered' those with coordinators under coordinators.

    Kinds of faults: loss, duplication, delay, reordering, partition, crash, torn, unsynced, disk, drift, jump, slow,
    standstill, late, stuck, queued, flapping, stale, forgetful, pause, step, stop, leave,
    emergency.
    """
    from firable.executor.simulation.campaign import Run

    if seed is not None and (more := [name for name in ("--seeds", "--from", "--jobs") if is_given(_OF[name])]):
        raise click.UsageError(f"--seed is one run alone, and {more[0]} is for many")
    kinds = _kinds(faults)
    asked = [seed] if seed is not None else range(first, first + seeds)
    runs = [Run(each, kinds, steps) for each in asked]
    return answer("rehearse", format_, lambda: _report(net, runs, jobs, format_ == "text"), _show)


def _kinds(faults: str | None) -> tuple[str, ...] | None:
    from firable.executor.simulation.faults import KINDS

    if faults is None:
        return None
    named = [] if faults == "none" else [each.strip() for each in faults.split(",")]
    if unknown := [each for each in named if each not in KINDS]:
        raise click.UsageError(f"there is no fault '{unknown[0]}'; there are: {', '.join(KINDS)}; or 'none'")
    return tuple(each for each in KINDS if each in named)


def _report(argument: str, runs: Sequence[Run], jobs: int, is_text: bool) -> Report:
    from firable.executor.simulation.campaign import shrunk
    from firable.executor.simulation.drawn import DRAWN

    subject = _subjects(argument)  # an input that cannot be split is refused here
    started = time.monotonic()
    done = _campaign(argument, runs, jobs)
    if not done.runs:
        raise KeyboardInterrupt  # before anything is known
    if is_text and len(runs) > 1:
        seconds = time.monotonic() - started
        click.echo(f"{done.runs:,} runs in {seconds:.1f} s: {done.runs / max(seconds, 1e-3):,.0f} a second", err=True)
    if done.failed and len(runs) > 1:
        with suppress(KeyboardInterrupt):  # who does not wait is shown the run as it was
            first = done.failed[0]
            shorter = shrunk(subject(first.run.seed), first)
            # Where seeds draw nets, another seed may be of another net: then the first run is shown as it was.
            if subject(shorter.run.seed) is subject(first.run.seed):
                done.failed[0] = shorter
    net = subject(done.failed[0].run.seed if done.failed else runs[0].seed).net
    return Report(
        "rehearse",
        argument,
        net,
        (_verdict(argument, done, len(runs)),),
        run={
            "runs": done.runs,
            "counts": dict(sorted(done.counts.items())),
            "never_fired": [] if argument in DRAWN else [t.name for t in net.transitions if t.name not in done.fired],
            "failed": [
                {"command": f.command(argument), "kind": f.kind, "message": f.message, "log": list(f.log)}
                for f in done.failed[:_FAILURES_MAX]
            ],
        },
    )


@cache
def _subjects(argument: str) -> Callable[[int], Subject]:
    """What a seed is tried on: the net of the argument as its bundle would run, or one that is drawn."""
    from firable.decompose.splitting.cut import split
    from firable.decompose.splitting.persistence import freed
    from firable.executor.simulation.drawn import DRAWN
    from firable.executor.simulation.judge import Subject

    if argument in DRAWN:
        drawn = cache(lambda number: Subject(freed(split(DRAWN[argument](number)))))
        return lambda seed: drawn(seed // _SEEDS_PER_NET)
    loaded = load_net(argument)
    with loaded.placing():
        subject = Subject(loaded.decomposition or freed(split(loaded.net)))
    return lambda _: subject


def _part(argument: str, runs: Iterable[Run]) -> Campaign:
    from firable.executor.simulation.campaign import campaign

    return campaign(_subjects(argument), runs)


def _campaign(argument: str, runs: Sequence[Run], jobs: int) -> Campaign:
    """What the runs come to; or those until Ctrl-C, or until enough of them have failed."""
    from firable.executor.simulation.campaign import Campaign

    size = min(_CHUNK, -(-len(runs) // jobs))  # of a few runs too each process gets some
    chunks = [runs[i : i + size] for i in range(0, len(runs), size)]
    done = Campaign()
    if jobs > 1:
        _share(argument, chunks, jobs, done)
        return done
    with suppress(KeyboardInterrupt):
        for chunk in chunks:
            for run in chunk:
                done.join(_part(argument, [run]))
            if len(done.failed) >= _FAILURES_MAX:
                break
    return done


_stopped: Event
"""In a process that shares the runs: whether it is to begin no more of them."""


def _begin(stopped: Event) -> None:
    """Begin such a process; Ctrl-C, which a terminal sends to all of them, is for the first one to hear.

    It ends with the first one, however that ends: nobody else gives it runs.
    """
    global _stopped
    _stopped = stopped
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_first, daemon=True).start()


def _end_with_the_first() -> None:
    if (first := parent_process()) is not None:
        first.join()
        os._exit(1)


def _part_of_all(argument: str, runs: Sequence[Run]) -> Campaign:
    return _part(argument, takewhile(lambda _: not _stopped.is_set(), runs))


def _share(argument: str, chunks: Sequence[Sequence[Run]], jobs: int, done: Campaign) -> None:
    """Let several processes share the runs, and join what they come to in the order of the chunks.

    Ctrl-C is noted and looked for. As an exception it may be raised where nobody lets it through, in a callback of the
    garbage collector say, and is lost.
    """
    from concurrent.futures import ProcessPoolExecutor, wait
    from multiprocessing import Event

    stopped, pressed = Event(), threading.Event()
    heard = signal.signal(signal.SIGINT, lambda *_: pressed.set())
    try:
        with ProcessPoolExecutor(jobs, initializer=_begin, initargs=(stopped,)) as pool:
            waiting = deque(pool.submit(_part_of_all, argument, chunk) for chunk in chunks)
            try:
                while waiting and len(done.failed) < _FAILURES_MAX and not pressed.is_set():
                    if wait([waiting[0]], _LOOK_SECONDS).done:
                        done.join(waiting.popleft().result())
            finally:  # however it ended, what is left is one run in each process
                stopped.set()
                pool.shutdown(cancel_futures=True)
            for begun in waiting if pressed.is_set() else ():
                if not begun.cancelled():
                    done.join(begun.result())
    finally:
        signal.signal(signal.SIGINT, heard)


def _verdict(argument: str, done: Campaign, n_asked: int) -> Verdict:
    from firable.nets.verdict import Status, Verdict

    method = "simulation from seeds, judged by the reference player"
    what = "trace of the net, and goes on when everything is mended"
    if not done.failed:
        statement = f"each of {text.counted(done.runs, 'run')} is a {what}"
        if done.runs < n_asked:
            bound = f"{text.counted(done.runs, 'run')} of {n_asked:,}; interrupted"
            return Verdict("rehearsal", Status.UNKNOWN, statement, method, bound=bound)
        return Verdict("rehearsal", Status.PROVED, statement, method)
    worst = done.failed[0]
    statement = f"each run is a {what}; of {text.counted(done.runs, 'run')} not: {len(done.failed)}"
    hint = f"{worst.kind}: {worst.message}\n{worst.command(argument)}"
    return Verdict("rehearsal", Status.VIOLATED, statement, method, hint=hint)


def _show(report: Report) -> None:
    text.heading(report.net, report.input)
    run = report.run
    for failed in run["failed"][:1]:
        click.echo("\n  the last steps:")
        for line in failed["log"]:
            click.echo(f"  {line}")
    if run["counts"]:
        told = ", ".join(f"{count:,} {what}" for what, count in run["counts"].items())
        click.echo(f"\n  what happened: {told}")
    if run["never_fired"]:
        click.echo(f"  never fired: {', '.join(run['never_fired'])}")
    text.show_verdicts(report.net, report.verdicts)
    for failed in run["failed"]:
        click.echo(f"\n  {click.style(failed['command'], bold=True)}")
