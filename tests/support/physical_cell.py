"""A cell whose signals are messages on wires: what the loop says of controllers that are told late, played out.

Each signal has a wire. A change of it is a message there, which arrives at its controller some time later; gates go by
what has arrived. Nothing else is held up meanwhile, and nobody asks who might go by an old value: so what the loop
reckons with, which signals it tells late and which in the instant, is not used here, only what its machines do.

Of the times of messages it is known that

- the messages of one wire arrive in order, those of several in any order; a completion behind all that the sensors have
  sent that see what its command does, and that of a stop when what it has broken off has been told;
- they are short: while a machine is at a command there is a moment at which nothing is under way, unless nothing was as
  it was given it; a key that a command releases is told of before that is done;
- a camera judges a workpiece when all is told that shows whether one lies there, and what it was found;
- so many messages are on a wire at most: a sensor that is taken a workpiece, given one and taken it again within one
  delay is in no loop, one that flickers is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final

import numpy as np

from firable.analysis.spaces.reachability import Budget, explore
from firable.decompose.verification.happenings import Changes, Happens, Plant
from firable.decompose.verification.plant import ACCIDENT, OVERRUN, State
from firable.nets.machines.loop import ClosedLoop
from firable.nets.machines.plant_file import Stop
from firable.nets.net import Place

MESSAGES_MAX: Final = 2
FLICKERING_MAX: Final = 4
OF_TELLING: Final = (".news", ".told_0", ".told_1", ".starting", "plant.untold")
"""How the places of a loop end that say what controllers know."""


@dataclass(frozen=True)
class PhysicalCell(Plant):
    """What can happen in a cell with wires; a wire is the word of the values that are under way, oldest first."""

    @cached_property
    def late(self) -> tuple[str, ...]:
        """No signal is a place that says what is known of it."""
        return ()

    @cached_property
    def start(self) -> State:
        """Every controller knows what is."""
        first = super().start
        known = {f"arrived {name}": self.is_true(name, first) for name in self.truths}
        quiet = {f"restless {name}": False for name in self.model.machines}
        return {**first, **known, **{f"wire {name}": "" for name in self.truths}, **quiet}

    def shown(self, signal: str, state: State) -> bool:
        """What has arrived."""
        return bool(state[f"arrived {signal}"]) if signal in self.truths else self.is_true(signal, state)

    def is_under_way(self, names: set[str], state: State) -> bool:
        """Whether there is a message of one of some signals."""
        return any(state[f"wire {name}"] for name in names if name in self.truths)

    def is_still_to_be_told(self, machine: str, state: State) -> bool:
        """Whether a command is still too young to be done."""
        keys = {name for name, sensor in self.model.sensors.items() if sensor.acknowledges == machine}
        return bool(state[f"restless {machine}"]) or self.is_under_way(keys, state)

    def done(self, place: Place, state: State) -> Iterator[Changes]:
        """A machine is done; at a stop that is told of, when what it has broken off was told."""
        if isinstance(self.action(place), Stop) and place.completion is not None:
            broken_off = self.may_break_off(self.machine_of(place))
            if self.is_under_way({name for one in broken_off for name, _ in self.shows_done(one)}, state):
                return
        yield from super().done(place, state)

    def judges(self, station: str, state: State) -> Iterator[Changes]:
        """A camera judges what is known to lie there, or not to, and not to be judged yet."""
        there = {name for name, sensor in self.model.sensors.items() if sensor.occupied == station}
        if not self.is_under_way(there | {*self.judging(station)}, state):
            yield from super().judges(station, state)

    def _by_themselves(self) -> Iterator[tuple[str, Happens]]:
        yield from super()._by_themselves()
        yield from ((f"{name} arrives", partial(self.message_arrives, name)) for name in self.truths)

    def message_arrives(self, name: str, state: State) -> Iterator[Changes]:
        """The oldest message of a signal."""
        wire = str(state[f"wire {name}"])
        if wire and not (name in self.completions and self.is_under_way(self.seen_with[name], state)):
            yield {f"wire {name}": wire[1:], f"arrived {name}": wire[0] == "1"}

    def is_news(self, happens: Happens, places: list[Place], state: State) -> Iterator[Changes]:
        """What happens, with the messages that it sends."""
        for changes in happens(state):
            if ACCIDENT in changes or OVERRUN in changes:
                yield changes
            elif (sent := self.messages(changes, state)) is not None:
                yield changes | sent | self.restless({**state, **changes, **sent}, places)

    def messages(self, changes: Changes, state: State) -> Changes | None:
        """The wires after some changes; None where one of them would bear too many."""
        after, sent = {**state, **changes}, Changes()
        for name in (name for name, thing in self.truths.items() if thing in changes):
            value = self.is_true(name, after)
            if name in self.completions and not value:  # whoever sends the command knows that it is not done
                sent |= {f"wire {name}": "", f"arrived {name}": False}
            elif value != self.is_true(name, state):
                sent[f"wire {name}"] = wire = f"{state[f'wire {name}']}{value:d}"
                sensor = self.model.sensors.get(name)
                if len(wire) > (FLICKERING_MAX if sensor is not None and sensor.may_flicker else MESSAGES_MAX):
                    return None
        return sent

    def restless(self, after: State, places: list[Place]) -> Changes:
        """The machines that were given a command when a message was under way, with none without one since."""
        if not self.is_under_way({*self.truths}, after):
            return {f"restless {name}": False for name in self.model.machines}
        given = {self.machine_of(place) for place in places}  # and are at it, or done with it
        return {f"restless {name}": after[f"at {name}"] is not None for name in given}

    def marking(self, state: State) -> frozenset[str]:
        """The places of the loop that hold a token then; of what is set from outside they say what has arrived."""
        outside = {name for name, sensor in self.model.sensors.items() if sensor.set_by is not None}
        known = {**state, **{f"set {name}": state[f"arrived {name}"] for name in outside}}
        return frozenset(places[known[thing]] for thing, places in self.things.items() if known[thing] in places)

    def runs(self, states_max: int) -> tuple[dict[frozenset[str], tuple[str, ...]], bool]:
        """The markings that so many states have, each with a shortest run to it; and whether those are all states."""
        found: dict[frozenset[str], tuple[str, ...]] = {}
        seen, open_ = {tuple(self.start.values())}, deque[tuple[State, tuple[str, ...]]]([(self.start, ())])
        while open_:
            state, run = open_.popleft()
            found.setdefault(self.marking(state), run)
            if state[ACCIDENT] or state[OVERRUN]:
                continue
            for name, happens in self.happenings.items():
                for changes in happens(state):
                    after = {**state, **changes}
                    if (values := tuple(after.values())) in seen:
                        continue
                    if len(seen) == states_max:
                        return found, False
                    seen.add(values)
                    open_.append((after, (*run, name)))
        return found, True


def reached(loop: ClosedLoop, budget: int) -> set[frozenset[str]] | None:
    """The markings of a loop but for what says what controllers know; None where there are too many."""
    space = explore(loop.net, budget=Budget(markings=budget))
    if not space.complete:
        return None
    kept = {p.name for p in loop.net.places if not p.name.endswith(OF_TELLING)}
    return {frozenset(kept & {*loop.net.names(one)}) for one in space.markings(np.arange(space.n_markings))}
