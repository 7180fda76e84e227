"""The journal in a file: SQLite in WAL mode, synchronous, each row with a check value, and a witness of the last sync.

SQLite makes a transaction atomic and durable (its write-ahead log is synced at each commit), is part of Python, and its
file can be looked at with any tool. What it does not promise is to notice *damage*: a flipped byte in a row is
read as it is, and a flipped byte in the log makes SQLite take the log's valid beginning for all of it and go back in
time without a word; the cell would then be commanded again what it has done. So:

- each row carries a check value over its machine, key and value, and the header one over all rows together, their sum,
  so that also a row that is missing, or an old one in the place of a new one, is noticed;
- each sync counts up the *generation*, in the transaction and, after it, in a small file beside the journal. That file
  is written and not synced: it can only be behind, and a journal that is behind it has lost what was durable. It is
  there before anything stands in the journal, empty until all of that is made, and synced once then: a journal without
  it was copied alone, and may have lost anything.

A journal is of one bundle and of certain machines, which its header names; another one's is refused (F5031), as is a
damaged one (F5032), one that another process has open (F5033), one that cannot be written (F5034), and one that a new
bundle goes on from (F5036), as a file beside it tells: a start script that was not changed would run the old bundle
beside the new one. The journal is locked as long as it is open, and the lock ends with the process, however it ends.

Rejected: a log file of our own. It would be short, and its recovery, rotation, locking and syncing would be the least
tested code on the way of every command.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final, NoReturn
from zlib import crc32

from firable.executor.journal.journal import Storing
from firable.executor.links.link import all_called
from firable.executor.protocol.messages import Effect, Keep, Stored
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

FORMAT: Final = 3
"""1 had a word in one piece (`stored_word`); 2 did not say on what its run commands (`taken_up`)."""

_SCHEMA: Final = """
    create table header (format integer, digest text, machines text, generation integer, total integer);
    create table kept (machine text, key text, value text, checked integer, primary key (machine, key)) without rowid;
"""

_Row = tuple[str, str]


class SqliteJournal:
    """The journal in the file `path`, of the machines `machines` of the bundle with this digest; made if there is none.

    Raises `InputError` F5031 for the journal of another bundle or of other machines, F5032 for a damaged one, F5033 for
    one in use, F5034 where the file cannot be read or written, F5036 for one that was taken over.
    """

    def __init__(self, path: Path | str, digest: str, machines: Iterable[str]) -> None:
        self.path = Path(path)
        self.machines = tuple(sorted(machines))
        self.witness = witness_of(self.path)
        self.rows: dict[_Row, Stored] = {}
        self.changed: dict[_Row, None] = {}
        """The rows written since the last sync, in any number of acts."""
        self.checks: dict[_Row, int] = {}
        """The check value of each row in the file."""
        self.total = 0
        self.generation = 0
        self.age = 0
        """The generation that is durable: behind `generation` while a sync is under way."""
        self.failed: InputError | None = None
        self.witness_descriptor = -1
        is_new = is_to_be_made(self.path)
        with _failures(self.path, "opened"):
            # One thread at a time uses it, and not always the same.
            self.connection = sqlite3.connect(self.path, timeout=0, isolation_level=None, check_same_thread=False)
        try:
            with _failures(self.path, "opened"):
                if is_new:
                    self._open_witness()
                self._open(digest)
            self.age = self.generation
        except BaseException:
            self.close()
            raise

    def kept(self, machine: str) -> Mapping[str, Stored]:
        """What a machine has kept, up to the last act written."""
        return {key: value for (of, key), value in self.rows.items() if of == machine}

    def write(self, machine: str, effects: Iterable[Effect]) -> None:
        """Take the writes of one act of a machine."""
        for effect in effects:
            if isinstance(effect, Keep):
                row = (machine, effect.key)
                self.changed[row] = None
                if effect.value is None:
                    self.rows.pop(row, None)
                else:
                    self.rows[row] = effect.value

    def sync(self) -> Storing | None:
        """Begin to make all acts written until now durable; F5034 where that fails, and then always: the process ends.

        What is stored is put together here, so that the thread that stores it shares nothing with the acts that go on.
        """
        if self.failed is not None:
            raise self.failed
        if not self.changed:
            return None
        written = []
        for row in self.changed:
            self.total -= self.checks.pop(row, 0)
            if row in self.rows:
                value = json.dumps(self.rows[row])
                self.checks[row] = check = _check(*row, value)
                self.total += check
                written.append((*row, value, check))
        deleted = [row for row in self.changed if row not in self.rows]
        self.changed.clear()
        self.generation += 1
        return partial(self._store, written, deleted, self.generation, self.total)

    def _store(
        self, written: list[tuple[str, str, str, int]], deleted: list[_Row], generation: int, total: int
    ) -> None:
        try:
            with _failures(self.path, "written"):
                run = self.connection.execute
                run("begin immediate")
                self.connection.executemany("insert or replace into kept values (?, ?, ?, ?)", written)
                self.connection.executemany("delete from kept where machine = ? and key = ?", deleted)
                run("update header set generation = ?, total = ?", (generation, total))
                run("commit")
                self._bear_witness(generation)
        except InputError as error:
            self.failed = error
            raise
        self.age = generation

    def close(self) -> None:
        """Let go of the file; what is not synced is lost."""
        self.connection.close()
        with suppress(OSError):
            os.close(self.witness_descriptor)
        self.witness_descriptor = -1

    def _open(self, digest: str) -> None:
        run = self.connection.execute
        run("pragma locking_mode = exclusive")  # held from the first reading until the process is gone
        run("pragma journal_mode = wal")
        run("pragma synchronous = full")
        run("begin exclusive")
        refuse_taken_over(self.path)  # it may have been while this waited
        tables = {name for (name,) in run("select name from sqlite_master where type = 'table'")}
        if not tables and _durable(self.path) == "":  # it was being made, if not now
            for statement in filter(str.strip, _SCHEMA.split(";")):
                run(statement)
            header = (FORMAT, digest, json.dumps(self.machines), 0, 0)
            run("insert into header values (?, ?, ?, ?, ?)", header)
            run("commit")
        else:
            run("commit")
            self._read(digest)
        self._open_witness()
        self._bear_witness(self.generation)
        os.fsync(self.witness_descriptor)  # once, so that a power cut leaves an older number there, and not none
        sync_folder(self.path.parent)

    def _open_witness(self) -> None:
        if self.witness_descriptor < 0:
            self.witness_descriptor = os.open(self.witness, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)

    def _read(self, digest: str) -> None:
        run = self.connection.execute
        problems = [str(problem) for (problem,) in run("pragma integrity_check") if problem != "ok"]
        if problems:
            _damaged(self.path, problems[0])
        if not run("select count(*) from sqlite_master").fetchone()[0]:
            _damaged(self.path, _gone(self.path) if self.witness.exists() else _NOTHING, is_alone=True)
        headers = run("select format, digest, machines, generation, total from header").fetchall()
        if len(headers) != 1 or not isinstance(headers[0][3], int):
            _damaged(self.path, "its header is missing")
        its_format, its_digest, machines, self.generation, total = headers[0]
        if (its_format, its_digest, machines) != (FORMAT, digest, json.dumps(self.machines)):
            self._foreign(its_format, its_digest, str(machines), digest)
        for machine, key, value, check in run("select machine, key, value, checked from kept"):
            is_text = isinstance(machine, str) and isinstance(key, str) and isinstance(value, str)
            if not is_text or check != _check(machine, key, value):
                _damaged(self.path, f"what '{printable(str(machine))}' kept under '{printable(str(key))}' has changed")
            self.rows[machine, key] = json.loads(value)
            self.checks[machine, key] = check
        self.total = sum(self.checks.values())
        if self.total != total:
            _damaged(self.path, "rows are missing, or are older than the others")
        durable = _durable(self.path)
        if durable == "" and not self.generation:  # the process ended when all was made, and nothing stored
            return
        if not durable or not durable.isdigit():
            told = f"{printable(self.witness.name)} beside it is {'no number' if durable else 'missing or empty'}"
            _damaged(self.path, told, is_alone=durable is None)
        if int(durable) > self.generation:
            _damaged(
                self.path, f"it has lost what was stored: it is at sync {self.generation}, and {int(durable)} were done"
            )

    def _bear_witness(self, generation: int) -> None:
        os.pwrite(self.witness_descriptor, f"{generation:020}\n".encode(), 0)

    def _foreign(self, its_format: Any, its_digest: Any, machines: str, digest: str) -> NoReturn:
        path = printable(str(self.path))
        hint = "name another journal, or run the bundle that the journal belongs to"
        if its_format != FORMAT:
            hint = "end its run with the firable that has written it, with the machines at the initial marking, and "
            hint += "name another journal then"
            message = f"{path}: the journal has format {its_format}, and this firable writes {FORMAT}"
        elif its_digest != digest:
            message = f"{path}: the journal is of the bundle {str(its_digest)[:12]}, and this one is {digest[:12]}"
        else:
            # The header as it is, where it does not say whose the journal is.
            with suppress(ValueError, TypeError):
                machines = all_called(map(str, json.loads(machines)))
            message = f"{path}: the journal is of {printable(machines)}, and not of {all_called(self.machines)}"
        if its_format == FORMAT and its_digest != digest:
            hint += "; `firable takeover` lets a new bundle go on where that one has stopped"
        raise InputError([Diagnostic("F5031", message, hint)])


def witness_of(path: Path | str) -> Path:
    """The file beside a journal that tells of its last sync."""
    return Path(f"{Path(path)}.generation")


def is_to_be_made(path: Path | str) -> bool:
    """Whether no journal is there yet, as far as that is seen without its lock; nothing is made by looking.

    Raises `InputError` F5032 where one was there and is gone, F5034 where that cannot be seen, F5036 where a new bundle
    goes on from it.
    """
    path = Path(path)
    refuse_taken_over(path)
    with _failures(path, "opened"):
        told = _durable(path)  # before the journal, which another process makes before it writes a number there
        is_new = not path.exists() or not path.stat().st_size
        if is_new and told:
            _damaged(path, _gone(path), is_alone=True)
    return is_new


def _durable(path: Path) -> str | None:
    """What the witness of a journal says, if it is there."""
    witness = witness_of(path)
    return witness.read_text("ascii", "replace").strip() if witness.exists() else None


def _gone(path: Path) -> str:
    return f"it is gone or empty, and {printable(witness_of(path).name)} beside it tells of one"


def mark_of(path: Path | str) -> Path:
    """The file beside a journal, wherever its name leads, that says which bundle goes on from it, and where."""
    return Path(f"{os.path.realpath(path)}.taken-over")


def mark_text(net: str, journal: Path | str | None, journals: Iterable[Path | str]) -> str:
    """What it says: which net goes on, in which journal (None: without these machines), and in which in all."""
    said = None if journal is None else os.path.realpath(journal)
    return json.dumps({"net": net, "journal": said, "journals": [os.path.realpath(one) for one in journals]}) + "\n"


def machines_of(path: Path | str) -> tuple[str, ...]:
    """The machines that a journal is of, as its header names them; nothing else of it is looked at.

    Raises `InputError` F5032 where it is damaged, F5033 where it is in use, F5034 where it cannot be read.
    """
    path = Path(path)
    with _failures(path, "read"), closing(sqlite3.connect(path, timeout=0)) as connection:
        if not connection.execute("select count(*) from sqlite_master").fetchone()[0]:
            _damaged(path, _NOTHING, is_alone=True)
        headers = connection.execute("select machines from header").fetchall()
        names = json.loads(headers[0][0]) if len(headers) == 1 and isinstance(headers[0][0], str) else None
        if not isinstance(names, list):
            _damaged(path, "its header is missing")
    return tuple(map(str, names))


def refuse_taken_over(path: Path | str) -> None:
    """Raise `InputError` F5036 where a new bundle goes on from a journal; F5034 where that cannot be read."""
    with _failures(Path(path), "opened"):
        mark = mark_of(path)
        if not mark.exists():
            return
        text = mark.read_text("utf-8", "replace")
    try:
        said = json.loads(text)
        net, journal, journals = str(said["net"]), said["journal"], [Path(str(one)) for one in said["journals"]]
    except (ValueError, TypeError, KeyError):  # whatever stands there, somebody has put it there
        net, journal, journals = "another bundle", None, [Path()]
    where = "" if journal is None else f" in {printable(_from_here(str(journal)))}"
    message = f"{printable(str(path))}: the journal was taken over: '{printable(net)}' goes on{where}"
    hint = "run that one; both would command the same machines"
    if not all(map(is_written, journals)):
        mark_shown = printable(_from_here(str(mark)))
        hint = (
            "run it where its journals were brought; where the takeover was broken off, and not all of them were ever "
            f"there, take away those that are, with their .generation, then {mark_shown} and each other .taken-over"
        )
    raise InputError([Diagnostic("F5036", message, hint)])


def is_written(journal: Path | str) -> bool:
    """Whether something stands in a journal, as far as that can be seen here."""
    try:
        return Path(journal).is_file() and Path(journal).stat().st_size > 0
    except (OSError, ValueError):
        return False


def _from_here(path: str) -> str:
    """A path as one would write it here, where that is short."""
    return os.path.relpath(path) if Path(path).is_relative_to(Path.cwd()) else path


_NOTHING: Final = "nothing stands in it"


def _damaged(path: Path, what: str, *, is_alone: bool = False, is_alien: bool = False) -> NoReturn:
    message = f"{printable(str(path))}: the journal is damaged: {what}"
    name = printable(path.name)
    files = f"{name}, {name}-wal, {name}.generation and {name}.cell"
    hint = (
        "what the cell did last is not known from it: look at the machines and bring the cell to its initial "
        f"marking, then move {files} away (those there are), and start anew"
    )
    if is_alone:
        hint = f"where it was copied without {name}-wal and {name}.generation, copy these, too; else {hint}"
    if is_alien:
        hint = f"where {name} was never a journal, name the one that is; else {hint}"
    raise InputError([Diagnostic("F5032", message, hint)])


@contextmanager
def _failures(path: Path, done: str) -> Iterator[None]:
    shown = printable(str(path))
    try:
        yield
    except (sqlite3.Error, OSError, ValueError) as error:  # ValueError: a path with a NUL in it, a row that is none
        name = getattr(error, "sqlite_errorname", "")
        if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
            message = f"{shown}: the journal is in use by another process"
            hint = "one process at a time runs these machines: stop that one first, or name another journal"
            raise InputError([Diagnostic("F5033", message, hint)]) from None
        if name.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB", "SQLITE_ERROR")) or not (
            name or isinstance(error, OSError)
        ):
            _damaged(path, str(error), is_alien=name.startswith("SQLITE_NOTADB"))
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        if name.startswith(("SQLITE_CANTOPEN", "SQLITE_IOERR", "SQLITE_READONLY")):
            reason = _why_not_opened(path) or reason
        message = f"{shown}: the journal cannot be {done}: {reason}"
        hint = "name a folder on a disk with room, that you may write to"
        if (
            done == "written"
        ):  # in another folder the run would begin anew, beside machines that are in the middle of it
            hint = "make room on its disk, or see what is the matter with it; the same command then takes the run up"
        raise InputError([Diagnostic("F5034", message, hint)]) from None


def _check(machine: str, key: str, value: str) -> int:
    return crc32("\0".join((machine, key, value)).encode()) + 1  # never 0: an empty row counts


def _why_not_opened(path: Path) -> str:
    """Why a file cannot be opened, in the words of the system, which SQLite keeps to itself."""
    try:
        os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600))
    except OSError as error:
        return error.strerror or ""
    return ""


def sync_folder(folder: Path) -> None:
    """Make the files that were made in a folder outlive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
