"""Protocols that are wrong, each by one thing that an engineer might leave out, and a run that shows it.

A proof that no mistake breaks proves nothing. So each obligation O1 to O6 of SEMANTICS is taken out of the protocol by
itself, in each of the ways in which one would forget it; then some obligation of the theorem fails, and there
is a run from the start on a small net at whose end something is wrong:

- NOT_FOLLOWED: the last thing that fires, the central net cannot fire then;
- APART: every decided round is closed, and the controllers hold another marking than the central net;
- STUCK: every round is closed, and a promise still stands, which nobody will ever release.

With parts that are free of promise, what they assume of a net is taken away in the same manner, one condition after
the other: a part that is taken for one and is none.

Most of these are the folklore of distributed commit (Gray, Notes on data base operating systems, 1978; Bernstein,
Hadzilacos, Goodman, 1987, chapter 7), told of tokens. The actions of each run are given here, and what they happen
on is found (`runs`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from firable.decompose.protocol.parametric.logic import Definition, Formula, Variable, exists, forall, same
from firable.decompose.protocol.parametric.runs import (
    NOT_FOLLOWED,
    Run,
    before_last,
    central_marking,
    find_run,
    steps_of,
)
from firable.decompose.protocol.parametric.script import Action, Demand, Update
from firable.decompose.protocol.parametric.system import (
    GATES_TAKE_PART,
    PROTOCOL,
    Controller,
    Protocol,
    Round,
    Transition,
    abort_order,
    adds_where,
    asked,
    c,
    central_enabled,
    commit_order,
    coordinated,
    coordinator_of,
    d,
    home,
    input_of,
    k,
    marked,
    obeyed,
    owner,
    permissive_of,
    promised,
    q,
    r,
    reads,
    s,
    t,
    takes_part,
    u,
    vote,
    writes,
)
from firable.decompose.protocol.parametric.theorem import agree, none_open, none_underway

APART: Final = none_underway & ~agree
STUCK: Final = none_open & exists(s, u, d)(promised(s, u, d))

EARLIER: Final = Variable("e", Round)
"""The round of a message, where it is not asked whether it is the present one."""
_OTHER: Final = Variable("o", Transition)


@dataclass(frozen=True)
class Wrong:
    """A wrong protocol: what is forgotten, what it does instead, which obligations fail, and a run that goes wrong.

    `breaks` are obligations of the theorem that fail; there may be more. `given` holds at the start of the run.
    """

    name: str
    forgets: str
    words: str
    change: Callable[[Protocol], Protocol]
    breaks: tuple[str, ...]
    run: str
    places: int
    goal: Formula = NOT_FOLLOWED
    given: tuple[Formula, ...] = ()

    @property
    def protocol(self) -> Protocol:
        """The protocol, changed."""
        return self.change(PROTOCOL)


@dataclass(frozen=True)
class Refutation:
    """A run of a wrong protocol, and what is wrong at its end."""

    wrong: Wrong
    run: Run
    end: str


def refute(wrong: Wrong) -> Refutation | None:
    """A run that shows what is wrong, and that the reference player has confirmed; None where there is none."""
    run = find_run(wrong.protocol, steps_of(wrong.run), wrong.places, wrong.goal, wrong.given)
    if run is None:
        return None
    end = next(_end(wrong.goal, run), "")
    assert end, f"the reference player does not confirm the run of '{wrong.name}'"
    return Refutation(wrong, run, end)


def _end(goal: Formula, run: Run) -> Iterator[str]:
    """What the reference player says is wrong at the end."""
    if goal is NOT_FOLLOWED:
        if (played := before_last(run)) is None:
            return
        marking, signals = played
        last = run.net.transition(run.course[-1])
        wrong = [f"'{p}' is empty" for p in (*last.inputs, *last.permissive) if p not in marking]
        wrong += [f"'{p}' is full" for p in (*last.outputs, *last.inhibitive) if p in marking]
        wrong += [f"'{g.signal}' is {int(not g.wanted)}" for g in last.external if signals[g.signal] != g.wanted]
        if wrong:
            yield f"the central net cannot fire '{last.name}' then: {' and '.join(wrong)}"
        return
    central = central_marking(run)
    if central is None or set(central) != set(run.central):
        return
    if goal is STUCK:
        yield "every round is closed, and a promise still stands, which nobody will release"
    for place in run.local:
        if place not in central:
            yield f"the controllers hold a token on '{place}', and the central net does not"
    for place in central:
        if place not in run.local:
            yield f"the central net holds a token on '{place}', and the controllers do not"


# --- Ways to forget something


def _with(name: str, change: Callable[[Action], Action]) -> Callable[[Protocol], Protocol]:
    """One action changed."""
    return lambda protocol: replace(
        protocol,
        actions=tuple(change(action) if action.name == name else action for action in protocol.actions),
    )


def _all(*changes: Callable[[Protocol], Protocol]) -> Callable[[Protocol], Protocol]:
    def change(protocol: Protocol) -> Protocol:
        for one in changes:
            protocol = one(protocol)
        return protocol

    return change


def without(name: str, words: str) -> Callable[[Protocol], Protocol]:
    """An action without one of its demands, named by a piece of its words."""

    def change(action: Action) -> Action:
        kept = tuple(demand for demand in action.demands if words not in demand.words)
        assert len(kept) == len(action.demands) - 1, f"'{words}' names no demand of '{name}'"
        return replace(action, demands=kept)

    return _with(name, change)


def _instead(name: str, words: str, formula: Formula, *more: Variable) -> Callable[[Protocol], Protocol]:
    """An action with another formula for one of its demands, and with more parameters."""

    def change(action: Action) -> Action:
        demands = tuple(Demand(demand.words, formula) if words in demand.words else demand for demand in action.demands)
        assert demands != action.demands, f"'{words}' names no demand of '{name}'"
        return replace(action, demands=demands, parameters=(*action.parameters, *more))

    return _with(name, change)


def _without_update(name: str, of: str) -> Callable[[Protocol], Protocol]:
    return _with(
        name,
        lambda action: replace(action, updates=tuple(up for up in action.updates if up.relation.name != of)),
    )


def _covering(disturbed: Formula) -> Callable[[Protocol], Protocol]:
    """Promises that keep away only what disturbs them in this sense: t, at a place q, what is promised of u."""
    promises = Definition(
        "kept-away",
        (r, t, c),
        forall(s, u, q)((promised(s, u, c) & ~same(s, r) & same(owner(q), c)).implies(~disturbed)),
    )
    locally = Definition(
        "kept-away-locally",
        (t, c),
        forall(s, u, q)((promised(s, u, c) & same(owner(q), c)).implies(~disturbed)),
    )
    return _all(_instead("promise", "O1", promises(r, t, c)), _instead("fire", "O1", locally(t, home(t))))


def _not_asked(*words: str) -> Callable[[Protocol], Protocol]:
    """A protocol that does not ask of free parts what these words say."""

    def change(protocol: Protocol) -> Protocol:
        kept = tuple(its for its in protocol.static if not any(word in its[0] for word in words))
        assert len(kept) == len(protocol.static) - len(words), f"{words} name no conditions"
        return replace(protocol, static=kept)

    return change


def _gates_elsewhere_are_cached(protocol: Protocol) -> Protocol:
    moved = forall(u, q)((coordinated(u) & writes(u, q)).implies(takes_part(u, owner(q))))
    return replace(
        protocol,
        static=tuple((words, moved if words == GATES_TAKE_PART else formula) for words, formula in protocol.static),
    )


_inputs_only = Definition(
    "inputs-hold",
    (t, c),
    forall(q)(same(owner(q), c).implies((input_of(t, q) | permissive_of(t, q)).implies(marked(q)))),
)

_FORGOTTEN: Final = Action(
    "lose-memory",
    (c,),
    (),
    (Update(promised, (s, u, d), promised(s, u, d) & ~same(d, c)),),
    "{c} crashes and starts again, and its promises are gone",
)

_VOTES: Final = "ask r1 G; promise r1 G a; promise r1 G b; hear r1 G a; hear r1 G b"
_APPLIED: Final = f"{_VOTES}; decide r1 G; apply r1 G a; apply r1 G b; note r1 G a; note r1 G b; close r1"
_STANDING: Final = "ask r1 G; stand G a; stand G b"
_USED: Final = f"{_STANDING}; decide r1 G; apply-free r1 G a; apply-free r1 G b; note r1 G a; note r1 G b; close r1"
_G = Variable("G", Transition)

WRONG: Final = (
    Wrong(
        "cached-votes",
        "O1",
        "a vote is a report of what was firable, and promises nothing; orders are carried out blindly",
        _all(_without_update("promise", "promised"), _instead("apply", "it is promised", ~obeyed(r, t, c))),
        ("keeps.promise",),
        "ask r1 G; promise r1 G a; promise r1 G b; fire l; hear r1 G a; hear r1 G b; decide r1 G",
        3,
    ),
    Wrong(
        "promises-with-a-time-limit",
        "O1",
        "a promise ends by itself when no order comes for long",
        without("release", "order to abort"),
        ("keeps.release",),
        "ask r1 G; promise r1 G a; release r1 G a; fire l; promise r1 G b; hear r1 G a; hear r1 G b; decide r1 G",
        3,
    ),
    Wrong(
        "local-transitions-ignore-promises",
        "O1",
        "a local transition fires though a promise stands",
        without("fire", "O1"),
        ("keeps.fire", "follows.fire"),
        "ask r1 G; promise r1 G a; fire l; promise r1 G b; hear r1 G a; hear r1 G b; decide r1 G",
        3,
    ),
    Wrong(
        "unlocked-conflicts",
        "O1, O2",
        "a part is promised though it disturbs the promise of another round",
        without("promise", "O1"),
        ("keeps.promise",),
        f"{_VOTES}; ask r2 H; promise r2 H a; promise r2 H b; hear r2 H a; hear r2 H b; decide r1 G; decide r2 H",
        5,
    ),
    Wrong(
        "read-places-not-promised",
        "O1",
        "a promise keeps away only what writes the places that the part writes, not what writes its gates",
        _covering(writes(t, q) & writes(u, q)),
        ("keeps.promise", "keeps.fire", "follows.fire"),
        "ask r1 G; promise r1 G a; fire l; promise r1 G b; hear r1 G a; hear r1 G b; decide r1 G",
        4,
    ),
    Wrong(
        "written-places-may-be-read",
        "O1",
        "a promise keeps away what writes the places that the part reads, not what reads those that it will write",
        _covering(writes(t, q) & reads(u, q)),
        ("keeps.promise", "follows.fire"),
        f"{_VOTES}; decide r1 G; fire l",
        4,
    ),
    Wrong(
        "two-commits-in-a-round",
        "O2",
        "the arbiter of a group commits one more of the transitions that it asked for together",
        without("decide", "not decided"),
        ("keeps.decide", "follows.decide"),
        f"{_VOTES}; ask r1 H; promise r1 H a; promise r1 H b; hear r1 H a; hear r1 H b; decide r1 G; decide r1 H",
        5,
    ),
    Wrong(
        "cached-gates",
        "O3",
        "who owns only a gate takes no part, and the gate is read from a copy",
        _gates_elsewhere_are_cached,
        ("follows.decide",),
        "ask r1 G; promise r1 G a; promise r1 G b; fire l; hear r1 G a; hear r1 G b; decide r1 G",
        4,
        given=(central_enabled(_G), takes_part(Variable("l", Transition), Variable("c", Controller))),
    ),
    Wrong(
        "signals-change-under-promises",
        "O4",
        "a signal that a promise reads is taken into the process image at once",
        without("sense", "no promise"),
        ("keeps.sense",),
        "ask r1 G; promise r1 G a; sense s1; promise r1 G b; hear r1 G a; hear r1 G b; decide r1 G",
        2,
    ),
    Wrong(
        "votes-from-before-the-decision",
        "O5",
        "a vote counts in whatever round of its transition it arrives",
        _instead("hear", "a vote", vote(EARLIER, t, c), EARLIER),
        ("keeps.hear",),
        "ask r1 G; promise r1 G a; give-up r1; release r1 G a; fire l; ask r2 G; promise r2 G b; "
        "hear r2 G a r1; hear r2 G b r2; decide r2 G",
        3,
    ),
    Wrong(
        "orders-applied-twice",
        "O5",
        "an order that arrives again is carried out again",
        without("apply", "it is promised"),
        ("keeps.apply", "once"),
        f"{_APPLIED}; fire l; apply r1 G a",
        3,
        APART,
    ),
    Wrong(
        "orders-of-another-round",
        "O5",
        "a late order of an earlier round is taken for the one of the present round",
        _instead("apply", "the order", commit_order(EARLIER, t, c), EARLIER),
        ("keeps.apply",),
        f"{_APPLIED}; fire l; fire m; ask r2 G; promise r2 G a; apply r2 G a r1".replace(
            "apply r1 G a;", "apply r1 G a r1;"
        ).replace("apply r1 G b;", "apply r1 G b r1;"),
        4,
        APART,
    ),
    Wrong(
        "commit-without-all-votes",
        "O5",
        "the coordinator decides when the votes that have come are yes",
        without("decide", "voted yes"),
        ("keeps.decide", "follows.decide"),
        "ask r1 G; promise r1 G a; hear r1 G a; decide r1 G",
        3,
        given=(takes_part(_G, Variable("b", Controller)),),
    ),
    Wrong(
        "late-requests-promise",
        "O5",
        "a request is granted though its round has been decided",
        without("promise", "obeyed"),
        ("keeps.promise",),
        "ask r1 G; give-up r1; release r1 G a; release r1 G b; note r1 G a; note r1 G b; close r1; promise r1 G a",
        2,
        STUCK,
    ),
    Wrong(
        "given-up-after-the-commit",
        "O5",
        "the coordinator aborts a round that it has committed, because some do not answer",
        without("give-up", "not decided"),
        ("keeps.give-up",),
        f"{_VOTES}; decide r1 G; apply r1 G a; give-up r1; release r1 G b; note r1 G a; note r1 G b; close r1",
        2,
        APART,
    ),
    Wrong(
        "closed-before-all-have-obeyed",
        "O5",
        "the coordinator closes a round without waiting for the acknowledgements, and an order is lost",
        without("close", "obeyed"),
        ("keeps.close",),
        f"{_VOTES}; decide r1 G; apply r1 G a; close r1; forget r1 b",
        2,
        APART,
    ),
    Wrong(
        "promises-not-in-stable-storage",
        "O6",
        "a controller that crashes forgets what it has promised",
        lambda protocol: replace(protocol, actions=(*protocol.actions, _FORGOTTEN)),
        ("keeps.lose-memory",),
        "ask r1 G; promise r1 G a; lose-memory a; fire l; promise r1 G b; hear r1 G a; hear r1 G b; decide r1 G",
        3,
    ),
    Wrong(
        "decisions-not-in-stable-storage",
        "O6",
        "a coordinator that crashes forgets what it has decided, and gives up every round that it has begun",
        _with(
            "restart",
            lambda action: replace(
                action,
                updates=(
                    action.updates[0],
                    adds_where(abort_order, asked(s, u) & takes_part(u, d) & same(coordinator_of(s), k)),
                ),
            ),
        ),
        ("keeps.restart",),
        f"{_VOTES}; decide r1 G; apply r1 G a; restart k1; release r1 G b; note r1 G a; note r1 G b; close r1",
        2,
        APART,
    ),
    Wrong(
        "rounds-of-one-number",
        "O8",
        "each coordinator numbers its rounds, and an abort of one is taken for that of another one's round",
        _instead(
            "release",
            "the order to abort",
            abort_order(EARLIER, _OTHER, c) & ~same(coordinator_of(EARLIER), coordinator_of(r)),
            *(EARLIER, _OTHER),
        ),
        ("keeps.release",),
        f"{_VOTES}; ask r2 H; give-up r2; release r1 G a r2 H; fire l; decide r1 G",
        4,
    ),
    Wrong(
        "filled-outputs-not-looked-at",
        "Eq. (5)",
        "a part is promised though its output place is full, as Eq. (5) reads without its bars",
        _instead("promise", "enabled", _inputs_only(t, c)),
        ("keeps.promise",),
        f"{_VOTES}; decide r1 G",
        2,
    ),
    Wrong(
        "votes-that-are-taken-back",
        "O1, free",
        "a part is free of promise though its vote is not persistent",
        lambda protocol: replace(protocol, persistent=False),
        ("persists.fire", "persists.decide"),
        f"{_STANDING}; fire l; decide r1 G",
        5,
    ),
    Wrong(
        "inputs-of-free-parts-read-by-others",
        "O1, free",
        "a part is free of promise though others read what it will take, before the order comes",
        _not_asked("takes an input of a free part"),
        ("keeps.fire", "follows.fire"),
        f"{_STANDING}; decide r1 G; fire l",
        5,
    ),
    Wrong(
        "outputs-of-free-parts-read-by-others",
        "O1, free",
        "a part is free of promise though others read what it will fill, before the order comes",
        _not_asked("fills an output of a free part"),
        ("keeps.fire", "follows.fire"),
        f"{_STANDING}; decide r1 G; fire l",
        5,
    ),
    Wrong(
        "votes-while-a-promise-stands",
        "O1, free",
        "a controller votes on a free part that what it has promised will disturb",
        without("stand", "O1"),
        ("keeps.stand",),
        "ask r1 H; promise r1 H a; promise r1 H b; hear r1 H a; hear r1 H b; decide r1 H; "
        "ask r2 G; stand G a; stand G b; decide r2 G",
        6,
    ),
    Wrong(
        "free-parts-that-wait-for-sensors",
        "O4, free",
        "a part is free of promise though it reads a signal that may change before the order comes",
        _not_asked("of signals a free part reads"),
        ("keeps.sense",),
        f"{_STANDING}; sense s1; decide r1 G",
        4,
    ),
    Wrong(
        "used-votes-counted-again",
        "O5, free",
        "a standing vote from before the last firing counts for the next one",
        _without_update("apply-free", "stands"),
        ("keeps.apply-free",),
        f"{_USED}; ask r2 G; decide r2 G",
        4,
    ),
    Wrong(
        "votes-counted-before-the-order-is-obeyed",
        "O5, free",
        "a standing vote counts though the order that uses it up has not been acknowledged",
        without("decide", "unacknowledged"),
        ("keeps.decide", "follows.decide"),
        f"{_STANDING}; decide r1 G; ask r2 G; decide r2 G",
        4,
    ),
    Wrong(
        "free-parts-applied-twice",
        "O5, free",
        "an order to a free part that arrives again is carried out again",
        without("apply-free", "obeyed"),
        ("keeps.apply-free",),
        f"{_USED}; fire l; apply-free r1 G a",
        4,
        APART,
    ),
    Wrong(
        "free-parts-not-waited-for",
        "O5, free",
        "a transition is decided though a free part has not voted",
        without("decide", "stand"),
        ("keeps.decide", "follows.decide"),
        f"{_USED}; fire l; ask r2 G; stand G a; decide r2 G",
        5,
    ),
    Wrong(
        "decided-by-two-coordinators",
        "O8, free",
        "a transition of which parts are free is decided by two coordinators, neither knowing of the other's order",
        without("ask", "decides it"),
        ("keeps.ask",),
        "ask r1 G; ask r2 G; stand G a; stand G b; decide r1 G; decide r2 G",
        4,
    ),
)
"""The wrong protocols, in the order of the obligations that they forget; last those with parts free of promise."""
