"""O2: of transitions that compete, one decides; where a global one is among them, that is the coordinator.

The statement is on whole conflict components: every transition, local ones too, in the component of a global one is
decided by the coordinator. Two transitions are in one component iff a chain of shared places leads from one to the
other, so it suffices that *at each shared place* all have one decider, of one place of decision: along the chain both
are handed on. So there is one obligation for each shared place and one for each global transition, and no component is
computed; which makes this another reason than that of the split, which does compute them.

The fault transition of a place with a time limit does not compete there, and may be left to its controller, because no
valuation opens it beside one that does; which is claimed with the rest, over the signals.

The variables: `G decides t`, that the group G of the table lists t; `t has a row`, that the coordinator's table has it;
`G is central`, that the coordinator decides G. What the table says is assumed of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from firable.analysis.induction.smt import Term, Terms
from firable.decompose.proofs.obligation import Obligation, claimed
from firable.decompose.proofs.sides import Sides
from firable.nets.net import Transition


def deciders(sides: Sides) -> Iterator[Obligation]:
    """O2 at each place with several consumers or producers, and for each global transition."""
    net = sides.net
    groups_of: dict[str, list[str]] = {}
    for group in sides.decomposition.groups:
        for name in dict.fromkeys((*group.sequence, *group.rest)):
            groups_of.setdefault(name, []).append(group.name)
    table = _Table({row.name for row in sides.decomposition.coordinated}, groups_of, sides)
    for transition in net.transitions:
        names = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
        owners = {net.place(place).owner for place in names}
        owners |= {net.signal(gate.signal).owner for gate in transition.external}
        if len(owners) > 1:
            yield table.of_global(transition.name)
    for p in range(len(net.places)):
        sharing = [
            [net.transitions[t].name for t in at] for at in (net.competitors[p], net.producers[p]) if len(at) > 1
        ]
        if sharing or p in net.fault_transitions:
            yield table.of_place(p, sharing)


class _Table:
    """What the table says of rows and groups, as terms."""

    def __init__(self, rows: set[str], groups_of: dict[str, list[str]], sides: Sides) -> None:
        self.rows, self.groups_of, self.sides = rows, groups_of, sides

    def row(self, terms: Terms, name: str) -> Term:
        return terms.variable(f"{name} has a row")

    def open(self, terms: Terms, transition: Transition) -> Term:
        return terms.conjunction(terms.literal(gate.signal, gate.wanted) for gate in transition.external)

    def of_global(self, name: str) -> Obligation:
        terms = Terms()
        row = self.row(terms, name)
        stated = row if name in self.rows else terms.negation(row)
        statement = f"'{name}', in which several controllers take part, is decided by the coordinator"
        return claimed(terms, f"o2.{name}", statement, row, subjects=(name,), assumptions=[stated])

    def of_place(self, p: int, sharing: Sequence[Sequence[str]]) -> Obligation:
        terms, net = Terms(), self.sides.net
        place = net.places[p].name
        members = list(dict.fromkeys(name for names in sharing for name in names))
        groups = list(dict.fromkeys(group for name in members for group in self.groups_of.get(name, ())))
        assumptions = [terms.literal(f"{name} has a row", name in self.rows) for name in members]
        assumptions += [
            terms.literal(f"{group} decides {name}", group in self.groups_of.get(name, ()))
            for name in members
            for group in groups
        ]
        assumptions += [
            terms.literal(f"{group} is central", self.sides.groups[group].controller is None) for group in groups
        ]
        claims: list[Term] = []
        for names in sharing:
            first = names[0]
            decides = [terms.variable(f"{group} decides {first}") for group in groups]
            # Some group decides the first, no two do, and it is central iff the first has a row: so is each other's.
            claims += [terms.disjunction(decides), terms.at_most_one(decides)]
            claims += [
                terms.implies(of_group, terms.equal(terms.variable(f"{group} is central"), self.row(terms, first)))
                for group, of_group in zip(groups, decides, strict=True)
            ]
            for one, other in pairwise(names):
                claims.append(terms.equal(self.row(terms, one), self.row(terms, other)))
                claims += [
                    terms.equal(terms.variable(f"{group} decides {one}"), terms.variable(f"{group} decides {other}"))
                    for group in groups
                ]
        statement = f"the transitions that compete for '{place}' have one decider, the coordinator if one has a row"
        if (fault := net.fault_transitions.get(p)) is not None:
            late = self.open(terms, net.transitions[fault])
            claims += [
                terms.negation(terms.conjunction([late, self.open(terms, net.transitions[t])]))
                for t in net.competitors[p]
            ]
            statement += f", and none of them is open beside '{net.transitions[fault].name}'"
        return claimed(
            terms,
            f"o2.{place}",
            statement,
            terms.conjunction(claims),
            subjects=(place, *members),
            assumptions=assumptions,
        )
