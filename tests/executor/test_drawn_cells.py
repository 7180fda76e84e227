"""Runs of drawn cells are runs of their loops, which are what their plant files say.

The loop is what the check asks its questions of, so a run that it does not have is a question answered wrongly. What
engineers think of has examples beside it (`test_runs_of_the_loop.py`); here are cells that nobody would think of.
"""

import io
import random
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import pytest
from support.drawn_cells import DrawnCell, drawn_cell, drawn_table
from support.examples import seeds
from support.following import Course, Follower, TooManyMarkingsError

from firable.decompose.splitting.cut import split
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.same_loop import compare
from firable.executor.cell.disturbances import Disturbance, NeverCompletes
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.running import RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.telling import Telling
from firable.nets.net import SignalKind
from firable.semantics.trace import Event, Noted, parse_trace

LINES_MAX: Final = 110
"""After so many lines of its trace a run is cut off."""
FIRINGS_AT_ONCE_MAX: Final = 15
MARKINGS_MAX: Final = 20_000
"""A run that leaves more of its loop's markings open is followed no further."""
OVERDUE_SECONDS: Final = 60.0
OF_THE_NET: Final = ("fire without end", f"within {OVERDUE_SECONDS:g} s")
"""What is said of faults that are no accident at the machines."""
TOLD_LATE: Final = (63, 81, 153, 154)
"""Seeds of cells that do something between two signals, which stands in their loops for that reason alone."""


class CutOffError(Exception):
    """The trace is as long as anybody wants to follow it."""


class ShortStream(io.StringIO):
    """What a trace is written to until it is long enough."""

    def write(self, text: str) -> int:
        if self.getvalue().count("\n") >= LINES_MAX:
            raise CutOffError
        return super().write(text)


@dataclass(frozen=True)
class Run:
    """What was seen of a run, and how it ended; it has no report where it was cut off."""

    events: tuple[Event, ...]
    workpieces: int
    disturbances: tuple[Disturbance, ...]
    report: RunReport | None

    @property
    def accident(self) -> str | None:
        """What happened at the machines, where that ended the run."""
        if self.report is None or self.report.state is not State.FAULT:
            return None
        message = self.report.situation.message
        return None if any(words in message for words in OF_THE_NET) else message

    @property
    def rests(self) -> bool:
        """Whether everything had come to a stop, and workpieces would have come if they could."""
        if self.report is None or self.report.state not in {State.WAITING, State.DEADLOCK}:
            return False
        entered = self.report.delivered + self.report.inside + self.report.lost
        return len(entered) < self.workpieces and not self.disturbances


def run(cell: DrawnCell, seed: int, *, faults: Faults = Faults.NONE) -> Run:
    """A run of the simulated cell; with faults, one of the commands that may fail is never done."""
    draw, stream = random.Random(seed), ShortStream()
    workpieces, disturbances = draw.choice([2, 4, 8]), tuple[Disturbance, ...]()
    if faults is not Faults.NONE:
        disturbances = (NeverCompletes(*draw.choice(failing(cell)), draw.randint(1, 3)),)
    report: RunReport | None = None
    with suppress(CutOffError):
        report = execute(
            split(cell.net),
            SimulatedCell(cell.plant, workpieces=workpieces, seed=seed, disturbances=disturbances),
            Conduct(trace=stream, overdue_seconds=OVERDUE_SECONDS, watch=Watch.IGNORE),
        )
    workpieces += len(cell.plant.full_at_first)
    return Run(tuple(parse_trace(stream.getvalue()).events), workpieces, disturbances, report)


def failing(cell: DrawnCell) -> list[tuple[str, str]]:
    """The machines with the commands that may fail."""
    machines = cell.plant.machines.items()
    commands = [(name, command, does) for name, one in machines for command, does in one.commands.items()]
    return [(name, command) for name, command, does in commands if getattr(does, "may_fail", None)]


def disagreement(cell: DrawnCell, loop: ClosedLoop, seen: Run) -> str | None:
    """The first thing of a run that its loop does not have, with what is needed to look into it.

    Raises `TooManyMarkingsError` where it is not followed to its end.
    """
    words = _first_wrong(cell, Course(Follower(loop, MARKINGS_MAX)), seen)
    sending = Sending.LATE if loop.unsent else Sending.AT_ONCE
    return words and f"sent {sending}: {words}\n{seen.disturbances}\n{cell}\n" + "\n".join(map(str, seen.events))


def _first_wrong(cell: DrawnCell, course: Course, seen: Run) -> str | None:
    at_risk = -1.0  # when an accident could happen last
    end = seen.events[-1].at_seconds if seen.events else 0.0
    for event in seen.events:
        if isinstance(event, Noted) and event.note == "fault":
            break
        if (seen.accident or seen.report is None) and course.follower.can_go_wrong(course.markings):
            at_risk = event.at_seconds
        if not course.goes_on(event):
            # What is done beside an accident, in its instant, is in no run of the loop, where nothing fires behind it;
            # and a run can be cut off there, before it is told of the accident.
            return None if at_risk == event.at_seconds == end else f"{event} is not in the loop"
    if seen.accident and at_risk != end and not course.follower.can_go_wrong(course.markings):
        return f"no accident of the loop: {seen.accident}"
    # In the loop sensors flicker, and keys are pressed, as often as they like.
    is_quiet = not any(word in cell.plant_text for word in ("may_flicker", "acknowledges", "set_by"))
    if seen.rests and is_quiet and not course.follower.can_rest(course.markings):
        return "the run rests, and in the loop something always goes on"
    return None


def disagreements(cell: DrawnCell, seed: int) -> Iterator[str | None]:
    """What the runs of a drawn cell do and its loops do not, however commands are sent: of each run that is followed to
    its end the first such thing, or an empty text; of each other None."""
    for faults in (Faults.NONE, Faults.FOR_GOOD) if failing(cell) else (Faults.NONE,):
        seen = run(cell, seed, faults=faults)
        for sending in Sending:
            try:
                yield disagreement(cell, close(cell.net, cell.plant, faults, sending), seen) or ""
            except TooManyMarkingsError:
                yield None


@pytest.fixture(autouse=True)
def runs_in_circles_end_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.executor.operating.groups.FIRINGS_AT_ONCE_MAX", FIRINGS_AT_ONCE_MAX)


@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(2))
def test_runs_of_drawn_cells_are_runs_of_their_loops(chunk: int) -> None:
    found = [words for seed in seeds(3, chunk) for words in disagreements(drawn_cell(seed), seed)]
    followed = [words for words in found if words is not None]
    assert not any(followed), "\n\n".join(followed)
    assert len(followed) > len(found) / 2


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(5))
def test_runs_of_drawn_tables_are_runs_of_their_loops(seed: int) -> None:
    followed = [words for words in disagreements(drawn_table(seed), seed) if words is not None]
    assert not any(followed), "\n\n".join(followed)


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(2))
@pytest.mark.parametrize("draw", [drawn_cell, drawn_table])
def test_the_loop_of_a_drawn_cell_is_what_its_plant_file_says(seed: int, draw: Callable[[int], DrawnCell]) -> None:
    cell = draw(seed)
    for sending in Sending:
        for faults in Faults:
            loop = close(cell.net, cell.plant, faults, sending)
            assert compare(Plant(cell.net, cell.plant, sending, faults), loop), cell


@pytest.mark.parametrize("seed", TOLD_LATE)
def test_a_loop_that_tells_nothing_late_lacks_a_run_of_a_drawn_cell(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = drawn_cell(seed)
    before = [*disagreements(cell, seed)]
    monkeypatch.setattr(Telling, "told_late", lambda *_: frozenset())
    found = {words: whole for whole, words in zip(before, disagreements(cell, seed), strict=True) if words}
    assert set(found.values()) == {""}, "the loop that tells of it has the whole run"
    assert all(cell.net_text in words and cell.plant_text in words for words in found)


def test_drawn_cells_have_much_of_what_can_be_written() -> None:
    cells = [draw(seed) for seed in range(40) for draw in (drawn_cell, drawn_table)]
    nets, plants = "".join(cell.net_text for cell in cells), "".join(cell.plant_text for cell in cells)
    does = "move grasp put carry index clamp process release stop switch"
    keys = "may_fail when_full occupied holding passes fails acknowledges set_by for_s may_linger may_flicker"
    keys += " full_at_first"
    assert [word for word in f"{does} {keys}".split() if word not in plants] == []
    assert [word for word in ("until", "within", "if", "unless") if f"{word}:" not in nets] == []
    assert any(len(cell.net.controllers) > 1 for cell in cells)
    assert any(cell.plant.departure(cell.plant.arrivals.station) for cell in cells)
    assert any(len(cell.plant.departures) > 1 for cell in cells)
    assert any(departure.raw for cell in cells for departure in cell.plant.departures)
    assert any(
        {signal.name for signal in cell.net.signals if signal.kind is SignalKind.COMPLETION} & {*cell.plant.sensors}
        for cell in cells
    )
