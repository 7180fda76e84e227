"""The protocol as a transition system: what there is, what may happen, for any net, any split, any number of rounds.

One line of this file is one sentence about the protocol; the invariant (`invariant`) and what is proved (`theorem`)
are about these lines, and the tests hold them to the machines that run the cell (`firable.executor`).

**What there is.** Places, transitions, controllers and rounds. Each place has an owner. A transition is *coordinated*,
or a local one of the controller that is its home. The part of a transition at a controller is what it has of places
there; so the arcs and gates are those of the central net, and that the subnets hold just these is a condition on
each decomposition (`side_conditions`).

**Signals.** To the protocol a signal, as the process image of its owner has it, is a place that the cell fills and
empties (`sense`): an external gate reads it as an internal one reads a place, and a command that it completes clears
it. That two commands clear one signal keeps neither promise from the other: cleared twice is cleared. A change of a
signal that a promise reads or clears is kept out of the image until the promise ends, so here it happens later.
What is proved is thus Eq. (1) *and* (2), of the images that the controllers have at one instant. That an image tells
the truth about the cell is assumed (O4).

**Rounds.** Coordinators ask for transitions in rounds, each decided once: with one transition committed, or with none.
A round is that of one coordinator, of which there are any number, beside or above each other: none knows what another
one has open, and nothing is asked of who decides what. Any number of rounds may be open at once, of one arbitration
group or of several, and a round may ask for any transitions: the proof needs no groups, because parts that conflict
disturb each other, and a promise in one round refuses those of others, whoever decides them. What was asked together is
told apart by the one commit of each round.

**Messages.** A message, once sent, is in a set that only grows, and whoever reads the set may act on it at any time,
again and again, or never. So each message may be lost, doubled, delayed and overtaken, without limit, and no fault has
to be an action of its own; to repeat a message changes nothing. This is the classical treatment of a channel
that is bad in every way (Lamport, Specifying Systems; Padon et al., Ivy, PLDI 2016).

**Crashes.** A controller that crashes does nothing for a while, or for ever; its memory is stable (O6). So its crash
changes nothing here, and whatever it might do stays possible after its restart. A coordinator that crashes keeps what
it has decided and gives up the rest of its rounds (`restart`).

**What fires when.** `shadow` is the marking of the central net: it fires at a commit and at each local firing, and has
the signals of the images. All that is proved compares it with `marked`, what the controllers hold.

Rejected: channels as bags with actions that lose and double; they need counting, of which first-order logic is not
capable, and show nothing more. Rounds as numbers: nothing is ever asked of them but whether they are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.parametric.logic import (
    Definition,
    Formula,
    Function,
    Relation,
    Sort,
    Term,
    Variable,
    both,
    forall,
    same,
)
from firable.decompose.protocol.parametric.script import Action, Demand, Update

# --- What there is

Place, Transition, Controller, Round = Sort("Place"), Sort("Transition"), Sort("Controller"), Sort("Round")
Coordinator = Sort("Coordinator")

p, t, c, r = Variable("p", Place), Variable("t", Transition), Variable("c", Controller), Variable("r", Round)
k = Variable("k", Coordinator)
"""Parameters of actions."""
q, u, d, s = Variable("q", Place), Variable("u", Transition), Variable("d", Controller), Variable("s", Round)
"""Whatever else there is of the sorts."""

owner = Function("owner", Place, Controller)
home = Function("home", Transition, Controller)
coordinator_of = Function("coordinator-of", Round, Coordinator)  # so no two rounds of theirs have one name
coordinated = Relation("coordinated", (Transition,))
input_of = Relation("input", (Transition, Place))
output_of = Relation("output", (Transition, Place))
permissive_of = Relation("permissive", (Transition, Place))
inhibitive_of = Relation("inhibitive", (Transition, Place))
takes_part = Relation("takes-part", (Transition, Controller))
clears = Relation("clears", (Transition, Place))  # a signal, because it completes a command that is sent then
signal = Relation("signal", (Place,))
initially = Relation("initially", (Place,))

writes = Definition("writes", (t, p), input_of(t, p) | output_of(t, p) | clears(t, p))
reads = Definition("reads", (t, p), input_of(t, p) | output_of(t, p) | permissive_of(t, p) | inhibitive_of(t, p))
touches = Definition("touches", (t, p), reads(t, p) | writes(t, p))
disturb = Definition(  # firing one could change what the other reads
    "disturb-at", (t, u, p), (writes(t, p) & reads(u, p)) | (reads(t, p) & writes(u, p))
)

GATES_TAKE_PART: Final = "who owns a place that a coordinated transition moves or reads takes part in it (O3)"

STATIC: Final[tuple[tuple[str, Formula], ...]] = (
    (GATES_TAKE_PART, forall(u, q)((coordinated(u) & touches(u, q)).implies(takes_part(u, owner(q))))),
    (
        "a local transition moves and reads places of its home alone",
        forall(u, q)((~coordinated(u) & touches(u, q)).implies(same(owner(q), home(u)))),
    ),
)
"""What is assumed of every net and its split, and checked of each."""

# --- What changes

marked = Relation("marked", (Place,), moves=True)
shadow = Relation("shadow", (Place,), moves=True)
# The coordinator: which rounds it has begun, what they ask for, whose votes it has, what it decided, who has obeyed.
begun = Relation("begun", (Round,), moves=True)
asked = Relation("asked", (Round, Transition), moves=True)
heard = Relation("heard", (Round, Transition, Controller), moves=True)
decided = Relation("decided", (Round,), moves=True)
committed = Relation("committed", (Round, Transition), moves=True)
noted = Relation("noted", (Round, Transition, Controller), moves=True)
closed_round = Relation("closed", (Round,), moves=True)
# A controller: the parts that it has promised, and those whose order it has obeyed.
promised = Relation("promised", (Round, Transition, Controller), moves=True)
obeyed = Relation("obeyed", (Round, Transition, Controller), moves=True)
# Messages, once sent.
request = Relation("request", (Round, Transition, Controller), moves=True)
vote = Relation("vote", (Round, Transition, Controller), moves=True)
commit_order = Relation("commit-order", (Round, Transition, Controller), moves=True)
abort_order = Relation("abort-order", (Round, Transition, Controller), moves=True)
acknowledgement = Relation("acknowledgement", (Round, Transition, Controller), moves=True)

MOVING: Final = (
    *(marked, shadow, begun, asked, heard, decided, committed, noted, closed_round, promised, obeyed),
    *(request, vote, commit_order, abort_order, acknowledgement),
)
"""All that steps change: a configuration is what these hold of."""


def _enabled(tokens: Relation, of: Variable, at: Variable) -> Formula:
    """Eq. (1)-(2) at one place: an input or permissive gate needs a token, an output or inhibitive gate none."""
    full = (input_of(of, at) | permissive_of(of, at)).implies(tokens(at))
    empty = (output_of(of, at) | inhibitive_of(of, at)).implies(~tokens(at))
    return full & empty


part_enabled = Definition(  # Eq. (1)-(2) of a part, in the subnet of its controller
    "part-enabled", (t, c), forall(q)(same(owner(q), c).implies(_enabled(marked, t, q)))
)
central_enabled = Definition("central-enabled", (t,), forall(q)(_enabled(shadow, t, q)))


def _fired(tokens: Relation, of: Variable, at: Variable) -> Formula:
    """Eq. (3)-(4): the token of a place after a firing; a signal of a command is cleared."""
    return output_of(of, at) | (tokens(at) & ~input_of(of, at) & ~clears(of, at))


undisturbed = Definition(  # O1, of a part of round r and the promises given in other rounds
    "undisturbed",
    (r, t, c),
    forall(s, u, q)((promised(s, u, c) & ~same(s, r) & same(owner(q), c)).implies(~disturb(t, u, q))),
)
undisturbed_locally = Definition(  # O1, of a local transition and all promises
    "undisturbed-locally",
    (t, c),
    forall(s, u, q)((promised(s, u, c) & same(owner(q), c)).implies(~disturb(t, u, q))),
)

# --- What may happen
#
# Every demand is needed: without any one of them the proof fails (tests/decompose/test_parametric_wrong.py). Only that
# it is signals which the cell changes by itself is no demand of the proof. The executor demands more here and there, as
# that a vote counts only before the decision, which changes nothing.


def _is(formals: tuple[Variable, ...], terms: tuple[Term, ...]) -> Formula:
    return both([same(formal, term) for formal, term in zip(formals, terms, strict=True)])


def formals_of(relation: Relation) -> tuple[Variable, ...]:
    """Variables for the places of a relation."""
    by_sort = {Place: q, Transition: u, Controller: d, Round: s}
    return tuple(by_sort[sort] for sort in relation.sorts)


def adds(relation: Relation, *terms: Term) -> Update:
    """From now on the relation holds of these, too."""
    formals = formals_of(relation)
    return Update(relation, formals, relation(*formals) | _is(formals, terms))


def removes(relation: Relation, *terms: Term) -> Update:
    """From now on the relation does not hold of these."""
    formals = formals_of(relation)
    return Update(relation, formals, relation(*formals) & ~_is(formals, terms))


def adds_where(relation: Relation, formula: Formula) -> Update:
    """From now on the relation holds, too, where the formula does; the free variables are q, u, d, s."""
    formals = formals_of(relation)
    return Update(relation, formals, relation(*formals) | formula)


def shadow_fires(of: Variable) -> Update:
    """The central net fires."""
    return Update(shadow, (q,), _fired(shadow, of, q))


def part_applied(of: Variable, at: Term) -> Update:
    """The subnet of a controller fires a part: of its own places alone."""
    own = same(owner(q), at)
    return Update(marked, (q,), (own & _fired(marked, of, q)) | (~own & marked(q)))


_stop_all = abort_order(s, u, d) | (asked(s, u) & takes_part(u, d) & ~decided(s) & same(coordinator_of(s), k))

ASK: Final = Action(
    "ask",
    (r, t),
    (
        Demand("the coordinator decides it", coordinated(t)),
        Demand("the round is not decided", ~decided(r)),
    ),
    (
        adds(begun, r),
        adds(asked, r, t),
        adds_where(request, same(s, r) & same(u, t) & takes_part(t, d)),
    ),
    "the coordinator asks for {t} in {r}",
)
PROMISE: Final = Action(
    "promise",
    (r, t, c),
    (
        Demand("a request of the round has arrived", request(r, t, c)),
        Demand("no order of the round has been obeyed", ~obeyed(r, t, c)),
        Demand("the part is enabled in the subnet", part_enabled(t, c)),
        Demand("no promise of another round is disturbed (O1)", undisturbed(r, t, c)),
    ),
    (adds(promised, r, t, c), adds(vote, r, t, c)),
    "{c} promises {t} in {r}, and votes yes",
)
HEAR: Final = Action(
    "hear",
    (r, t, c),
    (Demand("a vote of the round has arrived", vote(r, t, c)),),
    (adds(heard, r, t, c),),
    "the vote of {c} for {t} in {r} arrives",
)
DECIDE: Final = Action(
    "decide",
    (r, t),
    (
        Demand("the round asks for it", asked(r, t)),
        Demand("the round is not decided", ~decided(r)),
        Demand("all who take part have voted yes", forall(d)(takes_part(t, d).implies(heard(r, t, d)))),
    ),
    (
        adds(decided, r),
        adds(committed, r, t),
        adds_where(commit_order, same(s, r) & same(u, t) & takes_part(t, d)),
        adds_where(abort_order, same(s, r) & asked(r, u) & ~same(u, t) & takes_part(u, d)),
        shadow_fires(t),
    ),
    "the coordinator decides {t} in {r}: it fires",
    fires=True,
)
GIVE_UP: Final = Action(
    "give-up",
    (r,),
    (
        Demand("the round is begun", begun(r)),
        Demand("the round is not decided", ~decided(r)),
    ),
    (
        adds(decided, r),
        adds_where(abort_order, same(s, r) & asked(r, u) & takes_part(u, d)),
    ),
    "the coordinator gives {r} up",
)
RESTART: Final = Action(
    "restart",
    (k,),
    (),
    (
        adds_where(decided, begun(s) & same(coordinator_of(s), k)),
        Update(abort_order, (s, u, d), _stop_all),
    ),
    "the coordinator {k} crashes, starts again, and gives up all of its rounds that are not decided",
)
APPLY: Final = Action(
    "apply",
    (r, t, c),
    (
        Demand("the order to commit has arrived", commit_order(r, t, c)),
        Demand("it is promised", promised(r, t, c)),
    ),
    (
        part_applied(t, c),
        removes(promised, r, t, c),
        adds(obeyed, r, t, c),
        adds(acknowledgement, r, t, c),
    ),
    "the order for {t} in {r} arrives at {c}, which applies its part",
)
RELEASE: Final = Action(
    "release",
    (r, t, c),
    (Demand("the order to abort has arrived", abort_order(r, t, c)),),
    (removes(promised, r, t, c), adds(obeyed, r, t, c), adds(acknowledgement, r, t, c)),
    "the abort of {t} in {r} arrives at {c}",
)
NOTE: Final = Action(
    "note",
    (r, t, c),
    (Demand("an acknowledgement of the round has arrived", acknowledgement(r, t, c)),),
    (adds(noted, r, t, c),),
    "{c} has obeyed the order for {t} in {r}, and the coordinator hears of it",
)
CLOSE: Final = Action(
    "close",
    (r,),
    (
        Demand("the round is decided", decided(r)),
        Demand(
            "all who were asked have obeyed", forall(u, d)((asked(r, u) & takes_part(u, d)).implies(noted(r, u, d)))
        ),
    ),
    (adds(closed_round, r),),
    "the coordinator closes {r}",
)
FORGET: Final = Action(
    "forget",
    (r, c),
    (Demand("a message says that the round is closed", closed_round(r)),),
    (adds_where(obeyed, same(s, r) & same(d, c)),),
    "{c} hears that {r} is closed, and forgets it",
)
FIRE: Final = Action(
    "fire",
    (t,),
    (
        Demand("it is local", ~coordinated(t)),
        Demand("it is enabled in the subnet of its home", part_enabled(t, home(t))),
        Demand("no promise is disturbed (O1)", undisturbed_locally(t, home(t))),
    ),
    (part_applied(t, home(t)), shadow_fires(t)),
    "the local transition {t} fires",
    fires=True,
)

SENSE: Final = Action(
    "sense",
    (p,),
    (
        Demand("it is a signal", signal(p)),
        Demand("no promise reads or clears it", forall(s, u)(promised(s, u, owner(p)).implies(~touches(u, p)))),
    ),
    tuple(Update(tokens, (q,), (same(q, p) & ~tokens(q)) | (~same(q, p) & tokens(q))) for tokens in (marked, shadow)),
    "the signal {p} changes",
)


@dataclass(frozen=True)
class Protocol:
    """A protocol: what it assumes of the net, and what may happen."""

    static: tuple[tuple[str, Formula], ...]
    actions: tuple[Action, ...]

    def action(self, name: str) -> Action:
        """The action of a name; `KeyError` where there is none."""
        return {action.name: action for action in self.actions}[name]


PROTOCOL: Final = Protocol(
    STATIC, (ASK, PROMISE, HEAR, DECIDE, GIVE_UP, RESTART, APPLY, RELEASE, NOTE, CLOSE, FORGET, FIRE, SENSE)
)
"""The protocol of the executor."""

INITIAL: Final[tuple[tuple[str, Formula], ...]] = (
    ("the subnets hold the initial marking", forall(q)(marked(q).iff(initially(q)))),
    ("the central net holds it too", forall(q)(shadow(q).iff(initially(q)))),
    *(
        (f"nothing is {relation.name}", forall(*formals_of(relation))(~relation(*formals_of(relation))))
        for relation in MOVING
        if relation not in (marked, shadow)
    ),
)
