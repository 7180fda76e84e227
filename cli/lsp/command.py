"""`firable lsp`: the language server for editors."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class _Told(io.BufferedWriter):
    """What goes to an editor; one that is gone is told nothing: pygls would tell it of that failure, without an end."""

    def write(self, buffer: ReadableBuffer, /) -> int:
        with suppress(OSError, ValueError):
            return super().write(buffer)
        return 0

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            super().flush()


@click.command(short_help="Serve net files to an editor (Language Server Protocol).")
def lsp() -> int:
    """Serve net files to an editor, over standard input and output (Language Server Protocol).

    Diagnostics as one types, verdicts when a file is opened or saved, hovering (what a transition waits for), go to
    definition, references, rename, completion of names. An editor starts it by itself; see docs/ci.md.
    """
    from firable.cli.lsp.server import server

    # pygls closes what it has written to, and the program writes there, too, before it ends.
    with _Told(io.FileIO(os.dup(sys.stdout.fileno()), "wb")) as told:
        server.start_io(stdout=told)
    return 0
