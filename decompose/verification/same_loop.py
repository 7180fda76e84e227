"""Is the net of a closed loop what the plant file says? Compared in every state, reached or not, thing by thing.

For each thing that can happen the net has transitions, and the second reading (`happenings`) an interpreter. Both are
asked in every state of the things that either of them looks at, and must lead to the same states. Since each thing has
one value at the start, and what happens gives it one, by induction the loop and the reading have the same runs.
Nothing is explored, so the size of the loop does not matter; what one happening looks at is a dozen things at most.

States that cannot be are left out where `Things` says so: nothing is broken off but by a machine at a stop, and nothing
is judged where nothing lies. It is so at the start, and each happening is seen to leave it so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import ACCIDENT, BAD, GOOD, OVERRUN, DiffersError, UncomparedError, Value
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
            if sensor.passes is not None or sensor.fails is not None:
                verdicts = plant.things[f"judged {sensor.passes or sensor.fails}"]
                shown[signal] = verdicts[GOOD if sensor.passes is not None else BAD], True
                continue
            places = plant.things[plant.truths[signal]]
            shown[signal] = (places[True], True) if True in places else (places[None], False)
    shown |= {signal: (plant.things[f"told {signal}"][True], True) for signal in plant.late}
    if dict(loop.shown) != shown:
        raise DiffersError("the places that show the signals are others")


class _UnseenError(Exception):
    """Something looks at a thing whose value is left open."""


class _State(dict[str, Value]):
    """The values of some things; looking at another one is told, by its name."""

    def __missing__(self, thing: str) -> Value:
        raise _UnseenError(thing)


def compare_one(plant: Plant, name: str, transitions: Sequence[Transition]) -> int:
    """In how many states the transitions of one happening were compared; raises `DiffersError`.

    A state has the values of as many things as are looked at in it, and stands for all that have them: only where the
    reading, or a transition, looks at one more is there a state for each of its values. Where a transition lacks its
    first token nobody looks at machines, so there are sums of states and not products.
    """
    ended = {plant.things[thing][True] for thing in (ACCIDENT, OVERRUN)}
    for t in transitions:
        if not ended <= {*t.outputs, *t.inhibitive}:
            raise DiffersError(f"'{t.name}' may happen after an accident")
    count, open_ = 0, [(_State({ACCIDENT: False, OVERRUN: False}), [_Way.of(t) for t in transitions])]
    while open_:
        state, ways = open_.pop()
        left = [way for way in ways if way.may_fire(plant, state)]
        try:
            _compare_in(plant, name, left, state)
        except _UnseenError as error:
            open_ += ((_State({**state, **more}), left) for more in plant.ways_to_know(str(error), state))
            continue
        if (count := count + 1) > STATES_MAX:
            raise UncomparedError(name)
    return count


class _Way(NamedTuple):
    """The places of a transition: those that must be full, those that must be empty, and what it takes and fills."""

    full: tuple[str, ...]
    empty: tuple[str, ...]
    takes: frozenset[str]
    fills: frozenset[str]

    @classmethod
    def of(cls, t: Transition) -> _Way:
        full, empty = (*t.inputs, *t.permissive), (*t.outputs, *t.inhibitive)
        return cls(full, empty, frozenset(t.inputs), frozenset(t.outputs))

    def may_fire(self, plant: Plant, state: _State) -> bool:
        """Whether nothing that is known keeps it from firing."""
        for places, wanted in ((self.full, True), (self.empty, False)):
            for thing, value in map(plant.thing_of.__getitem__, places):
                if thing in state and (state[thing] == value) != wanted:
                    return False
        return True

    def look(self, plant: Plant, state: _State) -> None:
        """Look at all that it goes by; raises `_UnseenError` for what is left open."""
        for place in (*self.full, *self.empty):
            _ = state[plant.thing_of[place][0]]


def _compare_in(plant: Plant, name: str, ways: Iterable[_Way], state: _State) -> None:
    """Compare in one state, of `ways` that may fire in it: they do where nothing that they go by is left open."""
    changes = list(plant.happenings[name](state))
    for way in ways:
        way.look(plant, state)
    for one in changes:
        for thing in one:
            _ = state[thing]
        plant.assert_exists(_State({**state, **one}), one)
    marked = _marked(plant, state)
    if {_marked(plant, {**state, **one}) for one in changes} != {marked - way.takes | way.fills for way in ways}:
        told = ", ".join(f"{thing}: {value}" for thing, value in state.items() if value)
        raise DiffersError(f"'{name}' does not go as the plant file says, where {told or 'nothing is so'}")


def _marked(plant: Plant, state: Mapping[str, Value]) -> frozenset[str]:
    """The places of the things in a state that are marked in it."""
    things = plant.things
    return frozenset([things[thing][value] for thing, value in state.items() if value in things[thing]])
