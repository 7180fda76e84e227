"""`firable convert`: between the net file and PNML."""

from __future__ import annotations

from pathlib import Path

import click

from firable.cli import text
from firable.cli.files import READ, WRITTEN_NET
from firable.cli.net_files import write_net
from firable.cli.options import load_net, write_text


@click.command(short_help="Convert a net between *.firable.yaml and PNML.")
@click.argument("source", metavar="NET", type=READ)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=WRITTEN_NET,
    required=True,
    help="*.firable.yaml or *.pnml: the extension says which.",
)
def convert(source: str, output: str) -> int:
    """Convert NET to the format of the file named by --output.

    What the other format cannot carry is said, never dropped in silence. The first line of a net file names its JSON
    Schema, by which editors complete and check it: the net.schema.json of the project, which is written beside the
    file where there is none.
    """
    from firable.nets.loading import PNML_SUFFIXES, TEXT_SUFFIXES
    from firable.nets.pnml import write_pnml

    suffix = Path(output).suffix.lower()
    if suffix not in PNML_SUFFIXES | TEXT_SUFFIXES:
        raise click.UsageError(f"cannot tell the format of '{output}': name a file *.firable.yaml or *.pnml")
    loaded = load_net(source)
    if suffix in TEXT_SUFFIXES:
        for schema in write_net(output, loaded.net)[1:]:
            click.echo(f"written: {schema}, by which editors complete and check {output}")
        lost = loaded.notes
    else:
        written, more = write_pnml(loaded.net)
        write_text(output, written)
        lost = (*loaded.notes, *more)
    for note in lost:
        text.show_diagnostic(note)
    return 0
