"""Closing the loop: a cell's net and its machines as one extended net without external gates.

With gates free, a verdict says what the cell does if every gate opens at some time; a real cell may never open one.
Here the machines of the plant file become places and transitions beside those of the cell, each signal becomes a place,
and each external gate an internal gate on it. The result is a `Net` like any other, so every technique of `check`
decides it, and its firing rule is the one there is.

- *A command is sent* in the firing by which its place is entered: the same firing clears its completion bit and tells
  the machine (SEMANTICS, "Output signal", "Completion gates"). What it does depends on the plant (the bit was 0 or 1, a
  stopped machine was idle or busy), and a firing is one transition, so a transition of the cell becomes several
  *variants*, of which at most one is firable. `variants` maps each back to the cell's own transition.
- *A machine moves*: a command is done, a workpiece comes or goes, a sensor that is not exact drops, somebody presses a
  key or sets a signal from outside. A time limit may be over at any moment while its place holds the token and the
  completion has not come; so the fault transition asks for no more, and its timer is a place only where something else
  reads it.
- *An accident* ends the run: the executor stops every machine where it is. Nothing fires afterwards.

A variant has exactly the arcs and internal gates of its transition among the places of the cell, and a move of a
machine has none there, but that a time passes where there is a token. So each run of the loop, without the moves, is a
run of the open net: what never happens with gates free never happens here. The converse fails, which is the point. An
arbiter is left out, as from every verdict on what can happen.

A sensor that is exact is no place of its own: it is true iff its station is not empty, or has a workpiece that was
found good, or one that was not; but one that is told late is (`telling.py`). One that may flicker or linger is a bit. A
failure is a place for each machine: while it is marked nothing that the machine is at gets done.

Rejected: a place for each command on its way to the machine, which the machine then takes. That needs no variants, but
a second command could overtake the first, which no driver allows, and markings show commands that are neither sent nor
begun.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from types import MappingProxyType
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.machines.fitting import misfits
from firable.nets.machines.laws import Laws, fact
from firable.nets.machines.loop import ACCIDENT, OVERRUN, PLANT, UNSENT, ClosedLoop, Faults, Sending
from firable.nets.machines.moment import NOTHING, Case, Literal, Moment, each
from firable.nets.machines.plant_file import Failure, Index, PlantModel, Stop
from firable.nets.machines.telling import Telling
from firable.nets.net import Controller, Net, Place, SignalKind, Transition
from firable.nets.well_formed import as_name
from firable.nets.yaml_tree import Path

VARIANTS_MAX: Final = 4096
"""How many variants one transition may have before it is asked what controllers are told of it; it doubles with each
completion that it clears."""
TOLD_MAX: Final = 2**15
"""How many with all that: where it clears completions of which there is news, each may triple them."""


def close(net: Net, model: PlantModel, faults: Faults = Faults.NONE, sending: Sending = Sending.AT_ONCE) -> ClosedLoop:
    """The loop of a net with the machines of a plant.

    Raises `InputError`: F5003 where the plant does not fit the net, F3007 where one firing sends more than the loop can
    tell apart, F2001 where a name would be that of two things.

    >>> from firable.nets.catalogue import catalogue_net, catalogue_plant
    >>> loop = close(catalogue_net("one_robot"), catalogue_plant("one_robot"))
    >>> loop.variants["t1-a"][:2], loop.net.transition("t1-a").permissive, len(loop.net.signals)
    (('t1-a', 't1-a/clears-robot.touch'), ('robot.at_cv1', 'plant.R.hand_at.CV1', 'plant.R.holds_nothing'), 0)
    """
    if problems := misfits(model, net):
        raise InputError(problems)
    return _Closing(net, model, faults, sending).loop()


class _Closing:
    """One net and one plant on their way to a loop."""

    def __init__(self, net: Net, model: PlantModel, faults: Faults, sending: Sending) -> None:
        self.net, self.model, self.laws = net, model, Laws(model, net)
        late = self.laws.commanding if sending is Sending.LATE else ()
        self.unsent = {place.name: f"{UNSENT}.{place.name}" for place in late}
        self.accidents: dict[str, str] = {}
        completions = [signal.name for signal in net.signals if signal.kind is SignalKind.COMPLETION]
        self.sharing = {name: sum(place.completion == name for place in net.places) > 1 for name in completions}
        self.inexact = [name for name, sensor in model.sensors.items() if sensor.may_flicker or sensor.may_linger]
        self.timers = self.timers_read()
        self.by_hand = [name for name, sensor in model.sensors.items() if sensor.by_hand]
        self.acknowledged = {name: f"{PLANT}.{name}.acknowledged" for name in completions if name in model.sensors}
        truth = {
            signal.name: (signal.name, True) if signal.name in self.sharing else self.sensor(signal.name)
            for signal in net.signals
            if signal.kind is not SignalKind.TIMER
        }
        self.telling = Telling(self.laws, truth)
        self.shown = {
            **{name: self.telling.shown(name) for name in truth},
            **{timer: (timer, True) for timer in self.timers},
        }
        self.failing = self.may_fail(faults)
        self.repaired = faults is Faults.REPAIRED
        may_fail = [name for name in model.machines if name in self.failing.values()]
        self.failed = {name: f"{PLANT}.{as_name(name)}.failed" for name in may_fail}

    def alike(
        self, places: Iterable[Place], variants: Mapping[str, Iterable[Transition]], moves: Iterable[Transition]
    ) -> Iterator[Diagnostic]:
        """Names that two things of the loop would have, each where a part of it stands that somebody wrote.

        They are put together of names by dots, hyphens and slashes, which may stand in each of these: so the longest
        one that somebody wrote is what reaches over a joint.
        """
        signals = {signal: place.name for place in self.net.places for signal in place.cleared}
        kinds = {kind.value: f"this {kind} of the net" for kind in SignalKind}  # the descriptions of their places
        made = (
            *((place.name, "this place of the net") for place in self.net.places),
            *((place.name, kinds.get(place.description, place.description)) for place in places),
            *((one.name, f"a firing of '{name}'") for name, some in variants.items() for one in some),
            *((move.name, move.description) for move in moves),
        )
        written: dict[str, Path] = {
            **{name: ("places", place) for name, place in signals.items()},
            **{name: ("places", name) for name in self.net.place_index},
            **{name: ("transitions", name) for name in self.net.transition_index},
            **{name: ("sensors", name) for name in self.model.sensors},
            **{name: ("stations", i) for i, name in enumerate(self.model.stations)},
            **{name: ("machines", name) for name in self.model.machines},
        }
        if any(controller.name == PLANT for controller in self.net.controllers):
            message = f"'{PLANT}' would name two controllers of the cell with its machines: this one, and who has these"
            yield Diagnostic("F2001", message, f"rename '{PLANT}'", ("controllers", PLANT))
        first: dict[str, str] = {}
        for name, told in made:
            if name not in first:
                first[name] = told
                continue
            cause = max((one for one in written if one in name or as_name(one) in name), key=len, default="")
            path = written.get(cause, ())
            renamed = f"'{cause}'" if cause else "one of them"
            span = None if path[:1] in {("places",), ("transitions",)} else self.model.span(path)
            message = f"'{name}' would name two things of the cell with its machines: {first[name]}; and {told}"
            hint = f"rename {renamed}: the names there are put together of those of the net and of the plant"
            yield Diagnostic("F2001", message, hint, tuple(map(str, path)), span)

    def timers_read(self) -> dict[str, Place]:
        """The timers that some other transition reads than the fault transition, with their places."""
        faults = {(p, t) for p, t in self.net.fault_transitions.items()}
        found = {}
        for p, place in enumerate(self.net.places):
            if place.within is None:
                continue
            for t, transition in enumerate(self.net.transitions):
                if (p, t) not in faults and any(gate.signal == place.within.timer for gate in transition.external):
                    found[place.within.timer] = place
        return found

    def may_fail(self, faults: Faults) -> dict[str, str]:
        """The places whose command may fail, each with its machine."""
        found = {}
        for place in self.laws.commanding:
            name, action = self.laws.machine(place)[0], self.laws.action(place)
            failure = None if isinstance(action, Stop) else action.may_fail
            if failure is not None and (
                faults is Faults.FOR_GOOD or (faults is Faults.REPAIRED and failure is Failure.REPAIRABLE)
            ):
                found[place.name] = name
        return found

    def loop(self) -> ClosedLoop:
        variants = {transition.name: tuple(self.of_cell(transition)) for transition in self.net.transitions}
        for transition in self.net.transitions:
            _assert_projects(self.net, transition, variants[transition.name])
        moves, times, places = tuple(self.moves()), tuple(self.times()), tuple(self.places())
        alike = tuple(self.alike(places, variants, (*moves, *times)))
        told = {problem.subject for problem in alike}
        taken = (problem for problem in _taken(self.net, (*moves, *times)) if problem.subject not in told)
        if problems := (*alike, *taken):
            raise InputError(problems)
        _assert_apart(self.net, moves, times)
        moves += times
        net = Net(
            self.net.name,
            (*(replace(place, completion=None, within=None) for place in self.net.places), *places),
            (*chain.from_iterable(variants.values()), *moves),
            controllers=(*self.net.controllers, Controller(PLANT, description="Machines and workpieces")),
            description=f"{self.net.description} (with its machines)",
        )
        return ClosedLoop(
            self.net,
            net,
            MappingProxyType({name: tuple(one.name for one in some) for name, some in variants.items()}),
            MappingProxyType(self.accidents),
            MappingProxyType(self.shown),
            MappingProxyType(
                {place.name: self.laws.busy(place) for place in self.laws.commanding if self.laws.lasts(place)}
            ),
            MappingProxyType(self.failed),
            MappingProxyType(self.acknowledged),
            MappingProxyType(self.unsent),
            MappingProxyType(self.telling.news),
        )

    def places(self) -> Iterator[Place]:
        """The signals, and the places of the plant."""
        for signal in self.net.signals:
            if signal.kind is SignalKind.COMPLETION:
                yield Place(signal.name, signal.owner, description="completion")
            elif signal.name in self.timers:
                yield Place(signal.name, signal.owner, description="timer")
        for name in (*self.inexact, *self.by_hand):
            yield self.bit(name)
        for name in self.by_hand:
            yield fact(self.let_go(name), f"{name} is not {self.hand_words(name)[0]}", marked=True)
        for name, acknowledged in self.acknowledged.items():
            yield fact(acknowledged, f"the command of {name} is acknowledged, and its sensor does not show it yet")
        for name, unsent in self.unsent.items():
            yield fact(unsent, f"{self.net.place(name).command} is still to be sent")
        yield from self.telling.places()
        yield from self.laws.places()
        for name, failed in self.failed.items():
            yield fact(failed, f"{name} has failed")

    def let_go(self, signal: str) -> str:
        """The place that holds a token iff a key is not pressed, or a signal is not set from outside."""
        return f"{PLANT}.{signal}.{self.hand_words(signal)[1]}"

    def hand_words(self, signal: str) -> tuple[str, str]:
        """What somebody does with a key, or with a signal that is set from outside, and how it is undone."""
        return ("pressed", "released") if self.model.sensors[signal].set_by is None else ("set", "reset")

    def bit(self, sensor: str) -> Place:
        """The place of a sensor that is not exact, under the name of its signal where that is no completion."""
        if sensor in self.acknowledged:
            return fact(f"{PLANT}.{sensor}.sensor", f"the sensor of {sensor}", marked=self.laws.sees_at_first(sensor))
        marked = self.laws.sees_at_first(sensor)
        return Place(sensor, self.net.signal(sensor).owner, marked, description="sensor")

    def sensor(self, name: str) -> Literal:
        """The place that shows a sensor, and whether a token means 1."""
        if name in self.inexact or name in self.by_hand:
            return self.bit(name).name, True
        if (sensor := self.model.sensors.get(name)) is not None and sensor.judges is not None:
            return self.laws.verdict(sensor.judges, good=sensor.passes is not None), True
        return (self.reality(name), False) if name in self.model.sensors else (name, True)

    def reality(self, sensor: str) -> str:
        """The place that holds a token iff there is nothing for the sensor to see."""
        sees = self.model.sensors[sensor]
        return self.laws.empty(str(sees.occupied or sees.holding))

    # --- The cell

    def of_cell(self, transition: Transition) -> Iterator[Transition]:
        """The variants of a transition of the cell."""
        gates = [(self.shown[gate.signal], gate.wanted) for gate in transition.external if gate.signal in self.shown]
        own = Case(
            (
                (ACCIDENT, False),
                (OVERRUN, False),
                *((name, True) for name in transition.inputs),
                *((name, False) for name in transition.outputs),
                *((name, True) for name in transition.permissive),
                *((name, False) for name in transition.inhibitive),
                *((place, means == wanted) for (place, means), wanted in gates),
            ),
            (*((name, False) for name in transition.inputs), *((name, True) for name in transition.outputs)),
        )
        moments, ended = each(each([NOTHING], [own]), [self.applied(transition)]), list[Moment]()
        commanded, taken = set[str](), list[Place]()
        # In the order of the net, as the executor sends what one firing commands.
        for name in sorted(transition.outputs, key=self.net.place_index.__getitem__):
            place = self.net.place(name)
            if place.command is None or name in self.unsent:
                continue
            moments = each(each(moments, self.cleared(place)), self.timed_anew(place))
            ended += each(moments, self.laws.refused(place, again=place.command.machine in commanded))
            moments = each(moments, self.laws.sent(place))
            commanded.add(place.command.machine)
            taken.append(place)
            if len(moments) + len(ended) > VARIANTS_MAX:
                raise _too_many(transition, VARIANTS_MAX)
        told = tuple(islice(self.told(moments, taken), TOLD_MAX + 1))
        if len(told) + len(ended) > TOLD_MAX:
            raise _too_many(transition, TOLD_MAX)
        for moment in told:
            yield moment.transition(moment.name(transition.name), _told(transition, moment))
        for moment in ended:
            yield self.accident(moment.name(transition.name), _told(transition, moment), moment)

    def applied(self, transition: Transition) -> Case:
        """With commands that are sent late, what is taken or read was applied before, and what is put will be."""
        read = [self.unsent[name] for name in (*transition.inputs, *transition.permissive) if name in self.unsent]
        put = [self.unsent[name] for name in transition.outputs if name in self.unsent]
        return Case(tuple((name, False) for name in (*read, *put)), tuple((name, True) for name in put))

    def cleared(self, place: Place) -> Iterator[Case]:
        """Sending a command clears the completion that it will set."""
        signal = place.completion
        if signal is None:
            yield Case()
            return
        waiting = self.acknowledged.get(signal)
        idle = () if waiting is None else ((waiting, False),)
        yield Case(((signal, False), *idle))
        yield Case(((signal, True), *idle), ((signal, False),), f"clears-{signal}", f"clears {signal}")
        if waiting is not None:
            yield Case(
                ((signal, False), (waiting, True)), ((waiting, False),), f"forgets-{signal}", f"forgets {signal}"
            )

    def timed_anew(self, place: Place) -> Iterator[Case]:
        """Sending a command starts its time."""
        if place.within is None or place.within.timer not in self.timers:
            yield Case()
            return
        timer = place.within.timer
        yield Case(((timer, False),))
        yield Case(((timer, True),), ((timer, False),), f"clears-{timer}", f"clears {timer}")

    def accident(self, name: str, description: str, moment: Moment) -> Transition:
        self.accidents[name] = moment.says[-1]
        return moment.transition(name, description)

    # --- The machines

    def moves(self) -> Iterator[Transition]:
        """What machines, workpieces and sensors do by themselves."""
        calm = each([NOTHING], [Case(((ACCIDENT, False), (OVERRUN, False)))])
        for place in self.laws.commanding:
            if not self.laws.lasts(place):
                continue
            name, _ = self.laws.machine(place)
            busy, idle = self.laws.busy(place), self.laws.idle(name)
            # A machine that has failed at a command still obeys a stop.
            may_hang = name in self.failed and not isinstance(self.laws.action(place), Stop)
            working = ((busy, True), (idle, False), *(((self.failed[name], False),) if may_hang else ()))
            goes_on = Case(working).with_(self.telling.may_end(place))
            ends = replace(goes_on, leaves=((busy, False), (idle, True)))
            at_work = each(calm, [ends])
            words = self.words(place)
            if isinstance(action := self.laws.action(place), Index):
                for step, says, ways in self.laws.indexes(place, action):
                    moved = chain.from_iterable(map(self.seen, each(each(calm, [goes_on]), ways)))
                    yield from self.named(step, says, moved, [place])
            done = each(at_work, self.laws.done(place))
            done = [
                one for moment in done for seen in self.seen(moment) for one in each([seen], self.formed(place, seen))
            ]
            yield from self.named(f"{as_name(name)}/done/{place.name}", f"{words} is done", done, [place])
            yield from self.ended(f"{as_name(name)}/accident/{place.name}", each(at_work, self.laws.spoiled(place)))
            if place.name in self.failing:
                others = tuple((failed, False) for other, failed in self.failed.items() if other != name)
                failed = self.failed[name]
                fails = Case((*working, *others), ((failed, True),))
                yield from self.named(f"{as_name(name)}/fails/{place.name}", f"{words} fails", each(calm, [fails]))
        for name, places in self.laws.may_break_off.items():
            for place in places:
                yield from self.still_moves(name, place, calm)
        for name, failed in self.failed.items() if self.repaired else ():
            repair = Case(((failed, True),), ((failed, False),))
            yield from self.named(f"{as_name(name)}/repaired", f"{name} is repaired and goes on", each(calm, [repair]))
        for signal, waiting in self.acknowledged.items():
            shows = Case(((waiting, True), (signal, False), self.sensor(signal)), ((waiting, False), (signal, True)))
            yield from self.named(f"{signal}/shown", f"the sensor of {signal} shows it", each(calm, [shows]))
        yield from self.sent_late(calm)
        for name, words, ways in self.telling.moves():
            yield from self.named(name, words, each(calm, ways))
        yield from self.workpieces(calm)
        yield from self.unsteady(calm)

    def still_moves(self, name: str, place: Place, calm: list[Moment]) -> Iterator[Transition]:
        """What a machine breaks off may be done or end in its accident until it is at rest, unless it has failed."""
        works = Case(((self.failed[name], False),) if name in self.failed else ())
        still = each(each(calm, [works]), [self.laws.no_longer_broken_off(place)])
        done = chain.from_iterable(map(self.seen, each(still, self.laws.done(place))))
        words = f"{self.words(place)} is still done, before {name} has come to rest"
        yield from self.named(f"{as_name(name)}/still-done/{place.name}", words, done)
        yield from self.ended(f"{as_name(name)}/still-accident/{place.name}", each(still, self.laws.spoiled(place)))

    def sent_late(self, calm: list[Moment]) -> Iterator[Transition]:
        for name, unsent in self.unsent.items():
            place = self.net.place(name)
            sending = each(calm, [Case(((unsent, True),), ((unsent, False),))])
            cleared = each(each(sending, self.cleared(place)), self.timed_anew(place))
            sent = self.told(each(cleared, self.laws.sent(place)), [place])
            yield from _named(f"sent/{name}", f"{self.words(place)} is sent", sent)
            yield from self.ended(f"sent/{name}", each(cleared, self.laws.refused(place)))

    def workpieces(self, calm: list[Moment]) -> Iterator[Transition]:
        entry = self.model.arrivals.station
        arrived = chain.from_iterable(map(self.seen, each(calm, [self.laws.arrives()])))
        yield from self.named(f"arrives/{as_name(entry)}", f"a workpiece comes to {entry}", arrived)
        for departure in self.model.departures:
            exit_ = departure.station
            gone = chain.from_iterable(map(self.seen, each(calm, self.laws.departs(departure))))
            yield from self.named(f"leaves/{as_name(exit_)}", f"the workpiece on {exit_} is taken away", gone)
            yield from self.ended(f"leaves/{as_name(exit_)}", each(calm, self.laws.departs_raw(departure)))
        for station in self.model.stations:
            there = each(calm, [self.telling.is_seen(station)]) if station in self.laws.judged else []
            judged = each(there, self.laws.judges(station))
            yield from self.named(f"{as_name(station)}/judged", f"the workpiece on {station} is judged", judged)

    def unsteady(self, calm: list[Moment]) -> Iterator[Transition]:
        """What a sensor that is not exact does by itself, a key, and what is set from outside.

        None of them waits until controllers are told of anything else; what changes twice is told twice.
        """
        for name in self.inexact:
            told = [self.telling.is_told(name)] if name not in self.acknowledged else [Case()]
            quiet = each(calm, told)
            sensor, bit, empty = self.model.sensors[name], self.bit(name).name, self.reality(name)
            ways = []
            if sensor.may_flicker:
                ways.append(("drops", False, "drops, though the workpiece is there"))
                ways.append(("returns", True, "shows the workpiece again"))
            for word, value, says in ways:
                case = Case(((empty, False), (bit, not value)), ((bit, value),))
                yield from self.named(f"{name}/{word}", f"the sensor of {name} {says}", each(quiet, [case]))
            if sensor.may_linger:
                case = Case(((empty, True), (bit, True)), ((bit, False),))
                words = f"the sensor of {name} sees that the workpiece has gone"
                yield from self.named(f"{name}/clears", words, each(quiet, [case]))

        for name in self.by_hand:
            sensor, (done, undone) = self.model.sensors[name], self.hand_words(name)
            on = Case(((name, False), (self.let_go(name), True)), ((name, True), (self.let_go(name), False)))
            by = f" by {sensor.set_by}" if sensor.set_by is not None else ""
            off = Case(on.leaves, on.wants)
            if sensor.acknowledges is not None:
                # The next command to the machine releases it: so it holds until what waits for it has fired (O4).
                off = replace(off, wants=((self.laws.idle(sensor.acknowledges), False), *off.wants))
            quiet = each(calm, [self.telling.is_told(name)])
            yield from self.named(f"{name}/{done}", f"{name} is {done}{by}", each(quiet, [on]))
            yield from self.named(f"{name}/{undone}", f"{name} is {undone}{by}", each(quiet, [off]))

    def times(self) -> Iterator[Transition]:
        """Any time can be over while a token waits for a completion that has not come: nothing is known of times."""
        for timer, place in self.timers.items():
            completion, means = self.shown[str(place.completion)]
            waits = ((place.name, True), (completion, not means), (ACCIDENT, False), (OVERRUN, False))
            sent = ((self.unsent[place.name], False),) if place.name in self.unsent else ()
            over = Case((*waits, *sent, (timer, False)), ((timer, True),))
            words = f"the time of {place.name} is over, and {place.completion} has not come"
            yield from self.named(f"{timer}/over", words, each([NOTHING], [over]))

    def told(self, moments: Iterable[Moment], taken: Sequence[Place]) -> Iterator[Moment]:
        """Firings in which machines take the commands of some places, with what sensors see of it and controllers are
        told."""
        for moment in chain.from_iterable(map(self.seen, moments)):
            for told in self.telling.of(moment, taken):
                yield from self.telling.sent(told, taken)

    def named(
        self, name: str, description: str, moments: Iterable[Moment], done: Sequence[Place] = ()
    ) -> Iterator[Transition]:
        told = (one for moment in moments for one in self.telling.of(moment, done))
        yield from _named(name, description, told)

    def ended(self, name: str, moments: Iterable[Moment]) -> Iterator[Transition]:
        for moment in moments:
            yield self.accident(moment.name(name), moment.says[-1], moment)

    def words(self, place: Place) -> str:
        return str(place.command)

    def formed(self, place: Place, moment: Moment) -> Iterator[Case]:
        """Its completion is set when a command is done, if the sensor of that name agrees, where there is one."""
        signal = place.completion
        if signal is None:
            yield Case()
            return
        waiting = self.acknowledged.get(signal)
        if waiting is None:
            yield Case(((signal, False),), ((signal, True),))
        else:
            bit, means = self.sensor(signal)
            calm = ((waiting, False), (signal, False))
            known = moment.after.get(bit)
            if known in (None, means):
                yield Case((*calm, (bit, means)), ((signal, True),))
            if known in (None, not means):
                yield Case((*calm, (bit, not means)), ((waiting, True),), "unseen", "and its sensor does not show it")
            if self.sharing[signal]:
                yield Case(((waiting, True), (signal, False)), (), "twice")
        if self.sharing[signal]:
            yield Case(((signal, True),), (), "set-already")

    def seen(self, moment: Moment) -> list[Moment]:
        """A firing with what the sensors that are not exact see of it at once."""
        moments = [moment]
        for name in self.inexact:
            sensor, bit, empty = self.model.sensors[name], self.bit(name).name, self.reality(name)
            before, after = moment.before.get(empty), moment.after.get(empty)
            if before == after:
                continue
            came = not after
            at_once = Case(((bit, not came),), ((bit, came),))
            stays = Case(((bit, came),), (), f"{name}-{'on' if came else 'off'}")
            if came:
                moments = each(moments, [at_once, *([stays] if sensor.may_linger else [])])
            elif not sensor.may_linger:
                moments = each(moments, [at_once, *([stays] if sensor.may_flicker else [])])
            elif name in self.acknowledged:  # it may linger, and need not: the completion is formed from what it shows
                moments = each(moments, [Case(), replace(at_once, tag=f"{name}-clears")])
        return moments


def _named(name: str, description: str, moments: Iterable[Moment]) -> Iterator[Transition]:
    for moment in moments:
        yield moment.transition(moment.name(name), ", ".join((description, *moment.says)))


def _told(transition: Transition, moment: Moment) -> str:
    more = "; ".join(moment.says)
    return f"{transition.description}: {more}" if transition.description and more else transition.description or more


def _too_many(transition: Transition, most: int) -> InputError:
    message = f"'{transition.name}' sends commands with more than {most:,} outcomes in one firing"
    hint = "send them one after the other, in transitions of their own"
    return InputError([Diagnostic("F3007", message, hint, ("transitions", transition.name, "to"))])


def _taken(net: Net, moves: Iterable[Transition]) -> Iterator[Diagnostic]:
    """Transitions of the net with the name of something that happens at a machine, which words behind a slash end."""
    hint = "rename it: what happens in the plant has names of that form"
    parts = (move.name.split("/") for move in moves)
    begun = {"/".join(some[:length]) for some in parts for length in range(1, len(some) + 1)}
    for name in (t.name for t in net.transitions if "/" in t.name and t.name in begun):
        message = f"'{name}' names one of the transitions, and what happens in the plant"
        yield Diagnostic("F2001", message, hint, ("transitions", name))


def _assert_projects(net: Net, transition: Transition, variants: Iterable[Transition]) -> None:
    """Among the places of the cell a variant is its transition: what safety verdicts carry over by."""
    want, put = set(transition.inputs), set(transition.outputs)
    for variant in variants:
        same = {name for name in variant.inputs if name in net.place_index} == want
        same &= {name for name in variant.outputs if name in net.place_index} == put
        same &= set(transition.permissive) <= {*variant.permissive, *variant.inputs}
        same &= set(transition.inhibitive) <= {*variant.inhibitive, *variant.outputs}
        if not same:
            raise RuntimeError(f"the variant '{variant.name}' does not do what '{transition.name}' does")


def _assert_apart(net: Net, moves: Iterable[Transition], times: Iterable[Transition]) -> None:
    for move in moves:
        if not {*move.inputs, *move.outputs, *move.permissive, *move.inhibitive}.isdisjoint(net.place_index):
            raise RuntimeError(f"the machines' '{move.name}' touches a place of the cell")
    for time in times:
        if not {*time.inputs, *time.outputs}.isdisjoint(net.place_index):
            raise RuntimeError(f"'{time.name}' moves a token of the cell")
