"""The replay of a trace: plays it on the net by the reference player, and finds the first line that is no event of it.

Each firing must be firable, in a trace that records signals with its external gates open; every entry of a place with
an output signal must send its command exactly once before the token leaves; and the last line must show the marking
reached. A token that enters a place clears the completion signal of the place: a value from before is stale and opens
no gate, and a completion may not come before its command. A trace without its last line replays as incomplete.

One judge for counterexamples of the analysis and logs of the executor, and the slow one on purpose: it shares no
firing rule with what wrote the trace.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import NoReturn

from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.net import Marking, Net
from firable.semantics.player import Player
from firable.semantics.trace import CommandSent, Discipline, End, Fired, Noted, SignalChanged, Trace


@dataclass(frozen=True, slots=True)
class Replay:
    """What a trace did, once it is known to be a trace of the net."""

    marking: Marking
    firings: int
    commands: int
    complete: bool


def replay(net: Net, trace: Trace) -> Replay:
    """Play the trace by the reference player; raises `InputError` F5004 with the line that is no event of the net."""
    return _Replayer(net, trace).run()


class _Replayer:
    """The marking, the valuation and the commands owed, as the trace goes on."""

    def __init__(self, net: Net, trace: Trace) -> None:
        self.net = net
        self.trace = trace
        self.player = Player(net)
        self.marking = net.initial_marking
        self.signals: dict[str, bool] = {}
        self.owed: set[str] = set()
        self.now_seconds = 0.0
        self.firings = 0
        self.commands = 0

    def deviates(self, number: int, message: str, hint: str) -> NoReturn:
        record = (self.trace.header, *self.trace.events, *((self.trace.end,) if self.trace.end else ()))[number - 1]
        span = Span(self.trace.file, number, 1, json.dumps(record.to_json()))
        raise InputError([Diagnostic("F5004", message, hint, span=span)])

    def run(self) -> Replay:
        if self.trace.header.net != self.net.name:
            self.deviates(1, f"the trace is of the net '{self.trace.header.net}'", f"this net is '{self.net.name}'")
        number = 1
        for number, event in enumerate(self.trace.events, start=2):
            self.passed(number, event.at_seconds)
            match event:
                case Fired():
                    self.fired(number, event)
                case SignalChanged():
                    self.changed(number, event)
                case CommandSent():
                    self.sent(number, event)
                case Noted():
                    pass
        if self.trace.end is not None:
            self.passed(number + 1, self.trace.end.at_seconds)
            self.ended(number + 1, self.trace.end)
        return Replay(self.marking, self.firings, self.commands, self.trace.end is not None)

    def passed(self, number: int, at_seconds: float) -> None:
        if at_seconds < self.now_seconds:
            self.deviates(number, "time runs backwards", f"the line before is of {self.now_seconds:g} s")
        self.now_seconds = at_seconds

    def changed(self, number: int, event: SignalChanged) -> None:
        if event.signal not in self.net.signal_index:
            self.deviates(number, f"there is no signal '{event.signal}'", "is the trace of another net?")
        unsent = [place for place in sorted(self.owed) if self.net.place(place).completion == event.signal]
        if event.value and unsent:
            self.deviates(
                number, f"'{event.signal}' completes a command of '{unsent[0]}' that was not sent", "it is stale"
            )
        self.signals[event.signal] = event.value

    def fired(self, number: int, event: Fired) -> None:
        if unknown := [name for name in event.transitions if name not in self.net.transition_index]:
            self.deviates(number, f"there is no transition '{unknown[0]}'", "is the trace of another net?")
        if self.trace.header.discipline is Discipline.INTERLEAVING and len(event.transitions) > 1:
            self.deviates(number, "several transitions fire at once", "under interleaving they fire one at a time")
        fired = [self.net.transition_index[name] for name in event.transitions]
        if len(set(fired)) < len(fired):
            self.deviates(number, "a transition fires twice at once", "write it once")
        firable = self.player.firable(self.marking)
        judged = self.trace.header.signals
        enabled = self.player.enabled(self.marking, self.signals) if judged else firable
        for t in fired:
            transition = self.net.transitions[t]
            if t not in firable:
                self.deviates(number, f"'{transition.name}' is not firable", self.why_not(t))
            if not transition.openable:
                self.deviates(number, f"'{transition.name}' can never fire", "it wants one signal both 1 and 0")
            if t not in enabled:
                # That it is closed, the firing rule has said; which gate it is, the message wants to know.
                gate = next(g for g in transition.external if self.signals.get(g.signal, False) != g.wanted)
                self.deviates(
                    number,
                    f"'{transition.name}' fires although its external gate is closed",
                    f"'{gate.signal}' is {int(not gate.wanted)} and must be {int(gate.wanted)}",
                )
        if not self.player.conflicts.free(fired):
            self.deviates(number, "transitions in conflict fire together", "they share an input or an output place")
        step = self.trace.header.discipline is Discipline.STEP
        if step and not self.is_a_step(fired):
            self.deviates(number, "not a maximal step", "an enabled transition without conflict is left out")
        after = self.player.fire(self.marking, fired)
        self.entered(number, after)
        self.marking = after
        self.firings += len(fired)

    def is_a_step(self, fired: list[int]) -> bool:
        wanted = tuple(sorted(fired))
        if self.trace.header.signals:
            return wanted in self.player.maximal_steps(self.player.enabled(self.marking, self.signals))
        return self.player.is_step(self.marking, wanted)

    def why_not(self, t: int) -> str:
        masks, names = self.net.masks[t], self.net.names
        reasons = []
        if missing := names((masks.inputs | masks.permissive) & ~self.marking):
            reasons.append(f"{', '.join(missing)} must hold a token")
        if full := names((masks.outputs | masks.inhibitive) & self.marking):
            reasons.append(f"{', '.join(full)} must be empty")
        return "; ".join(reasons)

    def entered(self, number: int, after: Marking) -> None:
        entered = self.net.names(after & ~self.marking)
        for place in entered:
            if (completion := self.net.place(place).completion) is not None:
                self.signals[completion] = False
        if not self.trace.header.commands:
            return
        left = self.net.names(self.marking & ~after)
        if unsent := [place for place in left if place in self.owed]:
            command = self.net.place(unsent[0]).command
            self.deviates(number, f"the token leaves '{unsent[0]}' before its command was sent", f"expected: {command}")
        self.owed.update(place for place in entered if self.net.place(place).command is not None)

    def sent(self, number: int, event: CommandSent) -> None:
        if event.place not in self.owed:
            known = event.place in self.net.place_index
            reason = "no token has entered it since its last command" if known else "there is no such place"
            self.deviates(number, f"a command of '{event.place}' that is not due", reason)
        self.owed.remove(event.place)
        self.commands += 1

    def ended(self, number: int, end: End) -> None:
        shown = self.net.names(self.marking)
        if set(end.marking) != set(shown) or len(end.marking) != len(shown):
            self.deviates(
                number, "the trace ends in another marking than it shows", f"reached: {', '.join(shown) or 'none'}"
            )
        if end.reason == "deadlock" and not self.player.deadlocked(self.marking):
            self.deviates(number, "the trace ends in a deadlock that is none", "some transition is firable")
        if self.owed:
            self.deviates(
                number, f"the command of '{min(self.owed)}' was never sent", "each entry sends its command once"
            )
