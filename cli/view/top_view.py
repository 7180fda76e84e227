"""Where everything of a cell stands in its top view, from its plant file alone.

The plant file has no positions, so this is a sketch, arranged as a cell is sketched on paper: the stations in the order
of the file from left to right, a belt from the station from which a machine carries to each to which it does, the
first of them on the line and the others behind that, a table where a machine works, set back from the line, and an arm
before the stations that it reaches. Arms that reach the same stations stand on both sides of the line. A machine that
only works, at no station that the file names, stands behind them all.

A machine that carries from several stations is an arm whose gripper is a station of its own: what it alone fills and
empties. Units are those of the drawing; the line is y = 0, and what is in front of it has y > 0.
"""

from __future__ import annotations

from typing import Any, Final

from firable.cli.view.scene import Stage, carries, is_arm, works_at
from firable.nets.machines.plant_file import PlantModel

BELT: Final = 150.0
GAP: Final = 120.0
BACK: Final = -95.0
FRONT: Final = 125.0
SIDE: Final = 90.0
"""How far two things that would stand at one place are put apart."""


def top_view(plant: PlantModel) -> dict[str, Any]:
    """The places of stations, belts, tables, arms and other machines."""
    grippers = {arm: _grippers(plant, arm) for arm in plant.machines if is_arm(plant, arm)}
    hidden = {station for stations in grippers.values() for station in stations}
    belts = {name: pairs for name in plant.machines if not is_arm(plant, name) and (pairs := carries(plant, name))}
    tables = {name: at for name in plant.machines if (at := works_at(plant, name)) is not None and name not in grippers}
    stations = _stations(plant, hidden, list(belts.values()), set(tables.values()))
    arms = _arms(plant, grippers, stations)
    rest = [name for name in plant.machines if name not in {*belts, *tables, *arms}]
    middle = sum(x for x, _ in stations.values()) / max(1, len(stations))
    left = middle - (len(rest) - 1) * GAP / 2
    backs = [*(arm["home"][1] for arm in arms.values()), *(y for _, y in stations.values())]
    behind = min([BACK * 2.2, *(y - SIDE for y in backs)])
    others = {name: [left + i * GAP, behind] for i, name in enumerate(rest)}
    return {
        "name": plant.plant,
        "says": plant.description,
        "stations": stations,
        "belts": {name: {b: [*stations[a], *stations[b]] for a, b in pairs} for name, pairs in belts.items()},
        "tables": {name: stations[at] for name, at in tables.items()},
        "arms": arms,
        "others": others,
        "arrivals": plant.arrivals.station,
        "departures": [departure.station for departure in plant.departures],
    }


def top_of(stage: Stage | None, why_not: str) -> dict[str, Any]:
    """What the page shows as the top view at first, or why there is none."""
    if stage is None:
        return {"why_not": why_not}
    return {"view": top_view(stage.plant), **stage.told(stage.begin())}


def _grippers(plant: PlantModel, arm: str) -> set[str]:
    """The stations that one arm alone both fills and empties."""
    pairs = carries(plant, arm)
    others = {end for name in plant.machines if name != arm for pair in carries(plant, name) for end in pair}
    other_work = {works_at(plant, name) for name in plant.machines}
    both = {a for a, _ in pairs} & {b for _, b in pairs}
    through = {s for s in both if sum(s in pair for pair in pairs) > 2}
    return {s for s in through if s not in others and s not in other_work}


def _stations(
    plant: PlantModel, hidden: set[str], belts: list[list[tuple[str, str]]], tables: set[str]
) -> dict[str, list[float]]:
    line = {pairs[0] for pairs in belts}
    ends = {end for pair in line for end in pair}
    behind = {end: pairs[0][1] for pairs in belts for _, end in pairs[1:] if end not in ends}
    found: dict[str, list[float]] = {}
    x, before = 0.0, None
    for name in plant.stations:
        if name in hidden or name in behind:
            continue
        if before is not None:
            x += BELT if (before, name) in line or (name, before) in line else GAP
        found[name] = [x, BACK if name in tables or name not in ends else 0.0]
        before = name
    for name, first in behind.items():
        x, y = found[first][0], BACK
        while [x, y] in found.values():
            y += BACK
        found[name] = [x, y]
    return found


def _arms(plant: PlantModel, grippers: dict[str, set[str]], stations: dict[str, list[float]]) -> dict[str, Any]:
    """Each arm before the middle of what it reaches; where one stands there already, behind it, or beside."""
    arms: dict[str, Any] = {}
    taken = [(x, y) for x, y in stations.values() if y < BACK]
    for arm, own in grippers.items():
        one = plant.machines[arm]
        reached = [s for s in one.positions.values() if s in stations]
        reached += [end for pair in carries(plant, arm) for end in pair if end in stations]
        xs = [stations[s][0] for s in dict.fromkeys(reached)] or [0.0]
        x, y = sum(xs) / len(xs), FRONT
        while any(abs(x - a) < SIDE and abs(y - b) < SIDE for a, b in taken):
            x, y = (x, BACK - FRONT) if y == FRONT else (x + SIDE, FRONT)
        taken.append((x, y))
        home = [x, y + (38.0 if y > 0 else -38.0)]
        at = {name: stations.get(station or "", home) for name, station in one.positions.items()}
        arms[arm] = {"base": [x, y], "home": home, "positions": at, "gripper": sorted(own)}
    return arms
