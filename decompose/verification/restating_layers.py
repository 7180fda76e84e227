"""The obligations on layers (O8): who decides, that votes add up layer by layer, and that promises keep nobody waiting.

A coordinator below another one votes with the AND of its children's votes, and of its own part where it takes part.
Nothing is to be shown where there is one layer. docs/bundle.md has the sentences.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

from firable.decompose.verification.formulas import Formula
from firable.decompose.verification.restating_facts import agreeing
from firable.nets.decomposition import Coordinated
from firable.nets.net import Transition

if TYPE_CHECKING:
    from firable.decompose.verification.restating import Restated, Stated


def layers(of: Restated) -> Iterator[Stated]:
    """Who decides, then each global transition; nothing where all controllers are under one coordinator."""
    if not of.cut.in_layers:
        return
    yield _deciders(of)
    for row in of.decomposition.coordinated:
        if row.is_global:
            yield _votes(of, row)


def apart(of: Restated) -> Iterator[Stated]:
    """That no promise to one coordinator stands in the way of another one; nothing in one layer."""
    if not of.cut.in_layers:
        return
    at = {row.name: row.at or of.cut.root for row in of.decomposition.coordinated}
    never = []
    for subnet in of.decomposition.subnets:
        for (one, t), (other, u) in of.cut.disturbing(subnet, at):
            if at[one] != at[other]:
                both = of.of.all_of([_yes(of, t), _yes(of, u)])
                never.append(of.of.negation(both))
    sentence = "no two coordinators ask one controller for parts that could both be promised and disturb each other"
    yield of.claim("o8-apart", sentence, of.of.all_of(never))


def _yes(of: Restated, part: Transition) -> Formula:
    return of.of.all_of([of.firable(part), of.open(part)])


def _deciders(of: Restated) -> Stated:
    root = of.cut.root
    at = {t.name: of.cut.decided_at[t.name] for t in of.net.transitions if of.cut.is_global(t.name)}
    decided = []
    for group in of.cut.groups:
        if group.controller is None:
            members = list(dict.fromkeys((*group.sequence, *group.rest)))
            at.update({name: of.cut.decided_at[name] for name in members})
            decided.append(f"'{of.cut.decided_at[members[0]]}' decides the group {group.name}")
    central = [*(f"'{name}' decides {t}" for t, name in at.items()), *decided]
    made = [f"'{row.at or root}' decides {row.name}" for row in of.decomposition.coordinated]
    made += [
        f"'{group.at or root}' decides the group {group.name}"
        for group in of.decomposition.groups
        if group.controller is None
    ]
    sentence = (
        "each transition, with all that it competes with, is decided by the lowest coordinator above all participants"
    )
    return agreeing(of, "o8", sentence, central, made)


def _votes(of: Restated, row: Coordinated) -> Stated:
    at, t = row.at or of.cut.root, of.net.transition(row.name)
    votes: dict[str, list[Formula]] = {}
    for (controller, _), part in zip(of.keys(t), of.parts(t), strict=True):
        votes.setdefault(controller, []).append(_yes(of, part))
    children: dict[str, list[str]] = {}
    for controller, _ in of.keys(t):
        way = of.cut.way_up[controller]
        for child, above in pairwise(way):
            if child not in children.setdefault(above, []):
                children[above].append(child)

    def vote(controller: str) -> Formula:
        return of.of.all_of([*votes.get(controller, ()), *map(vote, children.get(controller, ()))])

    together = of.of.all_of(_yes(of, part) for part in of.parts(t))
    sentence = f"'{row.name}': the votes added up layer by layer at '{at}' are those of all parts together"
    return of.claim(f"o8.{row.name}", sentence, of.of.equal(together, vote(at)), [row.name])
