"""Traces are read back as written, and replayed against the net."""

import io
import json

import pytest

from firable.nets.diagnostics import InputError
from firable.nets.net import Command, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.semantics.replaying import replay
from firable.semantics.trace import (
    CommandSent,
    Discipline,
    End,
    Event,
    Fired,
    Header,
    Noted,
    SignalChanged,
    Start,
    Trace,
    parse_trace,
)

NET = Net(
    "drill",
    places=(Place("idle", marked=True), Place("busy", command=Command("D", "RUN"), completion="done")),
    transitions=(
        Transition("start", ("idle",), ("busy",)),
        Transition("stop", ("busy",), ("idle",), external=(ExternalGate("done"),)),
    ),
    signals=(Signal("done", kind=SignalKind.COMPLETION),),
)

RUN: tuple[Event, ...] = (
    Fired(0.0, ("start",)),
    CommandSent(0.0, "busy"),
    SignalChanged(1.5, "done", True),
    Noted(1.6, "operator", {"wish": "none"}),
    Fired(1.75, ("stop",)),
)


def trace(*events: Event, marking: tuple[str, ...] = ("idle",)) -> Trace:
    return Trace(Header("drill", signals=True, commands=True), events, End(2.0, marking))


def text_of(item: Trace) -> str:
    stream = io.StringIO()
    item.write(stream)
    return stream.getvalue()


def deviation(item: Trace) -> str:
    with pytest.raises(InputError) as caught:
        replay(NET, item)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "F5004"
    assert diagnostic.span is not None
    return f"{diagnostic.span.line}: {diagnostic.message}"


def test_a_trace_is_read_back_as_written() -> None:
    read = parse_trace(text_of(trace(*RUN)))
    assert (read.header, read.events, read.end) == (trace().header, RUN, trace().end)


def test_a_run_of_the_net_replays() -> None:
    result = replay(NET, trace(*RUN))
    assert (NET.names(result.marking), result.firings, result.commands, result.complete) == (("idle",), 2, 1, True)


def test_a_firing_that_is_not_firable_is_no_event_of_the_net() -> None:
    assert deviation(trace(RUN[0], RUN[1], Fired(1.0, ("start",)))) == "4: 'start' is not firable"


def test_a_firing_through_a_closed_gate_is_no_event_of_the_net() -> None:
    assert "external gate is closed" in deviation(trace(RUN[0], RUN[1], RUN[4]))


def test_a_command_that_is_never_sent_is_noticed_when_the_token_leaves() -> None:
    without_signals = Trace(Header("drill", commands=True), (RUN[0], RUN[4]), End(2.0, ("idle",)))
    assert "before its command was sent" in deviation(without_signals)


def test_a_command_that_is_never_sent_is_noticed_at_the_end() -> None:
    assert "never sent" in deviation(trace(RUN[0], marking=("busy",)))


def test_a_command_sent_twice_is_noticed() -> None:
    assert deviation(trace(RUN[0], RUN[1], RUN[1])) == "4: a command of 'busy' that is not due"


def test_a_final_marking_that_was_not_reached_is_noticed() -> None:
    assert "another marking" in deviation(trace(*RUN, marking=("busy",)))


def test_a_trace_of_another_net_is_refused() -> None:
    assert "trace is of the net 'mill'" in deviation(Trace(Header("mill"), ()))


def test_a_trace_that_begins_in_the_middle_is_judged_from_there() -> None:
    def begun(*events: Event, start: Start, marking: tuple[str, ...]) -> Trace:
        return Trace(Header("drill", signals=True, commands=True, start=start), events, End(2.0, marking))

    owing = begun(*RUN[1:], start=Start(("busy",), (), ("busy",)), marking=("idle",))
    assert parse_trace(text_of(owing)).header == owing.header
    done = replay(NET, owing)
    assert (done.firings, done.commands) == (1, 1)
    assert replay(NET, begun(RUN[4], start=Start(("busy",), ("done",)), marking=("idle",))).firings == 1
    assert "closed" in deviation(begun(RUN[4], start=Start(("busy",)), marking=("idle",)))
    assert "not due" in deviation(begun(RUN[1], start=Start(("busy",)), marking=("busy",)))
    assert deviation(begun(start=Start(("mill",)), marking=())) == "1: there is no place 'mill'"
    assert deviation(begun(start=Start((), ("mill",)), marking=())) == "1: there is no signal 'mill'"
    assert "not due" in deviation(begun(start=Start(("idle",), (), ("busy",)), marking=("idle",)))


@pytest.mark.parametrize("start", ["7", "{}", '{"marking": ["busy"], "signals": [], "owed": [1]}'])
def test_what_does_not_say_where_a_trace_begins_is_one_clear_error(start: str) -> None:
    head, rest = text_of(trace(*RUN)).split("}\n", 1)
    with pytest.raises(InputError, match="not where a trace begins"):
        parse_trace(f'{head}, "start": {start}}}\n{rest}')


def test_two_firings_at_once_are_no_interleaving() -> None:
    assert "several transitions" in deviation(trace(Fired(0.0, ("start", "stop"))))


def test_a_step_that_leaves_out_an_enabled_transition_is_not_maximal() -> None:
    net = Net(
        "two",
        places=(Place("a", marked=True), Place("b", marked=True)),
        transitions=(Transition("t", ("a",)), Transition("u", ("b",))),
    )
    whole = Trace.of_firings(net, [("t", "u")], Discipline.STEP)
    assert replay(net, whole).marking == 0
    with pytest.raises(InputError, match="not a maximal step"):
        replay(net, Trace.of_firings(net, [("t",), ("u",)], Discipline.STEP))


def test_time_does_not_run_backwards() -> None:
    assert deviation(trace(RUN[0], RUN[1], SignalChanged(-1.0, "done", True))) == "4: time runs backwards"


def test_a_completion_from_before_its_command_is_stale() -> None:
    again = (Fired(1.8, ("start",)), CommandSent(1.8, "busy"))
    assert "external gate is closed" in deviation(trace(*RUN, *again, Fired(1.9, ("stop",))))


def test_a_completion_does_not_come_before_its_command() -> None:
    assert "that was not sent" in deviation(trace(RUN[0], SignalChanged(0.0, "done", True), RUN[1]))


def test_a_transition_that_wants_a_signal_both_ways_fires_in_no_trace() -> None:
    torn = Transition("t", (), ("p",), external=(ExternalGate("s"), ExternalGate("s", wanted=False)))
    net = Net("torn", (Place("p"),), (torn,), (Signal("s"),))
    with pytest.raises(InputError, match="can never fire"):
        replay(net, Trace(Header("torn"), (Fired(0.0, ("t",)),)))


def test_a_transition_does_not_fire_twice_in_one_step() -> None:
    net = Net("one", (Place("a", marked=True),), (Transition("t", ("a",)),))
    with pytest.raises(InputError, match="fires twice"):
        replay(net, Trace(Header("one", discipline=Discipline.STEP), (Fired(0.0, ("t", "t")),)))


def test_a_deadlock_that_is_none_is_noticed() -> None:
    ended = Trace(trace().header, RUN, End(2.0, ("idle",), "deadlock"))
    assert "a deadlock that is none" in deviation(ended)


def test_a_trace_that_was_cut_off_replays_as_incomplete() -> None:
    lines = text_of(trace(*RUN)).splitlines(keepends=True)
    cut = "".join(lines[:-1]) + lines[-1][:9]
    assert not replay(NET, parse_trace(cut)).complete


@pytest.mark.parametrize(
    "line",
    [
        "nothing",
        "[]",
        '{"at": 1}',
        '{"at": 0, "fired": []}',
        '{"at": 0, "signal": "done", "value": 2}',
        '{"at": 0, "signal": "done", "value": true}',
        '{"at": 0, "signal": "done", "value": 1.0}',
        '{"at": 0, "fired": ["go"], "round": true}',
        '{"at": true, "fired": ["go"]}',
        "[" * 100_000,
        '{"at": NaN, "note": "x"}',
        '{"at": 1e400, "note": "x"}',
        f'{{"at": {10**400}, "note": "x"}}',
        '{"at": 1e12, "fired": ["go"]}',
    ],
)
def test_a_malformed_line_is_named(line: str) -> None:
    header = text_of(trace()).splitlines()[0]
    with pytest.raises(InputError, match=r"<trace>:2:1: error\[F5005\]"):
        parse_trace(f"{header}\n{line}\n")


@pytest.mark.parametrize("wrong", [{"began": one} for one in (-1, 1e12, 10**400, True)] + [{"firable_trace": True}])
def test_a_run_that_began_at_no_date_or_in_no_version_is_none(wrong: dict[str, object]) -> None:
    header = {**json.loads(text_of(trace()).splitlines()[0]), **wrong}
    with pytest.raises(InputError, match=r"<trace>:1:1: error\[F5005\]"):
        parse_trace(json.dumps(header) + "\n")


def test_a_file_that_does_not_begin_with_a_header_is_no_trace() -> None:
    with pytest.raises(InputError, match="not the header"):
        parse_trace('{"at": 0, "fired": ["t"]}\n')


def test_an_empty_trace_file_is_refused() -> None:
    with pytest.raises(InputError, match="F1002"):
        parse_trace("")
