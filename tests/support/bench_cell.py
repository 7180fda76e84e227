"""A bench with every kind of command, and a net that sends any of them at any time.

The net waits for nothing but the completion of the same command, so every accident that the plant knows can happen.
"""

from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition

PLANT = """\
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
      MOVE:  {does: move, takes_s: 2, may_fail: repairable}
      GRASP: {does: grasp, takes_s: 1}
      PUT:   {does: put, takes_s: 1}
      HOLD:  {does: put, takes_s: 1, when_full: wait}
      HALT:  {does: stop, takes_s: 1}
  M:
    commands:
      CLAMP:   {does: clamp, station: table, takes_s: 1}
      RUN:     {does: process, station: table, takes_s: 3, may_fail: for_good}
      UNCLAMP: {does: release, station: table, takes_s: 1}
      DOOR:    {does: work, takes_s: 1}
  B:
    commands:
      RUN:  {does: carry, from: entry, to: table, takes_s: 4}
      WAIT: {does: carry, from: table, to: exit, takes_s: 4, when_full: wait}
      STOP: {does: stop}
      HALT: {does: stop, takes_s: 1}
sensors:
  c.entry: {occupied: entry}
  c.hand:  {holding: R}
"""

STARTS = """\
firable: 1
cell: starts
controllers:
  c:
    start: cold
    inputs: [entry, hand]
    places:
      cold:
      rests:
      moves: {send: {machine: R, command: MOVE, to: TABLE}, until: at_table}
transitions:
  warm: {from: c.cold, to: c.rests}
  go: {from: c.rests, to: c.moves}
  stay: {from: c.moves, to: c.rests}
"""
"""A net on that bench with a transition that fires once."""

COMMANDS = {
    **{f"to_{at.lower()}": ("R", "MOVE", (("to", at),)) for at in ("HOME", "ENTRY", "TABLE", "EXIT")},
    **{f"grasp_{at.lower()}": ("R", "GRASP", (("at", at),)) for at in ("HOME", "ENTRY", "TABLE")},
    **{f"put_{at.lower()}": ("R", "PUT", (("at", at),)) for at in ("HOME", "TABLE", "EXIT")},
    "hold": ("R", "HOLD", (("at", "TABLE"),)),
    "halt": ("R", "HALT", ()),
    "clamp": ("M", "CLAMP", ()),
    "run": ("M", "RUN", (("program", "O1"),)),
    "unclamp": ("M", "UNCLAMP", ()),
    "door": ("M", "DOOR", ()),
    "belt": ("B", "RUN", ()),
    "belt_out": ("B", "WAIT", ()),
    "belt_stop": ("B", "STOP", ()),
    "belt_halt": ("B", "HALT", ()),
}
COMPLETIONS = {
    "grasp_entry": "c.hand",
    "grasp_table": "c.hand",
    "to_entry": "c.moved",
    "run": "c.ended",
    "halt": "c.at_rest",
}
"""Which commands are waited for: one by its sensor, one with two places, three by acknowledgement alone."""
CAMERAS = {
    "door": (ExternalGate("c.ok"),),
    "to_home": (ExternalGate("c.nok"), ExternalGate("c.fresh")),
    "to_exit": (ExternalGate("c.worse", wanted=False), ExternalGate("c.ok", wanted=False)),
}
"""What a camera must show before the end of a command counts."""


JUDGED = """\
  c.fresh: {passes: entry}
  c.ok:    {passes: table, likely: 0.5}
  c.nok:   {fails: table}
  c.worse: {fails: exit}
"""
"""Cameras at every station: where workpieces come, where they are machined, where they go."""


LEAVING = "{station: exit, after_s: 1}"
"""Where workpieces leave."""
LEAVING_RAW = f"[{LEAVING}, {{station: table, raw: true}}]"
"""Two ways out, of which one is where workpieces are machined, before or after that."""


def bench(extra: str = "", judged: str = "", leaving: str = LEAVING) -> PlantModel:
    """The plant, with something added to its first sensor, more sensors, and other ways out."""
    text = PLANT.replace("{occupied: entry}", f"{{occupied: entry{extra}}}").replace(LEAVING, leaving)
    return parse_plant(text + judged)


def free_cell(chosen: tuple[str, ...] = tuple(COMMANDS), *, judged: bool = False) -> Net:
    """A net with a place to rest and a place to command for each chosen command, each independent of the others.

    Where workpieces are judged, some of these wait for a camera to show that, or that it does not.
    """
    places, transitions = [], []
    for name in chosen:
        completion = COMPLETIONS.get(name)
        places += [
            Place(f"c.rest_{name}", "c", marked=True),
            Place(f"c.{name}", "c", command=Command(*COMMANDS[name]), completion=completion),
        ]
        waits = (ExternalGate(completion),) if completion else ()
        gates = (*waits, *(CAMERAS.get(name, ()) if judged else ()))
        entry = (ExternalGate("c.entry", wanted=name != "belt_out"),) if name in {"belt", "belt_out"} else ()
        transitions += [
            Transition(f"send_{name}", (f"c.rest_{name}",), (f"c.{name}",), external=entry),
            Transition(f"end_{name}", (f"c.{name}",), (f"c.rest_{name}",), external=gates),
        ]
    completions = dict.fromkeys(COMPLETIONS[name] for name in chosen if name in COMPLETIONS)
    signals = [Signal("c.entry", "c"), *(Signal(name, "c", SignalKind.COMPLETION) for name in completions)]
    signals += [Signal(name, "c") for name in ("c.fresh", "c.ok", "c.nok", "c.worse") if judged]
    if "c.hand" not in completions:
        signals.append(Signal("c.hand", "c"))
    return Net("bench", tuple(places), tuple(transitions), tuple(signals), (Controller("c"),))
