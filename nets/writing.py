"""Writing a file whole or not at all, for everything that is written at one stroke.

The bytes go into a file beside the place, to the disk, and are renamed into the place: whoever opens the file finds
the old content or the new, also after a power failure, and never half of either. Writing into the place itself would
lose the old content first. A link is followed, so that it stays one; a device or a pipe is refused, because a rename
would put a file where it was. A trace, which grows while a cell runs, is written by
`firable.executor.operating.recorder`; it may be a pipe, if somebody reads it (`open_at_once`).
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""The errors of a disk that takes no more."""


def write_whole(path: str | Path, data: bytes | str) -> None:
    """Write a file, text as UTF-8: whole, or not at all; a file that stands there is replaced.

    Raises `InputError` F1017 where that fails for any reason: a folder stands there or is missing, the name is none,
    permission or space are lacking.
    """
    with _failures(path):
        content = data.encode() if isinstance(data, str) else data
        target = Path(os.path.realpath(path))
        _refuse_what_is_no_file(str(path), target)
        unfinished = target.with_name(f".{os.urandom(8).hex()}.unfinished")
        mode = None
        with suppress(FileNotFoundError):  # who could read what stood there can read what does, and nobody else
            mode = stat.S_IMODE(target.stat().st_mode)
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            with os.fdopen(os.open(unfinished, flags, 0o666 if mode is None else 0o600), "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            if mode is not None:
                unfinished.chmod(mode)
            unfinished.replace(target)
        finally:  # nothing is left behind, whatever ended the writing
            with suppress(OSError, ValueError):
                unfinished.unlink(missing_ok=True)


def write_secret(path: str | Path, data: bytes) -> None:
    """Write a new file that its owner alone may read: whole, or not at all; nothing that stands there is replaced.

    Raises `InputError` F1017 where that fails for any reason, as where something stands there.
    """
    with _failures(path):
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        with ExitStack() as undone:  # half a key is refused as a key, and would be taken for one in use
            undone.callback(os.unlink, path)
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            undone.pop_all()


UNREAD: Final = "it is a pipe that nobody reads"
"""Why a named pipe is not opened."""


def open_at_once(path: str | Path, flags: int) -> int:
    """Open a file that is written line by line, and wait for nobody: a pipe that nobody reads is an `OSError`."""
    try:
        descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise OSError(errno.ENXIO, UNREAD) from None
    os.set_blocking(descriptor, True)
    return descriptor


def make_folder(path: str | Path) -> None:
    """Make a folder, and those around it, where it is missing; raises `InputError` F1017."""
    with _failures(path):
        try:
            Path(path).mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise OSError(None, "this is a file, and a folder is wanted") from None


def stands(path: str | Path) -> bool:
    """Whether something stands at a path; under a name that no file can have, nothing does."""
    try:
        return Path(path).exists()
    except OSError:
        return False


def _refuse_what_is_no_file(path: str, target: Path) -> None:
    if path.endswith("/") or target.is_dir():
        raise IsADirectoryError(None, "this is a directory")
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(target.stat().st_mode):
            raise OSError(None, "this is not a regular file")


@contextmanager
def _failures(path: str | Path) -> Generator[None]:
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it, a text that is no Unicode
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        message = f"{printable(str(path)) or 'no name'}: cannot be written: {reason}"
        is_full = isinstance(error, OSError) and error.errno in FULL
        hint = "make room on its disk" if is_full else "name a file in a folder that you may write to"
        raise InputError([Diagnostic("F1017", message, hint)]) from None
