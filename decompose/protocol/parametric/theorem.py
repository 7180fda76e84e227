"""What is proved of the protocol, once for every net: each obligation a file that must have no model.

- *starts*, *keeps*: the invariant holds at the start, and each action keeps it; so it holds for ever.
- *follows*, *rest*, *once*, *expected*: what the invariant is for. Whatever fires, at a commit or locally, is enabled
  in the central net then, which fires it by definition; all other actions leave it alone, but for signals that change.
  When every decided round is closed, the controllers hold the central marking. An order finds its part promised and
  enabled, so that it takes tokens that are there and puts them on empty places.
- *home*: as long as a round is open, one of five steps can be taken that leaves the shadow alone (give up, apply,
  release, note, close), and each of them makes what is still to be done strictly less.
- *complete*: when no round is open, whatever is enabled in the central net can fire: a local transition at once, a
  coordinated one asked for in a new round, promised and heard of each who takes part, and decided; and every signal
  can change. On the way the shadow stays.
- *advances*: every step that is hidden, but for asking, leaves everything as it is or makes something known for good
  that was not: so a run without end that fires nothing asks again and again, or repeats.

With *follows* and *complete* the relation "has this shadow" is a functional branching bisimulation between the
protocol, its other steps hidden, and the central net (van Glabbeek and Weijland, JACM 43, 1996). What is argued outside
the solver is said in docs/protocol-invariant.md.

Every obligation lies in a fragment that is decidable: all quantified variables that depend on others, and all
functions, go from places and transitions to controllers and rounds, and from none of these back (`fragment`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.decompose.protocol.parametric.invariant import INVARIANT, Conjunct, invariant_of
from firable.decompose.protocol.parametric.logic import (
    Formula,
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
    Protocol,
    abort_order,
    acknowledgement,
    asked,
    begun,
    c,
    central_enabled,
    closed_round,
    commit_order,
    coordinated,
    coordinator_of,
    d,
    decided,
    formals_of,
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
    q,
    r,
    s,
    shadow,
    signal,
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
    script.speak_of(*MOVING, coordinator_of)
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
    yield from prover.safety()
    yield from prover.homeward()
    yield from prover.complete()
    for action in protocol.actions:
        if action.name not in {"ask", "sense"} and not action.fires:
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

_to_do: Final = (
    begun(s) & ~decided(s),
    asked(s, u) & takes_part(u, d) & ~obeyed(s, u, d),
    asked(s, u) & takes_part(u, d) & ~noted(s, u, d),
    begun(s) & ~closed_round(s),
)
"""What is still to be done of rounds that are begun; the free variables say of what."""
_less: Final = both([closed(item.implies(earlier(item))) for item in _to_do]) & any_of(
    [exists(*free_variables(item))(earlier(item) & ~item) for item in _to_do]
)

_opening: Final = (
    asked(r, t) & ~decided(r) & central_enabled(t) & forall(s, u, d)(promised(s, u, d).implies(same(s, r))) & agree
)
"""Round r asks for t, which is enabled in the central net, and no promise of another round stands."""


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
        return ParametricObligation(name, statement, self.theory, (self.given, ("besides", given)), claim, by)

    def kept(self, name: str, statement: str, claim: Formula, by: Action) -> ParametricObligation:
        """From each configuration of the invariant, an action leads to one of which the claim holds."""
        return ParametricObligation(name, statement, self.theory, (self.given,), claim, by, happens=True)

    # --- The invariant

    def starts(self) -> ParametricObligation:
        return ParametricObligation("starts", "the invariant holds at the start", self.theory, INITIAL, self.invariant)

    def keeps(self, action: Action) -> ParametricObligation:
        return self.kept(f"keeps.{action.name}", f"'{action.name}' keeps the invariant", self.invariant, action)

    # --- Safety

    def safety(self) -> Iterator[ParametricObligation]:
        for action in self.protocol.actions:
            if action.fires:
                yield self.implied(
                    f"follows.{action.name}",
                    f"what fires at '{action.name}' is enabled in the central net then",
                    both(list(action.guard)),
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
            both(list(self.protocol.action("apply").guard)),
            takes_and_puts,
        )
        yield self.implied(
            "expected",
            "an order that was not obeyed finds its part promised and enabled",
            commit_order(r, t, c) & ~obeyed(r, t, c),
            promised(r, t, c) & part_enabled(t, c),
        )

    # --- Completeness

    def homeward(self) -> Iterator[ParametricObligation]:
        all_noted = forall(u, d)((asked(r, u) & takes_part(u, d)).implies(noted(r, u, d)))
        steps: tuple[tuple[str, Formula, str], ...] = (
            ("give-up", begun(r) & ~decided(r), "a round that is not decided can be given up"),
            ("apply", commit_order(r, t, c) & ~obeyed(r, t, c), "an order to commit can be applied"),
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
            any_of([exists(*free_variables(case))(case) for _, case, _ in steps]),
        )
        for step, case, words in steps:
            name, statement = f"home.{step}", f"{words}, and less is to be done then"
            action = self.protocol.action(step)
            yield self.implied(name, statement, case, _may(action) & _less, by=action)

    def complete(self) -> Iterator[ParametricObligation]:
        steps: tuple[tuple[str, Formula, Formula, str], ...] = (
            (
                "ask",
                none_open & coordinated(t) & central_enabled(t) & ~begun(r),
                _opening,
                "with no round open, a new one can ask for whatever is enabled in the central net",
            ),
            (
                "promise",
                _opening & takes_part(t, c) & ~promised(r, t, c),
                _opening & promised(r, t, c),
                "then each who takes part can promise its part",
            ),
            ("hear", _opening & promised(r, t, c), _opening & heard(r, t, c), "then each vote can be heard"),
            (
                "decide",
                _opening & forall(d)(takes_part(t, d).implies(heard(r, t, d))),
                both([]),
                "then it can be decided",
            ),
            (
                "fire",
                none_open & ~coordinated(t) & central_enabled(t),
                both([]),
                "with no round open, a local transition that is enabled in the central net can fire",
            ),
            ("sense", none_open & signal(p), both([]), "with no round open, every signal can change"),
        )
        for step, given, after, words in steps:
            action = self.protocol.action(step)
            yield self.implied(f"complete.{step}", words, given, _may(action) & after, by=action)

    def advances(self, action: Action) -> ParametricObligation:
        growing = (vote, heard, decided, obeyed, noted, closed_round)
        known = [begun(s) & relation(*formals_of(relation)) for relation in growing]
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
