"""Opening: the conceptual net with the steps of its tasks in it, transitions and places still without their names.

The place of a task stays, so that whoever looks at it sees what it saw. A transition that leads into it starts the
task: besides, it leads to the first steps. One that comes out of it ends the task: besides, it comes from the last
steps. A resource that the task releases before its end is no longer made idle by the transition that starts the task,
as the conceptual net says, but by the move that releases it; one that is borrowed is taken where the conceptual net
only asks for it. Everything else is untouched. So when two tasks follow
each other, a resource goes from the last step of one to the first step of the next, with no rule for that. A subtask is
opened by the same rule, with the move in the part of the transition, until no task is left.

Everything is known by a key here: places and transitions of the conceptual net by their names, the rest by the path of
tasks that it is in, `system.loading/robot.grasp`. `firable.decompose.refinement.naming` makes the names of a net.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from firable.decompose.refinement.binding import Binding
from firable.nets.net import Command, Net, TimeLimit
from firable.nets.tasks.model import Catalogue, Gate, Move


@dataclass(frozen=True, slots=True)
class OpenPlace:
    """A place by its key; `local` is the name that it should have in its controller, `full` the one it must have.

    `resource` is whose idle place or step it is, and `path` the task that it is in, if any.
    """

    key: str
    owner: str | None
    local: str
    full: str = ""
    marked: bool = False
    command: Command | None = None
    completion: str | None = None
    description: str = ""
    resource: str | None = None
    path: str = ""
    within: TimeLimit | None = None


@dataclass(slots=True)
class OpenTransition:
    """A transition by its key, while tasks are opened; `path` is the task that it is a move of, if any.

    External gates are triples of the controller, the local name and the value. `words` are the descriptions of the
    tasks that it ends and starts, and `starts` their paths.
    """

    key: str
    label: str
    inputs: list[str]
    outputs: list[str]
    permissive: list[str]
    inhibitive: list[str]
    external: list[tuple[str | None, str, bool]]
    number: int | None = None
    description: str = ""
    path: str = ""
    words: list[str] = field(default_factory=list)
    starts: list[str] = field(default_factory=list)
    late: bool = False


@dataclass(frozen=True)
class Opened:
    """A net with all its tasks open: places and transitions by key.

    `moves` are the keys of the moves of each path, and `released` the resources that some task makes idle inside.
    """

    places: Mapping[str, OpenPlace]
    transitions: Mapping[str, OpenTransition]
    moves: Mapping[str, Sequence[str]]
    lasts: Mapping[str, tuple[str, ...]]
    bound: Mapping[str, Binding]
    released: frozenset[str]


def open_tasks(net: Net, bound: Mapping[str, Binding], catalogue: Catalogue) -> Opened:
    """Open every task of a net, and every task within one; the ledger of each was checked before."""
    return _Opening(net, catalogue).opened(bound)


class _Opening:
    def __init__(self, net: Net, catalogue: Catalogue) -> None:
        self.net, self.catalogue = net, catalogue
        self.places: dict[str, OpenPlace] = {}
        self.transitions: dict[str, OpenTransition] = {}
        self.moves: dict[str, list[str]] = {}
        self.bound: dict[str, Binding] = {}
        self.released = set[str]()
        self.starting: dict[str, list[OpenTransition]] = {}
        self.ending: dict[str, list[OpenTransition]] = {}
        for place in net.places:
            local = place.name if place.owner is None else place.name.removeprefix(f"{place.owner}.")
            owner, full = place.owner, place.name
            if place.resource:
                full = place.resource.idle
                owner, _, local = full.partition(".")
            self.places[place.name] = OpenPlace(
                place.name, owner, local, full, place.marked, place.command, _local(place.completion, place.owner),
                place.description, place.name if place.resource else None, within=place.within,
            )  # fmt: skip
        for t in net.transitions:
            gates = [(net.signal(gate.signal), gate.wanted) for gate in t.external]
            self.add(OpenTransition(
                t.name, t.name, list(t.inputs), list(t.outputs), list(t.permissive), list(t.inhibitive),
                [(signal.owner, _local(signal.name, signal.owner) or "", wanted) for signal, wanted in gates],
                t.number, t.description,
            ))  # fmt: skip

    def opened(self, bound: Mapping[str, Binding]) -> Opened:
        todo = deque(bound.items())
        while todo:
            path, binding = todo.popleft()
            todo.extend(self.open(path, binding).items())
        lasts = {path: tuple(self.lasts(path)) for path in bound}
        return Opened(self.places, self.transitions, self.moves, lasts, self.bound, frozenset(self.released))

    def open(self, path: str, binding: Binding) -> dict[str, Binding]:
        """Open one task; returns the subtasks that are to be opened next."""
        task = binding.task
        self.bound[path] = binding
        early = {binding.resources[role] for role in task.released - {*task.start.releases}}
        self.released |= {binding.resources[role] for role in task.released}
        for t in self.starting.get(path, ()):
            t.starts.append(path)
            lent = [one for one in t.permissive if one in early and one not in t.outputs]
            t.permissive[:] = [one for one in t.permissive if one not in lent]
            t.outputs[:] = [one for one in t.outputs if one not in early]
            self.lead(t, out_of=lent)
            self.lead(t, into=[f"{path}/{step}" for step in task.start.targets])
            t.external += self.gates(binding, task.start)
            t.words.append(binding.text(task.start.description))
        for t in self.ending.get(path, ()):
            self.lead(t, out_of=[f"{path}/{step}" for step in task.end.sources])
            t.external += self.gates(binding, task.end)
            t.words.insert(0, binding.text(task.end.description))
        self.steps(path, binding)
        self.moves[path] = []
        for move in task.moves:
            key = f"{path}/{move.name}"
            self.moves[path].append(key)
            t = OpenTransition(
                key,
                move.name,
                [f"{path}/{step}" for step in move.sources],
                [*(f"{path}/{step}" for step in move.targets), *(binding.resources[role] for role in move.releases)],
                [f"{path}/{step}" for step in move.permissive],
                [f"{path}/{step}" for step in move.inhibitive],
                self.gates(binding, move),
                description=binding.text(move.description),
                path=path,
                late=move.late,
            )
            self.add(t)
        return {f"{path}/{subtask.name}": binding.within(subtask, self.catalogue) for subtask in task.subtasks}

    def add(self, t: OpenTransition) -> None:
        self.transitions[t.key] = t
        inputs, outputs = t.inputs, t.outputs
        t.inputs, t.outputs = [], []
        self.lead(t, outputs, inputs)

    def lead(self, t: OpenTransition, into: Sequence[str] = (), out_of: Sequence[str] = ()) -> None:
        """Give a transition more arcs, and remember what it may start and end."""
        t.outputs += into
        t.inputs += out_of
        for place in into:
            self.starting.setdefault(place, []).append(t)
        for place in out_of:
            self.ending.setdefault(place, []).append(t)

    def steps(self, path: str, binding: Binding) -> None:
        for name, (role, step) in binding.task.steps.items():
            resource = binding.resources[role.name]
            command = step.command and Command(
                binding.text(step.command.machine),
                binding.text(step.command.command),
                tuple((key, binding.text(value)) for key, value in step.command.parameters),
            )
            key = f"{path}/{name}"
            self.places[key] = OpenPlace(
                key, self.controller(resource), binding.text(step.place), command=command,
                completion=binding.text(step.completion) if step.completion else None,
                description=binding.text(step.description), resource=resource, path=path,
                within=TimeLimit(step.within, "") if step.within else None,
            )  # fmt: skip
        root = self.places[path.partition("/")[0]]
        for subtask in binding.task.subtasks:
            key = f"{path}/{subtask.name}"
            self.places[key] = OpenPlace(
                key, root.owner, "_".join((root.local, *key.split("/")[1:])),
                description=binding.text(subtask.description), path=path,
            )  # fmt: skip

    def gates(self, binding: Binding, move: Move) -> list[tuple[str | None, str, bool]]:
        return [self.gate(binding, gate) for gate in move.external]

    def gate(self, binding: Binding, gate: Gate) -> tuple[str | None, str, bool]:
        template = dict(binding.task.role(gate.role).inputs)[gate.input]
        return self.controller(binding.resources[gate.role]), binding.text(template), gate.wanted

    def controller(self, resource: str) -> str | None:
        return self.places[resource].owner

    def lasts(self, path: str) -> list[str]:
        """The last steps of a task, those of the subtasks that it ends with too."""
        found = [f"{path}/{step}" for step in self.bound[path].task.end.sources]
        return [*found, *(last for one in found if one in self.bound for last in self.lasts(one))]


def _local(name: str | None, owner: str | None) -> str | None:
    return name if name is None or owner is None else name.removeprefix(f"{owner}.")
