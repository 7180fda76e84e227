"""Cutting the central net anew, from the definitions of SEMANTICS, and comparing with what a bundle holds.

Participants(t) are the owners of what t touches; more than one make it global. Each participant has a part, named by
the number of its controller (0 the coordinator's own, the others from 1) and the number of the transition. Conflict is
a shared input or output place, and a component of it is one group, the coordinator's where a global transition is in
it: of the coordinators that are above all participants, the lowest. A transition that takes a token because it is late
does not compete for it (`is_late`). Where there are several coordinators, it decides with a transition all that
disturbs it and could be promised together with it. All this is a function of the net, so there is one right
decomposition; what a bundle holds is that one, or is refused with the first thing that differs.

Written for this purpose alone, and plainly: components grow by the places that their members share. It is the second
text of these definitions; the first one, `firable.decompose.splitting`, is what it checks.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count

from firable.decompose.verification.refusal import NotShownError
from firable.nets.decomposition import ArbitrationGroup, Coordinated, Decomposition, Part
from firable.nets.diagnostics import InputError
from firable.nets.net import ArbitrationRule, Net, Place, Signal, SignalKind, Transition


@dataclass(frozen=True)
class Cut:
    """What SEMANTICS makes of a net: participants, parts, conflict components."""

    net: Net

    @cached_property
    def owner(self) -> dict[str, str]:
        """The owner of each place and signal."""
        found: dict[str, str] = {}
        items: tuple[Place | Signal, ...] = (*self.net.places, *self.net.signals)
        for item in items:
            if item.owner is None:
                raise NotShownError(f"'{item.name}' has no owner")
            found[item.name] = item.owner
        awaited = {place.completion for place in self.net.places}
        for signal in self.net.signals:
            if signal.kind is SignalKind.COMPLETION and signal.name not in awaited:
                raise NotShownError(f"'{signal.name}' is the completion of no command: its gates never open")
        return found

    @cached_property
    def controller_number(self) -> dict[str, int]:
        """The number of each controller in the names of parts."""
        numbers = count(1)
        return {c.name: 0 if c.coordinator else next(numbers) for c in self.net.controllers}

    @cached_property
    def participants(self) -> dict[str, tuple[str, ...]]:
        """The controllers that take part in each transition, by their numbers."""
        found = {}
        for t in self.net.transitions:
            touched = [*t.inputs, *t.outputs, *t.permissive, *t.inhibitive, *(gate.signal for gate in t.external)]
            if not touched:
                raise NotShownError(f"nobody takes part in '{t.name}'")
            found[t.name] = tuple(
                sorted({self.owner[name] for name in touched}, key=self.controller_number.__getitem__)
            )
        return found

    def is_global(self, name: str) -> bool:
        """Whether more than one controller takes part."""
        return len(self.participants[name]) > 1

    @cached_property
    def numbers(self) -> dict[str, int | None]:
        """The number of each transition: its own; a global one without any has the next that no other one has."""
        taken = {t.number for t in self.net.transitions}
        if any(number is not None and number < 0 for number in taken):
            raise NotShownError("a row has a negative number")
        free = (n for n in count(1) if n not in taken)
        return {
            t.name: next(free) if t.number is None and self.is_global(t.name) else t.number
            for t in self.net.transitions
        }

    @cached_property
    def parts(self) -> dict[str, tuple[Part, ...]]:
        """The parts of each transition."""

        def named(controller: str, name: str) -> str:
            number = self.controller_number[controller]
            return f"t{number}-{self.numbers[name]}" + (str(number) if number else "")

        return {
            name: tuple(Part(c, named(c, name)) for c in among) if len(among) > 1 else (Part(among[0], name),)
            for name, among in self.participants.items()
        }

    @cached_property
    def sharing(self) -> dict[tuple[str, str], list[str]]:
        """The transitions at each place that they compete for: as consumers ("from") or as producers ("to")."""
        found: dict[tuple[str, str], list[str]] = {}
        for t in self.net.transitions:
            for kind, places in (("from", t.inputs), ("to", t.outputs)):
                for place in places:
                    if kind == "from" and is_late(self.net, t, place):
                        continue
                    found.setdefault((kind, place), []).append(t.name)
        return {key: names for key, names in found.items() if len(names) > 1}

    @cached_property
    def competes_for(self) -> dict[str, list[tuple[str, str]]]:
        """The places that each transition competes for."""
        found: dict[str, list[tuple[str, str]]] = {}
        for key, names in self.sharing.items():
            for name in names:
                found.setdefault(name, []).append(key)
        return found

    @cached_property
    def components(self) -> tuple[tuple[str, ...], ...]:
        """The conflict components, in the order of their first transitions, each in the order of the net."""
        order = {t.name: i for i, t in enumerate(self.net.transitions)}
        done: set[str] = set()
        seen: set[tuple[str, str]] = set()
        components = []
        for t in self.net.transitions:
            if t.name in done or t.name not in self.competes_for:
                continue
            grown, members = [t.name], {t.name}
            while grown:
                for key in self.competes_for[grown.pop()]:
                    if key in seen:
                        continue
                    seen.add(key)
                    new = [name for name in self.sharing[key] if name not in members]
                    members.update(new)
                    grown += new
            done |= members
            components.append(tuple(sorted(members, key=order.__getitem__)))
        return tuple(components)

    @cached_property
    def root(self) -> str:
        """The coordinator above all others."""
        return next((c.name for c in self.net.controllers if c.coordinator), "the coordinator")

    @cached_property
    def way_up(self) -> dict[str, tuple[str, ...]]:
        """Each controller, what it is under, and so on up to the root."""
        above = {c.name: c.under for c in self.net.controllers}
        ways = {}
        for name in above:
            way = [name]
            while way[-1] != self.root:
                way.append(above.get(way[-1]) or self.root)
            ways[name] = tuple(way)
        return ways

    def lowest_above(self, names: Iterable[str]) -> str:
        """The lowest coordinator above all who take part in these transitions."""
        ways = [self.way_up[owner] for owner in dict.fromkeys(o for name in names for o in self.participants[name])]
        return next(name for name in ways[0] if all(name in way for way in ways))

    @cached_property
    def in_layers(self) -> bool:
        """Whether there is a coordinator under another one."""
        return len({way[1] for way in self.way_up.values() if len(way) > 1}) > 1

    @cached_property
    def decided_at(self) -> dict[str, str]:
        """The coordinator of each transition that is global, or competes with one that is."""
        alone = [(t.name,) for t in self.net.transitions if t.name not in self.competes_for]
        classes = [set(names) for names in (*self.components, *alone) if any(map(self.is_global, names))]
        class_of = {name: names for names in classes for name in names}
        for one, other in self.standing_in_the_way(set(class_of)) if self.in_layers else ():
            larger, smaller = sorted((class_of[one], class_of[other]), key=len, reverse=True)
            if larger is not smaller:
                larger |= smaller
                class_of |= dict.fromkeys(smaller, larger)
        distinct = {id(names): names for names in class_of.values()}.values()
        decided = ((names, self.lowest_above(sorted(names))) for names in distinct)
        return {name: at for names, at in decided for name in names}

    def standing_in_the_way(self, among: set[str]) -> Iterator[tuple[str, str]]:
        """The pairs of these that disturb each other at a controller where the arcs let both be promised."""
        for subnet in self.subnets:
            for (one, t), (other, u) in self.disturbing(subnet, among):
                if not any(self.wants(t).get(x, w) != w for x, w in self.wants(u).items()):
                    yield one, other

    def disturbing(
        self, subnet: Net, among: Container[str]
    ) -> Iterator[tuple[tuple[str, Transition], tuple[str, Transition]]]:
        """The pairs of parts in a subnet of which one changes what the other reads, each with what it is part of."""
        whole = self._whole[subnet.name]
        its = [(whole[part.name], part) for part in subnet.transitions if whole[part.name] in among]
        readers: dict[str, list[int]] = {}
        for j, (_, part) in enumerate(its):
            for read in self.wants(part):
                readers.setdefault(read, []).append(j)
        pairs = set[tuple[int, int]]()
        for i, (_, part) in enumerate(its):
            cleared = (signal for place in part.outputs for signal in self.net.place(place).cleared)
            for changed in (*part.inputs, *part.outputs, *cleared):
                pairs |= {(min(i, j), max(i, j)) for j in readers.get(changed, ()) if j != i}
        return ((its[i], its[j]) for i, j in sorted(pairs))

    @cached_property
    def _whole(self) -> dict[str, dict[str, str]]:
        """For each controller, the transition of each of its parts."""
        found: dict[str, dict[str, str]] = {controller.name: {} for controller in self.net.controllers}
        for t, its in self.parts.items():
            for part in its:
                found[part.controller][part.name] = t
        return found

    @staticmethod
    def wants(part: Transition) -> dict[str, bool]:
        """The places and signals that a part reads, and whether it wants them full, or 1."""
        full = dict.fromkeys((*part.inputs, *part.permissive), True)
        empty = dict.fromkeys((*part.outputs, *part.inhibitive), False)
        return {gate.signal: gate.wanted for gate in part.external} | full | empty

    def layer(self, name: str) -> str | None:
        """The coordinator that decides a transition; None is the root."""
        found = self.decided_at[name]
        return None if found == self.root else found

    @cached_property
    def groups(self) -> tuple[ArbitrationGroup, ...]:
        """The arbitration group of each component."""
        of_arbiter = {name: arbiter for arbiter in self.net.arbiters for name in arbiter.among}
        competing = {name for members in self.components for name in members}
        if idle := next((name for name in of_arbiter if name not in competing), None):
            raise NotShownError(f"'{of_arbiter[idle].name}' decides of '{idle}', which is in no conflict")
        groups = []
        for number, members in enumerate(self.components, 1):
            arbiters = list(dict.fromkeys(of_arbiter[name] for name in members if name in of_arbiter))
            if len(arbiters) > 1 or any(set(a.among) - set(members) for a in arbiters):
                raise NotShownError(f"the conflict of '{members[0]}' does not have one arbiter of its own")
            name, by = f"conflict-{number}", ArbitrationRule.PRIORITY
            among: tuple[str, ...] = ()
            while name in {arbiter.name for arbiter in self.net.arbiters}:
                name = f"conflict-{name}"
            if arbiters:
                name, among, by = arbiters[0].name, arbiters[0].among, arbiters[0].by
            rest = tuple(t for t in members if t not in set(among))
            if any(map(self.is_global, members)):
                groups.append(ArbitrationGroup(name, among, rest, by, None, self.layer(members[0])))
            else:
                groups.append(ArbitrationGroup(name, among, rest, by, self.participants[members[0]][0]))
        return tuple(groups)

    @cached_property
    def coordinated(self) -> tuple[Coordinated, ...]:
        """The rows of the coordinator: the global transitions, and who competes with them."""
        return tuple(
            Coordinated(t.name, self.numbers[t.name], self.parts[t.name], t.description, self.layer(t.name))
            for t in self.net.transitions
            if t.name in self.decided_at
        )

    @cached_property
    def subnets(self) -> tuple[Net, ...]:
        """The subnet of each controller."""
        transitions: dict[str, list[Transition]] = {c.name: [] for c in self.net.controllers}
        for t in self.net.transitions:
            for part in self.parts[t.name]:
                number = t.number if len(self.parts[t.name]) == 1 else None
                transitions[part.controller].append(self._part(t, part, number))
        places: dict[str, list[str]] = {}
        signals: dict[str, list[str]] = {}
        for place in self.net.places:
            places.setdefault(self.owner[place.name], []).append(place.name)
        for signal in self.net.signals:
            signals.setdefault(self.owner[signal.name], []).append(signal.name)
        return tuple(
            Net(
                c.name,
                tuple(self.net.place(name) for name in places.get(c.name, ())),
                tuple(transitions[c.name]),
                tuple(self.net.signal(name) for name in signals.get(c.name, ())),
                (replace(c, under=None),),
                description=c.description,
            )
            for c in self.net.controllers
        )

    def _part(self, t: Transition, part: Part, number: int | None) -> Transition:
        def own(names: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(name for name in names if self.owner[name] == part.controller)

        gates = tuple(gate for gate in t.external if self.owner[gate.signal] == part.controller)
        arcs = own(t.inputs), own(t.outputs)
        return Transition(part.name, *arcs, own(t.permissive), own(t.inhibitive), gates, number, t.description)


def is_late(net: Net, t: Transition, place: str) -> bool:
    """Whether a transition takes the token of a place because its completion has not come in time.

    It wants the timer 1 and the completion 0, which all others there want 1: so it competes with none of them.
    """
    at = net.place(place)
    wanted = {(gate.signal, gate.wanted) for gate in t.external}
    late = at.within is not None and {(at.within.timer, True), (str(at.completion), False)} <= wanted
    return late and (str(at.completion), True) not in wanted


def check_cut(decomposition: Decomposition) -> Cut:
    """The cut of the net of a decomposition; raises `NotShownError` where the decomposition is another one.

    So it does where two parts have one name, that of a local transition included: verdicts on votes go by that name.
    """
    cut = Cut(decomposition.net)
    borne = [part.name for its in cut.parts.values() for part in its]
    if len(borne) > len({*borne}):
        twice = next(name for name in borne if borne.count(name) > 1)
        raise NotShownError(f"the net cannot be split: two parts are named '{twice}'", "net")
    try:
        found = next(_differences(cut, decomposition), None)
    except (InputError, ValueError) as error:  # its parts are no nets
        reason = error.diagnostics[0].message if isinstance(error, InputError) else str(error)
        raise NotShownError(f"the net cannot be split: {reason}", "net") from None
    if found is not None:
        raise found
    return cut


def _differences(cut: Cut, decomposition: Decomposition) -> Iterator[NotShownError]:
    if len(decomposition.subnets) != len(cut.subnets):
        yield NotShownError("there is not one subnet for each controller", "subnets")
    for subnet, wanted in zip(decomposition.subnets, cut.subnets, strict=False):
        for kind in (
            "name",
            "controllers",
            "places",
            "signals",
            "transitions",
            "arbiters",
            "properties",
            "description",
            "expected",
        ):
            if getattr(subnet, kind) != getattr(wanted, kind):
                yield NotShownError(
                    f"the subnet of '{wanted.name}' is not what '{wanted.name}' has of the net: {kind} differ",
                    "subnets",
                    wanted.name,
                )
    for i, row in enumerate(cut.coordinated):
        if i >= len(decomposition.coordinated) or decomposition.coordinated[i] != row:
            yield NotShownError(f"the row of '{row.name}' is missing, or not what the net makes it", "table", row.name)
    for i, group in enumerate(cut.groups):
        if i >= len(decomposition.groups) or decomposition.groups[i] != group:
            message = f"the group '{group.name}' is missing, or not what the net makes it"
            yield NotShownError(message, "table", group.name)
    if replace(decomposition, net=cut.net, subnets=cut.subnets, coordinated=cut.coordinated, groups=cut.groups) != (
        decomposition
    ):
        yield NotShownError("the decomposition is not the one that the net makes", "table")
