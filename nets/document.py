"""The shape of a `*.firable.yaml` file, as pydantic models: the one definition behind the reader and the JSON Schema.

The models say which keys exist and what kind of value each takes, nothing more: whether a name is declared, an arc
double or an owner missing is the business of `Net`, which holds the rules for every way a net is made. Short forms (one
name for a list of one name, nothing for an empty mapping) are made long by validators that tell the schema what they
accept. The alternative, a hand-written schema beside a hand-written reader, has two truths.

To add a key: a field here, its use in `text` and in `printing`, its row in the refusal tests.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from firable.nets.time_limits import TIME_PATTERN

DIGITS_MAX: Final = 18
"""The digits of the longest number."""

_DIGITS: Final = re.compile(rf"0|-?[1-9][0-9]{{0,{DIGITS_MAX - 1}}}")


def as_list(value: object) -> object:
    """One name as the list of it alone."""
    # Nothing is no list: `{from: , to: b}` is a name forgotten, and would be a transition that waits for nothing.
    return [value] if isinstance(value, str) else value


def given(value: object) -> object:
    """What stands behind a key, which may be left out, but not be alone: `until:` is a name forgotten, not none."""
    if value is None:
        raise PydanticCustomError("nothing_given", "nothing")
    return value


def _with_arcs(value: object) -> object:
    # Nothing is no transition: it would fire for ever, where somebody has yet to say what it takes.
    if value is None:
        raise PydanticCustomError("no_arcs", "nothing")
    return value


def as_integer(value: object) -> object:
    """A text of digits as the number it is; anything else as it was."""
    # The reader resolves no numbers, so that a name such as `007` stays as it is written.
    return int(value) if isinstance(value, str) and _DIGITS.fullmatch(value) else value


def _as_formula(value: object) -> object:
    return str(value).lower() if isinstance(value, bool) else value


def as_time(value: object) -> object:
    """A time alone as the mapping that says it."""
    return {"time": value} if isinstance(value, str) else given(value)


def _as_pair(value: object) -> object:
    if isinstance(value, list) and len(value) == 2:
        return {"from": value[0], "to": value[1]}
    return value


Name = Annotated[str, Field(min_length=1)]
Names = Annotated[list[Name], BeforeValidator(as_list, json_schema_input_type=Name | list[Name])]
OptionalName = Annotated[Name | None, BeforeValidator(given, json_schema_input_type=Name)]
OptionalNames = Annotated[Names | None, BeforeValidator(given, json_schema_input_type=Name | list[Name])]
Text = str
Integer = Annotated[int, BeforeValidator(as_integer, json_schema_input_type=int)]
OptionalNumber = Annotated[
    Annotated[Integer, Field(ge=0)] | None, BeforeValidator(given, json_schema_input_type=Annotated[int, Field(ge=0)])
]
FormulaText = Annotated[str, BeforeValidator(_as_formula, json_schema_input_type=str | bool)]


# A tuple, because a default that is a list would be copied anew for each transition, and slowly.
_NO_NAMES: Final[Any] = ()


class StrictDocument(BaseModel):
    """A mapping with no keys but its own."""

    model_config = ConfigDict(defer_build=True, extra="forbid", strict=True, frozen=True, populate_by_name=False)


class _Extensible(BaseModel):
    """A mapping whose further keys are parameters, each a text."""

    model_config = ConfigDict(defer_build=True, extra="allow", strict=True, frozen=True)
    # As pydantic's documentation has it; other type checkers object, for the attribute is mutable.
    # ty: ignore[incompatible-mutable-override]
    __pydantic_extra__: dict[str, str]  # pyright: ignore[reportIncompatibleVariableOverride]


class CommandDocument(_Extensible):
    """The output signal of a place: machine, command, and any further keys as parameters of the command."""

    machine: Name = Field(description="The machine that gets the command.")
    command: Name = Field(description="What the machine is told to do.")


class TaskUseDocument(_Extensible):
    """The registered task that a place stands for: its name, and further keys that fill its roles and parameters."""

    name: Name = Field(description="The task, by its name in the file of tasks.")


class ResourceDocument(_Extensible):
    """What a place opens to: an idle place, its machine, and any further keys as parameters for the tasks."""

    to: Name = Field(description="The idle place in the detailed net, by its full name.")
    machine: Name = Field(description="The machine that the tasks command.")
    prefix: Text = Field(default="", description="What comes before the names of the machine's signals.")


class WithinDocument(StrictDocument):
    """How long the completion may take, and names for what that gives; the time alone is the short form."""

    time: str = Field(json_schema_extra={"pattern": TIME_PATTERN}, description="Such as 5s, 500ms or 2min.")
    to: OptionalName = Field(default=None, description="The fault place, one of `places`; else PLACE_fault.")
    transition: OptionalName = Field(default=None, description="The fault transition; else CONTROLLER.PLACE_timeout.")
    timer: OptionalName = Field(default=None, description="The signal that the time is over; else PLACE_overdue.")


OptionalCommand = Annotated[CommandDocument | None, BeforeValidator(given, json_schema_input_type=CommandDocument)]


class PlaceDocument(StrictDocument):
    """A place; nothing after its name is a place without a command."""

    send: OptionalCommand = Field(default=None, description="The command sent when a token enters.")
    until: OptionalName = Field(
        default=None, description="The completion signal that lets the token out, by its local name."
    )
    within: Annotated[
        WithinDocument | None,
        BeforeValidator(
            as_time,
            json_schema_input_type=WithinDocument | Annotated[str, Field(json_schema_extra={"pattern": TIME_PATTERN})],
        ),
    ] = Field(default=None, description="How long the completion may take before the token goes to a fault place.")
    task: Annotated[TaskUseDocument | None, BeforeValidator(given, json_schema_input_type=TaskUseDocument)] = Field(
        default=None, description="The registered task that the place stands for."
    )
    opens: Annotated[ResourceDocument | None, BeforeValidator(given, json_schema_input_type=ResourceDocument)] = Field(
        default=None, description="The resource that the place stands for."
    )
    description: Text = Field(default="", description="What is so, or is being done, while a token is here.")


Places = dict[Name, PlaceDocument | None]


class ControllerDocument(StrictDocument):
    """A controller: what is nested in it is owned by it."""

    coordinator: bool = Field(default=False, description="Whether it coordinates the others.")
    under: OptionalName = Field(default=None, description="The coordinator above it, if not that of the whole net.")
    description: Text = Field(default="", description="What it controls, for a reader.")
    start: Names = Field(default=[], description="The places that hold a token at first.")
    inputs: Names = Field(default=[], description="The sensors, signals that no command clears, by their local names.")
    places: Places | None = Field(default=None, description="Its places, called `controller.place` elsewhere.")


class TransitionDocument(StrictDocument):
    """A transition; `if` and `unless` name places (internal gates) or signals (external gates).

    `{}` is one that takes and puts nothing, and so may always fire.
    """

    number: OptionalNumber = Field(default=None, description="The number in the coordinator table.")
    inputs: Names = Field(default=_NO_NAMES, alias="from", description="The places of which it takes the tokens.")
    outputs: Names = Field(
        default=_NO_NAMES, alias="to", description="The places that it puts tokens on; it waits until they are empty."
    )
    permissive: Names = Field(
        default=_NO_NAMES, alias="if", description="It waits until these places hold a token and these signals are 1."
    )
    inhibitive: Names = Field(
        default=_NO_NAMES, alias="unless", description="It waits until these places are empty and these signals are 0."
    )
    description: Text = Field(default="", description="What happens when it fires.")


class ArbiterDocument(StrictDocument):
    """How the conflict between the transitions `among` is decided."""

    among: Names = Field(description="The transitions that compete, in the order that `by` speaks of.")
    by: Literal["priority", "order", "rotation"] = Field(
        default="priority",
        description="priority: always in this order. rotation: turned so that who has won stands last; of several who "
        "win in one step, those who stand before the first who loses. order: in this sequence, which may name one of "
        "them more than once, and is read on from behind who has won in the same way.",
    )


class LeadsToDocument(StrictDocument):
    """Whenever `from` holds, `to` holds then or later."""

    source: FormulaText = Field(alias="from", description="What happens first.")
    target: FormulaText = Field(alias="to", description="What follows, at once or later.")
    fairness: Literal["none", "weak", "strong"] = Field(
        default="weak",
        description="Of which transitions it is assumed that they fire: of none, of those that stay firable (weak), "
        "or of those that are firable again and again (strong).",
    )


PATTERNS: Final = ("never", "always", "reachable", "leads_to", "always_possible")
LOGICS: Final = ("ctl", "ltl")


class PropertyDocument(StrictDocument):
    """One temporal pattern, or one formula of CTL or LTL."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        json_schema_extra={"oneOf": [{"required": [pattern]} for pattern in (*PATTERNS, *LOGICS)]},
    )

    never: FormulaText | None = Field(default=None, description="Holds in no reachable marking.")
    always: FormulaText | None = Field(default=None, description="Holds in every reachable marking.")
    reachable: FormulaText | None = Field(default=None, description="Holds in some reachable marking.")
    leads_to: (
        Annotated[
            LeadsToDocument,
            BeforeValidator(
                _as_pair,
                json_schema_input_type=LeadsToDocument
                | Annotated[list[FormulaText], Field(min_length=2, max_length=2)],
            ),
        ]
        | None
    ) = Field(default=None, description="Whenever `from` holds, `to` holds then or later; in short: [from, to].")
    always_possible: FormulaText | None = Field(
        default=None, description="Can be reached from every reachable marking."
    )
    ctl: FormulaText | None = Field(default=None, description="A formula of CTL, which must hold at first.")
    ltl: FormulaText | None = Field(default=None, description="A formula of LTL, which every run must satisfy.")

    @model_validator(mode="after")
    def _one_pattern(self) -> PropertyDocument:
        count = sum(getattr(self, pattern) is not None for pattern in (*PATTERNS, *LOGICS))
        if count != 1:
            said = f"one of {', '.join((*PATTERNS, *LOGICS))} is wanted, {count or 'none'} given"
            raise PydanticCustomError("refused", said, {"hint": "write one pattern for each property"})
        return self


class NetDocument(StrictDocument):
    """A whole file."""

    firable: Annotated[Literal[1], BeforeValidator(as_integer, json_schema_input_type=Literal[1])] = Field(
        description="The version of the format."
    )
    cell: Text = Field(description="The name of the net.")
    description: Text = Field(default="", description="What the cell does, for a reader.")
    controllers: dict[Name, ControllerDocument | None] | None = Field(
        default=None, description="The controllers by their names; what is nested in one is owned by it."
    )
    start: Names = Field(default=[], description="The places without an owner that hold a token at first.")
    inputs: Names = Field(default=[], description="The sensors without an owner.")
    places: Places | None = Field(default=None, description="The places without an owner.")
    transitions: (
        dict[
            Name, Annotated[TransitionDocument, BeforeValidator(_with_arcs, json_schema_input_type=TransitionDocument)]
        ]
        | None
    ) = Field(
        default=None,
        description="The transitions by their names; of those that several controllers share, each has a part.",
    )
    arbiters: dict[Name, ArbiterDocument] | None = Field(
        default=None, description="Who goes first where transitions compete; else it is the order of the file."
    )
    properties: dict[Name, PropertyDocument] | None = Field(
        default=None, description="What `firable check` shall show of this net; a bundle needs all of them proved."
    )
    expect: dict[Name, Literal["proved", "violated"]] | None = Field(
        default=None,
        description="Verdicts of `firable check` that are known to end so: it fails when one of them changes.",
    )


def json_schema() -> dict[str, Any]:
    """The JSON Schema of the format, for editors and other readers.

    >>> json_schema()["title"]
    'firable net file'
    """
    schema = NetDocument.model_json_schema(by_alias=True, mode="validation")
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "firable net file"
    return schema
