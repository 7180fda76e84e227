"""`firable lsp`: the language server for editors."""

from __future__ import annotations

import click


@click.command(short_help="Serve net files to an editor (Language Server Protocol).")
def lsp() -> int:
    """Serve net files to an editor, over standard input and output (Language Server Protocol).

    Diagnostics as one types, verdicts when a file is opened or saved, hovering (what a transition waits for), go to
    definition, references, rename, completion of names. An editor starts it by itself; see docs/ci.md.
    """
    from firable.cli.lsp.server import server

    server.start_io()
    return 0
