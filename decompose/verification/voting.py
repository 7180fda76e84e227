"""The net of the voting protocol made anew, from the cut of the central net and a table of steps.

The second text of `firable.decompose.protocol.building`, which it checks, for the true protocol alone: without
faults, and under any number of them. The table below is the protocol as docs/protocol.md tells it, a row for each step;
what stands in it is a place of the part (`request` is `request/G2/robot`), of its transition (`asked`, `committed`) or
of its group (`decided`), or a set of places in capitals. Who acts is the controller, or the coordinator that decides
the transition; where several decide something, each may crash by itself, and `coordinator-down` bears its name.

    INPUTS, OUTPUTS     what the part takes and puts, in the subnet of its controller
    FULL, EMPTY         what Eq. (1) demands of its places
    OTHERS              the promises, of parts of other groups, that it would disturb (O1)

Two different things whose names would make one place, as transitions `a/b` at `c` and `a` at `b/c`, are refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeVar

from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.nets.net import Transition

ASTRAY: Final = "astray"
GO_ON: Final = "faults-go-on"
LATE: Final = "late-copy-of-old-round"
COORDINATOR_DOWN: Final = "coordinator-down"
UNNAMED: Final = "the coordinator"
"""The root of the layers where none of the controllers is marked as it."""
MESSAGES: Final = ("request", "vote", "commit-order", "abort-order", "acknowledgement")
MEMORY: Final = ("promised", "obeyed", "heard", "noted")

HOME, REPEATS = "h", "r"

T = TypeVar("T")

_OF_PART: Final = tuple(
    tuple(word.strip() for word in row.split("|"))
    for row in """
        send-request/*       | coordinator | r  |         | request      | asked         | decided heard request
        promise/*            | controller  |    | request | promised vote | FULL | EMPTY OTHERS promised vote obeyed
        promise/*/again      | controller  |    | request | vote         | promised      | vote
        ignore-request/*     | controller  | h  | request |              | obeyed        |
        hear/*               | coordinator |    | vote    | heard        |               | heard decided
        hear/*/again         | coordinator | h  | vote    |              | heard         |
        ignore-vote/*        | coordinator | h  | vote    |              | decided       |
        order-commit/*       | coordinator | hr |         | commit-order | committed     | commit-order noted
        order-abort/*        | coordinator | hr |     | abort-order  | asked decided | abort-order committed noted heard
        order-abort/*/voted  | coordinator | hr | heard   | abort-order  | asked decided | abort-order committed noted
        apply/*              | controller  | h  | commit-order promised INPUTS | acknowledgement obeyed OUTPUTS | |
        acknowledge-commit/* | controller  | h  | commit-order | acknowledgement | obeyed | acknowledgement
        acknowledge-commit/*/unpromised | controller | h | commit-order | acknowledgement obeyed | | promised obeyed
        release/*            | controller  | h  | abort-order promised | acknowledgement obeyed | |
        release/*/unpromised | controller  | h  | abort-order | acknowledgement obeyed | | promised obeyed
        acknowledge-abort/*  | controller  | h  | abort-order | acknowledgement | obeyed | acknowledgement
        note/*               | coordinator | h  | acknowledgement | noted | | noted
        note/*/again         | coordinator | h  | acknowledgement | | noted |
    """.strip().splitlines()
)
"""Name, who acts, whether it leads home or repeats, what it takes, puts, and needs full and empty."""


@dataclass(frozen=True, slots=True)
class Part:
    """What one controller has of a transition that the coordinator decides, or a local transition."""

    whole: str
    controller: str
    own: Transition

    @property
    def writes(self) -> set[str]:
        """The places that it changes."""
        return {*self.own.inputs, *self.own.outputs}

    @property
    def reads(self) -> set[str]:
        """The places that its firability depends on."""
        return {*self.writes, *self.own.permissive, *self.own.inhibitive}

    def at(self, kind: str) -> str:
        """The place of this kind for the part."""
        return f"{kind}/{self.whole}/{self.controller}"


@dataclass(frozen=True, slots=True)
class Step:
    """One step: its places, the transition that fires by it, and whether it leads home or repeats."""

    name: str
    takes: frozenset[str]
    puts: frozenset[str]
    full: frozenset[str]
    empty: frozenset[str]
    fires: str = ""
    kind: str = ""

    @property
    def demands(self) -> dict[str, set[bool]]:
        """Eq. (1): what its places must hold."""
        found: dict[str, set[bool]] = {}
        for places, wanted in ((self.takes | self.full, True), (self.puts | self.empty, False)):
            for place in places:
                found.setdefault(place, set()).add(wanted)
        return found


@dataclass(frozen=True)
class Voting:
    """The protocol of a net that was cut, without faults or under all."""

    cut: Cut
    faults: bool

    @cached_property
    def transitions(self) -> tuple[Transition, ...]:
        """What can fire at all."""
        return tuple(
            t
            for t in self.cut.net.transitions
            if t.openable and not {*t.inputs, *t.permissive} & {*t.outputs, *t.inhibitive}
        )

    @cached_property
    def parts(self) -> dict[str, tuple[Part, ...]]:
        """The parts of each transition that the coordinator decides."""
        rows = {row.name for row in self.cut.coordinated}
        return {t.name: tuple(self._parts(t.name)) for t in self.transitions if t.name in rows}

    @cached_property
    def local(self) -> tuple[Part, ...]:
        """The transitions that a controller fires by itself."""
        return tuple(part for t in self.transitions if t.name not in self.parts for part in self._parts(t.name))

    def _parts(self, name: str) -> Iterator[Part]:
        for part in self.cut.parts[name]:
            yield Part(name, part.controller, self._subnets[part.controller][part.name])

    @cached_property
    def _subnets(self) -> dict[str, dict[str, Transition]]:
        return {subnet.name: {t.name: t for t in subnet.transitions} for subnet in self.cut.subnets}

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """What is decided together: one commit in each round."""
        decided_by_root = (group for group in self.cut.groups if group.controller is None)
        together = [tuple(t for t in (*g.sequence, *g.rest) if t in self.parts) for g in decided_by_root]
        grouped = {t for group in together for t in group}
        return (*(group for group in together if group), *((t,) for t in self.parts if t not in grouped))

    @cached_property
    def group_of(self) -> dict[str, tuple[str, ...]]:
        """The group of each transition that the coordinator decides."""
        return {t: group for group in self.groups for t in group}

    @cached_property
    def _at(self) -> dict[str, list[Part]]:
        found: dict[str, list[Part]] = {}
        for part in self.all_parts:
            found.setdefault(part.controller, []).append(part)
        return found

    @cached_property
    def all_parts(self) -> tuple[Part, ...]:
        """The parts of all transitions that the coordinator decides."""
        return tuple(part for its in self.parts.values() for part in its)

    def others(self, part: Part) -> Iterator[str]:
        """The promises that keep a part from being promised, or a local transition from firing (O1)."""
        mine = self.group_of.get(part.whole, ())
        for other in self._at.get(part.controller, ()):
            if other.whole not in mine and (part.writes & other.reads or part.reads & other.writes):
                yield other.at("promised")

    def decided(self, t: str) -> str:
        """The place of the decision on the round of a transition."""
        return f"decided/{'+'.join(self.group_of[t])}"

    def coordinator_down(self, t: str) -> str:
        """The place that holds a token while the coordinator of a transition is down."""
        at = self.cut.decided_at[t]
        return f"{COORDINATOR_DOWN}/{at}" if len(self.coordinators) > 1 and at != UNNAMED else COORDINATOR_DOWN

    @cached_property
    def coordinators(self) -> set[str]:
        """The coordinators that decide something."""
        return {self.cut.decided_at[t] for t in self.parts}

    @cached_property
    def coordinators_down(self) -> tuple[str, ...]:
        """These places, of all coordinators that decide something."""
        return tuple(sorted(set(map(self.coordinator_down, self.parts))))

    @cached_property
    def places(self) -> dict[str, bool]:
        """All places, and whether they hold a token at the start."""
        some = [(place.name, place.marked) for place in self.cut.net.places]
        some += [(central(place), marked) for place, marked in some]
        some += [(ASTRAY, False), *((f"decided/{'+'.join(group)}", False) for group in self.groups)]
        some += [(f"{kind}/{t}", False) for t in self.parts for kind in ("asked", "committed")]
        some += [(part.at(kind), False) for part in self.all_parts for kind in (*MESSAGES, *MEMORY)]
        if self.faults:
            some += [(GO_ON, True), (LATE, False), *((down, False) for down in self.coordinators_down)]
            some += [(f"down/{subnet.name}", False) for subnet in self.cut.subnets]
        return _distinct(some, "place")

    @cached_property
    def steps(self) -> dict[str, Step]:
        """All steps, by their names, in the order of these."""
        return dict(sorted(_distinct(((step.name, step) for step in self._steps()), "step").items()))

    def _steps(self) -> Iterator[Step]:
        for number, group in enumerate(self.groups):
            over = self.decided(group[0])
            for t in group:
                yield from self._of_coordinator(t, over, alone=len(group) == 1)
            if len(group) > 1:
                its = self.coordinator_down(group[0])
                yield self._step(f"close-round/{number}", its, HOME, {over}, (), (), {f"asked/{t}" for t in group})
        for part in self.all_parts:
            for row in _OF_PART:
                yield self._of_part(part, *row)
        for part in self.local:
            own = part.own
            places = (own.inputs, own.outputs, own.permissive, (*own.inhibitive, *self.others(part)))
            yield from self._firing(f"fire/{part.whole}", f"down/{part.controller}", part.whole, *places)
        if self.faults:
            yield from self._of_faults()

    def _step(
        self,
        name: str,
        down: str | None,
        kind: str,
        takes: Iterable[str] = (),
        puts: Iterable[str] = (),
        full: Iterable[str] = (),
        empty: Iterable[str] = (),
        fires: str = "",
    ) -> Step:
        """A step of somebody (None: of nobody) who takes none while there is a token on this place."""
        closed = (*empty, down) if self.faults and down is not None else empty
        return Step(name, frozenset(takes), frozenset(puts), frozenset(full), frozenset(closed), fires, kind)

    def _of_coordinator(self, t: str, over: str, *, alone: bool) -> Iterator[Step]:
        asked, committed, its, down = f"asked/{t}", f"committed/{t}", self.parts[t], self.coordinator_down(t)
        yield self._step(f"ask/{t}", down, "", (), {asked}, (), {asked, over})
        yield self._step(f"give-up/{t}", down, HOME + REPEATS, (), {over}, {asked}, {over})
        heard = [part.at("heard") for part in its]
        yield from self._firing(f"decide/{t}", down, t, heard, (committed, over), (asked,), (over,))
        answered = {asked, *(part.at(kind) for part in its for kind in ("noted", "obeyed"))}
        on_their_way = {part.at(kind) for part in its for kind in MESSAGES}
        takes, full = (answered | {over}, set[str]()) if alone else (answered, {over})
        yield self._step(f"close/{t}", down, HOME, takes | {committed}, (), full, on_their_way)
        yield self._step(f"close/{t}/aborted", down, HOME, takes, (), full, on_their_way | {committed})

    def _of_part(self, part: Part, name: str, who: str, kind: str, *columns: str) -> Step:
        own = part.own
        sets = {
            "INPUTS": own.inputs,
            "OUTPUTS": own.outputs,
            "FULL": (*own.inputs, *own.permissive),
            "EMPTY": (*own.outputs, *own.inhibitive),
            "OTHERS": tuple(self.others(part)),
            "asked": (f"asked/{part.whole}",),
            "committed": (f"committed/{part.whole}",),
            "decided": (self.decided(part.whole),),
        }
        takes, puts, full, empty = (
            [place for word in column.split() for place in sets.get(word, (part.at(word),))] for column in columns
        )
        down = f"down/{part.controller}" if who == "controller" else self.coordinator_down(part.whole)
        named = name.replace("*", f"{part.whole}/{part.controller}")
        return self._step(named, down, kind, takes, puts, full, empty)

    def _firing(
        self,
        name: str,
        down: str,
        t: str,
        takes: Iterable[str],
        puts: Iterable[str],
        full: Iterable[str],
        empty: Iterable[str],
    ) -> Iterator[Step]:
        """A step by which the central net fires, or is left behind: one for each place that may be the reason."""
        whole, own = self.cut.net.transition(t), (takes, puts, full, empty)
        moved = (whole.inputs, whole.outputs, whole.permissive, whole.inhibitive)
        both = [[*mine, *map(central, its)] for mine, its in zip(own, moved, strict=True)]
        yield self._step(name, down, "", both[0], both[1], both[2], both[3], t)
        for place in {*whole.inputs, *whole.permissive}:
            empty_there = [*empty, central(place)]
            yield self._step(f"{name}/astray/{place}", down, "", takes, [*puts, ASTRAY], full, empty_there, t)
        for place in {*whole.outputs, *whole.inhibitive}:
            full_there = [*full, central(place)]
            yield self._step(f"{name}/astray/{place}", down, "", takes, [*puts, ASTRAY], full_there, empty, t)

    def _of_faults(self) -> Iterator[Step]:
        yield self._step("cease", None, "", {GO_ON})
        yield self._step("late-copy", None, HOME, {LATE})
        for message in (part.at(kind) for part in self.all_parts for kind in MESSAGES):
            yield self._step(f"lose/{message}", None, "", {message}, (), {GO_ON})
            yield self._step(f"double/{message}", None, "", (), {LATE}, {message, GO_ON}, {LATE})
        for subnet in self.cut.subnets:
            down = f"down/{subnet.name}"
            yield self._step(f"crash/{subnet.name}", None, "", (), {down}, {GO_ON}, {down})
            yield self._step(f"restart/{subnet.name}", None, HOME, {down})
        for down in self.coordinators_down:
            name = "" if down == COORDINATOR_DOWN else f"/{down}"
            yield self._step(f"crash{name}", None, "", (), {down}, {GO_ON}, {down})
            yield self._step(f"restart{name}", None, HOME, {down})

    def way(self, t: str) -> tuple[Step, ...]:
        """The steps by which a transition fires where nothing else is asked."""
        if t not in self.parts:
            return (self.steps[f"fire/{t}"],)
        each = (f"{step}/{t}/{p.controller}" for p in self.parts[t] for step in ("send-request", "promise", "hear"))
        return tuple(self.steps[name] for name in (f"ask/{t}", *each, f"decide/{t}"))


def central(place: str) -> str:
    """The place that holds what the central net has."""
    return f"central/{place}"


def _distinct(items: Iterable[tuple[str, T]], what: str) -> dict[str, T]:
    found: dict[str, T] = {}
    for name, item in items:
        if name in found:
            raise NotShownError(f"two names of the net make one {what} of its protocol, '{name}'", "net")
        found[name] = item
    return found
