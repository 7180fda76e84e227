"""Following a run of the executor in the closed loop: which markings the loop can be in after what was seen of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from firable.nets.machines.loop import ClosedLoop
from firable.nets.net import Marking
from firable.semantics.trace import CommandSent, Event, Fired, SignalChanged, Trace

Markings = frozenset[Marking]
Act = Fired | CommandSent
"""What a cell does, in the loop as in a trace."""

ORDERS_MAX: Final = 6
"""In how many orders what was done in one instant is followed at most."""


class TooManyMarkingsError(Exception):
    """More markings of a loop were looked at than somebody wants to wait for."""


class Follower:
    """A loop, and what becomes of its markings; moves of machines are seen by nobody, so any may have been made."""

    def __init__(self, loop: ClosedLoop, markings_max: int | None = None) -> None:
        self.loop, self.net, self.markings_max = loop, loop.net, markings_max
        index = self.net.transition_index
        self.variants = {name: {index[one] for one in some} for name, some in loop.variants.items()}
        self.cell = frozenset[int]().union(*self.variants.values())
        self.sends: dict[str, set[int]] = {place: set() for place in loop.unsent}
        for name, t in index.items():
            if t not in self.cell and name.startswith("sent/"):
                self.sends[name.split("/")[1]].add(t)
        self.moves = {*index.values()}.difference(self.cell, *self.sends.values())
        self.accidents = {index[name] for name in loop.accidents}
        # A loop has thousands of transitions, so the firing rule is one comparison of masks for each; one that needs a
        # place both full and empty never fires.
        needs = [(mask.inputs | mask.permissive, mask.outputs | mask.inhibitive) for mask in self.net.masks]
        self.rules = [(t, full | empty, full) for t, (full, empty) in enumerate(needs) if not full & empty]
        self.changes = [mask.inputs | mask.outputs for mask in self.net.masks]
        self.next: dict[Marking, tuple[tuple[int, Marking], ...]] = {}
        self.perilous: set[Marking] = set()
        self.start = self.moved([self.net.initial_marking])

    def following(self, marking: Marking) -> tuple[tuple[int, Marking], ...]:
        """What may fire in a marking without an accident, and what it leads to."""
        if marking not in self.next:
            if len(self.next) == self.markings_max:
                raise TooManyMarkingsError
            firable = [t for t, looks_at, full in self.rules if marking & looks_at == full]
            calm = [t for t in firable if t not in self.accidents]
            self.next[marking] = tuple((t, marking ^ self.changes[t]) for t in calm)
            if len(calm) < len(firable):
                self.perilous.add(marking)
        return self.next[marking]

    def after(self, markings: Iterable[Marking], transitions: Iterable[int]) -> Markings:
        """What one of some transitions makes of some markings."""
        some = frozenset(transitions)
        return frozenset(then for marking in markings for t, then in self.following(marking) if t in some)

    def moved(self, markings: Iterable[Marking]) -> Markings:
        """What the machines can make of some markings by themselves, these among them."""
        found = new = frozenset(markings)
        while new:
            new = self.after(new, self.moves) - found
            found |= new
        return found

    def done(self, markings: Markings, act: Act) -> Markings:
        """What an act makes of some markings; none where the loop cannot do it."""
        if isinstance(act, CommandSent):  # which the loop has in a firing, unless it sends late
            sends = self.sends.get(act.place)
            return markings if sends is None else self.moved(self.after(markings, sends))
        for name in act.transitions:
            markings = self.moved(self.after(markings, self.variants[name]))
        return markings

    def showing(self, markings: Markings, signal: str, *, value: bool) -> Markings:
        """Those of some markings in which a signal has come to show a value, some moment ago."""
        place, means = self.loop.shown[signal]
        bit = 1 << self.net.place_index[place]
        return self.moved(marking for marking in markings if (bool(marking & bit) == means) == value)

    def can_go_wrong(self, markings: Markings) -> bool:
        """Whether an accident can happen."""
        self.after(markings, ())
        return not self.perilous.isdisjoint(markings)

    def can_rest(self, markings: Markings) -> bool:
        """Whether there is one from which the cell never fires, and nothing goes wrong, whatever machines do."""
        calm = (self.moved([marking]) for marking in markings)
        return any(not self.after(some, self.cell) and not self.can_go_wrong(some) for some in calm)


def followed(loop: ClosedLoop, trace: Trace) -> int:
    """How many transitions a trace fired, each of which the loop can fire when it did, and each 1 shown in between."""
    follower, fired = Follower(loop), 0
    markings = follower.start
    for event in trace.events:
        match event:
            case Fired(transitions=names):
                for name in names:
                    markings = follower.done(markings, Fired(event.at_seconds, (name,)))
                    assert markings, f"the loop cannot fire {name} here"
                    fired += 1
            case CommandSent(place=place):
                markings = follower.done(markings, event)
                assert markings, f"the loop cannot send the command of {place} here"
            case SignalChanged(signal=signal, value=True):
                markings = follower.showing(markings, signal, value=True)
                assert markings, f"the loop does not show {signal} = 1 here"
    return fired


class _Done(NamedTuple):
    before: Markings
    act: Act


class _Order(NamedTuple):
    """What was done in this instant, in one of the orders in which the loop can do it, and where it is then."""

    done: tuple[_Done, ...]
    markings: Markings


class Course:
    """A run that is followed up to the order of what is independent in one instant.

    A controller hears of a signal before it hears of the next one, and what it fires for the first may be decided, and
    stand in the trace, behind what another one fires for the second. Nobody can tell such an order from the other one.
    """

    def __init__(self, follower: Follower) -> None:
        self.follower = follower
        self.at_seconds = 0.0
        self.orders = [_Order((), follower.start)]
        transitions = follower.loop.cell.transitions
        self.changes = {t.name: {*t.inputs, *t.outputs} for t in transitions}
        self.reads = {t.name: {*t.permissive, *t.inhibitive} for t in transitions}

    @property
    def markings(self) -> Markings:
        """Where the loop can be."""
        return frozenset[Marking]().union(*(order.markings for order in self.orders))

    def goes_on(self, event: Event) -> bool:
        """Whether the loop can do what was done next; what was not done by the cell is no matter."""
        if not isinstance(event, Act):
            return True
        if event.at_seconds != self.at_seconds:
            self.at_seconds, self.orders = event.at_seconds, [_Order((), self.markings)]
        orders = [with_it for order in self.orders for with_it in self._with(order, event)][:ORDERS_MAX]
        if orders:
            self.orders = orders
        return bool(orders)

    def _with(self, order: _Order, act: Act) -> Iterator[_Order]:
        """An order with an act at its end, or before as much at the end as is independent of it."""
        kept, later = list(order.done), list[Act]()
        while True:
            done, markings = list(kept), order.done[len(kept)].before if later else order.markings
            for one in (act, *later):
                done.append(_Done(markings, one))
                markings = self.follower.done(markings, one)
            if markings:
                yield _Order(tuple(done), markings)
            if not kept or not self._independent(act, kept[-1].act):
                return
            later.insert(0, kept.pop().act)

    def _independent(self, act: Act, earlier: Act) -> bool:
        if isinstance(act, CommandSent):
            return False
        return not any(self._meets(name, earlier) for name in act.transitions)

    def _meets(self, name: str, earlier: Act) -> bool:
        changes, reads = self.changes[name], self.reads[name]
        if isinstance(earlier, CommandSent):
            return earlier.place in changes | reads
        return any(
            changes & (self.changes[one] | self.reads[one]) or self.changes[one] & reads for one in earlier.transitions
        )
