"""The whole executor through faults from seeds: the machines pass, and every planted fault is found."""

from collections.abc import Iterator
from functools import cache

import pytest
from support import free_parts
from support.examples import seeds
from support.gated_nets import GATE_MOVED_BY_A_LOCAL, GATE_READ_AGAIN
from support.planted import PLANTED, PROVOKED_BY, DecidesEarly, IgnoresPause, KeepsNoPromise
from support.planted_times import PLANTED_TIMES, PROVOKED_TIMES
from support.timed_nets import TWO_TIMES

from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed
from firable.executor.simulation.campaign import Campaign, Failed, Passed, Run, campaign, rehearse, shrunk
from firable.executor.simulation.clock import Clock
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.faults import KINDS, Faults
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.recovery import recover
from firable.executor.simulation.world import Machines, World
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net
from firable.semantics.replaying import replay

CELLS = ["one_robot", "one_robot_mc_late", "two_robots_separate", "two_robots_shared"]
FOUND_WITHIN = 600
"""In so many runs at the most each planted fault is found; most need fewer than thirty."""


@cache
def cell(name: str) -> Subject:
    return Subject(split(catalogue_net(name)))


@cache
def drawn(number: int, family: str = "drawn") -> Subject:
    return Subject(split(DRAWN[family](number)))


def nets() -> Iterator[Subject]:
    """One after the other the cell, a drawn net, and the two nets with gates at local transitions."""
    gated = [Subject(split(net)) for net in (GATE_READ_AGAIN, GATE_MOVED_BY_A_LOCAL)]
    number = 0
    while True:
        yield from (cell("one_robot"), drawn(number), *gated)
        number += 1


def shown(done: Campaign) -> str:
    return "\n".join("\n".join((f.kind, f.message, f.command("NET"), *f.log)) for f in done.failed[:1])


@pytest.mark.seeds
@pytest.mark.parametrize("name", CELLS)
def test_runs_of_a_cell_through_faults_are_traces_of_it_and_go_on(name: str) -> None:
    done = campaign(lambda _: cell(name), map(Run, seeds(125)))
    assert not done.failed, shown(done)


@pytest.mark.seeds
def test_runs_of_drawn_nets_through_faults_are_traces_of_them_and_go_on() -> None:
    done = campaign(lambda seed: drawn(seed // 10), map(Run, seeds(750)))
    assert not done.failed, shown(done)
    # Everything that can go wrong did, in one run or the other.
    happened = ("kills", "restarts", "partitions", "stops", "steps", "doubled", "lost", "questions", "sent again")
    assert not [what for what in (*KINDS, *happened) if not done.counts[what]]


@pytest.mark.seeds
def test_runs_of_drawn_nets_in_layers_through_faults_are_traces_of_them_and_go_on() -> None:
    done = campaign(lambda seed: drawn(seed // 10, "drawn-layered"), map(Run, seeds(100)))
    assert not done.failed, shown(done)


@cache
def free_in(name: str) -> Subject:
    """A cell with the parts free of promise that are so in its bundle."""
    return Subject(freed(split(catalogue_net(name))))


@cache
def drawn_free(number: int, family: str) -> Subject:
    return Subject(freed(split(DRAWN[family](number))))


@pytest.mark.seeds
@pytest.mark.parametrize("name", ["one_robot", "two_robots_shared", "one_robot_timed"])
def test_runs_of_a_cell_with_free_parts_are_traces_of_it_and_go_on(name: str) -> None:
    done = campaign(lambda _: free_in(name), map(Run, seeds(30)))
    assert free_in(name).decomposition.free
    assert not done.failed, shown(done)


@pytest.mark.seeds
@pytest.mark.parametrize("family", DRAWN)
def test_runs_of_drawn_nets_with_free_parts_are_traces_of_them_and_go_on(family: str) -> None:
    done = campaign(lambda seed: drawn_free(seed // 10, family), map(Run, seeds(60)))
    assert any(drawn_free(number, family).decomposition.free for number in range(12))
    assert not done.failed, shown(done)


FREE_FAULTS: list[tuple[Machines, tuple[str, ...]]] = [
    (Machines(coordinator=free_parts.CountsEarlierEpochs), ("crash", "delay", "duplication", "slow")),
    (Machines(coordinator=free_parts.CountsUsedVotes), ()),
    (Machines(coordinator=free_parts.CountsOlderReports), ("duplication", "reordering", "delay")),
    (Machines(controller=free_parts.VotesOnWhatIsNotKept), ("crash",)),
    (Machines(controller=free_parts.AppliesFreePartsTwice), ("duplication",)),
    (Machines(controller=free_parts.AcknowledgesBeforeItObeys), ()),
]


@pytest.mark.parametrize(("machines", "kinds"), FREE_FAULTS, ids=[str(i) for i in range(len(FREE_FAULTS))])
def test_planted_fault_of_free_parts_is_found(machines: Machines, kinds: tuple[str, ...]) -> None:
    subjects = (Subject(freed(split(free_parts.SLOWLY_BACK))), free_in("two_robots_shared"))
    for seed in range(FOUND_WITHIN):
        if isinstance(rehearse(subjects[seed % 2], Run(seed, kinds), machines), Failed):
            return
    pytest.fail("not found")


@pytest.mark.parametrize("net", [free_parts.CLOSED_AGAIN, free_parts.OUTPUT_READ], ids=["closed", "read"])
def test_part_that_is_free_and_may_not_be_is_found(net: Net) -> None:
    subject = Subject(free_parts.parts_of(split(net), "t1-11"))
    found = (rehearse(subject, Run(seed)) for seed in range(FOUND_WITHIN))
    assert any(isinstance(each, Failed) for each in found)
    rightly = Subject(freed(split(net)))
    assert not any(isinstance(rehearse(rightly, Run(seed)), Failed) for seed in range(30))


@pytest.mark.seeds
def test_runs_with_time_limits_through_faults_are_traces_of_the_net_and_keep_the_limits() -> None:
    timed = (Subject(split(TWO_TIMES)), cell("one_robot_timed"))
    done = campaign(lambda seed: (*timed, drawn(seed // 20, "drawn-timed"))[seed % 3], map(Run, seeds(300)))
    assert not done.failed, shown(done)
    assert done.counts["timers set"] > 50
    assert {"go_timeout", "spin_timeout", "again", "robot.to_cv1_timeout"} <= {t.removeprefix("a.") for t in done.fired}


@pytest.mark.parametrize("name", PLANTED_TIMES)
def test_planted_fault_of_a_timer_is_found(name: str) -> None:
    timed = (Subject(split(TWO_TIMES)), cell("one_robot_timed"))
    for seed in range(FOUND_WITHIN):
        subject = (*timed, drawn(seed // 3, "drawn-timed"))[seed % 3]
        if isinstance(rehearse(subject, Run(seed, PROVOKED_TIMES.get(name)), PLANTED_TIMES[name]), Failed):
            return
    pytest.fail(f"{name} was not found")


def test_a_clock_runs_at_its_rate_stands_still_and_jumps_and_never_goes_back() -> None:
    clock, shown = Clock(rate=1.5), list[float]()
    for _ in range(3):
        clock.advance(2.0)
        shown.append(clock.shown_seconds)
        clock.stands_still = not clock.stands_still
    clock.jump(0.5)
    assert (*shown, clock.shown_seconds) == (3.0, 3.0, 6.0, 6.5)


def test_every_timed_drawn_net_reaches_a_place_with_a_limit() -> None:
    assert all(any(drawn(number, "drawn-timed").limited.values()) for number in range(30))


@pytest.mark.parametrize("name", PLANTED)
def test_planted_fault_is_found(name: str) -> None:
    for seed, subject in zip(range(FOUND_WITHIN), nets(), strict=False):
        if isinstance(rehearse(subject, Run(seed, PROVOKED_BY.get(name)), PLANTED[name]), Failed):
            return
    pytest.fail(f"{name} was not found")


def test_one_seed_is_one_run() -> None:
    def trace(seed: int) -> list[str]:
        world = World(cell("one_robot"), seed, Faults.drawn(seed))
        world.begin()
        world.run(300)
        return [*world.trace.lines(), *world.told()]

    assert trace(3) == trace(3)
    assert trace(3) != trace(4)


def test_the_trace_of_a_run_is_replayed_by_the_reference_player() -> None:
    net = cell("one_robot").net
    world = World(cell("one_robot"), 1, Faults.none())
    world.begin()
    world.run(400)
    recover(world)
    assert replay(net, world.trace).firings == world.counts["firings"] > 8


def failing(machines: Machines, kinds: tuple[str, ...] | None = None) -> Failed:
    for seed in range(FOUND_WITHIN):
        found = rehearse(cell("one_robot"), Run(seed, kinds), machines)
        if isinstance(found, Failed):
            return found
    pytest.fail("not found")


def test_a_failure_is_brought_back_by_what_its_command_says() -> None:
    failed = failing(Machines(controller=KeepsNoPromise))
    again = rehearse(cell("one_robot"), failed.run, Machines(controller=KeepsNoPromise))
    assert isinstance(again, Failed)
    assert (again.kind, again.message, again.log) == (failed.kind, failed.message, failed.log)
    assert failed.command("catalogue:one_robot").startswith(
        f"firable rehearse catalogue:one_robot --seed {failed.run.seed}"
    )


def test_a_failure_is_shrunk_to_the_faults_that_it_needs() -> None:
    machines = Machines(controller=KeepsNoPromise)
    short = shrunk(cell("one_robot"), failing(machines, ("loss", "crash", "slow", "queued", "pause")), machines)
    assert short.run.kinds == ("crash",)
    assert isinstance(rehearse(cell("one_robot"), short.run, machines), Failed)


def test_a_fault_that_needs_no_faults_is_shrunk_to_a_run_without_any() -> None:
    machines = Machines(coordinator=IgnoresPause)
    assert shrunk(cell("one_robot"), failing(machines), machines).run.kinds == ()


REGRESSIONS = [
    # Of two commands that are sent together and share a completion, the first was forgotten at a crash.
    (20, Run(202, ("duplication", "torn", "disk", "drift", "slow", "step"), 362)),
    # A token entered and left a place without a completion between two syncs, and a crash lost its command.
    (10584, Run(105840, ("delay", "crash", "torn", "unsynced", "disk", "stuck"), 66)),
]
TIMED_REGRESSIONS = [
    # A completion that two commands share was cleared by the other one, and the time of the first was forgotten.
    (463, Run(4635, ("duplication", "reordering", "torn", "late", "stuck", "flapping", "stale"), 284)),
    (3, Run(38, ("reordering", "torn", "unsynced", "disk", "standstill", "stuck", "queued", "pause"), 135)),
    # The completion of a command whose time was over came between the next entry and its command: that is a trace.
    (500292, Run(5002923, ("loss", "delay", "standstill", "queued", "flapping", "emergency"), 139)),
]


@pytest.mark.parametrize(("number", "run"), REGRESSIONS, ids=str)
def test_what_was_found_once_is_not_found_again(number: int, run: Run) -> None:
    found = rehearse(drawn(number), run)
    assert isinstance(found, Passed), found


@pytest.mark.parametrize(("number", "run"), TIMED_REGRESSIONS, ids=str)
def test_what_was_found_once_of_time_limits_is_not_found_again(number: int, run: Run) -> None:
    found = rehearse(drawn(number, "drawn-timed"), run)
    assert isinstance(found, Passed), found


def test_a_run_that_is_told_its_kinds_suffers_as_much_of_each_as_where_they_were_drawn() -> None:
    for seed in range(50):
        faults = Faults.drawn(seed)
        assert Faults.drawn(seed, faults.intensities) == faults
    assert Faults.drawn(3, ["loss"]).intensities.keys() == {"loss"}


def test_the_log_of_a_failure_is_told_in_words() -> None:
    log = failing(Machines(coordinator=DecidesEarly)).log
    assert any("  fires: G" in line for line in log)
    assert any("arrives from" in line and " at the coordinator: " in line for line in log)


def test_every_cell_of_the_catalogue_tells_which_places_are_never_commanded_together() -> None:
    apart = cell("one_robot").apart
    assert "robot.to_cv1" in apart["robot.to_mc"]
    assert "conveyor.cv1_run" not in apart["robot.to_mc"]


def test_runs_without_faults_pass_and_fire() -> None:
    done = rehearse(Subject(split(GATE_READ_AGAIN)), Run(0, ()))
    assert isinstance(done, Passed)
    assert done.counts["firings"] > 0
