"""A robot, a machine and a belt at three stations, simulated, with a clock that a test sets."""

from firable.executor.cell.disturbances import Disturbance
from firable.executor.cell.plant import Plant, PlantFault, PlantReport
from firable.nets.machines.plant_file import PlantModel, parse_plant

TEXT = """\
firable_plant: 1
plant: bench
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 5}
departures: {station: exit, after_s: 1}
machines:
  R:
    hand: HOME
    positions: {HOME: , ENTRY: entry, TABLE: table, EXIT: exit}
    commands:
      MOVE:  {does: move, takes_s: 2}
      GRASP: {does: grasp, takes_s: 1}
      PUT:   {does: put, takes_s: 1}
      HOLD:  {does: put, takes_s: 1, when_full: wait}
  M:
    commands:
      CLAMP:   {does: clamp, station: table, takes_s: 1}
      RUN:     {does: process, station: table, takes_s: 3}
      UNCLAMP: {does: release, station: table, takes_s: 1}
  B:
    commands:
      RUN:  {does: carry, from: entry, to: table, takes_s: 4}
      STOP: {does: stop}
sensors:
  entry: {occupied: entry}
  hand:  {holding: R}
"""


def model(text: str = TEXT) -> PlantModel:
    return parse_plant(text)


class Bench:
    """A plant with a clock; commands run to their end unless told otherwise."""

    def __init__(self, *disturbances: Disturbance, workpieces: int = 2, text: str = TEXT, seed: int = 0) -> None:
        self.plant = Plant(model(text), workpieces=workpieces, seed=seed, disturbances=disturbances)
        self.now = 0.0
        self.reports: list[PlantReport] = self.plant.advance(0.0)
        self.tickets = 0

    def give(self, machine: str, command: str, **parameters: str) -> list[PlantReport]:
        self.tickets += 1
        reports = self.plant.command(self.now, machine, command, parameters, self.tickets)
        self.reports += reports
        return reports

    def wait(self, seconds: float) -> list[PlantReport]:
        self.now += seconds
        reports = self.plant.advance(self.now)
        self.reports += reports
        return reports

    def do(self, machine: str, command: str, **parameters: str) -> list[PlantReport]:
        return [*self.give(machine, command, **parameters), *self.wait(4.0)]

    def fetch(self) -> None:
        self.do("R", "MOVE", to="ENTRY")
        self.do("R", "GRASP", at="ENTRY")

    def load(self) -> None:
        self.fetch()
        self.do("R", "MOVE", to="TABLE")
        self.do("R", "PUT", at="TABLE")

    @property
    def faults(self) -> list[str]:
        return [report.message for report in self.reports if isinstance(report, PlantFault)]
