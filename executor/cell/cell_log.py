"""The log of a simulated cell: all that was ever done to it, so that it outlives the process that simulates it.

Real machines go on when their controller dies. A simulated cell whose controller is restarted has to be where it was,
too, and not in its initial marking with an empty table. It is a pure machine of its seed and its inputs, so its inputs
are its memory: each is a line in a file before it has any effect, and whoever reads them all has the cell back, as it
was at the last input, with what it shows and what became of each command.

    {"firable_cell": 1, "plant": "one-robot", "digest": "...", "workpieces": 10, "seed": 0}
    [12.5, "send", "robot.to_cv1", 1]

A line that was cut off, because the process was killed while it wrote, is an input that the cell never got. Rejected:
the cell as a server process, which would also outlive its controller, and have no virtual time; `firable sim` is
that, for real time. Rejected: pickling the cell, which would tie the file to the code and run what it reads.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.machines.plant_file import PlantModel
from firable.nets.source import printable

VERSION: Final = 1

Input = tuple[float, str, tuple[str | int, ...]]
"""When, what, and with which arguments."""


class CellLog:
    """The log in a file, made if there is none; `past` is what it held. Close it with `close`.

    Raises `InputError` F5035 where it is of another cell or run, or no log; F5034 where the file cannot be used.
    """

    def __init__(self, path: Path | str, plant: PlantModel, workpieces: int, seed: int) -> None:
        self.path = Path(path)
        digest = hashlib.sha256(repr(plant).encode()).hexdigest()
        head = {
            "firable_cell": VERSION,
            "plant": plant.plant,
            "digest": digest,
            "workpieces": workpieces,
            "seed": seed,
        }
        with self._failures():
            self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
            data = self.path.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]
            os.truncate(self.path, len(whole))
        first, *lines = whole.decode("utf-8", "replace").splitlines() or [""]
        self.is_new = not first
        """Whether nothing was there: then no process has ever simulated this cell."""
        if self.is_new:
            self._write(head)
        elif first != json.dumps(head):
            self._refuse(f"it is not of {workpieces} workpieces with the seed {seed} in this plant '{plant.plant}'")
        self.past: tuple[Input, ...] = tuple(map(self._input, lines))

    @property
    def end_seconds(self) -> float:
        """When the last input came."""
        return self.past[-1][0] if self.past else 0.0

    def add(self, at_seconds: float, what: str, *arguments: str | int) -> None:
        """Write an input, before it has its effect."""
        self._write([at_seconds, what, *arguments])

    def close(self) -> None:
        """Close the file."""
        os.close(self.descriptor)

    def _write(self, line: Any) -> None:
        with self._failures():
            # One call, so that a process which is killed has written the line or has not begun the next.
            os.write(self.descriptor, (json.dumps(line) + "\n").encode())

    def _input(self, line: str) -> Input:
        try:
            at_seconds, what, *arguments = json.loads(line)
            return float(at_seconds), str(what), tuple(arguments)
        except (ValueError, TypeError):
            self._refuse(f"'{printable(line[:60])}' is no line of it")
            raise

    def _refuse(self, why: str) -> None:
        message = f"{printable(str(self.path))}: not the simulated cell of this run: {why}"
        raise InputError([Diagnostic("F5035", message, "run it as it was begun, or name another folder")]) from None

    @contextmanager
    def _failures(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            message = f"{printable(str(self.path))}: the simulated cell cannot be kept: {error.strerror}"
            raise InputError([Diagnostic("F5034", message, "name a folder that you may write to")]) from None
