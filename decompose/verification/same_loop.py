"""Is the net of a closed loop what the plant file says? Compared in every state, reached or not, thing by thing.

For each thing that can happen the net has transitions, and the second reading (`happenings`) an interpreter. Both are
asked in every state of the things that either of them looks at, and must lead to the same states. Since each thing has
one value at the start, and what happens gives it one, by induction the loop and the reading have the same runs.
Nothing is explored, so the size of the loop does not matter; what one happening looks at is a dozen things at most.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import prod
from typing import Final, NamedTuple

from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import ACCIDENT, OVERRUN, DiffersError, Value
from firable.nets.machines.loop import ClosedLoop, Sending
from firable.nets.net import Transition

STATES_MAX: Final = 1_000_000
"""In how many states one happening is compared; one that looks at more things is refused."""


def compare(plant: Plant, loop: ClosedLoop) -> int:
    """In how many states the net of a loop was compared with a second reading of the plant file.

    Raises `DiffersError` at the first difference.
    """
    _compare_places(plant, loop)
    _compare_names(plant, loop)
    some = by_happening(plant, loop.net.transitions)
    return sum(compare_one(plant, name, some[name]) for name in plant.happenings)


def by_happening(plant: Plant, transitions: Iterable[Transition]) -> dict[str, list[Transition]]:
    """The transitions of a loop by what they are ways of; behind its name are words that tell the ways apart."""
    found: dict[str, list[Transition]] = {name: [] for name in plant.happenings}
    for transition in transitions:
        parts = transition.name.split("/")
        starts = ("/".join(parts[:length]) for length in range(len(parts), 0, -1))
        if (name := next((start for start in starts if start in found), None)) is None:
            raise DiffersError(f"nothing happens in the plant as '{transition.name}'")
        found[name].append(transition)
    return found


def _compare_places(plant: Plant, loop: ClosedLoop) -> None:
    if loop.net.signals or loop.net.arbiters or any(t.external for t in loop.net.transitions):
        raise DiffersError("something of it waits for a signal, or is arbitrated")
    wanted: dict[str, bool] = {}
    for thing, places in plant.things.items():
        wanted |= {place: plant.start[thing] == value for value, place in places.items()}
    found = {place.name: place.marked for place in loop.net.places}
    if differing := sorted(name for name in wanted | found if wanted.get(name) != found.get(name)):
        raise DiffersError(f"'{differing[0]}' is missing in the loop, nothing of the plant, or marked wrongly")


def _compare_names(plant: Plant, loop: ClosedLoop) -> None:
    """What the questions about O4 use: where each signal is shown, and which commands are still to be sent."""
    late = plant.commanding if plant.sending is Sending.LATE else ()
    if dict(loop.unsent) != {place.name: plant.things[f"unsent {place.name}"][True] for place in late}:
        raise DiffersError("the commands that are still to be sent are others")
    shown = {signal: (plant.things[f"signal {signal}"][True], True) for signal in (*plant.completions, *plant.timers)}
    for signal in (signal.name for signal in plant.net.signals if signal.name not in shown):
        if (sensor := plant.model.sensors.get(signal)) is not None:
            bit = plant.things.get(f"key {signal}") or plant.things.get(f"bit {signal}")
            seen = f"has {sensor.occupied or sensor.holding}"
            shown[signal] = (plant.things[seen][None], False) if bit is None else (bit[True], True)
    if dict(loop.shown) != shown:
        raise DiffersError("the places that show the signals are others")


class _UnseenError(Exception):
    """The second reading looks at a thing that the net does not."""


class _State(dict[str, Value]):
    """The values of some things; looking at another one, by its name in brackets, is told."""

    def __missing__(self, thing: str) -> Value:
        raise _UnseenError(thing)


def compare_one(plant: Plant, name: str, transitions: Sequence[Transition]) -> int:
    """In how many states the transitions of one happening were compared; raises `DiffersError`."""
    ended = {plant.things[thing][True] for thing in (ACCIDENT, OVERRUN)}
    for t in transitions:
        if not ended <= {*t.outputs, *t.inhibitive}:
            raise DiffersError(f"'{t.name}' may happen after an accident")
    touched = (place for t in transitions for place in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive))
    things = dict.fromkeys(plant.thing_of[place] for place in touched) | dict.fromkeys((ACCIDENT, OVERRUN))
    ways = [_Way.of(t) for t in transitions]
    while True:
        try:
            return sum(_same_in(plant, name, ways, state) for state in _states(plant, things, name))
        except _UnseenError as error:
            things[str(error)] = None


class _Way(NamedTuple):
    """The places of a transition: those that must be full, those that must be empty, and what it takes and fills."""

    full: frozenset[str]
    empty: frozenset[str]
    takes: frozenset[str]
    fills: frozenset[str]

    @classmethod
    def of(cls, t: Transition) -> _Way:
        takes, fills = frozenset(t.inputs), frozenset(t.outputs)
        return cls(takes.union(t.permissive), fills.union(t.inhibitive), takes, fills)


def _states(plant: Plant, things: Iterable[str], name: str) -> Iterator[_State]:
    """Every state of these things before an accident."""
    among: dict[str, list[Value]] = {
        thing: [False] if thing in {ACCIDENT, OVERRUN} else plant.values(thing) for thing in things
    }
    if prod(map(len, among.values())) > STATES_MAX:
        raise DiffersError(f"'{name}' looks at more things than are compared")
    yield from (_State(zip(among, values, strict=True)) for values in product(*among.values()))


def _same_in(plant: Plant, name: str, ways: Iterable[_Way], state: _State) -> bool:
    said = {_marked(plant, {**state, **_known(changes, state)}) for changes in plant.happenings[name](state)}
    marked = _marked(plant, state)
    firable = (way for way in ways if way.full <= marked and way.empty.isdisjoint(marked))
    if said != {marked - way.takes | way.fills for way in firable}:
        told = ", ".join(f"{thing}: {value}" for thing, value in state.items() if value)
        raise DiffersError(f"'{name}' does not go as the plant file says, where {told or 'nothing is so'}")
    return True


def _known(changes: dict[str, Value], state: dict[str, Value]) -> dict[str, Value]:
    if unseen := next((thing for thing in changes if thing not in state), None):
        raise _UnseenError(unseen)
    return changes


def _marked(plant: Plant, state: Mapping[str, Value]) -> frozenset[str]:
    """The places that are marked in a state."""
    things = plant.things
    return frozenset([things[thing][value] for thing, value in state.items() if value in things[thing]])
