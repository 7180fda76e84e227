"""Emergency stops at the terminal of `--step`, at which others act as well: what is asked, and what an answer moves."""

from __future__ import annotations

import asyncio
import io
import os
import sys
from collections.abc import Callable, Sequence

import pytest
from support.cells import decomposition_of
from support.waiting import PATIENCE_SECONDS, until

from firable.cli import stepping
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.driver import Answer, Latched
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.restart import uncertain
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.whereabouts import AT, MACHINES, Elsewhere
from firable.nets.interchange import net_digest
from firable.nets.net import Place
from firable.semantics.replaying import replay
from firable.semantics.trace import parse_trace

DECOMPOSITION = decomposition_of("one_robot")
NET = DECOMPOSITION.net


class Silent(DryRunDriver):
    """Machines that cannot say what became of a command."""

    async def ask(self, place: Place, entry: int) -> Answer:
        del place, entry
        return Answer.UNKNOWN


class Terminal:
    """A terminal at which what is typed, and what happens elsewhere, was laid down; it remembers what was asked."""

    def __init__(self, host: Host, acts: tuple[Act, ...]) -> None:
        self.host, self.acts = host, [*acts]
        self.ahead: list[str] = []
        """What is typed before it is asked for."""
        self.asked_for: list[tuple[str, int]] = []
        """The first word of each question, and how many transitions had fired by then."""

    async def asked(self, prompt: str, is_moot: Callable[[], bool]) -> str | None:
        if is_moot():
            raise stepping._MootError
        self.asked_for.append((prompt.strip().split()[0], sum(self.host.recorder.firings.values())))
        if self.ahead:
            return self.ahead.pop(0)
        while True:
            await asyncio.sleep(4)
            if is_moot():
                raise stepping._MootError
            if not self.acts:
                return None
            act = self.acts.pop(0)
            if isinstance(act, str):
                return act
            act(self)

    def unasked(self) -> bool:
        if self.ahead:
            self.ahead.pop(0)
            return True
        return False

    @property
    def wants(self) -> bool:
        return bool(self.ahead)


Act = str | Callable[[Terminal], object]


def run(
    monkeypatch: pytest.MonkeyPatch,
    *acts: Act,
    journal: MemoryJournal | None = None,
    stream: io.StringIO | None = None,
    ahead: Sequence[str] = (),
    elsewhere: Elsewhere | None = None,
    kind: type[DryRunDriver] = Silent,
) -> tuple[Situation, list[tuple[str, int]]]:
    """A run at whose terminal that is typed, and elsewhere done: how it ended, and what was asked."""
    journal, stream = journal or MemoryJournal(), stream or io.StringIO()

    def driver() -> Latched:
        return kind(DECOMPOSITION.subnets, 10.0)

    recorder = Recorder(NET, net_digest(NET), stream, journal.kept(TRACE).get(KEY))
    with stepping.stepping(1.0, to_stderr=False) as operator:
        conduct = Conduct(operator=operator, resume=elsewhere is not None)
        host = Host(
            DECOMPOSITION,
            driver(),
            recorder,
            conduct,
            journal=journal,
            begin_seconds=recorder.at_seconds,
            latched=driver,
            elsewhere=elsewhere,
        )
        terminal = Terminal(host, acts)
        terminal.ahead.extend(ahead)
        monkeypatch.setattr(stepping, "_TypedMeanwhile", lambda _: terminal)
        situation = run_in_virtual_time(host.main())
    assert replay(NET, parse_trace(stream.getvalue())).complete
    return situation, terminal.asked_for


def stopped(at: Terminal) -> None:
    at.host.emergency_stop("a person")


def stopped_while_somebody_types(at: Terminal) -> None:
    asyncio.get_running_loop().call_later(25, at.ahead.extend, ("reset", "reset"))
    asyncio.get_running_loop().call_later(25, at.host.emergency_stop, "a person")


def reset(at: Terminal) -> None:
    assert at.host.reset() == ()


def reset_while_somebody_types(at: Terminal) -> None:
    reset(at)
    at.ahead.extend(("conveyor.cv1_run=not-received", "r"))


def said(at: Terminal) -> None:
    (place,) = uncertain(at.host)
    assert not at.host.say(place, Answer.NOT_RECEIVED)


def resumed(at: Terminal) -> None:
    assert at.host.resume()


def resumed_until_somebody_types(at: Terminal) -> None:
    resumed(at)
    asyncio.get_running_loop().call_later(45, at.ahead.append, "")


def typed_while_the_next_step_waits(at: Terminal) -> None:
    asyncio.get_running_loop().call_later(4.5, at.ahead.extend, ("", "s"))  # half a second after its Enter


def test_what_is_typed_while_a_step_waits_for_a_machine_is_heard_before_the_machine_moves_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    situation, asked = run(monkeypatch, "", typed_while_the_next_step_waits, "")
    assert asked == [("[Enter]", 1), *[("[Enter]", 2)] * 3], "the second Enter asks for the same step, and s for none"
    assert (situation.state, situation.message.split(";")[0]) == (State.STOPPED, "stopped by the operator")


@pytest.mark.parametrize("is_terminal", [True, False])
@pytest.mark.parametrize("typed", ["s\n", ""], ids=["s", "end of input"])
def test_a_person_is_heard_unasked_and_a_script_is_asked(
    is_terminal: bool, typed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    near, far = os.openpty() if is_terminal else os.pipe()[::-1]
    with os.fdopen(far) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        meanwhile = stepping._TypedMeanwhile(lambda *_, **__: None)
        assert not meanwhile.wants
        if typed:
            os.write(near, typed.encode())
            until(lambda: meanwhile.lines, "the line")
            assert meanwhile.wants == is_terminal
        if is_terminal:
            os.write(near, b"\x04")  # Ctrl-D
        else:
            os.close(near)
        assert meanwhile.ended.wait(PATIENCE_SECONDS)
        assert meanwhile.wants == is_terminal


def test_an_emergency_stop_withdraws_the_question_and_the_way_back_is_typed_in_three_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    words = ("", "r", "reset", "conveyor.cv1_run", "conveyor.cv1_run=not-received", "", "e", "r", "", "s")
    situation, asked = run(monkeypatch, stopped, *words)
    assert asked == [
        ("[Enter]", 1),
        *[("type", 1)] * 3,  # neither Enter nor r resets
        *[("what", 1)] * 2,
        *[("[r]", 1)] * 3,  # nor do Enter and e take anything up
        ("[Enter]", 2),
        ("[Enter]", 3),
    ]
    assert (situation.state, situation.is_emergency) == (State.STOPPED, False)


def test_enter_for_the_next_step_takes_up_no_run_that_was_stopped_and_reset_elsewhere_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    situation, asked = run(monkeypatch, stopped, reset, said, "", "", "s")
    assert asked == [("[Enter]", 1), ("type", 1), ("what", 1), *[("[r]", 1)] * 3]
    assert (situation.state, situation.is_held) == (State.STOPPED, True)
    assert situation.message.startswith("stopped by the operator; the run was interrupted")


def test_a_run_that_is_taken_up_elsewhere_is_paused_at_the_terminal_and_stepped_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    situation, asked = run(monkeypatch, stopped, reset, said, resumed, "", "s")
    assert [question for question, _ in asked] == ["[Enter]", "type", "what", "[r]", "[Enter]", "[Enter]"]
    assert asked[-1][1] == asked[-2][1] + 1
    assert not situation.is_emergency


def test_a_run_that_is_resumed_elsewhere_runs_on_until_something_is_typed(monkeypatch: pytest.MonkeyPatch) -> None:
    _, asked = run(monkeypatch, "", resumed_until_somebody_types, "", "s")
    assert [question for question, _ in asked] == ["[Enter]"] * 4
    first, second, third, last = (fired for _, fired in asked)
    assert (first, second, last) == (1, 2, third + 1)
    assert third > second + 3


def test_what_was_typed_ahead_resets_nothing_and_a_run_that_runs_on_is_latched_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    situation, asked = run(monkeypatch, stopped_while_somebody_types, "r", "s")
    assert [question for question, _ in asked] == ["[Enter]", "type"]
    assert situation.is_emergency


def test_what_was_typed_ahead_of_a_reset_elsewhere_takes_nothing_up(monkeypatch: pytest.MonkeyPatch) -> None:
    situation, asked = run(monkeypatch, stopped, reset_while_somebody_types, said, "s")
    assert asked == [("[Enter]", 1), ("type", 1), ("what", 1), ("[r]", 1)]
    assert (situation.state, situation.is_held) == (State.STOPPED, True)
    assert situation.message.startswith("stopped by the operator; the run was interrupted")


@pytest.mark.parametrize("last", [("s",), ()], ids=["s", "end of input"])
def test_who_resets_nothing_ends_the_run_as_an_emergency_stop(
    last: tuple[Act, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    situation, asked = run(monkeypatch, stopped, *last)
    assert asked == [("[Enter]", 1), ("type", 1)]
    assert (situation.state, situation.message) == (State.STOPPED, "emergency stop: a person")
    assert situation.is_emergency


@pytest.mark.parametrize(("kind", "what"), [(Silent, ("robot.to_cv1=not-received",)), (DryRunDriver, ())])
def test_machines_elsewhere_are_said_to_be_those_of_the_journal_before_they_are_asked(
    kind: type[DryRunDriver], what: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    journal, before, stream = MemoryJournal(), io.StringIO(), io.StringIO()
    run(monkeypatch, "", "s", journal=journal, stream=before)
    stream.writelines(before.getvalue().splitlines(keepends=True)[:-1])  # the end is none any more
    moved = Elsewhere({"CV1": ("serial there", "serial here")}, {"CV1": "serial here"})
    words = ("", "r", *what, "r", "", "s")
    situation, asked = run(
        monkeypatch, *words, journal=journal, stream=stream, ahead=("r", "r"), elsewhere=moved, kind=kind
    )
    assert [question for question, _ in asked] == ["[r]", "[r]", *["what"] * len(what), "[r]", "[Enter]", "[Enter]"]
    *before_it_is_taken_up, stepped, last = (fired for _, fired in asked)
    assert set(before_it_is_taken_up) == {0}, "neither what is typed ahead nor Enter moves anything, nor the first r"
    assert (stepped, last) == (1, 2)
    assert not situation.is_held
    assert journal.kept(MACHINES)[AT] == {"CV1": "serial here"}
    assert stream.getvalue().index('"found again"') < stream.getvalue().index('"asked after"')
