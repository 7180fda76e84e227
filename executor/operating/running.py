"""Running a bundle on a cell: the way in for the command line and for programs.

A bundle is loaded only if it is unchanged (F5001) and everything that its net must prove is proved (F5002): the right
to run is checked where the run begins, not where the bundle was made. A bundle is run by `run_simulated`, by
`run_bound` or, on one host among others, by `hosting.run_host`. `execute` runs a decomposition without asking for that
right; it is for simulation and for tests, and no command offers it.

The simulated cell runs in virtual time unless a speed is given; then a run is a function of bundle, plant and seed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from firable.executor.cell.disturbances import Disturbance
from firable.executor.cell.plant import Plant
from firable.executor.drivers.binding import Binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.rivals import listen_first
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.journal.sqlite_journal import refuse_taken_over
from firable.executor.operating.conduct import UNATTENDED, Conduct, Watch
from firable.executor.operating.host import Host
from firable.executor.operating.monitor import Divergence, Monitor
from firable.executor.operating.service import (
    demand_address,
    demand_no_loop,
    figures_for,
    patience_with,
    run_to_the_end,
)
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.taken_up import Files, opened
from firable.executor.operating.whereabouts import machines_at
from firable.nets.bundle import Bundle, read_bundle
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.layers import Layers
from firable.nets.machines.fitting import misfits
from firable.nets.machines.plant_file import PlantModel
from firable.nets.right_to_run import unproved

Operator = Callable[[Host], Awaitable[None]]
"""A coroutine that runs beside the cell and uses its controls."""


@dataclass(frozen=True, slots=True)
class SimulatedCell:
    """The cell that stands in the place of machines, what goes through it and how fast."""

    plant: PlantModel
    workpieces: int
    seed: int = 0
    speed: float | None = None
    """None is virtual time, 1.0 real time, 10.0 ten times as fast."""
    disturbances: Iterable[Disturbance] = ()

    @property
    def going_through(self) -> int:
        """How many workpieces are to go through the cell: those that will come, and those that are there at first."""
        return self.workpieces + len(self.plant.full_at_first)


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


def run_simulated(bundle: Bundle, cell: SimulatedCell, conduct: Conduct = UNATTENDED) -> RunReport:
    """Run a bundle on a simulated cell until its workpieces have gone through.

    With a journal, a run whose process was killed is taken up where it was. It is held then, and ends at once as
    `State.HELD`, unless an operator is there, or `resume` says beforehand that it may go on as soon as each command is
    accounted for. The machines are held against their plant file as the run goes (`watch`).

    Raises `InputError` F5002 where the bundle is not proved, F5003 where the plant does not fit it, F5061 where the
    address of the service is taken, and `RuntimeError` within an event loop, all before a file is touched; F1017 where
    the trace cannot be written, and F5031 to F5035 where the journal or the simulated cell cannot be gone on with.
    """
    if problems := unproved(bundle):
        raise InputError(problems)
    return execute(bundle.decomposition, cell, conduct, digest=bundle.digest)


def execute(
    decomposition: Decomposition, cell: SimulatedCell, conduct: Conduct = UNATTENDED, *, digest: str = ""
) -> RunReport:
    """Run a decomposition, proved or not, on a simulated cell: as `run_simulated` does, which asks for F5002 besides.

    `digest` names what runs, in the journal. Raises `ValueError` where a number of `cell` or `conduct` makes no sense.
    """
    demand_no_loop()
    if cell.workpieces < 0 or conduct.overdue_seconds <= 0 or (cell.speed is not None and cell.speed <= 0):
        raise ValueError("workpieces must not be negative, times and speed must be positive")
    net = decomposition.net
    if problems := misfits(cell.plant, net):
        raise InputError(problems)
    demand_address(conduct.service)
    plant = Plant(cell.plant, workpieces=cell.workpieces, seed=cell.seed, disturbances=cell.disturbances)
    kept = (cell.plant, cell.workpieces, cell.seed)
    with opened(decomposition, digest, conduct.journal_path, conduct.trace, simulated=kept) as files:
        driver = SimulatedDriver(plant, net, files.cell)
        host = Host(
            decomposition,
            driver,
            files.recorder,
            conduct,
            speed=1.0 if cell.speed is None else cell.speed,
            is_complete=lambda: len(plant.delivered) == cell.going_through,
            cell=plant,
            journal=files.journal,
            begin_seconds=files.begin_seconds,
            monitor=None if conduct.watch is Watch.IGNORE else Monitor(net, cell.plant),
            figures=figures_for(net, conduct.service),
            latched=driver.latched,
        )
        report = _run_whole(host, files, virtual=cell.speed is None)
    delivered = tuple(workpiece.id for workpiece in plant.delivered)
    seen = Counter((*delivered, *plant.inside))
    lost = tuple(i for i in range(1, plant.entered + 1) if i not in seen)
    doubled = tuple(sorted(i for i, times in seen.items() if times > 1))
    return replace(report, delivered=delivered, inside=plant.inside, lost=lost, doubled=doubled)


def run_bound(
    bundle: Bundle, binding: Binding, conduct: Conduct = UNATTENDED, *, plant: PlantModel | None = None
) -> RunReport:
    """Run a bundle on the machines of a binding, in real time, until the operator stops it or nothing can go on.

    What workpieces there are is not to be known; the report counts none. Told, too, is of links that come and go, by
    device and sentence; the machines are watched where a `plant` says what they do.

    Raises `InputError` F5002 where the bundle is not proved, F5003 where the plant does not fit it, F5101 where the
    binding does not, F5061 where the address of the service is taken, and `RuntimeError` within an event loop, all
    before anything is connected; F5106 where another program commands a device, before anything is written; F1017 where
    the trace cannot be written, and F5031 to F5036 where the journal cannot be gone on with.
    """
    demand_no_loop()
    net, decomposition = bundle.net, bundle.decomposition
    if problems := (*unproved(bundle), *(misfits(plant, net) if plant is not None else ())):
        raise InputError(problems)
    driver = bound_driver(binding, net)
    demand_address(conduct.service)
    if conduct.journal_path is not None:
        refuse_taken_over(conduct.journal_path)
    listen_first(driver.binding)
    at = machines_at(driver.binding, net)
    with opened(decomposition, bundle.digest, conduct.journal_path, conduct.trace, at=at) as files:
        host = Host(
            decomposition,
            driver,
            files.recorder,
            conduct,
            patience=patience_with(driver),
            journal=files.journal,
            begin_seconds=files.begin_seconds,
            monitor=None if plant is None or conduct.watch is Watch.IGNORE else Monitor(net, plant),
            figures=figures_for(net, conduct.service),
            latched=partial(bound_driver, binding, net, latched=True),
            elsewhere=files.elsewhere,
        )
        return _run_whole(host, files)


def _run_whole(host: Host, files: Files, *, virtual: bool = False) -> RunReport:
    """Run a whole cell to its end; what workpieces there were is not known here."""
    if files.is_taken_up:
        host.unwatch()
    situation, firings = run_to_the_end(host, virtual=virtual), files.recorder.firings
    return RunReport(
        situation,
        delivered=(),
        inside=(),
        lost=(),
        doubled=(),
        firings=firings,
        commands=files.recorder.commands,
        messages=host.acts.messages,
        decided=_decided(host.decomposition, firings),
        simulated_seconds=host.now_seconds(),
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
