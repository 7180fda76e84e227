"""The figures of a run as Prometheus reads them: how often, how long, how many in vain.

They are counted from what the trace shows and from the messages between controllers and coordinator, so that a figure
and a trace cannot disagree. Times are those of the run. A time that somebody would look at as a distribution (the
cycle, from one firing of a transition to its next) is a histogram; those of which there is one for every place are a
count and a sum, because a histogram for each of a thousand places is what monitoring systems choke on.

`prometheus_client` keeps and prints the numbers. Its process-wide registry is not used: two runs in one process would
count into each other.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, Metric, Summary, generate_latest

from firable.executor.operating.disk_watch import ANSWERS, HANGS
from firable.executor.protocol.messages import Decision, Message, Vote
from firable.nets.net import Net
from firable.semantics.joining import APPLIED
from firable.semantics.trace import CommandSent, Event, Fired, Noted, SignalChanged

_FAULTS: Final = ("fault", "divergence", "emergency stop")
_CYCLE_SECONDS: Final = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 45, 60, 90, 120, 300, 600, 1800, 3600)


class _WithoutBirthdays:
    """A registry without the times at which its series were made, one for each number: they say nothing of the cell."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self.registry = registry

    def collect(self) -> Iterator[Metric]:
        for metric in self.registry.collect():
            metric.samples = [sample for sample in metric.samples if not sample.name.endswith("_created")]
            yield metric


class Metrics:
    """The figures of one run of a net, or of one host with these machines, which knows of no other places.

    To count must not fail, and must not wait.
    """

    def __init__(self, net: Net, machines: Collection[str] = ()) -> None:
        self.net = net
        self.machines = machines
        self.here = {place.name for place in net.places if not machines or place.owner in machines}
        self.registry = registry = CollectorRegistry()
        self.firings = Counter("firable_firings", "Firings of a transition", ["transition"], registry=registry)
        self.cycles = Histogram(
            "firable_cycle_seconds",
            "Time from one firing of a transition to its next",
            ["transition"],
            buckets=_CYCLE_SECONDS,
            registry=registry,
        )
        self.held = Summary("firable_place_seconds", "How long a token stayed on a place", ["place"], registry=registry)
        self.marked = Gauge("firable_marked", "1 while a place holds a token", ["place"], registry=registry)
        self.commands = Counter(
            "firable_commands", "Commands issued to a machine", ["machine", "command", "place"], registry=registry
        )
        self.completions = Summary(
            "firable_command_seconds",
            "Time from a command to its completion",
            ["machine", "command", "place"],
            registry=registry,
        )
        self.signals = Counter("firable_signal_changes", "Changes of a signal taken in", ["signal"], registry=registry)
        self.coalesced = Counter(
            "firable_coalesced_inputs",
            "Changes of a signal that came faster than they were read",
            ["signal"],
            registry=registry,
        )
        self.good = Gauge(
            "firable_input_good",
            "1 while a signal, or a contact of the emergency stop, is read and believed",
            ["signal"],
            registry=registry,
        )
        self.messages = Counter(
            "firable_messages", "Messages between controllers and coordinator", ["kind"], registry=registry
        )
        self.votes = Counter(
            "firable_votes",
            "Votes of a controller on a part of a transition",
            ["controller", "answer"],
            registry=registry,
        )
        self.rounds = Counter("firable_rounds", "Rounds of votes, by how they ended", ["outcome"], registry=registry)
        self.repeats = Counter("firable_repeats", "Messages sent again, unanswered so far", registry=registry)
        damaged = "What came over the link and was dropped, damaged or no message"
        self.damaged = Counter("firable_link_damaged", damaged, registry=registry)
        self.faults = Counter(
            "firable_faults", "Faults, divergences and emergency stops told", ["kind"], registry=registry
        )
        hangs = "1 while the disk of journal or trace does not answer"
        self.hangs = Gauge("firable_disk_hangs", hangs, registry=registry)
        self.latched = Gauge("firable_latched", "1 after an emergency stop, until it is reset", registry=registry)
        self.since: dict[str, float] = {}
        self.fired_at: dict[str, float] = {}
        self.sent_at: dict[str, tuple[float, str]] = {}
        """For each completion signal, when the command that it completes was sent, and of which place."""
        self.decided: dict[str, set[int]] = {}
        """The rounds that are decided and not closed; each has a decision for every participant."""
        for place in (place for place in net.places if place.name in self.here):
            self.marked.labels(place.name).set(place.marked)
            if place.marked:
                self.since[place.name] = 0.0
        for transition in net.transitions:
            self.firings.labels(transition.name)
        for kind in _FAULTS:  # whoever asks for an increase must find what it has increased from
            self.faults.labels(kind)

    def taken_up(self, marking: Collection[str]) -> None:
        """Go on in the marking of a run that was interrupted; how long its tokens have stayed there nobody has seen."""
        self.since.clear()
        for place in self.here:
            self.marked.labels(place).set(place in marking)

    def seen(self, event: Event) -> None:
        """Count an event of the trace."""
        match event:
            case Fired(at, transitions, number):
                for name in transitions:
                    self._fired(at, name)
                    if number is None or not self.machines:
                        self._moved(at, name, self.here)
            case SignalChanged(at, name, value):
                self.signals.labels(name).inc()
                if value and name in self.sent_at:
                    sent, place = self.sent_at.pop(name)
                    self.completions.labels(*self._labels(place)).observe(at - sent)
            case CommandSent(at, place):
                self.commands.labels(*self._labels(place)).inc()
                if (completion := self.net.place(place).completion) is not None:
                    self.sent_at[completion] = at, place
            case Noted(at, note, {"controller": str(controller), "transition": str(name)}) if note == APPLIED:
                self._moved(at, name, {place.name for place in self.net.places if place.owner == controller})
            case Noted(_, note):
                if note in _FAULTS:
                    self.faults.labels(note).inc()
                if note in ("emergency stop", "reset"):
                    self.latched.set(note == "emergency stop")
                if note in (HANGS, ANSWERS):
                    self.hangs.set(note == HANGS)

    def message(self, message: Message, *, again: bool = False) -> None:
        """Count a message between a controller and the coordinator; `again` where it repeats an unanswered one."""
        if again:
            self.repeats.inc()
            return
        self.messages.labels(type(message).__name__).inc()
        match message:
            case Vote(controller, _, promised):
                self.votes.labels(controller, "yes" if promised else "no").inc()
            case Decision(round=number) if number not in (decided := self.decided.get(message.coordinator, set())):
                still = {one for one in decided if one >= message.closed_below}
                self.decided[message.coordinator] = still | {number}
                self.rounds.labels("aborted" if message.committed is None else "committed").inc()

    def input_read(self, signal: str, *, good: bool) -> None:
        """Say how far what a driver reads of a signal may be believed."""
        self.good.labels(signal).set(good)

    def inputs_coalesced(self, signal: str, changes: int) -> None:
        """Count changes of a signal that a driver saw and could not hand over one by one."""
        self.coalesced.labels(signal).inc(changes)

    def came_damaged(self, count: int) -> None:
        """Count what came over the link, and was dropped."""
        self.damaged.inc(count)

    def text(self) -> bytes:
        """All figures in Prometheus' text format."""
        return generate_latest(_WithoutBirthdays(self.registry))

    def _fired(self, at_seconds: float, name: str) -> None:
        self.firings.labels(name).inc()
        if (before := self.fired_at.get(name)) is not None:
            self.cycles.labels(name).observe(at_seconds - before)
        self.fired_at[name] = at_seconds

    def _moved(self, at_seconds: float, name: str, places: Collection[str]) -> None:
        transition = self.net.transition(name)
        for place in (place for place in transition.inputs if place in places):
            self.marked.labels(place).set(0)
            if (since := self.since.pop(place, None)) is not None:
                self.held.labels(place).observe(at_seconds - since)
        for place in (place for place in transition.outputs if place in places):
            self.marked.labels(place).set(1)
            self.since[place] = at_seconds

    def _labels(self, place: str) -> tuple[str, str, str]:
        command = self.net.place(place).command
        return (command.machine, command.command, place) if command is not None else ("", "", place)
