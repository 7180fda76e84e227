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

**Parts free of promise.** A part may be `free`: it is not asked in a round. Its controller votes whenever the part is
enabled, and the vote `stands` until an order for it is applied; nothing is promised, and the decision is taken on the
standing vote, if the last order to the part has been acknowledged: a vote from before that firing is used up. What is
asked of such a part and its net is `FREE` and, of what fires, `TAKES_NONE_BACK`: that its yes is persistent. Between
its decision and its order others at its controller go on, and see the marking from before it; `FREE` says that they do
no more then than they may.

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
    closed,
    exists,
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
decider = Function("decider", Transition, Coordinator)
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
free = Relation("free", (Transition, Controller))  # the part needs no promise
lasting = Relation("lasting", (Place,))  # a signal that falls by a command alone: a completion
behind = Relation("behind", (Transition, Transition, Controller))
"""The first needs a place of the controller full that the second fills."""

writes = Definition("writes", (t, p), input_of(t, p) | output_of(t, p) | clears(t, p))
reads = Definition("reads", (t, p), input_of(t, p) | output_of(t, p) | permissive_of(t, p) | inhibitive_of(t, p))
touches = Definition("touches", (t, p), reads(t, p) | writes(t, p))
disturb = Definition(  # firing one could change what the other reads
    "disturb-at", (t, u, p), (writes(t, p) & reads(u, p)) | (reads(t, p) & writes(u, p))
)

GATES_TAKE_PART: Final = "who owns a place that a coordinated transition moves or reads takes part in it (O3)"

falsifies = Definition(  # firing one makes what the other needs at a place false
    "falsifies-at",
    (t, u, p),
    ((input_of(t, p) | clears(t, p)) & (input_of(u, p) | permissive_of(u, p)))
    | (output_of(t, p) & (output_of(u, p) | inhibitive_of(u, p))),
)

_beside = free(t, c) & same(owner(p), c) & ~same(t, u)
"""Of a free part and a place of its controller: what another transition does there."""
FREE: Final[tuple[tuple[str, Formula], ...]] = (
    ("a part that is free of promise is one of a coordinated transition", (
        closed(free(t, c).implies(coordinated(t) & takes_part(t, c))))),
    ("no other transition takes an input of a free part, or reads it full", (
        closed((_beside & input_of(t, p)).implies(~input_of(u, p) & ~permissive_of(u, p))))),
    ("no other transition fills an output of a free part, or reads it empty", (
        closed((_beside & output_of(t, p)).implies(~output_of(u, p) & ~inhibitive_of(u, p))))),
    ("who reads a signal that a free part clears needs a place full that it fills", (
        closed((_beside & clears(t, p) & reads(u, p)).implies(behind(u, t, c))))),
    ("what a command clears is a signal", closed(clears(t, p).implies(signal(p)))),
    ("of signals a free part reads such alone, at 1, as fall by a command", (
        closed((free(t, c) & same(owner(p), c) & signal(p)).implies(
            ~input_of(t, p) & ~output_of(t, p) & ~inhibitive_of(t, p) & permissive_of(t, p).implies(lasting(p)))))),
)  # fmt: skip
"""What is assumed of every part that is free of promise, and checked of each."""

STATIC: Final[tuple[tuple[str, Formula], ...]] = (
    (GATES_TAKE_PART, forall(u, q)((coordinated(u) & touches(u, q)).implies(takes_part(u, owner(q))))),
    (
        "a local transition moves and reads places of its home alone",
        forall(u, q)((~coordinated(u) & touches(u, q)).implies(same(owner(q), home(u)))),
    ),
    *FREE,
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
stands = Relation("stands", (Transition, Controller), moves=True)
"""The controller has voted yes on a free part, and has not applied an order for it since."""
# Messages, once sent.
request = Relation("request", (Round, Transition, Controller), moves=True)
vote = Relation("vote", (Round, Transition, Controller), moves=True)
commit_order = Relation("commit-order", (Round, Transition, Controller), moves=True)
abort_order = Relation("abort-order", (Round, Transition, Controller), moves=True)
acknowledgement = Relation("acknowledgement", (Round, Transition, Controller), moves=True)

MOVING: Final = (
    *(marked, shadow, begun, asked, heard, decided, committed, noted, closed_round, promised, obeyed, stands),
    *(request, vote, commit_order, abort_order, acknowledgement),
)
"""All that steps change: a configuration is what these hold of."""


def enabled_at(tokens: Relation, of: Variable, at: Variable) -> Formula:
    """Eq. (1)-(2) at one place: an input or permissive gate needs a token, an output or inhibitive gate none."""
    full = (input_of(of, at) | permissive_of(of, at)).implies(tokens(at))
    empty = (output_of(of, at) | inhibitive_of(of, at)).implies(~tokens(at))
    return full & empty


part_enabled = Definition(  # Eq. (1)-(2) of a part, in the subnet of its controller
    "part-enabled", (t, c), forall(q)(same(owner(q), c).implies(enabled_at(marked, t, q)))
)
central_enabled = Definition("central-enabled", (t,), forall(q)(enabled_at(shadow, t, q)))


def _fired(tokens: Relation, of: Variable, at: Variable) -> Formula:
    """Eq. (3)-(4): the token of a place after a firing; a signal of a command is cleared."""
    return output_of(of, at) | (tokens(at) & ~input_of(of, at) & ~clears(of, at))


undisturbed = Definition(  # O1, of a part of round r and the promises given in other rounds
    "undisturbed",
    (r, t, c),
    forall(s, u, q)((promised(s, u, c) & ~same(s, r) & same(owner(q), c)).implies(~disturb(t, u, q))),
)
undisturbed_locally = Definition(  # O1, of a local transition or a free part, and all promises
    "undisturbed-locally",
    (t, c),
    forall(s, u, q)((promised(s, u, c) & same(owner(q), c)).implies(~disturb(t, u, q))),
)

underway = Definition(  # the order to a free part is decided, and not yet applied
    "underway", (r, t, c), committed(r, t) & free(t, c) & ~obeyed(r, t, c)
)
counts = Definition(  # a standing vote from after the last order was applied
    "counts", (t, c), stands(t, c) & ~exists(s)(underway(s, t, c))
)
TAKES_NONE_BACK: Final = forall(u, d, q)((counts(u, d) & ~same(u, t) & same(owner(q), d)).implies(~falsifies(t, u, q)))
"""What fires takes no standing vote of another transition back: persistence, at the moment of a firing (`theorem`)."""

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


def asks(of: Variable, at: Variable) -> Formula:
    """Who is asked in a round: who takes part and has to promise."""
    return takes_part(of, at) & ~free(of, at)


_stop_all = abort_order(s, u, d) | (asked(s, u) & asks(u, d) & ~decided(s) & same(coordinator_of(s), k))

ASK: Final = Action(
    "ask",
    (r, t),
    (
        Demand("it is coordinated", coordinated(t)),
        Demand("the round is one of the coordinator that decides it", same(coordinator_of(r), decider(t))),
        Demand("the round is not decided", ~decided(r)),
    ),
    (
        adds(begun, r),
        adds(asked, r, t),
        adds_where(request, same(s, r) & same(u, t) & asks(t, d)),
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
STAND: Final = Action(
    "stand",
    (t, c),
    (
        Demand("the part is free of promise", free(t, c)),
        Demand("the part is enabled in the subnet", part_enabled(t, c)),
        Demand("no promise is disturbed (O1)", undisturbed_locally(t, c)),
    ),
    (adds(stands, t, c),),
    "{c} votes yes on {t}, and promises nothing",
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
        Demand("all who have to promise have voted yes", forall(d)(asks(t, d).implies(heard(r, t, d)))),
        Demand("the votes of free parts stand", forall(d)(free(t, d).implies(stands(t, d)))),
        Demand(
            "no earlier order of it to a free part is unacknowledged",
            forall(s, d)(
                (free(t, d) & committed(s, t) & same(coordinator_of(s), coordinator_of(r))).implies(noted(s, t, d))
            ),
        ),
    ),
    (
        adds(decided, r),
        adds(committed, r, t),
        adds_where(commit_order, same(s, r) & same(u, t) & takes_part(t, d)),
        adds_where(abort_order, same(s, r) & asked(r, u) & ~same(u, t) & asks(u, d)),
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
        adds_where(abort_order, same(s, r) & asked(r, u) & asks(u, d)),
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
APPLY_FREE: Final = Action(
    "apply-free",
    (r, t, c),
    (
        Demand("the order to commit has arrived", commit_order(r, t, c)),
        Demand("the part is free of promise", free(t, c)),
        Demand("no order of the round has been obeyed", ~obeyed(r, t, c)),
    ),
    (
        part_applied(t, c),
        removes(stands, t, c),
        adds(obeyed, r, t, c),
        adds(acknowledgement, r, t, c),
    ),
    "the order for {t} in {r} arrives at {c}, which applies its part and is free to vote on it again",
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
            "all who got an order have obeyed",
            forall(u, d)((asked(r, u) & takes_part(u, d) & (~free(u, d) | committed(r, u))).implies(noted(r, u, d))),
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
        Demand("it does not fall where only a command may clear it", ~(lasting(p) & marked(p))),
        Demand(
            "no free part that is decided and not yet applied clears it",
            forall(s, u)(underway(s, u, owner(p)).implies(~clears(u, p))),
        ),
    ),
    tuple(Update(tokens, (q,), (same(q, p) & ~tokens(q)) | (~same(q, p) & tokens(q))) for tokens in (marked, shadow)),
    "the signal {p} changes",
)
SENSE_LATE: Final = Action(
    "sense-late",
    (r, t, p),
    (
        Demand("it is a signal", signal(p)),
        Demand("a free part that is decided and not yet applied clears it", underway(r, t, owner(p)) & clears(t, p)),
    ),
    (Update(marked, (q,), (same(q, p) & ~marked(q)) | (~same(q, p) & marked(q))),),
    "the signal {p} changes, which the firing of {t} in {r} has cleared, and its order is still to clear",
)
"""The other case of `sense`, of a signal that the central net has cleared already."""


@dataclass(frozen=True)
class Protocol:
    """A protocol: what it assumes of the net, and what may happen.

    With `persistent` it assumes, too, that the votes of parts that are free of promise are: of the markings that the
    central net reaches, not of its arcs.
    """

    static: tuple[tuple[str, Formula], ...]
    actions: tuple[Action, ...]
    persistent: bool = True

    def action(self, name: str) -> Action:
        """The action of a name; `KeyError` where there is none."""
        return {action.name: action for action in self.actions}[name]


PROTOCOL: Final = Protocol(
    STATIC,
    (
        *(ASK, PROMISE, STAND, HEAR, DECIDE, GIVE_UP, RESTART, APPLY, APPLY_FREE, RELEASE, NOTE, CLOSE, FORGET),
        *(FIRE, SENSE, SENSE_LATE),
    ),
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
