"""Cells that fire on what a sensor showed a moment ago, and could not have fired before it changed."""

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net

CARRIED_NET = """\
firable: 1
cell: carried
controllers:
  belt:
    start: rest
    inputs: [entry, table]
    places:
      rest:
      bring: {send: {machine: A, command: RUN}, until: brought}
      take:  {send: {machine: B, command: RUN}, until: taken}
      watch:
      alarm:
transitions:
  come:  {from: belt.rest, to: belt.bring, if: belt.entry}
  go:    {from: belt.bring, to: [belt.take, belt.watch]}
  end:   {from: [belt.take, belt.watch], to: belt.rest}
  still: {from: belt.watch, to: belt.alarm, if: belt.table}
properties:
  never_alarm: {never: belt.alarm}
"""
CARRIED_PLANT = """\
firable_plant: 1
plant: carried
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 4}
departures: {station: exit, after_s: 1}
machines:
  A: {commands: {RUN: {does: carry, from: entry, to: table, takes_s: 4}}}
  B: {commands: {RUN: {does: carry, from: table, to: exit, takes_s: 4, when_full: wait}}}
sensors:
  belt.entry: {occupied: entry}
  belt.table: {occupied: table}
"""
STOPPED_NET = """\
firable: 1
cell: stopped
controllers:
  robot:
    start: rest
    inputs: [entry, holds]
    places:
      rest:
      work:  {send: {machine: M, command: WORK}, until: worked}
      grasp: {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped}
      worry:
      halt:  {send: {machine: R, command: STOP}}
      alarm:
transitions:
  come:  {from: robot.rest, to: [robot.work, robot.grasp], if: robot.entry}
  t:     {from: robot.work, to: robot.worry}
  stops: {from: robot.worry, to: robot.halt, unless: robot.holds}
  bad:   {from: robot.halt, to: robot.alarm, if: robot.holds}
properties:
  never_alarm: {never: robot.alarm}
"""
STOPPED_PLANT = """\
firable_plant: 1
plant: stopped
stations: [entry, exit]
arrivals:   {station: entry, every_s: 50}
departures: {station: exit, after_s: 1}
machines:
  M: {commands: {WORK: {does: work, takes_s: 1}}}
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


def carried() -> tuple[Net, PlantModel]:
    """A conveyor takes its workpiece in the firing that lets `still` fire while the table seems to be full."""
    return parse_net(CARRIED_NET), parse_plant(CARRIED_PLANT)


def stopped() -> tuple[Net, PlantModel]:
    """A robot is stopped for holding nothing when it has grasped, a moment before, and nothing is left undone."""
    return parse_net(STOPPED_NET), parse_plant(STOPPED_PLANT)
