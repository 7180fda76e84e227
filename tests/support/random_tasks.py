"""Random registered tasks, and random conceptual nets that name them: what refinement is held to exploration on.

A task has one to three roles, each a chain of steps; some of its moves are joined into synchronisations, and then it is
spoilt a little: moves back, choices, gates, a release. A net is one or two rings of tasks and buffers; a resource comes
from its idle place, or from the task before. Most tasks are sound, and most nets contact-free; the others count too.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace

from firable.nets.formula import And, Formula, Holds, Not, Or, Start
from firable.nets.net import (
    Controller,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Resource,
    Signal,
    TaskUse,
    Transition,
)
from firable.nets.tasks.model import Catalogue, Gate, Move, Role, Step, Subtask, Task


def random_task(draw: random.Random, name: str, spoil: float = 0.3) -> Task:
    """A task; `spoil` is how often something is changed that may make it unsound."""
    roles = [f"r{i}" for i in range(draw.randint(1, 3))]
    chains = {role: [f"{role}.s{i}" for i in range(draw.randint(1, 4))] for role in roles}
    moves: list[Move] = []
    left = {role: list(zip(chains[role], chains[role][1:], strict=False)) for role in roles}
    released = draw.choice(roles) if len(roles) > 1 and draw.random() < 0.6 else None
    ready = released is None
    for _ in range(20):
        if ready and not any(left.values()):
            break
        able = [role for role in roles if left[role]]
        among = draw.sample(able, draw.randint(1, len(able))) if able else []
        sources = [left[role][0][0] for role in among]
        targets = [left[role].pop(0)[1] for role in among]
        releases: tuple[str, ...] = ()
        if released is not None and not ready and not left[released] and released not in among and draw.random() < 0.7:
            sources.append(chains[released][-1])
            releases, ready = (released,), True
        if sources:
            moves.append(Move(f"m{len(moves)}", tuple(sources), tuple(targets), releases=releases))
    for i, move in enumerate(moves):
        if draw.random() < spoil:
            moves[i] = _gated(draw, move, [step for chain in chains.values() for step in chain])
    for _ in range(3):
        if draw.random() > spoil:
            break
        role = draw.choice(roles)
        source, target = draw.choice(chains[role]), draw.choice(chains[role])
        if source != target:  # a move back, a short cut or a choice
            moves.append(Move(f"m{len(moves)}", (source,), (target,)))
    if draw.random() < spoil / 3 and len(moves) > 1:
        moves.pop(draw.randrange(len(moves)))
    kept = [role for role in roles if not any(role in move.releases for move in moves)]
    first = draw.choice(roles)
    gates = (Gate(first, "sensor"),) if draw.random() < 0.3 else ()
    return Task(
        name,
        tuple(
            Role(role, tuple(_step(one) for one in chains[role]), (("sensor", f"{{{role}}}_sensor"),)) for role in roles
        ),
        Move("start", (), tuple(chains[role][0] for role in roles), external=gates),
        Move("end", tuple(chains[role][-1] for role in kept), ()),
        tuple(moves),
    )


def nested(draw: random.Random, task: Task, catalogue: Catalogue) -> Task:
    """The task with a subtask put into one of its moves, if one of the catalogue fits the roles that move there."""
    moves = [move for move in task.moves if not {*move.sources, *move.targets} & {one.name for one in task.subtasks}]
    draw.shuffle(moves)
    for move in moves:
        movers = {one.partition(".")[0] for one in move.sources}
        fitting = [
            inner
            for inner in catalogue.values()
            if len(inner.roles) == len(movers) == len(move.sources) and len(inner.released) == len(move.releases)
        ]
        if not fitting:
            continue
        inner = draw.choice(fitting)
        kept = sorted(movers - {*move.releases})
        draw.shuffle(kept)
        arguments = {
            **dict(zip(inner.kept, kept, strict=True)),
            **dict(zip(sorted(inner.released), move.releases, strict=True)),
        }
        name = f"sub{len(task.subtasks)}"
        into = replace(move, targets=(name,), external=())
        out_of = Move(f"{move.name}_", (name,), move.targets, external=move.external)
        return replace(
            task,
            subtasks=(*task.subtasks, Subtask(name, TaskUse(inner.name, tuple(sorted(arguments.items()))))),
            moves=(*(one for one in task.moves if one is not move), into, out_of),
        )
    return task


def _step(name: str) -> Step:
    role, _, local = name.partition(".")
    return Step(local, f"{{{role}}}_{role}_{local}")


def _gated(draw: random.Random, move: Move, steps: list[str]) -> Move:
    gate = draw.choice(steps)
    if gate in {*move.sources, *move.targets}:
        return move
    if draw.random() < 0.5:
        return replace(move, permissive=(gate,))
    return replace(move, inhibitive=(gate,))


@dataclass
class _Draft:
    places: dict[str, Place] = field(default_factory=dict)
    transitions: list[Transition] = field(default_factory=list)


def random_conceptual(draw: random.Random, catalogue: Catalogue) -> Net:
    """A conceptual net whose places name tasks of the catalogue; its ledger is right."""
    draft = _Draft()
    pool = [f"c{i}" for i in range(draw.randint(2, 5))]
    for resource in pool:
        draft.places[resource] = Place(
            resource, None, draw.random() < 0.93, resource=Resource(f"cell.{resource}", resource.upper())
        )
    for ring in range(draw.randint(1, 2)):
        _ring(draw, draft, f"w{ring}_", pool, catalogue)
    for i in range(draw.randint(0, 1)):  # somebody else who takes a resource
        resource = draw.choice(pool)
        draft.places[f"other{i}"] = Place(f"other{i}")
        draft.transitions.append(Transition(f"take{i}", (resource,), (f"other{i}",)))
        draft.transitions.append(Transition(f"give{i}", (f"other{i}",), (resource,)))
    if draw.random() < 0.1:  # a resource out of nothing: contact, if its place is full
        draft.transitions.append(Transition("more", (), (draw.choice(pool),)))
    tasks = {name for name, place in draft.places.items() if place.task}
    released = {
        dict(place.task.arguments)[role]
        for place in draft.places.values()
        if place.task
        for role in catalogue[place.task.name].released
    }
    gateable = [name for name in draft.places if name not in released]
    transitions = []
    for t in draft.transitions:
        permissive, inhibitive = list(t.permissive), list[str]()
        if draw.random() < 0.1 and (gate := draw.choice(list(draft.places))) not in {
            *t.inputs,
            *t.outputs,
            *t.permissive,
        }:
            permissive.append(gate)
        if draw.random() < 0.1 and (gate := draw.choice(gateable)) not in {*t.inputs, *t.outputs}:
            inhibitive.append(gate)
        external = (ExternalGate("go", draw.random() < 0.5),) if draw.random() < 0.2 else ()
        transitions.append(Transition(t.name, t.inputs, t.outputs, tuple(permissive), tuple(inhibitive), external))
    visible = sorted(set(draft.places) - released)
    return Net(
        "random",
        tuple(draft.places.values()),
        tuple(transitions),
        (Signal("go"),),
        (Controller("cell"),),
        properties=tuple(_properties(draw, visible, sorted(tasks))),
    )


def _ring(draw: random.Random, draft: _Draft, name: str, pool: list[str], catalogue: Catalogue) -> None:
    # An open ring takes as many workpieces as its tasks let in: then there may be contact, or much concurrency.
    source = () if draw.random() < 0.5 else (f"{name}src",)
    if source:
        draft.places[f"{name}src"] = Place(f"{name}src", None, marked=True)
    before, held = source, set[str]()
    for i in range(draw.randint(1, 4)):
        place = f"{name}{i}"
        releasing = [task for task in catalogue.values() if task.released]
        choice = releasing if held and releasing and draw.random() < 0.6 else list(catalogue.values())
        filled = _filled(draw, draw.choice(choice), held, pool)
        if filled is None:  # a buffer, in which nothing is held
            draft.places[place] = Place(place)
            draft.transitions.append(Transition(f"{place}_in", before, (place, *sorted(held))))
            before, held = (place,), set()
            continue
        task, roles = filled
        draft.places[place] = Place(place, task=TaskUse(task.name, tuple(roles.items())))
        early = {roles[role] for role in task.released}
        takes = sorted(set(roles.values()) - held - early)
        frees = sorted(held - set(roles.values())) + sorted(early & held)
        arcs = (*before, *takes), (place, *frees)
        draft.transitions.append(Transition(f"{place}_in", *arcs, permissive=tuple(sorted(early - held))))
        before, held = (place,), {roles[role] for role in task.kept}
    back = () if draw.random() < 0.03 else source
    draft.transitions.append(Transition(f"{name}out", before, (*back, *sorted(held))))


def _filled(draw: random.Random, task: Task, held: set[str], pool: list[str]) -> tuple[Task, dict[str, str]] | None:
    """The roles of a task filled, the released ones from what is held; None where that is not enough."""
    roles: dict[str, str] = {}
    for role in sorted(task.released):
        free = sorted((set(pool) if draw.random() < 0.3 else held) - set(roles.values()))
        if not free:
            return None
        roles[role] = draw.choice(free)
    for role in task.kept:
        free = sorted(set(pool) - set(roles.values()))
        if not free:
            return None
        roles[role] = draw.choice(free)
    return task, {role.name: roles[role.name] for role in task.roles}


def _properties(draw: random.Random, places: list[str], tasks: list[str]) -> list[Property]:
    def formula() -> Formula:
        atoms: list[Formula] = [Holds(draw.choice(places)) for _ in range(draw.randint(1, 3))]
        atoms = [Not(atom) if draw.random() < 0.4 else atom for atom in atoms]
        if len(atoms) == 1:
            return atoms[0]
        return And(tuple(atoms)) if draw.random() < 0.5 else Or(tuple(atoms))

    found = [
        Property("never", PropertyKind.NEVER, formula()),
        Property("always", PropertyKind.ALWAYS, formula()),
        Property("reachable", PropertyKind.REACHABLE, formula()),
        Property("possible", PropertyKind.ALWAYS_POSSIBLE, formula()),
        Property("restart", PropertyKind.ALWAYS_POSSIBLE, Start()),
    ]
    for fairness in Fairness:
        then = Holds(draw.choice(tasks or places))
        found.append(Property(f"leads_{fairness}", PropertyKind.LEADS_TO, formula(), then, fairness))
    return found
