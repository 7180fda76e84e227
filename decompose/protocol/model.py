"""The distributed system as a small-step system: votes, promises, orders on their way, locks, rounds, faults.

A configuration holds the markings of all controllers, which part has voted, which votes the coordinator counts, which
orders are on their way, and the marking that the central net has after the same firings. A move is one thing that
happens at one place:

- a controller fires a local transition that is firable in its own subnet;
- a controller votes yes on a part that is firable there; it does not vote on it again before its order has come;
- the coordinator decides a transition whose parts all count as yes, and sends each part its order;
- an order arrives, in any order with others, and its part is applied;
- faults: an order is lost, is delivered and arrives once more later, a controller that voted yes stops for ever.

The firings of a run are, in this order: local transitions when they fire, global ones when they are decided. External
gates are free.

What is left out, because it changes nothing: a vote on its way (it counts late, as if given late), and under rounds
every message of an old round (whoever gets it ignores it). So an abort is one move, the promise withdrawn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple

from firable.decompose.splitting.persistence import nonpersistent
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, Net
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import Player


class Votes(StrEnum):
    """What the coordinator takes for a yes."""

    CACHED = "cached"  # a yes of any part, kept until it is used
    STALE = "stale"  # a yes of a non-persistent part is kept, the others are read when it decides
    FRESH = "fresh"  # all are read when it decides
    PROMISED = "promised"  # a yes is a promise (O1), kept until commit or abort


@dataclass(frozen=True, slots=True)
class Variant:
    """A protocol, and the faults that it is exposed to.

    `recheck`: a part is applied only if it is still firable; else blindly. `gate_copies`: the owner of a gate takes no
    part, its gate is read from a copy that is brought up to date at some time (against O3). `serial`: one order at a
    time. `rounds`: orders carry a round number, so that late duplicates are known (O5).

    >>> Variant.named("locked_dup_noepoch")
    Variant(votes=<Votes.PROMISED: 'promised'>, recheck=False, gate_copies=False, serial=False, rounds=False, \
loss=False, duplication=True, crash=False)
    """

    votes: Votes
    recheck: bool = False
    gate_copies: bool = False
    serial: bool = False
    rounds: bool = False
    loss: bool = False
    duplication: bool = False
    crash: bool = False

    @classmethod
    def named(cls, name: str) -> Variant:
        """The variant of a name such as `locked_crash`: a protocol, then its faults; `ValueError` for another."""
        protocol, faults = name, set[str]()
        while protocol not in PROTOCOLS:
            protocol, _, fault = protocol.rpartition("_")
            if fault not in {"loss", "dup", "noepoch", "crash"} or fault in faults:
                raise ValueError(f"no protocol variant is named '{name}'")
            faults.add(fault)
        base = PROTOCOLS[protocol]
        return cls(
            base.votes,
            base.recheck,
            base.gate_copies,
            base.serial,
            base.rounds and "noepoch" not in faults,
            "loss" in faults,
            "dup" in faults,
            "crash" in faults,
        )


PROTOCOLS: Final = {
    "naive": Variant(Votes.CACHED),
    "recheck": Variant(Votes.CACHED, recheck=True),
    "gates": Variant(Votes.PROMISED, gate_copies=True, rounds=True),
    "fresh": Variant(Votes.FRESH),
    "stale": Variant(Votes.STALE),
    "stale_serial": Variant(Votes.STALE, serial=True),
    "locked": Variant(Votes.PROMISED, rounds=True),
}
"""The protocols by name; only `locked` keeps O1-O3 and O5."""

LEFT: Final = -1
"""In place of the central marking: the central net could not follow."""


class Configuration(NamedTuple):
    """Masks over the places of the net, the parts (voted to duplicates), and the controllers."""

    local: Marking  # what the controllers' places hold
    central: Marking  # what the central net holds after the same firings, or LEFT
    voted: int = 0  # the controller has voted yes and no order has come since
    counted: int = 0  # the coordinator holds the yes and has not used it
    orders: int = 0  # an order is on its way
    duplicates: int = 0  # an order that has arrived is on its way once more
    crashed: int = 0
    copies: int = 0  # by reader: the value of a remote gate source as last heard

    @property
    def quiescent(self) -> bool:
        """No message is on its way: what the controllers hold is displayed."""
        return not self.orders and not self.duplicates


@dataclass(frozen=True, slots=True)
class Event:
    """What happened at one place, in the names of the net."""

    text: str
    subject: str
    controller: str = ""

    def __str__(self) -> str:
        return self.text.format(self.subject, self.controller)


class Move(NamedTuple):
    """An event, the transition that fires by it (-1: none), and the configuration after it."""

    event: Event
    fired: int
    after: Configuration


@dataclass(frozen=True, slots=True)
class _Part:
    """A transition, or the part of one, at one controller; masks are over the places of the central net."""

    whole: int
    controller: int
    name: str
    inputs: int
    outputs: int
    reads: int  # every place that its firability depends on, but for copies
    copies: tuple[tuple[int, bool], ...] = ()  # (bit of the copy, wanted value) of each remote gate

    @property
    def writes(self) -> int:
        return self.inputs | self.outputs


class Model:
    """The moves of one decomposition under one variant."""

    def __init__(self, decomposition: Decomposition, variant: Variant) -> None:
        self.net = decomposition.net
        self.variant = variant
        self.player = Player(self.net)
        self.controllers = [controller.name for controller in self.net.controllers]
        self.copied: list[tuple[int, int]] = []
        """The (reader, place) of each copy."""
        self.local: list[_Part] = []
        self.parts: list[_Part] = []
        self.parts_of: dict[int, int] = {}
        """The mask of the parts of each global transition."""
        self._subnets = [decomposition.subnet(name) for name in self.controllers]
        self._firable: dict[tuple[int, int], bool] = {}
        self._central: dict[tuple[Marking, int], Marking] = {}
        self._events: dict[tuple[str, str, str], Event] = {}
        self._build(decomposition)
        falsifiable = nonpersistent(decomposition) if variant.votes is Votes.STALE else {}
        self.voting = sum(
            1 << i
            for i, part in enumerate(self.parts)
            if variant.votes in {Votes.CACHED, Votes.PROMISED} or part.name in falsifiable
        )
        self.at = [
            sum(1 << i for i, part in enumerate(self.parts) if part.controller == c)
            for c in range(len(self.controllers))
        ]

    def _build(self, decomposition: Decomposition) -> None:
        net, names = self.net, {row.name: row.parts for row in decomposition.coordinated}
        for t, transition in enumerate(net.transitions):
            if not transition.openable:
                continue  # no valuation ever opens it
            if transition.name in names:
                made = [self._part(t, self.controllers.index(p.controller), p.name) for p in names[transition.name]]
            else:
                owner = next(c for c, subnet in enumerate(self._subnets) if transition.name in subnet.transition_index)
                made = [self._part(t, owner, transition.name)]
            if self.variant.gate_copies:
                made = self._with_copies(made)
            if len(made) == 1:
                self.local += made
            else:
                self.parts_of[t] = ((1 << len(made)) - 1) << len(self.parts)
                self.parts += made

    def _part(self, whole: int, controller: int, name: str) -> _Part:
        transition = self._subnets[controller].transition(name)
        inputs, outputs = self.net.marking(transition.inputs), self.net.marking(transition.outputs)
        gates = self.net.marking((*transition.permissive, *transition.inhibitive))
        return _Part(whole, controller, name, inputs, outputs, inputs | outputs | gates)

    def _with_copies(self, parts: list[_Part]) -> list[_Part]:
        """The parts without those that own only gates; the first of the others reads these from copies."""
        kept = [p for p in parts if p.writes or self._subnets[p.controller].transition(p.name).external]
        if not kept or len(kept) == len(parts):
            return parts
        reader, copies = kept[0], []
        for part in parts:
            if part in kept:
                continue
            transition = self._subnets[part.controller].transition(part.name)
            for wanted, sources in ((True, transition.permissive), (False, transition.inhibitive)):
                for place in sources:
                    copy = (reader.controller, self.net.place_index[place])
                    if copy not in self.copied:
                        self.copied.append(copy)
                    copies.append((self.copied.index(copy), wanted))
        first = _Part(
            *(reader.whole, reader.controller, reader.name, reader.inputs, reader.outputs, reader.reads), tuple(copies)
        )
        return [first, *kept[1:]]

    @property
    def initial(self) -> Configuration:
        """M0 everywhere, and nothing said yet; copies are up to date."""
        marking = self.net.initial_marking
        copies = sum(1 << i for i, (_, place) in enumerate(self.copied) if marking >> place & 1)
        return Configuration(marking, marking, copies=copies)

    def is_firable(self, part: _Part, configuration: Configuration) -> bool:
        """Eq. (1) of the part in the subnet of its controller, and the copies that it reads."""
        if any(bool(configuration.copies >> bit & 1) != wanted for bit, wanted in part.copies):
            return False
        key = (id(part), configuration.local & part.reads)
        if key not in self._firable:
            subnet: Net = self._subnets[part.controller]
            index = self.net.place_index
            self._firable[key] = firable(
                BOOL,
                subnet,
                subnet.transition_index[part.name],
                lambda p: bool(configuration.local >> index[subnet.places[p].name] & 1),
            )
        return self._firable[key]

    def follow(self, central: Marking, t: int) -> Marking:
        """The central marking after `t`, or LEFT where the central net cannot fire it."""
        key = (central, t)
        if key not in self._central:
            follows = central != LEFT and t in self.player.may_fire(central)
            self._central[key] = self.player.fire(central, [t]) if follows else LEFT
        return self._central[key]

    def moves(self, now: Configuration) -> Iterator[Move]:
        """Everything that can happen next."""
        written, read = self._locks(now)

        def excluded(part: _Part) -> bool:
            return bool(part.writes & (read | written) or part.reads & written)

        yield from self._local_firings(now, excluded)
        for i, part in enumerate(self.parts):
            bit = 1 << i
            if now.crashed >> part.controller & 1:
                if self.variant.loss and now.orders & bit:
                    yield self._lost(now, part, bit)
                continue
            if self.voting & bit and not now.voted & bit and self.is_firable(part, now) and not excluded(part):
                after = now._replace(voted=now.voted | bit, counted=now.counted | bit)
                yield Move(self._event("{1} votes yes on {0}", part), -1, after)
            if self.variant.votes is Votes.PROMISED and now.counted & now.voted & bit:
                after = now._replace(voted=now.voted & ~bit, counted=now.counted & ~bit)
                yield Move(self._event("{0} is aborted at {1}", part), -1, after)
            if now.orders & bit:
                if self.variant.loss:
                    yield self._lost(now, part, bit)
                after = self._ordered(now, part, bit)._replace(orders=now.orders & ~bit)
                yield Move(self._event("the order for {0} arrives at {1}", part), -1, after)
                if self.variant.duplication and not now.duplicates & bit:
                    after = after._replace(duplicates=now.duplicates | bit)
                    yield Move(self._event("the order for {0} arrives at {1}, and a copy is late", part), -1, after)
            if now.duplicates & bit:
                after = now if self.variant.rounds else self._ordered(now, part, bit)
                after = after._replace(duplicates=now.duplicates & ~bit)
                yield Move(self._event("the late copy of the order for {0} arrives at {1}", part), -1, after)
        yield from self._decisions(now)
        yield from self._crashes_and_copies(now)

    def _locks(self, now: Configuration) -> tuple[int, int]:
        """The places that promised parts will write, and those that they have read."""
        written = read = 0
        if self.variant.votes is Votes.PROMISED and now.voted:
            for i, part in enumerate(self.parts):
                if now.voted >> i & 1:
                    written |= part.writes
                    read |= part.reads
        return written, read

    def _local_firings(self, now: Configuration, excluded: Callable[[_Part], bool]) -> Iterator[Move]:
        for part in self.local:
            if now.crashed >> part.controller & 1 or excluded(part) or not self.is_firable(part, now):
                continue
            after = now._replace(
                local=now.local & ~part.inputs | part.outputs, central=self.follow(now.central, part.whole)
            )
            yield Move(self._event("{1} fires {0}", part), part.whole, after)

    def _decisions(self, now: Configuration) -> Iterator[Move]:
        if self.variant.serial and now.orders:
            return
        for t, mask in self.parts_of.items():
            missing = mask & ~now.counted
            if all(
                not (self.voting | now.voted) & bit
                and not now.crashed >> part.controller & 1
                and self.is_firable(part, now)
                for part, bit in self._among(missing)
            ):
                after = now._replace(
                    central=self.follow(now.central, t),
                    voted=now.voted | mask,
                    counted=now.counted & ~mask,
                    orders=now.orders | mask,
                )
                name = self.net.transitions[t].name
                yield Move(self._known("{0} is decided", name, ""), t, after)

    def _among(self, mask: int) -> Iterator[tuple[_Part, int]]:
        while mask:
            bit = mask & -mask
            yield self.parts[bit.bit_length() - 1], bit
            mask ^= bit

    def _crashes_and_copies(self, now: Configuration) -> Iterator[Move]:
        if self.variant.crash:
            for c, name in enumerate(self.controllers):
                if now.voted & self.at[c] and not now.crashed >> c & 1:
                    yield Move(
                        self._known("{1} stops for ever", "", name), -1, now._replace(crashed=now.crashed | 1 << c)
                    )
        for i, (reader, place) in enumerate(self.copied):
            if (now.copies >> i ^ now.local >> place) & 1:
                event = self._known("{1} hears of {0}", self.net.places[place].name, self.controllers[reader])
                yield Move(event, -1, now._replace(copies=now.copies ^ 1 << i))

    def _ordered(self, now: Configuration, part: _Part, bit: int) -> Configuration:
        """The part obeys an order: under promises only one that it waits for."""
        if self.variant.votes is Votes.PROMISED and not now.voted & bit:
            return now
        local = now.local
        if not self.variant.recheck or self.is_firable(part, now):
            local = local & ~part.inputs | part.outputs
        return now._replace(local=local, voted=now.voted & ~bit)

    def _lost(self, now: Configuration, part: _Part, bit: int) -> Move:
        event = self._event("the order for {0} to {1} is lost", part)
        return Move(event, -1, now._replace(orders=now.orders & ~bit))

    def _event(self, text: str, part: _Part) -> Event:
        return self._known(text, self.net.transitions[part.whole].name, self.controllers[part.controller])

    def _known(self, text: str, subject: str, controller: str) -> Event:
        key = (text, subject, controller)
        return self._events.setdefault(key, Event(*key))
