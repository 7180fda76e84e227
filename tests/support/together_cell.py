"""A cell whose robot is watched by two sensors that change in one instant, and what nobody would see if they did so.

While the robot takes a workpiece, that lies at the entry or is in the hand: `lost` waits for neither. Where a
controller is told first that the entry is empty, and fires before it is told of the hand, it takes the workpiece for
lost.
"""

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net

NET = """\
firable: 1
cell: together
controllers:
  robot:
    start: [free, idle]
    inputs: [entry, holds]
    places:
      free:
      idle:
      watching:
      alarm:
      grasp:   {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped}
      to_exit: {send: {machine: R, command: MOVE,  to: EXIT},  until: there}
      put:     {send: {machine: R, command: PUT,   at: EXIT},  until: placed}
      back:    {send: {machine: R, command: MOVE,  to: ENTRY}, until: there}
transitions:
  come: {from: [robot.free, robot.idle], to: [robot.grasp, robot.watching], if: robot.entry}
  lost: {from: robot.watching, to: robot.alarm, unless: [robot.entry, robot.holds]}
  t1:   {from: [robot.grasp, robot.watching], to: [robot.to_exit, robot.idle]}
  t2:   {from: robot.to_exit, to: robot.put}
  t3:   {from: robot.put, to: robot.back}
  t4:   {from: robot.back, to: robot.free}
properties:
  never_lost: {never: robot.alarm}
"""
PLANT = """\
firable_plant: 1
plant: together
stations: [entry, exit]
arrivals:   {station: entry, every_s: 4}
departures: {station: exit, after_s: 1}
machines:
  R:
    hand: ENTRY
    positions: {ENTRY: entry, EXIT: exit}
    commands:
      MOVE:  {does: move,  takes_s: 1, may_fail: repairable}
      GRASP: {does: grasp, takes_s: 0.5}
      PUT:   {does: put,   takes_s: 0.5, when_full: wait}
sensors:
  robot.entry: {occupied: entry}
  robot.holds: {holding: R}
"""

BELT_NET = """\
firable: 1
cell: belts
controllers:
  belt:
    start: [rest, watch]
    inputs: [entry, on_it, table]
    places:
      rest:
      watch:
      seen:
      run:  {send: {machine: B, command: RUN}, until: there, within: {time: 9s, to: late}}
      halt: {send: {machine: B, command: HALT}}
      late:
transitions:
  go:    {from: belt.rest, to: belt.run, if: belt.entry}
  end:   {from: belt.run, to: belt.rest}
  stops: {from: belt.run, to: belt.halt, if: belt.on_it, unless: [belt.table, belt.there]}
  anew:  {from: belt.halt, to: belt.run, unless: belt.entry}
  again: {from: belt.late, to: belt.rest}
  see:   {from: belt.watch, to: belt.seen, if: [belt.table, belt.on_it]}
  other: {from: belt.seen, to: belt.watch, if: belt.entry, unless: [belt.table, belt.on_it]}
"""
BELT_PLANT = """\
firable_plant: 1
plant: belts
stations: [entry, table]
arrivals:   {station: entry, every_s: 4}
departures: {station: table, after_s: 1}
machines:
  B:
    commands:
      RUN:  {does: carry, from: entry, to: table, takes_s: 4, may_fail: repairable}
      HALT: {does: stop, takes_s: 1}
sensors:
  belt.entry: {occupied: entry}
  belt.on_it: {holding: B}
  belt.table: {occupied: table}
"""


def together(first: str = "entry") -> tuple[Net, PlantModel]:
    """The cell that takes a workpiece for lost; a simulated run is told of one sensor first."""
    *text, entry, holds = PLANT.splitlines()
    sensors = (entry, holds) if first == "entry" else (holds, entry)
    return parse_net(NET), parse_plant("\n".join((*text, *sensors, "")))


def belts(extra: str = "", plant: str = BELT_PLANT) -> tuple[Net, PlantModel]:
    """A cell whose sensors change with a command that is sent, too; something is added to the one at the entry."""
    return parse_net(BELT_NET), parse_plant(plant.replace("{occupied: entry}", f"{{occupied: entry{extra}}}"))
