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
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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


class CellLog:
    """The log in a file, made if there is none; `past` is what it held. Close it with `close`.

    Raises `InputError` F5035 where it is of another cell or run, or no log; F5034 where the file cannot be used.
    """

    def __init__(self, path: Path | str, plant: PlantModel, workpieces: int, seed: int) -> None:
        self.path = Path(path)
        self.check = 0
        """Over all lines so far, the header aside."""
        digest = hashlib.sha256(plant.model_dump_json(exclude_defaults=True).encode()).hexdigest()
        head = {
            "firable_cell": VERSION,
            "plant": plant.plant,
            "digest": digest,
            "workpieces": workpieces,
            "seed": seed,
        }
        with self._failures():
            self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
        try:
            with self._failures():
                data = self.path.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]
            first, *lines = whole.decode("utf-8", "replace").splitlines() or [""]
            self.is_new = not first
            """Whether nothing was there: then no process has ever simulated this cell."""
            is_begun = self.is_new and json.dumps(head).encode().startswith(data)
            if not is_begun and first != json.dumps(head):
                if (its := _format_of(first)) not in {None, VERSION}:
                    self._refuse(f"it has format {its}, and this firable writes {VERSION}")
                self._refuse(f"it is not of {workpieces} workpieces with the seed {seed} in this plant '{plant.plant}'")
            past, checks = [], [self.check]
            for line in lines:
                past.append(self._input(line))
                checks.append(self.check)
            self.past: tuple[Input, ...] = tuple(past)
            self.past_checks = tuple(checks)
            self.count = len(past)
            with self._failures():
                os.truncate(self.descriptor, len(whole))  # now that it is known to be ours
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
            self._refuse(f"it has {len(self.past)} of the {count} inputs that it had when {_WRITTEN}", PUT_BACK)
        if self.past_checks[count] != check:
            self._refuse(f"its first {count} inputs are not those that it had when {_WRITTEN}", PUT_BACK)

    def add(self, at_seconds: float, what: str, *arguments: str | int) -> None:
        """Write an input, before it has its effect."""
        whole = [at_seconds, what, *arguments]
        check = self._check_of(whole)
        self._write([*whole, check])
        self.count, self.check = self.count + 1, check  # what was not written whole is none

    def close(self) -> None:
        """Close the file."""
        os.close(self.descriptor)

    def _write(self, line: Any) -> None:
        with self._failures():
            # One call, so that a process which is killed has written the line or has not begun the next. Where that has
            # written a part only, the disk is full, and the next one says so.
            rest = (json.dumps(line) + "\n").encode()
            while rest:
                rest = rest[os.write(self.descriptor, rest) :]

    def _input(self, line: str) -> Input:
        try:
            *whole, check = json.loads(line)
            at_seconds, what, *arguments = whole
            if check != self._check_of(whole):
                raise ValueError("another check value")
            self.check = check
            return float(at_seconds), str(what), tuple(arguments)
        except (ValueError, TypeError, RecursionError):
            self._refuse(f"'{printable(line[:60])}' is no line of it, or does not follow on the one before")

    def _check_of(self, item: list[Any]) -> int:
        """The check value that the next line has."""
        return crc32(json.dumps(item).encode(), self.check)

    def _refuse(self, why: str, hint: str = "run it as it was begun, or name another journal") -> NoReturn:
        message = f"{printable(str(self.path))}: not the simulated cell of this run: {why}"
        raise InputError([Diagnostic("F5035", message, hint)]) from None

    @contextmanager
    def _failures(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            message = f"{printable(str(self.path))}: the simulated cell cannot be kept: {error.strerror}"
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
