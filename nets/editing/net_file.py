"""A net file on the disk that is being edited: read, and written only where it is still what was read.

Somebody may have the same file open in an editor. So a file is known by the bytes that it had, and is written over only
while it has them: who comes second is told (F1019) and can read it again, and no change is lost in silence. Between
that look and the rename another program could still write; a lock would be one that no editor takes.
"""

from __future__ import annotations

import codecs
import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import Source, read_bytes, source_of
from firable.nets.text import SIZE_BYTES_MAX
from firable.nets.writing import write_whole


@dataclass(frozen=True)
class NetFile:
    """The text of a file as it was read, and by which bytes it is known again."""

    path: Path
    source: Source
    version: str
    has_mark: bool = False
    """Whether the file begins with the mark of UTF-8 that some editors write."""

    @classmethod
    def read(cls, path: str | Path) -> NetFile:
        """The file as it is; raises `InputError` as `read_source` does."""
        data = read_bytes(path, SIZE_BYTES_MAX)
        return cls(Path(path), source_of(path, data), _version(data), data.startswith(codecs.BOM_UTF8))

    def is_current(self) -> bool:
        """Whether the file on the disk is still what was read; a file that is gone is not."""
        try:
            return _version(read_bytes(self.path, SIZE_BYTES_MAX)) == self.version
        except InputError:
            return False

    def may_be_written(self) -> bool:
        """Whether this process has the right to write it."""
        return os.access(self.path, os.W_OK)

    def written(self, text: str) -> NetFile:
        """The file with another text, on the disk; where it had other line ends than that, they are those that it had.

        Raises `InputError`: F1019 where the file is not what was read any more, F1017 where it cannot be written.
        """
        if not self.is_current():
            message = f"{self.path} has been changed by somebody else since it was read"
            raise InputError([Diagnostic("F1019", message, "read it again; what was to be written is not")])
        if "\r\n" in self.source.text and "\r\n" not in text:  # as a browser hands it over
            text = text.replace("\n", "\r\n")
        data = (codecs.BOM_UTF8 if self.has_mark else b"") + text.encode()
        write_whole(self.path, data)
        return NetFile(self.path, Source(self.source.file, text), _version(data), self.has_mark)


def _version(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:24]
