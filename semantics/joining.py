"""Joining: from the traces of the hosts of a cell to one trace of its central net.

Each host writes what its own machines do, in their order, by its own clock. What is between hosts, the rounds tell:

- a controller that votes yes for a transition has done before all that its trace shows before (`voted`);
- one whose part is free of promise has done so before its yes that stands, and that is of no round (`stands`);
- the coordinator fires it when it has the votes (a firing with its `round`); a yes that stands counts once, and the
  next one of that controller is from after it has applied the firing;
- a controller applies it, and sends its commands, when it has heard of that (`applied`).

These and the order in each file are what happened before what (Lamport 1978). Any order of all lines that keeps them is
one trace of the central net: two lines that it leaves open are of controllers that share no place, or lie between the
vote and the application of a round that they do not disturb (O1), so either order leads to the same marking. The order
chosen goes by the clocks as far as it may; so clocks that disagree change what is told first, and not what is judged.

Rejected: joining by the clocks alone. Two hosts agree to a millisecond at best, and a round takes less.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.net import Net
from firable.nets.source import printable
from firable.semantics.trace import End, Event, Fired, Noted, Start, Trace

VOTED: Final = "voted"
"""The note of a vote: `controller`, `round`, and in `promised` the transitions with a yes."""
COORDINATOR: Final = ""
"""The name of the coordinator among the machines of a host."""
STANDS: Final = "stands"
"""The note of votes on parts free of promise: `controller`, and in `transitions` those with a yes from now on."""
APPLIED: Final = "applied"
"""The note of a controller that takes its part of a committed transition: `controller`, `round`."""

Vote = tuple[int, str, str]
"""A yes: the round, the transition, the controller."""
Standing = tuple[str, str]
"""A yes that stands: the transition, the controller."""


@dataclass(slots=True)
class _Part:
    """One host's trace, and how much of it has been told."""

    trace: Trace
    yes: dict[Vote, int]
    """Where each yes stands first."""
    told: int = 0

    @property
    def next(self) -> Event | None:
        """The event that is told next."""
        events = self.trace.events
        return events[self.told] if self.told < len(events) else None

    @property
    def next_seconds(self) -> float:
        """When that was, in seconds since 1970."""
        event = self.next
        return self.trace.header.began + (event.at_seconds if event is not None else 0.0)

    @property
    def whole(self) -> bool:
        """Whether the trace was not cut off."""
        return self.trace.end is not None

    def has_told(self, vote: Vote) -> bool:
        """Whether a yes stands in the trace, and has been told."""
        return self.yes.get(vote, self.told) < self.told


@dataclass(slots=True)
class _Joined:
    """What has been told so far."""

    net: Net
    parts: list[_Part]
    stands_somewhere: frozenset[Standing]
    fired: dict[int, str] = field(default_factory=dict)
    """The rounds that are decided, and for what."""
    stands: set[Standing] = field(default_factory=set)
    """The votes that stand and that no firing has used."""
    unapplied: set[Standing] = field(default_factory=set)
    """Where a firing has used one, and is not applied."""

    def tell(self, event: Event | None) -> None:
        """Note what an event means for those that come after it."""
        match event:
            case Fired(_, (transition,), int(number)):
                self.fired[number] = transition
                used = {each for each in self.stands if each[0] == transition}
                self.stands -= used
                self.unapplied |= used
            case Noted(_, note, {"controller": str(controller), "round": int(number)}) if note == APPLIED:
                self.unapplied.discard((self.fired[number], controller))
            case Noted(_, note, {"controller": str(controller), "transitions": list(names)}) if note == STANDS:
                # One that is told again before the order is applied is the yes that was used.
                self.stands |= {(str(name), controller) for name in names} - self.unapplied

    def missing(self, event: Event | None) -> str:
        """What has to be told before this event; nothing where it may come now."""
        match event:
            case Fired(_, (transition,), int(number)):
                for controller in _participants(self.net, transition):
                    vote = (number, transition, controller)
                    stands = (transition, controller) in self.stands
                    if not stands and not any(part.has_told(vote) for part in self.parts):
                        return f"the yes of '{controller}' for '{transition}' in round {number}"
            case Noted(_, note, {"round": int(number)}) if note == APPLIED and number not in self.fired:
                return f"the decision of round {number}"
        return ""

    def stands_later(self, event: Event | None) -> bool:
        """Whether what has to be told before this event stands in some trace."""
        match event:
            case Fired(_, (transition,), int(number)):
                votes = [(number, transition, controller) for controller in _participants(self.net, transition)]
                return all(vote[1:] in self.stands_somewhere or self._is_voted(vote) for vote in votes)
            case Noted(_, _, {"round": int(number)}):
                events = (event for part in self.parts for event in part.trace.events)
                return any(isinstance(event, Fired) and event.round == number for event in events)
        return True

    def _is_voted(self, vote: Vote) -> bool:
        return any(vote in part.yes for part in self.parts)


def join(net: Net, traces: Sequence[Trace]) -> Trace:
    """The trace of the central net that the traces of its hosts make; incomplete where one of them is cut off.

    Raises `InputError`: F5005 where they are not traces of all hosts of a run on this net, because a machine is missing
    or there twice; F5004 where something was applied that nobody decided, or decided without the votes. Whether
    what they make is a trace of the net, `firable.semantics.replaying` says.
    """
    _refuse_other_hosts(net, traces)
    joined = _Joined(net, [_Part(trace, _yes(trace)) for trace in traces], _standing(traces))
    began = min(trace.header.began for trace in traces)
    events: list[Event] = []
    now = 0.0
    while True:
        able = [part for part in joined.parts if part.next is not None and not joined.missing(part.next)]
        if not able:
            break
        part = min(able, key=lambda part: part.next_seconds)
        now = max(now, part.next_seconds - began)
        event = part.next
        part.told += 1
        joined.tell(event)
        if event is not None and not (isinstance(event, Noted) and event.note in (VOTED, STANDS, APPLIED)):
            events.append(replace(event, at_seconds=now))
    stuck = [part for part in joined.parts if part.next is not None]
    whole = all(part.whole for part in joined.parts)
    if stuck and whole:
        # What waits for a line that stands somewhere waits for whoever has to tell it.
        first = next((part for part in stuck if not joined.stands_later(part.next)), stuck[0])
        message = f"the traces do not join: nowhere before stands {joined.missing(first.next)}"
        hint = "are these the traces of one run, of all its hosts?"
        raise _refusal(first.trace, first.told + 2, message, hint)
    header = replace(traces[0].header, machines=(), began=0.0, start=_start(traces))
    return Trace(header, tuple(events), _end(net, traces, now) if whole else None, traces[0].file)


def _participants(net: Net, transition: str) -> frozenset[str]:
    """The owners of what a transition reads and writes."""
    of = net.transition(transition)
    places = {*of.inputs, *of.outputs, *of.permissive, *of.inhibitive}
    owners = {net.place(name).owner for name in places}
    owners |= {net.signal(gate.signal).owner for gate in of.external}
    return frozenset(owner for owner in owners if owner is not None)


def _yes(trace: Trace) -> dict[Vote, int]:
    found: dict[Vote, int] = {}
    for i, event in enumerate(trace.events):
        match event:
            case Noted(_, note, {"round": int(number), "controller": str(controller), "promised": list(names)}):
                if note == VOTED:
                    for name in names:
                        found.setdefault((number, name, controller), i)
    return found


def _standing(traces: Iterable[Trace]) -> frozenset[Standing]:
    """The votes that stand at any time."""
    notes = (event for trace in traces for event in trace.events if isinstance(event, Noted) and event.note == STANDS)
    found: set[Standing] = set()
    for note in notes:
        match note.data:
            case {"controller": str(controller), "transitions": list(names)}:
                found |= {(str(name), controller) for name in names}
    return frozenset(found)


def _end(net: Net, traces: Iterable[Trace], now: float) -> End:
    """The last line: each host shows the tokens of its own machines."""
    ends = [trace.end for trace in traces if trace.end is not None]
    marked = {place for end in ends for place in end.marking}
    reasons = {end.reason for end in ends}
    reason = reasons.pop() if len(reasons) == 1 else "the hosts ended differently"
    last = max((trace.header.began + trace.end.at_seconds for trace in traces if trace.end is not None), default=0.0)
    began = min(trace.header.began for trace in traces)
    return End(max(now, last - began), tuple(p.name for p in net.places if p.name in marked), reason)


def _start(traces: Sequence[Trace]) -> Start | None:
    """Where the hosts begin, if not in M0: each says it of its own machines."""
    starts = [trace.header.start for trace in traces if trace.header.start is not None]
    if not starts:
        return None
    return Start(
        tuple(name for start in starts for name in start.marking),
        tuple(name for start in starts for name in start.signals),
        tuple(name for start in starts for name in start.owed),
    )


def _refuse_other_hosts(net: Net, traces: Sequence[Trace]) -> None:
    """Refuse traces that are not of all machines of the net, each once, and of one version of it."""
    where: dict[str, Trace] = {}
    for trace in traces:
        if trace.header.digest != traces[0].header.digest or trace.header.net != net.name:
            raise _not_together(trace, "the traces are of different nets", "give those of one run")
        if not trace.header.machines:
            raise _not_together(trace, "this is the trace of a whole run, not of one host", "replay it by itself")
        for name in trace.header.machines:
            if name in where:
                other = printable(where[name].file)
                raise _not_together(trace, f"'{name}' has two traces: this one, and {other}", "leave one of them out")
            where[name] = trace
    later = [trace for trace in traces if trace.header.start is not None]
    owners = {place.owner for place in net.places}
    if later and any(trace.header.start is None and owners & {*trace.header.machines} for trace in traces):
        message = "this one begins where a cell was taken over, and another in the initial marking"
        raise _not_together(later[0], message, "give those of one run: all hosts are taken over together")
    names = {COORDINATOR: "the coordinator", **{c.name: f"'{c.name}'" for c in net.controllers}}
    if missing := [called for name, called in names.items() if name not in where]:
        message = f"there is no trace of {', '.join(missing)}"
        raise _not_together(traces[0], message, "give the traces of all hosts of the run")


def _not_together(trace: Trace, message: str, hint: str) -> InputError:
    return InputError([Diagnostic("F5005", message, hint, span=Span(printable(trace.file), 1, 1))])


def _refusal(trace: Trace, line: int, message: str, hint: str) -> InputError:
    return InputError([Diagnostic("F5004", message, hint, span=Span(printable(trace.file), line, 1))])
