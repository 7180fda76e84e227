"""The detailed net that registered tasks make of a conceptual one, opened anew from docs/refinement.md.

The second text of what `firable refine` does, so that a bundle can say from where its net comes. Here a net is taken
apart into places and transitions under *keys*: those of the conceptual net under their names, those of a task under the
place that it stands for and their names in the task, with `INSIDE` between them. No name of a net has that, but one may
have a slash: with slashes a move `sub/m` and the move `m` of a subtask `sub` would be one, and the last of the two hide
the other from every question. Nothing is put under a key that something has. Each block, outer ones first, adds
its own and changes the transitions that lead into its place and out of it; names come last (`naming_anew`). A block
also remembers which of its places is which, since that is what the proof of the refinement is about (`relating`).

The order of places, arcs and signals is no matter of what a net is, and is not made anew.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeVar

from firable.decompose.verification.refusal import NotShownError
from firable.nets.net import Command, Net, Place, Signal
from firable.nets.source import printable
from firable.nets.tasks.model import Catalogue, Gate, Step, Task

DEPTH_MAX: Final = 16
INSIDE: Final = "\n"
"""What stands between the names of a key."""
_WORD: Final = re.compile(r"\{([^{}]*)\}")

One = TypeVar("One")
Literal = tuple[str, bool]
"""A signal by its full name, and the value that a gate wants."""


@dataclass(slots=True)
class Block:
    """A task in the place of `path`, with who fills its roles (idle places, by conceptual names) and its words."""

    path: tuple[str, ...]
    task: Task
    filled: Mapping[str, str]
    words: Mapping[str, str]

    @property
    def key(self) -> str:
        """The key of the place that the block stands for."""
        return INSIDE.join(self.path)

    def inner(self, name: str) -> str:
        """The key of a step, a move or a subtask."""
        return f"{self.key}{INSIDE}{name}"

    def holds(self, key: str) -> bool:
        """Whether a key is of something in the block, or in a block within it."""
        return key.startswith(f"{self.key}{INSIDE}")

    def text(self, template: str) -> str:
        """A template, filled."""
        try:
            return _WORD.sub(lambda found: self.words[found[1]], template)
        except KeyError as missing:
            raise NotShownError(f"the task '{self.task.name}' asks for {missing}, which nobody says") from None


@dataclass(slots=True)
class Kept:
    """A place under its key: what it was in the conceptual net, or the step or subtask that it is."""

    owner: str | None
    local: str
    full: str = ""
    of: Place | None = None
    step: Step | None = None
    description: str = ""
    block: Block | None = None


@dataclass(slots=True)
class Move:
    """A transition under its key, its arcs and gates keys of places."""

    label: str
    inputs: set[str] = field(default_factory=set)
    outputs: set[str] = field(default_factory=set)
    permissive: set[str] = field(default_factory=set)
    inhibitive: set[str] = field(default_factory=set)
    external: set[Literal] = field(default_factory=set)
    owners: set[str | None] = field(default_factory=set)
    number: int | None = None
    description: str = ""
    words: list[str] = field(default_factory=list)
    starts: list[Block] = field(default_factory=list)
    block: Block | None = None
    late: bool = False


class Opening:
    """A conceptual net with all its tasks open, under keys."""

    def __init__(self, net: Net, tasks: Catalogue) -> None:
        self.net, self.tasks = net, tasks
        self.places: dict[str, Kept] = {}
        self.moves: dict[str, Move] = {}
        self.blocks: list[Block] = []
        self.signals = {signal.name: signal for signal in net.signals}
        self.lent = set[str]()
        """The resources that some transition borrows."""
        for place in net.places:
            self.places[place.name] = _kept(place)
        for t in net.transitions:
            move = Move(t.name, {*t.inputs}, {*t.outputs}, {*t.permissive}, {*t.inhibitive}, number=t.number)
            move.description = t.description
            for gate in t.external:
                move.external.add((gate.signal, gate.wanted))
                move.owners.add(net.signal(gate.signal).owner)
            self.moves[t.name] = move
        todo = deque(self._outermost())
        while todo:
            block = todo.popleft()
            if len(block.path) > DEPTH_MAX:
                raise NotShownError(f"the task '{block.task.name}' is nested too deep")
            self.blocks.append(block)
            self._open(block)
            todo.extend(self._within(block))

    def full(self, owner: str | None, local: str) -> str:
        """The full name of what is called `local` in a controller."""
        return local if owner is None else f"{owner}.{local}"

    # --- Who fills the roles

    def _outermost(self) -> Iterator[Block]:
        for place in self.net.places:
            if place.task is None:
                continue
            task, given = self._task(place.task.name), dict(place.task.arguments)
            filled, words = {}, {}
            for role in task.roles:
                resource = self._resource(place, given.get(role.name, ""))
                filled[role.name] = resource.name
                words[role.name] = _local(resource.name, resource.owner)
                of = resource.resource
                assert of is not None
                says = {"machine": of.machine, "prefix": of.prefix, **dict(of.parameters)}
                words |= {f"{role.name}.{key}": text for key, text in says.items()}
            words |= {name: given.get(name, default) or "" for name, default in task.parameters}
            _complete(task, given)
            yield Block((place.name,), task, filled, words)

    def _within(self, block: Block) -> Iterator[Block]:
        for subtask in block.task.subtasks:
            task, given = self._task(subtask.use.name), dict(subtask.use.arguments)
            _complete(task, given)
            filled = {role.name: block.filled.get(given[role.name], "") for role in task.roles}
            if "" in filled.values():
                raise NotShownError(f"a role of the subtask '{subtask.name}' is filled by nobody")
            words = {name: block.text(given[name]) if name in given else of or "" for name, of in task.parameters}
            for role in task.roles:
                by = given[role.name]
                for word, text in block.words.items():
                    head, dot, key = word.partition(".")
                    if head == by:
                        words[f"{role.name}{dot}{key}"] = text
            yield Block((*block.path, subtask.name), task, filled, words)

    def _task(self, name: str) -> Task:
        if name not in self.tasks:
            raise NotShownError(f"the task '{name}' is not among those that the bundle holds")
        return self.tasks[name]

    def _resource(self, place: Place, name: str) -> Place:
        local = self.full(place.owner, name)
        for full in (local, name):
            if full in self.net.place_index and self.net.place(full).resource:
                return self.net.place(full)
        raise NotShownError(f"'{name}', which '{place.name}' names, opens to no resource")

    # --- What a block adds and changes

    def _open(self, block: Block) -> None:
        task = block.task
        for name, (role, step) in task.steps.items():
            owner = self.places[block.filled[role.name]].owner
            local = block.text(step.place)
            kept = Kept(owner, local, step=step, description=block.text(step.description), block=block)
            self._put(self.places, block, name, kept)
        outermost = self.places[block.path[0]]
        for subtask in task.subtasks:
            local = "_".join((outermost.local, *block.path[1:], subtask.name))
            kept = Kept(outermost.owner, local, description=block.text(subtask.description), block=block)
            self._put(self.places, block, subtask.name, kept)
        late = {block.filled[role] for role in task.released if role not in task.start.releases}
        for move in self.moves.values():
            if block.key in move.outputs:
                borrowed = (move.permissive & late) - move.outputs
                self.lent |= borrowed
                move.permissive -= borrowed
                move.inputs |= borrowed
                move.outputs -= late
                move.outputs |= {block.inner(step) for step in task.start.targets}
                self._gates(block, move, task.start.external)
                move.words.append(block.text(task.start.description))
                move.starts.append(block)
            if block.key in move.inputs:
                move.inputs |= {block.inner(step) for step in task.end.sources}
                self._gates(block, move, task.end.external)
                move.words.insert(0, block.text(task.end.description))
        for one in task.moves:
            made = Move(one.name, description=block.text(one.description), block=block, late=one.late)
            made.inputs = {block.inner(step) for step in one.sources}
            made.outputs = {block.inner(step) for step in one.targets} | {block.filled[r] for r in one.releases}
            made.permissive = {block.inner(step) for step in one.permissive}
            made.inhibitive = {block.inner(step) for step in one.inhibitive}
            self._gates(block, made, one.external)
            self._put(self.moves, block, one.name, made)

    @staticmethod
    def _put(among: dict[str, One], block: Block, name: str, one: One) -> None:
        """Keep something of a block under its key, which nothing else may have."""
        if INSIDE in name or among.setdefault(block.inner(name), one) is not one:
            raise NotShownError(f"the task '{block.task.name}' has two of '{printable(name)}', or no name there")

    def _gates(self, block: Block, move: Move, gates: tuple[Gate, ...]) -> None:
        for gate in gates:
            owner = self.places[block.filled[gate.role]].owner
            name = self.full(owner, block.text(dict(block.task.role(gate.role).inputs)[gate.input]))
            self.signals.setdefault(name, Signal(name, owner))
            move.external.add((name, gate.wanted))
            move.owners.add(owner)

    def participants(self, move: Move) -> set[str | None]:
        """Whose places and signals a transition touches."""
        touched = move.inputs | move.outputs | move.permissive | move.inhibitive
        return {self.places[key].owner for key in touched} | move.owners

    def command(self, kept: Kept) -> Command | None:
        """The command of a place."""
        if kept.step is None or kept.block is None:
            return None if kept.of is None else kept.of.command
        template = kept.step.command
        if template is None:
            return None
        text = kept.block.text
        parameters = tuple((key, text(value)) for key, value in template.parameters)
        return Command(text(template.machine), text(template.command), parameters)

    def completion(self, kept: Kept) -> str | None:
        """The completion signal of a place."""
        if kept.step is not None and kept.block is not None:
            local = kept.block.text(kept.step.completion) if kept.step.completion else None
        else:
            local = kept.of.completion if kept.of else None
            local = None if local is None or kept.of is None else _local(local, kept.of.owner)
        return None if local is None else self.full(kept.owner, local)


def _kept(place: Place) -> Kept:
    if place.resource is None:
        return Kept(place.owner, _local(place.name, place.owner), place.name, place, description=place.description)
    owner, _, local = place.resource.idle.partition(".")
    return Kept(owner, local, place.resource.idle, place, description=place.description)


def _local(name: str, owner: str | None) -> str:
    return name if owner is None else name.removeprefix(f"{owner}.")


def _complete(task: Task, given: Mapping[str, str]) -> None:
    """Whether every argument is one that the task has, and none is missing or filled by the same resource twice."""
    roles, parameters = [role.name for role in task.roles], dict(task.parameters)
    needed = {*roles, *(name for name, default in task.parameters if default is None)}
    if not needed <= set(given) <= {*roles, *parameters} or len({given[role] for role in roles}) < len(roles):
        raise NotShownError(f"the arguments of the task '{task.name}' are not those that it takes")
