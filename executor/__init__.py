"""Executing a decomposition: local controllers, their coordinator, drivers, the simulated cell.

What a program imports from here: `load` reads a bundle that may run, `read_plant` the file of a simulated cell, and
`run_simulated` carries workpieces through such a `SimulatedCell` and returns a `RunReport`, whose `Situation` has a
`State` and says with `Blocked` what waits for what. `execute` runs a decomposition that need not be proved, for
simulation and tests. A `Conduct` says how a run is conducted: an `Operator` beside it is given its `Host`, with the
controls pause, step, resume and stop; an `Answer` says what became of a command, of a run that is taken up from its
journal; `Watch` what is done where machines are not as they are modelled. `StuckSensor`, `NeverCompletes` and `Drops`
disturb the cell. Other machines than simulated ones are reached by a `Driver`.

    from firable.executor import SimulatedCell, load, read_plant, run_simulated

    report = run_simulated(load("cell.bundle"), SimulatedCell(read_plant("cell.plant.yaml"), workpieces=10))

The voting protocol (`coordinator`, `controller`, `messages`) is pure: no clock, socket, task or random source. The room
imports `semantics` and `nets` and nothing that proves.
"""

from firable.executor.cell.disturbances import Disturbance, Drops, NeverCompletes, StuckSensor
from firable.executor.drivers.driver import Driver
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.host import Host
from firable.executor.operating.running import Operator, RunReport, SimulatedCell, execute, load, run_simulated
from firable.executor.operating.situation import Blocked, Situation, State
from firable.executor.protocol.commands import Answer
from firable.nets.machines.plant_file import PlantModel, read_plant

__all__ = [
    "Answer",
    "Blocked",
    "Conduct",
    "Disturbance",
    "Driver",
    "Drops",
    "Host",
    "NeverCompletes",
    "Operator",
    "PlantModel",
    "RunReport",
    "SimulatedCell",
    "Situation",
    "State",
    "StuckSensor",
    "Watch",
    "execute",
    "load",
    "read_plant",
    "run_simulated",
]
