"""What is proved of the protocol, once for every net: each obligation a file that must have no model.

- *starts*, *keeps*: the invariant holds at the start, and each action keeps it; so it holds for ever.
- *follows*, *rest*, *once*, *expected*: what the invariant is for. Whatever fires, at a commit or locally, is enabled
  in the central net then, which fires it by definition; all other actions leave it alone, but for signals that change.
  When every decided round is closed, the controllers hold the central marking. An order finds its part promised and
  enabled, so that it takes tokens that are there and puts them on empty places.
- *waits*: while the vote on a free part stands, nobody at its controller is enabled, or promised, who waits for a place
  that it will fill. *persists*: in a net of which the votes of free parts are persistent, what fires takes
  none of them back. Both speak of things that have names, and are given elsewhere of all: so what exists because of
  others never goes from transitions to places.
- *home*: as long as a round is open, one of six steps can be taken that leaves the shadow alone (give up, apply,
  apply-free, release, note, close), and each of them makes what is still to be done strictly less.
- *complete*: when no round is open, whatever is enabled in the central net can fire: a local transition at once, a
  coordinated one asked for in a new round, promised and heard of each who has to promise, voted on by the others, and
  decided; and every signal can change, as the cell changes it. On the way the shadow stays.
- *advances*: every step that is hidden, but for asking, leaves everything as it is or makes something known for good
  that was not: so a run without end that fires nothing asks again and again, or repeats.

With *follows* and *complete* the relation "has this shadow" is a functional branching bisimulation between the
protocol, its other steps hidden, and the central net (van Glabbeek and Weijland, JACM 43, 1996). What is argued outside
the solver is said in docs/protocol-invariant.md.

Every obligation lies in a fragment that is decidable: all quantified variables that depend on others, and all
functions, go from places to transitions, to controllers, to rounds, to coordinators, and never back (`fragment`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.decompose.protocol.parametric.invariant import INVARIANT, Conjunct, invariant_of
from firable.decompose.protocol.parametric.logic import (
    Formula,
    Term,
    Variable,
    any_of,
    both,
    closed,
    earlier,
    exists,
    forall,
    free_variables,
    same,
)
from firable.decompose.protocol.parametric.script import Action, Script
from firable.decompose.protocol.parametric.system import (
    INITIAL,
    MOVING,
    PROTOCOL,
    TAKES_NONE_BACK,
    Protocol,
    Transition,
    abort_order,
    acknowledgement,
    asked,
    asks,
    begun,
    behind,
    c,
    central_enabled,
    closed_round,
    commit_order,
    committed,
    coordinated,
    coordinator_of,
    counts,
    d,
    decided,
    decider,
    enabled_at,
    falsifies,
    formals_of,
    free,
    heard,
    home,
    input_of,
    lasting,
    marked,
    noted,
    obeyed,
    output_of,
    owner,
    p,
    part_enabled,
    permissive_of,
    promised,
    q,
    r,
    s,
    shadow,
    signal,
    stands,
    t,
    takes_part,
    u,
    vote,
)


@dataclass(frozen=True)
class ParametricObligation:
    """A claim about the protocol, proved iff its `script`, which denies it, cannot be true.

    What is `given` of the theory implies the claim. With an action `by`, the claim is about the moment after it, and
    says of the one before it what is marked `earlier`; the demands of the action are given too if `happens`, else to be
    shown.
    """

    name: str
    statement: str
    theory: Script
    given: tuple[tuple[str, Formula], ...]
    claim: Formula
    by: Action | None = None
    happens: bool = False

    @cached_property
    def script(self) -> Script:
        """The theory, what is given, and that the claim does not hold."""
        script = self.theory.continued()
        for words, formula in self.given:
            script.add(formula, f"given: {words}")
        if self.by is not None:
            (script.step if self.happens else script.change)(self.by)
        script.add(~self.claim, "and what is to be shown does not hold")
        return script

    @property
    def block(self) -> str:
        """What is asserted beyond the theory, as a block of the file of all obligations."""
        lines = [f"; {self.statement}", "(push 1)", f'(echo "protocol.{self.name}")', *self.script.more()]
        return "\n" + "\n".join([*lines, "(check-sat)", "(pop 1)"]) + "\n"


def theory(protocol: Protocol = PROTOCOL, conjuncts: Sequence[Conjunct] = INVARIANT) -> Script:
    """What there is, what is assumed of every net, and what the invariant says."""
    script = Script()
    script.speak_of(*MOVING, coordinator_of, decider, behind, lasting)
    for words, formula in protocol.static:
        script.add(formula, f"assumed of every net: {words}")
    for conjunct in conjuncts:
        script.remark(f"invariant {conjunct.name}: {conjunct.words}")
        script.speak_of(conjunct.sentence)
    script.speak_of(invariant_of(conjuncts))
    return script


def parametric_obligations(
    protocol: Protocol = PROTOCOL, conjuncts: Sequence[Conjunct] = INVARIANT
) -> Iterator[ParametricObligation]:
    """Every obligation of the theorem, of this protocol and the invariant of these conjuncts, for every net."""
    prover = _Prover(protocol, conjuncts)
    yield prover.starts()
    for action in protocol.actions:
        yield prover.keeps(action)
    yield from prover.waits()
    yield from prover.persists()
    yield from prover.safety()
    yield from prover.homeward()
    yield from prover.complete()
    for action in protocol.actions:
        if action.name not in {"ask", "sense", "sense-late"} and not action.fires:
            yield prover.advances(action)


none_underway: Final = forall(s)(decided(s).implies(closed_round(s)))
"""Every decided round is closed: quiescence."""
none_open: Final = forall(s)(begun(s).implies(closed_round(s)))
"""Every round is closed."""
agree: Final = forall(q)(marked(q).iff(shadow(q)))
"""The controllers hold the central marking."""
takes_and_puts: Final = forall(q)(
    same(owner(q), c).implies(input_of(t, q).implies(marked(q)) & output_of(t, q).implies(~marked(q)))
)
"""Each input of the part of t at c holds a token, and each output none."""

_ordered = asked(s, u) & takes_part(u, d) & (~free(u, d) | committed(s, u))
_to_do: Final = (
    begun(s) & ~decided(s),
    _ordered & ~obeyed(s, u, d),
    _ordered & ~noted(s, u, d),
    begun(s) & ~closed_round(s),
)
"""What is still to be done of rounds that are begun; the free variables say of what."""
_less: Final = both([closed(item.implies(earlier(item))) for item in _to_do]) & any_of(
    [exists(*free_variables(item))(earlier(item) & ~item) for item in _to_do]
)

_v: Final = Variable("v", Transition)

_opening: Final = (
    asked(r, t)
    & ~decided(r)
    & central_enabled(t)
    & forall(s, u, d)(promised(s, u, d).implies(same(s, r) & same(u, t)))
    & none_underway
    & agree
)
"""Round r asks for t, which is enabled in the central net, and no other promise stands."""


def _live(r: Variable, t: Variable, d: Variable) -> Formula:
    """A promise that may still be applied."""
    return promised(r, t, d) & (~decided(r) | committed(r, t))


_WAITS: Final = (
    (
        "whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)",
        forall(s, u, _v, d)((_live(s, _v, d) & stands(u, d)).implies(~behind(_v, u, d))),
    ),
)


def _of(action: Action, *, firing: bool = True) -> Iterator[tuple[str, Formula]]:
    """What the lemmas *waits* and, of what fires, *persists* say of an action that happens."""
    if action.name in {"promise", "stand", "fire"}:
        where: Term = home(t) if action.name == "fire" else c
        yield (
            "waits for no place that a free part fills whose vote stands (waits.enabled)",
            forall(u)(stands(u, where).implies(~behind(t, u, where))),
        )
    if action.fires and firing:
        yield f"takes no standing vote back (persists.{action.name})", TAKES_NONE_BACK


def _may(action: Action) -> Formula:
    """The demands of an action, of the moment before it."""
    return earlier(both(list(action.guard)))


class _Prover:
    """The obligations of one protocol."""

    def __init__(self, protocol: Protocol, conjuncts: Sequence[Conjunct]) -> None:
        self.protocol = protocol
        self.theory = theory(protocol, conjuncts)
        self.invariant = invariant_of(conjuncts)()
        self.given = ("the invariant", self.invariant)

    def implied(
        self, name: str, statement: str, given: Formula, claim: Formula, by: Action | None = None
    ) -> ParametricObligation:
        """In each configuration of the invariant, `given` implies `claim`; or after the action `by`."""
        lemmas = (*_WAITS, ("besides", given))
        return ParametricObligation(name, statement, self.theory, (self.given, *lemmas), claim, by)

    def kept(self, name: str, statement: str, claim: Formula, by: Action) -> ParametricObligation:
        """From each configuration of the invariant, an action leads to one of which the claim holds."""
        lemmas = [*_WAITS, *((f"'{by.name}' {words}", formula) for words, formula in _of(by))]
        return ParametricObligation(name, statement, self.theory, (self.given, *lemmas), claim, by, happens=True)

    # --- The invariant

    def starts(self) -> ParametricObligation:
        return ParametricObligation("starts", "the invariant holds at the start", self.theory, INITIAL, self.invariant)

    def keeps(self, action: Action) -> ParametricObligation:
        return self.kept(f"keeps.{action.name}", f"'{action.name}' keeps the invariant", self.invariant, action)

    # --- Parts that are free of promise

    def waits(self) -> Iterator[ParametricObligation]:
        needs_full = exists(q)(same(owner(q), c) & output_of(u, q) & (input_of(t, q) | permissive_of(t, q)))
        whoever: tuple[tuple[str, str, Formula], ...] = (
            ("enabled", "is enabled at its controller", part_enabled(t, c)),
            ("promised", "is promised there and may still be applied", _live(r, t, c)),
        )
        for name, words, formula in whoever:
            given = (self.given, ("besides", formula & stands(u, c)), ("behind", behind(t, u, c).implies(needs_full)))
            statement = f"what {words} waits for no place that a free part fills whose vote stands"
            yield ParametricObligation(f"waits.{name}", statement, self.theory, given, ~behind(t, u, c))

    def persists(self) -> Iterator[ParametricObligation]:
        yes = forall(q)(same(owner(q), c).implies(enabled_at(shadow, u, q)))
        persistent = (yes & central_enabled(t) & free(u, c) & ~same(u, t)).implies(
            same(owner(p), c).implies(~falsifies(t, u, p))
        )
        assumed = ("the net: a yes that holds is taken back by nothing else that is enabled", persistent)
        for action in self.protocol.actions:
            if action.fires:
                given = (
                    self.given,
                    *_WAITS,
                    *_of(action, firing=False),
                    *((assumed,) if self.protocol.persistent else ()),
                    ("besides", both(list(action.guard)) & counts(u, c) & ~same(u, t) & same(owner(p), c)),
                )
                statement = f"what fires at '{action.name}' takes no standing vote back that counts"
                claim = ~falsifies(t, u, p)
                yield ParametricObligation(f"persists.{action.name}", statement, self.theory, given, claim)

    # --- Safety

    def safety(self) -> Iterator[ParametricObligation]:
        for action in self.protocol.actions:
            if action.fires:
                waiting = [formula for _, formula in _of(action, firing=False)]
                yield self.implied(
                    f"follows.{action.name}",
                    f"what fires at '{action.name}' is enabled in the central net then",
                    both([*action.guard, *waiting]),
                    central_enabled(t),
                )
        yield self.implied(
            "rest",
            "when every decided round is closed, the controllers hold the marking of the central net",
            none_underway,
            agree,
        )
        yield self.implied(
            "once",
            "an order takes tokens that are there, and puts tokens on empty places",
            any_of([both(list(self.protocol.action(name).guard)) for name in ("apply", "apply-free")]),
            takes_and_puts,
        )
        yield self.implied(
            "expected",
            "an order that was not obeyed finds its part promised and enabled, or free",
            commit_order(r, t, c) & ~obeyed(r, t, c) & ~free(t, c),
            promised(r, t, c) & part_enabled(t, c),
        )

    # --- Completeness

    def homeward(self) -> Iterator[ParametricObligation]:
        all_noted = forall(u, d)(
            (asked(r, u) & takes_part(u, d) & (~free(u, d) | committed(r, u))).implies(noted(r, u, d))
        )
        steps: tuple[tuple[str, Formula, str], ...] = (
            ("give-up", begun(r) & ~decided(r), "a round that is not decided can be given up"),
            ("apply", commit_order(r, t, c) & ~obeyed(r, t, c) & ~free(t, c), "an order to commit can be applied"),
            ("apply-free", commit_order(r, t, c) & ~obeyed(r, t, c) & free(t, c), "by a free part, too"),
            ("release", abort_order(r, t, c) & ~obeyed(r, t, c), "an order to abort can be obeyed"),
            ("note", acknowledgement(r, t, c) & ~noted(r, t, c), "an acknowledgement can be noted"),
            (
                "close",
                begun(r) & decided(r) & ~closed_round(r) & all_noted,
                "a round of which all acknowledgements are noted can be closed",
            ),
        )
        yield self.implied(
            "home.some",
            "as long as a round is open, one of the steps that lead home can be taken",
            begun(r) & ~closed_round(r),
            any_of([exists(*(v for v in free_variables(case) if v != r))(case) for _, case, _ in steps]),
        )
        for step, case, words in steps:
            name, statement = f"home.{step}", f"{words}, and less is to be done then"
            action = self.protocol.action(step)
            yield self.implied(name, statement, case, _may(action) & _less, by=action)

    def complete(self) -> Iterator[ParametricObligation]:
        steps: tuple[tuple[str, Formula, Formula, str], ...] = (
            (
                "ask",
                none_open & coordinated(t) & central_enabled(t) & ~begun(r) & same(coordinator_of(r), decider(t)),
                _opening,
                "with no round open, a new one can ask for whatever is enabled in the central net",
            ),
            (
                "promise",
                _opening & asks(t, c) & ~promised(r, t, c),
                _opening & promised(r, t, c),
                "then each who has to promise can promise its part",
            ),
            (
                "stand",
                _opening & free(t, c),
                _opening & stands(t, c),
                "and each of whom a part is free of promise can vote on it",
            ),
            ("hear", _opening & promised(r, t, c), _opening & heard(r, t, c), "then each vote can be heard"),
            (
                "decide",
                _opening & forall(d)(takes_part(t, d).implies(heard(r, t, d) | (free(t, d) & stands(t, d)))),
                both([]),
                "then it can be decided",
            ),
            (
                "fire",
                none_open & ~coordinated(t) & central_enabled(t),
                both([]),
                "with no round open, a local transition that is enabled in the central net can fire",
            ),
            (
                "sense",
                none_open & signal(p) & ~(lasting(p) & marked(p)),
                both([]),
                "with no round open, every signal can change, but for completions that have come",
            ),
        )
        for step, given, after, words in steps:
            action = self.protocol.action(step)
            yield self.implied(f"complete.{step}", words, given, _may(action) & after, by=action)

    def advances(self, action: Action) -> ParametricObligation:
        growing = (vote, heard, decided, obeyed, noted, closed_round)
        known = [begun(s) & relation(*formals_of(relation)) for relation in growing]
        known += [stands(u, d)] if action.name == "stand" else []  # an order that is applied ends it
        lost_none = both([closed(earlier(fact).implies(fact)) for fact in known])
        gained = any_of([exists(*free_variables(fact))(fact & ~earlier(fact)) for fact in known])
        changed = [update.relation(*formals_of(update.relation)) for update in action.updates]
        unchanged = both([closed(fact.iff(earlier(fact))) for fact in changed])
        asked_no_more = both([closed(fact.implies(earlier(fact))) for fact in (asked(s, u), begun(s))])
        return self.kept(
            f"advances.{action.name}",
            f"'{action.name}' changes nothing, or makes something known for good",
            asked_no_more & (unchanged | (lost_none & gained)),
            action,
        )
