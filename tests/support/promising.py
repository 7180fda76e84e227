"""The voting protocol with some parts that promise nothing: every run of a small net, against the central net.

A controller votes on what its own places show; the coordinator decides by the votes of one round; orders come late, and
overtake each other. Parts in `free` vote without a promise. The central net fires with each decision and each local
firing: where it cannot follow, or an order cannot be applied, the run is wrong.

A completion is a bit beside the places: a firing that sends a command clears it, at its controller when it is applied
and in the central net at once, and a machine sets it while a place that waits for it is full, which tells the central
net nothing of a command still to be sent. Sensors are free.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, SignalKind, Transition

Part = tuple[int, int]
"""A coordinated transition, and one of its parts, by their numbers."""


@dataclass(frozen=True, slots=True)
class Situation:
    """What the controllers' places hold, what the central net's would, and where each round stands."""

    local: Marking
    central: Marking
    heard: frozenset[Part] = frozenset()
    promised: frozenset[Part] = frozenset()
    ordered: frozenset[Part] = frozenset()
    stopped: frozenset[Part] = frozenset()


@dataclass(frozen=True, slots=True)
class Sets:
    """The places and completions of a part, or of a local transition, as masks; `reads` holds all of them."""

    controller: str
    full: Marking
    empty: Marking
    inputs: Marking
    outputs: Marking
    clears: Marking

    @property
    def reads(self) -> Marking:
        return self.full | self.empty

    @property
    def writes(self) -> Marking:
        return self.inputs | self.outputs | self.clears

    def firable(self, marking: Marking) -> bool:
        return marking & self.full == self.full and not marking & self.empty

    def disturbs(self, other: Sets) -> bool:
        return bool(self.writes & other.reads or other.writes & self.reads)

    def fire(self, marking: Marking) -> Marking:
        return marking & ~(self.inputs | self.clears) | self.outputs


class Promising:
    """The protocol of one decomposition."""

    def __init__(self, decomposition: Decomposition, free: Collection[str]) -> None:
        self.net = decomposition.net
        self.rows = decomposition.coordinated
        self.free = free
        self.completion = {
            signal.name: 1 << len(self.net.places) + i
            for i, signal in enumerate(self.net.signals)
            if signal.kind is SignalKind.COMPLETION
        }
        waiting = dict[str, set[str]]()
        for place in self.net.places:
            if place.completion is not None:
                waiting.setdefault(place.completion, set()).add(place.name)
        self.waiting = [(self.completion[signal], self.net.marking(names)) for signal, names in waiting.items()]
        group_of = {name: i for i, g in enumerate(decomposition.groups) for name in (*g.sequence, *g.rest)}
        self.group = [group_of.get(row.name, -1 - i) for i, row in enumerate(self.rows)]
        self.whole = [self.sets("", self.net.transition(row.name)) for row in self.rows]
        self.parts = [
            [
                self.sets(part.controller, decomposition.subnet(part.controller).transition(part.name))
                for part in row.parts
            ]
            for row in self.rows
        ]
        coordinated = {part.name for row in self.rows for part in row.parts}
        self.local = [
            self.sets(subnet.name, t)
            for subnet in decomposition.subnets
            for t in subnet.transitions
            if t.name not in coordinated
        ]

    def sets(self, controller: str, t: Transition) -> Sets:
        mark, bit = self.net.marking, self.completion
        gates = [gate for gate in t.external if gate.signal in bit]
        sent = {self.net.place(name).completion for name in t.outputs}
        return Sets(
            controller,
            mark({*t.inputs, *t.permissive}) | sum({bit[gate.signal] for gate in gates if gate.wanted}),
            mark({*t.outputs, *t.inhibitive}) | sum({bit[gate.signal] for gate in gates if not gate.wanted}),
            mark(t.inputs),
            mark(t.outputs),
            sum(bit[signal] for signal in sent if signal is not None),
        )

    def of(self, part: Part) -> Sets:
        return self.parts[part[0]][part[1]]

    @cached_property
    def openable(self) -> list[bool]:
        return [self.net.transition(row.name).openable for row in self.rows]

    def held(self, now: Situation, one: Sets, group: int | None) -> bool:
        """Whether a promise of another round at the controller keeps this from being voted on or fired."""
        return any(
            self.of(part).controller == one.controller and self.group[part[0]] != group and self.of(part).disturbs(one)
            for part in now.promised
        )

    def moves(self, now: Situation) -> Iterator[Situation | None]:
        """What may happen next; None is a move that the central net does not follow."""
        busy = {self.group[t] for t, _ in (*now.ordered, *now.stopped)}
        for t, parts in enumerate(self.parts):
            if self.group[t] in busy or not self.openable[t]:
                continue
            every = {(t, i) for i in range(len(parts))}
            for part in every - now.heard:
                if self.of(part).firable(now.local) and not self.held(now, self.of(part), self.group[t]):
                    promised = now.promised if self.rows[t].parts[part[1]].name in self.free else now.promised | {part}
                    yield replace(now, heard=now.heard | {part}, promised=promised)
            if every <= now.heard:
                yield self.decided(now, t, frozenset(every))
        for group in {self.group[t] for t, _ in now.heard} - busy:
            yield self.given_up(now, group)
        for part in now.ordered:
            sets = self.of(part)
            fits = now.local & sets.inputs == sets.inputs and not now.local & sets.outputs
            left = replace(
                now, local=sets.fire(now.local), ordered=now.ordered - {part}, promised=now.promised - {part}
            )
            yield left if fits else None
        for part in now.stopped:
            yield replace(now, stopped=now.stopped - {part}, promised=now.promised - {part})
        for sets in self.local:
            if sets.firable(now.local) and not self.held(now, sets, None):
                local, central = sets.fire(now.local), sets.fire(now.central)
                yield replace(now, local=local, central=central) if sets.firable(now.central) else None
        for bit, places in self.waiting:
            latched = any((self.of(part).reads | self.of(part).clears) & bit for part in now.promised)
            if now.local & places and not now.local & bit and not latched:
                stale = any(self.of(part).clears & bit for part in now.ordered)
                yield replace(now, local=now.local | bit, central=now.central if stale else now.central | bit)

    def decided(self, now: Situation, t: int, every: frozenset[Part]) -> Situation | None:
        whole = self.whole[t]
        if not whole.firable(now.central):
            return None
        others = frozenset(part for part in now.promised if self.group[part[0]] == self.group[t] and part not in every)
        return replace(
            now,
            central=whole.fire(now.central),
            heard=frozenset(part for part in now.heard if self.group[part[0]] != self.group[t]),
            ordered=now.ordered | every,
            stopped=now.stopped | others,
        )

    def given_up(self, now: Situation, group: int) -> Situation:
        return replace(
            now,
            heard=frozenset(part for part in now.heard if self.group[part[0]] != group),
            stopped=now.stopped | {part for part in now.promised if self.group[part[0]] == group},
        )

    def follows(self, most: int = 20_000) -> bool | None:
        """Whether the central net follows every run; None where there are more situations than are looked at."""
        start = Situation(self.net.initial_marking, self.net.initial_marking)
        seen, waiting = {start}, [start]
        while waiting:
            for after in self.moves(waiting.pop()):
                if after is None:
                    return False
                if after not in seen:
                    seen.add(after)
                    waiting.append(after)
            if len(seen) > most:
                return None
        return True
