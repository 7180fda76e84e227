"""What is where in a cell: workpieces, hands and machines, as the commands sent and the signals come tell it.

The top view needs more than a marking: a token says that the robot moves, not what it holds. The plant file says what
each command does to a workpiece, so a scene is carried along with the events of a run: a command that is sent keeps
its machine busy, and its completion has the effect (a hand is elsewhere, a workpiece lies on another station). The
same rules serve a net that is played, a trace and a running cell, bound to real machines or not.

It is a picture and judges nothing. A transfer from a station where no workpiece is known to lie moves none; only at the
station of the arrivals one appears, with its sensor or when it is first taken, and at those of the departures it is
taken away with the next firing. What really lies where is known to nobody but the cell (`executor/cell/plant.py`
simulates that, with accidents, and `check --machines` proves things of it).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from firable.cli.view.site import refusal
from firable.nets.machines.plant_file import Carry, Grasp, Index, Move, PlantModel, Process, Put, Release
from firable.nets.net import Net, Place


@dataclass(frozen=True)
class Piece:
    """A workpiece: its number, where it is (a station, or the machine that has it), and whether it was machined."""

    number: int
    on: str
    machined: bool = False


@dataclass(frozen=True)
class Scene:
    """The workpieces, the position of each hand, and the place whose command each busy machine is at."""

    pieces: tuple[Piece, ...]
    hands: Mapping[str, str]
    busy: Mapping[str, str]
    arrived: int = 0

    def on(self, where: str) -> Piece | None:
        """The workpiece at a station or a machine."""
        return next((piece for piece in self.pieces if piece.on == where), None)

    def moved(self, source: str, target: str) -> Scene:
        """The scene with the workpiece of one place at another."""
        return replace(self, pieces=tuple(replace(p, on=target) if p.on == source else p for p in self.pieces))

    def to_json(self) -> dict[str, Any]:
        """For the page, which hands it back with what is done next."""
        return {
            "pieces": [[piece.number, piece.on, piece.machined] for piece in self.pieces],
            "hands": dict(self.hands),
            "busy": dict(self.busy),
            "arrived": self.arrived,
        }


@dataclass(frozen=True)
class Stage:
    """A net and its plant, and how events change the scene."""

    net: Net
    plant: PlantModel

    def begin(self) -> Scene:
        """All at rest, and no workpiece has come: a place that holds a token at first has sent no command."""
        hands = {name: one.hand for name, one in self.plant.machines.items() if one.hand is not None}
        full = enumerate(self.plant.full_at_first.items(), 1)
        pieces = tuple(Piece(number, station, kind == "machined") for number, (station, kind) in full)
        return Scene(pieces, hands, {}, len(pieces))

    def sent(self, scene: Scene, name: str) -> Scene:
        """A place has sent its command; one that nobody waits for is done at once."""
        place = self.net.place(name)
        if place.command is None or (action := self._action(place)) is None:
            return scene
        machine = place.command.machine
        if machine in scene.busy:
            scene = self.done(scene, scene.busy[machine])
        if isinstance(action, Carry) and scene.on(machine) is None:
            scene = self._came(scene, action.source).moved(action.source, machine)
        scene = replace(scene, busy={**scene.busy, machine: name})
        return scene if place.completion is not None else self.done(scene, name)

    def done(self, scene: Scene, name: str) -> Scene:
        """The command of a place is completed: its effect."""
        place = self.net.place(name)
        command, action = place.command, self._action(place)
        if command is None or scene.busy.get(command.machine) != name:
            return scene
        machine, parameters = command.machine, dict(command.parameters)
        scene = self.left(scene, name)
        at = self.plant.machines[machine].positions.get(scene.hands.get(machine, ""))
        match action:
            case Move():
                return replace(scene, hands={**scene.hands, machine: parameters.get("to", "")})
            case Grasp() if at is not None and scene.on(machine) is None:
                return self._came(scene, at).moved(at, machine)
            case Put() if at is not None and scene.on(at) is None:
                return scene.moved(machine, at)
            case Carry(target=target) if scene.on(target) is None:
                return scene.moved(machine, target)
            case Index(following=following):
                pieces = tuple(replace(piece, on=following.get(piece.on, piece.on)) for piece in scene.pieces)
                is_apart = len({piece.on for piece in pieces}) == len(pieces)
                return replace(scene, pieces=pieces) if is_apart else scene
            case Process(station=station):
                pieces = tuple(replace(p, machined=True) if p.on == station else p for p in scene.pieces)
                return replace(scene, pieces=pieces)
        return scene

    def left(self, scene: Scene, name: str) -> Scene:
        """A command ends without its effect: its place was left before."""
        return replace(scene, busy={machine: at for machine, at in scene.busy.items() if at != name})

    def signal(self, scene: Scene, signal: str) -> Scene:
        """A signal has become 1: it completes a command, or sees a workpiece that has come, or is in a hand."""
        for name in tuple(scene.busy.values()):
            if self.net.place(name).completion == signal:
                scene = self.done(scene, name)
        sensor = self.plant.sensors.get(signal)
        if sensor is not None and sensor.station == self.plant.arrivals.station:
            scene = scene if sensor.may_flicker else self._cleared(scene, sensor.station)
            scene = self._came(scene, sensor.station)
        return self._held(scene, signal)

    def fired(self, scene: Scene, transitions: Iterable[str], *, sends: bool) -> Scene:
        """Transitions have fired; with `sends` the commands of the places entered go out too.

        A token that leaves by the completion has its command done, also where gates are free and no signal came.
        """
        staying = tuple(piece for piece in scene.pieces if self.plant.departure(piece.on) is None)
        scene = replace(scene, pieces=staying)
        for name in transitions:
            if name not in self.net.transition_index:
                continue
            transition = self.net.transition(name)
            opened = {gate.signal for gate in transition.external if gate.wanted}
            for signal in opened:
                scene = self._held(scene, signal)
            for place in transition.inputs:
                completed = self.net.place(place).completion in opened
                scene = self.done(scene, place) if completed else self.left(scene, place)
            for place in transition.outputs if sends else ():
                scene = self.sent(scene, place)
        return scene

    def words(self, scene: Scene) -> list[str]:
        """What each machine does, and where workpieces are, in sentences."""
        told = []
        for machine in self.plant.machines:
            held = scene.on(machine)
            hand = f", its hand at {scene.hands[machine]}" if machine in scene.hands else ""
            at = scene.busy.get(machine)
            does = str(self.net.place(at).command).removeprefix(f"{machine} ") if at is not None else "at rest"
            told.append(f"{machine}: {does}{hand}{f', with {_words(held)}' if held else ''}")
        told += [f"{_words(piece)} lies on {piece.on}" for piece in scene.pieces if piece.on in self.plant.stations]
        return told

    def of_json(self, asked: Any) -> Scene:
        """The scene that the page hands back; raises `InputError` F5070 where it is none of this plant."""
        where = {*self.plant.stations, *self.plant.machines}
        match asked:
            case {"pieces": list(pieces), "hands": dict(hands), "busy": dict(busy), "arrived": int(arrived)} if (
                len(pieces) <= len(where)
                and all(_is_piece(piece, where) for piece in pieces)
                and all(name in self.plant.machines and isinstance(at, str) for name, at in hands.items())
                and all(name in self.plant.machines and at in self.net.place_index for name, at in busy.items())
            ):
                return Scene(tuple(Piece(*piece) for piece in pieces), hands, busy, arrived)
        raise refusal("the page speaks of workpieces that the plant cannot have")

    def told(self, scene: Scene) -> dict[str, Any]:
        """A scene as the page shows it: what it hands back, what it draws of each machine, and sentences."""
        doing = {}
        for machine, name in scene.busy.items():
            place = self.net.place(name)
            action = self._action(place)
            if place.command is None or action is None:
                continue
            doing[machine] = {
                "does": action.does,
                "command": str(place.command),
                "from": action.source if isinstance(action, Carry) else "",
                "to": action.target if isinstance(action, Carry) else dict(place.command.parameters).get("to", ""),
                "takes_s": action.takes_s,
            }
        return {"scene": scene.to_json(), "doing": doing, "words": self.words(scene)}

    def _came(self, scene: Scene, station: str) -> Scene:
        """At the station of the arrivals a workpiece lies by now, whether or not its sensor has told so."""
        if station != self.plant.arrivals.station or scene.on(station) is not None:
            return scene
        number = scene.arrived + 1
        return replace(scene, pieces=(*scene.pieces, Piece(number, station)), arrived=number)

    def _cleared(self, scene: Scene, station: str) -> Scene:
        """A sensor shows a workpiece anew: the one before is in the hand that is told to grasp there.

        The next one comes as soon as the station is empty, and that is seen before the grasp is said to be done.
        """
        for machine, name in scene.busy.items():
            at = self.plant.machines[machine].positions.get(scene.hands.get(machine, ""))
            if at == station and scene.on(machine) is None and isinstance(self._action(self.net.place(name)), Grasp):
                return scene.moved(station, machine)
        return scene

    def _held(self, scene: Scene, signal: str) -> Scene:
        """A sensor that sees a workpiece in a hand is believed: a grasp that was given up may have been done."""
        sensor = self.plant.sensors.get(signal)
        machine = sensor.holding if sensor is not None else None
        if machine is None or scene.on(machine) is not None:
            return scene
        at = self.plant.machines[machine].positions.get(scene.hands.get(machine, ""))
        return scene if at is None else scene.moved(at, machine)

    def _action(self, place: Place) -> Any:
        command = place.command
        machine = None if command is None else self.plant.machines.get(command.machine)
        return None if machine is None or command is None else machine.commands.get(command.command)


def _is_piece(asked: Any, where: Collection[str]) -> bool:
    match asked:
        case [int(), str(on), bool()]:
            return on in where
    return False


def _words(piece: Piece) -> str:
    return f"{'a machined' if piece.machined else 'a raw'} workpiece"


def is_arm(plant: PlantModel, machine: str) -> bool:
    """Whether a machine carries from several stations, or has a hand: it is drawn as an arm, and not as a belt."""
    one = plant.machines[machine]
    return one.hand is not None or len({source for source, _ in carries(plant, machine)}) > 1


def carries(plant: PlantModel, machine: str) -> list[tuple[str, str]]:
    """The stations between which a machine carries."""
    commands = plant.machines[machine].commands.values()
    return list(dict.fromkeys((one.source, one.target) for one in commands if isinstance(one, Carry)))


def works_at(plant: PlantModel, machine: str) -> str | None:
    """The station at which a machine clamps or machines workpieces."""
    for one in plant.machines[machine].commands.values():
        if isinstance(one, (Process, Release)) or one.does == "clamp":
            return one.station
    return None
