"""Registered tasks as text: the one spelling in which a bundle holds those that its net was made of.

The text is a file of tasks as `firable.nets.tasks.text` reads it, with the names of all places and the borders of each
task said and not left to a default: a person reads it as one more file of tasks, and there is no second reader. What a
task does not hold, the description of a file and where things stand in it, is not printed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from firable.nets.tasks.model import Catalogue, Move, Role, Step, Task
from firable.nets.time_limits import format_time

_BARE: Final = re.compile(r"(?!(y|n|yes|no|on|off|true|false|null)$)[a-z][a-z_]*")
"""Keys that are text for every reader of YAML."""


def format_tasks(tasks: Iterable[Task]) -> str:
    """The text of these tasks, in their order; `parse_tasks` reads it back, with arguments and parameters sorted.

    >>> from firable.nets.tasks.text import parse_tasks
    >>> tasks = parse_tasks("firable_tasks: 1\\ntasks: {rest: {roles: {robot: {steps: {home: }}}}}")
    >>> parse_tasks(format_tasks(tasks.values())) == tasks
    True
    """
    document = {"firable_tasks": 1, "tasks": {task.name: _task(task) for task in tasks}}
    return "".join(f"{line}\n" for line in _lines(document))


def as_written(tasks: Catalogue, text: str) -> bool:
    """Whether a text from which these tasks were read is their one spelling."""
    return format_tasks(tasks.values()) == text


def _lines(of: Mapping[str, Any], indent: str = "") -> Iterator[str]:
    """A mapping as YAML: what is empty is left out, but for the arcs of a border; no value at all is a blank."""
    for key, value in of.items():
        name = f"{indent}{key if _BARE.fullmatch(key) else _quoted(key)}:"
        if isinstance(value, Mapping):
            yield name
            yield from _lines(value, f"{indent}  ")
        elif isinstance(value, list):
            yield f"{name} [{', '.join(map(_quoted, value))}]"
        else:
            yield name if value is None else f"{name} {value if isinstance(value, int) else _quoted(value)}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _said(of: dict[str, Any]) -> dict[str, Any]:
    """What is not empty."""
    return {key: value for key, value in of.items() if value not in ("", [], {})}


def _task(task: Task) -> dict[str, Any]:
    faults = {move.sources[0]: move.targets[0] for move in task.moves if move.late}
    subtasks = {
        one.name: {
            "task": {"name": one.use.name, **dict(sorted(one.use.arguments))},
            **_said({"description": one.description}),
        }
        for one in task.subtasks
    }
    moves = {
        move.name: {"from": [*move.sources], **_around(move, to=[*move.targets])}
        for move in task.moves
        if not move.late
    }
    return {
        **_said({"description": task.description}),
        "roles": {role.name: _role(role, faults) for role in task.roles},
        **_said({"parameters": dict(sorted(task.parameters)), "subtasks": subtasks}),
        "start": {"to": [*task.start.targets], **_around(task.start)},
        **_said({"moves": moves}),
        "end": {"from": [*task.end.sources], **_around(task.end)},
    }


def _role(role: Role, faults: dict[str, str]) -> dict[str, Any]:
    steps = {step.name: _step(step, faults.get(f"{role.name}.{step.name}", "")) for step in role.steps}
    return _said({"steps": steps, "inputs": dict(role.inputs)})


def _step(step: Step, fault: str) -> dict[str, Any]:
    made: dict[str, Any] = {"place": step.place, **_said({"description": step.description})}
    if step.command:
        send = {"machine": step.command.machine, "command": step.command.command}
        made["send"] = {**send, **dict(step.command.parameters)}
    if step.completion is not None:
        made["until"] = step.completion
    if step.within is not None:
        made["within"] = {"time": format_time(step.within), "to": fault.partition(".")[2]}
    return made


def _around(move: Move, **more: list[str]) -> dict[str, Any]:
    """The gates and the words of a move: sensors bear their names in the task, as steps do."""
    return _said(
        {
            **more,
            "if": [*move.permissive, *(str(gate) for gate in move.external if gate.wanted)],
            "unless": [*move.inhibitive, *(str(gate) for gate in move.external if not gate.wanted)],
            "release": [*move.releases],
            "description": move.description,
        }
    )
