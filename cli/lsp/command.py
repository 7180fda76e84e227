"""`firable lsp`: the language server for editors."""

from __future__ import annotations

import os
import sys

import click


@click.command(short_help="Serve net files to an editor (Language Server Protocol).")
def lsp() -> int:
    """Serve net files to an editor, over standard input and output (Language Server Protocol).

    Diagnostics as one types, verdicts when a file is opened or saved, hovering (what a transition waits for), go to
    definition, references, rename, completion of names. An editor starts it by itself; see docs/ci.md.
    """
    from firable.cli.lsp.server import server

    # pygls closes what it has written to, and the program writes there, too, before it ends.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as told:
        server.start_io(stdout=told)
    return 0
