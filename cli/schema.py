"""`firable schema`: the JSON Schemas of what firable reads and prints."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

import click

from firable.cli.choice import OneOf


@click.command(short_help="Print the JSON Schema of net, task, plant, layout and binding files, or of what is printed.")
@click.argument("kind", type=OneOf(["net", "tasks", "plant", "layout", "bind", "report", "io"]))
def schema(kind: str) -> int:
    """Print the JSON Schema of a net, task, plant or layout file, of a binding, or of what --format json prints.

    `report` is what most commands print, `io` a line of `firable io`.

    Editors complete and check net files by it.
    """
    click.echo(schema_text(kind), nl=False)
    return 0


def schema_text(kind: str) -> str:
    """The JSON Schema of a kind of file or output, as it is printed and written."""
    return json.dumps(schema_of(kind), indent=2, ensure_ascii=False) + "\n"


def schema_of(kind: str) -> Any:
    """The JSON Schema of a kind of file or output, as data."""
    match kind:
        case "net":
            from firable.nets.document import json_schema

            return json_schema()
        case "tasks":
            from firable.nets.tasks.document import json_schema as tasks_schema

            return tasks_schema()
        case "plant":
            from firable.nets.machines.plant_file import PlantModel

            return PlantModel.model_json_schema()
        case "layout":
            from firable.nets.drawing.layout_file import LayoutModel

            return LayoutModel.model_json_schema()
        case _:
            return json.loads(files("firable.cli").joinpath(f"{kind}.schema.json").read_text(encoding="utf-8"))
