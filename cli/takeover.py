"""`firable takeover`: let a new bundle go on where an old one has stopped."""

from __future__ import annotations

import os
import shlex
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from firable.cli.files import JOURNAL, OLD_JOURNAL, READ, journal_files
from firable.cli.options import analysis_options, budget, refuse_a_net

if TYPE_CHECKING:
    from firable.analysis.spaces.reachability import Budget
    from firable.executor.journal.takeover import Takeover
    from firable.executor.links.storages import Memory
    from firable.executor.protocol.messages import Stored
    from firable.nets.net import Net
    from firable.nets.verdict import Verdict

_ASKED = "taken-over"


@click.command(short_help="Let a new bundle go on where an old one has stopped.")
@click.argument("old", metavar="OLD", type=READ)
@click.argument("new", metavar="NEW", type=READ)
@click.option(
    "--journal",
    "journals",
    metavar="FILE",
    type=OLD_JOURNAL,
    multiple=True,
    required=True,
    help="The journal of the run of OLD, which has stopped; of each of its hosts, where there are several.",
)
@click.option(
    "--into",
    metavar="FILE",
    type=JOURNAL,
    multiple=True,
    required=True,
    help="Where to write the journal for the run of NEW: one for each --journal, in their order.",
)
@analysis_options
def takeover(
    old: str,
    new: str,
    journals: tuple[str, ...],
    into: tuple[str, ...],
    max_markings: int,
    max_memory: int,
    max_seconds: float | None,
) -> int:
    """Take the marking of a stopped cell over from bundle OLD to bundle NEW, by the names of its places.

    It is done only in a marking that NEW can reach, because NEW was proved for those alone; with no vote open, and with
    the same command in every place that has a token. The journals of OLD are left as they are, and OLD is not run on
    with them: a file .taken-over beside each says so. `firable run NEW --journal` then goes on: held, until the
    machines are asked where they are and the operator resumes.
    """
    from firable.executor.journal.memory import HOSTS, remembered
    from firable.executor.journal.sqlite_journal import SqliteJournal, machines_of, mark_of, mark_text
    from firable.executor.journal.takeover import dealt_out, take_over
    from firable.executor.operating.dispatch import TAKEN
    from firable.executor.operating.hosting import machines_of as hosted
    from firable.executor.operating.running import load
    from firable.executor.operating.whereabouts import MACHINES
    from firable.executor.protocol.deciders import TOP, coordinators
    from firable.nets.bundle import read_bundle

    if len(into) != len(journals):
        raise click.UsageError("name a file --into for each --journal")
    for bundle in (old, new):
        refuse_a_net(bundle, "a cell is taken over from bundle to bundle")
    before, after = read_bundle(old), load(new)
    _refuse_missing(journals)
    _refuse_standing(into)
    deciding = coordinators(after.decomposition)
    machines = {file: machines_of(file) for file in journals}
    kept: dict[str, dict[str, Stored]] = {}
    memories: dict[str, Memory] = {}
    aside: dict[str, Mapping[str, Mapping[str, Stored]]] = {}
    with ExitStack() as held:  # nobody runs the old bundle on while it is taken over
        for file, names in machines.items():
            read = held.enter_context(closing(SqliteJournal(file, before.digest, names)))
            kept |= {name: dict(read.kept(name)) for name in names}
            memories[file] = remembered(read.kept(HOSTS), read.age)
            aside[file] = {name: read.kept(name) for name in (TAKEN, MACHINES)}
        _refuse_copies(machines, memories)
        everything = [*coordinators(before.decomposition), *(subnet.name for subnet in before.decomposition.subnets)]
        controllers = dealt_out(machines, everything, [subnet.name for subnet in after.decomposition.subnets])
        at_top = [file for file, names in machines.items() if TOP in names and after.net.coordinator is None]
        dealt = {file: hosted(after.net, names, coordinator=file in at_top) for file, names in controllers.items()}
        if len(journals) == 1:
            dealt = {file: (*deciding, *names) for file, names in controllers.items()}
        moved = take_over(before.decomposition, after.decomposition, kept, deciding)
        _demand_reachable(before.net, after.net, moved.marking, budget(max_markings, max_memory, max_seconds))
        targets = dict(zip(journals, into, strict=True))
        written = {targets[file]: names for file, names in dealt.items() if names}
        goes_on = {file: targets[file] if dealt[file] else None for file in journals}
        marks = {str(mark_of(file)): mark_text(after.net.name, target, written) for file, target in goes_on.items()}
        cells = {}
        if len(journals) == 1 and Path(f"{journals[0]}.cell").is_file():  # the simulated cell, if there is one
            cells = {f"{into[0]}.cell": Path(f"{journals[0]}.cell").read_bytes()}
        with _removed_if_it_fails([name for file in written for name in journal_files(file)], marks):
            witnesses, whole = _made(written, after.digest, moved, {targets[file]: of for file, of in aside.items()})
            # In this order, however this ends: a witness without its journal is refused, so that no host begins the new
            # bundle anew; a marked journal is refused, so that none runs the old one on; and only then the new ones are
            # there.
            for files in (witnesses, marks, {**cells, **whole}):
                _put_down(files)
    click.echo(f"{', '.join(into)}: '{after.net.name}' goes on with tokens on {', '.join(moved.marking)}")
    if moved.under_way:
        click.echo(f"  under way, and asked after at the start: the commands of {', '.join(moved.under_way)}")
    click.echo("  begun anew: whose turn it is where arbiters alternate; what sensors show is read at the start")
    for file, mark in zip(journals, marks, strict=True):
        kept_apart = "; bring that back to its host with the new one" if len(journals) > 1 else ""
        click.echo(f"  {file} is not run on any more: {mark} beside it says so{kept_apart}")
    for file, names in dealt.items():
        if names:
            host = "".join(f" --controller {name}" for name in controllers[file]) if len(dealt) > 1 else ""
            host += " --coordinator" if len(dealt) > 1 and file in at_top else ""
            target = shlex.quote(targets[file])
            with_what = "its links, and the binding" if len(dealt) > 1 else "the plant or binding"
            click.echo(f"  next: firable run {shlex.quote(new)}{host} --journal {target}, with {with_what} of the cell")
        else:
            click.echo(f"  {targets[file]} is not written: '{after.net.name}' has none of the machines of that host")
    return 0


@contextmanager
def _removed_if_it_fails(names: Collection[str], marks: Collection[str]) -> Iterator[None]:
    """Leave none of these files, where none stood, unless all is done: part of a cell must not be started.

    The marks go last, and only where nothing else is left by which the new bundle might be run.
    """
    from firable.nets.diagnostics import InputError
    from firable.nets.writing import stands

    new, marked = ([name for name in some if not stands(name)] for some in (names, marks))
    try:
        yield
    except BaseException:
        _take_away(new)
        with suppress(InputError):  # where it is not known to be gone, the old one stays marked
            _sync_folders(new)
            if not any(map(stands, new)):
                _take_away(marked)
        raise


def _take_away(names: Iterable[str]) -> None:
    for name in names:
        with suppress(OSError, ValueError):
            Path(name).unlink(missing_ok=True)


def _put_down(files: Mapping[str, bytes | str]) -> None:
    """Write files whole, and durably before anything that is written behind them."""
    from firable.nets.writing import write_whole

    for file, data in files.items():
        write_whole(file, data)
    _sync_folders(files)


def _sync_folders(files: Iterable[str]) -> None:
    """Make durable which files stand in the folders of these; raises `InputError` F1017 where that fails."""
    from firable.executor.journal.sqlite_journal import sync_folder
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    for folder in dict.fromkeys(Path(os.path.realpath(file)).parent for file in files):
        try:
            sync_folder(folder)
        except OSError as error:
            message = f"{printable(str(folder))}: what is written there may not outlive a power cut: {error.strerror}"
            raise InputError([Diagnostic("F1017", message, "name files in a folder on another disk")]) from None


def _refuse_copies(machines: Mapping[str, Sequence[str]], memories: Mapping[str, Memory]) -> None:
    """Raise `InputError` F5050 where a journal remembers what another one does not hold: that is an older copy."""
    from firable.executor.links.link import called
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    problems = []
    for file, memory in memories.items():
        for by, other in memories.items():
            if by != file and (why := other.estranged(machines[file], memory.storage)) is not None:
                what = "an older copy: it does not hold" if why.is_older else "another one than"
                who = ", ".join(map(called, why.machines))
                message = f"{printable(file)}: the journal is {what} what {printable(by)} knows of {who}"
                hint = "name the journals as their hosts have left them at the end of one and the same run"
                problems.append(Diagnostic("F5050", message, hint))
    if problems:
        raise InputError(problems)


def _made(
    journals: Mapping[str, Sequence[str]],
    digest: str,
    moved: Takeover,
    aside: Mapping[str, Mapping[str, Mapping[str, Stored]]],
) -> tuple[dict[str, bytes], dict[str, bytes]]:
    """The witnesses and the journals, with their machines, and what was kept `aside`: made apart, to be whole."""
    from firable.executor.journal.journal import sync_now
    from firable.executor.journal.memory import HOSTS, keeping, new_name
    from firable.executor.journal.sqlite_journal import SqliteJournal, witness_of
    from firable.executor.links.storages import Memory, Met, Storage
    from firable.executor.protocol.messages import Keep

    storages = {file: Storage(new_name()) for file in journals}
    of = {name: storages[file] for file, names in journals.items() for name in names}
    with TemporaryDirectory() as apart:
        witnesses: dict[str, bytes] = {}
        whole: dict[str, bytes] = {}
        for number, (file, names) in enumerate(journals.items()):
            written = Path(apart, str(number))
            others = Memory(
                storages[file], {name: Met(storage.name) for name, storage in of.items() if name not in names}
            )
            with closing(SqliteJournal(written, digest, names)) as journal:
                for name in names:  # of a coordinator that decides nothing there is nothing to keep
                    journal.write(name, [Keep(key, value) for key, value in moved.kept.get(name, {}).items()])
                for name, of_name in aside[file].items():
                    journal.write(name, [Keep(key, value) for key, value in of_name.items()])
                if others.known:
                    journal.write(HOSTS, keeping(others))
                sync_now(journal)
            witnesses[str(witness_of(file))], whole[file] = witness_of(written).read_bytes(), written.read_bytes()
    return witnesses, whole


def _demand_reachable(old: Net, net: Net, marking: tuple[str, ...], allowed: Budget) -> None:
    """Raise `InputError` F5051 unless the marking is one that the new net can reach."""
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.verdict import Status

    verdict = _reachable(net, marking, allowed)
    shown = ", ".join(marking)
    if verdict.status is Status.UNKNOWN:
        message = f"whether '{net.name}' reaches the marking {shown} could not be decided: {verdict.bound}"
        raise InputError([Diagnostic("F5051", message, "give it more time or memory: --max-seconds, --max-memory")])
    if verdict.status is Status.VIOLATED:
        message = f"'{net.name}' never comes into the marking {shown}, so nothing is proved of what follows"
        where = "best to the end of the cycle"
        if new := [name for name in net.names(net.initial_marking) if name not in old.place_index]:
            # What only the new net has gets no token from the old one.
            message += f": {', '.join(new)}, which the old net has not, begins with a token and would have none"
            where = f"in the new net with no token on {', '.join(new)}"
        hint = (
            f"run the old bundle on, to a marking that both nets reach: {where}; where there is "
            "none, bring the cell by hand to the initial marking of the new net, and begin with a new journal"
        )
        raise InputError([Diagnostic("F5051", message, hint)])


def _reachable(net: Net, marking: tuple[str, ...], allowed: Budget) -> Verdict:
    from dataclasses import replace

    from firable.analysis.check import check
    from firable.executor.journal.takeover import formula_of
    from firable.nets.net import Property, PropertyKind

    asked = replace(net, properties=(Property(_ASKED, PropertyKind.REACHABLE, formula_of(net, marking)),))
    return check(asked, budget=allowed).verdict(f"property.{_ASKED}")


def _refuse_missing(journals: Sequence[str]) -> None:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable
    from firable.nets.writing import stands

    for file in journals:
        if _is_twice(file, journals):
            message = f"{printable(file)}: the journal is named twice"
            raise InputError([Diagnostic("F5050", message, "name one journal for each host, that of its last run")])
        if not stands(file) or not Path(file).is_file():
            message = f"{printable(file)}: there is no journal"
            raise InputError([Diagnostic("F1001", message, "name the file that `firable run OLD --journal` wrote")])


def _refuse_standing(into: Sequence[str]) -> None:
    """Raise `InputError` F1017 where a journal would take the place of another, or of what another has left.

    SQLite would take a log for the end of the new journal, and a run the cell for its own; and the file that tells of a
    journal that was lost would be lost, too.
    """
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable
    from firable.nets.writing import stands

    for file in into:
        if stands(file):
            message = f"{printable(file)}: a file stands there, and may be the journal of a cell"
            raise InputError([Diagnostic("F1017", message, "name another file")])
        for left in filter(stands, journal_files(file)):
            message = f"{printable(left)}: what an earlier journal of that name has left stands there"
            hint = "name another file, or remove that one with its journal"
            raise InputError([Diagnostic("F1017", message, hint)])


def _is_twice(file: str, files: Sequence[str]) -> bool:
    """Whether files are one, however they are spelled."""
    places = [os.path.realpath(each) for each in files]
    return places.count(os.path.realpath(file)) > 1
