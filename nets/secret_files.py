"""Secrets in files: a key, a password or a token is none where everybody on this host can read it, or put in another.

What firable makes it makes for its owner alone, so that a token or a key that signs bundles was opened by somebody, and
is refused. The keys of TLS and the passwords of devices are made elsewhere, and in a container often readable by all:
there a warning must do.
"""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from firable.nets.diagnostics import Diagnostic, Severity
from firable.nets.source import printable


def is_open_to_all(path: str | Path) -> bool:
    """Whether everybody on this host can read a file, or change it."""
    with suppress(OSError, ValueError):  # who reads it tells that it cannot be read
        return bool(Path(path).stat().st_mode & (stat.S_IROTH | stat.S_IWOTH))
    return False


def warning_if_open(path: str | Path, what: str) -> Iterator[Diagnostic]:
    """The warning (F5026) that a file is open to all, where it is."""
    if is_open_to_all(path):
        name = printable(str(path))
        message = f"{name}: everybody on this host can read this {what}, or change it"
        yield Diagnostic("F5026", message, f"`chmod o-rw {name}`", severity=Severity.WARNING)
