"""`--log FILE`: the log of a run, as JSON lines, in a file that may be rotated, or on standard error."""

from __future__ import annotations

import errno
import logging
import logging.handlers
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from firable.executor.operating.log import Log

F = TypeVar("F", bound="Callable[..., Any]")


def log_option(command: F) -> F:
    """The option of a run that keeps a log."""
    return click.option(
        "--log",
        metavar="FILE",
        help="Tell in JSON lines, with levels and the time of day, what happens to the run; - is standard error.",
    )(command)


@contextmanager
def log_to(path: str | None) -> Iterator[Log | None]:
    """The log that the option names, on a thread of its own; raises `InputError` F1017 where it cannot be written."""
    if path is None:
        yield None
        return
    from firable.executor.operating.aside import aside
    from firable.executor.operating.log import JsonLines, Log, logger_to

    handler = _handler(path)
    handler.setFormatter(JsonLines())
    with aside(handler.handle) as tell:
        yield Log(logger_to(_Aside(tell)))


def _handler(path: str) -> logging.Handler:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    if path == "-":
        return logging.StreamHandler(sys.stderr)
    try:
        _demand_writable(path)
        return _InFile(path, encoding="utf-8", delay=True)
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        message = f"{printable(path)}: the log cannot be written: {reason}"
        raise InputError([Diagnostic("F1017", message, "name a file in a folder that you may write to")]) from None


def _demand_writable(path: str) -> None:
    """Raise `OSError` where a log cannot be written; a run that is refused before it begins leaves no file behind."""
    if (file := Path(path)).exists():
        with file.open("ab"):
            return
    file.parent.stat()
    if not os.access(file.parent, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


class _Aside(logging.Handler):
    """Hands each record to what says it elsewhere."""

    def __init__(self, tell: Callable[[logging.LogRecord], None]) -> None:
        super().__init__()
        self.tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        """Have it said."""
        self.tell(record)


class _InFile(logging.handlers.WatchedFileHandler):
    """A log that breaks is told once, and ends no run: a cell does not stop because a disk for logs is full."""

    is_broken = False

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line, to the file that has the name now."""
        try:
            self.reopenIfNeeded()
            stream = self.stream or self._open()  # none where it could not be opened anew before
            self.stream = stream
            stream.write(f"{self.format(record)}\n")
            stream.flush()
        except (OSError, ValueError) as error:
            if not self.is_broken:
                self.is_broken = True
                click.echo(f"  the log {self.baseFilename} cannot be written any more: {error}", err=True)
