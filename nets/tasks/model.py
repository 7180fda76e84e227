"""A registered task: the net of steps that `firable refine` puts in the stead of a place of a conceptual net.

A task has *roles*, each of which a resource of the cell fills: the robot that loads, the conveyor that it loads from,
the machine that it loads. Each role goes through *steps*, places in which its machine obeys one command at most, and
*moves*, transitions, lead from steps to steps. A move of several roles is a synchronisation: all of them step together.
A role is *released* by a move, and its machine is then idle before the task ends; a role that no move releases is kept
to the end, where it becomes idle or is handed to the next task. A step of a task may itself be a task: a *subtask*,
which holds those of the roles that fill its own.

Texts are templates: `{source}` is the name of the resource in that role, `{source.machine}` its machine,
`{source.prefix}` and other keys what its place in the conceptual net says under `opens`, and `{program}` a parameter.

Places of a task bear dotted names: `robot.grasp` is the step `grasp` of the role `robot`, and `fetching` a subtask. A
`span` is where the file says so, for problems that are found later.
The rejected alternative, tasks as Python functions that add places to a net, could not be checked before they are used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from firable.nets.diagnostics import Span
from firable.nets.net import Command, TaskUse


@dataclass(frozen=True, slots=True)
class Step:
    """A step of a role: the place that it becomes (a template for its local name), its command and its completion.

    `within` is how long the completion may take, in milliseconds; then a move that is `late` leads to a fault step.
    """

    name: str
    place: str
    command: Command | None = None
    completion: str | None = None
    description: str = ""
    within: int | None = None


@dataclass(frozen=True, slots=True)
class Role:
    """A role, its steps in the order of the file, and its sensors: the name in the task, and the template."""

    name: str
    steps: tuple[Step, ...] = ()
    inputs: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Subtask:
    """A step that is itself a task: `use` fills its roles with roles of this task."""

    name: str
    use: TaskUse
    description: str = ""
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Gate:
    """An external gate: a sensor of a role, by its name in the task, and the value that it wants."""

    role: str
    input: str
    wanted: bool = True

    def __str__(self) -> str:
        return f"{self.role}.{self.input}"


@dataclass(frozen=True, slots=True)
class Move:
    """A transition of a task; `releases` are the roles whose machines are idle from here on.

    `sources`, `targets` and the internal gates `permissive` and `inhibitive` name steps and subtasks. One that is
    `late` leaves a step whose time is over.
    """

    name: str
    sources: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    permissive: tuple[str, ...] = ()
    inhibitive: tuple[str, ...] = ()
    external: tuple[Gate, ...] = ()
    releases: tuple[str, ...] = ()
    description: str = ""
    span: Span | None = field(default=None, compare=False)
    late: bool = False


@dataclass(frozen=True)
class Task:
    """A registered task. Its `start` leads to the first steps, and its `end` comes from the last ones."""

    name: str
    roles: tuple[Role, ...]
    start: Move
    end: Move
    moves: tuple[Move, ...] = ()
    subtasks: tuple[Subtask, ...] = ()
    parameters: tuple[tuple[str, str | None], ...] = ()
    description: str = ""
    span: Span | None = field(default=None, compare=False)

    @cached_property
    def released(self) -> frozenset[str]:
        """The roles that are idle again before the task ends."""
        return frozenset(role for move in (self.start, *self.moves) for role in move.releases)

    @cached_property
    def kept(self) -> tuple[str, ...]:
        """The roles that the task holds to its end, in order."""
        return tuple(role.name for role in self.roles if role.name not in self.released)

    @cached_property
    def steps(self) -> Mapping[str, tuple[Role, Step]]:
        """The steps by their dotted names."""
        return {f"{role.name}.{step.name}": (role, step) for role in self.roles for step in role.steps}

    def role(self, name: str) -> Role:
        """The role of this name; `KeyError` where there is none."""
        for role in self.roles:
            if role.name == name:
                return role
        raise KeyError(name)

    def transitions(self) -> Iterator[Move]:
        """Start, moves and end."""
        yield self.start
        yield from self.moves
        yield self.end


Catalogue = Mapping[str, Task]
"""Registered tasks by name."""
