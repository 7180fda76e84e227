"""A cell with an index table, a walking beam that shares a station with it, a robot, a belt, a tool and a lamp.

The net waits for nothing but the completion of the same command, so all that can go wrong there does.
"""

from typing import Final

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.nets.text import parse_net

NET: Final = """\
firable: 1
cell: tables
controllers:
  c:
    start: [table_rests, beam_rests, others_rest]
    inputs: [load, drill, good]
    places:
      table_rests:
      turn:   {send: {machine: T, command: INDEX}, until: turned}
      back:   {send: {machine: T, command: BACK}}
      light:  {send: {machine: L, command: LIGHT}}
      test:   {send: {machine: L, command: TEST}, until: tested}
      beam_rests:
      beam:   {send: {machine: W, command: STEP}, until: stepped}
      others_rest:
      put:    {send: {machine: R, command: PUT, at: LOAD}, until: placed}
      clamp:  {send: {machine: D, command: CLAMP}, until: clamped}
      drill_: {send: {machine: D, command: DRILL}, until: drilled}
      free:   {send: {machine: D, command: RELEASE}, until: released}
      belt:   {send: {machine: B, command: RUN}, until: there}
transitions:
  turn:  {from: c.table_rests, to: c.turn, if: c.load}
  back:  {from: c.turn, to: c.back, unless: c.drill}
  light: {from: c.back, to: c.light}
  test:  {from: c.light, to: c.test}
  rest:  {from: c.test, to: c.table_rests}
  step:  {from: c.beam_rests, to: c.beam}
  stand: {from: c.beam, to: c.beam_rests, if: c.good}
  t1:    {from: c.others_rest, to: c.put, if: c.drill}
  t2:    {from: c.put, to: c.clamp}
  t3:    {from: c.clamp, to: c.drill_}
  t4:    {from: c.drill_, to: c.free}
  t5:    {from: c.free, to: c.belt}
  t6:    {from: c.belt, to: c.others_rest, unless: c.load}
"""

PLANT: Final = """\
firable_plant: 1
plant: tables
stations: [feed, load, drill, unload, out]
full_at_first: {drill: raw, unload: machined}
arrivals:   {station: load, every_s: 4}
departures: {station: out, after_s: 1}
machines:
  T:
    commands:
      INDEX: {does: index, next: {load: drill, drill: unload, unload: load}, takes_s: 2, may_fail: repairable}
      BACK:  {does: index, next: {drill: load}, takes_s: 2}
  W: {commands: {STEP: {does: index, next: {unload: out}, takes_s: 2, may_fail: for_good}}}
  R:
    hand: LOAD
    positions: {LOAD: load, DRILL: drill}
    commands:
      MOVE:  {does: move, takes_s: 1}
      GRASP: {does: grasp, takes_s: 1}
      PUT:   {does: put, takes_s: 1}
      HALT:  {does: stop, takes_s: 1}
  D:
    commands:
      CLAMP:   {does: clamp, station: drill, takes_s: 1}
      DRILL:   {does: process, station: drill, takes_s: 1}
      RELEASE: {does: release, station: drill, takes_s: 1}
  B: {commands: {RUN: {does: carry, from: feed, to: load, takes_s: 1, when_full: wait}}}
  L: {commands: {LIGHT: {does: switch}, TEST: {does: work, takes_s: 1}}}
sensors:
  c.load:  {occupied: load}
  c.drill: {occupied: drill}
  c.good:  {passes: unload, after_s: 1}
"""


def tables(extra: str = "") -> tuple[Net, PlantModel]:
    """The net and its machines, with something added to the sensor at the station where workpieces come."""
    return parse_net(NET), parse_plant(PLANT.replace("{occupied: load}", f"{{occupied: load{extra}}}"))


COMMANDS: Final = {
    **{command.lower(): ("T", command, ()) for command in ("INDEX", "BACK")},
    "step": ("W", "STEP", ()),
    **{f"to_{at.lower()}": ("R", "MOVE", (("to", at),)) for at in ("LOAD", "DRILL")},
    **{
        f"{does}_{at}": ("R", does.upper(), (("at", at.upper()),))
        for does in ("grasp", "put")
        for at in ("load", "drill")
    },
    **{command.lower(): ("D", command, ()) for command in ("CLAMP", "DRILL", "RELEASE")},
    "belt": ("B", "RUN", ()),
    **{command.lower(): ("L", command, ()) for command in ("LIGHT", "TEST")},
}


def free_tables() -> Net:
    """A net that rests, sends one of the commands, waits for its completion, and rests; each beside the others."""
    places, transitions, signals = list[Place](), list[Transition](), list[Signal]()
    for name, command in COMMANDS.items():
        completion = None if name == "light" else f"c.{name}_done"
        places.append(Place(f"c.rest_{name}", "c", marked=True))
        places.append(Place(f"c.at_{name}", "c", command=Command(*command), completion=completion))
        signals += [Signal(completion, "c", SignalKind.COMPLETION)] if completion is not None else []
        waits = (ExternalGate(completion),) if completion is not None else ()
        transitions.append(Transition(f"send_{name}", (f"c.rest_{name}",), (f"c.at_{name}",)))
        transitions.append(Transition(f"end_{name}", (f"c.at_{name}",), (f"c.rest_{name}",), external=waits))
    signals += [Signal(name, "c") for name in ("c.load", "c.drill", "c.good")]
    return Net("tables", tuple(places), tuple(transitions), tuple(signals), (Controller("c"),))
