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


DONE_NET = """firable: 1
cell: done
controllers:
  robot:
    start: [free, watching]
    inputs: [entry, holds]
    places:
      free:
      grasp: {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped}
      gone:
      watching:
      alarm:
      odd:
transitions:
  come: {from: robot.free, to: robot.grasp, if: robot.entry}
  lost: {from: robot.watching, to: robot.alarm, unless: [robot.entry, robot.holds]}
  end:  {from: robot.grasp, to: robot.gone, if: robot.holds}
  odd:  {from: robot.grasp, to: robot.odd, unless: robot.holds}
properties:
  never_odd: {never: robot.odd}
"""
HAND = """firable_plant: 1
plant: CELL
stations: [entry, exit]
arrivals:   {station: entry, every_s: 5}
departures: {station: exit, after_s: 1}
machines:
  R:
    hand: ENTRY
    positions: {ENTRY: entry}
    commands:
      GRASP: {does: grasp, takes_s: 1}
      STOP:  {does: stop}
sensors:
  robot.entry: {occupied: entry}
  robot.holds: {holding: R}
"""


def done() -> tuple[Net, PlantModel]:
    """A robot that would miss the workpiece in its hand if it was told first that it has grasped it."""
    return parse_net(DONE_NET), parse_plant(HAND.replace("CELL", "done"))


def done_when_the_next_has_come() -> tuple[Net, PlantModel]:
    """The same robot, which has grasped one when the next workpiece lies there: a sensor shows the completion."""
    plant = f"{HAND.replace('CELL', 'done')}  robot.next:  {{occupied: entry}}\n"
    return parse_net(DONE_NET.replace("until: grasped", "until: next")), parse_plant(plant)


AT_REST_NET = """firable: 1
cell: rests
controllers:
  robot:
    start: rest
    inputs: [entry, holds]
    places:
      rest:
      grasp: {send: {machine: R, command: GRASP, at: ENTRY}}
      halt:  {send: {machine: R, command: STOP}, until: at_rest}
      empty:
      odd:
transitions:
  come:  {from: robot.rest, to: robot.grasp, if: robot.entry}
  stops: {from: robot.grasp, to: robot.halt}
  empty: {from: robot.halt, to: robot.empty, unless: robot.holds}
  odd:   {from: robot.empty, to: robot.odd, if: robot.holds}
properties:
  never_odd: {never: robot.odd}
"""


def at_rest() -> tuple[Net, PlantModel]:
    """A robot that is stopped, and looks into its hand when it has come to rest."""
    return parse_net(AT_REST_NET), parse_plant(HAND.replace("CELL", "rests"))


JUDGED_NET = """firable: 1
cell: judged
controllers:
  belt:
    start: [ready, watching]
    inputs: [waits, lies, good]
    places:
      ready:
      running: {send: {machine: B, command: RUN}}
      watching:
      odd:
transitions:
  run: {from: belt.ready, to: belt.running, if: belt.waits}
  odd: {from: belt.watching, to: belt.odd, if: belt.good, unless: belt.lies}
properties:
  never_odd: {never: belt.odd}
"""
JUDGED_PLANT = """firable_plant: 1
plant: judged
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 5}
departures: {station: exit}
machines:
  B: {commands: {RUN: {does: carry, from: entry, to: table, takes_s: 1}}}
sensors:
  belt.waits: {occupied: entry}
  belt.lies:  {occupied: table}
  belt.good:  {passes: table}
"""


BOTH_NET = """firable: 1
cell: judged
controllers:
  eye: {start: rest, inputs: [good, bad], places: {rest: , odd: }}
transitions:
  odd: {from: eye.rest, to: eye.odd, if: [eye.good, eye.bad]}
properties:
  never_odd: {never: eye.odd}
"""
BOTH_PLANT = """firable_plant: 1
plant: judged
stations: [entry]
arrivals:   {station: entry, every_s: 5}
departures: {station: entry}
machines: {}
sensors:
  eye.good: {passes: entry}
  eye.bad:  {fails: entry}
"""


def both() -> tuple[Net, PlantModel]:
    """Who finds a workpiece good and bad at once, of which one came behind the other."""
    return parse_net(BOTH_NET), parse_plant(BOTH_PLANT)


def judged() -> tuple[Net, PlantModel]:
    """A camera that finds a workpiece good which stays where a belt has carried it."""
    return parse_net(JUDGED_NET), parse_plant(JUDGED_PLANT)


TIMED_OUT_NET = """firable: 1
cell: again
controllers:
  robot:
    start: free
    inputs: [entry, holds]
    places:
      free:
      grasp:       {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped, within: 2s}
      grasp_fault: {send: {machine: R, command: STOP}}
      have:
transitions:
  come:  {from: robot.free, to: robot.grasp, if: robot.entry}
  again: {from: robot.grasp_fault, to: robot.grasp, unless: robot.holds}
  end:   {from: robot.grasp, to: robot.have}
"""
MIXED_UP_NET = """firable: 1
cell: again
controllers:
  robot:
    start: [free, ready]
    inputs: [entry, holds]
    places:
      free:
      ready:
      grasp: {send: {machine: R, command: GRASP, at: ENTRY}, until: finished}
      work:  {send: {machine: W, command: WORK}, until: finished}
      missed:
      worked:
transitions:
  come:  {from: [robot.free, robot.ready], to: [robot.grasp, robot.work], if: robot.entry}
  miss:  {from: robot.grasp, to: robot.missed}
  again: {from: robot.missed, to: robot.grasp, unless: robot.holds}
  end:   {from: robot.work, to: robot.worked}
"""


def timed_out() -> tuple[Net, PlantModel]:
    """A robot that grasps anew when the time is over and its hand seems to be empty."""
    return parse_net(TIMED_OUT_NET), parse_plant(HAND.replace("CELL", "again"))


def mixed_up() -> tuple[Net, PlantModel]:
    """A robot that grasps anew when another machine has said that it has finished and its hand seems to be empty."""
    plant = HAND.replace("machines:\n", "machines:\n  W: {commands: {WORK: {does: work, takes_s: 1}}}\n")
    return parse_net(MIXED_UP_NET), parse_plant(plant.replace("CELL", "again"))


OVERDUE_NET = """firable: 1
cell: overdue
controllers:
  robot:
    start: [free, watching]
    inputs: [entry, holds]
    places:
      free:
      grasp:       {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped, within: 2s}
      grasp_fault: {send: {machine: R, command: STOP}}
      have:
      watching:
      in_time:
      odd:
transitions:
  come:  {from: robot.free, to: robot.grasp, if: robot.entry}
  end:   {from: robot.grasp, to: robot.have}
  early: {from: robot.watching, to: robot.in_time, if: [robot.grasp, robot.holds], unless: robot.grasp_overdue}
  odd:   {from: robot.in_time, to: robot.odd, if: [robot.grasp, robot.grasp_overdue]}
properties:
  never_odd: {never: robot.odd}
"""


def overdue() -> tuple[Net, PlantModel]:
    """A robot that sees the workpiece in its hand in time, and is told too late that it has grasped it."""
    return parse_net(OVERDUE_NET), parse_plant(HAND.replace("CELL", "overdue"))


TRIED_AGAIN_NET = """firable: 1
cell: again
controllers:
  robot:
    start: free
    inputs: entry
    places:
      free:
      move:       {send: {machine: R, command: MOVE, to: ENTRY}, until: there, within: 2s}
      move_fault: {send: {machine: R, command: STOP}}
      have:
transitions:
  come:  {from: robot.free, to: robot.move}
  again: {from: robot.move_fault, to: robot.move}
  end:   {from: robot.move, to: robot.have}
properties:
  gets_there: {leads_to: {from: robot.move, to: robot.have, fairness: strong}}
"""


def tried_again() -> tuple[Net, PlantModel]:
    """A robot that moves anew whenever the time is over."""
    plant = HAND.replace("GRASP: {does: grasp, ", "MOVE:  {does: move,  ").replace("  robot.holds: {holding: R}\n", "")
    return parse_net(TRIED_AGAIN_NET), parse_plant(plant.replace("CELL", "again"))


TESTED_NET = """firable: 1
cell: tested
controllers:
  robot:
    start: [free, watching]
    inputs: lies
    places:
      free:
      grasp: {send: {machine: R, command: GRASP, at: TABLE}, until: good}
      watching:
      saw:
transitions:
  come:  {from: robot.free, to: robot.grasp, if: robot.lies}
  end:   {from: robot.grasp, to: robot.free}
  watch: {from: robot.watching, to: robot.saw, unless: robot.good}
  back:  {from: robot.saw, to: robot.watching}
"""
TESTED_PLANT = """firable_plant: 1
plant: tested
stations: [table]
arrivals:   {station: table, every_s: 5}
departures: {station: table}
machines:
  R: {hand: TABLE, positions: {TABLE: table}, commands: {GRASP: {does: grasp, takes_s: 1}}}
sensors:
  robot.lies: {occupied: table}
  robot.good: {passes: table}
"""


def found_good() -> tuple[Net, PlantModel]:
    """A robot that is done with one workpiece when the next one was found good."""
    return parse_net(TESTED_NET), parse_plant(TESTED_PLANT)


TWICE_NET = """firable: 1
cell: twice
controllers:
  belt:
    start: [rest, calm]
    inputs: entry
    places:
      rest:
      run:  {send: {machine: B, command: RUN}}
      halt: {send: {machine: B, command: STOP}, until: at_rest}
      calm:
      seen:
transitions:
  go:  {from: belt.rest, to: [belt.run, belt.halt], if: belt.entry}
  see: {from: belt.calm, to: belt.seen, if: belt.entry}
"""
TWICE_PLANT = """firable_plant: 1
plant: twice
stations: [entry, exit]
arrivals:   {station: entry, every_s: 5}
departures: {station: exit, raw: true}
machines:
  B: {commands: {RUN: {does: carry, from: entry, to: exit, takes_s: 4}, STOP: {does: stop}}}
sensors:
  belt.entry: {occupied: entry}
"""


def twice() -> tuple[Net, PlantModel]:
    """A belt is started and stopped in one firing, and takes its workpiece before a controller is told."""
    return parse_net(TWICE_NET), parse_plant(TWICE_PLANT)


BOUNCING_NET = """firable: 1
cell: bouncing
controllers:
  belt:
    start: [rest, watch]
    inputs: entry
    places:
      rest:
      run:  {send: {machine: B, command: RUN}}
      watch:
      gone:
      more: {send: {machine: A, command: RUN}}
transitions:
  go:   {from: belt.rest, to: belt.run, if: belt.entry}
  left: {from: belt.watch, to: belt.gone, if: belt.run, unless: belt.entry}
  next: {from: belt.gone, to: belt.more, if: belt.entry}
"""
BOUNCING_PLANT = """firable_plant: 1
plant: bouncing
stations: [entry, left, right]
arrivals:   {station: entry, every_s: 5}
departures: {station: left, raw: true}
machines:
  A: {commands: {RUN: {does: carry, from: entry, to: left, takes_s: 4, when_full: wait}}}
  B: {commands: {RUN: {does: carry, from: entry, to: right, takes_s: 4, when_full: wait}}}
sensors:
  belt.entry: {occupied: entry}
"""


def bouncing(extra: str = ", may_flicker: true") -> tuple[Net, PlantModel]:
    """A belt is told to carry the next workpiece when a sensor comes back, which has flickered as the last one went."""
    plant = BOUNCING_PLANT.replace("{occupied: entry}", f"{{occupied: entry{extra}}}")
    return parse_net(BOUNCING_NET), parse_plant(plant)


LEAVING_NET = """firable: 1
cell: leaving
controllers:
  belt:
    start: [rest, calm]
    inputs: [entry, exit]
    places:
      rest:
      first:  {send: {machine: B, command: RUN}, until: carried}
      second: {send: {machine: B, command: RUN}, until: carried}
      wait:
      third:  {send: {machine: A, command: RUN}, until: brought}
      calm:
      seen:
transitions:
  go:   {from: belt.rest, to: belt.first, if: belt.entry}
  more: {from: belt.first, to: belt.second, if: belt.entry}
  end:  {from: belt.second, to: belt.wait}
  last: {from: belt.wait, to: belt.third, if: belt.entry, unless: belt.exit}
  see:  {from: belt.calm, to: belt.seen, if: belt.exit}
"""
LEAVING_PLANT = """firable_plant: 1
plant: leaving
stations: [entry, exit]
arrivals:   {station: entry, every_s: 5}
departures: {station: exit, raw: true}
machines:
  A: {commands: {RUN: {does: carry, from: entry, to: exit, takes_s: 4}}}
  B: {commands: {RUN: {does: carry, from: entry, to: exit, takes_s: 4, when_full: wait}}}
sensors:
  belt.entry: {occupied: entry}
  belt.exit:  {occupied: exit}
"""


def leaving() -> tuple[Net, PlantModel]:
    """A workpiece leaves, and the next one is laid down, before a controller is told of the one or the other."""
    return parse_net(LEAVING_NET), parse_plant(LEAVING_PLANT)


FORMED_NET = """firable: 1
cell: shown
controllers:
  robot:
    start: [free, ready, w0]
    inputs: [in, entry, holds]
    places:
      free:
      grasp: {send: {machine: R, command: GRASP, at: ENTRY}, until: seen}
      gone:
      ready:
      first: {send: {machine: A, command: RUN}, until: brought}
      second: {send: {machine: A, command: RUN}}
      w0:
      w1:
      w2:
      w3:
transitions:
  feed: {from: robot.ready, to: robot.first, if: robot.in}
  more: {from: robot.first, to: robot.second, if: robot.in}
  come: {from: robot.free, to: robot.grasp, if: [robot.entry, robot.second]}
  o1:   {from: robot.w0, to: robot.w1, if: robot.grasp, unless: [robot.entry, robot.holds]}
  o2:   {from: robot.w1, to: robot.w2, if: robot.entry, unless: robot.holds}
  o3:   {from: robot.w2, to: robot.w3, unless: [robot.entry, robot.holds]}
  end:  {from: [robot.grasp, robot.w3], to: robot.gone}
"""
FORMED_PLANT = """firable_plant: 1
plant: shown
stations: [in, entry]
arrivals:   {station: in, every_s: 5}
departures: {station: entry, raw: true}
machines:
  R: {hand: ENTRY, positions: {ENTRY: entry}, commands: {GRASP: {does: grasp, takes_s: 1}}}
  A: {commands: {RUN: {does: carry, from: in, to: entry, takes_s: 1, when_full: wait}}}
sensors:
  robot.in:     {occupied: in}
  robot.entry:  {occupied: entry}
  robot.holds:  {holding: R}
  robot.seen:   {occupied: entry}
"""


def formed() -> tuple[Net, PlantModel]:
    """A completion that its sensor forms while another one that sees the grip is still to be told of, and that goes on
    when the workpiece has gone again."""
    return parse_net(FORMED_NET), parse_plant(FORMED_PLANT)
