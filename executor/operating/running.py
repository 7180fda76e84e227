"""Running a bundle on a cell: the way in for the command line and for programs.

A bundle is loaded only if it is unchanged (F5001) and everything that its net must prove is proved (F5002): the right
to run is checked where the run begins, not where the bundle was made. `execute` runs a decomposition without asking for
that right; it is for simulation and for tests, and no command offers it.

The simulated cell runs in virtual time unless a speed is given; then a run is a function of bundle, plant and seed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from firable.executor.cell.disturbances import Disturbance
from firable.executor.cell.plant import Plant
from firable.executor.drivers.binding import Binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.rivals import listen_first
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.journal.sqlite_journal import refuse_taken_over
from firable.executor.operating.conduct import UNATTENDED, Conduct, Told, Watch
from firable.executor.operating.host import Host
from firable.executor.operating.log import Log
from firable.executor.operating.monitor import Divergence, Monitor
from firable.executor.operating.recorder import LineStream
from firable.executor.operating.service import Service, figures_for, patience_with, run_to_the_end
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.taken_up import opened
from firable.executor.protocol.commands import Answer
from firable.nets.bundle import Bundle, read_bundle
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.layers import Layers
from firable.nets.machines.plant_file import PlantModel, misfits
from firable.nets.net import Net
from firable.nets.right_to_run import unproved

Operator = Callable[[Host], Awaitable[None]]
"""A coroutine that runs beside the cell and uses its controls."""


@dataclass(frozen=True, slots=True)
class SimulatedCell:
    """The cell that stands in the place of machines, what goes through it and how fast: as for `run`."""

    plant: PlantModel
    workpieces: int
    seed: int = 0
    speed: float | None = None
    disturbances: Iterable[Disturbance] = ()


@dataclass(frozen=True, slots=True)
class RunReport:
    """How a run ended: the workpieces by their identities, what was done for them, and the situation at the end.

    Firings, commands and messages are those since the run was begun or taken up; its trace has them all.
    """

    situation: Situation
    delivered: tuple[int, ...]
    inside: tuple[int, ...]
    lost: tuple[int, ...]
    doubled: tuple[int, ...]
    firings: Mapping[str, int]
    commands: int
    """How many commands the controllers issued, as the trace has them, whether or not machines took them."""
    messages: int
    decided: Mapping[str, int]
    """How many transitions each coordinator has committed."""
    simulated_seconds: float
    watched: bool = False
    """Whether the machines were held against their plant file, from the beginning to the end or to a divergence."""
    divergence: Divergence | None = None
    """The first thing that they did and could not have done, or did not and must have."""
    coalesced: Mapping[str, int] = field(default_factory=dict)
    """For each signal how many of its changes came faster than they were read, and were told to nobody."""
    begin_seconds: float = 0.0
    """When it was taken up, in the time of the run; 0 where it was begun."""

    @property
    def state(self) -> State:
        """How the run ended."""
        return self.situation.state

    def to_json(self) -> dict[str, Any]:
        """The report as JSON data."""
        return {
            "state": self.state.value,
            "message": self.situation.message,
            "marking": list(self.situation.marking),
            "blocked": [str(blocked) for blocked in self.situation.blocked],
            "delivered": list(self.delivered),
            "inside": list(self.inside),
            "lost": list(self.lost),
            "doubled": list(self.doubled),
            "firings": dict(self.firings),
            "commands": self.commands,
            "messages": self.messages,
            "decided": dict(self.decided),
            "coalesced": dict(self.coalesced),
            "simulated_seconds": self.simulated_seconds,
            "begin_seconds": self.begin_seconds,
            **({} if self.divergence is None else {"divergence": self.divergence.to_json()}),
        }


def load(path: Path | str, trust: Sequence[Path | str] = ()) -> Bundle:
    """Read a bundle that may run, signed by one of the public keys in the files of `trust`, where there are any.

    Raises `InputError` F5001 where it is changed, F5002 where it is not proved, F5023 where it is not signed.
    """
    bundle = read_bundle(path)
    if trust:
        from firable.nets.signing import demand_signature  # the extra `sign`, which only such a site needs

        demand_signature(bundle, path, trust)
    if problems := unproved(bundle):
        raise InputError(problems)
    return bundle


def run(
    bundle: Bundle,
    plant: PlantModel,
    *,
    workpieces: int,
    seed: int = 0,
    speed: float | None = None,
    trace_path: Path | str | None = None,
    overdue_seconds: float = 120.0,
    disturbances: Iterable[Disturbance] = (),
    operator: Operator | None = None,
    journal_path: Path | str | None = None,
    resume: bool = False,
    said: Mapping[str, Answer] | None = None,
    watch: Watch = Watch.TELL,
    service: Service | None = None,
    log: Log | None = None,
    tell: Told | None = None,
) -> RunReport:
    """Run a bundle on the simulated cell of a plant until `workpieces` workpieces have gone through.

    With a journal, a run whose process was killed is taken up where it was. It is held then, and ends at once as
    `State.HELD`, unless an operator is there, or `resume` says beforehand that it may go on as soon as each command is
    accounted for; `said` gives the operator's word on those that no machine can tell of, by place.

    The machines are held against their plant file as the run goes (`watch`). With a `service` an operator may act from
    elsewhere, in real time. A `log` is told what the trace notes, `tell` what an operator has to know.

    `speed` None is virtual time, 1.0 real time, 10.0 ten times as fast. A command that is not completed within
    `overdue_seconds` (of the cell's time) is a fault. Raises `InputError` F5002 where the bundle is not proved, F5003
    where the plant does not fit it, both before a file is touched; F1017 where the trace cannot be written, and F5031
    to F5035 where the journal or the simulated cell cannot be gone on with.
    """
    cell = SimulatedCell(plant, workpieces, seed, speed, disturbances)
    conduct = Conduct(
        trace=trace_path,
        journal_path=journal_path,
        resume=resume,
        said=said or {},
        watch=watch,
        overdue_seconds=overdue_seconds,
        operator=operator,
        service=service,
        log=log,
        tell=tell,
    )
    return run_simulated(bundle, cell, conduct)


def execute(
    decomposition: Decomposition,
    plant: PlantModel,
    *,
    workpieces: int,
    seed: int = 0,
    speed: float | None = None,
    trace: LineStream | Path | str | None = None,
    overdue_seconds: float = 120.0,
    disturbances: Iterable[Disturbance] = (),
    operator: Operator | None = None,
    journal_path: Path | str | None = None,
    digest: str = "",
    resume: bool = False,
    said: Mapping[str, Answer] | None = None,
    watch: Watch = Watch.TELL,
    service: Service | None = None,
    log: Log | None = None,
    tell: Told | None = None,
) -> RunReport:
    """Run a decomposition, proved or not, on the simulated cell of a plant; parameters as for `run`.

    `digest` names what runs, in the journal. Raises `InputError` F5003 where the plant does not fit the net.
    """
    cell = SimulatedCell(plant, workpieces, seed, speed, disturbances)
    conduct = Conduct(
        trace=trace,
        journal_path=journal_path,
        resume=resume,
        said=said or {},
        watch=watch,
        overdue_seconds=overdue_seconds,
        operator=operator,
        service=service,
        log=log,
        tell=tell,
    )
    _check(cell, conduct, decomposition.net)
    return _carry_through(decomposition, digest, cell, conduct)


def run_simulated(bundle: Bundle, cell: SimulatedCell, conduct: Conduct = UNATTENDED) -> RunReport:
    """Run a bundle on a simulated cell: `run`, with what it takes in two values."""
    # A run that is refused has touched no file.
    _check(cell, conduct, bundle.net, unproved(bundle))
    return _carry_through(bundle.decomposition, bundle.digest, cell, conduct)


def _carry_through(decomposition: Decomposition, digest: str, simulated: SimulatedCell, conduct: Conduct) -> RunReport:
    plant, workpieces, seed = simulated.plant, simulated.workpieces, simulated.seed
    cell = Plant(plant, workpieces=workpieces, seed=seed, disturbances=simulated.disturbances)
    net, kept = decomposition.net, (plant, workpieces, seed)
    with opened(decomposition, digest, conduct.journal_path, conduct.trace, simulated=kept) as files:
        figures = figures_for(net, conduct.service)
        driver = SimulatedDriver(cell, net, files.cell)
        host = Host(
            decomposition,
            driver,
            files.recorder,
            conduct,
            speed=1.0 if simulated.speed is None else simulated.speed,
            is_complete=lambda: len(cell.delivered) == workpieces,
            journal=files.journal,
            begin_seconds=files.begin_seconds,
            monitor=None if conduct.watch is Watch.IGNORE else Monitor(net, plant),
            figures=figures,
            latched=driver.latched,
        )
        if files.is_taken_up:
            host.unwatch()
        situation = run_to_the_end(host, figures, virtual=simulated.speed is None)
    delivered = tuple(workpiece.id for workpiece in cell.delivered)
    seen = Counter((*delivered, *cell.inside))
    return RunReport(
        situation,
        delivered,
        cell.inside,
        lost=tuple(i for i in range(1, cell.entered + 1) if i not in seen),
        doubled=tuple(sorted(i for i, times in seen.items() if times > 1)),
        firings=files.recorder.firings,
        commands=files.recorder.commands,
        messages=host.acts.messages,
        decided=_decided(decomposition, files.recorder.firings),
        simulated_seconds=host.now_seconds(),
        watched=host.is_watched,
        divergence=host.divergence,
        coalesced=host.coalesced.up_to_now(host.driver),
        begin_seconds=files.begin_seconds,
    )


def run_bound(
    bundle: Bundle, binding: Binding, conduct: Conduct = UNATTENDED, *, plant: PlantModel | None = None
) -> RunReport:
    """Run a bundle on the machines of a binding, in real time, until the operator stops it or nothing can go on.

    What workpieces there are is not to be known; the report counts none. Told, too, is of links that come and go, by
    device and sentence; the machines are watched where a `plant` says what they do.

    Raises `InputError` F5002 where the bundle is not proved, F5101 where the binding does not fit it, both before
    anything is connected; F5106 where another program commands a device, before anything is written; F1017 where the
    trace cannot be written, and F5031 to F5036 where the journal cannot be gone on with.
    """
    if problems := (*unproved(bundle), *(misfits(plant, bundle.net) if plant is not None else ())):
        raise InputError(problems)
    driver = bound_driver(binding, bundle.net)
    if conduct.journal_path is not None:
        refuse_taken_over(conduct.journal_path)
    listen_first(driver.binding)
    decomposition = bundle.decomposition
    with opened(decomposition, bundle.digest, conduct.journal_path, conduct.trace) as files:
        figures = figures_for(decomposition.net, conduct.service)
        host = Host(
            decomposition,
            driver,
            files.recorder,
            conduct,
            patience=patience_with(driver),
            journal=files.journal,
            begin_seconds=files.begin_seconds,
            monitor=None if plant is None or conduct.watch is Watch.IGNORE else Monitor(decomposition.net, plant),
            figures=figures,
            latched=lambda: bound_driver(binding, bundle.net, latched=True),
        )
        if files.is_taken_up:
            host.unwatch()
        situation = run_to_the_end(host, figures)
        recorder = files.recorder
    return RunReport(
        situation,
        (),
        (),
        (),
        (),
        recorder.firings,
        recorder.commands,
        host.acts.messages,
        _decided(decomposition, recorder.firings),
        host.now_seconds(),
        watched=host.is_watched,
        divergence=host.divergence,
        coalesced=host.coalesced.up_to_now(host.driver),
        begin_seconds=files.begin_seconds,
    )


def _decided(decomposition: Decomposition, firings: Mapping[str, int]) -> dict[str, int]:
    """How much each coordinator has decided: no other one can have fired what stands in its name."""
    layers = Layers(decomposition.net)
    of_each = Counter({layers.root: 0})
    for row in decomposition.coordinated:
        of_each[row.at or layers.root] += firings.get(row.name, 0)
    return {name: of_each[name] for name in (layers.root, *layers.coordinators()) if name in of_each}


def _check(cell: SimulatedCell, conduct: Conduct, net: Net, problems: Sequence[Diagnostic] = ()) -> None:
    if cell.workpieces < 0 or conduct.overdue_seconds <= 0 or (cell.speed is not None and cell.speed <= 0):
        raise ValueError("workpieces must not be negative, times and speed must be positive")
    if problems or (problems := misfits(cell.plant, net)):
        raise InputError(problems)
