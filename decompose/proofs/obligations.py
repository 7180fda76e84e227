"""What has to be proved of a decomposition, each obligation as terms that must not be true together.

Every obligation compares two sides that are made from different data: one from the central net, one from the subnets
and the table. So a subnet that was edited, by hand or by a fault of the split, is refuted, and the assignment that
refutes it speaks of places, signals and transitions of the net.

- Eq. (7), for each transition: firable in the central net iff all its parts are firable in their subnets.
- Eq. (8): its external gates are open iff those of all its parts are.
- Eq. (9)-(10), for each place: whatever may fire together, the owner's subnet gives the place the same token as the
  central net. The transitions that fire are free variables, but for the arbiters' promise that a place has one
  consumer and one producer at most; every arbitrated firing is such a choice, so this is more than the paper asks.
- Arbitration, for each group and turn: whatever is enabled, the group grants what the central arbiter grants, without
  conflict, and leaves out nothing that conflicts with nothing granted.
- Facts: ownership exactly once with the participants of each transition (O3), M0, commands with their completions, and
  that groups are the conflict components, coordinated where a global transition is in them (O2). A fact is a variable
  that one side fixes and the other claims.

Formulas are evaluations of `firable.semantics.firing` in the algebra of terms. A part that is missing is never
firable, and a place that is missing never holds a token: so what was taken out is refuted, too.

These are identities at one instant. That votes taken at different instants do not break them is the business of the
protocol (O1, O5): see `firable.decompose.protocol`.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from firable.analysis.induction.smt import Term, Terms
from firable.decompose.splitting.cut import participants
from firable.nets.decomposition import ArbitrationGroup, Decomposition
from firable.nets.formula import Start
from firable.nets.net import ArbitrationRule, Net, Place, Signal, Transition
from firable.semantics.arbitration import Arbitration, Group
from firable.semantics.conflict import Conflicts, conflicts
from firable.semantics.firing import external_gates, firable, next_token
from firable.semantics.formulas import evaluate

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Obligation:
    """A claim, proved iff what is `asserted`, its negation under its assumptions, cannot be true.

    `sides` are the two terms that the claim compares, where it compares two, with their descriptions: for the message.
    """

    name: str
    statement: str
    subjects: tuple[str, ...]
    claim: Term
    asserted: tuple[Term, ...]
    sides: tuple[tuple[str, Term], ...] = ()


def obligations(decomposition: Decomposition) -> Iterator[Obligation]:
    """Every obligation of a decomposition, in the order of the net."""
    sides = _Sides(decomposition)
    for transition in decomposition.net.transitions:
        yield sides.eq7(transition)
        yield sides.eq8(transition)
    for p in range(len(decomposition.net.places)):
        yield sides.eq9_10(p)
    yield sides.ownership()
    yield sides.initial_marking()
    yield sides.commands()
    yield sides.arbitration()
    for name in dict.fromkeys([*sides.central_groups, *sides.groups]):
        yield sides.arbitration_of(name)


class _Sides:
    """The terms of both sides; the central ones from the net, the others from subnets and table."""

    def __init__(self, decomposition: Decomposition) -> None:
        self.net = decomposition.net
        self.subnets = decomposition.subnets
        self.decomposition = decomposition
        self.terms = Terms()
        self.by_name = {subnet.name: subnet for subnet in decomposition.subnets}
        self.parts: dict[str, tuple[tuple[str, str], ...]] = {
            row.name: tuple((part.controller, part.name) for part in row.parts) for row in decomposition.coordinated
        }
        self.whole = {part: name for name, parts in self.parts.items() for part in parts}
        for transition in self.net.transitions:
            if transition.name not in self.parts:  # local, under its own name, wherever it stands
                self.parts[transition.name] = tuple(
                    (subnet.name, transition.name)
                    for subnet in self.subnets
                    if transition.name in subnet.transition_index
                )
        arbitration = Arbitration.of(self.net)
        self.conflicts = arbitration.conflicts
        self.central_groups = {group.name: group for group in arbitration.groups}
        self.groups = {group.name: group for group in decomposition.groups}

    def obligation(
        self,
        name: str,
        statement: str,
        subjects: tuple[str, ...],
        assumptions: tuple[Term, ...],
        claim: Term,
        sides: tuple[tuple[str, Term], ...] = (),
    ) -> Obligation:
        return Obligation(name, statement, subjects, claim, (*assumptions, self.terms.negation(claim)), sides)

    # --- Eq. (7) to (10)

    def holds(self, net: Net) -> Callable[[int], Term]:
        return lambda p: self.terms.variable(net.places[p].name)

    def signals(self, net: Net) -> Callable[[int], Term]:
        return lambda s: self.terms.variable(net.signals[s].name)

    def of_parts(self, name: str, value: Callable[[Net, int], Term]) -> Term:
        """The AND over the parts of a transition; a part that is not there, or a transition without any, is false."""
        factors = []
        for controller, part in self.parts[name]:
            subnet = self.by_name.get(controller)
            missing = subnet is None or part not in subnet.transition_index
            factors.append(value(subnet, subnet.transition_index[part]) if subnet and not missing else self.terms.false)
        return self.terms.conjunction(factors) if factors else self.terms.false

    def equation(self, name: str, statement: str, subject: str, central: Term, parts: Term) -> Obligation:
        claim = self.terms.equal(central, parts)
        sides = (("in the central net", central), ("in the subnets", parts))
        return self.obligation(name, statement, (subject,), (), claim, sides)

    def eq7(self, transition: Transition) -> Obligation:
        name, t = transition.name, self.net.transition_index[transition.name]
        return self.equation(
            f"eq7.{name}",
            f"'{name}' is firable in the central net iff each of its parts is firable in its subnet",
            name,
            firable(self.terms, self.net, t, self.holds(self.net)),
            self.of_parts(name, lambda subnet, part: firable(self.terms, subnet, part, self.holds(subnet))),
        )

    def eq8(self, transition: Transition) -> Obligation:
        name, t = transition.name, self.net.transition_index[transition.name]
        return self.equation(
            f"eq8.{name}",
            f"the external gates of '{name}' are open iff those of each of its parts are open",
            name,
            external_gates(self.terms, self.net, t, self.signals(self.net)),
            self.of_parts(name, lambda subnet, part: external_gates(self.terms, subnet, part, self.signals(subnet))),
        )

    def fires(self, name: str) -> Term:
        return self.terms.variable(f"fires({name})")

    def eq9_10(self, p: int) -> Obligation:
        place = self.net.places[p]
        together = [
            self.terms.at_most_one(self.fires(self.net.transitions[t].name) for t in adjacent)
            for adjacent in (self.net.consumers[p], self.net.producers[p])
            if len(adjacent) > 1
        ]
        central = next_token(
            self.terms, self.net, p, self.holds(self.net), lambda t: self.fires(self.net.transitions[t].name)
        )
        subnet = self.by_name.get(place.owner or "")
        local = self.terms.false
        if subnet is not None and place.name in subnet.place_index:
            # A part fires when its transition does; what is a part of nothing fires at will.
            def fires_part(t: int) -> Term:
                part = subnet.transitions[t].name
                return self.fires(self.whole.get((subnet.name, part), part))

            local = next_token(self.terms, subnet, subnet.place_index[place.name], self.holds(subnet), fires_part)
        return self.obligation(
            f"eq9-10.{place.name}",
            f"whatever fires, the next token of '{place.name}' is the same in its subnet and in the central net",
            (place.name,),
            tuple(together),
            self.terms.equal(central, local),
            (("next in the central net", central), ("next in the subnet", local)),
        )

    # --- Facts

    def agree(
        self, name: str, statement: str, subjects: Iterable[str], central: Iterable[str], made: Iterable[str]
    ) -> Obligation:
        """The facts that the decomposition states are those of the central net: no fewer and no more."""
        claimed, stated = dict.fromkeys(central), dict.fromkeys(made)
        facts = [*claimed, *(fact for fact in stated if fact not in claimed)]
        assumptions = tuple(self.terms.literal(fact, fact in stated) for fact in facts)
        claim = self.terms.conjunction(self.terms.literal(fact, fact in claimed) for fact in facts)
        return self.obligation(name, statement, tuple(subjects), assumptions, claim)

    def ownership(self) -> Obligation:
        net = self.net
        central = [f"controller {_json([c.name, c.coordinator])}" for c in net.controllers]
        central += [f"{item.owner} owns {item.name}" for item in _owned(net)]
        central += [f"{owner} takes part in {t.name}" for t in net.transitions for owner in participants(net, t)]
        made = [f"controller {_json([c.name, c.coordinator])}" for s in self.subnets for c in s.controllers]
        made += [f"{s.name} owns {item.name}" for s in self.subnets for item in _owned(s)]
        made += [f"twice {name}" for name in _repeated(made)]
        central += [f"{c.name} has one subnet, without arbiters" for c in net.controllers]
        for name, n in Counter(s.name for s in self.subnets).items():
            plain = n == 1 and not self.by_name[name].arbiters
            made += [f"{name} has {'one subnet, without arbiters' if plain else 'other subnets'}"]
        for subnet in self.subnets:
            made += [
                f"{item.owner} owns {item.name} in the subnet of {subnet.name}"
                for item in _owned(subnet)
                if item.owner != subnet.name
            ]
            taking_part = []
            for t in subnet.transitions:
                whole = self.whole.get((subnet.name, t.name), t.name)
                taking_part.append(f"{subnet.name} takes part in {whole}")
            made += taking_part + [f"twice {name}" for name in _repeated(taking_part)]
        # A row that lists a part which its subnet does not have: a vote that never comes.
        made += [
            f"{controller} has no {part}"
            for parts in self.parts.values()
            for controller, part in parts
            if controller not in self.by_name or part not in self.by_name[controller].transition_index
        ]
        every = [part for parts in self.parts.values() for part in parts]
        made += [f"{controller}: {part} is a part twice" for controller, part in _repeated(every)]
        return self.agree(
            "ownership",
            "each place and signal is owned once, by its owner, and each transition has one part at each participant",
            (),
            central,
            made,
        )

    def initial_marking(self) -> Obligation:
        central = evaluate(self.terms, self.net, Start(), self.holds(self.net))
        made = self.terms.conjunction(
            evaluate(self.terms, subnet, Start(), self.holds(subnet)) for subnet in self.subnets
        )
        return self.obligation(
            "initial-marking",
            "the initial markings of the subnets together are that of the central net",
            (),
            (),
            self.terms.equal(central, made),
            (("the central M0", central), ("the subnets' M0", made)),
        )

    def commands(self) -> Obligation:
        def facts(net: Net) -> Iterator[str]:
            for place in net.places:
                if place.command is not None:
                    sent = [place.command.machine, place.command.command, *map(list, place.command.parameters)]
                    yield f"{place.name} sends {_json(sent)}"
                if place.completion is not None:
                    yield f"{place.name} waits until {place.completion}"
            for signal in net.signals:
                yield f"{signal.name} is a {signal.kind.value}"

        made = [fact for subnet in self.subnets for fact in facts(subnet)]
        statement = "the subnets send the same commands on the same places, and wait for the same signals"
        return self.agree("commands", statement, (), facts(self.net), made)

    def arbitration(self) -> Obligation:
        relation, net = self.conflicts, self.net
        central: list[str] = []
        is_global = {t.name: len(participants(net, t)) > 1 for t in net.transitions}
        coordinated = {name for name, it_is in is_global.items() if it_is}
        for group, members in zip(self.central_groups.values(), relation.components, strict=True):
            names = [net.transitions[t].name for t in members]
            owner: str | None = participants(net, net.transitions[members[0]])[0]
            if any(is_global[name] for name in names):
                coordinated.update(names)
                owner = None
            sequence, rest = ([net.transitions[t].name for t in part] for part in (group.sequence, group.rest))
            central += _group_facts(group.name, sequence, rest, group.by, owner)
        central += [f"the coordinator decides {t.name}" for t in net.transitions if t.name in coordinated]
        made: list[str] = []
        for its in self.decomposition.groups:
            made += _group_facts(its.name, its.sequence, its.rest, its.by, its.controller)
        made += [f"the coordinator decides {row.name}" for row in self.decomposition.coordinated]
        made += [f"twice {name}" for name in _repeated(group.name for group in self.decomposition.groups)]
        made += [f"twice {name}" for name in _repeated(row.name for row in self.decomposition.coordinated)]
        return self.agree(
            "arbitration",
            "each conflict component is one group, decided by the coordinator where a global transition is in it",
            (),
            central,
            made,
        )

    # --- Arbitration of one group

    def arbitration_of(self, name: str) -> Obligation:
        net, terms = self.net, self.terms
        central, its = self.central_groups.get(name), self.groups.get(name)
        members = dict.fromkeys(net.transitions[t].name for t in (central.sequence + central.rest if central else ()))
        members.update(dict.fromkeys((*its.sequence, *its.rest) if its else ()))
        enabled = {t: terms.variable(f"enabled({t})") for t in members}
        rivals = {
            t: {net.transitions[u].name for u in self.conflicts.rivals[net.transition_index[t]]}
            for t in members
            if t in net.transition_index
        }
        claims: list[Term] = []
        turns = max(1, len(central.sequence) if central and central.by is not ArbitrationRule.PRIORITY else 1)
        for turn in range(turns):
            wanted = [net.transitions[t].name for t in central.preference(turn)] if central else []
            granted = greedy(terms, enabled, wanted or list(members), rivals)
            given = greedy(terms, enabled, _preference(its, turn) if its else [], self.rivals_in_subnets)
            for t in members:
                claims.append(terms.equal(given.get(t, terms.false), granted.get(t, terms.false)))
                against = [given[u] for u in members if u in rivals.get(t, ()) and u in given]
                claims += [terms.negation(terms.conjunction([given.get(t, terms.false), u])) for u in against]
                claims.append(terms.implies(enabled[t], terms.disjunction([given.get(t, terms.false), *against])))
        statement = f"whatever is enabled, '{name}' grants a maximal set without conflict, as the central arbiter does"
        return self.obligation(f"arbitration.{name}", statement, tuple(members), (), terms.conjunction(claims))

    @cached_property
    def rivals_in_subnets(self) -> Mapping[str, set[str]]:
        """The conflicts that the subnets show: parts of the two share an input or an output place there."""
        found: dict[str, set[str]] = {}
        for subnet in self.subnets:
            relation: Conflicts = conflicts(subnet)
            for t, against in enumerate(relation.rivals):
                whole = [
                    self.whole.get((subnet.name, subnet.transitions[u].name), subnet.transitions[u].name)
                    for u in (t, *against)
                ]
                found.setdefault(whole[0], set()).update(whole[1:])
        return found


def greedy(
    terms: Terms, enabled: Mapping[str, Term], preference: Iterable[str], rivals: Mapping[str, Iterable[str]]
) -> dict[str, Term]:
    """What is granted: in order of preference, each enabled transition that conflicts with none granted before."""
    granted: dict[str, Term] = {}
    for t in preference:
        against = set(rivals.get(t, ()))
        before = terms.disjunction(granted[u] for u in granted if u in against)
        granted[t] = terms.conjunction([enabled[t], terms.negation(before)])
    return granted


def _preference(group: ArbitrationGroup, turn: int) -> list[str]:
    """The members in order of preference, by the one rule of `firable.semantics.arbitration`."""
    names = list(dict.fromkeys((*group.sequence, *group.rest)))
    sequence, rest = (tuple(map(names.index, part)) for part in (group.sequence, group.rest))
    return [names[t] for t in Group(group.name, sequence, rest, group.by).preference(turn)]


def _group_facts(
    name: str, sequence: Iterable[str], rest: Iterable[str], by: ArbitrationRule, controller: str | None
) -> Iterator[str]:
    yield f"{name} decides by {by.value} at {_json(controller)}"
    yield from (f"{name} takes {t} in turn {i}" for i, t in enumerate(sequence))
    yield from (f"{name} takes {t} last, in turn {i}" for i, t in enumerate(rest))


def _owned(net: Net) -> tuple[Place | Signal, ...]:
    return (*net.places, *net.signals)


def _repeated(items: Iterable[Item]) -> list[Item]:
    return [item for item, n in Counter(items).items() if n > 1]


def _json(data: object) -> str:
    return json.dumps(data, ensure_ascii=True)
