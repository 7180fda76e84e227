"""`--log FILE`: the log of a run, as JSON lines, in a file that may be rotated, or on standard error."""

from __future__ import annotations

import errno
import logging
import logging.handlers
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

    from firable.executor.operating.log import Log

F = TypeVar("F", bound="Callable[..., Any]")


def log_option(command: F) -> F:
    """The option of a run that keeps a log."""
    return click.option(
        "--log",
        metavar="FILE",
        help="Tell in JSON lines, with levels and the time of day, what happens to the run; - is standard error.",
    )(command)


def log_to(path: str | None) -> Log | None:
    """The log that the option names; raises `InputError` F1017 where it cannot be written."""
    if path is None:
        return None
    from firable.executor.operating.log import Log, logger_to
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    if path == "-":
        return Log(logger_to(logging.StreamHandler(sys.stderr)))
    try:
        _demand_writable(path)
        return Log(logger_to(_InFile(path, encoding="utf-8", delay=True)))
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
