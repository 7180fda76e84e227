"""The central net as it goes on when somebody has died, as a net of its own: what the dead hold up fires no more.

What the others can still do after a crash is a question about the protocol, whose net has 1e33 configurations of a cell
with forty markings. But of all configurations that carry one central marking some are the worst, and what they still
fire is seen in the central net:

- *A controller is dead.* A round that asks for a transition in which it takes part stays open for ever: undecided, as
  its vote does not come, and then the promises of the others stand; or without its acknowledgement. The coordinator
  opens no round that disturbs an open one, nor one that disturbs a group that waits for that, and so on; whoever has
  promised fires nothing that disturbs the promise, and reads no signal anew that it reads or clears. Such a round may
  be opened after the crash, too, on reports from before. So whatever it would keep back is held up throughout.
- *A coordinator is dead.* It decides nothing any more, and what it was promised stays promised: parts that do not
  disturb each other. What would disturb one of them fires no more (O1), nor what shares a signal with it. A part that
  is promised is firable; or it is behind: its transition was decided before, so the central net has its tokens moved
  already, and others may have gone on from there, but its order never comes. A part that is *free of promise* locks
  nothing, whatever it has voted; but it may be behind, too, beside whatever else is promised, and its gates may have
  changed since.

Everything else can be brought to rest, and is then fired as if nobody were dead. So the net here is the central one,
the life of who dies, and the promises that a dead coordinator leaves:

    not-begun ─begins──▶ alive ─dies──▶ dying ─is-dead──▶ dead        what the dead hold up fires while they are alive,
    not-begun ─dies-at-once──▶ dead, early                            the rest then, and when they are dead
    hold/t/c: while dying, c has promised its part of t             behind/t/c: and t was decided before

Each question is a property of this net (`outages`), with evidence as any property. That what goes on here goes on in
the protocol's net is proved, too (`dead_script`). What the executor does beyond that net is argued in docs/protocol.md:
that a round with a dead controller may stay open, that a coordinator opens none beside what it would disturb, and that
a promise holds signals still. Tests hold it to exploring the protocol's net, and to the machines that run.

Rejected: to count on it that a round with a dead controller is given up. The coordinator that runs has no clock, and
decides when everybody has voted. Rejected, too: to explore the protocol's net with somebody dead in it, which took the
line of two cells a minute, and left no evidence but diagrams of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.decompose.protocol.parts import Part, Parts
from firable.nets.formula import And, Firable, Holds, Or, format_formula
from firable.nets.net import Net, Place, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.temporal import Logic, parse_temporal

NOT_BEGUN: Final = "life/not-begun"
ALIVE: Final = "life/alive"
DYING: Final = "life/dying"
DEAD: Final = "life/dead"
EARLY: Final = "life/dead-at-once"


@dataclass(frozen=True)
class Bereft:
    """A decomposition of which somebody dies: the controller `who`, or where that is empty the `coordinator`."""

    parts: Parts
    who: str
    coordinator: str = ""
    free: frozenset[tuple[str, str]] = frozenset()
    """The transition and the controller of each part free of promise; `parts` takes them for such as promise."""

    @cached_property
    def held_up(self) -> frozenset[str]:
        """The transitions of which nothing is claimed when the dead are dead: in the worst case they fire no more.

        Cost: each pair of coordinated transitions is compared once.
        """
        parts = self.parts
        if not self.who:
            return frozenset(t for t in parts.coordinated if parts.decider(t) == self.coordinator)
        waiting = {t for t, its in parts.coordinated.items() if any(part.controller == self.who for part in its)}
        asked = [group for group in parts.groups if not waiting.isdisjoint(group)]
        found = {t for group in asked for t in group}
        locked = (
            part.whole
            for part in parts.local
            if part.controller == self.who or any(self._shared(part.whole, t) for t in found)
        )
        own = tuple(locked)
        rest, new = [group for group in parts.groups if group not in asked], found
        while new:  # whoever waits for those keeps its place before others
            behind = [group for group in rest if any(self._shared(t, u) for t in group for u in new)]
            rest = [group for group in rest if group not in behind]
            new = {t for group in behind for t in group}
            found = found | new
        return frozenset((*found, *own))

    def _shared(self, t: str, u: str) -> bool:
        """Whether one disturbs the other, or both have to do with a signal."""
        (writes, reads), (others_writes, others_reads) = self._reach[t], self._reach[u]
        return not (writes.isdisjoint(others_reads) and reads.isdisjoint(others_writes))

    @cached_property
    def _reach(self) -> dict[str, tuple[frozenset[str], frozenset[str]]]:
        """Of each transition what it changes, and what it depends on.

        Signals count as changed even where they are read: one that a standing promise reads is not read anew. They are
        told from places by a bar; were a place named so, more would be held up.
        """
        found = {}
        for t in self.parts.transitions:
            writes = {*t.inputs, *t.outputs, *self._signals(t)}
            found[t.name] = frozenset(writes), frozenset((*writes, *t.permissive, *t.inhibitive))
        return found

    def _signals(self, t: Transition) -> Iterator[str]:
        yield from (f"|{gate.signal}" for gate in t.external)
        for place in t.outputs:
            yield from (f"|{signal}" for signal in self.parts.net.place(place).cleared)

    def _in_the_way(self, part: Part) -> tuple[Part, ...]:
        """The parts whose promise keeps this one from being promised or fired, or its signals from being read."""
        mine = self._signals_of[part]
        if not mine:
            return self.parts.excluding(part)
        of_place = set(self.parts.excluding(part))
        group = self.parts.group_of.get(part.whole)
        return tuple(
            other
            for t, its in self.parts.coordinated.items()
            for other in its
            if other in of_place
            or (
                other.controller == part.controller
                and (group is None or self.parts.group_of[t] != group)
                and not mine.isdisjoint(self._signals_of[other])
            )
        )

    @cached_property
    def _signals_of(self) -> dict[Part, frozenset[str]]:
        subnets = {subnet.name: subnet for subnet in self.parts.decomposition.subnets}
        return {
            part: frozenset(self._signals(subnets[part.controller].transition(part.name)))
            for part in (*self.parts.local, *(part for its in self.parts.coordinated.values() for part in its))
        }

    @cached_property
    def at_once(self) -> frozenset[str]:
        """The transitions that nobody but the dead could fire: local to the controller, or decided by the coordinator.

        Of the others that are held up one may fire after the crash, if it was decided before, or not asked for with
        what the dead take part in.
        """
        if not self.who:
            return self.held_up
        return frozenset(part.whole for part in self.parts.local if part.controller == self.who)

    @property
    def verdict(self) -> str:
        """The name of the verdict, without its family."""
        return verdict_name(self.who, self.coordinator)

    def rests(self, group: Iterable[str]) -> bool:
        """Whether the rounds of a group come to rest without who is dead."""
        if not self.who:
            return self.held_up.isdisjoint(group)
        return all(part.controller != self.who for t in group for part in self.parts.coordinated[t])

    @cached_property
    def left(self) -> tuple[Part, ...]:
        """The parts that a dead coordinator may leave promised or behind, and that keep somebody from firing so."""
        if self.who:
            return ()
        disturbed = {other for part in self._going for other in self._in_the_way(part)}
        its = (part for t, some in self.parts.coordinated.items() if t in self.held_up for part in some)
        return tuple(part for part in its if part in disturbed)

    @cached_property
    def _going(self) -> tuple[Part, ...]:
        """The parts of what is not held up."""
        every = (*self.parts.local, *(part for its in self.parts.coordinated.values() for part in its))
        return tuple(part for part in every if part.whole not in self.held_up)

    @cached_property
    def net(self) -> Net:
        """The net; its size is that of the central net, and of the parts that may stay promised."""
        central = self.parts.net
        held = {part: f"held/{part.whole}/{part.controller}" for part in self.left}
        life = (Place(name, marked=name == NOT_BEGUN) for name in (NOT_BEGUN, ALIVE, DYING, DEAD, EARLY))
        places = (*life, *map(Place, sorted(held.values())), *(Place(p.name, marked=p.marked) for p in central.places))
        lives = (
            Transition("life/begins", (NOT_BEGUN,), (ALIVE,)),
            Transition("life/dies-at-once", (NOT_BEGUN,), (DEAD, EARLY)),
            Transition("life/dies", (ALIVE,), (DYING,)),
            Transition("life/is-dead", (DYING,), (DEAD,)),
        )
        holding = sorted((t for part in held for t in self._holding(part, held)), key=lambda t: t.name)
        return Net(f"bereft-{central.name}", places, (*lives, *holding, *self._central(held)))

    def _holding(self, part: Part, held: Mapping[Part, str]) -> Iterator[Transition]:
        """The part is promised and firable, but for what others of its round may have moved; or it is behind."""
        name, here = f"{part.whole}/{part.controller}", (held[part],)
        full, empty = {*part.outputs}, {*part.inputs}
        if self.is_free(part):
            yield Transition(f"behind/{name}", (), here, _sorted({DYING, *full}), _sorted(empty))
            return
        others = {held[other] for other in self.parts.excluding(part) if other in held and not self.is_free(other)}
        # What its own firing has moved is as that leaves it, whatever a gate of it wanted there before.
        full = full.union(set(part.permissive) - part.writes)
        empty = empty.union(set(part.inhibitive) - part.writes)
        yield Transition(f"behind/{name}", (), here, _sorted({DYING, *full}), _sorted(empty | others))
        moved = moved_beside(self.parts, part)
        full, empty = {*part.inputs, *part.permissive} - moved, {*part.outputs, *part.inhibitive} - moved
        yield Transition(f"hold/{name}", (), here, _sorted({DYING, *full}), _sorted(empty | others))

    def is_free(self, part: Part) -> bool:
        """Whether a part promises nothing."""
        return (part.whole, part.controller) in self.free

    def _central(self, held: Mapping[Part, str]) -> Iterator[Transition]:
        disturbed: dict[str, list[str]] = {}
        for part in self._going if held else ():
            disturbed.setdefault(part.whole, []).extend(held[o] for o in self._in_the_way(part) if o in held)
        for t in self.parts.transitions:
            alive, away = ((ALIVE,), ()) if t.name in self.held_up else ((), (NOT_BEGUN, DYING))
            empty = (*t.inhibitive, *away, *disturbed.get(t.name, ()))
            yield Transition(t.name, t.inputs, t.outputs, _sorted((*t.permissive, *alive)), _sorted(empty))

    # --- The questions

    def fires(self, t: str) -> Property:
        """The transition fires in some run of the central net."""
        return Property(f"fires.{t}", PropertyKind.REACHABLE, Firable(t))

    def kept_from_start(self, t: str) -> Property:
        """Where somebody dies before anything has fired, the transition never fires."""
        return Property(f"kept-from-start.{t}", PropertyKind.NEVER, And((Holds(EARLY), Firable(t))))

    def goes_on(self, name: str, some: Sequence[str]) -> TemporalProperty:
        """From wherever somebody dies and the central net could fire one of these, one of them can be fired."""
        alive, dying, dead = (format_formula(Holds(place)) for place in (ALIVE, DYING, DEAD))
        one = format_formula(Firable(some[0]) if len(some) == 1 else Or(tuple(map(Firable, some))))
        never_again = f"E[{dying} U {dead} and not EF ({one})]"
        text = f"AG (not EF ({alive} and ({one})) or AX (not {dying} or not {never_again}))"
        return TemporalProperty(f"goes-on.{name}", Logic.CTL, parse_temporal(text))


def verdict_name(who: str, coordinator: str) -> str:
    """The name of the verdict on a dead controller or, where `who` is empty, coordinator, without its family."""
    return f"dead.{who}" if who else f"dead-{coordinator.removeprefix('the ').replace(' ', '.', 1)}"


def moved_beside(parts: Parts, part: Part) -> frozenset[str]:
    """The places that other parts of its round move at the controller of a part."""
    group = parts.groups[parts.group_of[part.whole]]
    mates = (mate for t in group if t != part.whole for mate in parts.coordinated[t])
    return frozenset(place for mate in mates if mate.controller == part.controller for place in mate.writes)


def deaths(parts: Parts, free: Iterable[tuple[str, str]] = ()) -> Iterator[Bereft]:
    """Everybody who can be dead: each controller, then each coordinator."""
    known = frozenset(free)
    yield from (Bereft(parts, subnet.name, free=known) for subnet in parts.decomposition.subnets)
    yield from (Bereft(parts, "", coordinator, known) for coordinator in parts.deciders)


def _sorted(places: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(set(places)))
