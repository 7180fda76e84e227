"""What must be proved of a decomposition, stated anew from the net, the subnets and the table.

The form of each sentence and of each formula is that of docs/bundle.md, which is all that this shares with the prover:
neither the firing rule of `firable.semantics` nor its conflicts are used. Here Eq. (1) is written out as SEMANTICS
has it, and a part is the transition of a subnet that the table names.

The decomposition has been cut anew before (`recut`), so every part is where it should be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from firable.decompose.verification.formulas import AtMostOne, Formula, Formulas
from firable.decompose.verification.recut import Cut
from firable.nets.decomposition import Decomposition
from firable.nets.net import Net, Place, Transition
from firable.nets.verdict import Weight

HEADS: Final = {
    "eq7": "a transition is firable iff all its parts are",
    "eq8": "its external gates are open iff those of all its parts are",
    "eq9-10": "the next token of a place is the same in its subnet",
    "o2": "transitions that compete have one decider",
    "o3": "what a transition touches is touched by its owner's part alone",
    "ownership": "each place and signal is owned once, by its owner",
    "initial-marking": "the initial markings of the subnets together are M0",
    "commands": "the subnets send the commands of the net, on the same places",
    "o8": "votes add up layer by layer, and competitors meet in one coordinator",
    "o8-apart": "no coordinator's promise stands in the way of another coordinator",
    "arbitration": "conflicts are decided as in the central net",
    "persistence": "a yes once given stays until its transition fires",
}
"""What stands at the head of the file of each family."""


@dataclass(frozen=True, slots=True)
class Stated:
    """An obligation: its name, its sentence, what it is about, what must have no model, and what its verdict weighs.

    `rests_on` are those before it in its family of which the claims are given.
    """

    name: str
    sentence: str
    subjects: tuple[str, ...]
    asserted: tuple[Formula, ...]
    weight: Weight = Weight.REQUIRED
    discipline: str = ""
    rests_on: tuple[str, ...] = ()


class Restated:
    """The obligations of one decomposition; `units` are those that its bundle lists (`restating_votes`)."""

    def __init__(
        self, decomposition: Decomposition, cut: Cut, formulas: Formulas, units: Sequence[tuple[str, ...]] = ()
    ) -> None:
        self.units = units
        self.decomposition, self.net, self.cut, self.of = decomposition, decomposition.net, cut, formulas
        self.subnet = {subnet.name: subnet for subnet in decomposition.subnets}
        self.listed = {row.name: row.parts for row in decomposition.coordinated}
        self.whole = {(p.controller, p.name): row.name for row in decomposition.coordinated for p in row.parts}

    def family(self, name: str) -> Iterator[Stated]:
        """The obligations of a family, in order."""
        from firable.decompose.verification import restating_choice, restating_facts, restating_layers, restating_votes

        match name:
            case "eq7":
                return (self.eq7(t) for t in self.net.transitions)
            case "eq8":
                return (self.eq8(t) for t in self.net.transitions)
            case "eq9-10":
                return (self.eq9_10(p) for p in self.net.places)
            case "initial-marking":
                return iter([self.initial_marking()])
            case "o8":
                return restating_layers.layers(self)
            case "o8-apart":
                return restating_layers.apart(self)
            case "arbitration":
                return restating_choice.arbitration(self)
            case "persistence":
                return restating_votes.persistence(self)
        return restating_facts.FAMILIES[name](self)

    # --- What the families share

    def claim(
        self, name: str, sentence: str, claim: Formula, subjects: Iterable[str] = (), given: Iterable[Formula] = ()
    ) -> Stated:
        """The obligation that a claim follows from what is given."""
        return Stated(name, sentence, tuple(subjects), (*given, self.of.negation(claim)))

    def parts(self, t: Transition) -> list[Transition]:
        """The parts of a transition, as the subnets have them."""
        return [self.subnet[controller].transition(name) for controller, name in self.keys(t)]

    def keys(self, t: Transition) -> list[tuple[str, str]]:
        """The controller and the name of each part; a transition without a row stands under its own name."""
        if t.name in self.listed:
            return [(part.controller, part.name) for part in self.listed[t.name]]
        (owner,) = self.cut.participants[t.name]
        return [(owner, t.name)]

    def whole_of(self, controller: str, name: str) -> str:
        """The transition of the central net that a transition of a subnet is a part of, or is itself."""
        return self.whole.get((controller, name), name)

    def every(self, names: Iterable[str], *, full: bool) -> list[Formula]:
        """That each of the places holds a token, or that none does."""
        return [self.of.literal(name, full) for name in names]

    def at_most_one(self, operands: Iterable[Formula]) -> Formula:
        """At most one of some formulas."""
        return AtMostOne(self.of, operands).formula()

    # --- Eq. (7) to (10)

    def firable(self, t: Transition) -> Formula:
        """Eq. (1)."""
        ready = [
            *self.every(t.inputs, full=True),
            *self.every(t.permissive, full=True),
            *self.every(t.inhibitive, full=False),
        ]
        return self.of.all_of([self.of.all_of(ready), self.of.all_of(self.every(t.outputs, full=False))])

    def open(self, t: Transition) -> Formula:
        """Eq. (2)."""
        return self.of.all_of(self.of.literal(gate.signal, gate.wanted) for gate in t.external)

    def eq7(self, t: Transition) -> Stated:
        """Firable in the whole iff firable in all parts."""
        sentence = f"'{t.name}' is firable in the central net iff each of its parts is firable in its subnet"
        distributed = self.of.all_of(map(self.firable, self.parts(t)))
        return self.claim(f"eq7.{t.name}", sentence, self.of.equal(self.firable(t), distributed), [t.name])

    def eq8(self, t: Transition) -> Stated:
        """Open in the whole iff open in all parts."""
        sentence = f"the external gates of '{t.name}' are open iff those of each of its parts are open"
        distributed = self.of.all_of(map(self.open, self.parts(t)))
        return self.claim(f"eq8.{t.name}", sentence, self.of.equal(self.open(t), distributed), [t.name])

    def eq9_10(self, p: Place) -> Stated:
        """The next token of a place, whatever fires that consumes and produces each place once at most."""
        subnet = self.subnet[self.cut.owner[p.name]]
        central = self.next_token(p.name, self.at(self.net, p.name), lambda name: name)
        local = self.next_token(p.name, self.at(subnet, p.name), lambda name: self.whole_of(subnet.name, name))
        given = [self.at_most_one(map(self.fires, names)) for names in self.at(self.net, p.name) if len(names) > 1]
        sentence = f"whatever fires, the next token of '{p.name}' is the same in its subnet and in the central net"
        return self.claim(f"eq9-10.{p.name}", sentence, self.of.equal(central, local), [p.name], given)

    def fires(self, name: str) -> Formula:
        """That a transition of the central net fires."""
        return self.of.variable(f"fires({name})")

    def at(self, net: Net, place: str) -> tuple[Sequence[str], Sequence[str]]:
        """The names of the consumers and of the producers of a place."""
        p = net.place_index[place]
        consumers, producers = ([net.transitions[t].name for t in table[p]] for table in (net.consumers, net.producers))
        return consumers, producers

    def next_token(self, place: str, at: tuple[Sequence[str], Sequence[str]], whole: Callable[[str], str]) -> Formula:
        """Eq. (3)-(4): it holds a token and no consumer fires, or a producer fires."""
        taken, put = (self.of.any_of(self.fires(whole(name)) for name in names) for names in at)
        stays = self.of.all_of([self.of.variable(place), self.of.negation(taken)])
        return self.of.any_of([stays, put])

    def initial_marking(self) -> Stated:
        """M0."""

        def start(net: Net) -> Formula:
            marked = self.every((p.name for p in net.places if p.marked), full=True)
            return self.of.all_of([*marked, *self.every((p.name for p in net.places if not p.marked), full=False)])

        together = self.of.all_of(map(start, self.decomposition.subnets))
        sentence = "the initial markings of the subnets together are that of the central net"
        return self.claim("initial-marking", sentence, self.of.equal(start(self.net), together))
