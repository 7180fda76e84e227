"""Runs of the simulated cells of the catalogue, of machines that keep to their plant file or do not, to be watched."""

import io
from functools import cache

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import Disturbance
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.running import SimulatedCell, execute
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.plant_file import Move, PlantModel
from firable.semantics.trace import Trace, parse_trace

CELLS = [
    "index_table",
    "one_robot",
    "one_robot_mc_late",
    "one_robot_mc_late_capacity",
    "two_cells",
    "two_robots_separate",
    "two_robots_shared",
]


def run_of(
    cell: str, *disturbances: Disturbance, workpieces: int = 6, seed: int = 1, plant: PlantModel | None = None
) -> Trace:
    """The trace of a run, which nobody watches meanwhile."""
    if plant is not None:
        return _run(cell, plant, disturbances, workpieces, seed)
    return _run_as_modelled(cell, disturbances, workpieces, seed)


@cache
def _run_as_modelled(cell: str, disturbances: tuple[Disturbance, ...], workpieces: int, seed: int) -> Trace:
    return _run(cell, catalogue_plant(cell), disturbances, workpieces, seed)


def _run(cell: str, plant: PlantModel, disturbances: tuple[Disturbance, ...], workpieces: int, seed: int) -> Trace:
    stream = io.StringIO()
    execute(
        split(catalogue_net(cell)),
        SimulatedCell(plant, workpieces=workpieces, seed=seed, disturbances=disturbances),
        Conduct(trace=stream, watch=Watch.IGNORE),
    )
    return parse_trace(stream.getvalue())


def slower(model: PlantModel, machine: str, command: str, takes_s: float) -> PlantModel:
    machines = dict(model.machines)
    action = machines[machine].commands[command]
    assert isinstance(action, Move)
    commands = {**machines[machine].commands, command: action.model_copy(update={"takes_s": takes_s})}
    machines[machine] = machines[machine].model_copy(update={"commands": commands})
    return model.model_copy(update={"machines": machines})
