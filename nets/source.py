"""The text of an input file, read with bounds, and the spans of diagnostics in it.

A reader is given a file by a person, so the file may be anything: a directory, a photograph, 100 MB of noise. Size is
asked of the file system before a byte is read, so that noise is refused at once; the bytes must be UTF-8 without NUL.
All readers (text, PNML) go through here, so each of these mistakes has one code and one wording.
"""

from __future__ import annotations

import os
import re
import stat
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from firable.nets.archive import SIGNATURE
from firable.nets.diagnostics import Diagnostic, InputError, Span, did_you_mean

EXCERPT_CHARACTERS_MAX: Final = 100
_PASSWORD: Final = re.compile(r"""(\bpassword["']?\s*:\s*)("(?:[^"\\]|\\.)*"?|'[^']*'?|[^\s'"].*)""")
"""A password in YAML or JSON; what is printed may go anywhere, into the log of a CI run most of all."""

_DECLARED: Final = re.compile(
    rb"""\A<\?xml\b[^>]*?\sencoding\s*=\s*["'](iso-8859-\d+|us-ascii|windows-\d+)["']""", re.IGNORECASE
)
"""The encodings with one byte for a character that an XML file may declare."""
_BREAK: Final = re.compile(r"\s*[\t-\r\x1c-\x1e\x85\u2028\u2029]\s*")
_BLANK: Final = re.compile(r"\s")
"""One of any width, or at which no line is broken, as French has before a colon: Python calls it not printable."""


@dataclass(frozen=True)
class Source:
    """A text and the name of the file that it came from."""

    file: str
    text: str

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """The lines of the text, divided as YAML and XML divide them."""
        return tuple(self.text.replace("\r\n", "\n").replace("\r", "\n").split("\n"))

    def span(self, line: int, column: int, length: int = 1) -> Span:
        """The span at a line and column (both from 1), with its excerpt, in which no password is shown."""
        text = self.lines[line - 1] if 0 < line <= len(self.lines) else ""
        text = _PASSWORD.sub(lambda found: found[1] + "*" * len(found[2]), text)
        start = 1
        if len(text) > EXCERPT_CHARACTERS_MAX:
            first = max(0, min(column - 1 - EXCERPT_CHARACTERS_MAX // 3, len(text) - EXCERPT_CHARACTERS_MAX))
            last = first + EXCERPT_CHARACTERS_MAX
            window = ("…" if first else "") + text[first:last] + ("…" if last < len(text) else "")
            start = first if first else 1
            text = window
        return Span(self.file, line, column, printable(text), max(1, length), start)

    def span_at(self, offset: int, length: int = 1) -> Span:
        """The span at a character (from 0) of the whole text."""
        before = Source(self.file, self.text[:offset]).lines
        return self.span(len(before), len(before[-1]) + 1, length)

    def with_parts(self, parts: Iterable[tuple[int, int, int, str]]) -> str:
        """The text with parts of lines replaced, each by line, column (from 1), length and the new text."""
        lines = re.split(r"(\r\n|\r|\n)", self.text)  # lines at even indexes, their ends between them
        for line, column, length, new in sorted(parts, reverse=True):
            text = lines[2 * (line - 1)]
            lines[2 * (line - 1)] = text[: column - 1] + new + text[column - 1 + length :]
        return "".join(lines)

    def refuse(self, code: str, message: str, hint: str, line: int = 1, column: int = 1, length: int = 1) -> InputError:
        """The error with one diagnostic at a place of this text."""
        return InputError([Diagnostic(code, message, hint, span=self.span(line, column, length))])


def printable(text: str) -> str:
    """The text with a middle dot for each character that a terminal would obey or hide; as many characters.

    >>> printable("a\\tb\\x1b[31m")
    'a b·[31m'
    """
    return "".join(c if c.isprintable() else " " if c == "\t" else "·" for c in text)


def one_line(text: str) -> str:
    """The text on one line, and printable: what stands in a file must not look like what is said of it.

    >>> one_line("  1. G1  hand over\\n::error::all is well")
    '  1. G1  hand over ::error::all is well'
    >>> one_line("poser\\u00a0: z.\\u202fB.")
    'poser : z. B.'
    """
    return text if text.isprintable() else printable(_BLANK.sub(" ", _BREAK.sub(" ", text)))


def quoted(text: str) -> str:
    """The text in quotes for a message, on one line and not too long."""
    return f"'{printable(text if len(text) <= 60 else text[:59] + '…')}'"


def read_source(path: str | Path, size_bytes_max: int) -> Source:
    """Read a UTF-8 text file of at most `size_bytes_max` bytes.

    Raises `InputError`: F1001 where there is no such file or it may not be read, F1003 where it is too large, F1004
    where it is not text.
    """
    return source_of(path, read_bytes(path, size_bytes_max))


def source_of(path: str | Path, data: bytes) -> Source:
    """The text of a file whose bytes are read; raises `InputError` F1004 where they are not text."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        at = error.start + (len(BOM_UTF8) if data.startswith(BOM_UTF8) else 0)  # it is counted from behind the mark
        raise _no_text(path, data, at, f"not UTF-8 text: byte {at} is 0x{data[at]:02x}") from None
    if "\0" in text:
        raise _no_text(path, data, (at := data.index(0)), f"not text: byte {at} is NUL")
    return Source(str(path), text)


def xml_text(data: bytes) -> str:
    """The text of an XML file for messages, by the encoding that it declares; what is no text there is marked.

    >>> xml_text('<?xml version="1.0" encoding="ISO-8859-1"?><für/>'.encode("latin-1"))[-6:]
    '<für/>'
    """
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode("utf-16", "replace")
    declared = _DECLARED.match(data)
    try:
        return data.decode(declared[1].decode() if declared else "utf-8-sig", "replace")
    except LookupError:
        return data.decode("utf-8-sig", "replace")


def _no_text(path: str | Path, data: bytes, at: int, message: str) -> InputError:
    """The refusal of bytes that are no text, at the line and column of the first that is none."""
    source = Source(printable(str(path)), data.decode("utf-8-sig", "replace"))
    before = Source("", data[:at].decode("utf-8-sig")).lines
    hint = "save the file as UTF-8 text"
    if data.startswith(SIGNATURE):
        hint = "this is a bundle, or another archive: `firable run` reads a bundle"
    return source.refuse("F1004", message, hint, len(before), len(before[-1]) + 1)


def read_bytes(path: str | Path, size_bytes_max: int) -> bytes:
    """Read a file of at most `size_bytes_max` bytes, asking for the size before reading.

    Raises `InputError`: F1001 where there is no such file or it may not be read, F1003 where it is too large.
    """
    path = Path(path)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            with os.scandir(path) as entries:
                next(entries, None)  # one that may not be looked into is told as such
            raise _refusal(path, "F1001", "this is a directory", "name a file in it")
        if not stat.S_ISREG(status.st_mode):
            raise _refusal(path, "F1001", "this is not a regular file", "name a file that can be read twice")
        if status.st_size > size_bytes_max:
            found = f"{status.st_size:,} bytes are more than such a file can need ({size_bytes_max:,})"
            raise _refusal(path, "F1003", found, "is this the right file?")
        with path.open("rb") as stream:
            data = stream.read(size_bytes_max + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        hint = f"{_beside(path)}check the path and the permissions"
        raise _refusal(path, "F1001", f"cannot be read: {reason}", hint) from None
    if len(data) > size_bytes_max:
        raise _refusal(path, "F1003", "the file grew beyond the limit while it was read", "is something writing to it?")
    return data


def _beside(path: Path) -> str:
    """The start of a hint that names the file of the same folder which was probably meant."""
    try:
        names = [] if path.exists() else sorted(one.name for one in path.parent.iterdir() if one.is_file())
    except (OSError, ValueError):  # ValueError: a NUL in the path
        return ""
    return did_you_mean(path.name, names)


def _refusal(path: str | Path, code: str, message: str, hint: str) -> InputError:
    return InputError([Diagnostic(code, message, hint, span=Span(printable(str(path)), 1, 1))])
