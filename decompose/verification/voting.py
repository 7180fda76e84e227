"""The net of the voting protocol made anew, from the cut of the central net and a table of steps.

The second text of `firable.decompose.protocol.building`, which it checks, for the true protocol alone: without
faults, and under any number of them. The table below is the protocol as docs/protocol.md tells it, a row for each step;
what stands in it is a place of the part (`request` is `request/G2/robot`), of its transition (`asked`, `committed`) or
of its group (`decided`), or a set of places in capitals. Who acts is the controller, or the coordinator that decides
the transition; where several decide something, each may crash by itself, and `coordinator-down` bears its name.

    INPUTS, OUTPUTS     what the part takes and puts, in the subnet of its controller
    FULL, EMPTY         what Eq. (1) demands of its places
    OTHERS              the promises, of parts of other groups, that it would disturb (O1)
    ALL-OTHERS          these, of parts of its own group, too

A part that is free of promise has a table of its own: it `stands` where another one would be promised. Where every part
of a transition is free, nobody is asked, and the transition has no place `asked`.

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
MESSAGES_OF_FREE: Final = ("vote", "commit-order", "acknowledgement")
MEMORY: Final = ("promised", "obeyed", "heard", "noted")
MEMORY_OF_FREE: Final = ("stands", "obeyed", "heard", "noted")

HOME, REPEATS = "h", "r"

T = TypeVar("T")


def _rows(text: str) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(word.strip() for word in row.split("|")) for row in text.strip().splitlines())


_OF_PART: Final = _rows("""
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
""")
"""Name, who acts, whether it leads home or repeats, what it takes, puts, and needs full and empty."""


_OF_FREE_PART: Final = _rows("""
        stand/*              | controller  |    |       | stands vote  | FULL          | EMPTY ALL-OTHERS stands vote
        stand/*/again        | controller  | r  |         | vote         | stands        | vote
        hear/*               | coordinator | h  | vote    | heard        |               | heard committed
        hear/*/again         | coordinator | h  | vote    |              | heard         |
        ignore-vote/*        | coordinator | h  | vote    |              | committed     |
        order-commit/*       | coordinator | hr |         | commit-order | committed     | commit-order noted
        apply/*              | controller  | h  | commit-order stands INPUTS | acknowledgement obeyed OUTPUTS | | obeyed
        acknowledge-commit/* | controller  | h  | commit-order | acknowledgement | obeyed | acknowledgement
        note/*               | coordinator | h  | acknowledgement | noted | | noted
        note/*/again         | coordinator | h  | acknowledgement | | noted |
""")
"""The same of a part that is free of promise."""


@dataclass(frozen=True, slots=True)
class Part:
    """What one controller has of a transition that the coordinator decides, or a local transition."""

    whole: str
    controller: str
    own: Transition
    free: bool = False

    @property
    def messages(self) -> tuple[str, ...]:
        """The messages about it."""
        return MESSAGES_OF_FREE if self.free else MESSAGES

    @property
    def memory(self) -> tuple[str, ...]:
        """What is remembered of it."""
        return MEMORY_OF_FREE if self.free else MEMORY

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
    """The protocol of a net that was cut, without faults or under all; `free` are the parts free of promise."""

    cut: Cut
    faults: bool
    free: frozenset[tuple[str, str]] = frozenset()

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
            free = (name, part.controller) in self.free
            yield Part(name, part.controller, self._subnets[part.controller][part.name], free)

    @cached_property
    def _subnets(self) -> dict[str, dict[str, Transition]]:
        return {subnet.name: {t.name: t for t in subnet.transitions} for subnet in self.cut.subnets}

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """What is decided together: one commit in each round, whoever has several turns."""
        central = (group for group in self.cut.groups if group.controller is None)
        together = [tuple(dict.fromkeys(t for t in (*g.sequence, *g.rest) if t in self.parts)) for g in central]
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

    def asks(self, t: str) -> bool:
        """Whether anybody is asked for a promise."""
        return not all(part.free for part in self.parts[t])

    def others(self, part: Part, *, every: bool = False) -> Iterator[str]:
        """The promises that keep a part from being promised, or a local transition from firing (O1).

        With `every` those of its own group are among them.
        """
        mine = (part.whole,) if every else self.group_of.get(part.whole, ())
        for other in self._at.get(part.controller, ()):
            if other.free:
                continue
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
        some += [(f"asked/{t}", False) for t in self.parts if self.asks(t)]
        some += [(f"committed/{t}", False) for t in self.parts]
        some += [(part.at(kind), False) for part in self.all_parts for kind in (*part.messages, *part.memory)]
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
                yield self._step(f"close-round/{number}", its, HOME, {over}, (), (), set(map(self.opened, group)))
        for part in self.all_parts:
            for row in _OF_FREE_PART if part.free else _OF_PART:
                yield self._of_part(part, *row)
        for part in self.local:
            own = part.own
            places = (own.inputs, own.outputs, own.permissive, (*own.inhibitive, *self.others(part)))
            yield from self._firing(f"fire/{part.whole}", f"down/{part.controller}", part.whole, *places)
        if self.faults:
            yield from self._of_faults()

    def opened(self, t: str) -> str:
        """The place by which the round of a transition is open."""
        return f"asked/{t}" if self.asks(t) else f"committed/{t}"

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
        asks = {asked} if self.asks(t) else set[str]()
        if asks:
            yield self._step(f"ask/{t}", down, "", (), {asked}, (), {asked, over})
            yield self._step(f"give-up/{t}", down, HOME + REPEATS, (), {over}, {asked}, {over})
        heard = [part.at("heard") for part in its]
        yield from self._firing(f"decide/{t}", down, t, heard, (committed, over), asks, (over,))
        ends, full = ({over}, set[str]()) if alone else (set[str](), {over})

        def closing(name: str, some: Iterable[Part], taken: set[str], empty: set[str]) -> Step:
            of = tuple(some)
            takes = asks | ends | taken | {part.at(kind) for part in of for kind in ("noted", "obeyed")}
            on_their_way = {part.at(kind) for part in of for kind in part.messages}
            return self._step(name, down, HOME, takes, (), full, on_their_way | empty)

        yield closing(f"close/{t}", its, {committed}, set())
        if asks:
            yield closing(f"close/{t}/aborted", (part for part in its if not part.free), set(), {committed})

    def _of_part(self, part: Part, name: str, who: str, kind: str, *columns: str) -> Step:
        own = part.own
        sets = {
            "INPUTS": own.inputs,
            "OUTPUTS": own.outputs,
            "FULL": (*own.inputs, *own.permissive),
            "EMPTY": (*own.outputs, *own.inhibitive),
            "OTHERS": tuple(self.others(part)),
            "ALL-OTHERS": tuple(self.others(part, every=True)),
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
        for message in (part.at(kind) for part in self.all_parts for kind in part.messages):
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

    def way(self, t: str) -> tuple[tuple[Step, bool], ...]:
        """The steps by which a transition fires where nothing else is asked, and whether each has to be taken.

        A vote that promises nothing may stand already, and have been heard.
        """
        if t not in self.parts:
            return ((self.steps[f"fire/{t}"], True),)
        found = [(f"ask/{t}", True)] if self.asks(t) else []
        for part in self.parts[t]:
            named = f"{t}/{part.controller}"
            if part.free:
                found += [(f"stand/{named}", False), (f"stand/{named}/again", False), (f"hear/{named}", False)]
            else:
                found += [(f"{step}/{named}", True) for step in ("send-request", "promise", "hear")]
        return tuple((self.steps[name], must) for name, must in (*found, (f"decide/{t}", True)))


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
