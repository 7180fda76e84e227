"""Runs of the cells of the catalogue on their simulated plants."""

import io
from collections.abc import Iterable

from support.cells import decomposition_of, plant_of

from firable.executor.cell.disturbances import Disturbance
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.running import Operator, RunReport, SimulatedCell, execute
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.semantics.joining import VOTED
from firable.semantics.replaying import replay
from firable.semantics.trace import Noted, Trace, parse_trace


def run_cell(
    cell: str,
    workpieces: int,
    *,
    seed: int = 0,
    speed: float | None = None,
    overdue_seconds: float = 120.0,
    disturbances: Iterable[Disturbance] = (),
    operator: Operator | None = None,
    plant: PlantModel | None = None,
) -> tuple[RunReport, Trace]:
    """Run a cell of the catalogue; every trace must be a complete one of the central net."""
    stream = io.StringIO()
    report = execute(
        decomposition_of(cell),
        SimulatedCell(
            plant or plant_of(cell), workpieces=workpieces, seed=seed, speed=speed, disturbances=disturbances
        ),
        Conduct(trace=stream, overdue_seconds=overdue_seconds, operator=operator),
    )
    trace = parse_trace(stream.getvalue())
    replayed = replay(catalogue_net(cell), trace)
    assert replayed.complete
    assert catalogue_net(cell).names(replayed.marking) == report.situation.marking
    assert (replayed.firings, replayed.commands) == (sum(report.firings.values()), report.commands)
    return report, trace


def notes(trace: Trace) -> list[str]:
    """What the trace keeps beside firings, signals, commands and votes."""
    return [event.note for event in trace.events if isinstance(event, Noted) and event.note != VOTED]


def replace_text(cell: str, old: str, new: str) -> PlantModel:
    text = catalogue_path(cell).with_name(f"{cell}.plant.yaml").read_text("utf-8")
    assert old in text
    return parse_plant(text.replace(old, new))
