"""What holds in every configuration that the protocol reaches, in any net: the inductive invariant.

Each conjunct is one sentence, for all values of its variables. Together they hold at the start and each action keeps
them (`theorem`), so they hold for ever. V1 to V5, S1 and S2 are the ones by which the safety argument goes:

- a vote that may still count rests on a promise (V1), and a promise keeps its part enabled in the subnet (V2), because
  whatever fires or is promised besides does not disturb it (V3);
- so at a commit all parts are enabled at once, though the votes were given at different instants; and what is
  committed stays promised until its order is obeyed (V4), once in each round (V5);
- where a committed part is not yet applied, the shadow has moved the token already, which the subnet still holds (V2);
  everywhere else they hold the same (S1, S2).

The rest says what messages say: that of what was sent the cause is true, and that what has to be sent was sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.decompose.protocol.parametric.logic import Definition, Formula, both, closed, exists, same
from firable.decompose.protocol.parametric.system import (
    abort_order,
    acknowledgement,
    asked,
    asks,
    begun,
    c,
    closed_round,
    commit_order,
    committed,
    coordinated,
    coordinator_of,
    counts,
    decided,
    decider,
    disturb,
    enabled_at,
    free,
    heard,
    input_of,
    marked,
    noted,
    obeyed,
    output_of,
    owner,
    p,
    part_enabled,
    promised,
    r,
    request,
    s,
    shadow,
    stands,
    t,
    takes_part,
    u,
    underway,
    vote,
    writes,
)


@dataclass(frozen=True)
class Conjunct:
    """One sentence of the invariant; `formula` is for all values of its free variables."""

    name: str
    words: str
    formula: Formula

    @cached_property
    def sentence(self) -> Definition:
        """The formula with its quantifiers, under its name."""
        return Definition(f"inv-{self.name}", (), closed(self.formula))


_moving = committed(r, t) & ~obeyed(r, t, owner(p)) & writes(t, p)
"""A committed transition has moved this place in the shadow, and its part is not yet applied."""

INVARIANT: Final = (
    Conjunct("V1", "a part with a vote stays promised until its order is obeyed", (
        vote(r, t, c) & ~obeyed(r, t, c)).implies(promised(r, t, c))),
    Conjunct("V2", "a promised part that may still be applied is enabled in its subnet", (
        promised(r, t, c) & (~decided(r) | committed(r, t))).implies(part_enabled(t, c))),
    Conjunct("V3", "promises of different rounds at one controller do not disturb each other", (
        promised(r, t, c) & promised(s, u, c) & ~same(r, s) & same(owner(p), c)).implies(~disturb(t, u, p))),
    Conjunct("V4", "a committed part stays promised until it is applied", (
        committed(r, t) & asks(t, c) & ~obeyed(r, t, c)).implies(promised(r, t, c))),
    Conjunct("V5", "a round commits one transition at most", (
        committed(r, t) & committed(r, u)).implies(same(t, u))),
    Conjunct("S1", "where a committed part is not yet applied, the shadow has moved the token", (
        _moving).implies(shadow(p).iff(output_of(t, p)))),
    Conjunct("S2", "everywhere else the subnets hold what the shadow holds", (
        ~exists(r, t)(_moving)).implies(marked(p).iff(shadow(p)))),
    Conjunct("F1", "while a vote stands, the part has its inputs full and its outputs empty in its subnet", (
        stands(t, c) & same(owner(p), c)).implies(
            input_of(t, p).implies(marked(p)) & output_of(t, p).implies(~marked(p)))),
    Conjunct("F2", "a standing vote that counts holds in the central net", (
        counts(t, c) & same(owner(p), c)).implies(enabled_at(shadow, t, p))),
    Conjunct("F3", "a vote stands until the order is applied, one order at a time", (
        underway(r, t, c)).implies(stands(t, c) & underway(s, t, c).implies(same(r, s)))),
    Conjunct("stands", "votes stand of free parts alone", stands(t, c).implies(free(t, c))),
    Conjunct("asked", "what is asked for is coordinated, in a round of who decides it that is begun", (
        asked(r, t)).implies(begun(r) & coordinated(t) & same(coordinator_of(r), decider(t)))),
    Conjunct("decided", "a round that is decided was begun", decided(r).implies(begun(r))),
    Conjunct("committed", "what is committed was asked for, in a round that is decided", (
        committed(r, t)).implies(decided(r) & asked(r, t))),
    Conjunct("request", "requests go to those who have to promise a part of what is asked for", (
        request(r, t, c)).iff(asked(r, t) & asks(t, c))),
    Conjunct("promised", "a promise was requested, is voted for, and no order of it has been obeyed", (
        promised(r, t, c)).implies(request(r, t, c) & vote(r, t, c) & ~obeyed(r, t, c))),
    Conjunct("heard", "what the coordinator has heard was voted", heard(r, t, c).implies(vote(r, t, c))),
    Conjunct("commit-order", "orders to commit are those of the committed transition, to all who take part", (
        commit_order(r, t, c)).iff(committed(r, t) & takes_part(t, c))),
    Conjunct("abort-order", "orders to abort are those of whatever else had to be promised in a decided round", (
        abort_order(r, t, c)).iff(decided(r) & asked(r, t) & ~committed(r, t) & asks(t, c))),
    Conjunct("obeyed", "orders are obeyed in rounds that are decided", obeyed(r, t, c).implies(decided(r))),
    Conjunct("acknowledgement", "who was asked, or ordered to commit, acknowledges what it has obeyed, and only that", (
        acknowledgement(r, t, c)).iff((request(r, t, c) | commit_order(r, t, c)) & obeyed(r, t, c))),
    Conjunct("noted", "what the coordinator notes was acknowledged", (
        noted(r, t, c)).implies(acknowledgement(r, t, c))),
    Conjunct("closed", "a closed round is begun and decided", closed_round(r).implies(begun(r) & decided(r))),
    Conjunct("closed-noted", "in a closed round all have acknowledged", (
        closed_round(r) & asked(r, t) & takes_part(t, c) & (~free(t, c) | committed(r, t))).implies(noted(r, t, c))),
)  # fmt: skip
"""The invariant; the order is the one of the documentation."""


def invariant_of(conjuncts: Sequence[Conjunct]) -> Definition:
    """All of these together, under the name `invariant`."""
    return Definition("invariant", (), both([conjunct.sentence() for conjunct in conjuncts]))
