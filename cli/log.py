"""`--log FILE`: the log of a run, as JSON lines, in a file that may be rotated, or on standard error."""

from __future__ import annotations

import errno
import logging
import os
import sys
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from firable.cli.files import WRITTEN

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from firable.executor.operating.log import Log

F = TypeVar("F", bound="Callable[..., Any]")


def log_option(command: F) -> F:
    """The option of a run that keeps a log."""
    return click.option(
        "--log",
        metavar="FILE",
        type=WRITTEN,
        help="Tell in JSON lines, with levels and the time of day, what happens to the run; - is standard error.",
    )(command)


@contextmanager
def log_to(path: str | None) -> Iterator[Log | None]:
    """The log that the option names, on a thread of its own; raises `InputError` F1017 where it cannot be written."""
    if path is None:
        yield None
        return
    from firable.executor.operating.aside import aside
    from firable.executor.operating.log import Log, logger_to

    with aside(_writer(path)) as tell:
        yield Log(logger_to(_Aside(tell)))


def told_aside(say: Callable[[str, str], None], log: Log | None) -> AbstractContextManager[Callable[[str, str], None]]:
    """What tells an operator a kind and a sentence, on a thread of its own; the log hears of what nobody was told."""
    from firable.executor.operating.aside import aside

    if log is None:
        return aside(say, named=lambda kind, _: kind)
    return aside(say, named=lambda kind, _: kind, left=log.untold)


def _writer(path: str) -> Callable[[str], None]:
    """What writes lines; no handler that `logging` would wait for at the end of the process, nor a stream's buffer."""
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable
    from firable.nets.writing import UNREAD

    if path == "-":
        return _on_standard_error
    log = _InFile(path)
    try:
        log.demand_writable()
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        message = f"{printable(path)}: the log cannot be written: {reason}"
        hint = "name a file in a folder that you may write to"
        if reason == UNREAD:
            hint = "start who reads it before the run, or name a file"
        raise InputError([Diagnostic("F1017", message, hint)]) from None
    return log.write


class _Aside(logging.Handler):
    """Hands each line to what says it elsewhere, and never fails: a log that breaks ends no run."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__()
        self.tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        """Have it said, and after it how many were not."""
        from firable.executor.operating.aside import UntoldError

        try:
            self.tell(f"{self.format(record)}\n")
        except UntoldError as error:
            missing = logging.makeLogRecord({"msg": "untold", "levelname": "WARNING", "args": {"message": str(error)}})
            self.tell(f"{self.format(missing)}\n")


def _on_standard_error(line: str) -> None:
    with suppress(OSError, ValueError):  # a terminal that is gone
        try:
            descriptor = sys.stderr.fileno()
        except OSError:  # it stands for something in this process
            sys.stderr.write(line)
        else:
            _write_whole(descriptor, line)


def _write_whole(descriptor: int, line: str) -> None:
    rest = memoryview(line.encode())
    while rest:
        rest = rest[os.write(descriptor, rest) :]


class _InFile:
    """A log in the file that has the name now: it may be rotated. One that breaks is told once."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.descriptor: int | None = None
        self.is_broken = False

    def demand_writable(self) -> None:
        """Raise `OSError` where it cannot be written; a run that is refused before it begins leaves no file behind.

        One that is there stays open: who reads a pipe would take it for the end if it were closed again.
        """
        if (file := Path(self.path)).exists():
            self._opened()
            return
        file.parent.stat()
        if not os.access(file.parent, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    def write(self, line: str) -> None:
        """Write a line with its end."""
        try:
            _write_whole(self._opened(), line)
        except (OSError, ValueError) as error:
            if not self.is_broken:
                self.is_broken = True
                with suppress(OSError, ValueError):
                    click.echo(f"  the log {self.path} cannot be written any more: {error}", err=True)

    def _opened(self) -> int:
        from firable.nets.writing import open_at_once

        if self.descriptor is not None:
            try:
                if os.path.samestat(Path(self.path).stat(), os.fstat(self.descriptor)):
                    return self.descriptor
            except FileNotFoundError:
                pass  # it was moved, and is begun anew
            os.close(self.descriptor)
            self.descriptor = None
        self.descriptor = open_at_once(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        return self.descriptor
