"""The files of a run that can be taken up: its journal, its simulated cell, and its trace, opened so that they agree.

    cell.journal               what the machines keep, in SQLite
    cell.journal.generation    how many syncs it has seen: it notices what SQLite does not
    cell.journal.cell          what was done to the simulated cell: it outlives the process, as machines do

Whatever cannot go on from where the last process was is refused, rather than begun anew beside machines that are
somewhere else; and so is what would go on beside another kind of machines than those of that process. Whether they are
where they were is for a person to say (`whereabouts.py`).
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Final

from firable.executor.cell.cell_log import PUT_BACK, CellLog, Input, past_in
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.journal.sqlite_journal import SqliteJournal, is_to_be_made
from firable.executor.operating.recorder import (
    CELL,
    KEY,
    TRACE,
    LineStream,
    Recorder,
    TraceFile,
    room_for,
    size_bytes_of,
)
from firable.executor.operating.whereabouts import AT, MACHINES, Elsewhere, elsewhere
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import Keep, Stored
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.interchange import net_digest
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net
from firable.nets.source import printable
from firable.semantics.trace import Start

ON: Final = "on"

NOWHERE: Final[Mapping[str, str]] = MappingProxyType({})


class On(StrEnum):
    """On what a run commands, in the words of its journal, which tells where that stands and not what is elsewhere."""

    MACHINES = "the machines of a binding"
    SIMULATED = "a simulated cell"
    NOTHING = "no machines, as a dry run"


@dataclass(frozen=True, slots=True)
class Files:
    """What a run writes, and where it goes on."""

    journal: Journal
    recorder: Recorder
    cell: CellLog | None
    begin_seconds: float
    is_taken_up: bool
    """Whether it goes on from where an earlier process, or bundle, was."""
    elsewhere: Elsewhere | None = None
    """Which machines are not where the journal has them."""


@contextmanager
def opened(
    decomposition: Decomposition,
    digest: str,
    journal_path: Path | str | None,
    trace: LineStream | Path | str | None,
    *,
    simulated: tuple[PlantModel, int, int] | None = None,
    machines: tuple[str, ...] = (),
    on: On = On.MACHINES,
    at: Mapping[str, str] = NOWHERE,
) -> Iterator[Files]:
    """The files of a run, for as long as it lasts; without a journal nothing is taken up.

    `simulated` are plant, workpieces and seed of the simulated cell that would have to be where it was, if there is
    one; `machines` those of one host among others, whose clock goes on while it is down; `on` is what runs without a
    simulated cell are on, and `at` where each machine of a binding is.

    Raises `InputError` F5031-F5034 for a journal that cannot be gone on with, F5035 for a simulated cell of another
    run, or of one whose journal is gone, F1017 for a trace that cannot be written or does not go on where it was.
    """
    net = decomposition.net
    with ExitStack() as stack:
        # What is seen without its lock is looked at before a journal is made, which a refused run would leave there.
        if isinstance(trace, Path | str):
            stack.enter_context(room_for(trace))
        if journal_path is not None and is_to_be_made(journal_path):
            if isinstance(trace, Path | str):
                _demand_an_empty_one(trace, is_taken_over=False)
            if simulated is not None:
                _demand_an_unmoved_one(cell_of := _cell_of(journal_path), past_in(cell_of, *simulated))
        journal: Journal = MemoryJournal()
        cell = None
        names = machines or (*coordinators(decomposition), *(subnet.name for subnet in decomposition.subnets))
        if journal_path is not None:
            journal = stack.enter_context(closing(SqliteJournal(journal_path, digest, names)))
            _demand_what_it_is_on(journal_path, journal, On.SIMULATED if simulated else on, names)
        kept = journal.kept(TRACE).get(KEY)
        begun = any(journal.kept(name) for name in names)
        is_taken_over = begun and kept is None
        moved = _moved(decomposition, journal, at)
        if isinstance(trace, Path | str):
            if begun and not is_taken_over:
                _demand_the_same(trace, kept)
            elif journal_path is not None or simulated is None:
                _demand_an_empty_one(trace, is_taken_over=is_taken_over)
        if journal_path is not None and simulated is not None:
            cell = stack.enter_context(closing(CellLog(_cell_of(journal_path), *simulated)))
            if begun:
                _demand_the_cell(cell, net, kept)
            else:
                _demand_an_unmoved_one(cell.path, cell.past)
        if isinstance(trace, Path | str):
            trace = stack.enter_context(closing(TraceFile(trace, size_bytes_of(kept))))
        now = time.time() if machines else 0.0
        start = start_of(decomposition, names, journal) if is_taken_over else None
        recorder = Recorder(net, net_digest(net), trace, kept, machines, now, start, cell)
        last = max(recorder.at_seconds, cell.end_seconds if cell is not None else 0.0, now - recorder.began)
        yield Files(journal, recorder, cell, last, begun, moved)


def _cell_of(journal: Path | str) -> Path:
    """The log of the simulated cell of a journal."""
    return Path(f"{journal}.cell")


def _demand_what_it_is_on(path: Path | str, journal: Journal, on: On, names: Collection[str]) -> None:
    """What a simulation or a dry run has done, no machine has done: its tokens stand where no machine is."""
    if not any(journal.kept(name) for name in names):
        journal.write(MACHINES, [Keep(ON, on.value)])
    elif (before := journal.kept(MACHINES).get(ON)) != on:
        message = f"{printable(str(path))}: the journal is of {_run_on(str(before))}, and this is {_run_on(on)}"
        hint = "name another journal: the machines of this run are not where that one has left its own"
        raise InputError([Diagnostic("F5031", message, hint)])


def _run_on(on: str) -> str:
    """What an operator calls a run on that."""
    return "a dry run" if on == On.NOTHING else f"a run on {printable(on)}"


def _moved(decomposition: Decomposition, journal: Journal, at: Mapping[str, str]) -> Elsewhere | None:
    """Which machines are not where the journal has them; where none is, it has them from now on where they are."""
    has_tokens = any(journal.kept(subnet.name) for subnet in decomposition.subnets)
    before = journal.kept(MACHINES).get(AT)
    moved = elsewhere(before, at) if has_tokens else None
    if moved is None and at and at != before:
        journal.write(MACHINES, [Keep(AT, dict(at))])
    return moved


def _demand_the_same(path: Path | str, kept: Stored | None) -> None:
    """A trace goes on in the file in which it was begun, or it would not be a trace of the net."""
    if size_bytes_of(kept) or _lines_of(kept):
        if Path(path).exists() or not size_bytes_of(kept):
            return
        message = f"{printable(str(path))}: the trace of this run is not there, and cannot be begun in the middle"
        hint = "name the file in which the trace was begun, or leave --trace out"
    else:
        message = f"{printable(str(path))}: this run was begun without a trace, which cannot be begun in the middle"
        hint = "leave --trace out, or begin with a new journal"
    raise InputError([Diagnostic("F1017", message, hint)])


def _demand_an_empty_one(path: Path | str, *, is_taken_over: bool) -> None:
    """What machines have done once is in no other file than its trace: a run that begins one writes over none.

    That of a simulated cell without a journal may be written over, as what the same command makes again.
    """
    with suppress(OSError, ValueError):  # what cannot be looked at, `TraceFile` refuses
        if Path(path).is_file() and Path(path).stat().st_size:
            of = "a run that was taken over" if is_taken_over else "this run"
            message = f"{printable(str(path))}: the trace of {of} begins anew, and this file has lines"
            hint = "name another file, or the journal of the run that it is of"
            if is_taken_over:
                hint = "name another file; `firable replay` judges each with the bundle of its time"
            raise InputError([Diagnostic("F1017", message, hint)])


def _lines_of(kept: Stored | None) -> str:
    return str(kept["lines"]) if isinstance(kept, dict) else ""


def _demand_the_cell(cell: CellLog, net: Net, kept: Stored | None) -> None:
    """What the journal tells of was done to this simulated cell, by places that the net still has."""
    message = f"{printable(str(cell.path))}: the simulated cell of this journal is empty or gone"
    hint = PUT_BACK
    sent = _sent(cell.past)
    if unknown := sorted(place for place in sent if place not in net.place_index):
        message = f"{printable(str(cell.path))}: the simulated cell was commanded by '{unknown[0]}', which is no place"
        hint = "a simulated cell is taken over only by a net that keeps the places which have commanded it"
    elif not cell.is_new:
        if isinstance(kept, dict) and isinstance(mark := kept.get(CELL), list):
            cell.demand(mark)
        return
    raise InputError([Diagnostic("F5035", message, hint)])


def _demand_an_unmoved_one(path: Path, past: Iterable[Input]) -> None:
    """Whose journal has not begun was never commanded: a command leaves when the journal has it."""
    if _sent(past):
        message = f"{printable(str(path))}: the simulated cell was commanded by a run whose journal is gone"
        hint = "put that journal back, or name another one: the machines of this cell are not at their beginning"
        raise InputError([Diagnostic("F5035", message, hint)])


def _sent(past: Iterable[Input]) -> set[str]:
    """The places that have commanded a simulated cell."""
    return {str(arguments[0]) for _, what, arguments in past if what == "send" and arguments}


def start_of(decomposition: Decomposition, names: Collection[str], journal: Journal) -> Start:
    """Where the controllers here go on, which no trace has told: after a takeover."""
    held: list[str] = []
    shown: list[str] = []
    owed: list[str] = []
    for subnet in decomposition.subnets:
        if subnet.name in names:
            controller = LocalController.restored(decomposition, subnet.name, journal.kept(subnet.name))
            held += subnet.names(controller.marking)
            shown += (s.name for s in subnet.signals if controller.word & controller.player.signal_bit(s.name))
            owed += (place for place, _ in controller.commands.owed)
    return Start(tuple(held), tuple(shown), tuple(owed))
