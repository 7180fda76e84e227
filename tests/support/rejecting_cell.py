"""A cell with a camera at its entry and two ways out: what is not found good leaves as it came, beside the machine."""

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net

NET = """\
firable: 1
cell: rejecting
controllers:
  cell:
    start: idle
    inputs: [ok, nok]
    places:
      idle:
      loading:   {send: {machine: R, command: LOAD},   until: loaded}
      rejecting: {send: {machine: R, command: REJECT}, until: rejected}
      clamping:  {send: {machine: M, command: CLAMP},  until: clamped}
      cutting:   {send: {machine: M, command: CUT},    until: cut}
      freeing:   {send: {machine: M, command: FREE},   until: freed}
      unloading: {send: {machine: R, command: UNLOAD}, until: unloaded}
transitions:
  accept: {from: cell.idle, to: cell.loading, if: cell.ok}
  reject: {from: cell.idle, to: cell.rejecting, if: cell.nok, unless: cell.ok}
  t1: {from: cell.rejecting, to: cell.idle}
  t2: {from: cell.loading, to: cell.clamping}
  t3: {from: cell.clamping, to: cell.cutting}
  t4: {from: cell.cutting, to: cell.freeing}
  t5: {from: cell.freeing, to: cell.unloading}
  t6: {from: cell.unloading, to: cell.idle}
"""
PLANT = """\
firable_plant: 1
plant: rejecting
stations: [entry, table, exit, bin]
arrivals: {station: entry, every_s: 4}
departures:
  - {station: exit, after_s: 1}
  - {station: bin, after_s: 2, raw: true}
machines:
  R:
    commands:
      LOAD:   {does: carry, from: entry, to: table, takes_s: 2}
      REJECT: {does: carry, from: entry, to: bin, takes_s: 2, when_full: wait}
      UNLOAD: {does: carry, from: table, to: exit, takes_s: 2, when_full: wait}
  M:
    commands:
      CLAMP: {does: clamp, station: table, takes_s: 1}
      CUT:   {does: process, station: table, takes_s: 3}
      FREE:  {does: release, station: table, takes_s: 1}
sensors:
  cell.ok:  {passes: entry, likely: 0.5}
  cell.nok: {fails: entry}
"""


def net() -> Net:
    """The net of the cell."""
    return parse_net(NET)


def plant(text: str = PLANT) -> PlantModel:
    """Its machines."""
    return parse_plant(text)
