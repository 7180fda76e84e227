"""The net that is left of the central one when somebody is dead, made anew.

The second text of `firable.decompose.protocol.bereft`: which transitions the dead may hold up, which promises a dead
coordinator leaves, and the net that has both. What is asked of it is in `outages`, and what ties it to the protocol's
net in `outage_obligations`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.decompose.verification.voting import UNNAMED, Part, Voting
from firable.nets.net import Net, Place, Transition

PREFIX: Final = "faults.dead"

NOT_BEGUN: Final = "life/not-begun"
ALIVE: Final = "life/alive"
DYING: Final = "life/dying"
DEAD: Final = "life/dead"
EARLY: Final = "life/dead-at-once"


@dataclass(frozen=True)
class Wake:
    """What is left when a controller is dead, or where that is empty a coordinator, by the name in the layers."""

    voting: Voting
    controller: str
    coordinator: str
    free: frozenset[tuple[str, str]] = frozenset()

    @property
    def told(self) -> str:
        """Who is dead, in words."""
        unnamed = self.coordinator == UNNAMED or len(self.voting.coordinators) == 1
        return self.controller or (UNNAMED if unnamed else f"coordinator {self.coordinator}")

    @property
    def name(self) -> str:
        """The name of the verdict."""
        if self.controller:
            return f"{PREFIX}.{self.controller}"
        return f"{PREFIX}-coordinator" + ("" if self.told == UNNAMED else f".{self.coordinator}")

    @cached_property
    def held_up(self) -> set[str]:
        """What fires no more in the worst case: for a controller, whatever is behind a round of it, or may be."""
        voting = self.voting
        if not self.controller:
            return {t for t in voting.parts if voting.cut.decided_at[t] == self.coordinator}
        waited_for = {part.whole for part in voting.all_parts if part.controller == self.controller}
        together = {t for group in voting.groups if waited_for & set(group) for t in group}
        footprints = {t.name: self._footprint(t) for t in voting.transitions}

        def near(t: str, some: set[str]) -> bool:
            moved, looked_at = footprints[t]
            return any(moved & footprints[u][1] or looked_at & footprints[u][0] for u in some)

        alone = {p.whole for p in voting.local if p.controller == self.controller or near(p.whole, together)}
        stopped = set(together)
        while behind := {u for t in voting.parts if t not in stopped and near(t, stopped) for u in voting.group_of[t]}:
            stopped |= behind
        return stopped | alone

    def _footprint(self, t: Transition) -> tuple[set[tuple[str, str]], set[tuple[str, str]]]:
        """What a transition may change, and what it may see; a signal under a promise stays as it is, so both."""
        both = {("place", p) for p in (*t.inputs, *t.outputs)} | {("signal", s) for s in self._signals(t)}
        return both, both | {("place", p) for p in (*t.permissive, *t.inhibitive)}

    def _signals(self, t: Transition) -> set[str]:
        """The signals that its gates read, and those that a token clears where it puts one."""
        entered = map(self.voting.cut.net.place, t.outputs)
        return {gate.signal for gate in t.external} | {signal for place in entered for signal in place.cleared}

    def _promises_near(self, part: Part) -> set[str]:
        """The promises that keep a part from being promised or fired, or hold a signal of it still."""
        mine, its = self._signals(part.own), self.voting.group_of.get(part.whole, ())
        found = set(self.voting.others(part))
        for other in self.voting.all_parts if mine else ():
            if other.controller == part.controller and other.whole not in its and mine & self._signals(other.own):
                found.add(other.at("promised"))
        return found

    def is_at_once(self, t: str) -> bool:
        """Whether only the dead could fire it."""
        if not self.controller:
            return t in self.held_up
        return any(part.whole == t and part.controller == self.controller for part in self.voting.local)

    def sending(self, among: list[str]) -> dict[str, list[str]]:
        """For each machine, the transitions of these that send it a command."""
        found: dict[str, list[str]] = {}
        for place in self.voting.cut.net.places:
            if place.command is not None:
                found.setdefault(place.command.machine, []).append(place.name)
        outputs = {t: set(self.voting.cut.net.transition(t).outputs) for t in among}
        senders = {machine: [t for t in among if outputs[t] & set(entered)] for machine, entered in found.items()}
        return {machine: some for machine, some in senders.items() if some}

    @cached_property
    def promises(self) -> dict[str, Part]:
        """The parts that may stay promised to the dead and are in somebody's way, by the names of places."""
        if self.controller:
            return {}
        going = (part for part in (*self.voting.local, *self.voting.all_parts) if part.whole not in self.held_up)
        in_the_way = {promise for part in going for promise in self._promises_near(part)}
        its = (part for part in self.voting.all_parts if part.whole in self.held_up)
        return {f"held/{part.whole}/{part.controller}": part for part in its if part.at("promised") in in_the_way}

    def left_by(self, part: Part) -> set[str]:
        """The promises of these that keep a part from firing."""
        return self._places_of(self._promises_near(part))

    def _places_of(self, promises: Iterable[str]) -> set[str]:
        its = {other.at("promised"): place for place, other in self.promises.items()}
        return {its[promise] for promise in promises if promise in its}

    @cached_property
    def net(self) -> Net:
        """The net that is left."""
        central = self.voting.cut.net
        places = [Place(NOT_BEGUN, marked=True), *(Place(name) for name in (ALIVE, DYING, DEAD, EARLY))]
        places += [Place(name) for name in sorted(self.promises)]
        places += [Place(place.name, marked=place.marked) for place in central.places]
        return Net(f"bereft-{central.name}", tuple(places), tuple(self._transitions()))

    def rests(self, group: Iterable[str]) -> bool:
        """Whether the rounds of a group come to rest by the others."""
        if self.controller:
            return not any(part.controller == self.controller for t in group for part in self.voting.parts[t])
        return not any(self.voting.cut.decided_at[t] == self.coordinator for t in group)

    @property
    def down(self) -> str:
        """The place of the protocol's net that holds a token while the dead are down."""
        if self.controller:
            return f"down/{self.controller}"
        return next(self.voting.coordinator_down(t) for t in sorted(self.held_up))

    def _promised(self, part: Part) -> tuple[set[str], set[str]]:
        """What is full and what is empty in the central net, of a part that is promised and of which no order is on."""
        own, moved = part.own, set[str]()
        for other in self.voting.all_parts:
            if other.controller == part.controller and other.whole in self.voting.group_of[part.whole]:
                moved |= other.writes if other is not part else set()
        return {*own.inputs, *own.permissive} - moved, {*own.outputs, *own.inhibitive} - moved

    def _behind(self, part: Part) -> tuple[set[str], set[str]]:
        """The same of one that has been decided: the central net has moved its tokens.

        One that is free of promise has locked nothing, and its gates may be as they like by now.
        """
        own = part.own
        if self.is_free(part):
            return set(own.outputs), set(own.inputs)
        seen, shut = {*own.permissive} - part.writes, {*own.inhibitive} - part.writes  # gates on what it has moved
        return {*own.outputs, *seen}, {*own.inputs, *shut}

    def is_free(self, part: Part) -> bool:
        """Whether it promises nothing, and nobody waits for it but where it is behind."""
        return (part.whole, part.controller) in self.free

    def _transitions(self) -> Iterator[Transition]:
        yield Transition("life/begins", (NOT_BEGUN,), (ALIVE,))
        yield Transition("life/dies-at-once", (NOT_BEGUN,), (DEAD, EARLY))
        yield Transition("life/dies", (ALIVE,), (DYING,))
        yield Transition("life/is-dead", (DYING,), (DEAD,))
        for act in ("behind", "hold"):
            for place, part in sorted(self.promises.items()):
                if act == "hold" and self.is_free(part):
                    continue
                full, empty = self._promised(part) if act == "hold" else self._behind(part)
                full = full | {DYING}
                if not self.is_free(part):
                    others = self._places_of(self.voting.others(part))
                    empty = empty | {other for other in others if not self.is_free(self.promises[other])}
                name = f"{act}{place.removeprefix('held')}"
                yield Transition(name, (), (place,), tuple(sorted(full)), tuple(sorted(empty)))
        stopped: dict[str, set[str]] = {}
        for part in (*self.voting.local, *self.voting.all_parts):
            stopped[part.whole] = stopped.get(part.whole, set()) | self.left_by(part)
        for t in self.voting.transitions:
            full, empty = set(t.permissive), set(t.inhibitive)
            if t.name in self.held_up:
                full.add(ALIVE)
            else:
                empty |= {NOT_BEGUN, DYING} | stopped[t.name]
            yield Transition(t.name, t.inputs, t.outputs, tuple(sorted(full)), tuple(sorted(empty)))


def wakes(voting: Voting, free: Iterable[tuple[str, str]] = ()) -> Iterator[Wake]:
    """Everybody who can be dead; `voting` is the protocol in which every part promises, `free` those that do not."""
    known = frozenset(free)
    yield from (Wake(voting, subnet.name, "", known) for subnet in voting.cut.subnets)
    yield from (Wake(voting, "", coordinator, known) for coordinator in sorted(voting.coordinators))
