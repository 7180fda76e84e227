"""Timers in traces: cleared when the token enters, set only while it waits, and taken by gates like other signals."""

import pytest

from firable.nets.diagnostics import InputError
from firable.nets.text import parse_net
from firable.semantics.replaying import Replay, replay
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, SignalChanged, Trace

NET = parse_net(
    """\
firable: 1
cell: c
start: free
places:
  free:
  go: {send: {machine: M, command: GO}, until: there, within: 1s}
transitions:
  start: {from: free, to: go}
  end: {from: go, to: free}
  again: {from: go_fault, to: go}
"""
)


def fired(name: str) -> Event:
    return Fired(0.0, (name,))


def signal(name: str, value: bool = True) -> Event:
    return SignalChanged(0.0, name, value)


SENT = CommandSent(0.0, "go")
LATE = signal("go_overdue")


def played(*events: Event, end: tuple[str, ...] | None = None) -> Replay:
    header = Header("c", signals=True, commands=True)
    return replay(NET, Trace(header, events, None if end is None else End(0.0, end)))


def test_a_timeout_is_a_firing_like_any_other() -> None:
    assert played(fired("start"), SENT, LATE, fired("go_timeout"), end=("go_fault",)).firings == 2


@pytest.mark.parametrize(
    ("events", "says"),
    [
        ([fired("start"), SENT, fired("go_timeout")], "'go_overdue' is 0 and must be 1"),
        ([fired("start"), SENT, LATE, signal("there"), fired("go_timeout")], "'there' is 1 and must be 0"),
        ([LATE], "which holds no token"),
        ([fired("start"), LATE], "that was not sent"),
        ([fired("start"), SENT, signal("there"), LATE], "after 'there' has come"),
        (
            [fired("start"), SENT, LATE, fired("go_timeout"), fired("again"), SENT, fired("go_timeout")],
            "'go_overdue' is 0 and must be 1",
        ),
    ],
)
def test_a_timer_that_cannot_be_is_no_event_of_the_net(events: list[Event], says: str) -> None:
    with pytest.raises(InputError) as caught:
        played(*events)
    (problem,) = caught.value.diagnostics
    assert problem.code == "F5004"
    assert says in f"{problem.message} {problem.hint}"


def test_a_timer_may_be_told_to_be_cleared_at_any_time() -> None:
    assert played(signal("go_overdue", value=False), fired("start"), SENT).firings == 1


AGAIN = [fired("start"), SENT, LATE, fired("go_timeout"), fired("again")]
"""The token was let go while the machine was at its command, and comes again; its new command is still to be sent."""


def test_the_completion_of_a_command_whose_time_was_over_may_come_before_the_next_one_and_opens_nothing() -> None:
    assert played(*AGAIN, signal("there"), SENT, end=("go",)).commands == 2
    with pytest.raises(InputError, match="'there' is 0 and must be 1"):
        played(*AGAIN, signal("there"), SENT, fired("end"))
    assert played(*AGAIN, signal("there"), SENT, signal("there"), fired("end"), end=("free",)).firings == 4


def test_one_completion_is_not_that_of_two_commands_before_the_next_is_sent() -> None:
    with pytest.raises(InputError, match="completes a command of 'go' that was not sent"):
        played(*AGAIN[:4], signal("there"), fired("again"), signal("there"))
    with pytest.raises(InputError, match="completes a command of 'go' that was not sent"):
        played(fired("start"), signal("there"))
