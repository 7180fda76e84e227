"""The committed JSON Schema is the generated one, and agrees with the reader on what it can judge."""

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import firable.nets
from firable.nets.catalogue import catalogue_names, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.document import json_schema
from firable.nets.drawing.layout_file import LayoutModel
from firable.nets.machines.plant_file import PlantModel
from firable.nets.printing import format_net
from firable.nets.tasks.document import json_schema as tasks_schema
from firable.nets.text import parse_net

SCHEMA = Path(str(firable.nets.__file__)).parent / "net.schema.json"


CATALOGUE = SCHEMA.parent / "catalogue"
SCHEMAS = {
    "net": json_schema,
    "tasks": tasks_schema,
    "plant": PlantModel.model_json_schema,
    "layout": LayoutModel.model_json_schema,
}
FILES = sorted(file for kind in ("firable", "tasks", "plant") for file in CATALOGUE.glob(f"*.{kind}.yaml"))
FIRST_LINE = re.compile(r"# yaml-language-server: \$schema=(.+)\n")


@pytest.mark.parametrize("kind", SCHEMAS)
def test_the_committed_schema_is_the_generated_one(kind: str) -> None:
    assert json.loads(SCHEMA.with_name(f"{kind}.schema.json").read_text("utf-8")) == SCHEMAS[kind]()


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_first_line_of_a_file_of_the_catalogue_names_its_schema(file: Path) -> None:
    text = file.read_text("utf-8")
    named = FIRST_LINE.match(text)
    assert named
    schema = json.loads((file.parent / named[1]).read_text("utf-8"))
    jsonschema.Draft202012Validator(schema).validate(yaml.safe_load(text))
    kind = file.name.split(".")[-2].replace("firable", "net")
    assert schema == SCHEMAS[kind]()


def test_an_editor_is_told_what_every_key_means() -> None:
    schema = json_schema()
    records = {"": schema, **schema["$defs"]}
    silent = [f"{kind}.{key}" for kind, one in records.items() for key, value in one.get("properties", {}).items()
              if not value.get("description")]  # fmt: skip
    assert not silent


def test_the_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema())


def errors(text: str) -> list[Any]:
    return list(jsonschema.Draft202012Validator(json_schema()).iter_errors(yaml.safe_load(text)))


@pytest.mark.parametrize("name", catalogue_names())
def test_a_file_of_the_catalogue_validates(name: str) -> None:
    text = catalogue_path(name).read_text("utf-8")
    assert errors(text) == []
    assert errors(format_net(parse_net(text))) == []


HEAD = "firable: 1\ncell: c\n"


@pytest.mark.parametrize(
    "body",
    [
        "",
        "places: {p: , q: {description: x}}\nstart: [p, q]\n",
        "places:\n",
        "controllers: {r: }\n",
        "transitions: {t: {}}\n",
        "properties: {p: {leads_to: [a, b]}}\nplaces: {a: , b: }\n",
        "properties: {p: {leads_to: {from: a, to: b, fairness: none}}}\nplaces: {a: , b: }\n",
        "properties: {p: {always: true}}\n",
        "properties: {p: {ctl: true}, q: {ltl: 'G F start'}}\n",
        "transitions: {t: {number: 3}}\n",
    ],
)
def test_what_the_reader_takes_validates(body: str) -> None:
    assert errors(HEAD + body) == []
    assert parse_net(HEAD + body).name == "c"


@pytest.mark.parametrize(
    "body",
    [
        "plases: {}\n",
        "places: [p]\n",
        "places: {p: {send: {machine: R}}}\n",
        "places: {p: {send: {machine: R, command: M, to: [a]}}}\n",
        "transitions: {t: {from: {p: q}}}\n",
        "transitions: {t: {number: one}}\n",
        "controllers: {s: {coordinator: maybe}}\n",
        "arbiters: {a: {among: [t, u], by: luck}}\n",
        "arbiters: {a: }\n",
        "properties: {p: {}}\n",
        "properties: {p: {never: a, always: b}}\n",
        "properties: {p: {ctl: a, ltl: b}}\n",
        "properties: {p: {leads_to: [a]}}\n",
        'places: {"": }\n',
    ],
)
def test_what_validation_refuses_the_reader_refuses(body: str) -> None:
    assert errors(HEAD + body) != []
    with pytest.raises(InputError):
        parse_net(HEAD + body)
