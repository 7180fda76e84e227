"""Cells in which something else happens while a controller is told one thing after the other."""

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net

IN_BETWEEN = """firable: 1
cell: carrying
controllers:
  belt:
    start: [ready, looking]
    inputs: [key, waits, carries, lies]
    places:
      ready:
      running: {send: {machine: B, command: RUN}, until: carried}
      still:
      looking:
      seen:
      spinning: {send: {machine: M, command: SPIN}}
transitions:
  run:  {from: belt.ready, to: belt.running, if: belt.waits}
  end:  {from: belt.running, to: belt.still}
  see:  {from: belt.looking, to: belt.seen, if: [belt.carries, belt.lies], unless: belt.key}
  spin: {from: belt.seen, to: belt.spinning, if: [belt.carries, belt.lies, belt.key]}
"""
CARRIED_ONCE = """firable_plant: 1
plant: carrying
stations: [entry, table]
arrivals:   {station: entry, every_s: 5}
departures: {station: table, raw: true}
machines:
  B: {commands: {RUN:  {does: carry, from: entry, to: table, takes_s: 1}}}
  M: {commands: {SPIN: {does: process, station: table, takes_s: 1}}}
sensors:
  belt.key:     {set_by: operator}
  belt.waits:   {occupied: entry}
  belt.carries: {holding: B}
  belt.lies:    {occupied: table}
"""


def in_between(key: str) -> tuple[Net, PlantModel]:
    """A machine is started where nothing is clamped when the key changes between two signals of the belt."""
    return parse_net(IN_BETWEEN), parse_plant(CARRIED_ONCE.replace("{set_by: operator}", key))


def beside() -> tuple[Net, PlantModel]:
    """What changes in between is that another machine is done with its work."""
    text = IN_BETWEEN.replace("start: [ready, looking]", "start: [ready, looking, rest]").replace("[key, ", "[")
    text = text.replace(
        "      seen:\n", "      seen:\n      rest:\n      working: {send: {machine: W, command: WORK}, until: key}\n"
    )
    text += "  work: {from: belt.rest, to: belt.working, if: belt.waits}\n"
    plant = CARRIED_ONCE.replace("  belt.key:     {set_by: operator}\n", "")
    return parse_net(text), parse_plant(
        plant.replace("machines:\n", "machines:\n  W: {commands: {WORK: {does: work, takes_s: 1}}}\n")
    )


BLIND_NET = """firable: 1
cell: blind
controllers:
  robot:
    start: free
    inputs: [part_there, reset]
    places:
      free:
      to_table:  {send: {machine: R, command: MOVE, to: TABLE}, until: arrived}
      grasp:     {send: {machine: R, command: GRASP, at: TABLE}, until: grasped}
      to_exit:   {send: {machine: R, command: MOVE, to: EXIT}, until: arrived}
      put:       {send: {machine: R, command: PUT, at: EXIT}, until: laid_down, within: 2s}
      put_fault: {send: {machine: R, command: STOP}}
transitions:
  start:   {from: robot.free, to: robot.to_table, if: robot.part_there}
  grip:    {from: robot.to_table, to: robot.grasp}
  carry:   {from: robot.grasp, to: robot.to_exit}
  release: {from: robot.to_exit, to: robot.put}
  again:   {from: robot.put_fault, to: robot.put, if: robot.reset}
  end:     {from: robot.put, to: robot.free}
"""
BLIND_PLANT = """firable_plant: 1
plant: blind
stations: [table, exit]
arrivals:   {station: table, every_s: 5}
departures: {station: exit, after_s: 1, raw: true}
machines:
  R:
    hand: EXIT
    positions: {TABLE: table, EXIT: exit}
    commands:
      MOVE:  {does: move,  takes_s: 1.0}
      GRASP: {does: grasp, takes_s: 0.5}
      PUT:   {does: put,   takes_s: 0.5, when_full: wait}
      STOP:  {does: stop}
sensors:
  robot.part_there: {occupied: table}
  robot.reset:      {set_by: operator}
"""


def blind() -> tuple[Net, PlantModel]:
    """A robot without a sensor in its hand that is told to put anew when the time was over."""
    return parse_net(BLIND_NET), parse_plant(BLIND_PLANT)


BY_SENSORS_NET = """firable: 1
cell: sensors
controllers:
  belt:
    start: rest
    inputs: [entry, middle, exit]
    places:
      rest:
      feed: {send: {machine: A, command: RUN}}
      run:  {send: {machine: B, command: RUN}}
      odd:
transitions:
  first: {from: belt.rest, to: belt.feed, if: belt.entry}
  go:    {from: belt.feed, to: belt.run, if: belt.middle}
  both:  {from: belt.run, to: belt.odd, if: [belt.middle, belt.exit]}
"""
BY_SENSORS_PLANT = """firable_plant: 1
plant: sensors
stations: [entry, middle, exit]
arrivals:   {station: entry, every_s: 4}
departures: {station: exit, after_s: 1}
machines:
  A: {commands: {RUN: {does: carry, from: entry, to: middle, takes_s: 4}}}
  B: {commands: {RUN: {does: carry, from: middle, to: exit,  takes_s: 4}}}
sensors:
  belt.entry:  {occupied: entry}
  belt.middle: {occupied: middle}
  belt.exit:   {occupied: exit}
"""


def by_sensors() -> tuple[Net, PlantModel]:
    """Belts that run by sensors alone: what one has taken away is not seen any more when it has carried it."""
    return parse_net(BY_SENSORS_NET + "properties:\n  never_odd: {never: belt.odd}\n"), parse_plant(BY_SENSORS_PLANT)
