"""A second reading of the plant file: what can happen in a cell with its machines, told as an interpreter would.

The loops of a bundle are made by `firable.nets.machines`, for prover and checker alike. So the checker reads the
plant file a second time, and not as arcs: here a machine *is at* a command or at none, a hand *is at* a position, a
station or a hand *has* nothing, a raw or a machined workpiece, one on a station *is judged* good or bad; and of each
thing that can happen it is told, in one state, which states may follow. That the net of the loop does the same in every
state is compared in `same_loop`.

The meaning is that of docs/machines.md. Commands are sent in the firing itself, one after the other, or late: each
controller sends a command some time after the firing that it belongs to, and what reads or takes the token of that
place waits until then.

    T                  a transition of the cell fires
    sent/P             late, the command of place P reaches its machine, or cannot be taken: an accident, and all ends
    M/done/P           the machine is done with it;           M/accident/P   it ends in an accident
    M/still-done/P     what M breaks off, because it is stopped at P, is done before it has come to rest;
    M/still-accident/P it ends in an accident
    M/fails/P          M, at the command of P, fails, while no other machine has;   M/repaired   it goes on
    M/takes/P/X        M, which indexes at P, takes what lies on station X;   M/lays/P/X   lays that on the next one
    S/shown            the sensor of an acknowledged completion shows it
    arrives/E, leaves/E   a workpiece comes, or is taken away
    X/judged           the workpiece on a station is found good, or not
    S/drops, S/returns, S/clears     a sensor that is not exact
    S/pressed, S/released            a key;     S/set, S/reset   what somebody outside the cell sets
    S/over             a time limit that somebody reads
    S/told             a controller is told of a signal that has changed some moment before
    M/started          all is told, and a machine that was given its command before is still at it

Rejected: an explored comparison with the simulated cell, which is exact about times and cannot say that nothing is
left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

from firable.decompose.verification.plant import (
    ACCIDENT,
    BAD,
    GOOD,
    OVERRUN,
    UNTOLD,
    DiffersError,
    State,
    Step,
    Things,
    Value,
    target_of,
)
from firable.nets.machines.loop import Faults, Sending
from firable.nets.machines.plant_file import (
    Action,
    Carry,
    Clamp,
    Departure,
    Grasp,
    Index,
    Move,
    Process,
    Put,
    Release,
    Stop,
    Switch,
)
from firable.nets.net import Place, Transition
from firable.nets.well_formed import as_name

Changes = dict[str, Value]
Happens = Callable[[State], Iterator[Changes]]


@dataclass(frozen=True)
class Plant(Things):
    """What can happen in a cell with its machines."""

    @cached_property
    def happenings(self) -> dict[str, Happens]:
        """Everything that can happen, by its name: after a state, what changes, once for each way that it can go.

        Raises `DiffersError` where two have one name: the one would stand for the other in all that is asked.
        """
        found: dict[str, Happens] = {}
        by_commands = ((name, partial(self.is_news, *what)) for name, what in self._by_commands())
        by_themselves = ((name, partial(self.is_news, happens, [])) for name, happens in self._by_themselves())
        for name, happens in (*by_commands, *by_themselves):
            if name in found:
                raise DiffersError(f"two things that happen are called '{name}'")
            found[name] = happens
        return found

    def _by_commands(self) -> Iterator[tuple[str, tuple[Happens, list[Place]]]]:
        """What happens as commands are sent, or done, with their places."""
        for t in self.net.transitions:
            sent = [place for place in self.commanding if place.name in t.outputs and self.sending is Sending.AT_ONCE]
            yield t.name, (partial(self.fires, t), sent)
        for place in self.commanding if self.sending is Sending.LATE else ():
            yield f"sent/{place.name}", (partial(self.sent_late, place), [place])
        for place in self.commanding:
            if place.name not in self.momentary:
                yield f"{as_name(self.machine_of(place))}/done/{place.name}", (partial(self.done, place), [place])
            steps = self.steps_of(place) if isinstance(self.action(place), Index) else []
            for step, next_ in zip(steps, [*(one.name for one in steps[1:]), None], strict=False):
                name = f"{as_name(self.machine_of(place))}/{step.does}/{place.name}/{as_name(step.at)}"
                yield name, (partial(self.goes_on, place, step, next_), [place])

    def _by_themselves(self) -> Iterator[tuple[str, Happens]]:
        for timer in self.timers:
            yield f"{timer}/over", partial(self.over, timer)
        for name in self.late:
            yield f"{name}/told", partial(self.told, name)
        for name in self.may_start:
            yield f"{as_name(name)}/started", partial(self.started, name)
        for name, sensor in self.model.sensors.items():
            ways: dict[str, Happens] = {}
            if sensor.acknowledges is not None:
                ways = {"pressed": partial(self.pressed, name), "released": partial(self.released, name)}
            elif sensor.set_by is not None:
                ways = {way: partial(self.set_from_outside, name, value=way == "set") for way in ("set", "reset")}
            flickers = ("drops", "returns") if sensor.may_flicker else ()
            ways |= {way: partial(self.wavers, name, way) for way in flickers}
            ways |= {"clears": partial(self.wavers, name, "clears")} if sensor.may_linger else {}
            yield from ((f"{name}/{way}", partial(self.once_it_is_told, name, does)) for way, does in ways.items())
        for place in self.commanding:
            if place.name not in self.momentary:
                yield f"{as_name(self.machine_of(place))}/accident/{place.name}", partial(self.spoils, place)
        for name in self.model.machines:
            for place in self.may_break_off(name):
                yield f"{as_name(name)}/still-done/{place.name}", partial(self.still_done, place)
                yield f"{as_name(name)}/still-accident/{place.name}", partial(self.still_spoils, place)
        for place in self.failing:
            yield f"{as_name(self.machine_of(place))}/fails/{place.name}", partial(self.fails, place)
        for name in self.may_fail if self.faults is Faults.REPAIRED else ():
            yield f"{as_name(name)}/repaired", partial(self.repaired, name)
        for name in self.sensed:
            yield f"{name}/shown", partial(self.comes_to_be_shown, name)
        yield f"arrives/{as_name(self.model.arrivals.station)}", self.arrives
        for out in self.model.departures:
            yield f"leaves/{as_name(out.station)}", partial(self.leaves, out)
        for station in sorted(self.judged):
            yield f"{as_name(station)}/judged", partial(self.judges, station)

    def once_it_is_told(self, name: str, happens: Happens, state: State) -> Iterator[Changes]:
        """Nobody outside, and no sensor by itself, waits until a controller is told of anything but this very signal.

        What forms a completion is no signal.
        """
        if name in self.sensed or name not in self.late or not state[f"news of {name}"]:
            yield from happens(state)

    def is_news(self, happens: Happens, places: list[Place], state: State) -> Iterator[Changes]:
        """What happens, with what controllers are told of it at once, and what is news to them."""
        for changes in happens(state):
            if ACCIDENT in changes or OVERRUN in changes:
                yield changes
                continue
            for told in self.told_at_once(changes, places, state):
                all_ = told | self.untold(told, state)
                yield all_ | self.starts(all_, state)

    def untold(self, changes: Changes, state: State) -> Changes:
        """Whether there is news now, where some has come or is no more."""
        if not self.may_start or not any(f"news of {name}" in changes for name in self.late):
            return {}
        after = _Overlaid(changes, state)
        return {UNTOLD: any(after[f"news of {name}"] for name in self.late)}

    def starts(self, changes: Changes, state: State) -> Changes:
        """A machine that is given a command while there is news is starting, but one that is stopped at once, or done,
        is not."""
        given = [name for name in self.may_start if f"at {name}" in changes]
        return {
            f"starting {name}": changes[f"at {name}"] is not None and _Overlaid(changes, state)[UNTOLD]
            for name in given
        }

    def started(self, machine: str, state: State) -> Iterator[Changes]:
        """A machine is at its command still when all is told."""
        if state[f"starting {machine}"] and not state[UNTOLD]:
            yield {f"starting {machine}": False}

    def is_still_to_be_told(self, machine: str, state: State) -> bool:
        """Whether a controller is still to be told of what was so before a machine was given its command, or of a key
        that the command has released: a signal takes less time than any command."""
        if machine in self.may_start and state[f"starting {machine}"]:
            return True
        keys = [name for name in self.late if name in self.model.sensors]
        return any(self.model.sensors[name].acknowledges == machine and state[f"news of {name}"] for name in keys)

    def told_at_once(self, changes: Changes, places: list[Place], state: State) -> Iterator[Changes]:
        """Of what closes a gate a controller may be told later; it clears completions by itself."""
        after = _Overlaid(changes, state)
        touched = [name for name, thing in self.truths.items() if thing in changes]
        values = ((name, self.is_true(name, after), self.is_true(name, state)) for name in touched)
        new = {name: now for name, now, was in values if now != was}
        closing = [(name, value) for name, value in new.items() if value or name not in self.completions]
        late = self.told_late(closing, places)
        if not late <= {*self.late}:
            raise DiffersError(f"{', '.join(sorted(late - {*self.late}))} may be told late, and was not expected to be")
        ways: list[Changes] = [{}]
        for name in sorted(new.keys() & {*self.late}, key=lambda one: one in self.completions):
            told, news = f"told {name}", f"news of {name}"
            is_known = bool(state[told]) == new[name]
            if state[news]:  # it is again what the controller knows, or other news is still to come
                stay: list[Changes] = [{}] if name not in self.completions else []
                over: list[Changes] = [{news: False}] if is_known else []
                ways = [{**way, **one} for way in ways for one in (*stay, *over)]
                continue
            next_: list[Changes] = []
            for way in ways:
                is_behind = any(_Overlaid(way, state)[f"news of {one}"] for one in self.told_before.get(name, ()))
                waits = new[name] and is_behind
                if name in late or waits:
                    next_.append({**way, news: True})
                is_late_alone = late == {name} and name in self.completions
                if (name not in late or is_late_alone) and not waits and not is_known:
                    next_.append({**way, told: new[name]})  # what is no news is known
            ways = next_
        yield from (changes | way for way in ways)

    def told(self, name: str, state: State) -> Iterator[Changes]:
        """A controller is told of a signal that has changed, of a completion behind what sensors show of it; or of an
        earlier change: it was different meanwhile, or has flickered before it fell."""
        if any(state[f"news of {one}"] for one in self.told_before.get(name, ())):
            return
        if not state[f"news of {name}"]:
            return
        if bool(state[f"told {name}"]) != (value := self.is_true(name, state)):
            yield {f"news of {name}": False, f"told {name}": value}
            if not value and name not in self.completions and name in self.flickering:
                yield {f"told {name}": False}
        elif name not in self.completions:  # it was different meanwhile
            yield {f"told {name}": not value}

    def fires(self, t: Transition, state: State) -> Iterator[Changes]:
        """Eq. (1)-(4), gates as the signals show them, once the commands of what it takes or reads have been sent."""
        if not all(state[f"token of {p}"] for p in (*t.inputs, *t.permissive)):
            return
        if any(state[f"token of {p}"] for p in (*t.outputs, *t.inhibitive)):
            return
        due = [f"unsent {p}" for p in (*t.inputs, *t.permissive, *t.outputs) if f"unsent {p}" in self.things]
        timers = {place.within.timer for place in self.net.places if place.within is not None}
        read = [gate for gate in t.external if gate.signal not in timers or gate.signal in self.timers]
        if not any(state[one] for one in due) and all(self.shown(gate.signal, state) == gate.wanted for gate in read):
            changes: Changes = {f"token of {p}": False for p in t.inputs}
            changes |= {f"token of {p}": True for p in t.outputs}
            if self.sending is Sending.LATE:
                yield changes | {f"unsent {p}": True for p in t.outputs if f"unsent {p}" in self.things}
                return
            commanding = [place for place in self.commanding if place.name in t.outputs]
            yield from self.all_sent(commanding, changes, state)

    def sent_late(self, place: Place, state: State) -> Iterator[Changes]:
        """A command that was still to be sent is."""
        if state[f"unsent {place.name}"]:
            yield from self.all_sent([place], {f"unsent {place.name}": False}, state)

    def all_sent(self, places: list[Place], changes: Changes, state: State) -> Iterator[Changes]:
        """Commands are sent in the order of the net; after an accident none is, and no sensor sees anything more."""
        if not places:
            yield from ({**changes, **seen} for seen in self.sensors_see(changes, state))
            return
        for sent in self.sent(places[0], _Overlaid(changes, state)):
            if ACCIDENT in sent or OVERRUN in sent:
                yield changes | sent
            else:
                yield from self.all_sent(places[1:], changes | sent, state)

    def sent(self, place: Place, state: State) -> Iterator[Changes]:
        """The command reaches its machine, and clears the completion that it will set."""
        cleared: Changes = {}
        if place.completion is not None:
            cleared[f"signal {place.completion}"] = False
            if place.completion in self.sensed:
                cleared[f"acknowledged {place.completion}"] = False
                if state[f"acknowledged {place.completion}"] and state[f"signal {place.completion}"]:
                    return  # no completion is both: it is shown, or waits to be
        if place.within is not None and place.within.timer in self.timers:
            cleared[f"signal {place.within.timer}"] = False
        yield from (cleared | taken for taken in self.taken(place, state))

    def taken(self, place: Place, state: State) -> Iterator[Changes]:
        """How a machine takes a command."""
        name, action = self.machine_of(place), self.action(place)
        at, has = f"at {name}", f"has {name}"
        if isinstance(action, Stop):
            yield from self.stopped(place, state)
        elif state[at] is not None:
            yield {OVERRUN: True}
        elif isinstance(action, (Grasp, Put)):
            right = state[f"hand {name}"] == self.where(place, "at")
            right = right and (state[has] is None) == isinstance(action, Grasp)
            yield {at: place.name} if right else {ACCIDENT: True}
        elif isinstance(action, Carry) and state[has] is None:
            there = state[f"has {action.source}"]
            taken: Changes = {at: place.name, has: there, f"has {action.source}": None}
            yield {ACCIDENT: True} if there is None else self.unjudged(taken)
        elif isinstance(action, Process):
            right = bool(state[f"clamped {action.station}"]) and state[f"has {action.station}"] == "raw"
            yield {at: place.name} if right else {ACCIDENT: True}
        elif isinstance(action, Index):
            if state[f"step {name}"] is not None:
                return  # it is never idle in the midst of an index
            wrong = [bool(state[f"clamped {one}"]) for one in action.following if one in self.clamps]
            others = (other for other in self.tables_at(self.ends_of(name)) if other != name)
            wrong += [state[f"step {other}"] is not None for other in others]
            begun: Changes = {at: place.name, f"step {name}": self.steps_of(place)[0].name}
            yield {ACCIDENT: True} if any(wrong) else begun
        elif isinstance(action, Switch):
            yield {}
        else:
            yield {at: place.name}

    def goes_on(self, place: Place, step: Step, next_: str | None, state: State) -> Iterator[Changes]:
        """A machine that indexes takes what lies on a station, if anything does; or lays that on the next one."""
        machine = self.machine_of(place)
        if state[f"at {machine}"] != place.name or state[f"step {machine}"] != step.name:
            return
        if self.has_failed(machine, state) or self.is_still_to_be_told(machine, state):
            return
        ends = [f"has {step.at}", f"has {machine} from {step.at}"]
        source, target = ends if step.does == "takes" else (ends[1], f"has {step.to}")
        if state[source] is None:
            yield {f"step {machine}": next_}
        elif state[target] is None:
            changes = self.unjudged({f"step {machine}": next_, source: None, target: state[source]})
            yield from ({**changes, **seen} for seen in self.sensors_see(changes, state))

    def is_indexed(self, station: str, state: State) -> bool:
        """Whether a machine is in the midst of an index there."""
        return any(state[f"step {table}"] is not None for table in self.tables_at([station]))

    def stopped(self, place: Place, state: State) -> Iterator[Changes]:
        """A machine leaves what it is at undone, or breaks it off: that may still be done until it is at rest."""
        name = self.machine_of(place)
        at, breaks = f"at {name}", f"breaks off {name}"
        changes: Changes = {at: None if place.name in self.momentary else place.name}
        if state[at] is not None and breaks in self.things:
            was = self.net.place(str(state[at]))
            if isinstance(self.action(was), Stop):
                changes |= {breaks: None} if place.name in self.momentary else {}
            elif was in self.may_break_off(name) and place.name not in self.momentary:
                changes |= {breaks: was.name}
        yield changes

    def done(self, place: Place, state: State) -> Iterator[Changes]:
        """A machine is done with what it is at: the effect, what sensors see of it, and the completion."""
        name = self.machine_of(place)
        if state[f"at {name}"] != place.name:
            return
        if self.has_failed(name, state) and not isinstance(self.action(place), Stop):
            return
        if self.is_still_to_be_told(name, state):
            return
        if isinstance(self.action(place), Stop) and place.completion is not None:
            broken_off = {signal for one in self.may_break_off(name) for signal, _ in self.shows_done(one)}
            if any(state[f"news of {signal}"] for signal in self.late if signal in broken_off):
                return  # what was done after all is seen when the machine says that it is at rest
        for effect in self.effect(place, state):
            for seen in self.sensors_see(effect, state):
                changes: Changes = {f"at {name}": None, **effect, **seen}
                if isinstance(self.action(place), Stop) and f"breaks off {name}" in self.things:
                    changes[f"breaks off {name}"] = None
                yield from ({**changes, **formed} for formed in self.formed(place, _Overlaid(changes, state)))

    def effect(self, place: Place, state: State) -> Iterator[Changes]:
        """What a command does; nothing where it waits, or ends in an accident."""
        name, action = self.machine_of(place), self.action(place)
        match action:
            case Move():
                yield {f"hand {name}": self.where(place, "to")}
            case Grasp():
                station = self.model.machines[name].positions[self.where(place, "at")]
                if station is not None and not (station in self.clamps and state[f"clamped {station}"]):
                    yield from self.moves(station, name, state)
            case Put():
                station = self.model.machines[name].positions[self.where(place, "at")]
                if station is not None and not self.is_indexed(station, state):
                    yield from self.moves(name, station, state)
            case Carry(target=target):
                if not self.is_indexed(target, state):
                    yield from self.moves(name, target, state)
            case Index():
                if state[f"step {name}"] is None:
                    yield {}
            case Clamp(station=station):
                if state[f"has {station}"] is not None:
                    yield {f"clamped {station}": True}
            case Process(station=station):
                if state[f"has {station}"] is not None:
                    yield self.unjudged({f"has {station}": "machined"})
            case Release(station=station):
                yield {f"clamped {station}": False}
            case _:
                yield {}

    def moves(self, source: str, target: str, state: State) -> Iterator[Changes]:
        """A workpiece goes from one to the other, where there is one, and the other has none."""
        kind = state[f"has {source}"]
        if kind is not None and state[f"has {target}"] is None:
            yield self.unjudged({f"has {source}": None, f"has {target}": kind})

    def unjudged(self, changes: Changes) -> Changes:
        """What is on a station is another thing now, or nothing: nobody has judged it."""
        stations = {thing.removeprefix("has ") for thing in changes if thing.startswith("has ")}
        return changes | {f"judged {station}": None for station in stations & self.judged}

    def judges(self, station: str, state: State) -> Iterator[Changes]:
        """A workpiece that lies there, and was not judged, is good or bad, once both are told."""
        judged = f"judged {station}"
        sees = {name for name, sensor in self.model.sensors.items() if sensor.occupied == station}
        sees |= {*self.judging(station)}
        if any(state[f"news of {name}"] for name in self.late if name in sees):
            return
        if state[f"has {station}"] is not None and state[judged] is None:
            yield {judged: GOOD}
            yield {judged: BAD}

    def spoils(self, place: Place, state: State) -> Iterator[Changes]:
        """What a machine is at ends in an accident."""
        name, action = self.machine_of(place), self.action(place)
        at_work = state[f"at {name}"] == place.name and not self.has_failed(name, state)
        if at_work and not self.is_still_to_be_told(name, state) and self.goes_wrong(name, action, place, state):
            yield {f"at {name}": None, ACCIDENT: True}

    def still_done(self, place: Place, state: State) -> Iterator[Changes]:
        """What a machine breaks off has its effect before it is at rest; nobody acknowledges it."""
        breaks = f"breaks off {self.machine_of(place)}"
        if state[breaks] == place.name and not self.has_failed(self.machine_of(place), state):
            for effect in self.effect(place, state):
                yield from ({breaks: None, **effect, **seen} for seen in self.sensors_see(effect, state))

    def still_spoils(self, place: Place, state: State) -> Iterator[Changes]:
        """It ends in an accident before the machine is at rest."""
        name = self.machine_of(place)
        still = state[f"breaks off {name}"] == place.name and not self.has_failed(name, state)
        if still and self.goes_wrong(name, self.action(place), place, state):
            yield {f"breaks off {name}": None, ACCIDENT: True}

    def has_failed(self, machine: str, state: State) -> bool:
        """Whether a machine has failed: nothing that it is at gets done then, but a stop."""
        return machine in self.may_fail and bool(state[f"failed {machine}"])

    def fails(self, place: Place, state: State) -> Iterator[Changes]:
        """A machine fails at a command, once and alone."""
        name = self.machine_of(place)
        if state[f"at {name}"] == place.name and not any(state[f"failed {other}"] for other in self.may_fail):
            yield {f"failed {name}": True}

    def repaired(self, machine: str, state: State) -> Iterator[Changes]:
        """A machine that has failed is repaired, and goes on with what it is at."""
        if state[f"failed {machine}"]:
            yield {f"failed {machine}": False}

    def goes_wrong(self, name: str, action: Action, place: Place, state: State) -> bool:
        """Whether it does."""

        def collides(station: str, when_full: str) -> bool:
            is_free = state[f"has {station}"] is None
            wrong = self.is_indexed(station, state) if is_free else when_full == "collide"
            return wrong and state[f"has {name}"] is not None

        match action:
            case Grasp():
                station = self.model.machines[name].positions[self.where(place, "at")]
                if station is None or state[f"has {station}"] is None:
                    return True
                return station in self.clamps and bool(state[f"clamped {station}"])
            case Put(when_full=when_full):
                station = self.model.machines[name].positions[self.where(place, "at")]
                return station is None or collides(station, when_full)
            case Carry(target=target, when_full=when_full):
                return collides(target, when_full)
            case Index():
                now = (step for step in self.steps_of(place) if state[f"step {name}"] == step.name)
                return any(
                    step.does == "lays" and None not in (state[f"has {name} from {step.at}"], state[f"has {step.to}"])
                    for step in now
                )
            case Clamp(station=station) | Process(station=station):
                return state[f"has {station}"] is None
        return False

    def formed(self, place: Place, after: State) -> Iterator[Changes]:
        """The completion of a command that is done: set if the sensor of its name agrees, else acknowledged."""
        signal = place.completion
        if signal is None:
            yield {}
            return
        shared = sum(other.completion == signal for other in self.net.places) > 1
        if after[f"signal {signal}"] or (signal in self.sensed and after[f"acknowledged {signal}"]):
            if shared:
                yield {}
        elif signal in self.sensed and not self.seen(signal, after):
            yield {f"acknowledged {signal}": True}
        else:
            yield {f"signal {signal}": True}

    def sensors_see(self, effect: Changes, state: State) -> Iterator[Changes]:
        """What sensors that are not exact show where a workpiece comes or goes; nothing where that cannot be."""
        ways: list[Changes] = [{}]
        for name, sensor in self.model.sensors.items():
            thing, bit = target_of(sensor), f"bit {name}"
            if bit not in self.things or thing not in effect or (effect[thing] is None) == (state[thing] is None):
                continue
            came = effect[thing] is not None
            if not came and sensor.may_linger:  # it clears some time later; of a completion also before that is formed
                if name in self.sensed and state[bit]:
                    ways += [{**way, bit: False} for way in ways]
            elif bool(state[bit]) != came:
                ways = [{**way, bit: came} for way in ways]
            elif not (sensor.may_linger if came else sensor.may_flicker):
                return
        yield from ways

    def comes_to_be_shown(self, name: str, state: State) -> Iterator[Changes]:
        """The sensor of a completion that is acknowledged shows it."""
        if state[f"acknowledged {name}"] and not state[f"signal {name}"] and self.seen(name, state):
            yield {f"acknowledged {name}": False, f"signal {name}": True}

    def arrives(self, state: State) -> Iterator[Changes]:
        """A raw workpiece comes to the first station, unless a machine is in the midst of an index there."""
        entry = f"has {self.model.arrivals.station}"
        if state[entry] is None and not self.is_indexed(self.model.arrivals.station, state):
            yield from ({entry: "raw", **seen} for seen in self.sensors_see({entry: "raw"}, state))

    def leaves(self, out: Departure, state: State) -> Iterator[Changes]:
        """A finished workpiece is taken away from a last station; an unfinished one is an accident, unless it may leave
        so, or workpieces come there, too: it waits to be machined."""
        last = f"has {out.station}"
        if state[last] == self.kinds[-1] or (out.raw and state[last] is not None):
            gone = self.unjudged({last: None})
            yield from ({**gone, **seen} for seen in self.sensors_see(gone, state))
        elif state[last] is not None and self.model.arrivals.station != out.station:
            yield {ACCIDENT: True}

    def wavers(self, name: str, way: str, state: State) -> Iterator[Changes]:
        """A sensor drops though something is there, comes back, or clears when it is gone."""
        there, bit = state[target_of(self.model.sensors[name])] is not None, bool(state[f"bit {name}"])
        if (there, bit) == {"drops": (True, True), "returns": (True, False), "clears": (False, True)}[way]:
            yield {f"bit {name}": not bit}

    def pressed(self, name: str, state: State) -> Iterator[Changes]:
        """Somebody presses a key."""
        if not state[f"key {name}"]:
            yield {f"key {name}": True}

    def released(self, name: str, state: State) -> Iterator[Changes]:
        """A key is released while the machine that it is for is at a command."""
        if state[f"key {name}"] and state[f"at {self.model.sensors[name].acknowledges}"] is not None:
            yield {f"key {name}": False}

    def set_from_outside(self, name: str, state: State, *, value: bool) -> Iterator[Changes]:
        """Somebody outside the cell changes a signal, whatever goes on in it."""
        if state[f"set {name}"] != value:
            yield {f"set {name}": value}

    def over(self, timer: str, state: State) -> Iterator[Changes]:
        """A time is over, while the token waits for a completion that has not come."""
        place = self.timers[timer]
        unsent = f"unsent {place.name}"
        waits = state[f"token of {place.name}"] and not self.shown(str(place.completion), state)
        if waits and not (unsent in self.things and state[unsent]) and not state[f"signal {timer}"]:
            yield {f"signal {timer}": True}


class _Overlaid(Mapping[str, Value]):
    """A state after some changes."""

    def __init__(self, changes: Changes, state: State) -> None:
        self.changes, self.state = changes, state

    def __getitem__(self, thing: str) -> Value:
        return self.changes[thing] if thing in self.changes else self.state[thing]

    def __iter__(self) -> Iterator[str]:
        return iter(self.state)

    def __len__(self) -> int:
        return len(self.state)
