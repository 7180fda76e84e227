"""A net as JSON, for programs: the form in which bundles carry nets, and over which a net is hashed.

Canonical (one net has one JSON text), complete (every field of `Net`, also empty ones) and strict (an unknown or
missing key is refused): what a bundle's hash covers must be all that the executor acts on. The executor reads this
form and so needs no YAML, no positions and none of the conveniences of the text format. Formulas are text in the
grammar of `formula`, which keeps the form free of a second syntax.

Version 3 has the time limit of a place and the kind `timer` of a signal. A net of an earlier version is not read: its
bundle is made anew from the net file, with a proof by the release that will run it.

Rejected: pickling the dataclasses (runs code on reading) and hashing the YAML text (a comment would void a proof).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, ValidationError

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import Formula, FormulaError, format_formula, parse_formula
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Resource,
    Signal,
    SignalKind,
    TaskUse,
    TemporalProperty,
    TimeLimit,
    Transition,
)
from firable.nets.records import Many, Named, Record
from firable.nets.temporal import Logic, format_temporal, logics, parse_temporal
from firable.nets.verdict import Expectation, Status

FORMAT: Final = "firable-net/3"
_ANEW: Final = f"write it anew with `net_to_json`, or make the bundle or the evidence anew: the form is {FORMAT}"


def net_to_json(net: Net) -> dict[str, Any]:
    """The net as JSON values.

    >>> net_to_json(Net("empty"))["places"]
    []
    """
    return {
        "format": FORMAT,
        "name": net.name,
        "description": net.description,
        "controllers": [
            {"name": c.name, "coordinator": c.coordinator, "description": c.description, "under": c.under}
            for c in net.controllers
        ],
        "places": [
            {
                "name": place.name,
                "owner": place.owner,
                "marked": place.marked,
                "command": None
                if place.command is None
                else {
                    "machine": place.command.machine,
                    "command": place.command.command,
                    "parameters": [list(pair) for pair in place.command.parameters],
                },
                "completion": place.completion,
                "description": place.description,
                "task": None
                if place.task is None
                else {"name": place.task.name, "arguments": [list(pair) for pair in place.task.arguments]},
                "resource": None
                if place.resource is None
                else {
                    "idle": place.resource.idle,
                    "machine": place.resource.machine,
                    "prefix": place.resource.prefix,
                    "parameters": [list(pair) for pair in place.resource.parameters],
                },
                "within": None
                if place.within is None
                else {"milliseconds": place.within.milliseconds, "timer": place.within.timer},
            }
            for place in net.places
        ],
        "signals": [{"name": s.name, "owner": s.owner, "kind": str(s.kind)} for s in net.signals],
        "transitions": [
            {
                "name": t.name,
                "inputs": list(t.inputs),
                "outputs": list(t.outputs),
                "permissive": list(t.permissive),
                "inhibitive": list(t.inhibitive),
                "external": [{"signal": gate.signal, "wanted": gate.wanted} for gate in t.external],
                "number": t.number,
                "description": t.description,
            }
            for t in net.transitions
        ],
        "arbiters": [{"name": a.name, "among": list(a.among), "by": str(a.by)} for a in net.arbiters],
        "properties": [_property_to_json(p) for p in net.properties],
        **({"expected": {one.verdict: str(one.status) for one in net.expected}} if net.expected else {}),
    }


def _property_to_json(of: Property | TemporalProperty) -> dict[str, Any]:
    if isinstance(of, TemporalProperty):
        text, fairness = format_temporal(of.formula), str(Fairness.NONE)
        return {"name": of.name, "kind": str(of.logic), "formula": text, "then": None, "fairness": fairness}
    return {
        "name": of.name,
        "kind": str(of.kind),
        "formula": format_formula(of.formula),
        "then": None if of.then is None else format_formula(of.then),
        "fairness": str(of.fairness),
    }


def net_from_json(data: Mapping[str, Any]) -> Net:
    """The net that `net_to_json` wrote.

    Raises `InputError`: F1015 where the values have not exactly the form of `net_to_json`, F1012 for a formula, and
    the codes of `Net`.
    """
    try:
        record = _NetRecord.model_validate(data)
    except ValidationError as error:
        raise InputError(
            Diagnostic(
                "F1015",
                f"not a net in JSON: {'.'.join(str(step) for step in one['loc']) or 'the whole'}: {one['msg']}",
                _ANEW,
            )
            for one in error.errors(include_url=False, include_input=False)[:20]
        ) from None
    parts = (
        record.name,
        tuple(
            Place(
                p.name,
                p.owner,
                p.marked,
                Command(p.command.machine, p.command.command, tuple(p.command.parameters)) if p.command else None,
                p.completion,
                p.description,
                TaskUse(p.task.name, tuple(p.task.arguments)) if p.task else None,
                Resource(p.resource.idle, p.resource.machine, p.resource.prefix, tuple(p.resource.parameters))
                if p.resource
                else None,
                TimeLimit(p.within.milliseconds, p.within.timer) if p.within else None,
            )
            for p in record.places
        ),
        tuple(
            Transition(
                t.name,
                tuple(t.inputs),
                tuple(t.outputs),
                tuple(t.permissive),
                tuple(t.inhibitive),
                tuple(ExternalGate(gate.signal, gate.wanted) for gate in t.external),
                t.number,
                t.description,
            )
            for t in record.transitions
        ),
        tuple(Signal(s.name, s.owner, SignalKind(s.kind)) for s in record.signals),
        tuple(Controller(c.name, c.coordinator, c.description, c.under) for c in record.controllers),
        tuple(Arbiter(a.name, tuple(a.among), ArbitrationRule(a.by)) for a in record.arbiters),
        tuple(_property(p) for p in record.properties),
        record.description,
        tuple(Expectation(name, Status(end)) for name, end in record.expected.items()),
    )
    try:
        return Net(*parts)
    except ValueError as error:  # a contradiction that no text can express, such as a completion that gates nothing
        raise InputError([Diagnostic("F1015", f"not a net in JSON: {error}", _ANEW)]) from None


def canonical_json(value: Any) -> bytes:
    """The one JSON text of these values: sorted keys, no blanks, ASCII.

    >>> canonical_json({"b": 1, "a": "ü"})
    b'{"a":"\\\\u00fc","b":1}'
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode("ascii")


def net_digest(net: Net) -> str:
    """The SHA-256 of the net's canonical JSON without descriptions, in hexadecimal.

    A corrected description voids no proof; the order of places, transitions and arcs does count.
    """
    return hashlib.sha256(canonical_json(_without_descriptions(net_to_json(net)))).hexdigest()


def _without_descriptions(data: dict[str, Any]) -> dict[str, Any]:
    return {
        key: [{k: v for k, v in item.items() if k != "description"} for item in value]
        if isinstance(value, list)
        else value
        for key, value in data.items()
        if key not in {"description", "expected"}
    }


def _property(record: _PropertyRecord) -> Property | TemporalProperty:
    if (record.then is None) == (record.kind == "leads_to"):
        message = f"the property '{record.name}' wants 'then' exactly where it is a leads_to"
        raise InputError([Diagnostic("F1015", message, _ANEW)])
    if record.kind in {*Logic}:
        return _temporal_property(record)
    formula = _formula(record.name, record.formula)
    then = None if record.then is None else _formula(record.name, record.then)
    return Property(record.name, PropertyKind(record.kind), formula, then, Fairness(record.fairness))


def _temporal_property(record: _PropertyRecord) -> TemporalProperty:
    logic = Logic(record.kind)
    if record.fairness != "none":
        raise InputError([Diagnostic("F1015", f"the property '{record.name}' assumes no fairness", _ANEW)])
    try:
        formula = parse_temporal(record.formula)
        if logic not in logics(formula):
            raise FormulaError(f"not of {logic.upper()}", 0)
    except FormulaError as error:
        raise _no_formula(record.name, error) from None
    return TemporalProperty(record.name, logic, formula)


def _formula(name: str, text: str) -> Formula:
    try:
        return parse_formula(text)
    except FormulaError as error:
        raise _no_formula(name, error) from None


def _no_formula(name: str, error: FormulaError) -> InputError:
    message = f"the property '{name}' is not a formula: {error.message}"
    return InputError([Diagnostic("F1012", message, _ANEW, ("properties", name))])


class _ControllerRecord(Record):
    name: str
    coordinator: bool
    description: str
    under: str | None


_Pairs = Many[Annotated[tuple[str, str], BeforeValidator(lambda v: tuple(v) if isinstance(v, list) else v)]]


class _CommandRecord(Record):
    machine: str
    command: str
    parameters: _Pairs


class _TaskUseRecord(Record):
    name: str
    arguments: _Pairs


class _ResourceRecord(Record):
    idle: str
    machine: str
    prefix: str
    parameters: _Pairs


class _TimeLimitRecord(Record):
    milliseconds: int
    timer: str


class _PlaceRecord(Record):
    name: str
    owner: str | None
    marked: bool
    command: _CommandRecord | None
    completion: str | None
    description: str
    task: _TaskUseRecord | None
    resource: _ResourceRecord | None
    within: _TimeLimitRecord | None


class _SignalRecord(Record):
    name: str
    owner: str | None
    kind: Literal["completion", "sensor", "timer"]


class _GateRecord(Record):
    signal: str
    wanted: bool


class _TransitionRecord(Record):
    name: str
    inputs: Many[str]
    outputs: Many[str]
    permissive: Many[str]
    inhibitive: Many[str]
    external: Many[_GateRecord]
    number: int | None
    description: str


class _ArbiterRecord(Record):
    name: str
    among: Many[str]
    by: Literal["priority", "order", "rotation"]


class _PropertyRecord(Record):
    name: str
    kind: Literal["never", "always", "reachable", "leads_to", "always_possible", "ctl", "ltl"]
    formula: str
    then: str | None
    fairness: Literal["none", "weak", "strong"]


class _NetRecord(Record):
    format: Literal["firable-net/3"]
    name: str
    description: str
    controllers: Many[_ControllerRecord]
    places: Many[_PlaceRecord]
    signals: Many[_SignalRecord]
    transitions: Many[_TransitionRecord]
    arbiters: Many[_ArbiterRecord]
    properties: Many[_PropertyRecord]
    expected: Named[Literal["proved", "violated"]] = Field(default_factory=dict)
