"""A cell with a camera: what it finds good goes on, what it does not is worked on elsewhere and judged again."""

import io
from collections.abc import Iterable

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import Disturbance
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net
from firable.semantics.trace import Trace, parse_trace

NET = """\
firable: 1
cell: inspected
controllers:
  robot:
    start: free
    inputs: entry
    places:
      free:
      to_entry:  {send: {machine: R, command: MOVE,  to: ENTRY},  until: there}
      grasp:     {send: {machine: R, command: GRASP, at: ENTRY},  until: grasped}
      to_table:  {send: {machine: R, command: MOVE,  to: TABLE},  until: there}
      put:       {send: {machine: R, command: PUT,   at: TABLE},  until: placed}
      shown:
      take_good: {send: {machine: R, command: GRASP, at: TABLE},  until: grasped}
      to_exit:   {send: {machine: R, command: MOVE,  to: EXIT},   until: there}
      deliver:   {send: {machine: R, command: PUT,   at: EXIT},   until: placed}
      take_bad:  {send: {machine: R, command: GRASP, at: TABLE},  until: grasped}
      to_bench:  {send: {machine: R, command: MOVE,  to: BENCH},  until: there}
      put_bench: {send: {machine: R, command: PUT,   at: BENCH},  until: placed}
      mending:   {send: {machine: W, command: MEND}, until: mended}
      take_back: {send: {machine: R, command: GRASP, at: BENCH},  until: grasped}
  camera:
    start: idle
    inputs: [ok, nok]
    places: {idle: , passing: , failing: }
transitions:
  come:    {from: robot.free,      to: robot.to_entry, if: robot.entry}
  t1:      {from: robot.to_entry,  to: robot.grasp}
  t2:      {from: robot.grasp,     to: robot.to_table}
  t3:      {from: robot.to_table,  to: robot.put}
  t4:      {from: robot.put,       to: robot.shown}
  accept:  {from: [robot.shown, camera.idle], to: [robot.take_good, camera.passing], if: camera.ok}
  reject:  {from: [robot.shown, camera.idle], to: [robot.take_bad, camera.failing], if: camera.nok}
  t5:      {from: [robot.take_good, camera.passing], to: [robot.to_exit, camera.idle]}
  t6:      {from: robot.to_exit,   to: robot.deliver}
  t7:      {from: robot.deliver,   to: robot.free}
  t8:      {from: [robot.take_bad, camera.failing], to: [robot.to_bench, camera.idle]}
  t9:      {from: robot.to_bench,  to: robot.put_bench}
  t10:     {from: robot.put_bench, to: robot.mending}
  t11:     {from: robot.mending,   to: robot.take_back}
  t12:     {from: robot.take_back, to: robot.to_table}
properties:
  rests:   {never: deadlock}
"""
PLANT = """\
firable_plant: 1
plant: inspected
stations: [entry, table, bench, exit]
arrivals:   {station: entry, every_s: 4}
departures: {station: exit, after_s: 1}
machines:
  R:
    hand: ENTRY
    positions: {ENTRY: entry, TABLE: table, BENCH: bench, EXIT: exit}
    commands:
      MOVE:  {does: move,  takes_s: 1, jitter_s: 0.1, may_fail: repairable}
      GRASP: {does: grasp, takes_s: 0.5}
      PUT:   {does: put,   takes_s: 0.5, when_full: wait}
  W:
    commands:
      MEND:  {does: work, takes_s: 5}
sensors:
  robot.entry: {occupied: entry}
  camera.ok:   {passes: table, likely: 0.6}
  camera.nok:  {fails: table}
"""


def net() -> Net:
    """The net of the cell."""
    return parse_net(NET)


def plant(text: str = PLANT) -> PlantModel:
    """Its machines."""
    return parse_plant(text)


def run(seed: int, *, workpieces: int = 5, disturbances: Iterable[Disturbance] = ()) -> Trace:
    """The trace of a run, which nobody watches meanwhile; without disturbances it comes to its end."""
    stream = io.StringIO()
    report = execute(
        split(net()),
        SimulatedCell(plant(), workpieces=workpieces, seed=seed, disturbances=disturbances),
        Conduct(trace=stream, watch=Watch.IGNORE),
    )
    assert disturbances or report.state is State.DONE
    return parse_trace(stream.getvalue())
