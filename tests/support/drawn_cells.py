"""Small cells drawn by a seed: machines, the net that commands them, and much that looks at what they do.

A robot or two, or belts, go through their cycles between stations; a tool may clamp and machine at one of them. Sensors
see stations and hands, judge workpieces and wait for a key, and gates anywhere in the net read them, also where their
controller has nothing to do with the machine. Watchers go to and fro by what several sensors show. Some commands are
broken off by a stop or a time limit, some completions are shared or are what a sensor shows, and some transitions of
two controllers are one. The nets are to do odd things: most of them run into an accident or stand still before long.

All times are drawn, with many digits, so that nothing comes in one instant but what is of one cause.
"""

from __future__ import annotations

import random
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, Final

import yaml

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net

Document = dict[str, Any]

STOPS: Final = ("STOP", "HALT")
ROOMY: Final[tuple[Document, ...]] = ({}, {"when_full": "wait"})
FAILING: Final[tuple[Document, ...]] = ({}, {}, {"may_fail": "repairable"}, {"may_fail": "for_good"})
BLURRED: Final[tuple[Document, ...]] = (
    {},
    {},
    {},
    {"may_linger": True},
    {"may_flicker": True},
    {"may_linger": True, "may_flicker": True},
)
"""What a drawn sensor may do wrong; most see what is there."""


@dataclass(frozen=True)
class DrawnCell:
    """A net file and a plant file, as texts."""

    net_text: str
    plant_text: str

    @property
    def net(self) -> Net:
        """The net."""
        return parse_net(self.net_text)

    @property
    def plant(self) -> PlantModel:
        """Its machines."""
        return parse_plant(self.plant_text)

    def __str__(self) -> str:
        return f"{self.net_text}\n{self.plant_text}"


def drawn_cell(seed: int) -> DrawnCell:
    """The cell of a seed."""
    first, more = random.Random(seed), random.Random(f"more of {seed}")  # a cell stays what it was when it gets more
    drawing = _Drawing(first)
    for i in range(drawing.draw.randint(1, 2)):
        if drawing.draw.random() < 0.5:
            drawing.robot(i)
        else:
            drawing.belt(i)
    if drawing.draw.random() < 0.4:
        drawing.tool()
    for _ in range(drawing.draw.randint(0, 4)):
        drawing.further_sensor()
    for i in range(drawing.draw.randint(0, 3)):
        drawing.watcher(i)
    drawing.further_gates()
    if drawing.draw.random() < 0.35:
        drawing.coordinate()
    drawing.see_completions()
    drawing.draw = more
    if more.random() < 0.2:
        drawing.lamp()
    drawing.draw = first
    plant = drawing.plant()
    drawing.draw = more
    if more.random() < 0.3:
        plant["full_at_first"] = drawing.full_at_first(plant)
    return DrawnCell(_text(drawing.net()), _text(plant))


def drawn_table(seed: int) -> DrawnCell:
    """A cell with a table that moves several workpieces at once, and little else: it gets to that often."""
    draw = random.Random(f"table {seed}")
    drawing = _Drawing(draw)
    drawing.table()
    if draw.random() < 0.4:
        drawing.belt(0)
    if draw.random() < 0.2:
        drawing.tool()
    for i in range(draw.randint(0, 2)):
        drawing.watcher(i)
    if draw.random() < 0.3:
        drawing.lamp()
    plant = drawing.plant()
    plant["full_at_first"] = drawing.full_at_first(plant)
    return DrawnCell(_text(drawing.net()), _text(plant))


def _text(document: Document) -> str:
    # A net file takes no "null": whatever is nothing is left empty.
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120).replace(": null", ": ")


@dataclass
class _Transition:
    name: str
    sources: list[str]
    targets: list[str]
    wanted: list[str] = field(default_factory=list)
    unwanted: list[str] = field(default_factory=list)

    @property
    def touched(self) -> set[str]:
        return {*self.sources, *self.targets}

    @property
    def gates(self) -> set[str]:
        return {*self.wanted, *self.unwanted}

    def document(self) -> Document:
        gates = {"if": self.wanted, "unless": self.unwanted}
        return {"from": self.sources, "to": self.targets, **{word: names for word, names in gates.items() if names}}


class _Drawing:
    """A cell that is being drawn; places and signals bear their full names, those of the file are the local ones."""

    def __init__(self, draw: random.Random) -> None:
        self.draw = draw
        self.controllers = [f"c{i}" for i in range(draw.randint(1, 3))]
        self.stations = [f"s{i}" for i in range(draw.randint(2, 4))]
        self.entry = self.stations[0]
        self.exit = self.entry if draw.random() < 0.2 else self.stations[-1]
        self.shares_completions = draw.random() < 0.25
        self.machines: dict[str, Document] = {}
        self.movers: list[str] = []
        self.stops: dict[str, str] = {}
        """A command of each machine that stops it, where it has one."""
        self.places: dict[str, Document] = {}
        self.marked: list[str] = []
        self.transitions: list[_Transition] = []
        self.completions: list[str] = []
        self.sensors: dict[str, Document] = {}

    def seconds(self, least: float, most: float) -> float:
        return round(self.draw.uniform(least, most), 4)

    # --- Machines and their cycles

    def robot(self, i: int) -> None:
        """A robot that fetches workpieces from one station and lays them down on another one."""
        name, (source, target) = f"R{i}", self.route(i)
        hand = self.draw.choice(["HOME", f"AT_{self.entry}"])
        commands = {does.upper(): self.command(does) for does in ("move", "grasp")}
        commands["PUT"] = self.command("put", self.draw.choice(ROOMY))
        positions = {"HOME": None, **{f"AT_{station}": station for station in self.stations}}
        self.machine(name, commands, hand=hand, positions=positions)
        self.movers.append(name)
        controller = self.draw.choice(self.controllers)
        free = self.rest(f"{controller}.free_{name}")
        steps = [
            self.commanding(free, f"to_source_{name}", name, "MOVE", to=f"AT_{source}"),
            self.commanding(free, f"grasp_{name}", name, "GRASP", at=f"AT_{source}"),
            self.commanding(free, f"to_target_{name}", name, "MOVE", to=f"AT_{target}"),
            self.commanding(free, f"put_{name}", name, "PUT", at=f"AT_{target}"),
        ]
        if hand != "HOME" and self.draw.random() < 0.3:
            steps = [*steps[1:], steps[0]]  # it waits where it grasps
        self.guard(self.cycle(free, steps)[0], i, source, target)

    def belt(self, i: int) -> None:
        """A belt that carries workpieces from one station to another one."""
        name, (source, target) = f"B{i}", self.route(i)
        route = {"from": source, "to": target}
        self.machine(name, {"RUN": self.command("carry", route, self.draw.choice(ROOMY))})
        self.movers.append(name)
        controller = self.draw.choice(self.controllers)
        free = self.rest(f"{controller}.free_{name}")
        self.guard(self.cycle(free, [self.commanding(free, f"run_{name}", name, "RUN")])[0], i, source, target)

    def tool(self) -> None:
        """A tool that clamps what comes to a station, works on it and lets it go."""
        station, controller = self.draw.choice(self.stations), self.draw.choice(self.controllers)
        at = {"station": station}
        commands = {
            "CLAMP": {"does": "clamp", **at, "takes_s": self.seconds(0.2, 2)},
            "RUN": self.command("process", at),
            "RELEASE": {"does": "release", **at, "takes_s": self.seconds(0.2, 2)},
        }
        self.machine("T", commands)
        free = self.rest(f"{controller}.free_T")
        steps = [self.commanding(free, f"{command.lower()}_T", "T", command) for command in commands]
        seen = f"{controller}.work_T"
        self.sensors[seen] = {"occupied": station}
        waits = self.draw.random() < 0.7
        if waits:
            steps.append(self.place(f"{controller}.ready_T"))
        first, *_, last = self.cycle(free, steps)
        first.wanted.append(seen)
        if waits:
            last.unwanted.append(seen)

    def table(self) -> None:
        """A machine that moves what lies on some stations at once, round in a circle or not, and perhaps back."""
        stations = self.draw.sample(self.stations, self.draw.randint(2, len(self.stations)))
        ring = self.draw.random() < 0.6
        following = {stations[i - 1]: at for i, at in enumerate(stations) if i or ring}
        commands = {"INDEX": self.command("index", {"next": following})}
        if self.draw.random() < 0.3:
            commands["BACK"] = self.command("index", {"next": {to: at for at, to in following.items()}})
        self.machines["I"] = {"commands": commands}
        free = self.rest(f"{self.draw.choice(self.controllers)}.free_I")
        steps = [self.commanding(free, f"{command.lower()}_I", "I", command) for command in commands]
        begins = self.cycle(free, steps)[0]
        begins.wanted.append(self.sensor_beside(begins, "full_I", {"occupied": self.draw.choice(stations)}))
        if self.draw.random() < 0.6:
            begins.unwanted.append(self.sensor_beside(begins, "taken_I", {"occupied": stations[-1]}))

    def lamp(self) -> None:
        """A lamp that is lit as long as a sensor shows something."""
        self.machines["L"] = {"commands": {colour: {"does": "switch"} for colour in ("GREEN", "DARK")}}
        controller, seen = self.draw.choice(self.controllers), self.draw.choice([*self.sensors])
        unlit = self.rest(f"{controller}.unlit_L")
        lit, out = (
            self.place(f"{controller}.{colour.lower()}_L", {"send": {"machine": "L", "command": colour}})
            for colour in ("GREEN", "DARK")
        )
        lights, darkens, _ = self.cycle(unlit, [lit, out])
        lights.wanted.append(seen)
        darkens.unwanted.append(seen)

    def route(self, i: int) -> tuple[str, str]:
        source = self.entry if i == 0 or self.draw.random() < 0.5 else self.draw.choice(self.stations)
        return source, self.draw.choice([station for station in self.stations if station != source])

    def command(self, does: str, *more: Document) -> Document:
        command = {"does": does, "takes_s": self.seconds(0.2, 2)}
        for some in (*more, self.draw.choice(FAILING)):
            command |= some
        return command

    def machine(self, name: str, commands: Document, **more: object) -> None:
        """A machine, perhaps with a command or two that stop it, in a moment or at once."""
        stops = STOPS[: self.draw.choice([0, 0, 1, 2])]
        for stop in stops:
            takes = {"takes_s": self.seconds(0.1, 1)} if self.draw.random() < 0.5 else {}
            commands[stop] = {"does": "stop", **takes}
            self.stops[name] = stop
        self.machines[name] = {**more, "commands": commands}

    def cycle(self, free: str, steps: list[str]) -> list[_Transition]:
        """From the place of rest through the steps and back; the first of the transitions is the one that begins."""
        ring = [free, *steps]
        return [self.transition([ring[i - 1]], [ring[i]]) for i in (*range(1, len(ring)), 0)]

    def guard(self, begins: _Transition, i: int, source: str, target: str) -> None:
        """Mostly a cycle begins where there is something to fetch, and often where there is room for it."""
        if self.draw.random() < 0.9:
            begins.wanted.append(self.sensor_beside(begins, f"full_{source}_{i}", {"occupied": source}))
        if self.draw.random() < 0.6:
            begins.unwanted.append(self.sensor_beside(begins, f"taken_{target}_{i}", {"occupied": target}))

    # --- Places, transitions and signals

    def place(self, name: str, document: Document | None = None) -> str:
        self.places[name] = document or {}
        return name

    def rest(self, name: str) -> str:
        self.marked.append(name)
        return self.place(name)

    def transition(self, sources: list[str], targets: list[str], name: str = "") -> _Transition:
        drawn = _Transition(name or f"t{len(self.transitions)}", sources, targets)
        self.transitions.append(drawn)
        return drawn

    def commanding(self, free: str, local: str, machine: str, command: str, **arguments: str) -> str:
        """A place that sends a command, mostly with a completion and now and then with a time limit."""
        controller = _controller(free)
        name = f"{controller}.{local}"
        document: Document = {"send": {"machine": machine, "command": command, **arguments}}
        if self.draw.random() < 0.9:
            document["until"] = self.completion(controller, f"{local}_done")
            if self.draw.random() < 0.15:
                late = self.too_late(name, machine)
                document["within"] = {"time": self.draw.choice(["300ms", "1s", "3s"]), "to": _local(late)}
                self.transition([late], [name if self.draw.random() < 0.6 else free], f"again_{local}")
        return self.place(name, document)

    def too_late(self, name: str, machine: str) -> str:
        """The place where the token of another one goes when its time is over, which may stop the machine."""
        late = f"{name}_late"
        if machine not in self.stops or self.draw.random() < 0.4:
            return self.place(late)
        return self.stopping(late, machine)

    def stopping(self, name: str, machine: str) -> str:
        document: Document = {"send": {"machine": machine, "command": self.stops[machine]}}
        if self.draw.random() < 0.4:
            document["until"] = self.completion(_controller(name), f"{_local(name)}_done")
        return self.place(name, document)

    def completion(self, controller: str, local: str) -> str:
        """A completion of its own, or that of another place of the controller; the local name."""
        others = [name for name in self.completions if _controller(name) == controller]
        if self.shares_completions and others and self.draw.random() < 0.4:
            return _local(self.draw.choice(others))
        self.completions.append(f"{controller}.{local}")
        return local

    def sensor(self, controller: str, local: str, sees: Document) -> str:
        exact = {"passes", "fails", "acknowledges", "set_by"} & {*sees}
        self.sensors[f"{controller}.{local}"] = sees | ({} if exact else self.draw.choice(BLURRED))
        return f"{controller}.{local}"

    def sensor_beside(self, transition: _Transition, local: str, sees: Document) -> str:
        """A sensor of the controller of a transition, or of another one."""
        own = _controller(transition.sources[0])
        return self.sensor(own if self.draw.random() < 0.75 else self.draw.choice(self.controllers), local, sees)

    # --- What looks on

    def further_sensor(self) -> None:
        """A sensor of any kind, a camera, a key or what is set from outside, told to any controller."""
        choices = [self.occupied(), self.holding(), self.judging(), self.from_outside()]
        if self.stops:
            choices.append({"acknowledges": self.draw.choice([*self.stops]), "after_s": self.seconds(0.1, 1)})
        sees = self.draw.choices(choices, weights=[35, 30, 25, 10, 10][: len(choices)])[0]
        self.sensor(self.draw.choice(self.controllers), f"{next(iter(sees))}_{len(self.sensors)}", sees)

    def occupied(self) -> Document:
        return {"occupied": self.draw.choice(self.stations)}

    def holding(self) -> Document:
        return {"holding": self.draw.choice(self.movers)}

    def judging(self) -> Document:
        kind = self.draw.choice(["passes", "fails"])
        return {kind: self.draw.choice(self.stations), "after_s": self.seconds(0.1, 1)}

    def from_outside(self) -> Document:
        again: Document = {"after_s": self.seconds(0.1, 4), "for_s": self.seconds(0.1, 4)}
        return {"set_by": "operator", **(again if self.draw.random() < 0.7 else {})}

    def watcher(self, i: int) -> None:
        """Two places between which a token goes by what several signals show; the second may stop a machine."""
        controller = self.draw.choice(self.controllers)
        calm, alarm = self.rest(f"{controller}.calm_{i}"), f"{controller}.alarm_{i}"
        if self.stops and self.draw.random() < 0.5:
            self.stopping(alarm, self.draw.choice([*self.stops]))
        else:
            self.place(alarm)
        read = [*dict.fromkeys([*self.sensors, self.draw.choice(self.completions)])] if self.completions else []
        read = read or [*self.sensors]
        for sources, targets, name in (([calm], [alarm], f"alarm_{i}"), ([alarm], [calm], f"calm_{i}")):
            watching = self.transition(sources, targets, name)
            for signal in self.draw.sample(read, min(len(read), self.draw.randint(1, 3))):
                self.gate(watching, signal, 0.5)

    def gate(self, transition: _Transition, name: str, wanted: float) -> None:
        """A gate, which wants a token or a 1 so often, unless the transition has to do with it."""
        if name not in transition.gates | transition.touched:
            (transition.wanted if self.draw.random() < wanted else transition.unwanted).append(name)

    def further_gates(self) -> None:
        """Gates that read a sensor, or a place of any controller, here and there."""
        for transition in self.transitions:
            if self.sensors and self.draw.random() < 0.1:
                self.gate(transition, self.draw.choice([*self.sensors]), 0.5)
            if self.draw.random() < 0.075:
                self.gate(transition, self.draw.choice([*self.places]), 0.4)

    def coordinate(self) -> None:
        """Two transitions that share no place become one."""
        one, other = self.draw.sample(self.transitions, 2)
        if one.touched & other.touched or (one.gates & other.touched) or (other.gates & one.touched):
            return
        self.transitions.remove(other)
        one.sources += other.sources
        one.targets += other.targets
        one.wanted += [name for name in other.wanted if name not in one.gates]
        one.unwanted += [name for name in other.unwanted if name not in one.gates]

    def see_completions(self) -> None:
        """Some completions are what a sensor shows, mostly one that sees what the command has done."""
        for name in self.completions:
            if self.draw.random() > 0.25:
                continue
            done, machine = _local(name).removesuffix("_done").rpartition("_")[::2]
            fitting = {"grasp": {"holding": machine}, "put": self.occupied(), "run": self.occupied()}
            others = [self.occupied(), self.holding(), {"passes": self.draw.choice(self.stations)}]
            sees = fitting[done] if done in fitting and self.draw.random() < 0.7 else self.draw.choice(others)
            self.sensor(_controller(name), _local(name), sees)

    # --- The files

    def net(self) -> Document:
        controllers = {controller: self.part(controller) for controller in self.controllers}
        transitions = {transition.name: transition.document() for transition in self.transitions}
        return {"firable": 1, "cell": "drawn", "controllers": controllers, "transitions": transitions}

    def part(self, controller: str) -> Document:
        """What the net file says of a controller; one with nothing to do has a place all the same."""
        start = _of(controller, self.marked)
        inputs = _of(controller, [name for name in self.sensors if name not in self.completions])
        places = {_local(name): one for name, one in self.places.items() if _controller(name) == controller}
        found: Document = {"start": start, "inputs": inputs}
        return {**{word: names for word, names in found.items() if names}, "places": places or {"idle": {}}}

    def plant(self) -> Document:
        found: Document = {
            "firable_plant": 1,
            "plant": "drawn",
            "stations": self.stations,
            "arrivals": {"station": self.entry, "every_s": self.seconds(0.5, 6)},
            "departures": {"station": self.exit, "after_s": self.seconds(0.2, 3)},
            "machines": self.machines,
            "sensors": dict(self.draw.sample([*self.sensors.items()], len(self.sensors))),
        }
        if self.draw.random() < 0.3:
            found["departures"] = self.ways_out(found["departures"])
        return found

    def full_at_first(self, plant: Document) -> Document:
        """Stations where a workpiece lies, machined or not, where some machine does that and it may leave so."""
        ways_out = plant["departures"] if isinstance(plant["departures"], list) else [plant["departures"]]
        ends = {one["station"] for one in ways_out if not one.get("raw")}
        machined = "T" in self.machines
        kinds = {at: ["raw"] * (at not in ends or not machined) + ["machined"] * machined for at in self.stations}
        return {
            at: self.draw.choice(kinds[at]) for at in self.stations if at != self.entry and self.draw.random() < 0.5
        }

    def ways_out(self, first: Document) -> list[Document]:
        """Some workpieces leave elsewhere, or as they came."""
        others = [station for station in self.stations if station != self.exit]
        second = {"station": self.draw.choice(others), "after_s": self.seconds(0.2, 3)} if others else {}
        return [{**one, "raw": True} if self.draw.random() < 0.4 else one for one in (first, second) if one]


def _of(controller: str, names: Collection[str]) -> list[str]:
    return [_local(name) for name in names if _controller(name) == controller]


def _controller(name: str) -> str:
    return name.partition(".")[0]


def _local(name: str) -> str:
    return name.partition(".")[2]
