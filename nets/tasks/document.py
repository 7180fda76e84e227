"""The shape of a `*.tasks.yaml` file, as pydantic models; the reader beside it says what the keys mean.

The conventions are those of the net file (`firable.nets.document`): short forms are made long, and nothing is checked
here but which keys there are and what kind of value each takes.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field

from firable.nets.document import (
    Name,
    Names,
    OptionalCommand,
    OptionalName,
    OptionalNames,
    StrictDocument,
    TaskUseDocument,
    Text,
    as_integer,
    as_time,
)
from firable.nets.document_errors import Shape, keys_of
from firable.nets.time_limits import TIME_PATTERN

_NO_NAMES: Final[Any] = ()


class StepWithinDocument(StrictDocument):
    """How long a step may take, and the step of the same role that comes then; the time alone is the short form."""

    time: str = Field(json_schema_extra={"pattern": TIME_PATTERN}, description="Such as 5s, 500ms or 2min.")
    to: OptionalName = Field(default=None, description="The fault step; else STEP_fault, which need not be declared.")


class StepDocument(StrictDocument):
    """A step: a place of the machine in this role; its name is a template, by default the name of the step."""

    place: OptionalName = Field(default=None, description="The local name of the place, a template.")
    send: OptionalCommand = Field(default=None, description="The command sent when the step begins.")
    until: OptionalName = Field(default=None, description="The completion signal that ends it, a template.")
    within: Annotated[
        StepWithinDocument | None,
        BeforeValidator(
            as_time,
            json_schema_input_type=StepWithinDocument
            | Annotated[str, Field(json_schema_extra={"pattern": TIME_PATTERN})],
        ),
    ] = Field(default=None, description="How long the completion may take before a fault step comes.")
    description: Text = ""


class RoleDocument(StrictDocument):
    """A role: the steps that its machine goes through, and the sensors that gates ask."""

    steps: dict[Name, StepDocument | None] | None = None
    inputs: dict[Name, Name | None] | None = Field(default=None, description="Sensors, each with its template.")


class MoveDocument(StrictDocument):
    """A transition between steps; `if` and `unless` name steps (internal gates) or sensors (external gates)."""

    sources: Names = Field(default=_NO_NAMES, alias="from")
    targets: Names = Field(default=_NO_NAMES, alias="to")
    permissive: Names = Field(default=_NO_NAMES, alias="if")
    inhibitive: Names = Field(default=_NO_NAMES, alias="unless")
    release: Names = Field(default=_NO_NAMES, description="The roles whose machines are idle from here on.")
    description: Text = ""


class StartDocument(StrictDocument):
    """How the task starts: on which steps (by default the first of each role), and with which gates."""

    targets: OptionalNames = Field(default=None, alias="to")
    permissive: Names = Field(default=_NO_NAMES, alias="if")
    inhibitive: Names = Field(default=_NO_NAMES, alias="unless")
    release: Names = Field(default=_NO_NAMES, description="The roles that a first subtask releases.")
    description: Text = ""


class EndDocument(StrictDocument):
    """How the task ends: from which steps (by default the last of each role that is not released)."""

    sources: OptionalNames = Field(default=None, alias="from")
    permissive: Names = Field(default=_NO_NAMES, alias="if")
    inhibitive: Names = Field(default=_NO_NAMES, alias="unless")
    description: Text = ""


class SubtaskDocument(StrictDocument):
    """A step that is itself a task."""

    task: TaskUseDocument
    description: Text = ""


class TaskDocument(StrictDocument):
    """A registered task."""

    description: Text = ""
    roles: dict[Name, RoleDocument | None]
    parameters: dict[Name, Text | None] | None = Field(default=None, description="Each with its default, if any.")
    subtasks: dict[Name, SubtaskDocument] | None = None
    start: StartDocument | None = None
    moves: dict[Name, MoveDocument] | None = None
    end: EndDocument | None = None


class CatalogueDocument(StrictDocument):
    """A whole file."""

    firable_tasks: Annotated[Literal[1], BeforeValidator(as_integer, json_schema_input_type=Literal[1])] = Field(
        description="The version of the format."
    )
    description: Text = ""
    tasks: dict[Name, TaskDocument]


SHAPE: Final = Shape(
    "firable_tasks",
    "file of tasks",
    {
        path: keys_of(model)
        for path, model in (
            ((), CatalogueDocument),
            (("tasks", "*"), TaskDocument),
            (("tasks", "*", "roles", "*"), RoleDocument),
            (("tasks", "*", "roles", "*", "steps", "*"), StepDocument),
            (("tasks", "*", "subtasks", "*"), SubtaskDocument),
            (("tasks", "*", "start"), StartDocument),
            (("tasks", "*", "moves", "*"), MoveDocument),
            (("tasks", "*", "end"), EndDocument),
        )
    },
    {"tasks": "task", "roles": "role", "steps": "step", "moves": "move", "subtasks": "subtask"},
)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of the format, for editors and other readers.

    >>> json_schema()["title"]
    'firable file of tasks'
    """
    schema = CatalogueDocument.model_json_schema(by_alias=True, mode="validation")
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "firable file of tasks"
    return schema
