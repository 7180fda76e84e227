"""Families of plants: pipelines, floors, flexible manufacturing cells, vehicles in zones.

What the examples of the catalogue are for one cell, these are for n: parts that move on when there is room, robots and
zones that are shared. Room is always a place of its own, marked while there is room, so that the nets are contact-free
and every transition says what it waits for; relying on the contact rule instead would halve the places and hide
the collisions that the rule prevents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

from firable.nets.catalogue.processes import controllers, never_both
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Signal,
    SignalKind,
    Transition,
)

FLOOR_WIDTH_ZONES = 4
"""How many zones of `vehicles` stand side by side."""
MACHINES_OF_A_ROBOT = 4
"""How many machines of `workshop` share a robot."""


def pipeline(n: int) -> Net:
    """A line of n buffers for one part each: 2^n markings, since any of them can be full.

    (n + 3) 2^(n-2) edges: parts enter and leave in half of the markings, and each of the n - 1 moves is possible in a
    quarter.
    """
    who = [f"b{i}" for i in range(1, n + 1)]
    places, transitions = [], [Transition("enter", ("b1.free",), ("b1.full",))]
    for i, b in enumerate(who):
        places += [Place(f"{b}.free", b, marked=True), Place(f"{b}.full", b)]
        if i + 1 < n:
            after = who[i + 1]
            transitions.append(Transition(f"{b}_moves", (f"{b}.full", f"{after}.free"), (f"{b}.free", f"{after}.full")))
    transitions.append(Transition("leave", (f"{who[-1]}.full",), (f"{who[-1]}.free",)))
    return Net(
        f"pipeline-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(who, "a buffer"),
        properties=(never_both("a_buffer_is_free_or_full", "b1.free", "b1.full"),),
        description="A line of buffers for one part each",
    )


def grid(n: int) -> Net:
    """A floor of n by n cells with n pallets, each of which can move to a free cell beside it.

    (n^2 choose n) markings: pallets are not told apart, and any arrangement of them can be reached.
    """
    places, transitions = [], []
    for x in range(n):
        for y in range(n):
            cell = f"c{x}_{y}"
            places += [Place(f"{cell}.free", cell, marked=y > 0), Place(f"{cell}.pallet", cell, marked=y == 0)]
            for dx, dy in ((1, 0), (0, 1)):
                if x + dx < n and y + dy < n:
                    other = f"c{x + dx}_{y + dy}"
                    transitions += [_move(cell, other), _move(other, cell)]
    return Net(
        f"grid-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers([f"c{x}_{y}" for x in range(n) for y in range(n)], "a cell of the floor"),
        description="Pallets on a floor of square cells",
    )


def _move(source: str, target: str) -> Transition:
    inputs, outputs = (f"{source}.pallet", f"{target}.free"), (f"{source}.free", f"{target}.pallet")
    return Transition(f"{source}_to_{target}", inputs, outputs)


def manufacturing_cells(n: int) -> Net:
    """A line of n stations, loaded by robots that each serve two of them; a station is reserved before the robot moves.

    13^(n/2) markings, times 4 for an odd station at the end: a station is free, reserved, working or ready, and
    while the second of a robot's two is reserved, the first stays free, since the robot is away. No deadlock.
    """
    stations = [f"s{i}" for i in range(1, n + 1)]
    robots = [f"r{j}" for j in range(1, (n + 1) // 2 + 1)]
    places, transitions, signals = [], [], []
    for s in stations:
        finished = f"{s}.finished"
        places += [Place(f"{s}.free", s, marked=True), Place(f"{s}.reserved", s)]
        places.append(Place(f"{s}.working", s, command=Command(s.upper(), "RUN"), completion=finished))
        places.append(Place(f"{s}.ready", s))
        signals.append(Signal(finished, s, SignalKind.COMPLETION))
    for j, robot in enumerate(robots):
        places.append(Place(f"{robot}.free", robot, marked=True))
        for s in stations[2 * j : 2 * j + 2]:
            move = Command(robot.upper(), "MOVE", (("to", s.upper()),))
            places.append(Place(f"{robot}.to_{s}", robot, command=move, completion=f"{robot}.at_{s}"))
            signals.append(Signal(f"{robot}.at_{s}", robot, SignalKind.COMPLETION))
    for i, s in enumerate(stations):
        robot = robots[i // 2]
        to = f"{robot}.to_{s}"
        taken, left = ((f"{stations[i - 1]}.ready",), (f"{stations[i - 1]}.free",)) if i else ((), ())
        transitions += [
            Transition(f"{s}_load", (f"{robot}.free", f"{s}.free", *taken), (to, f"{s}.reserved", *left)),
            Transition(
                f"{s}_start",
                (to, f"{s}.reserved"),
                (f"{robot}.free", f"{s}.working"),
                external=(ExternalGate(f"{robot}.at_{s}"),),
            ),
            Transition(f"{s}_end", (f"{s}.working",), (f"{s}.ready",), external=(ExternalGate(f"{s}.finished"),)),
        ]
    last = stations[-1]
    transitions.append(Transition("leave", (f"{last}.ready",), (f"{last}.free",)))
    return Net(
        f"manufacturing_cells-{n}",
        tuple(places),
        tuple(transitions),
        tuple(signals),
        (*controllers(stations, "a station"), *controllers(robots, "a robot that serves two stations")),
        properties=(never_both("one_part_in_a_station", "s1.reserved", "s1.working"),),
        description="A line of stations, loaded by robots that serve two each",
    )


@dataclass(frozen=True, slots=True)
class _Cell:
    places: tuple[Place, ...]
    transitions: tuple[Transition, ...]
    signals: tuple[Signal, ...]


def workshop_markings(n: int) -> int:
    """The number of markings of `workshop`, as its docstring explains it."""
    cells, rest = divmod(n, MACHINES_OF_A_ROBOT)
    return prod((4 + 6 * k) << 2 * k for k in (*[MACHINES_OF_A_ROBOT] * cells, *([rest] if rest else [])))


def workshop(n: int) -> Net:
    """Machines in cells of four, each cell with a robot and two conveyors that its machines share.

    Ten transitions for each machine and two for each cell, most of them of two or three controllers: the family by
    which splitting and proving are measured. The loads and unloads of a cell are one conflict, decided in rotation;
    what gives back the robot is another one, of the robot alone. A conveyor takes a part away only while the arm is
    not above it, which inhibitive gates of the robot say.

    A cell of k machines has 4^k (4 + 6 k) markings, and cells multiply, since they have nothing to do with one another:
    while the robot is free each machine is free, clamping, working or done, and each conveyor empty or not; a machine
    for which the robot is on its way leaves 24 for itself and the conveyors. No deadlock.
    """
    machines = [f"m{i}" for i in range(1, n + 1)]
    cells = [machines[i : i + MACHINES_OF_A_ROBOT] for i in range(0, n, MACHINES_OF_A_ROBOT)]
    made = [_workshop_cell(j, its) for j, its in enumerate(cells, 1)]
    served = [name for j in range(1, len(cells) + 1) for name in (f"r{j}", f"in{j}", f"out{j}")]
    # As a file would have them: what one controller owns stands together.
    order = {name: i for i, name in enumerate((*machines, *served))}
    return Net(
        f"workshop-{n}",
        tuple(sorted((place for cell in made for place in cell.places), key=lambda place: order[place.owner or ""])),
        tuple(transition for cell in made for transition in cell.transitions),
        tuple(sorted((signal for cell in made for signal in cell.signals), key=lambda s: order[s.owner or ""])),
        (*controllers(machines, "a machine"), *controllers(served, "a robot or a conveyor of four machines")),
        tuple(
            Arbiter(
                f"jobs{j}", tuple(f"{m}_{job}" for m in its for job in ("load", "unload")), ArbitrationRule.ROTATION
            )
            for j, its in enumerate(cells, 1)
        ),
        properties=(never_both("one_part_in_a_machine", "m1.clamping", "m1.working"),),
        description="Machines in cells of four, each with a robot and two conveyors",
    )


def _workshop_cell(j: int, machines: Sequence[str]) -> _Cell:
    r, entry, leaving = f"r{j}", f"in{j}", f"out{j}"
    places = [Place(f"{r}.free", r, marked=True)]
    for conveyor in (entry, leaving):
        places += [Place(f"{conveyor}.free", conveyor, marked=True), Place(f"{conveyor}.part", conveyor)]
    signals: list[Signal] = []
    transitions = [
        Transition(f"{entry}_brings", (f"{entry}.free",), (f"{entry}.part",)),
        Transition(
            f"{leaving}_takes_away",
            (f"{leaving}.part",),
            (f"{leaving}.free",),
            inhibitive=tuple(f"{r}.leaving_{m}" for m in machines),
        ),
    ]
    for m in machines:
        places.append(Place(f"{m}.free", m, marked=True))
        places += [Place(f"{m}.{name}", m) for name in ("waiting", "done", "giving")]
        works = [(m, "clamping", "CLAMP"), (m, "working", "WORK")]
        moves = ("fetching", "carrying", "retreating", "reaching", "bringing", "leaving")
        works += [(r, f"{move}_{m}", f"{move.upper()}_{m.upper()}") for move in moves]
        for owner, name, command in works:
            signals.append(Signal(f"{owner}.{name}_ended", owner, SignalKind.COMPLETION))
            places.append(
                Place(f"{owner}.{name}", owner, command=Command(owner.upper(), command), completion=signals[-1].name)
            )
        places += [Place(f"{entry}.for_{m}", entry), Place(f"{leaving}.for_{m}", leaving)]
        to = {move: f"{r}.{move}_{m}" for move in moves}
        from_entry, to_leaving = f"{entry}.for_{m}", f"{leaving}.for_{m}"
        chain: tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...] = (
            ("load", (f"{r}.free", f"{m}.free", f"{entry}.part"), (to["fetching"], f"{m}.waiting", from_entry)),
            ("grasp", (to["fetching"], from_entry), (to["carrying"], f"{entry}.free")),
            ("put", (to["carrying"], f"{m}.waiting"), (to["retreating"], f"{m}.clamping")),
            ("left", (to["retreating"],), (f"{r}.free",)),
            ("clamped", (f"{m}.clamping",), (f"{m}.working",)),
            ("worked", (f"{m}.working",), (f"{m}.done",)),
            ("unload", (f"{r}.free", f"{m}.done", f"{leaving}.free"), (to["reaching"], f"{m}.giving", to_leaving)),
            ("take", (to["reaching"], f"{m}.giving"), (to["bringing"], f"{m}.free")),
            ("set_down", (to["bringing"], to_leaving), (to["leaving"], f"{leaving}.part")),
            ("back", (to["leaving"],), (f"{r}.free",)),
        )
        ends = {place.name: ExternalGate(place.completion) for place in places if place.completion is not None}
        for name, inputs, outputs in chain:
            gates = tuple(ends[place] for place in inputs if place in ends)
            transitions.append(Transition(f"{m}_{name}", inputs, outputs, external=gates))
    return _Cell(tuple(places), tuple(transitions), tuple(signals))


def vehicles(n: int, zones: int = 32) -> Net:
    """Vehicles, told apart, on a floor of zones four wide; one moves to a free zone beside it.

    zones! / (zones - n)! markings, as any placing of the vehicles can be reached while two zones are free: 4.2e11 for 8
    vehicles in 32 zones, 2.3e14 for 10. `ValueError` for zones that are no such floor.
    """
    width = FLOOR_WIDTH_ZONES
    if not 2 * width <= zones <= 1024 or zones % width or zones < n + 2:
        raise ValueError(
            f"the zones of 'vehicles' are a multiple of {width}, from {2 * width} to 1,024, and two more than vehicles"
        )
    who = [f"v{i}" for i in range(1, n + 1)]
    places = [Place(f"floor.free{z}", "floor", marked=z >= n) for z in range(zones)]
    places += [Place(f"{v}.in{z}", v, marked=i == z) for i, v in enumerate(who) for z in range(zones)]
    beside = [(z, z + 1) for z in range(zones) if (z + 1) % width] + [(z, z + width) for z in range(zones - width)]
    transitions = [
        Transition(
            f"{v}_from{a}_to{b}",
            (f"{v}.in{a}", f"floor.free{b}"),
            (f"{v}.in{b}", f"floor.free{a}"),
        )
        for v in who
        for pair in beside
        for a, b in (pair, pair[::-1])
    ]
    return Net(
        f"vehicles-{n}-{zones}",
        tuple(places),
        tuple(transitions),
        controllers=(Controller("floor", description="the zones"), *controllers(who, "a vehicle")),
        properties=(never_both("vehicles_are_apart", "v1.in0", "v2.in0"),) if n > 1 else (),
        description="Vehicles that share the zones of a floor",
    )
