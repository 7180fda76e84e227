"""The obligations on arbitration: the groups as facts, and the choice of each group.

The choice goes through the considered transitions one after the other: under rotation and order the sequence, entered
at a variable turn, then the sequence again; then the rest. Each is granted if it is enabled, its turn has come and none
of the places that it competes for has been taken; what is granted takes them. docs/bundle.md has the formulas.

What is claimed of the table's choice is claimed of each consideration, by the places of the net. That they are free
adds nothing to what grants it now: so of all that is granted at a place one at most is. That it is enabled, and that
they were free when it was considered last, adds nothing to what grants it at all: so nothing could be added.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from firable.decompose.verification.formulas import FALSE, TRUE, Formula, Formulas
from firable.decompose.verification.recut import is_late
from firable.decompose.verification.restating_facts import agreeing
from firable.nets.decomposition import ArbitrationGroup
from firable.nets.net import ArbitrationRule, Net

if TYPE_CHECKING:
    from firable.decompose.verification.restating import Restated, Stated


_Key = tuple[str, str]
"""A place, and whether it is competed for as an input ("from") or as an output ("to")."""


@dataclass(frozen=True)
class _Contest:
    """The places that each transition competes for, and who competes for each."""

    for_what: Mapping[str, Sequence[_Key]]
    inputs: Mapping[str, Sequence[_Key]]
    who: Mapping[_Key, Sequence[str]]


def arbitration(of: Restated) -> Iterator[Stated]:
    """The facts on the groups, and the choice of each."""
    yield _facts(of)
    central = _contest([(of.net, str)])
    in_subnets = _contest((subnet, partial(of.whole_of, subnet.name)) for subnet in of.decomposition.subnets)
    given = {group.name: group for group in of.decomposition.groups}
    for group in of.cut.groups:
        yield _choice(of, group, given[group.name], central, in_subnets)


def _facts(of: Restated) -> Stated:
    def facts(groups: Sequence[ArbitrationGroup], rows: Sequence[str]) -> Iterator[str]:
        for g in groups:
            yield f"{g.name} decides by {g.by.value} at {json.dumps(g.controller)}"
            yield from (f"{g.name} takes {t} in turn {i}" for i, t in enumerate(g.sequence))
            yield from (f"{g.name} takes {t} last, in turn {i}" for i, t in enumerate(g.rest))
        yield from (f"the coordinator decides {name}" for name in rows)

    central = facts(of.cut.groups, [row.name for row in of.cut.coordinated])
    made = facts(of.decomposition.groups, [row.name for row in of.decomposition.coordinated])
    sentence = "each conflict component is one group, decided by the coordinator where a global transition is in it"
    return agreeing(of, "arbitration", sentence, central, made)


def _contest(nets: Iterable[tuple[Net, Callable[[str], str]]]) -> _Contest:
    """The contest in these nets: the places with several consumers and those with several producers, by name.

    Transitions are told by their names in the central net.
    """
    for_what: dict[str, list[_Key]] = {}
    inputs: dict[str, list[_Key]] = {}
    who: dict[_Key, list[str]] = {}
    for net, whole in nets:
        at: dict[tuple[str, str], list[str]] = {}
        for t in net.transitions:
            for kind, places in (("from", t.inputs), ("to", t.outputs)):
                for place in places:
                    if kind == "from" and is_late(net, t, place):
                        continue
                    at.setdefault((kind, place), []).append(whole(t.name))
        for key in ((kind, place.name) for kind in ("from", "to") for place in net.places):
            names = at.get(key, [])
            if len(names) < 2:
                continue
            who[key] = names
            for name in names:
                for_what.setdefault(name, []).append(key)
                if key[0] == "from":
                    inputs.setdefault(name, []).append(key)
    for keys in (*for_what.values(), *inputs.values()):
        keys.sort()
    return _Contest(for_what, inputs, who)


class _Steps:
    """A variable `step(i)` for each OR that grows with the competitors; the same OR has the same one."""

    def __init__(self, of: Formulas) -> None:
        self.of = of
        self.variables: dict[Formula, Formula] = {}

    def either(self, operands: Iterable[Formula]) -> Formula:
        """Its variable, also of one operand; what is true, false or a variable already needs none."""
        made = self.of.any_of(operands)
        if made in (TRUE, FALSE) or self.of.is_variable(made):
            return made
        return self.variables.setdefault(made, self.of.variable(f"step({len(self.variables)})"))

    def given(self) -> list[Formula]:
        """What each of them is."""
        return [self.of.equal(variable, made) for made, variable in self.variables.items()]


@dataclass(frozen=True)
class _Chosen:
    """What a group grants at all, and what it takes to be granted at each of its considerations."""

    granted: Mapping[str, Formula]
    now: Sequence[tuple[str, Sequence[Formula]]]


def _chosen(of: Formulas, group: ArbitrationGroup, contest: _Contest, steps: _Steps) -> _Chosen:
    """What the group grants, for whatever is enabled and whatever the turn is."""
    considered: list[tuple[str, Formula]] = []
    if group.by is not ArbitrationRule.PRIORITY:
        begun = FALSE
        for i, name in enumerate(group.sequence):
            begun = steps.either([begun, of.variable(f"turn({i})")])
            considered.append((name, begun))
    considered += [(name, TRUE) for name in (*group.sequence, *group.rest)]
    taken: dict[_Key, Formula] = {}
    at_any_time: dict[str, list[Formula]] = {}
    needs: list[tuple[str, Sequence[Formula]]] = []
    for name, its_turn in considered:
        places = contest.for_what.get(name, ())
        free = [of.negation(taken.get(place, FALSE)) for place in places]
        needs.append((name, [of.variable(f"enabled({name})"), its_turn, *free]))
        now = of.all_of(needs[-1][1])
        at_any_time.setdefault(name, []).append(now)
        for place in places:
            taken[place] = steps.either([taken.get(place, FALSE), now])
    return _Chosen({name: of.any_of(nows) for name, nows in at_any_time.items()}, needs)


def _winning(of: Formulas, granted: Mapping[str, Formula], contest: _Contest, steps: _Steps) -> dict[str, Formula]:
    """Who wins an input conflict: it is granted, and one that is enabled and shares an input with it is not."""
    losing: dict[_Key, Formula] = {}
    for place in dict.fromkeys(place for name in granted for place in contest.inputs.get(name, ())):
        losing[place] = steps.either(
            of.all_of([of.variable(f"enabled({name})"), of.negation(granted[name])])
            for name in contest.who[place]
            if name in granted
        )
    return {
        name: of.all_of([its, of.any_of(losing[place] for place in contest.inputs.get(name, ()))])
        for name, its in granted.items()
    }


def _choice(
    of: Restated, group: ArbitrationGroup, in_table: ArbitrationGroup, central: _Contest, in_subnets: _Contest
) -> Stated:
    formulas, steps = of.of, _Steps(of.of)
    wanted = _chosen(formulas, group, central, steps)
    winning = _winning(formulas, wanted.granted, central, steps)
    given = _chosen(formulas, in_table, in_subnets, steps)
    won = _winning(formulas, given.granted, in_subnets, steps)
    claims = []
    for name in wanted.granted:
        claims.append(formulas.equal(given.granted[name], wanted.granted[name]))
        claims.append(formulas.equal(won[name], winning[name]))
    taken: dict[_Key, Formula] = {}
    nows: dict[str, list[Formula]] = {}
    last: dict[str, Formula] = {}
    for name, needs in given.now:
        now = formulas.all_of(needs)
        places = central.for_what.get(name, ())
        free = [formulas.negation(taken.get(place, FALSE)) for place in places]
        claims.append(formulas.equal(formulas.all_of([*needs, *free]), now))
        for place in places:
            taken[place] = steps.either([taken.get(place, FALSE), now])
        nows.setdefault(name, []).append(now)
        last[name] = formulas.all_of([formulas.variable(f"enabled({name})"), *free])
    for name in wanted.granted:
        claims.append(formulas.equal(formulas.any_of([*nows[name], last[name]]), given.granted[name]))
    sentence = f"whatever is enabled, '{group.name}' grants a maximal set without conflict, as the central arbiter does"
    return of.claim(
        f"arbitration.{group.name}", sentence, formulas.all_of(claims), tuple(wanted.granted), steps.given()
    )
