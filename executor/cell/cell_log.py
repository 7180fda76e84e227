"""The log of a simulated cell: all that was ever done to it, so that it outlives the process that simulates it.

Real machines go on when their controller dies. A simulated cell whose controller is restarted has to be where it was,
too, and not in its initial marking with an empty table. It is a pure machine of its seed and its inputs, so its inputs
are its memory: each is a line in a file before it has any effect, and whoever reads them all has the cell back, as it
was at the last input, with what it shows and what became of each command.

    {"firable_cell": 2, "plant": "one-robot", "digest": "...", "workpieces": 10, "seed": 0}
    [12.5, "send", "robot.to_cv1", 1, 3127415032]

A line that was cut off, because the process was killed while it wrote, is an input that the cell never got. Each line
ends with a check value over itself and all before it: of inputs that have changed, or that are missing in the middle, a
cell would be made that is somewhere else than the journal left it, and nobody could tell. Lines that are missing at the
end no check value tells of, so the journal keeps with each sync how many there were, and the check value of the last
one (`mark`). Each is written before that sync, so a process that is killed leaves as many or more; fewer are left by
a power cut, for they are not synced, or by somebody who has put back an old log, and then the machines would stand
where they have been before. Rejected: the cell as a server process, which would also outlive its controller, and have
no virtual time; `firable sim` is that, for real time. Rejected: pickling the cell, which would tie the file to the code
and run what it reads.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn
from zlib import crc32

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.machines.plant_file import PlantModel
from firable.nets.source import printable

VERSION: Final = 3
"""1 had no check values, and 2 was of another cell as soon as plant files could say more."""

PUT_BACK: Final = "put it back, or begin with a new journal: its machines would not be where the journal left them"
"""What to do about a log that is not what it was."""
_WRITTEN: Final = "its journal was written last"

Input = tuple[float, str, tuple[str | int, ...]]
"""When, what, and with which arguments."""


@dataclass(frozen=True, slots=True)
class _Past:
    """What a log holds: its inputs, the check value at the beginning and behind each, and how many bytes are whole."""

    inputs: tuple[Input, ...]
    checks: tuple[int, ...]
    size_bytes: int

    @classmethod
    def of(cls, path: Path, data: bytes, head: Mapping[str, object]) -> _Past:
        """Read a log, which is to have this first line; raises `InputError` F5035."""
        whole = data[: data.rfind(b"\n") + 1]
        first, *lines = whole.decode("utf-8", "replace").splitlines() or [""]
        is_begun = not first and json.dumps(head).encode().startswith(data)
        if not is_begun and first != json.dumps(head):
            if (its := _format_of(first)) not in {None, VERSION}:
                _refuse(path, f"it has format {its}, and this firable writes {VERSION}")
            of = f"{head['workpieces']} workpieces with the seed {head['seed']} in this plant '{head['plant']}'"
            _refuse(path, f"it is not of {of}")
        inputs, checks = [], [0]
        for line in lines:
            try:
                *told, check = json.loads(line)
                at_seconds, what, *arguments = told
                if check != _check_of(told, checks[-1]):
                    raise ValueError("another check value")
                inputs.append((float(at_seconds), str(what), tuple(arguments)))
                checks.append(check)
            except (ValueError, TypeError, RecursionError):
                _refuse(path, f"'{printable(line[:60])}' is no line of it, or does not follow on the one before")
        return cls(tuple(inputs), tuple(checks), len(whole))


def past_in(path: Path | str, plant: PlantModel, workpieces: int, seed: int) -> tuple[Input, ...]:
    """What a log holds, if there is one; refused as by `CellLog`, and nothing is changed."""
    path = Path(path)
    with _failures(path), suppress(FileNotFoundError, NotADirectoryError):
        os.close(os.open(path, os.O_RDWR | os.O_CLOEXEC))
        return _Past.of(path, path.read_bytes(), _head(plant, workpieces, seed)).inputs
    return ()


class CellLog:
    """The log in a file, made if there is none; `past` is what it held. Close it with `close`.

    Raises `InputError` F5035 where it is of another cell or run, or no log; F5034 where the file cannot be used.
    """

    def __init__(self, path: Path | str, plant: PlantModel, workpieces: int, seed: int) -> None:
        self.path = Path(path)
        head = _head(plant, workpieces, seed)
        with _failures(self.path):
            self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
        try:
            with _failures(self.path):
                data = self.path.read_bytes()
            found = _Past.of(self.path, data, head)
            self.is_new = not found.size_bytes
            """Whether nothing was there: then no process has ever simulated this cell."""
            self.past = found.inputs
            self.past_checks = found.checks
            self.count = len(self.past)
            self.check = self.past_checks[-1]
            """Over all lines so far, the header aside."""
            with _failures(self.path):
                os.truncate(self.descriptor, found.size_bytes)  # now that it is known to be ours
            if self.is_new:
                self._write(head)
        except BaseException:
            os.close(self.descriptor)
            raise

    @property
    def end_seconds(self) -> float:
        """When the last input came."""
        return self.past[-1][0] if self.past else 0.0

    @property
    def mark(self) -> list[int]:
        """How many inputs there were so far, and the check value of the last."""
        return [self.count, self.check]

    def demand(self, mark: Sequence[object]) -> None:
        """Refuse (F5035) a log that has not been where this mark was made."""
        count, check = mark
        if not isinstance(count, int) or count >= len(self.past_checks):
            _refuse(self.path, f"it has {len(self.past)} of the {count} inputs that it had when {_WRITTEN}", PUT_BACK)
        if self.past_checks[count] != check:
            _refuse(self.path, f"its first {count} inputs are not those that it had when {_WRITTEN}", PUT_BACK)

    def add(self, at_seconds: float, what: str, *arguments: str | int) -> None:
        """Write an input, before it has its effect."""
        whole = [at_seconds, what, *arguments]
        check = _check_of(whole, self.check)
        self._write([*whole, check])
        self.count, self.check = self.count + 1, check  # what was not written whole is none

    def close(self) -> None:
        """Close the file."""
        os.close(self.descriptor)

    def _write(self, line: Any) -> None:
        with _failures(self.path):
            # One call, so that a process which is killed has written the line or has not begun the next. Where that has
            # written a part only, the disk is full, and the next one says so.
            rest = (json.dumps(line) + "\n").encode()
            while rest:
                rest = rest[os.write(self.descriptor, rest) :]


def _head(plant: PlantModel, workpieces: int, seed: int) -> dict[str, object]:
    """The first line of a log."""
    return {
        "firable_cell": VERSION,
        "plant": plant.plant,
        "digest": hashlib.sha256(plant.model_dump_json(exclude_defaults=True).encode()).hexdigest(),
        "workpieces": workpieces,
        "seed": seed,
    }


def _check_of(item: list[Any], before: int) -> int:
    """The check value of a line behind one with another."""
    return crc32(json.dumps(item).encode(), before)


def _refuse(path: Path, why: str, hint: str = "run it as it was begun, or name another journal") -> NoReturn:
    message = f"{printable(str(path))}: not the simulated cell of this run: {why}"
    raise InputError([Diagnostic("F5035", message, hint)]) from None


@contextmanager
def _failures(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        message = f"{printable(str(path))}: the simulated cell cannot be kept: {error.strerror}"
        hint = "name a folder that you may write to"
        if error.errno in {errno.ENOSPC, errno.EDQUOT}:
            hint = "make room on its disk; the same command then takes the run up"
        raise InputError([Diagnostic("F5034", message, hint)]) from None


def _format_of(first: str) -> int | None:
    """The format that a first line names, if it names one."""
    try:
        match json.loads(first):
            case {"firable_cell": int(its)}:
                return its
    except (ValueError, RecursionError):
        pass
    return None
