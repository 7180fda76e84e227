"""The steps of the bare protocols: votes given unasked, orders sent once.

A vote counts as soon as it is given: one that is on its way counts late, as if given late. An order is one message, and
nobody hears whether it has been obeyed. Under promises an abort is one step, the promise withdrawn at both ends.
"""

from __future__ import annotations

from collections.abc import Collection

from firable.decompose.protocol.draft import Draft, Step, at, blind, checked
from firable.decompose.protocol.parts import Part, Parts
from firable.decompose.protocol.rounds import copy
from firable.decompose.protocol.variant import Votes

ORDER = "commit-order"


def add_bare(draft: Draft, parts: Parts, falsifiable: Collection[str]) -> None:
    """Add every step; `falsifiable` are the names of the parts whose yes another firing can falsify."""
    for t, its in parts.coordinated.items():
        voting = [part for part in its if _votes(parts, part, falsifiable)]
        _decide(draft, parts, t, voting)
        for part in its:
            if part in voting:
                _vote(draft, parts, part)
            _obey(draft, parts, part)


def _votes(parts: Parts, part: Part, falsifiable: Collection[str]) -> bool:
    """Whether a part votes beforehand; else it is read when the coordinator decides."""
    kind = parts.variant.votes
    return kind in {Votes.CACHED, Votes.PROMISED} or (kind is Votes.STALE and part.name in falsifiable)


def _decide(draft: Draft, parts: Parts, t: str, voting: Collection[Part]) -> None:
    its = parts.coordinated[t]
    inputs, full, empty = list[str](), list[str](), list[str]()
    outputs = [at(ORDER, part) for part in its]
    for part in its:
        if part in voting:
            inputs.append(at("counted", part))
            # An order that is on its way is for a vote that was used: to its controller there is no second vote.
            full.append(at("promised", part))
        else:
            outputs.append(at("promised", part))
            full += part.inputs + part.permissive
            empty += part.outputs + part.inhibitive
            empty += draft.down_places(part.controller)
    if parts.variant.serial:
        empty += [at(ORDER, part) for others in parts.coordinated.values() for part in others]
    draft.fire(
        f"decide/{t}",
        Step("decide", f"{t} is decided", fires=t, coordinator=parts.decider(t)),
        inputs,
        outputs,
        full,
        empty,
    )


def _vote(draft: Draft, parts: Parts, part: Part) -> None:
    t, c = part.whole, part.controller
    promised, counted = at("promised", part), at("counted", part)
    draft.step(
        f"promise/{t}/{c}",
        Step("promise", f"{c} votes yes on {t}", c),
        (),
        [promised, counted],
        [*part.inputs, *part.permissive, *(copy(c, place) for place in part.copied_full)],
        [
            *part.outputs,
            *part.inhibitive,
            *(copy(c, place) for place in part.copied_empty),
            *(at("promised", other) for other in parts.excluding(part)),
        ],
    )
    if parts.variant.votes is Votes.PROMISED:
        draft.step(f"release/{t}/{c}", Step("release", f"{t} is aborted at {c}", c), [promised, counted])


def _obey(draft: Draft, parts: Parts, part: Part) -> None:
    t, c = part.whole, part.controller
    order, promised = at(ORDER, part), at("promised", part)
    apply = Step("apply", f"the order for {t} arrives at {c}", c)
    trusting = parts.variant.votes is not Votes.PROMISED
    for effect in checked(part) if parts.variant.recheck else blind(part):
        inputs = [order, *effect.inputs]
        draft.step(
            f"apply/{t}/{c}{effect.suffix}", apply, [*inputs, promised], effect.outputs, effect.full, effect.empty
        )
        if trusting:
            draft.step(
                f"apply/{t}/{c}/again{effect.suffix}",
                apply,
                inputs,
                effect.outputs,
                effect.full,
                [*effect.empty, promised],
            )
    if not trusting:
        draft.step(f"apply/{t}/{c}/unpromised", apply, [order], (), (), [promised])
