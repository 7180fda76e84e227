"""Contact, deadlock, liveness, reversibility, home and doomed markings: what the state space says by its shape.

All are the definitions of SEMANTICS, decided on any state space:

- a transition is *live* iff from every reachable marking one can be reached in which it may fire;
- the net is *reversible* iff M0 can be reached from every reachable marking;
- a *home marking* can be reached from every reachable marking: the markings of the bottom component, if there is only
  one;
- a marking is *doomed* iff every run from it ends in a deadlock, whatever is chosen: no cycle can be reached from it. A
  deadlock is doomed itself. The alternative reading, "M0 cannot be reached again", condemns every start-up phase.

Each violation comes with a shortest firing sequence: into the deadlock, to the first marking in contact, to the first
marking from which the transition can never fire again. For a doomed marking that is the point of no return: the last
firing of the sequence is the mistake.

Weights. Contact, deadlock and a dead transition are defects of a controller and fail it. A transition that can fire
only during start-up is legal but rare, so liveness warns; so do doomed markings, which repeat the deadlock's
violation at the place where it can still be mended. Reversibility and home markings inform.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Generic

from firable.analysis.question import Answer, Question, listed, no, yes
from firable.analysis.spaces.space import S, StateSpace, WitnessError
from firable.nets.verdict import Verdict, Weight, Witness, spelled
from firable.semantics.algebra import BOOL
from firable.semantics.firing import in_contact
from firable.semantics.player import holds_in

CONTACT_FREE: Final = Question(
    "contact-free",
    "no transition is held back only by a full output place",
    hint=(
        "an ordinary net would put a second token there: it is not 1-safe, and here the transition waits instead; "
        "take a place that is free when the output place is empty as an input, or check the arcs"
    ),
)
DEADLOCK_FREE: Final = Question(
    "deadlock-free",
    "in every reachable marking some transition is firable, external gates free",
    hint="the sequence leads into the deadlock; `doomed-markings` shows where it can no longer be avoided",
)
QUASI_LIVE: Final = Question(
    "quasi-live",
    "no transition is dead: each can fire at least once",
    hint="check its inputs and gates; a place that is only read is a permissive gate, not an input and an output",
)
LIVE: Final = Question(
    "live",
    "from every reachable marking every transition can fire again, external gates free",
    Weight.WARNING,
    hint="right for what happens only at start-up; otherwise this part of the cell is lost for good",
)
REVERSIBLE: Final = Question(
    "reversible", "the initial marking can be reached from every reachable marking", Weight.INFORMATION
)
HOME_MARKINGS: Final = Question(
    "home-markings", "some marking can be reached from every reachable marking", Weight.INFORMATION
)
NO_DOOMED: Final = Question(
    "doomed-markings",
    "no reachable marking is doomed: a deadlock can still be avoided from each",
    Weight.WARNING,
    hint="the last firing of the sequence is the point of no return: give it an input or gate that forbids it",
)
QUESTIONS: Final = (CONTACT_FREE, DEADLOCK_FREE, NO_DOOMED, QUASI_LIVE, LIVE, REVERSIBLE, HOME_MARKINGS)
"""The questions of this file, which other techniques may answer too."""


@dataclass(frozen=True)
class Behaviour(Generic[S]):
    """The sets of markings and transitions that the verdicts speak of; each is computed once, when asked for.

    Raises `IncompleteGraph` or `BudgetExceeded` where a set needs more than is there.
    """

    space: StateSpace[S]

    @cached_property
    def contacts(self) -> dict[str, int]:
        """For each transition that is in contact somewhere, the number of markings found where it is."""
        counts = self.space.contacts()
        return {self._name(t): count for t, count in enumerate(counts) if count}

    @cached_property
    def fired(self) -> tuple[int, ...]:
        """The transitions that fire on some edge found, by index."""
        return tuple(t for t, count in enumerate(self.space.fired()) if count)

    @cached_property
    def never_fire(self) -> tuple[str, ...]:
        """The transitions that can never fire for a reason one can see without exploring.

        A place that is both input and output must hold a token and hold none; a signal wanted both 1 and 0 closes a
        gate for ever.
        """
        return tuple(
            transition.name
            for transition in self.space.net.transitions
            if transition.self_loops or not transition.openable
        )

    @cached_property
    def dead(self) -> tuple[str, ...]:
        """The transitions that never fire."""
        self.space.require_complete()
        fired = frozenset(self.fired)
        return tuple(t.name for i, t in enumerate(self.space.net.transitions) if i not in fired)

    @cached_property
    def _live(self) -> Sequence[bool]:
        return self.space.live()

    @cached_property
    def live(self) -> tuple[str, ...]:
        """The live transitions."""
        return tuple(self._name(t) for t, live in enumerate(self._live) if live)

    @cached_property
    def nonlive(self) -> tuple[str, ...]:
        """The transitions that are not live, dead ones included."""
        return tuple(self._name(t) for t, live in enumerate(self._live) if not live)

    @cached_property
    def reversible(self) -> bool:
        """Whether M0 can be reached from every reachable marking."""
        return self.space.reversible()

    @cached_property
    def home(self) -> int:
        """The number of home markings."""
        return self.space.count(self.space.home())

    @cached_property
    def doomed(self) -> S:
        """The markings from which every run ends in a deadlock: no run goes on for ever."""
        return self.space.algebra.negation(self.space.endless())

    @property
    def lost(self) -> S:
        """The markings from which M0 cannot be reached again."""
        return self.space.algebra.negation(self.space.backward(self.space.initial))

    def _name(self, t: int) -> str:
        return self.space.net.transitions[t].name


def contact_free(behaviour: Behaviour[Any]) -> Verdict:
    """No reachable marking is in contact: the guard of the firing rule hides no collision."""

    def find() -> Answer:
        space = behaviour.space
        if blocked := space.meet_contact():
            return no(tuple(space.net.transitions[t].name for t in blocked), _nearest_contact(space, blocked))
        space.require_complete()
        return yes()

    return CONTACT_FREE.ask(behaviour.space, find)


def _nearest_contact(space: StateSpace[S], blocked: Sequence[int]) -> Witness:
    """A sequence to a marking in contact, and what is full there."""
    net = space.net
    found = space.witness_of_contact(blocked)
    if found is None:
        raise WitnessError("there are markings in contact, and none of them is found")
    marking = net.marking(found.marking)
    t = next(t for t in blocked if in_contact(BOOL, net, t, holds_in(marking)))
    full = net.names(net.masks[t].outputs & ~net.masks[t].inputs & marking)
    return replace(found, note=f"the inputs of {net.transitions[t].name} are there and {listed(full)} is full")


def deadlock_free(behaviour: Behaviour[Any]) -> Verdict:
    """No reachable marking is a deadlock."""

    def find() -> Answer:
        space = behaviour.space
        if count := space.count(space.deadlocks):
            found = (
                "1 marking of the net is a deadlock"
                if count == 1
                else f"{spelled(count)} markings of the net are deadlocks"
            )
            note = found if space.complete else f"at least {found}"
            return no((), space.witness(space.deadlocks, note))
        space.require_complete()
        return yes()

    return DEADLOCK_FREE.ask(behaviour.space, find)


def quasi_live(behaviour: Behaviour[Any]) -> Verdict:
    """Every transition can fire at least once; the ones that cannot are dead."""

    def find() -> Answer:
        if behaviour.space.complete:
            return Answer(not behaviour.dead, behaviour.dead)
        if behaviour.never_fire:
            return no(behaviour.never_fire)
        if len(behaviour.fired) < len(behaviour.space.net.transitions):
            behaviour.space.require_complete()
        return yes()

    return QUASI_LIVE.ask(behaviour.space, find)


def all_live(behaviour: Behaviour[Any]) -> Verdict:
    """Every transition is live."""

    def find() -> Answer:
        space, nonlive = behaviour.space, behaviour.nonlive
        if not nonlive:
            return yes()
        # One is shown, as each costs a closure; a dead one only where there is no other, since it has its own verdict.
        dead = frozenset(behaviour.dead)
        name = next((name for name in nonlive if name not in dead), nonlive[0])
        again = space.backward(space.may_fire(space.net.transition_index[name]))
        witness = space.witness(space.algebra.negation(again), f"{name} can never fire after this")
        if witness is None:
            raise WitnessError(f"{name} is not live and can fire again from everywhere")
        return no(nonlive, witness)

    return LIVE.ask(behaviour.space, find)


def reversible(behaviour: Behaviour[Any]) -> Verdict:
    """M0 can be reached from every reachable marking."""

    def find() -> Answer:
        if behaviour.reversible:
            return yes()
        return no((), behaviour.space.witness(behaviour.lost, "the initial marking can never be reached again"))

    return REVERSIBLE.ask(behaviour.space, find)


def home_markings(behaviour: Behaviour[Any]) -> Verdict:
    """Some marking can be reached from every reachable marking."""

    def find() -> Answer:
        if behaviour.home:
            return yes()
        note = "nothing leads back from here, and another part of the state space is such too"
        return no((), behaviour.space.witness(behaviour.space.bottom(), note))

    return HOME_MARKINGS.ask(behaviour.space, find)


def no_doomed(behaviour: Behaviour[Any]) -> Verdict:
    """No reachable marking is doomed: while the cell runs, every deadlock can still be avoided."""

    def find() -> Answer:
        space, doomed = behaviour.space, behaviour.doomed
        count = space.count(doomed)
        if not count:
            return yes()
        note = f"{spelled(count)} doomed markings; from here every run ends in a deadlock"
        return no((), space.witness(doomed, note))

    return NO_DOOMED.ask(behaviour.space, find)
