"""The JSON Schema of bindings: what an editor is told is what the reader of a binding says."""

import json
from importlib.resources import files
from typing import Any

import jsonschema
import pytest
import yaml

from firable.cli.schema import schema_of
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.binding_schema import json_schema
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import InputError

GOOD = """\
firable_bind: 1
cell: c
devices:
  plc:
    driver: modbus-tcp
    host: 127.0.0.1
    port: 1502
    heartbeat: {write: holding 0, every_s: 0.2, tripped: discrete 0}
    alive: {read: input 0, within_s: 1}
    safe: {coil 0: false}
    channels: {R: {number: holding 1, taken: input 1, done: input 2, failed: input 3}}
  line: {driver: modbus-rtu, port: ./line, stop_bits: 2}
  broker: {driver: mqtt, host: localhost, tls: true, alive: {read: life, within_s: 2}}
  opc: {driver: opcua, url: "opc.tcp://localhost:4840", user: me, password: mine}
  wire: {driver: serial, port: ./wire, every_s: 0.5}
  none: {driver: simulated, shows: {key: 1}, effects: {R GO: {seconds: 2, then: {key: 0}}}}
emergency_stop: {door: {device: plc, read: discrete 9, controllers: a}}
signals:
  a.there: {device: plc, read: discrete 1, on_loss: 0, invert: true, edges: input 5}
  a.done: acknowledged
commands: {a.go: {device: plc, channel: R, write: {holding 2: 7}, force: true}}
"""


def schema() -> Any:
    return schema_of("bind")


def says_schema(text: str) -> bool:
    """Whether the schema allows a binding."""
    return bool(jsonschema.Draft202012Validator(schema()).is_valid(yaml.safe_load(text)))


def says_reader(text: str) -> bool:
    """Whether its reader finds the keys and the forms of their values right."""
    try:
        parse_binding(text)
    except InputError as error:
        return not any(problem.code.startswith("F10") for problem in error.diagnostics)
    return True


def test_the_committed_schema_is_the_generated_one() -> None:
    assert schema() == json_schema()


def test_the_binding_of_the_catalogue_names_its_schema_and_keeps_it() -> None:
    file = catalogue_path("one_robot").with_name("one_robot.bind.yaml")
    named, text = file.read_text("utf-8").split("\n", 1)
    _, _, path = named.partition("# yaml-language-server: $schema=")
    assert json.loads((file.parent / path).read_text("utf-8")) == schema()
    assert files("firable.cli").joinpath("bind.schema.json").read_text("utf-8").endswith("}\n")
    assert says_schema(text)


@pytest.mark.parametrize(
    ("old", "new", "is_right"),
    [
        ("", "", True),
        ("controllers: a}", "controllers: [a, b]}", True),
        ("on_loss: 0", "on_loss: hold", True),
        ("tls: true", "tls: {ca: authority.pem}", True),
        ("coil 0: false", "coil 0: 0", True),
        ("write: {holding 2: 7}", 'write: {holding 2: "7"}', True),
        ("controllers: a}", "controllers: []}", False),
        ("firable_bind: 1", "firable_bind: 2", False),
        ("cell: c", "cell: c\ncolour: red", False),
        ("cell: c\n", "", False),
        ("host: 127.0.0.1\n", "hots: 127.0.0.1\n", False),
        ("    host: 127.0.0.1\n", "", False),
        ("port: 1502", "port: 150200", False),
        ("port: 1502", "port: 1502\n    baud: 9600", False),
        ("stop_bits: 2", "stop_bits: 3", False),
        ("tls: true", "tls: {ca: authority.pem, key: 1, hot: 2}", False),
        ("every_s: 0.2", "every_s: 0", False),
        ("within_s: 1}", "within_s: soon}", False),
        ("tripped: discrete 0", "tripped: discrete 0, trips: 1", False),
        ("done: input 2", "doen: input 2", False),
        ("on_loss: 0", "on_loss: 2", False),
        ("acknowledged", "acknowledge", False),
        ("channel: R, ", "", False),
        ("force: true", "force: perhaps", False),
        ("then: {key: 0}", "then: {key: 2}", False),
        ("driver: serial", "diver: serial", False),
    ],
)
def test_the_schema_says_of_keys_and_forms_what_the_reader_says(old: str, new: str, is_right: bool) -> None:
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    assert (says_schema(text), says_reader(text)) == (is_right, is_right)


def test_a_kind_that_others_bring_has_keys_of_its_own() -> None:
    text = GOOD.replace("{driver: serial, port: ./wire, every_s: 0.5}", "{driver: theirs, memory: far, timeout_s: 2}")
    assert says_schema(text)
    assert not says_schema(text.replace("timeout_s: 2", "timeout_s: soon"))
