"""In which order a driver tells what it sees together: sensors, then the completions that are formed with sensors."""

from importlib.metadata import EntryPoint

import pytest

from firable.executor.cell.plant import CommandDone, Plant, SensorChanged
from firable.executor.drivers import kinds
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.simulated import SimulatedDriver
from firable.nets.machines.plant_file import parse_plant
from firable.nets.text import parse_net

NET = parse_net("""
firable: 1
cell: arm
controllers:
  a:
    start: home
    inputs: there
    places: {home: , away: {send: {machine: A, command: GRASP, at: P}, until: held}}
transitions:
  go:   {from: a.home, to: a.away, if: a.there}
  back: {from: a.away, to: a.home}
""")
PLANT = parse_plant("""
firable_plant: 1
plant: arm
stations: [p, q]
arrivals: {station: p, every_s: 9}
departures: {station: q}
machines: {A: {hand: P, positions: {P: p}, commands: {GRASP: {does: grasp, takes_s: 1}}}}
sensors:
  a.held:  {holding: A}
  a.there: {occupied: p}
""")
BINDING = """
firable_bind: 1
cell: arm
devices:
  far: {driver: theirs, memory: far, channels: {A: {command: out, taken: in, done: ok}}}
signals:
  a.held:  {device: far, read: held}
  a.there: {device: far, read: there}
commands: {a.away: {device: far, channel: A}}
"""


class Listener:
    """Whom a driver tells, and in which order."""

    def __init__(self) -> None:
        self.told: list[tuple[str, int | None]] = []

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        assert value
        self.told.append((name, entry))

    def taken(self, place: str, entry: int) -> None:
        """It does not matter here."""

    def driver_fault(self, machine: str, message: str) -> None:
        pytest.fail(f"{machine}: {message}")

    def driver_note(self, machine: str, message: str) -> None:
        """It does not matter here."""

    def emergency_stop(self, reason: str) -> None:
        pytest.fail(reason)

    def all_told(self) -> None:
        """It does not matter here."""

    def moved(self) -> None:
        """It does not matter here."""


def test_a_simulated_cell_forms_completions_behind_what_other_sensors_show() -> None:
    """The machine was done before its sensor showed that; the sensor stands first in the plant file."""
    driver, listener = SimulatedDriver(Plant(PLANT, workpieces=1), NET), Listener()
    driver.listener = listener
    driver.completions.commanded("a.held", 1)
    driver.completions.acknowledged("a.held", 1)
    driver._tell(0.0, [SensorChanged("a.held", True), SensorChanged("a.there", True)])
    assert listener.told == [("a.there", None), ("a.held", 1)]


def test_a_simulated_cell_tells_of_one_thing_after_the_other() -> None:
    """What happens behind an acknowledgement is not told before it."""
    driver, listener = SimulatedDriver(Plant(PLANT, workpieces=1), NET), Listener()
    driver.listener = listener
    driver.completions.commanded("a.held", 1)
    driver.tickets[7] = (NET.place("a.away"), 1)
    driver._tell(0.0, [SensorChanged("a.held", True), CommandDone(7), SensorChanged("a.there", True)])
    assert listener.told == [("a.held", 1), ("a.there", None)]


def test_a_device_forms_completions_behind_what_other_sensors_show(monkeypatch: pytest.MonkeyPatch) -> None:
    one = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [one])
    driver, listener = bound_driver(parse_binding(BINDING), NET), Listener()
    driver.listener = listener
    driver.completions.commanded("a.held", 1)
    driver.completions.acknowledged("a.held", 1)
    driver.devices["far"].read([("held", True), ("there", True)])
    assert listener.told == [("a.there", None), ("a.held", 1)]
