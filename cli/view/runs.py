"""Runs that the page plays: traces of a file, and the counterexamples that `check` finds, frame by frame.

A frame is what one event left: the marking, the signals that are 1, and in words what happened. A trace is judged by
`Replayer` as it is told, so the page never shows a run that is none of the net. What each transition waits for is asked
for the frame that is looked at, as when one plays (`moment.py`): a trace may have thousands of frames.

A run for ever (a cycle) is told once around; the page says where it begins anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from firable.cli.page.pieces import TONES
from firable.cli.story import outcome_told
from firable.cli.text import SUBJECTS_SHOWN, first_of, mark
from firable.cli.view.scene import Stage
from firable.nets.net import Net
from firable.nets.rules import hints_of
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.replaying import Replayer
from firable.semantics.trace import CommandSent, Discipline, Fired, Noted, SignalChanged, Trace

FRAMES_MAX: Final = 20_000
"""So many frames are shown of a trace; a browser keeps them all."""
SECONDS_MAX: Final = 20.0
"""So long a check that the page asks for may take."""


@dataclass(frozen=True)
class Run:
    """A run that can be played: of a trace file, or of a verdict."""

    name: str
    says: str
    trace: Trace
    cycle_at: int | None = None
    """The firing with which the part that is fired for ever begins."""
    note: str = ""
    is_given: bool = False
    """Whether it is the trace that was named, and not what a check has found."""

    def summary(self) -> dict[str, Any]:
        """What the page lists."""
        firings = sum(isinstance(event, Fired) for event in self.trace.events)
        return {"name": self.name, "says": self.says, "firings": firings}

    def to_json(self, net: Net, stage: Stage | None = None) -> dict[str, Any]:
        """All frames, each with how the cell looks where that has changed; raises `InputError` F5004 where it is no run
        of the net.
        """
        frames = list(self._frames(net))
        # Where workpieces were when a cell was taken over no trace says.
        if stage is not None and self.trace.header.start is None:
            _look(frames, self.trace, stage)
        return {
            **self.summary(),
            "note": self.note,
            "free": not self.trace.header.signals,
            "frames": frames[: FRAMES_MAX + 1],
            "left_out": max(0, len(frames) - FRAMES_MAX - 1),
        }

    def _frames(self, net: Net) -> Iterator[dict[str, Any]]:
        replayer = Replayer(net, self.trace.header, self.trace.file)
        begins = "the initial marking" if self.trace.header.start is None else "the marking that was taken over"
        shown = [name for name, value in replayer.signals.items() if value]
        yield {"marking": list(net.names(replayer.marking)), "signals": shown, "what": begins}
        firings = 0
        for event in self.trace.events:
            replayer.take(event)
            happened = _words(net, event)
            if happened is None:
                continue
            if isinstance(event, Fired):
                happened["turn"] = self.cycle_at == firings
                firings += 1
            yield {
                "at": event.at_seconds if self.trace.header.signals else None,
                "marking": list(net.names(replayer.marking)),
                "signals": [name for name, value in replayer.signals.items() if value],
                **happened,
            }
        if self.trace.end is not None:
            replayer.end(self.trace.end)


def _look(frames: list[dict[str, Any]], trace: Trace, stage: Stage) -> None:
    """Give the frames of a trace their scenes: what happens between two of them shows in the later one."""
    scene = stage.begin()
    frames[0]["scene"] = scene.to_json()
    sends = not any(isinstance(event, CommandSent) for event in trace.events)
    told = iter(frames[1:])
    for event in trace.events:
        before = scene
        match event:
            case Fired(_, names):
                scene = stage.fired(scene, names, sends=sends)
            case CommandSent(_, place):
                scene = stage.sent(scene, place)
            case SignalChanged(_, signal, True):
                scene = stage.signal(scene, signal)
        if _words(stage.net, event) is not None:
            frame = next(told)
            if scene != before:
                frame["scene"] = scene.to_json()


def _words(net: Net, event: Fired | SignalChanged | CommandSent | Noted) -> dict[str, Any] | None:
    match event:
        case Fired(_, names):
            says = "; ".join(text for name in names if (text := net.transition(name).description))
            return {"fired": list(names), "what": f"{', '.join(names)} fires", "says": says}
        case SignalChanged(_, signal, value):
            return {"what": f"{signal} becomes {int(value)}"}
        case CommandSent(_, place):
            return {"what": f"{place} sends {net.place(place).command}", "place": place}
        case Noted(_, note, data):
            words = data.get("message") or data.get("what")
            return {"what": f"{note}: {words}"} if words and not {"round", "controller"} & data.keys() else None


def runs_of(net: Net, verdicts: tuple[Verdict, ...], discipline: Discipline) -> tuple[Run, ...]:
    """The violations that matter and have a run, each as a run to play."""
    found = []
    for verdict in verdicts:
        witness = verdict.witness
        if verdict.status is not Status.VIOLATED or verdict.told_as is Weight.INFORMATION or witness is None:
            continue
        if firings := (*witness.firings, *witness.cycle):
            cycle_at = len(witness.firings) if witness.cycle else None
            trace = Trace.of_firings(net, firings, discipline)
            found.append(Run(verdict.name, verdict.statement, trace, cycle_at, witness.note))
    return tuple(found)


def checked(net: Net) -> tuple[tuple[Verdict, ...], tuple[Run, ...]]:
    """What `check` says of a net within `SECONDS_MAX`, with what cures it, and the runs that show what is violated."""
    from firable.analysis.check import check
    from firable.analysis.cures.finding import explained
    from firable.analysis.spaces.reachability import Budget
    from firable.nets.verdict import held_to

    discipline = Discipline.INTERLEAVING
    verdicts = held_to(net.expected, explained(check(net, discipline, Budget(seconds=SECONDS_MAX))))
    return verdicts, runs_of(net, verdicts, discipline)


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """A verdict as the page lists it, in the words and with the sign of `firable check`."""
    sign, word, _ = mark(verdict)
    return {
        "name": verdict.name,
        "sign": sign,
        "word": word,
        "tone": TONES[sign],
        "fails": verdict.matters and verdict.outcome is Status.VIOLATED,
        "listed": verdict.matters or (verdict.told_as is not Weight.INFORMATION and not verdict.holds),
        "says": verdict.statement,
        "about": first_of(verdict.subjects, SUBJECTS_SHOWN) if verdict.status is Status.VIOLATED else "",
        "hints": [{"code": code, "says": hint} for code, hint in hints_of(verdict)],
        "cures": [{"changes": list(cure.changes), "checked": outcome_told(cure)} for cure in verdict.cures],
    }
