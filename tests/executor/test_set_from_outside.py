"""Signals that are set from outside the cell: an operator's key, a door, the next cell."""

from __future__ import annotations

import asyncio
import io
import re

import pytest

from firable.analysis.loop.verdicts import check_loop
from firable.decompose.proofs.held_gates import held_gates
from firable.decompose.splitting.cut import split
from firable.decompose.verification.happenings import Plant as Reading
from firable.decompose.verification.same_loop import compare
from firable.executor.cell.plant import Plant, SensorChanged
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.far_side.cell import CellServer
from firable.executor.drivers.far_side.ends import binding_text, ends_of
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.host import Host
from firable.executor.operating.monitor import Monitor
from firable.executor.operating.running import Operator, RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.executor.operating.watched_loop import WatchedLoop
from firable.executor.protocol.commands import Answer
from firable.nets.diagnostics import InputError
from firable.nets.machines.closing import close
from firable.nets.machines.fitting import misfits, otherwise_than
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net
from firable.nets.verdict import Status
from firable.semantics.trace import SignalChanged, parse_trace

NET = """firable: 1
cell: press
controllers:
  press:
    start: ready
    inputs: [key, door, part]
    places:
      ready:
      closing: {send: {machine: P, command: CLAMP}, until: closed}
      working: {send: {machine: P, command: WORK}, until: worked}
      opening: {send: {machine: P, command: FREE}, until: opened}
      done:
transitions:
  start: {from: press.ready, to: press.closing, if: [press.key, press.door, press.part]}
  work:  {from: press.closing, to: press.working}
  open:  {from: press.working, to: press.opening}
  end:   {from: press.opening, to: press.done}
  again: {from: press.done, to: press.ready, unless: press.key}
"""
PLANT = """firable_plant: 1
plant: press
stations: [die]
arrivals:   {station: die, every_s: 5}
departures: {station: die}
machines:
  P:
    commands:
      CLAMP: {does: clamp,   station: die, takes_s: 0.5}
      WORK:  {does: process, station: die, takes_s: 2}
      FREE:  {does: release, station: die, takes_s: 0.5}
sensors:
  press.key:  {set_by: operator, after_s: 2, for_s: 1}
  press.door: {set_by: door, after_s: 7, for_s: 2}
  press.part: {occupied: die}
"""
KEY = "{set_by: operator, after_s: 2, for_s: 1}"


def net() -> Net:
    return parse_net(NET)


def plant(key: str = KEY) -> PlantModel:
    return parse_plant(PLANT.replace(KEY, key))


def loop() -> ClosedLoop:
    return close(net(), plant())


def ran(
    text: str = NET,
    model: PlantModel | None = None,
    trace: io.StringIO | None = None,
    operator: Operator | None = None,
) -> RunReport:
    cell = SimulatedCell(model or plant(), workpieces=2)
    return execute(split(parse_net(text)), cell, Conduct(trace=trace, watch=Watch.STOP, operator=operator))


def test_whatever_goes_on_such_a_signal_can_change_in_the_loop() -> None:
    names = {move: move.rpartition("/")[0] for move in loop().net.transition_index if move.endswith(("/set", "/reset"))}
    assert sorted(names) == ["press.door/reset", "press.door/set", "press.key/reset", "press.key/set"]
    for move, signal in names.items():
        transition = loop().net.transition(move)
        assert {*transition.inputs, *transition.outputs} >= {signal, f"plant.{signal}.reset"}
        looked_at = {*transition.permissive, *transition.inhibitive}
        assert all("P." not in place and "die" not in place for place in looked_at)
    assert loop().net.transition("press.key/set").description.startswith("press.key is set by operator")


def test_the_second_reading_has_the_same_loop() -> None:
    for sending in Sending:
        for faults in Faults:
            assert compare(Reading(net(), plant(), sending, faults), close(net(), plant(), faults, sending))


def test_the_cell_is_live_with_its_machines_because_somebody_may_come() -> None:
    found = {verdict.name: verdict.status for verdict in check_loop(net(), plant()).verdicts}
    assert found["loop.live"] is found["loop.gates-open"] is found["loop.deadlock-free"] is Status.PROVED


BELT = """  belt:
    start: here
    places: {here: , there: }
transitions:
"""
STARTING = "{from: press.ready, to: press.closing, if: [press.key, press.door, press.part]}"
SHARED = "{from: [press.ready, belt.here], to: [press.closing, belt.there], if: [press.key, press.door, press.part]}"
ASKING = "{from: press.ready, to: press.asked, if: [press.key, press.door, press.part]}"
ASKED = "{from: [press.asked, belt.here], to: [press.closing, belt.there]}"
BACK = "  back:  {from: belt.there, to: belt.here}\n"


def test_a_gate_on_it_may_close_while_a_vote_stands_and_a_place_that_remembers_it_helps() -> None:
    with_belt = NET.replace("transitions:\n", BELT) + BACK
    shared = parse_net(with_belt.replace(STARTING, SHARED))
    found = {verdict.name: verdict for verdict in held_gates(split(shared), plant()).verdicts}
    for signal in ("press.key", "press.door"):
        assert found[f"o4.start/{signal}"].status is Status.VIOLATED
        assert found[f"o4.start/{signal}"].hint.startswith(f"read '{signal}' in a transition of its own controller")
    remembering = with_belt.replace("      done:\n", "      done:\n      asked:\n")
    asked = parse_net(remembering.replace(f"start: {STARTING}", f"start: {ASKED}\n  ask: {ASKING}"))
    names = {verdict.name for verdict in held_gates(split(asked), plant()).verdicts}
    assert names == {"o4.completions", "o4.commands"}


def test_a_simulated_run_sets_it_and_resets_it_again_and_again() -> None:
    cell, found = Plant(plant(), workpieces=0), list[tuple[float, bool]]()
    while len(found) < 5:
        assert cell.next_seconds is not None
        reports = cell.advance(cell.next_seconds)
        shown = [one.value for one in reports if isinstance(one, SensorChanged) and one.signal == "press.key"]
        found += [(cell.now_seconds, value) for value in shown]
    assert found == [(2, True), (3, False), (5, True), (6, False), (8, True)]
    assert cell.at_rest


def test_without_a_time_it_is_set_at_once_and_for_good() -> None:
    cell = Plant(plant("{set_by: operator}"), workpieces=0)
    assert not cell.at_rest
    assert SensorChanged("press.key", value=True) in cell.advance(0.0)
    assert "press.key" not in {event.signal for *_, event in cell.events if hasattr(event, "signal")}


def test_a_run_waits_until_both_are_set_and_ends_when_all_workpieces_are_through() -> None:
    trace = io.StringIO()
    report = ran(trace=trace)
    assert (report.state, len(report.delivered)) == (State.DONE, 2)
    fired = [event.at_seconds for event in parse_trace(trace.getvalue()).events if "start" in str(event)]
    assert fired == [8.0, 17.0]


def test_a_run_that_nobody_can_help_ends_though_the_key_is_turned_on_and_on() -> None:
    barred = NET.replace("press.part]", "press.part], unless: press.barred").replace(
        "door, part]", "door, part, barred]"
    )
    report = ran(barred, parse_plant(f"{PLANT}  press.barred: {{set_by: police}}\n"))
    assert report.state is State.WAITING
    assert 100 < report.simulated_seconds < 400
    assert "press.barred" in str(report.situation.blocked)


SEEN_TWICE = """firable: 1
cell: press
controllers:
  press:
    start: ready
    inputs: [key, part]
    places:
      ready:
      working: {send: {machine: P, command: WORK}, until: worked}
  lamp: {start: dark, inputs: key, places: {dark: , lit: }}
transitions:
  work: {from: [press.ready, lamp.dark], to: [press.working, lamp.lit], if: press.key, unless: lamp.key}
"""


class Bounded(io.StringIO):
    """A trace of a run that ends."""

    def write(self, text: str) -> int:
        assert self.tell() < 100_000, "the run is endless"
        return super().write(text)


def test_a_vote_that_fails_at_each_turn_of_a_key_puts_off_no_end() -> None:
    """Of the two who see it one is told first, so that there is a round each time, in which the other says no."""
    door = "press.door: {set_by: door, after_s: 7, for_s: 2}"
    trace = Bounded()
    report = ran(SEEN_TWICE, parse_plant(PLANT.replace(door, f"lamp.key:  {KEY}")), trace)
    assert trace.getvalue().count('"note": "voted"') > 20
    assert report.state is State.WAITING
    assert report.simulated_seconds < 100


def test_a_run_is_at_rest_for_its_operator_only_when_nobody_comes_any_more() -> None:
    stepped: list[tuple[str, float]] = []

    async def operator(host: Host) -> None:
        host.pause()
        while len(stepped) < 5:
            if (name := await host.step()) is not None:
                stepped.append((name, host.now_seconds()))
            assert not host.at_rest
            await asyncio.sleep(0.5)
        host.resume()

    assert ran(operator=operator).state is State.DONE
    assert [name for name, _ in stepped] == ["start", "work", "open", "end", "again"]
    assert 8.0 <= stepped[0][1] < 9.0


def test_a_cycle_is_not_at_its_end_while_it_waits_for_a_door_that_will_be_shut() -> None:
    opening = "{from: press.working, to: press.opening"
    waiting = NET.replace("[press.key, press.door, press.part]", "press.part").replace(
        f"{opening}}}", f"{opening}, if: press.door}}"
    )

    async def operator(host: Host) -> None:
        await asyncio.sleep(4.5)
        host.stop(at_end_of_cycle=True)

    report = ran(waiting, operator=operator)
    assert (report.state, report.situation.marking) == (State.STOPPED, ("press.ready",))
    assert report.firings["open"] == 1
    assert report.simulated_seconds < 20


def test_a_lamp_that_follows_the_key_puts_off_no_end_of_the_cycle() -> None:
    lamp = "  lamp: {start: dark, inputs: key, places: {dark: , lit: }}\ntransitions:\n"
    follows = "  light: {from: lamp.dark, to: lamp.lit, if: lamp.key}\n"
    follows += "  dim: {from: lamp.lit, to: lamp.dark, unless: lamp.key}\n"
    with_lamp = (
        NET.replace("transitions:\n", lamp).replace("press.part]", "press.part], unless: press.barred") + follows
    )
    barred = with_lamp.replace("door, part]", "door, part, barred]")
    model = parse_plant(f"{PLANT}  press.barred: {{set_by: police}}\n  lamp.key: {KEY}\n")

    async def operator(host: Host) -> None:
        await asyncio.sleep(4.5)
        host.stop(at_end_of_cycle=True)

    report = ran(barred, model, operator=operator)
    assert (report.state, report.inside) == (State.STOPPED, (1,))
    assert report.simulated_seconds < 400


def test_a_run_that_was_paused_for_long_waits_anew() -> None:
    async def operator(host: Host) -> None:
        host.pause()
        await asyncio.sleep(300.0)
        host.resume()

    report = ran(operator=operator)
    assert (report.state, len(report.delivered)) == (State.DONE, 2)


def test_it_changes_in_its_time_while_the_machines_stand_after_an_emergency_stop() -> None:
    """What was pressed and let go meanwhile is told then, and not all at once when the stop is over."""

    async def operator(host: Host) -> None:
        await asyncio.sleep(9.0)  # the press is at work
        assert "press.working" in host.marking
        host.emergency_stop("a person")
        await asyncio.sleep(40.5)
        assert host.situation().state is State.LATCHED
        assert "press.working" in host.marking
        assert host.reset() == ()
        while host.taking_up is None or not host.taking_up.is_final:
            await asyncio.sleep(0.001)
        assert not host.say("press.working", Answer.NOT_RECEIVED)
        assert host.resume()

    trace = io.StringIO()
    report = ran(trace=trace, operator=operator)
    assert (report.state, len(report.delivered)) == (State.DONE, 2)
    events = parse_trace(trace.getvalue()).events
    for signal, period, set_at in (("press.key", 3, 2), ("press.door", 9, 7)):
        changes = [
            (one.at_seconds, one.value) for one in events if isinstance(one, SignalChanged) and one.signal == signal
        ]
        assert {value for at, value in changes if 9.0 < at < 49.0} == {False, True}
        for at, value in changes:
            assert at % period == pytest.approx(set_at if value else 0, abs=1e-6)


def test_the_monitor_believes_nothing_of_it() -> None:
    believed = WatchedLoop(net(), plant(), ())
    assert {*believed.signals} == {"press.closed", "press.worked", "press.opened", "press.part"}
    assert not {"press.key", "press.door"} & believed.index.keys()
    monitor = Monitor(net(), plant())
    assert monitor.signal(1.0, "press.key", value=True) is None
    assert monitor.signal(1.0, "press.key", value=False) is None
    assert monitor.signal(1.0, "press.worked", value=True) is not None


@pytest.mark.parametrize(
    ("key", "message", "hint"),
    [
        ("{set_by: operator, occupied: die}", "a sensor sees one thing", "`set_by: WHO`"),
        ("{set_by: operator, may_flicker: true}", "may change at any time as it is", "leave out `may_flicker`"),
        ("{set_by: operator, may_linger: true}", "may change at any time as it is", "`may_linger`"),
        ("{set_by: operator, for_s: 1}", "hardly any time would pass", "leave out `for_s`"),
        ("{set_by: operator, after_s: 1, for_s: 0}", "hardly any time would pass", "at least 0.001 s"),
        ("{set_by: operator, after_s: 1.0e-20, for_s: 1}", "hardly any time would pass", "at least 0.001 s"),
        ("{occupied: die, for_s: 1}", "nobody sets this sensor", "`for_s` belongs to `set_by`"),
        ("{occupied: die, after_s: 1}", "a sensor sees at once", "and `set_by`"),
    ],
)
def test_what_cannot_be_said_of_it_is_refused(key: str, message: str, hint: str) -> None:
    with pytest.raises(InputError, match=rf"F5003.*{re.escape(message)}") as caught:
        plant(key)
    (problem,) = caught.value.diagnostics
    assert hint in problem.hint
    assert problem.span is not None
    assert "press.key" in PLANT.splitlines()[problem.span.line - 1]


def test_it_is_no_completion_for_nobody_outside_knows_of_commands() -> None:
    model = parse_plant(PLANT + "  press.worked: {set_by: operator}\n")
    (problem,) = misfits(model, net())
    assert problem.message == "what is set from outside, 'press.worked' is a completion of the net"


def test_its_times_are_no_matter_of_a_proof_and_who_sets_it_is() -> None:
    assert not otherwise_than(plant(), plant("{set_by: operator, after_s: 9}"))
    assert otherwise_than(plant(), plant("{acknowledges: P, after_s: 2}"))


def test_a_served_cell_tells_of_what_is_set_again_and_again_once_for_all() -> None:
    said: list[str] = []

    async def main() -> None:
        binding = parse_binding(binding_text(net(), {"modbus": str(free_port())}, plant().sensors))
        cell = CellServer(
            binding,
            net(),
            Plant(plant(), workpieces=0, seed=0),
            ends_of(binding),
            speed=200.0,
            tell=lambda _, what: said.append(what),
        )
        await cell.start()
        serving = asyncio.create_task(cell.run())
        await until(lambda: sum(edge > 6 for edge in cell.edges.values()) == 2, "key and door, set again and again")
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        await cell.stop()

    asyncio.run(main())
    for name, seconds in (("key", (1, 2)), ("door", (2, 7))):
        of_it = [what.removeprefix(f"press.{name} ") for what in said if what.startswith(f"press.{name} ")]
        so = f"goes on so, 1 for {seconds[0]} s and 0 for {seconds[1]} s, and is told no more"
        assert of_it == ["shows 1", "shows 0", so]
