"""O8: with coordinators above coordinators, votes still add up to Eq. (7) and (8), and competitors meet in one decider.

A coordinator that is asked from above answers with the AND of its children's votes, so what the decider of a transition
computes is a conjunction bracketed along the tree, from its participants up to it. For each global transition that is
compared with the flat conjunction of Eq. (7) and (8), whose factors are the same terms. A part that hangs under another
coordinator than the decider is in no branch, so its factor is missing, and the two differ in the marking where only
that part is not firable. That the tree is one, each controller under one coordinator and none under itself, is a rule
of the net.

Who decides is a fact for each row and group: the lowest common ancestor of all participants, of the whole conflict
component where there is one, and of all that contend (`firable.nets.contention`). Here it is found by its definition,
the deepest of those that are above everyone, and not by the search from below that the split uses.

What this is for is an obligation of its own: no two coordinators ask one controller for parts that are firable together
and disturb each other (`apart`). So what one coordinator has been promised never makes another one give up a round, and
no two of them give up for ever because of each other. It is stated of the table as it is, whoever made it.

Nothing is to be shown of a net in one layer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise

from firable.analysis.induction.smt import Term, Terms
from firable.decompose.proofs.obligation import Obligation, claimed, equation, facts
from firable.decompose.proofs.sides import Sides, holds, signals
from firable.nets.contention import contentions
from firable.nets.layers import Layers
from firable.nets.net import Net
from firable.semantics.firing import enabled


def layers(sides: Sides) -> Iterator[Obligation]:
    """O8 for each row of the table, and the deciders of all; nothing where there is one layer."""
    tree = Layers(sides.net)
    if not tree.several:
        return
    yield _deciders(sides, tree)
    for row in sides.decomposition.coordinated:
        if row.is_global:
            yield _votes(sides, tree, row.name, row.at or tree.root, [part.controller for part in row.parts])


def apart(sides: Sides) -> Iterator[Obligation]:
    """That no promise to one coordinator stands in the way of another one; nothing where there is one layer."""
    tree = Layers(sides.net)
    if not tree.several:
        return
    terms = Terms()
    at = {row.name: row.at or tree.root for row in sides.decomposition.coordinated}
    never: list[Term] = []
    for subnet in sides.subnets:
        its = {t: at[whole] for t in range(len(subnet.transitions)) if (whole := sides.whole_of(subnet, t)) in at}
        for t, u in _disturbing(subnet, its):
            never.append(terms.negation(terms.conjunction([_yes(terms, subnet, t), _yes(terms, subnet, u)])))
    yield claimed(
        terms,
        "o8-apart",
        "no two coordinators ask one controller for parts that could both be promised and disturb each other",
        terms.conjunction(never),
    )


def _disturbing(subnet: Net, its: Mapping[int, str]) -> list[tuple[int, int]]:
    """The pairs of these parts, asked for by two coordinators, of which firing one could change what the other reads.

    Cost: those that meet at a place or a signal, not all pairs.
    """
    moving: dict[str, set[int]] = {}
    reading: dict[str, set[int]] = {}
    for t in its:
        part = subnet.transitions[t]
        cleared = (signal for place in part.outputs for signal in subnet.place(place).cleared)
        for name in (*part.inputs, *part.outputs, *cleared):
            moving.setdefault(name, set()).add(t)
        gates = (gate.signal for gate in part.external)
        for name in (*part.inputs, *part.outputs, *part.permissive, *part.inhibitive, *gates):
            reading.setdefault(name, set()).add(t)
    pairs = ((t, u) for name, some in moving.items() for t in some for u in reading.get(name, ()) if its[t] != its[u])
    return sorted({(min(pair), max(pair)) for pair in pairs})


def _votes(sides: Sides, tree: Layers, name: str, at: str, owners: Sequence[str]) -> Obligation:
    terms = Terms()
    votes: dict[str, list[Term]] = {}
    for key in sides.parts[name]:
        found = sides.part(key)
        votes.setdefault(key[0], []).append(_yes(terms, *found) if found else terms.false)
    below: dict[str, dict[str, None]] = {}
    for owner in owners:
        way = tree.up(owner)
        for child, above in pairwise(way):
            below.setdefault(above, {})[child] = None
    return equation(
        terms,
        f"o8.{name}",
        f"'{name}': the votes added up layer by layer at '{at}' are those of all parts together",
        name,
        sides.of_parts(terms, name, partial(_yes, terms)),
        _added_up(terms, at, votes, below),
        words=("the votes of all parts", f"the vote at '{at}'"),
    )


def _yes(terms: Terms, subnet: Net, part: int) -> Term:
    """Eq. (1) and (2) of a part in its subnet."""
    return enabled(terms, subnet, part, holds(terms, subnet), signals(terms, subnet))


def _added_up(terms: Terms, at: str, votes: Mapping[str, list[Term]], below: Mapping[str, Iterable[str]]) -> Term:
    """The vote of a controller: its own part, and the votes of those under it that take part."""
    under = (_added_up(terms, child, votes, below) for child in below.get(at, ()))
    return terms.conjunction([*votes.get(at, ()), *under])


def _deciders(sides: Sides, tree: Layers) -> Obligation:
    net, arbitration = sides.net, sides.arbitration
    participants: dict[str, set[str]] = {}
    for transition in net.transitions:
        names = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
        owners = {net.place(place).owner for place in names}
        owners |= {net.signal(gate.signal).owner for gate in transition.external}
        participants[transition.name] = {owner for owner in owners if owner is not None}
    central = {name: _lowest(tree, owners) for name, owners in participants.items() if len(owners) > 1}
    together: dict[str, list[str]] = {name: [name] for name in central}
    groups: dict[str, list[str]] = {}
    for group in arbitration.groups:
        members = [net.transitions[t].name for t in (*group.sequence, *group.rest)]
        if any(name in central for name in members):
            groups[group.name] = members
            together.update(dict.fromkeys(members, members))
    for found in contentions(net, together.keys()):
        one, other = together[found.mover], together[found.reader]
        if one is not other:
            one.extend(other)
            together.update(dict.fromkeys(other, one))
    for name, members in together.items():
        central[name] = _lowest(tree, set().union(*(participants[member] for member in members)))
    of_group = [f"'{central[members[0]]}' decides the group {name}" for name, members in groups.items()]
    made = [f"'{row.at or tree.root}' decides {row.name}" for row in sides.decomposition.coordinated]
    made += [
        f"'{group.at or tree.root}' decides the group {group.name}"
        for group in sides.decomposition.groups
        if group.controller is None or group.at is not None
    ]
    return facts(
        "o8",
        "each transition, with all that it competes with, is decided by the lowest coordinator above all participants",
        [*(f"'{at}' decides {name}" for name, at in central.items()), *of_group],
        made,
    )


def _lowest(tree: Layers, owners: set[str]) -> str:
    """Of those that are above everyone, the one with most others above it."""
    above = set.intersection(*(set(tree.up(owner)) for owner in owners))
    return max(above, key=lambda name: len(tree.up(name)))
