"""What the parametric proof calls the things of a decomposition, and a run of it told as actions of the proof.

A *configuration* is a structure with the relations of `parametric.system`. `explain` says by which actions one became
another: it reads from the difference what must have happened, plays it, and compares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from support.finite_structures import Structure, Thing, Tuples, Values

from firable.decompose.protocol.parametric.invariant import INVARIANT
from firable.decompose.protocol.parametric.script import Action
from firable.decompose.protocol.parametric.system import MOVING, PROTOCOL
from firable.executor.protocol.deciders import TOP, coordinator_at, coordinators
from firable.nets.decomposition import Decomposition
from firable.nets.net import SignalKind

Instance = tuple[str, tuple[Thing, ...]]
"""An action with the values of its parameters."""


def net_structure(decomposition: Decomposition, rounds: Sequence[Thing], *, signals: bool) -> Structure:
    """The things and the fixed relations of a decomposition; nothing moves yet. Without signals, gates are free.

    Whose rounds they are has to be added (`of_coordinators`).
    """
    net = decomposition.net
    rows = {row.name: row for row in decomposition.coordinated}
    homes = {t.name: s.name for s in decomposition.subnets for t in s.transitions if t.name in net.transition_index}
    part = [(row.name, its.controller) for row in rows.values() for its in row.parts]
    part += [(name, home) for name, home in homes.items() if name not in rows]
    sensed = tuple(signal.name for signal in net.signals) if signals else ()

    def arcs(kind: str, wanted: bool | None = None) -> Tuples:
        found = {(t.name, place) for t in net.transitions for place in getattr(t, kind)}
        gates = {(t.name, gate.signal) for t in net.transitions for gate in t.external if gate.wanted is wanted}
        return frozenset(found | gates if signals else found)

    cleared = {(t.name, name) for t in net.transitions for place in t.outputs for name in net.place(place).cleared}
    fixed: dict[str, Tuples] = {
        "coordinated": frozenset((name,) for name in rows),
        "takes-part": frozenset(part),
        "input": arcs("inputs"),
        "output": arcs("outputs"),
        "permissive": arcs("permissive", wanted=True),
        "inhibitive": arcs("inhibitive", wanted=False),
        "signal": frozenset((name,) for name in sensed),
        "clears": frozenset(key for key in cleared if key[1] in sensed),
        "free": frozenset(decomposition.free),
        "lasting": frozenset((s.name,) for s in net.signals if s.kind is SignalKind.COMPLETION),
        "behind": frozenset(
            (t.name, u.name, net.place(place).owner or "")
            for t in net.transitions
            for u in net.transitions
            for place in {*t.inputs, *t.permissive} & {*u.outputs}
        ),
    }
    deciders = {row.name: coordinator_at(row.at) for row in decomposition.coordinated}
    some_home = decomposition.subnets[0].name
    return Structure(
        {
            "Place": (*(place.name for place in net.places), *sensed),
            "Transition": tuple(t.name for t in net.transitions),
            "Controller": tuple(subnet.name for subnet in decomposition.subnets),
            "Round": tuple(rounds),
            "Coordinator": coordinators(decomposition),
        },
        {
            "owner": dict(
                [(p.name, p.owner or "") for p in net.places] + [(s.name, s.owner or "") for s in net.signals]
            ),
            "home": {t.name: homes.get(t.name, some_home) for t in net.transitions},
            "decider": {t.name: deciders.get(t.name, TOP) for t in net.transitions},
            "coordinator-of": {},
        },
        {**fixed, **{relation.name: frozenset() for relation in MOVING}},
    )


def of_coordinators(structure: Structure, rounds: Mapping[Thing, str]) -> Structure:
    """The structure with these rounds, each of the coordinator of this name."""
    things = {**structure.things, "Round": tuple(rounds)}
    return replace(structure, things=things, functions={**structure.functions, "coordinator-of": rounds})


def broken(configuration: Structure) -> list[str]:
    """The names of the conjuncts of the invariant, and of the assumptions, that do not hold."""
    found = [words for words, formula in PROTOCOL.static if not configuration.holds(formula, {})]
    return found + [each.name for each in INVARIANT if not configuration.holds(each.sentence.body, {})]


def instance(step: Instance) -> tuple[Action, Values]:
    """An action of the protocol, and its parameters with their values."""
    action = PROTOCOL.action(step[0])
    return action, dict(zip(action.parameters, step[1], strict=True))


def play(configuration: Structure, steps: Iterable[Instance]) -> Structure:
    """The configuration after actions, of which each must be possible where it stands."""
    for step in steps:
        action, values = instance(step)
        missing = configuration.may(action, values)
        assert not missing, f"{step} is not possible: {missing}"
        configuration = configuration.after(action, values)
    return configuration


def differences(found: Structure, wanted: Structure) -> list[str]:
    """The relations that differ, with the tuples that one has more."""
    return [
        f"{relation.name}: {sorted(map(str, found.relations[relation.name] ^ wanted.relations[relation.name]))}"
        for relation in MOVING
        if found.relations[relation.name] != wanted.relations[relation.name]
    ]


def explain(
    before: Structure,
    after: Structure,
    fired: Sequence[str] = (),
    sensed: Sequence[str] = (),
    compared: Callable[[Structure], Structure] = lambda structure: structure,
) -> list[Instance]:
    """The actions by which one configuration becomes the other.

    `fired` are the local transitions that fired, `sensed` the signals that changed by themselves; `compared` leaves out
    what is not to be compared. Raises `AssertionError` where there are no such actions: then something has happened
    that the proof knows nothing of.
    """
    steps = list(_steps(before, after, fired, sensed))
    reached = compared(play(before, steps))
    assert not differences(reached, after), f"{steps} leads elsewhere: {differences(reached, after)}"
    return steps


def _steps(before: Structure, after: Structure, fired: Sequence[str], sensed: Sequence[str]) -> Iterator[Instance]:
    def new(name: str) -> list[tuple[Thing, ...]]:
        return sorted(after.relations[name] - before.relations[name], key=str)

    yield from (("forget", pair) for pair in sorted({(r, c) for r, _, c in _forgotten(before, after)}, key=str))
    free = before.relations["free"]
    yield from (("fire", (name,)) for name in fired)
    yield from (("promise", key) for key in new("promised"))
    used = set()
    for key in new("obeyed"):
        if key in _forgotten(before, after):
            continue
        if key[:2] not in before.relations["committed"]:
            yield "release", key
        elif key[1:] in free:
            used.add(key[1:])
            yield "apply-free", key
        else:
            yield "apply", key
    for name in sensed:
        late = cleared_late(before, used, name)
        yield ("sense-late", (*late, name)) if late else ("sense", (name,))
    stood = before.relations["stands"] - used
    yield from (("stand", key) for key in sorted(after.relations["stands"] - stood, key=str))
    yield from (("hear", key) for key in new("heard"))
    decided = new("decided")
    opened = {r for r, _ in new("asked")}
    yield from _decisions([r for (r,) in decided if r not in opened], new("committed"))
    yield from (("note", key) for key in new("noted"))
    yield from (("close", key) for key in new("closed"))
    yield from (("ask", key) for key in new("asked"))
    # In which nobody has to promise.
    yield from _decisions([r for (r,) in decided if r in opened], new("committed"))


def _decisions(decided: Iterable[Thing], committed: Sequence[tuple[Thing, ...]]) -> Iterator[Instance]:
    for r in decided:
        commits = [key for key in committed if key[0] == r]
        yield ("decide", commits[0]) if commits else ("give-up", (r,))


def cleared_late(before: Structure, used: set[tuple[Thing, ...]], name: str) -> tuple[Thing, ...]:
    """The round and the transition, at a free part, that has cleared a signal whose owner has still to obey."""
    owner = before.functions["owner"][name]
    for r, t in sorted(before.relations["committed"], key=str):
        under_way = (t, owner) in before.relations["free"] and (r, t, owner) not in before.relations["obeyed"]
        if under_way and (t, owner) not in used and (t, name) in before.relations["clears"]:
            return r, t
    return ()


def _forgotten(before: Structure, after: Structure) -> set[tuple[Thing, ...]]:
    """What a controller takes for obeyed because it has heard that the round is closed."""
    fresh = after.relations["obeyed"] - before.relations["obeyed"]
    return {key for key in fresh if (key[0],) in before.relations["closed"]}


def with_relations(structure: Structure, **relations: Iterable[tuple[Thing, ...]]) -> Structure:
    """The structure with other tuples in some relations; `_` in a name stands for a hyphen."""
    named = {name.replace("_", "-"): frozenset(tuples) for name, tuples in relations.items()}
    return replace(structure, relations={**structure.relations, **named})
