"""The laws of a loop are those of the simulated cell, and its firings those of the open net."""

from __future__ import annotations

import random
from collections.abc import Iterator
from copy import deepcopy

import pytest
from support.bench_cell import COMMANDS, JUDGED, LEAVING, LEAVING_RAW, bench, free_cell
from support.examples import seeds
from support.table_cell import free_tables, tables

from firable.executor.cell.events import Busy, FinishDue
from firable.executor.cell.plant import Plant, PlantFault, PlantReport
from firable.nets.machines.closing import close
from firable.nets.machines.laws import Laws
from firable.nets.machines.loop import ACCIDENT, OVERRUN
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net, SignalKind
from firable.semantics.player import Player


class AlwaysInTime(random.Random):
    """What a machine breaks off it is always so near the end of that it may still do it."""

    def random(self) -> float:
        return 0.0


class Told(Plant):
    """A plant whose cameras find workpieces what they are told to, and when."""

    def _find(self, station: str) -> None:
        """Nothing yet."""


class Twin:
    """A loop and a simulated plant that are led through the same events."""

    def __init__(self, net: Net, model: PlantModel) -> None:
        self.net, self.loop = net, close(net, model)
        self.player, self.marking = Player(self.loop.net), self.loop.net.initial_marking
        self.own = {variant: name for name, some in self.loop.variants.items() for variant in some}
        self.plant = Told(model, workpieces=10_000)
        self.plant.random = AlwaysInTime()
        self.judged = sorted(Laws(model, net).judged)
        named = [signal.name for signal in net.signals]
        self.late = [name for name in named if f"plant.{name}.news" in self.loop.net.place_index]
        self.untold = dict.fromkeys(self.exact, 0)
        """How often each sensor has changed since what its controller knows."""

    @property
    def exact(self) -> list[str]:
        """The sensors that show what is there, and form no completion, which is set when its sensor agrees."""
        return [
            name
            for name, sensor in self.plant.model.sensors.items()
            if self.net.signal(name).kind is not SignalKind.COMPLETION and not (sensor.may_flicker or sensor.may_linger)
        ]

    def sees(self) -> dict[str, bool]:
        return {name: self.plant._sees(name, self.plant.model.sensors[name]) for name in self.exact}

    def holds(self, place: str) -> bool:
        return bool(self.marking >> self.loop.net.place_index[place] & 1)

    def fire(self, t: int) -> None:
        name, seen = self.loop.net.transitions[t].name, self.sees()
        self.marking = self.player.fire(self.marking, [t])
        reports = self.simulate(name)
        for signal, value in self.sees().items():
            self.untold[signal] += value != seen[signal]
            self.untold[signal] -= name in {f"{signal}/told/rose", f"{signal}/told/fell"}
        faults = [report for report in reports if isinstance(report, PlantFault)]
        assert bool(faults) == (name in self.loop.accidents), (name, reports)
        assert bool(faults) == (self.holds(ACCIDENT) or self.holds(OVERRUN))
        if not faults:
            self.compare()

    def simulate(self, name: str) -> list[PlantReport]:
        if name in self.own:
            reports: list[PlantReport] = []
            for entered in self.net.transition(self.own[name]).outputs:
                if (command := self.net.place(entered).command) is not None:
                    self.plant.now_seconds += 1
                    parameters = dict(command.parameters)
                    ticket = self.net.place_index[entered]
                    reports += self.plant.command(
                        self.plant.now_seconds, command.machine, command.command, parameters, ticket
                    )
            return reports
        what, _, of = name.partition("/")
        if what == "arrives":
            self.plant.arrival_due = True
            self.plant._arrive()
            return []
        if what == "leaves":
            return self.plant._lawful(self.departing(of.partition("/")[0]))
        if of.startswith("judged/"):
            self.plant.found_good[what] = of == "judged/passes"
            return []
        if of.partition("/")[0] in {"shown", "told", "started", "clears", "drops", "returns"}:
            return []
        machine = self.plant.machines[what]
        busy = machine.breaks_off if of.startswith("still-") else machine.busy
        assert isinstance(busy, Busy)
        return self.plant._lawful(self.plant._happen(FinishDue(what, busy)))

    def departing(self, station: str) -> Iterator[PlantReport]:
        leaving = self.plant.stations[station]
        assert leaving is not None
        self.plant._depart(station, leaving.id)
        yield from ()

    def compare(self) -> None:
        self.compare_places()
        firable = [self.loop.net.transitions[t].name for t in self.player.firable(self.marking)]
        for name, machine in self.plant.machines.items():
            ends = any(move.startswith((f"{name}/done/", f"{name}/accident/")) for move in firable)
            if machine.busy is None or self.is_kept(name, machine.busy):
                assert not ends
                continue
            later = deepcopy(self.plant)
            busy = later.machines[name].busy
            assert busy is not None
            later._lawful(later._happen(FinishDue(name, busy)))
            waits = later.machines[name].busy
            assert ends == (waits is None or not waits.waits), f"{name} at {busy.command}"

    def is_kept(self, name: str, busy: Busy) -> bool:
        """Whether a machine gets done later, because a controller is still to be told something: of before it was given
        its command, or of what it has broken off, where somebody waits until it is at rest."""
        starting = f"plant.{name}.starting"
        if starting in self.loop.net.place_index and self.holds(starting):
            return True
        shown = {"c.entry", "c.fresh", "c.ok", "c.nok"} & {*self.late}
        at_rest = self.net.places[busy.ticket].completion == "c.at_rest"
        return at_rest and any(self.holds(f"plant.{signal}.news") for signal in shown)

    def compare_places(self) -> None:
        for station, workpiece in self.plant.stations.items():
            assert self.holds(f"plant.{station}.empty") == (workpiece is None)
            if workpiece is not None:
                assert self.holds(f"plant.{station}.{'machined' if workpiece.processed else 'raw'}")
        for name, machine in self.plant.machines.items():
            assert self.holds(f"plant.{name}.idle") == (machine.busy is None), name
            if machine.busy is not None:
                entered = self.net.places[machine.busy.ticket].name
                assert self.holds(self.loop.at[entered])
            broken_off = self.net.places[machine.breaks_off.ticket].name if machine.breaks_off is not None else ""
            for place in self.net.places:
                fact = f"plant.{name}.breaks_off.{place.name}"
                # The simulated cell remembers what it broke off also when that is done after all.
                assert fact not in self.loop.net.place_index or not self.holds(fact) or place.name == broken_off
            if machine.position is not None:
                assert self.holds(f"plant.{name}.hand_at.{machine.position}")
        for station in self.judged:
            found = self.plant.found_good.get(station)
            shown = {good: self.holds(f"plant.{station}.{word}") for good, word in ((True, "passes"), (False, "fails"))}
            assert shown == {True: found is True, False: found is False}
        for name, value in self.sees().items():
            shows, means = self.loop.shown[name]
            if name not in self.late or not self.holds(f"plant.{name}.news"):
                self.untold[name] = 0
            else:  # what has changed twice since is as its controller knows it, and news all the same
                assert self.untold[name] > 0, name
            knows = self.holds(shows) == means
            assert (knows == value) == (self.untold[name] % 2 == 0), (name, self.untold[name])
        for station in ("table",):
            assert self.holds(f"plant.{station}.clamped") == (station in self.plant.clamped)


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(20))
@pytest.mark.parametrize("judged", ["", JUDGED], ids=["", "judged"])
@pytest.mark.parametrize("leaving", [LEAVING, LEAVING_RAW], ids=["", "two ways out"])
def test_the_loop_and_the_simulated_cell_obey_the_same_laws(seed: int, judged: str, leaving: str) -> None:
    draw = random.Random(seed)
    twin = Twin(free_cell(judged=bool(judged)), bench(judged=judged, leaving=leaving))
    for _ in range(60):
        choices = twin.player.firable(twin.marking)
        # Accidents end a walk, so they are left for the end, where one is seen to happen in both.
        calm = [t for t in choices if twin.loop.net.transitions[t].name not in twin.loop.accidents]
        wild = [t for t in choices if t not in calm]
        if not calm or (wild and draw.random() < 0.08):
            break
        twin.fire(draw.choice(calm))
    wild = [t for t in twin.player.firable(twin.marking) if twin.loop.net.transitions[t].name in twin.loop.accidents]
    for t in wild[:1]:
        twin.fire(t)


class TableTwin(Twin):
    """A twin of machines that index: the simulated one takes all as it is sent the command, and lays all in the end."""

    @property
    def exact(self) -> list[str]:
        """None: what sensors see in the midst of an index comes at other moments."""
        return []

    def simulate(self, name: str) -> list[PlantReport]:
        return [] if {"takes", "lays"} & {name.split("/")[1] if "/" in name else ""} else super().simulate(name)

    def is_laying(self, name: str) -> bool:
        """Whether this goes on where a machine has begun to lay something down, or has laid all."""
        machine, _, of = name.partition("/")
        steps = {"T": ("BACK.lays.drill", "INDEX.lays.load"), "W": ("STEP.lays.unload",)}.get(machine, ())
        begins = any(self.holds(f"plant.{machine}.{step}") for step in steps)
        return bool(steps) and not begins and of.startswith(("lays/", "done/", "accident/"))

    def compare(self) -> None:
        if not any(machine.indexes for machine in self.plant.machines.values()):
            super().compare()

    def compare_places(self) -> None:
        for station, workpiece in self.plant.stations.items():
            kind = "empty" if workpiece is None else "machined" if workpiece.processed else "raw"
            assert self.holds(f"plant.{station}.{kind}"), station
        for name, machine in self.plant.machines.items():
            assert self.holds(f"plant.{name}.idle") == (machine.busy is None), name
        assert self.holds("plant.drill.clamped") == ("drill" in self.plant.clamped)


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(30))
def test_a_table_in_the_loop_and_a_simulated_one_obey_the_same_laws(seed: int) -> None:
    draw = random.Random(seed)
    twin = TableTwin(free_tables(), tables()[1])
    for _ in range(120):
        names = {t: twin.loop.net.transitions[t].name for t in twin.player.firable(twin.marking)}
        wild = [t for t in names if names[t] in twin.loop.accidents]
        calm = [t for t in names if t not in wild]
        # Of what happens in one instant in the simulated cell nothing else comes in between.
        at_once = [t for t in names if "/takes/" in names[t]] or [t for t in names if twin.is_laying(names[t])]
        if not at_once and (not calm or (wild and draw.random() < 0.02)):
            break
        t = draw.choice(at_once or calm)
        twin.fire(t)
        if t in wild:
            return
    wild = [t for t in twin.player.firable(twin.marking) if twin.loop.net.transitions[t].name in twin.loop.accidents]
    if wild:
        twin.fire(draw.choice(wild))


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(25))
def test_a_variant_is_firable_iff_its_transition_is_and_its_gates_are_open(seed: int) -> None:
    draw = random.Random(seed)
    chosen = tuple(draw.sample(list(COMMANDS), 6))
    judged = draw.choice(["", JUDGED])
    net = free_cell(chosen, judged=bool(judged))
    loop = close(net, bench(draw.choice(["", ", may_flicker: true", ", may_linger: true"]), judged))
    player, open_player = Player(loop.net), Player(net)
    marking, mask = loop.net.initial_marking, (1 << len(net.places)) - 1

    def shows(signal: str) -> bool:
        place, means = loop.shown[signal]
        return bool(marking >> loop.net.place_index[place] & 1) == means

    for _ in range(40):
        firable = {loop.net.transitions[t].name for t in player.firable(marking)}
        ended = marking & loop.net.marking([ACCIDENT, OVERRUN])
        for t, transition in enumerate(net.transitions):
            is_open = all(shows(gate.signal) == gate.wanted for gate in transition.external)
            expected = is_open and t in open_player.firable(marking & mask) and not ended
            possible = [name for name in loop.variants[transition.name] if name in firable]
            assert len(possible) == int(expected), (transition.name, possible)
        if not firable:
            break
        t = draw.choice(player.firable(marking))
        after = player.fire(marking, [t])
        own = next((name for name, some in loop.variants.items() if loop.net.transitions[t].name in some), None)
        projected = marking & mask
        if own is not None:
            projected = open_player.fire(projected, [net.transition_index[own]])
        assert after & mask == projected, "a run of the loop is one of the open net"
        marking = after
