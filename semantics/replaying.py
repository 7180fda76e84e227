"""The replay of a trace: plays it on the net by the reference player, and finds the first line that is no event of it.

Each firing must be firable, in a trace that records signals with its external gates open; every entry of a place with
an output signal must send its command exactly once before the token leaves; and the last line must show the marking
reached. A token that enters a place clears the completion signal of the place and its timer: a value from before is
stale and opens no gate, a completion may not come before its command, and a timer is set only while the token is there
and its completion has not come. Where a time limit has let the token go, the command is still under way, and its
completion may come at any time: also between the next entry, which a trace shows where it is decided, and the command
of that, which clears it once more. A trace without its last line replays as incomplete. One that begins in the middle,
because its run has taken a cell over, is judged from the marking that its first line names.

One judge for counterexamples of the analysis and logs of the executor, and the slow one on purpose: it shares no
firing rule with what wrote the trace.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import NoReturn

from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.net import Marking, Net, Place
from firable.semantics.player import Player
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
)


@dataclass(frozen=True, slots=True)
class Replay:
    """What a trace did, once it is known to be a trace of the net."""

    marking: Marking
    firings: int
    commands: int
    complete: bool


def replay(net: Net, trace: Trace) -> Replay:
    """Play the trace by the reference player; raises `InputError` F5004 with the line that is no event of the net."""
    replayer = Replayer(net, trace.header, trace.file)
    for event in trace.events:
        replayer.take(event)
    if trace.end is not None:
        replayer.end(trace.end)
    return Replay(replayer.marking, replayer.firings, replayer.commands, trace.end is not None)


class Replayer:
    """The marking, the valuation and the commands owed, as a trace goes on: a judge of one event after the other.

    `player` plays the tokens: the reference player, or one that remembers what it has answered. Raises `InputError`
    F5004 at the first line that is no event of the net, the header among them.
    """

    def __init__(self, net: Net, header: Header, file: str = "<trace>", player: Player | None = None) -> None:
        self.net = net
        self.header = header
        self.file = file
        self.player = player or Player(net)
        self.marking = net.initial_marking
        self.signals: dict[str, bool] = {}
        self.owed: set[str] = set()
        self.under_way: set[str] = set()
        """The completions of commands that were sent and have not come."""
        self.timed = {place.within.timer: place for place in net.places if place.within is not None}
        self.now_seconds = 0.0
        self.firings = 0
        self.commands = 0
        self.line = 1
        """The number of the line that is judged."""
        if header.net != net.name:
            self._deviates(header, f"the trace is of the net '{header.net}'", f"this net is '{net.name}'")
        if header.start is not None:
            self._begin(header, header.start)

    def _begin(self, header: Header, start: Start) -> None:
        if unknown := [name for name in start.marking if name not in self.net.place_index]:
            self._deviates(header, f"there is no place '{unknown[0]}'", "is the trace of another net?")
        if unknown := [name for name in start.signals if name not in self.net.signal_index]:
            self._deviates(header, f"there is no signal '{unknown[0]}'", "is the trace of another net?")
        self.marking = self.net.marking(start.marking)
        self.signals = dict.fromkeys(start.signals, True)
        marked = [self.net.place(name) for name in start.marking]
        commanding = {place.name for place in marked if place.command is not None}
        if unowed := sorted(set(start.owed) - commanding):
            self._deviates(header, f"a command of '{unowed[0]}' that is not due", "no token is there that sends one")
        self.owed = set(start.owed)

    def _deviates(self, record: Header | Event | End, message: str, hint: str) -> NoReturn:
        span = Span(self.file, self.line, 1, json.dumps(record.to_json()))
        raise InputError([Diagnostic("F5004", message, hint, span=span)])

    def take(self, event: Event) -> None:
        """Judge the next event."""
        self.line += 1
        self._passed(event, event.at_seconds)
        match event:
            case Fired():
                self._fired(event)
            case SignalChanged():
                self._changed(event)
            case CommandSent():
                self._sent(event)
            case Noted():
                pass

    def end(self, end: End) -> None:
        """Judge the last line."""
        self.line += 1
        self._passed(end, end.at_seconds)
        self._ended(end)

    def _passed(self, record: Event | End, at_seconds: float) -> None:
        if at_seconds < self.now_seconds:
            self._deviates(record, "time runs backwards", f"the line before is of {self.now_seconds:g} s")
        self.now_seconds = at_seconds

    def _changed(self, event: SignalChanged) -> None:
        if event.signal not in self.net.signal_index:
            self._deviates(event, f"there is no signal '{event.signal}'", "is the trace of another net?")
        unsent = [place for place in sorted(self.owed) if self.net.place(place).completion == event.signal]
        if event.value and unsent and event.signal not in self.under_way:
            self._deviates(
                event, f"'{event.signal}' completes a command of '{unsent[0]}' that was not sent", "it is stale"
            )
        if event.value and (place := self.timed.get(event.signal)) is not None:
            self._timed_out(event, place)
        self.signals[event.signal] = event.value
        if event.value:
            self.under_way.discard(event.signal)

    def _timed_out(self, event: SignalChanged, place: Place) -> None:
        """When a timer may be set; not after what time, since a controller has a clock of its own."""
        if not self.marking >> self.net.place_index[place.name] & 1:
            self._deviates(event, f"'{event.signal}' times '{place.name}', which holds no token", "it is stale")
        if place.name in self.owed:
            self._deviates(
                event, f"'{event.signal}' times a command of '{place.name}' that was not sent", "it is stale"
            )
        if place.completion is not None and self.signals.get(place.completion, False):
            self._deviates(event, f"'{event.signal}' is set after '{place.completion}' has come", "it came in time")

    def _fired(self, event: Fired) -> None:
        if unknown := [name for name in event.transitions if name not in self.net.transition_index]:
            self._deviates(event, f"there is no transition '{unknown[0]}'", "is the trace of another net?")
        if self.header.discipline is Discipline.INTERLEAVING and len(event.transitions) > 1:
            self._deviates(event, "several transitions fire at once", "under interleaving they fire one at a time")
        fired = [self.net.transition_index[name] for name in event.transitions]
        if len(set(fired)) < len(fired):
            self._deviates(event, "a transition fires twice at once", "write it once")
        firable = self.player.firable(self.marking)
        judged = self.header.signals
        enabled = self.player.enabled(self.marking, self.signals) if judged else firable
        for t in fired:
            transition = self.net.transitions[t]
            if t not in firable:
                self._deviates(event, f"'{transition.name}' is not firable", self._why_not(t))
            if not transition.openable:
                self._deviates(event, f"'{transition.name}' can never fire", "it wants one signal both 1 and 0")
            if t not in enabled:
                # That it is closed, the firing rule has said; which gate it is, the message wants to know.
                gate = next(g for g in transition.external if self.signals.get(g.signal, False) != g.wanted)
                self._deviates(
                    event,
                    f"'{transition.name}' fires although its external gate is closed",
                    f"'{gate.signal}' is {int(not gate.wanted)} and must be {int(gate.wanted)}",
                )
        if not self.player.conflicts.free(fired):
            self._deviates(event, "transitions in conflict fire together", "they share an input or an output place")
        step = self.header.discipline is Discipline.STEP
        if step and not self._is_a_step(fired):
            self._deviates(event, "not a maximal step", "an enabled transition without conflict is left out")
        after = self.player.fire(self.marking, fired)
        self._entered(event, after)
        self.marking = after
        self.firings += len(fired)

    def _is_a_step(self, fired: list[int]) -> bool:
        wanted = tuple(sorted(fired))
        if self.header.signals:
            return wanted in self.player.maximal_steps(self.player.enabled(self.marking, self.signals))
        return self.player.is_step(self.marking, wanted)

    def _why_not(self, t: int) -> str:
        masks, names = self.net.masks[t], self.net.names
        reasons = []
        if missing := names((masks.inputs | masks.permissive) & ~self.marking):
            reasons.append(f"{', '.join(missing)} must hold a token")
        if full := names((masks.outputs | masks.inhibitive) & self.marking):
            reasons.append(f"{', '.join(full)} must be empty")
        return "; ".join(reasons)

    def _entered(self, event: Fired, after: Marking) -> None:
        entered = self.net.names(after & ~self.marking)
        for place in entered:
            self.signals.update(dict.fromkeys(self.net.place(place).cleared, False))
        if not self.header.commands:
            return
        left = self.net.names(self.marking & ~after)
        if unsent := [place for place in left if place in self.owed]:
            command = self.net.place(unsent[0]).command
            self._deviates(event, f"the token leaves '{unsent[0]}' before its command was sent", f"expected: {command}")
        self.owed.update(place for place in entered if self.net.place(place).command is not None)

    def _sent(self, event: CommandSent) -> None:
        if event.place not in self.owed:
            known = event.place in self.net.place_index
            reason = "no token has entered it since its last command" if known else "there is no such place"
            self._deviates(event, f"a command of '{event.place}' that is not due", reason)
        self.owed.remove(event.place)
        self.commands += 1
        if (completion := self.net.place(event.place).completion) is not None:
            self.signals[completion] = False
            self.under_way.add(completion)

    def _ended(self, end: End) -> None:
        shown = self.net.names(self.marking)
        if set(end.marking) != set(shown) or len(end.marking) != len(shown):
            self._deviates(
                end, "the trace ends in another marking than it shows", f"reached: {', '.join(shown) or 'none'}"
            )
        if end.reason == "deadlock" and not self.player.deadlocked(self.marking):
            self._deviates(end, "the trace ends in a deadlock that is none", "some transition is firable")
        if self.owed:
            self._deviates(
                end, f"the command of '{min(self.owed)}' was never sent", "each entry sends its command once"
            )
