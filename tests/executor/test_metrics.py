"""The figures of a run agree with its trace, and are text that Prometheus reads."""

from __future__ import annotations

import asyncio
import io
from collections import Counter
from collections.abc import Mapping

from prometheus_client.parser import text_string_to_metric_families

from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.driver import Reading
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import Greeting
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.metrics import Metrics
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.operating.service import Inputs
from firable.executor.protocol.messages import Decision, Readiness, Vote
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.semantics.trace import CommandSent, Fired, Trace, parse_trace

NET = catalogue_net("one_robot")


def run_of(workpieces: int) -> Trace:
    stream = io.StringIO()
    execute(
        split(NET), SimulatedCell(catalogue_plant("one_robot"), workpieces=workpieces, seed=3), Conduct(trace=stream)
    )
    return parse_trace(stream.getvalue())


def samples(metrics: Metrics) -> dict[tuple[str, tuple[str, ...]], float]:
    found = {}
    for family in text_string_to_metric_families(metrics.text().decode()):
        for sample in family.samples:
            if not sample.name.endswith("_created"):
                found[sample.name, tuple(value for _, value in sorted(sample.labels.items()))] = sample.value
    return found


def test_figures_are_those_of_the_trace() -> None:
    trace, metrics = run_of(4), Metrics(NET)
    for event in trace.events:
        metrics.seen(event)
    found = samples(metrics)
    firings = Counter(name for event in trace.events if isinstance(event, Fired) for name in event.transitions)
    commands = Counter(event.place for event in trace.events if isinstance(event, CommandSent))
    assert {name: found["firable_firings_total", (name,)] for name in firings} == firings
    assert {place: found["firable_commands_total", ("MOVE", "R", place)] for place in ("robot.to_cv1",)} == {
        "robot.to_cv1": commands["robot.to_cv1"]
    }
    times = [event.at_seconds for event in trace.events if isinstance(event, Fired) and "G1" in event.transitions]
    assert found["firable_cycle_seconds_count", ("G1",)] == len(times) - 1
    assert abs(found["firable_cycle_seconds_sum", ("G1",)] - (times[-1] - times[0])) < 1e-6
    moved = found["firable_command_seconds_sum", ("MOVE", "R", "robot.to_cv1")] / commands["robot.to_cv1"]
    assert 1.8 <= moved <= 2.2, "the plant file says 2.0 s, with 0.2 s of jitter"
    marked = {labels[0] for (name, labels), value in found.items() if name == "firable_marked" and value}
    assert trace.end is not None
    assert marked == set(trace.end.marking)


def test_a_run_that_is_taken_up_shows_the_marking_that_it_has_and_no_times_that_nobody_saw() -> None:
    decomposition, journal = split(NET), MemoryJournal()
    recorder = Recorder(NET, "", None)
    first = Host(decomposition, DryRunDriver(decomposition.subnets, 1.0), recorder, journal=journal)

    async def main() -> None:
        ending = asyncio.create_task(first.main())
        await asyncio.sleep(2.5)
        first.stop()
        await ending

    run_in_virtual_time(main())
    metrics, again = Metrics(NET), Recorder(NET, "", None, journal.kept(TRACE)[KEY])
    driver = DryRunDriver(decomposition.subnets, 1.0)
    second = Host(decomposition, driver, again, journal=journal, figures=metrics)
    marked = {labels[0] for (name, labels), value in samples(metrics).items() if name == "firable_marked" and value}
    assert marked == set(second.marking) == set(first.marking) != set(NET.names(NET.initial_marking))
    leaving = next(t for t in NET.transitions if set(t.inputs) <= marked)
    metrics.seen(Fired(9.0, (leaving.name,), 0))
    assert not [labels for name, labels in samples(metrics) if name == "firable_place_seconds_count"]


def test_what_can_go_wrong_is_counted_from_nought() -> None:
    found = samples(Metrics(NET))
    faults = {labels: value for (name, labels), value in found.items() if name == "firable_faults_total"}
    assert faults == {("fault",): 0, ("divergence",): 0, ("emergency stop",): 0}


def test_a_round_counts_once_however_many_take_part_and_however_often_it_is_told() -> None:
    metrics = Metrics(NET)
    for controller in ("robot", "mc"):
        metrics.message(Vote(controller, 7, frozenset({"G2"}), Readiness(1, frozenset())))
    metrics.message(Vote("system", 7, frozenset(), Readiness(1, frozenset())))
    told = [Decision(controller, 7, None, 7, 0) for controller in ("robot", "mc", "system")]
    for decision in told:
        metrics.message(decision)
    metrics.message(told[0], again=True)
    metrics.message(Decision("robot", 8, "G2", 8, 0))
    found = samples(metrics)
    assert found["firable_rounds_total", ("aborted",)] == 1
    assert found["firable_rounds_total", ("committed",)] == 1
    assert found["firable_votes_total", ("yes", "robot")] == 1
    assert found["firable_votes_total", ("no", "system")] == 1
    assert found["firable_messages_total", ("Decision",)] == 4
    assert found["firable_repeats_total", ()] == 1


def test_two_runs_in_one_process_do_not_count_into_each_other() -> None:
    first, second = Metrics(NET), Metrics(NET)
    first.inputs_coalesced("robot.touch", 3)
    assert samples(first)["firable_coalesced_inputs_total", ("robot.touch",)] == 3
    assert ("firable_coalesced_inputs_total", ("robot.touch",)) not in samples(second)


class Chattering(DryRunDriver):
    """A driver whose sensor has chattered that often since it was made."""

    def __init__(self, coalesced: int) -> None:
        super().__init__(split(NET).subnets, 1.0)
        self.coalesced = coalesced

    def readings(self) -> Mapping[str, Reading]:
        return {"robot.touch": Reading(coalesced=self.coalesced)}


def test_what_was_coalesced_is_counted_on_by_the_driver_that_follows_an_emergency_stop() -> None:
    metrics, driver = Metrics(NET), Chattering(3)
    host = Host(split(NET), driver, Recorder(NET, "", None), figures=metrics)
    inputs = Inputs(host, metrics)
    counted = []
    for at_the_end, of_the_next in ((5, 0), (7, 1), (8, 4)):
        inputs.look()
        driver.coalesced = at_the_end  # nobody has looked since
        driver = host.driver = Chattering(of_the_next)
        inputs.look()
        counted.append(samples(metrics)["firable_coalesced_inputs_total", ("robot.touch",)])
    assert counted == [5, 13, 24]


class NoisyLink(InProcessLink):
    """A link over which that much has come damaged."""

    noise = 0

    @property
    def damaged(self) -> int:
        return self.noise


def test_what_came_damaged_over_the_link_is_counted_once() -> None:
    metrics, link = Metrics(NET), NoisyLink(Exchange(), Greeting("", ("robot",)))
    driver = DryRunDriver(split(NET).subnets, 1.0)
    inputs = Inputs(Host(split(NET), driver, Recorder(NET, "", None), machines=("robot",), link=link), metrics)
    counted = []
    for noise in (0, 3, 3, 5):
        link.noise = noise
        inputs.look()
        counted.append(samples(metrics)["firable_link_damaged_total", ()])
    assert counted == [0, 3, 3, 5]
