"""Arbitration: the groups of the table are the conflict components, each decided as in the central net.

Which transitions a group decides, in which order, by which rule and where are facts. What they amount to is the
equivalence of the arbiters: for every set of firable transitions, coordinator and local arbiters together choose
what the central arbiter chooses. The choice of the whole is the union of the choices of the groups, since a transition
that shares a place stands in one group only (the facts, and O2), and whatever shares none is granted by both sides when
it is enabled. So one obligation for each group is the whole statement, over every set of enabled members:

- the group grants what the central arbiter grants, in every turn;
- what wins an input conflict is the same, whatever is enabled, and so is what loses it: of two enabled alone, one wins
  where they share an input. That turns a rotation, so the turns stay the same for ever;
- what is granted consumes and produces each place at most once, and leaves out nothing that could be added.

The turn is a variable, not a case: the sequence is written twice in a row, and a preference begins where the first
variable `turn(i)` is true, or with the second writing. What was refused at its first writing finds the same places
taken at its second, so the order is that of every turn, at a size that is linear in the arcs of the group. The
alternative, a copy of the choice for each turn and a rival for each pair, is cubic: minutes for a robot with a thousand
jobs. The central side is told by the places of the net, the other one by those of the subnets.

Whatever grows with the competitors of a place is a variable, `step(i)`, which is assumed to be the OR that it names:
that a place has been taken is the one before it or what is granted now, and that somebody loses at a place is said
once. Written out, these ORs are flattened by solvers, over and over. The same OR is the same step on both sides. And
what is claimed of a choice is claimed where it is made, as an equation whose sides are one term if all is well: at
each writing, that no place of it is taken adds nothing to what grants it, so that of all grants at a place one at most
is true; at the last writing of each, that it is enabled and no place of it is taken adds nothing to its being granted.
So a solver has nothing to search for. The alternative, "of any two that compete one at most is granted, and of any
that is enabled some competitor", is the same sentence, and a search through all that stands before: for 300 that take
turns z3 took a second and cvc5 twelve, and for 1,000 cvc5 gave up, where either now takes less than one.

Assumed is that an arbiter sees its members at one instant: that is what promises are for (O1, the protocol).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from firable.analysis.induction.smt import Operator, Term, Terms
from firable.decompose.proofs.obligation import Obligation, claimed, facts
from firable.decompose.proofs.sides import Sides
from firable.decompose.splitting.cut import participants
from firable.nets.layers import Layers
from firable.nets.net import ArbitrationRule, Net


def arbitration(sides: Sides) -> Iterator[Obligation]:
    """The facts on all groups, and the equivalence of the arbiters of each."""
    yield _groups(sides)
    central = Competition.of([(sides.net, lambda t: sides.net.transitions[t].name)])
    subnets = Competition.of((subnet, partial(sides.whole_of, subnet)) for subnet in sides.subnets)
    for name in sides.central_groups:  # that there are no others is one of the facts
        yield _equivalence(sides, name, central, subnets)


# --------------------------------------------------------------------------------------------------------------------
# Facts


def _groups(sides: Sides) -> Obligation:
    net, relation = sides.net, sides.arbitration.conflicts
    central: list[str] = []
    coordinated = {t.name for t in net.transitions if len(participants(net, t)) > 1}
    for group, members in zip(sides.central_groups.values(), relation.components, strict=True):
        names = [net.transitions[t].name for t in members]
        owner: str | None = None
        if coordinated.isdisjoint(names):
            owner = next(iter(participants(net, net.transitions[members[0]])), None)
        else:
            coordinated.update(names)
        sequence, rest = ([net.transitions[t].name for t in part] for part in (group.sequence, group.rest))
        central += _group_facts(group.name, sequence, rest, group.by, owner)
    central += [f"the coordinator decides {t.name}" for t in net.transitions if t.name in coordinated]
    made: list[str] = []
    for its in sides.decomposition.groups:
        made += _group_facts(its.name, its.sequence, its.rest, its.by, its.controller)
    made += [f"the coordinator decides {row.name}" for row in sides.decomposition.coordinated]
    if not (tree := Layers(net)).several:  # there is the one; of several, O8 says which
        named = [(row.at, row.name) for row in sides.decomposition.coordinated]
        named += [(group.at, group.name) for group in sides.decomposition.groups]
        made += [f"'{at}' decides {name}" for at, name in named if at not in {None, tree.root}]
    statement = "each conflict component is one group, decided by the coordinator where a global transition is in it"
    return facts("arbitration", statement, central, made)


def _group_facts(
    name: str, sequence: Iterable[str], rest: Iterable[str], by: ArbitrationRule, controller: str | None
) -> Iterator[str]:
    yield f"{name} decides by {by.value} at {json.dumps(controller, ensure_ascii=True)}"
    yield from (f"{name} takes {t} in turn {i}" for i, t in enumerate(sequence))
    yield from (f"{name} takes {t} last, in turn {i}" for i, t in enumerate(rest))


# --------------------------------------------------------------------------------------------------------------------
# The choice of one group


@dataclass(frozen=True)
class Competition:
    """Who competes for what: for each transition its shared places, those of its inputs apart, and who is at each."""

    inputs: Mapping[str, Sequence[Hashable]]
    places: Mapping[str, Sequence[Hashable]]
    at: Mapping[Hashable, Sequence[str]]

    @classmethod
    def of(cls, nets: Iterable[tuple[Net, Callable[[int], str]]]) -> Competition:
        """The competition in these nets, each with the name in the central net of a transition by its index."""
        inputs: dict[str, list[Hashable]] = {}
        places: dict[str, list[Hashable]] = {}
        at: dict[Hashable, list[str]] = {}
        name_of: dict[Hashable, tuple[str, str]] = {}
        for n, (net, whole) in enumerate(nets):
            for kind, table in (("from", net.competitors), ("to", net.producers)):
                for p, adjacent in enumerate(table):
                    if len(adjacent) < 2:
                        continue
                    key = (n, kind, p)
                    name_of[key] = (kind, net.places[p].name)
                    at[key] = [whole(t) for t in adjacent]
                    for name in at[key]:
                        places.setdefault(name, []).append(key)
                        if kind == "from":
                            inputs.setdefault(name, []).append(key)
        for keys in (*inputs.values(), *places.values()):
            keys.sort(key=name_of.__getitem__)
        return cls(inputs, places, at)


@dataclass(frozen=True)
class Choice:
    """What one side grants, and what wins an input conflict in it, each as a term over `enabled` and `turn`.

    `writings` has, in order of preference, each transition with the conditions of its being granted there and then.
    """

    granted: Mapping[str, Term]
    winning: Mapping[str, Term]
    writings: Sequence[tuple[str, Sequence[Term]]] = ()


class Steps:
    """A variable for each OR that grows with the competitors, so that each is a short text wherever it is used.

    The same OR has the same variable, whoever makes it: two sides that choose alike share all of them.
    """

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._named: dict[Term, Term] = {}

    def any_of(self, operands: Iterable[Term]) -> Term:
        """The variable of the OR, also of one operand; what is true, false or a variable already needs none."""
        made = self._terms.disjunction(operands)
        if made.operator in _NAMED_ALREADY:
            return made
        return self._named.setdefault(made, self._terms.variable(f"step({len(self._named)})"))

    def definitions(self) -> tuple[Term, ...]:
        """What each variable is, in the order in which they were made."""
        return tuple(self._terms.equal(variable, made) for made, variable in self._named.items())


_NAMED_ALREADY: Final = frozenset((Operator.TRUE, Operator.FALSE, Operator.VARIABLE))


def choice(
    terms: Terms,
    steps: Steps,
    sequence: Sequence[str],
    rest: Sequence[str],
    competition: Competition,
    *,
    turns: bool,
) -> Choice:
    """The choice of a group: in order of preference each enabled transition whose shared places nobody has taken."""
    taken: dict[Hashable, Term] = {}
    grants: dict[str, list[Term]] = {}
    begun = terms.false
    considered: list[tuple[str, Term]] = []
    writings: list[tuple[str, Sequence[Term]]] = []
    if turns:
        for i, t in enumerate(sequence):
            begun = steps.any_of([begun, terms.variable(f"turn({i})")])
            considered.append((t, begun))
    considered += [(t, terms.true) for t in (*sequence, *rest)]
    for t, its_turn in considered:
        free = (terms.negation(taken.get(place, terms.false)) for place in competition.places.get(t, ()))
        conditions = (terms.variable(f"enabled({t})"), its_turn, *free)
        now = terms.conjunction(conditions)
        writings.append((t, conditions))
        grants.setdefault(t, []).append(now)
        for place in competition.places.get(t, ()):
            taken[place] = steps.any_of([taken.get(place, terms.false), now])
    granted = {t: terms.disjunction(nows) for t, nows in grants.items()}
    losing: dict[Hashable, Term] = {}
    for place in dict.fromkeys(place for t in granted for place in competition.inputs.get(t, ())):
        at = [t for t in competition.at[place] if t in granted]
        losing[place] = steps.any_of(
            terms.conjunction([terms.variable(f"enabled({t})"), terms.negation(granted[t])]) for t in at
        )
    winning = {
        t: terms.conjunction([its, terms.disjunction(losing[place] for place in competition.inputs.get(t, ()))])
        for t, its in granted.items()
    }
    return Choice(granted, winning, writings)


def _equivalence(sides: Sides, name: str, competition: Competition, in_subnets: Competition) -> Obligation:
    net, terms = sides.net, Terms()
    steps = Steps(terms)
    central, its = sides.central_groups[name], sides.groups.get(name)
    sequence, rest = ([net.transitions[t].name for t in part] for part in (central.sequence, central.rest))
    wanted = choice(terms, steps, sequence, rest, competition, turns=_turns(central.by))
    given = Choice({}, {})
    if its is not None:
        given = choice(terms, steps, its.sequence, its.rest, in_subnets, turns=_turns(its.by))
    members = list(dict.fromkeys((*wanted.granted, *given.granted)))
    grants = {t: given.granted.get(t, terms.false) for t in members}
    claims: list[Term] = []
    for t in members:
        claims.append(terms.equal(grants[t], wanted.granted.get(t, terms.false)))
        claims.append(terms.equal(given.winning.get(t, terms.false), wanted.winning.get(t, terms.false)))
    claims += maximal_without_conflict(terms, steps, given, members, competition)
    statement = f"whatever is enabled, '{name}' grants a maximal set without conflict, as the central arbiter does"
    return claimed(
        terms,
        f"arbitration.{name}",
        statement,
        terms.conjunction(claims),
        subjects=tuple(members),
        definitions=steps.definitions(),
    )


def maximal_without_conflict(
    terms: Terms, steps: Steps, given: Choice, members: Iterable[str], competition: Competition
) -> Iterator[Term]:
    """What makes a choice one of the members that is maximal and takes each place of this competition once at most.

    Of each writing: that no place of it is taken adds nothing to its conditions. Of each member: that it is enabled and
    no place of it was taken at its last writing adds nothing to its being granted.
    """
    taken: dict[Hashable, Term] = {}
    granting: dict[str, list[Term]] = {}
    enabled = {t: terms.variable(f"enabled({t})") for t in members}
    deserving = dict(enabled)
    for t, conditions in given.writings:
        now, places = terms.conjunction(conditions), competition.places.get(t, ())
        free = [terms.negation(taken.get(place, terms.false)) for place in places]
        yield terms.equal(terms.conjunction([*conditions, *free]), now)
        for place in places:
            taken[place] = steps.any_of([taken.get(place, terms.false), now])
        granting.setdefault(t, []).append(now)
        deserving[t] = terms.conjunction([enabled[t], *free])
    for t, deserved in deserving.items():
        nows = granting.get(t, ())
        yield terms.equal(terms.disjunction([*nows, deserved]), terms.disjunction(nows))


def _turns(by: ArbitrationRule) -> bool:
    return by is not ArbitrationRule.PRIORITY
