"""Traces of several hosts, joined by their rounds, are a trace of the central net."""

import io
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest
from support.examples import seeds
from support.free_parts import freed
from support.host_traces import Hosts

from firable.decompose import split
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.semantics.joining import APPLIED, STANDS, VOTED, join
from firable.semantics.replaying import replay
from firable.semantics.trace import CommandSent, Event, Fired, Noted, Trace, parse_trace

NETS = ["one_robot", "two_robots_shared", "one_robot_mc_late"]


@cache
def decomposition_of(name: str, *, free: bool) -> Decomposition:
    decomposition = split(catalogue_net(name))
    return freed(decomposition) if free else decomposition


def of_hosts(name: str, seed: int, steps: int = 600, *, free: bool = False) -> list[Trace]:
    return Hosts(decomposition_of(name, free=free), seed).run(steps)


@pytest.mark.seeds
@pytest.mark.parametrize("free", [False, True], ids=["promises", "free"])
@pytest.mark.parametrize("name", NETS)
def test_the_traces_of_hosts_join_to_a_trace_of_the_net_whatever_their_clocks_say(name: str, *, free: bool) -> None:
    fired = 0
    for seed in seeds(20):
        traces = of_hosts(name, seed, free=free)
        joined = join(catalogue_net(name), traces)
        done = replay(catalogue_net(name), joined)
        assert done.complete, seed
        fired += done.firings
        lines = sum(isinstance(event, Fired | CommandSent) for trace in traces for event in trace.events)
        assert sum(isinstance(event, Fired | CommandSent) for event in joined.events) == lines
    assert fired > 100


def test_by_the_clocks_alone_they_do_not() -> None:
    net, wrong = catalogue_net("one_robot"), 0
    for seed in range(10):
        traces = of_hosts("one_robot", seed)
        events = [(t.header.began + e.at_seconds, e) for t in traces for e in t.events]
        events.sort(key=lambda pair: pair[0])
        by_clock = tuple(replace(event, at_seconds=0.0) for _, event in events)
        try:
            replay(net, Trace(replace(traces[0].header, machines=()), by_clock))
        except InputError:
            wrong += 1
    assert wrong > 2


def test_a_trace_of_a_host_is_read_as_it_was_written() -> None:
    for trace in of_hosts("one_robot", 1):
        text = io.StringIO()
        trace.write(text)
        assert parse_trace(text.getvalue(), trace.file) == trace


def test_a_trace_that_was_cut_off_leaves_the_joined_one_incomplete() -> None:
    net, traces = catalogue_net("one_robot"), of_hosts("one_robot", 1)
    for i, trace in enumerate(traces):
        for length in (0, len(trace.events) // 2, len(trace.events)):
            cut = [*traces[:i], replace(trace, events=trace.events[:length], end=None), *traces[i + 1 :]]
            joined = join(net, cut)
            assert joined.end is None
            assert not replay(net, joined).complete


def refused(traces: list[Trace]) -> str:
    with pytest.raises(InputError) as refusal:
        replay(catalogue_net("one_robot"), join(catalogue_net("one_robot"), traces))
    assert refusal.value.diagnostics[0].code in {"F5004", "F5005"}
    return str(refusal.value)


def test_traces_that_are_not_of_one_run_of_all_hosts_are_refused() -> None:
    traces = of_hosts("one_robot", 1)
    assert "no trace of 'robot'" in refused([t for t in traces if t.header.machines != ("robot",)])
    assert "no trace of the coordinator" in refused(traces[1:])
    assert "two traces" in refused([*traces, traces[1]])
    assert "whole run" in refused([*traces[:-1], replace(traces[-1], header=replace(traces[-1].header, machines=()))])
    other = replace(traces[0].header, digest="0" * 64)
    assert "different nets" in refused([*traces[1:], replace(traces[0], header=other)])


def test_a_firing_without_a_vote_and_a_part_without_a_decision_are_refused() -> None:
    traces = of_hosts("one_robot", 1)
    fired = next(e for e in traces[0].events if isinstance(e, Fired))

    def left_out(event: Event) -> bool:
        return isinstance(event, Noted) and event.note == VOTED and event.data["round"] == fired.round

    unvoted = [replace(t, events=tuple(e for e in t.events if not left_out(e))) for t in traces]
    assert f"for '{fired.transitions[0]}' in round {fired.round}" in refused(unvoted)
    undecided = tuple(e for e in traces[0].events if e != fired)
    assert f"the decision of round {fired.round}" in refused([replace(traces[0], events=undecided), *traces[1:]])


def test_a_firing_without_a_vote_that_stands_and_one_on_a_vote_that_was_used_are_refused() -> None:
    traces = of_hosts("one_robot", 1, free=True)

    def with_notes(note: str, keep: Callable[[int], bool]) -> list[Trace]:
        """The traces with some of these notes alone, by their numbers in each trace."""
        found = []
        for trace in traces:
            places = [i for i, event in enumerate(trace.events) if isinstance(event, Noted) and event.note == note]
            dropped = {place for number, place in enumerate(places) if not keep(number)}
            found.append(replace(trace, events=tuple(e for i, e in enumerate(trace.events) if i not in dropped)))
        return found

    assert replay(catalogue_net("one_robot"), join(catalogue_net("one_robot"), with_notes(STANDS, lambda _: True)))
    assert "nowhere before stands the yes of" in refused(with_notes(STANDS, lambda _: False))
    assert "nowhere before stands the yes of" in refused(with_notes(STANDS, lambda number: number == 0))
    assert "nowhere before stands the yes of" in refused(with_notes(APPLIED, lambda _: False))


def test_commands_that_are_told_before_their_decision_are_noticed() -> None:
    found = 0
    for seed in range(5):
        traces = of_hosts("one_robot", seed)
        for i, trace in enumerate(traces):
            events = tuple(e for e in trace.events if not (isinstance(e, Noted) and e.note == APPLIED))
            early = replace(trace, events=events, header=replace(trace.header, began=0.0))
            try:
                net = catalogue_net("one_robot")
                replay(net, join(net, [*traces[:i], early, *traces[i + 1 :]]))
            except InputError:
                found += 1
    assert found > 5
