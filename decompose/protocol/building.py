"""The protocol of a decomposition as an extended net of its own.

Its places are what the controllers hold, what the coordinator knows, the messages on their way, and a copy of the
central marking that fires whenever something fires: at a decision, and at a local firing. So every question about the
protocol is a question about an ordinary net, and whatever can decide it of a cell can decide it of the cell's protocol:
explicit search, diagrams, invariants, each with its evidence. The rejected alternative, a small-step system
written in Python with its own search, was a second engine to trust; it could hold a hundredth of the markings, and no
evidence of what it found could leave it.

**Who is where.** A decision diagram lives on the order of its places. They stand in the net by transitions: what
belongs to the parts of the first transition, what the coordinator knows of it, then the places that it moves, each
beside its copy in the central net; then the next. For the whole cell this order needs a second, where one controller
after the other needs more than a minute. As the transitions of a group share a round, they may stand together instead:
some cells that the net's own sequence does not do in a minute are done so in seconds. Neither is the better one of all
nets, so `orders` gives both, and the engine lets them race. The rejected alternative, the central net above everything,
is as good on one cell and fails on most.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from firable.decompose.protocol.bare import ORDER, add_bare
from firable.decompose.protocol.draft import ASTRAY, CHANNELS, Draft, Step, at, central, channels_of, down, late
from firable.decompose.protocol.faulty import add_faults, declare_faults, is_numbered
from firable.decompose.protocol.parts import Part, Parts
from firable.decompose.protocol.rounds import add_rounds, asked, committed, copy, decided
from firable.decompose.protocol.variant import NO_FAULTS, PROTOCOL, Faults, Variant, Votes
from firable.decompose.splitting.persistence import nonpersistent
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import And, Formula, Holds, Not, Or
from firable.nets.net import Net, Property, PropertyKind, Transition

_MEMORY = ("noted", "acknowledgement", "abort-order", "commit-order", "heard", "vote", "request", "obeyed", "promised")
"""The places of a part in the skeleton with rounds, in the order that diagrams like."""
_FREE_MEMORY = ("noted", "acknowledgement", "commit-order", "heard", "vote", "obeyed", "stands")
"""Those of one that is free of promise."""
_BARE_MEMORY = ("commit-order", "counted", "promised")


FOLLOWS: Final = "follows"
AGREES: Final = "agrees"
FIT: Final = "orders-fit"


@dataclass(frozen=True)
class ProtocolNet:
    """A protocol as a net, and beside it what step each of its transitions is."""

    parts: Parts
    faults: Faults
    net: Net
    steps: Mapping[str, Step]

    @property
    def variant(self) -> Variant:
        """Which protocol it is."""
        return self.parts.variant

    @cached_property
    def orders(self) -> list[list[int]]:
        """Orders of the places that a diagram may like, each from its lowest level to the highest.

        The first is that of the net. In the second, where it is another one, conflicting transitions stand together.
        """
        parts, index = self.parts, self.net.place_index
        flow = _flow(parts, self.faults, _gathered(parts))
        found = [list(range(len(index))), list(dict.fromkeys((*(index[place] for place in flow), *range(len(index)))))]
        return [order[::-1] for order in (found[:1] if found[0] == found[1] else found)]

    @cached_property
    def firing(self) -> dict[str, tuple[int, ...]]:
        """For each transition of the central net, the transitions by which it fires and the central net follows."""
        found: dict[str, list[int]] = {t.name: [] for t in self.parts.net.transitions}
        for i, transition in enumerate(self.net.transitions):
            if (t := self.steps[transition.name].fires) and ASTRAY not in (*transition.outputs, *transition.permissive):
                found[t].append(i)
        return {t: tuple(indexes) for t, indexes in found.items()}

    @cached_property
    def hidden(self) -> tuple[int, ...]:
        """The transitions by which nothing fires in the central net."""
        return tuple(i for i, t in enumerate(self.net.transitions) if not self.steps[t.name].fires)

    @cached_property
    def at_rest(self) -> Formula:
        """No round is decided and open, and no order is on its way: what the controllers hold is displayed."""
        names = self.net.place_index
        waiting = [decided(self.parts, group[0]) for group in self.parts.groups if self.variant.acknowledged]
        orders = [at(kind, part) for part in self._all for kind in ("commit-order", "abort-order")]
        waiting += [place for order in orders for place in (order, late(order)) if place in names]
        return And(tuple(Not(Holds(place)) for place in waiting))

    @cached_property
    def differs(self) -> Formula:
        """Some controller holds another token than the central net."""
        pairs = ((Holds(place.name), Holds(central(place.name))) for place in self.parts.net.places)
        return Or(tuple(Or((And((a, Not(b))), And((b, Not(a))))) for a, b in pairs))

    @cached_property
    def unfit(self) -> Formula:
        """An order has arrived where the part is promised and cannot be applied."""
        cases: list[Formula] = []
        for part in self._all:
            missing = [Not(Holds(place)) for place in (*part.inputs, *part.permissive)]
            in_the_way: list[Formula] = [Holds(place) for place in (*part.outputs, *part.inhibitive)]
            if part.free:  # its gates may have changed since the decision
                missing = [Not(Holds(at("stands", part))), *(Not(Holds(place)) for place in part.inputs)]
                in_the_way = [Holds(place) for place in part.outputs]
            waits = Not(Holds(at("obeyed", part))) if part.free else Holds(at("promised", part))
            cases.append(And((Holds(at("commit-order", part)), waits, Or((*missing, *in_the_way)))))
        return Or(tuple(cases))

    @cached_property
    def standing(self) -> frozenset[str]:
        """The places that tell of votes which stand, and may stand for ever: those of parts free of promise."""
        free = (part for part in self._all if part.free)
        return frozenset(at(kind, part) for part in free for kind in ("stands", "heard"))

    @cached_property
    def quiet(self) -> Formula:
        """Nothing is asked, promised or on its way, all agree, and every vote that can stand does, and is heard.

        Else the coordinator knows nothing. A part is firable here where it is in the central net.
        """
        own = {place.name for place in self.parts.net.places}
        own |= {central(place) for place in own} | self.standing
        rest = [place.name for place in self.net.places if place.name not in own and not place.marked]
        voted: list[Formula] = []
        for part in (part for part in self._all if part.free):
            full = [Holds(place) for place in (*part.inputs, *part.permissive)]
            firable = And((*full, *(Not(Holds(place)) for place in (*part.outputs, *part.inhibitive))))
            for vote in (Holds(at(kind, part)) for kind in ("stands", "heard")):
                voted.append(Or((And((vote, firable)), And((Not(vote), Not(firable))))))
        return And((*(Not(Holds(place)) for place in rest), Not(self.differs), *voted))

    def sentences(self) -> Iterator[Property]:
        """What must hold of every run for the protocol to refine the central net, as properties of its net."""
        yield Property(FOLLOWS, PropertyKind.NEVER, Holds(ASTRAY))
        yield Property(AGREES, PropertyKind.NEVER, And((self.at_rest, self.differs)))
        if self.variant.is_true and self._all:
            yield Property(FIT, PropertyKind.NEVER, self.unfit)

    @cached_property
    def _all(self) -> tuple[Part, ...]:
        return tuple(part for its in self.parts.coordinated.values() for part in its)


def protocol_net(decomposition: Decomposition, variant: Variant = PROTOCOL, faults: Faults = NO_FAULTS) -> ProtocolNet:
    """The protocol of a decomposition under a variant, exposed to faults, as a net.

    Its size is linear in that of the central net and its parts, where no two parts of one controller disturb each
    other; else each such pair is an inhibitor gate more. What obeys blindly (every variant but the true one) takes two
    to the power of the places of each part. Raises `InputError` F2001 where two names of the net would make one place.

    >>> from firable.decompose.splitting.cut import split
    >>> from firable.nets.catalogue import catalogue_net
    >>> built = protocol_net(split(catalogue_net("one_robot")))
    >>> len(built.net.places), len(built.net.transitions) > 400, str(built.steps["decide/G2"])
    (298, True, 'G2 is decided')
    """
    parts = Parts(decomposition, variant)
    _require_distinct(parts)
    draft = Draft(decomposition.net, onward=not variant.is_true)
    _declare(draft, parts, faults)
    declare_faults(draft, parts, faults, _channels(parts))
    draft.place(ASTRAY)
    if variant.acknowledged:
        add_rounds(draft, parts)
    else:
        stale = nonpersistent(decomposition) if variant.votes is Votes.STALE else ()
        add_bare(draft, parts, stale)
    _local(draft, parts)
    add_faults(draft, parts, faults, lambda part: _channels(parts, part))
    built = ProtocolNet(parts, faults, draft.net(f"protocol-of-{decomposition.net.name}"), draft.steps)
    return replace(built, net=replace(built.net, properties=tuple(built.sentences())))


def _channels(parts: Parts, part: Part | None = None) -> tuple[str, ...]:
    """The kinds of messages that there are, of a part or of any."""
    if not parts.variant.acknowledged:
        return (ORDER,)
    return CHANNELS if part is None else channels_of(part)


def _memory(parts: Parts, part: Part) -> tuple[str, ...]:
    """The places of a part."""
    if not parts.variant.acknowledged:
        return _BARE_MEMORY
    return _FREE_MEMORY if part.free else _MEMORY


def _require_distinct(parts: Parts) -> None:
    """Refuse names that make one place of two, as the transition `a+b` beside `a` and `b`, which compete."""
    own, part_of = [place.name for place in parts.net.places], parts.coordinated.items()
    made = [*own, *map(central, own), ASTRAY, *(down(subnet.name) for subnet in parts.decomposition.subnets)]
    made += [name(t) for t in parts.coordinated for name in (asked, committed)]
    made += [decided(parts, group[0]) for group in parts.groups]
    made += [at(kind, part) for _, its in part_of for part in its for kind in {*_MEMORY, *_FREE_MEMORY}]
    for place, times in Counter(made).items():
        if times > 1:
            message = f"two names of the net make one place of the net of its protocol, '{place}'"
            raise InputError([Diagnostic("F2001", message, "rename one of them; names without `+` never do so")])


def _gathered(parts: Parts) -> Iterator[Transition]:
    """The transitions of the central net, those of a group one after the other."""
    net, found = parts.net, dict[str, None]()
    for t in net.transitions:
        group = set(parts.groups[parts.group_of[t.name]]) if t.name in parts.coordinated else {t.name}
        found |= dict.fromkeys(u.name for u in net.transitions if u.name in group)
    return map(net.transition, found)


def _flow(parts: Parts, faults: Faults, transitions: Iterable[Transition]) -> Iterator[str]:
    """The places that belong to these transitions, by transitions; some of them more than once."""
    acknowledged = parts.variant.acknowledged
    for t in transitions:
        for part in parts.coordinated.get(t.name, ()):
            for kind in _memory(parts, part):
                yield at(kind, part)
                if faults.duplication and kind in _channels(parts, part) and not is_numbered(parts, kind):
                    yield late(at(kind, part))
        if t.name in parts.coordinated and acknowledged:
            if parts.promising(t.name):
                yield asked(t.name)
            yield committed(t.name)
            if parts.groups[parts.group_of[t.name]][-1] == t.name:
                yield decided(parts, t.name)
        for name in (*t.inputs, *t.outputs):
            yield name
            yield central(name)


def _declare(draft: Draft, parts: Parts, faults: Faults) -> None:
    """Add the places, in the order that diagrams like."""
    net = parts.net
    marked = {name for place in net.places if place.marked for name in (place.name, central(place.name))}
    for name in _flow(parts, faults, net.transitions):
        draft.place(name, marked=name in marked)
    for place in net.places:
        draft.place(place.name, marked=place.marked)
        draft.place(central(place.name), marked=place.marked)
    for reader, source in parts.copies:
        draft.place(copy(reader, source), marked=net.place(source).marked)


def _local(draft: Draft, parts: Parts) -> None:
    """Local firings, and copies of gates that are brought up to date."""
    for part in parts.local:
        c = part.controller
        promised = [at("promised", other) for other in parts.excluding(part)]
        draft.fire(
            f"fire/{part.whole}",
            Step("fire", f"{c} fires {part.whole}", c, fires=part.whole),
            part.inputs,
            part.outputs,
            [*part.permissive, *(copy(c, place) for place in part.copied_full)],
            [*part.inhibitive, *(copy(c, place) for place in part.copied_empty), *promised],
        )
    for reader, source in parts.copies:
        told = Step("hear", f"{reader} hears of {source}", reader)
        here = copy(reader, source)
        draft.step(f"copy-full/{reader}/{source}", told, (), [here], [source])
        draft.step(f"copy-empty/{reader}/{source}", told, [here], (), (), [source])
