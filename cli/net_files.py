"""Net files that firable writes: each names its JSON Schema in the first line, so that editors complete and check it.

The line names a file, by the way to it from the net file, and not an address: it is right offline, in a fork, and for
the version of firable that the project was written with. Where the project has no such file yet, it gets one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from firable.cli.files import refuse_to_overwrite
from firable.cli.options import write_text

if TYPE_CHECKING:
    from firable.nets.net import Net

SCHEMA_FILE: Final = "net.schema.json"


def demand_a_net_file(path: str | None) -> None:
    """Raise `click.UsageError` where a net is to be written where nobody would look for one, or amid the report."""
    from firable.nets.loading import TEXT_SUFFIXES

    if path == "-":
        raise click.UsageError("the net cannot go to standard output, where the report goes: name a file")
    if path is not None and Path(path).suffix.lower() not in TEXT_SUFFIXES:
        raise click.UsageError(f"'{path}' is not named like a net file: name a file *.firable.yaml")


def is_schema(file: str) -> bool:
    """Whether a file that a command has written is the schema beside a net file, by its name."""
    return Path(file).name == SCHEMA_FILE


def schema_told(file: str) -> str:
    """The line that tells of a schema that was written."""
    return f"written: {file}, by which editors complete and check it"


def write_net(path: str, net: Net) -> tuple[str, ...]:
    """Write a net file; returns the files written, which may be two.

    Its schema is the nearest `net.schema.json` beside it or above it, up to the folder that the command runs in; where
    there is none, it is written beside it. Raises `InputError` F1017 as `write_text` does.
    """
    from firable.cli.schema import schema_text
    from firable.nets.printing import format_net

    found = _schema_above(Path(path).absolute())
    schema = str(Path(path).parent / SCHEMA_FILE)
    if found is None:
        refuse_to_overwrite([schema])
    write_text(path, f"# yaml-language-server: $schema={found or SCHEMA_FILE}\n{format_net(net)}")
    if found is not None:
        return (path,)
    write_text(schema, schema_text("net"))
    return path, schema


def write_nets(folder: str, nets: Mapping[str, Net]) -> tuple[str, ...]:
    """Write net files into a folder, made if it is missing, as `write_net` does; returns the files written."""
    from firable.nets.writing import make_folder

    paths = {str(Path(folder, name)): net for name, net in nets.items()}
    refuse_to_overwrite(paths)
    make_folder(folder)
    return tuple(file for path, net in paths.items() for file in write_net(path, net))


def _schema_above(file: Path) -> str | None:
    here = Path.cwd()
    for steps, folder in enumerate(file.parents):
        if (folder / SCHEMA_FILE).is_file():
            return "../" * steps + SCHEMA_FILE
        if not folder.is_relative_to(here) or folder == here:
            break
    return None
