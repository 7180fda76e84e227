"""Who takes part in what: the parts of the coordinated transitions, their groups, who decides, and what disturbs what.

A part is what one controller has of a coordinated transition: a transition of its subnet. Two parts *disturb* each
other if firing one could change what the other reads (O1). A part that is free of promise votes unasked, and nobody
waits for a promise of it; it waits for all that it would disturb. What can never fire (no valuation opens its external
gates, or Eq. (1) wants a place both full and empty) takes no part in anything and is left out.

The variants that break the split itself are made here, so that the steps need not know of them: with copies of gates,
who owns only gates takes no part, and one of the others reads a copy; without arbitration, the local members of a
conflict are local, and global ones have groups of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from firable.decompose.protocol.variant import Lock, Variant
from firable.nets.decomposition import Decomposition
from firable.nets.layers import COORDINATOR, Layers
from firable.nets.net import Net, Transition


@dataclass(frozen=True, slots=True)
class Part:
    """A transition, or the part of one, at one controller; places are those of the central net.

    `copied_full` and `copied_empty` are places of others, of which the controller reads copies. One that is `free` of
    promise votes unasked.
    """

    whole: str
    controller: str
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    permissive: tuple[str, ...]
    inhibitive: tuple[str, ...]
    has_signals: bool
    copied_full: tuple[str, ...] = ()
    copied_empty: tuple[str, ...] = ()
    free: bool = False

    @property
    def writes(self) -> frozenset[str]:
        """The places that it moves tokens of."""
        return frozenset((*self.inputs, *self.outputs))

    @property
    def reads(self) -> frozenset[str]:
        """The places that its firability depends on."""
        return self.writes | frozenset((*self.permissive, *self.inhibitive))


@dataclass(frozen=True)
class Parts:
    """The parts of a decomposition under a variant, in the order of the central net."""

    decomposition: Decomposition
    variant: Variant

    @property
    def net(self) -> Net:
        """The central net."""
        return self.decomposition.net

    @cached_property
    def transitions(self) -> tuple[Transition, ...]:
        """The transitions that can fire at all: their gates can open, and no place has to be full and empty at once."""
        return tuple(
            t
            for t in self.net.transitions
            if t.openable and {*t.inputs, *t.permissive}.isdisjoint((*t.outputs, *t.inhibitive))
        )

    @cached_property
    def copies(self) -> tuple[tuple[str, str], ...]:
        """The (reader, place) of each copy of a gate source elsewhere."""
        every = ((part.controller, place) for its in self._made.values() for part in its for place in _copied(part))
        return tuple(dict.fromkeys(every))

    @cached_property
    def coordinated(self) -> dict[str, tuple[Part, ...]]:
        """The parts of each transition that the coordinator decides."""
        rows = {row.name for row in self.decomposition.coordinated}
        return {t: its for t, its in self._made.items() if t in rows and (len(its) > 1 or self._stays(t))}

    @cached_property
    def local(self) -> tuple[Part, ...]:
        """The transitions that a controller fires by itself."""
        return tuple(its[0] for t, its in self._made.items() if t not in self.coordinated)

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """The coordinated transitions that are decided together, each once, however many turns it has."""
        if not self.variant.arbitrated:
            return tuple((t,) for t in self.coordinated)
        together = [
            tuple(dict.fromkeys(t for t in (*group.sequence, *group.rest) if t in self.coordinated))
            for group in self.decomposition.groups
            if group.controller is None
        ]
        if not self.variant.common:
            together = [tuple(t for t in group if self._decided_at[t] == at) for group in together for at in self._at]
        grouped = {t for group in together for t in group}
        return (*filter(None, together), *((t,) for t in self.coordinated if t not in grouped))

    @cached_property
    def group_of(self) -> dict[str, int]:
        """The index of the group of each coordinated transition."""
        return {t: g for g, group in enumerate(self.groups) for t in group}

    @cached_property
    def deciders(self) -> tuple[str, ...]:
        """The coordinators that decide something, in words, from the root of the layers down."""
        return tuple(dict.fromkeys(self._named(at) for at in self._at if at in self._deciding))

    def decider(self, t: str) -> str:
        """The coordinator that decides a transition, in words: with several, a controller bears its name too."""
        return self._named(self._decided_at[t])

    @cached_property
    def _at(self) -> tuple[str, ...]:
        return tuple(Layers(self.net).coordinators())

    @cached_property
    def _decided_at(self) -> dict[str, str]:
        layers = Layers(self.net)
        rows = [row for row in self.decomposition.coordinated if row.name in self.coordinated]
        if self.variant.common:
            return {row.name: row.at or layers.root for row in rows}
        lowest = {row.name: layers.common(part.controller for part in row.parts) for row in rows}
        return {t: at if at in self._at else layers.parent[at] for t, at in lowest.items()}

    @cached_property
    def _deciding(self) -> frozenset[str]:
        return frozenset(self._decided_at.values())

    def _named(self, at: str) -> str:
        return COORDINATOR if len(self._deciding) == 1 or at == COORDINATOR else f"coordinator {at}"

    def promising(self, t: str) -> tuple[Part, ...]:
        """The parts of a transition that are asked for a promise; without any, it is not asked for at all."""
        return tuple(part for part in self.coordinated[t] if not part.free)

    def excluding(self, part: Part) -> tuple[Part, ...]:
        """The parts whose promise keeps this one from being promised, voted on or fired."""
        return tuple(
            other
            for its in self.coordinated.values()
            for other in its
            if other.controller == part.controller and not other.free and self._excludes(other, part)
        )

    def _excludes(self, promised: Part, part: Part) -> bool:
        if promised.whole == part.whole or self.variant.lock is Lock.NOTHING:
            return False
        group = self.group_of.get(part.whole)
        together = group is not None and group == self.group_of[promised.whole] and self.variant.acknowledged
        if together and not part.free:
            return False  # the round is theirs together, and has one commit
        if not self.variant.arbitrated and self._conflict(promised.whole, part.whole):
            return False
        if not self.variant.common and group is not None and self._conflict(promised.whole, part.whole):
            return False
        covered = promised.writes if self.variant.lock is Lock.WRITES else promised.reads
        return bool(part.writes & covered or part.reads & promised.writes)

    def _conflict(self, t: str, u: str) -> bool:
        component = (frozenset((*group.sequence, *group.rest)) for group in self.decomposition.groups)
        return any({t, u} <= members for members in component)

    def _stays(self, t: str) -> bool:
        """Whether a coordinated transition with one part is decided by the coordinator."""
        whole = next(row for row in self.decomposition.coordinated if row.name == t)
        return self.variant.acknowledged and self.variant.arbitrated and not whole.is_global

    @cached_property
    def _made(self) -> dict[str, tuple[Part, ...]]:
        names = {row.name: row.parts for row in self.decomposition.coordinated}
        found = {}
        for t in self.transitions:
            if t.name in names:
                its = tuple(self._part(t.name, part.controller, part.name) for part in names[t.name])
            else:
                its = (self._part(t.name, self._home(t.name), t.name),)
            found[t.name] = _with_copies(its) if self.variant.gate_copies else its
        return found

    def _home(self, t: str) -> str:
        return next(subnet.name for subnet in self.decomposition.subnets if t in subnet.transition_index)

    def _part(self, whole: str, controller: str, name: str) -> Part:
        t = self.decomposition.subnet(controller).transition(name)
        arcs = (t.inputs, t.outputs, t.permissive, t.inhibitive)
        return Part(whole, controller, name, *arcs, bool(t.external), free=self._is_free(whole, controller))

    def votes_numbered(self, part: Part) -> bool:
        """Whether votes on a part carry the number of their round; one that stands, that of what it comes after."""
        return self.variant.vote_rounds or (self.variant.of_free and not part.free)

    def orders_numbered(self, part: Part) -> bool:
        """Whether orders to a part carry the number of their round."""
        return self.variant.order_rounds or (self.variant.of_free and not part.free)

    def _is_free(self, whole: str, controller: str) -> bool:
        """Whether a part is said to be free of promise; in the bare skeleton none is."""
        if not self.variant.acknowledged:
            return False
        return (whole, controller) in self._free or (self.variant.all_free and whole in self._rows)

    @cached_property
    def _free(self) -> frozenset[tuple[str, str]]:
        return frozenset(self.decomposition.free)

    @cached_property
    def _rows(self) -> frozenset[str]:
        return frozenset(row.name for row in self.decomposition.coordinated)


def _copied(part: Part) -> Iterator[str]:
    yield from part.copied_full
    yield from part.copied_empty


def _with_copies(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts without those that own only gates; the first of the others reads these from copies."""
    kept = [part for part in parts if part.writes or part.has_signals]
    if not kept or len(kept) == len(parts):
        return tuple(parts)
    left_out = [part for part in parts if part not in kept]

    def sources(of: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(place for places in of for place in places)

    reader = replace(
        kept[0],
        copied_full=sources(part.permissive for part in left_out),
        copied_empty=sources(part.inhibitive for part in left_out),
    )
    return (reader, *kept[1:])
