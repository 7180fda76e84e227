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
