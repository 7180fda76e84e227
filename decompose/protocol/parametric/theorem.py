"""What is proved of the protocol, once for every net: each obligation a file that must have no model.

- *starts*, *keeps*: the invariant holds at the start, and each action keeps it; so it holds for ever.
- *follows*, *rest*, *once*, *expected*: what the invariant is for. Whatever fires, at a commit or locally, the central
  net can fire then, and the shadow does so by definition; all other actions leave the shadow alone. When every decided
  round is closed, the controllers hold the central marking. An order finds its part promised and firable, so that it
  takes tokens that are there and puts them on empty places.
- *home*: as long as a round is open, one of five steps can be taken that leaves the shadow alone (give up, apply,
  release, note, close), and each of them makes what is still to be done strictly less.
- *complete*: when no round is open, whatever the central net may fire can fire: a local transition at once, a
  coordinated one asked for in a new round, promised and heard of each who takes part, and decided. On the way the
  shadow stays.
- *advances*: every step that is hidden, but for asking, leaves everything as it is or makes something known for good
  that was not: so a run without end that fires nothing asks again and again, or repeats.

With *follows* and *complete* the relation "has this shadow" is a functional branching bisimulation between the
protocol, its other steps hidden, and the central net (van Glabbeek and Weijland, JACM 43, 1996). What is argued outside
the solver is said in docs/protocol-invariant.md.

Every obligation lies in a fragment that is decidable: all quantified variables that depend on others, and all
functions, go from places and transitions to controllers and rounds, and from none of these back (`fragment`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.parametric.fragment import dependencies, order
from firable.decompose.protocol.parametric.invariant import INVARIANT
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
    ACTIONS,
    APPLY,
    ASK,
    CLOSE,
    DECIDE,
    FIRE,
    GIVE_UP,
    HEAR,
    INITIAL,
    NOTE,
    PROMISE,
    RELEASE,
    STATIC,
    abort_order,
    acknowledgement,
    asked,
    begun,
    c,
    central_firable,
    closed_round,
    commit_order,
    coordinated,
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
    part_firable,
    promised,
    q,
    r,
    s,
    shadow,
    t,
    takes_part,
    u,
    vote,
)


@dataclass(frozen=True)
class ParametricObligation:
    """A claim about the protocol, proved iff its `script`, which denies it, cannot be true."""

    name: str
    statement: str
    script: Script

    @property
    def text(self) -> str:
        """The file, whose head says why it can be decided."""
        sorts = order(dependencies(self.script.formulas))
        assert sorts is not None, f"{self.name} is outside the decidable fragment"
        way = ", ".join(sort.name for sort in sorts)
        return self.script.text(f"Decidable, for functions and what depends on what go one way: {way}.")


def parametric_obligations() -> Iterator[ParametricObligation]:
    """Every obligation of the theorem; they are the same for every net."""
    yield _starts()
    for action in ACTIONS:
        yield _keeps(action)
    yield from _safety()
    yield from _homeward()
    yield from _complete()
    for action in ACTIONS:
        if action is not ASK and not action.fires:
            yield _advances(action)


def begin(name: str, statement: str, *, given: bool = True) -> Script:
    """A file with its head, what is assumed of every net, and, if `given`, the invariant."""
    script = Script(
        (
            f"protocol.{name} of the voting protocol, for any net and any number of controllers and rounds",
            f"To prove: {statement}.",
            "Asserted is that it does not hold, so the answer `unsat` proves it.",
        )
    )
    for words, formula in STATIC:
        script.add(formula, f"net: {words}")
    if given:
        for conjunct in INVARIANT:
            script.add(conjunct.sentence, f"invariant {conjunct.name}: {conjunct.words}")
    return script


def deny(script: Script, formula: Formula) -> None:
    """Assert that what is to be shown does not hold."""
    script.add(~formula, "and what is to be shown does not hold")


def whole_invariant() -> Formula:
    """All conjuncts together."""
    return both([conjunct.sentence for conjunct in INVARIANT])


def _starts() -> ParametricObligation:
    statement = "the invariant holds at the start"
    script = begin("starts", statement, given=False)
    for words, formula in INITIAL:
        script.add(formula, f"start: {words}")
    deny(script, whole_invariant())
    return ParametricObligation("starts", statement, script)


def _keeps(action: Action) -> ParametricObligation:
    name, statement = f"keeps.{action.name}", f"'{action.name}' keeps the invariant"
    script = begin(name, statement)
    script.step(action)
    deny(script, whole_invariant())
    return ParametricObligation(name, statement, script)


def _implied(
    name: str, statement: str, given: Formula, claim: Formula, by: Action | None = None
) -> ParametricObligation:
    """In each configuration of the invariant, `given` implies `claim`; or what `claim` says after the action `by`.

    The claim speaks of the moment after the action; what it says of the one before is marked `earlier`.
    """
    script = begin(name, statement)
    script.add(given, "given")
    if by is not None:
        script.change(by)
    deny(script, claim)
    return ParametricObligation(name, statement, script)


_none_underway: Final = forall(s)(decided(s).implies(closed_round(s)))
_none_open: Final = forall(s)(begun(s).implies(closed_round(s)))
_agree: Final = forall(q)(marked(q).iff(shadow(q)))


def _safety() -> Iterator[ParametricObligation]:
    for action in ACTIONS:
        if action.fires:
            yield _implied(
                f"follows.{action.name}",
                f"what fires at '{action.name}', the central net may fire then",
                both(list(action.guard)),
                central_firable(t),
            )
    yield _implied(
        "rest",
        "when every decided round is closed, the controllers hold the marking of the central net",
        _none_underway,
        _agree,
    )
    yield _implied(
        "once",
        "an order takes tokens that are there, and puts tokens on empty places",
        both(list(APPLY.guard)),
        forall(q)(same(owner(q), c).implies(input_of(t, q).implies(marked(q)) & output_of(t, q).implies(~marked(q)))),
    )
    yield _implied(
        "expected",
        "an order that was not obeyed finds its part promised and firable",
        commit_order(r, t, c) & ~obeyed(r, t, c),
        promised(r, t, c) & part_firable(t, c),
    )


def _may(action: Action) -> Formula:
    """The demands of an action, of the moment before it."""
    return earlier(both(list(action.guard)))


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


def _homeward() -> Iterator[ParametricObligation]:
    steps: tuple[tuple[Action, Formula, str], ...] = (
        (GIVE_UP, begun(r) & ~decided(r), "a round that is not decided can be given up"),
        (APPLY, commit_order(r, t, c) & ~obeyed(r, t, c), "an order to commit can be applied"),
        (RELEASE, abort_order(r, t, c) & ~obeyed(r, t, c), "an order to abort can be obeyed"),
        (NOTE, acknowledgement(r, t, c) & ~noted(r, t, c), "an acknowledgement can be noted"),
        (
            CLOSE,
            begun(r)
            & decided(r)
            & ~closed_round(r)
            & forall(u, d)((asked(r, u) & takes_part(u, d)).implies(noted(r, u, d))),
            "a round of which all acknowledgements are noted can be closed",
        ),
    )
    cases = [exists(*free_variables(case))(case) for _, case, _ in steps]
    yield _implied(
        "home.some",
        "as long as a round is open, one of the steps that lead home can be taken",
        begun(r) & ~closed_round(r),
        any_of(cases),
    )
    for action, case, words in steps:
        name, statement = f"home.{action.name}", f"{words}, and less is to be done then"
        yield _implied(name, statement, case, _may(action) & _less, by=action)


_opening: Final = (
    asked(r, t) & ~decided(r) & central_firable(t) & forall(s, u, d)(promised(s, u, d).implies(same(s, r))) & _agree
)
"""Round r asks for t, which the central net may fire, and no promise of another round stands."""


def _complete() -> Iterator[ParametricObligation]:
    everybody = forall(d)(takes_part(t, d).implies(heard(r, t, d)))
    steps: tuple[tuple[Action, Formula, Formula, str], ...] = (
        (
            ASK,
            _none_open & coordinated(t) & central_firable(t) & ~begun(r),
            _opening,
            "with no round open, a new one can ask for what the central net may fire",
        ),
        (
            PROMISE,
            _opening & takes_part(t, c) & ~promised(r, t, c),
            _opening & promised(r, t, c),
            "then each who takes part can promise its part",
        ),
        (HEAR, _opening & promised(r, t, c), _opening & heard(r, t, c), "then each vote can be heard"),
        (DECIDE, _opening & everybody, both([]), "then it can be decided"),
        (
            FIRE,
            _none_open & ~coordinated(t) & central_firable(t),
            both([]),
            "with no round open, a local transition that the central net may fire can fire",
        ),
    )
    for action, given, after, words in steps:
        yield _implied(f"complete.{action.name}", words, given, _may(action) & after, by=action)


def _advances(action: Action) -> ParametricObligation:
    name, statement = f"advances.{action.name}", f"'{action.name}' changes nothing, or makes something known for good"
    script = begin(name, statement)
    script.step(action)
    known = [
        begun(s) & relation(*formals_of(relation)) for relation in (vote, heard, decided, obeyed, noted, closed_round)
    ]
    lost_none = both([closed(earlier(fact).implies(fact)) for fact in known])
    gained = any_of([exists(*free_variables(fact))(fact & ~earlier(fact)) for fact in known])
    changed = [update.relation(*formals_of(update.relation)) for update in action.updates]
    unchanged = both([closed(fact.iff(earlier(fact))) for fact in changed])
    asked_no_more = closed(asked(s, u).implies(earlier(asked(s, u)))) & closed(begun(s).implies(earlier(begun(s))))
    deny(script, asked_no_more & (unchanged | (lost_none & gained)))
    return ParametricObligation(name, statement, script)
