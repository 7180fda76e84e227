"""The obligations on votes: that of each unit one place at most holds a token, and that a yes stands by arcs and units.

Which units there are nobody has to find again: a bundle lists them, each as the subjects of its verdict. A unit is
some places of which never more than one holds a token. Of each vote each accused transition is excluded by the first
unit of the list of which it and the yes would need two places full; where that leaves nobody, the vote is an obligation
here, under these units. So the list decides which votes are, and a unit that is the first for no vote may not be in it.

docs/bundle.md has the formulas. That a unit keeps its one token is shown by induction over what fires, one transition
at a time; so no more is said than of interleaving.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from firable.decompose.verification.formulas import FALSE, TRUE, AtMostOne, Formula
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.votes import Vote, needs, votes
from firable.nets.right_to_run import EXECUTED_BY
from firable.nets.verdict import Weight

if TYPE_CHECKING:
    from firable.decompose.verification.restating import Restated, Stated

UNIT: Final = "unit."
"""The prefix of the verdicts on units."""


def persistence(of: Restated) -> Iterator[Stated]:
    """Each unit, then each vote that they and the arcs settle, in the order of the table."""
    _check_form(of)
    of_place: dict[str, list[int]] = {}
    for k, unit in enumerate(of.units):
        for place in unit:
            of_place.setdefault(place, []).append(k)
    settled = [(vote, used) for vote in votes(of.decomposition) if (used := _used(of, vote, of_place)) is not None]
    if idle := sorted(set(range(len(of.units))).difference(*(used for _, used in settled))):
        raise NotShownError(f"no vote needs '{UNIT}{idle[0] + 1}'", "verdicts", f"{UNIT}{idle[0] + 1}")
    made = (*(_unit(of, k, unit) for k, unit in enumerate(of.units)), *(_stands(of, *one) for one in settled))
    return (replace(one, weight=Weight.INFORMATION, discipline=EXECUTED_BY) for one in made)


def _check_form(of: Restated) -> None:
    """A unit has several places, in the order of the net; and so have the units."""
    index = of.net.place_index
    before: list[int] = []
    for k, unit in enumerate(of.units, 1):
        if not set(unit) <= index.keys():
            raise NotShownError(f"'{UNIT}{k}' has places that the net has not", "verdicts", f"{UNIT}{k}")
        places = [index[place] for place in unit]
        if len(places) < 2 or places != sorted(set(places)) or places <= before:
            raise NotShownError(f"'{UNIT}{k}' is no unit, or stands in the wrong order", "verdicts", f"{UNIT}{k}")
        before = places


def _used(of: Restated, vote: Vote, of_place: Mapping[str, Sequence[int]]) -> list[int] | None:
    """The units that settle a vote; None where they do not."""
    first: set[int] = set()
    for name in vote.accused:
        seen: set[int] = set()
        twice: set[int] = set()
        for place in vote.full | needs(of.net.transition(name))[0]:
            for k in of_place.get(place, ()):
                (twice if k in seen else seen).add(k)
        if not twice:
            return None
        first.add(min(twice))
    return sorted(first) if vote.asked else None


def _unit(of: Restated, k: int, unit: tuple[str, ...]) -> Stated:
    once = AtMostOne(of.of, map(of.of.variable, unit))
    before, position = once.formula(), {place: i for i, place in enumerate(unit)}
    marked = of.of.all_of(of.of.literal(place, of.net.place(place).marked) for place in unit)
    claims = [_follows(of, marked, before)]
    filling = sorted({t for place in unit for t in of.net.producers[of.net.place_index[place]]})
    for t in (of.net.transitions[t] for t in filling):
        next_tokens = {position[place]: FALSE for place in t.inputs if place in position}
        next_tokens.update({position[place]: TRUE for place in t.outputs if place in position})
        fires = of.of.all_of([before, of.firable(t)])
        claims.append(_follows(of, fires, once.when(next_tokens)))
    sentence = f"of the {len(unit)} places of '{UNIT}{k + 1}' one at most holds a token, in M0 and whatever fires"
    return of.claim(f"{UNIT}{k + 1}", sentence, of.of.all_of(claims), unit)


def _follows(of: Restated, premise: Formula, conclusion: Formula) -> Formula:
    return of.of.any_of([of.of.negation(premise), conclusion])


def _stands(of: Restated, vote: Vote, used: Sequence[int]) -> Stated:
    touching = [of.net.transition(name) for name in vote.touching]
    full = vote.full.union(*(needs(t)[0] for t in touching))
    given = [of.at_most_one(of.of.variable(place) for place in of.units[k] if place in full) for k in used]
    taken_back = of.of.any_of(of.of.all_of([of.firable(t), of.open(t)]) for t in touching)
    levels = map(of.of.variable, vote.levels)
    claim = of.of.negation(of.of.all_of([of.firable(vote.part), *levels, taken_back]))
    rests_on = tuple(f"{UNIT}{k + 1}" for k in used)
    return replace(of.claim(vote.name, vote.sentence, claim, (), given), rests_on=rests_on)
