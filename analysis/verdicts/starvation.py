"""Starvation: a live transition that the arbiters, as they are, never let fire.

Liveness is a verdict on the un-arbitrated net: from every marking the transition *can* fire again. A fixed priority can
still pass it over for ever. With all external gates open, the arbitrated net is deterministic under synchronous steps:
the arbiters choose one maximal set in each marking and remember finitely much, so the run from M0 ends in a deadlock
or in a cycle, found by running it. A transition that is live in the net and does not fire on the cycle is starved.

In that run no time limit is ever over: a timer is 0, and what fires only after a timeout (the fault transition, the way
back from a fault place) does not starve there, for nothing calls for it.

What this does and does not say: it is a verdict on one run, the one in which every machine answers at once. In another
timing the transition may fire, or others may starve; the statement says so. Where two transitions that meet want a
signal 1 and 0, no valuation opens all gates, that run does not exist, and the verdict is UNKNOWN, unless no
transition is live: then none starves in any run.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Any, Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.question import Answer, Question, no, unknown, yes
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.verdicts.behaviour import Behaviour
from firable.nets.bits import bits
from firable.nets.net import Marking, Net
from firable.nets.time_limits import only_after_a_timeout, waiting_for_a_timer
from firable.nets.verdict import Verdict, Weight, Witness
from firable.semantics.algebra import BOOL
from firable.semantics.arbitration import Arbitration
from firable.semantics.conflict import at_odds
from firable.semantics.firing import firable
from firable.semantics.player import FiringSet, Player, holds_in
from firable.semantics.trace import Discipline

STARVATION: Final = Question(
    "starvation",
    "every live transition fires again and again in the arbitrated run with all external gates open",
    Weight.WARNING,
    hint="let the arbiter go by `order` or `rotation`, or accept that these wait for a slower cycle",
    method="eager run of synchronous steps under the arbiters",
)
STEPS_MAX: Final = 100_000


class GatesCannotBeOpenError(ValueError):
    """No valuation opens the external gates of all transitions that are firable at one marking of the run."""


@dataclass(frozen=True, slots=True)
class EagerRun:
    """The run in which all enabled transitions fire as the arbiters choose: first `prefix`, then `cycle` for ever.

    Each element is the set fired in one step. An empty cycle is a deadlock, or, where not `complete`, a run that was
    cut off after `STEPS_MAX` steps or by a deadline.
    """

    prefix: tuple[tuple[str, ...], ...]
    cycle: tuple[tuple[str, ...], ...]
    complete: bool = True

    def first(self, n_steps: int) -> tuple[tuple[str, ...], ...]:
        """The first steps of the run."""
        fired = list(self.prefix[:n_steps])
        while self.cycle and len(fired) < n_steps:
            fired += self.cycle[: n_steps - len(fired)]
        return tuple(fired)


def eager_run(net: Net, *, steps_max: int = STEPS_MAX, deadline: Deadline = NEVER) -> EagerRun:
    """The arbitrated run from M0 with all external gates open, as far as it comes before the deadline.

    Raises `InputError` F2013 where the arbiters do not fit the conflicts, `GatesCannotBeOpenError` where no valuation
    opens the gates.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")),
    ...           (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))))
    >>> eager_run(net).cycle
    (('t',), ('u',))
    """
    player, arbitration = Player(net), Arbitration.of(net)
    if deadline.over:
        return EagerRun((), (), complete=False)
    marking, turns = net.initial_marking, arbitration.first_turns
    seen = {(marking, turns): 0}
    fired: list[tuple[str, ...]] = []
    running = Enabled(net, marking, waiting_for_a_timer(net))
    enabled = tuple(sorted(running.transitions))
    while len(fired) < steps_max and not deadline.over:
        if not enabled:
            return EagerRun(tuple(fired), ())
        if (found := at_odds(net, enabled)) is not None:
            *two, signal = (net.transitions[found[0]].name, net.transitions[found[1]].name, found[2])
            said = f"{' and '.join(two)} are firable together, and want the signal '{signal}' 1 and 0"
            raise GatesCannotBeOpenError(said)
        step, turns = arbitration.decide(enabled, turns)
        marking = player.fire(marking, step)
        enabled = running.after(marking)
        fired.append(tuple(net.transitions[t].name for t in step))
        if (start := seen.setdefault((marking, turns), len(fired))) < len(fired):
            return EagerRun(tuple(fired[:start]), tuple(fired[start:]))
    return EagerRun(tuple(fired), (), complete=False)


class Enabled:
    """Which transitions may fire in the course of a run, external gates free.

    Of a transition that may not, one place is watched that keeps it from firing, and until that place changes nothing
    is asked again: the one that changed least so far. So a run costs what happens in it, and not the number of
    transitions, nor that of their arcs, for each firing. Those of `without` never may.
    """

    def __init__(self, net: Net, marking: Marking, without: AbstractSet[int] = frozenset()) -> None:
        self.net, self.marking = net, marking
        self.transitions: set[int] = set()
        self.at: list[list[int]] = [[] for _ in net.places]
        self.watched: list[set[int]] = [set() for _ in net.places]
        self.changes = [0] * len(net.places)
        for t, transition in enumerate(net.transitions):
            joined = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
            for place in {net.place_index[name] for name in joined}:
                self.at[place].append(t)
            if transition.openable and t not in without:
                self._look(t)

    def after(self, marking: Marking) -> FiringSet:
        """What may fire in the next marking of the run."""
        changed, again = self.marking ^ marking, set[int]()
        self.marking = marking
        for place in bits(changed):
            self.changes[place] += 1
            again |= self.watched[place]
            self.watched[place].clear()
            again.update(t for t in self.at[place] if t in self.transitions)
        for t in again:
            self._look(t)
        return tuple(sorted(self.transitions))

    def _look(self, t: int) -> None:
        if firable(BOOL, self.net, t, holds_in(self.marking)):
            self.transitions.add(t)
            return
        self.transitions.discard(t)
        of = self.net.masks[t]
        wrong = ((of.inputs | of.permissive) & ~self.marking) | ((of.outputs | of.inhibitive) & self.marking)
        self.watched[min(bits(wrong), key=lambda place: self.changes[place])].add(t)


def scan(net: Net, valuations: Iterable[Mapping[str, bool]]) -> tuple[tuple[str, ...], ...]:
    """The sets fired from M0, one for each valuation of the signals, as the arbiters choose; a signal not given is 0.

    Raises `InputError` F2013 where the arbiters do not fit the conflicts.
    """
    player, arbitration = Player(net), Arbitration.of(net)
    marking, turns = net.initial_marking, arbitration.first_turns
    fired = []
    for valuation in valuations:
        step, turns = arbitration.decide(player.enabled(marking, valuation), turns)
        marking = player.fire(marking, step)
        fired.append(tuple(net.transitions[t].name for t in step))
    return tuple(fired)


def starved(run: EagerRun, live: Iterable[str]) -> tuple[str, ...]:
    """The live transitions that do not fire on the cycle of the run."""
    served = {name for step in run.cycle for name in step}
    return tuple(name for name in live if name not in served)


NONE_STARVES: Final = replace(yes(), hint="no transition is live, so none starves")


def starvation_free(behaviour: Behaviour[Any]) -> Verdict:
    """Every live transition fires again and again under the arbiters of the file, in the eager run with all gates open.

    Raises `InputError` F2013 where the arbiters do not fit the conflicts.
    """

    def find() -> Answer:
        space = behaviour.space
        try:
            run = eager_run(space.net, deadline=space.moment if isinstance(space, ReachabilityGraph) else NEVER)
        except GatesCannotBeOpenError as error:
            if space.complete and not behaviour.live:
                return NONE_STARVES
            return unknown(str(error), "there is no run with all gates open; starvation depends on the signals")
        if not run.complete:
            if space.complete and not behaviour.live:
                return NONE_STARVES
            bound = f"{len(run.prefix):,} steps of the run"
            return unknown(bound, "the run has not come back to an earlier marking", "F3004")
        late = only_after_a_timeout(space.net)
        hungry = starved(run, (name for name in behaviour.live if name not in late))
        if not hungry:
            return yes() if behaviour.live else NONE_STARVES
        return no(hungry, _witness(space.net, space.discipline, run, f"{hungry[0]} never fires in the cycle"))

    return STARVATION.ask(behaviour.space, find)


def _witness(net: Net, discipline: Discipline, run: EagerRun, note: str) -> Witness | None:
    """The run as a firing sequence of a discipline, replayed; None where it is none of that discipline.

    Under interleaving the transitions of a step fire one by one, in an order that its gate races allow, if there is
    one.
    """
    index, witnesses = net.transition_index, Witnesses(net, discipline)
    parts: list[list[FiringSet]] = []
    for part in (run.prefix, run.cycle):
        fired: list[FiringSet] = []
        for step in part:
            together = tuple(sorted(index[name] for name in step))
            if discipline is Discipline.STEP:
                fired.append(together)
                continue
            order = witnesses.player.order_of(together)
            if order is None:
                return None
            fired += [(t,) for t in order]
        parts.append(fired)
    prefix, cycle = parts
    marking = witnesses.play(net.initial_marking, prefix)
    if witnesses.play(marking, cycle) != marking:
        raise WitnessError("the cycle does not close")
    return witnesses.named(prefix, marking, cycle, note)
