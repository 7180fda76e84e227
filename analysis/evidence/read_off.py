"""What the net itself says of a verdict: read off its arcs, or by playing its one arbitrated run.

These verdicts want no certificate, since to look again costs no more than to check one. A document brings its own net,
so each look ends with a deadline, as everything does that is checked.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.refusal import in_time
from firable.nets.bits import bits
from firable.nets.net import Marking, Net, SignalKind, Transition
from firable.semantics.algebra import BOOL
from firable.semantics.arbitration import Arbitration
from firable.semantics.conflict import conflicts, gate_races, jointly_openable, structural_conflicts
from firable.semantics.firing import firable
from firable.semantics.player import Player, holds_in
from firable.semantics.trace import Discipline

STEPS_MAX: Final = 100_000
"""How many steps of the arbitrated run are played."""


def read_off(net: Net, discipline: Discipline, name: str, deadline: Deadline = NEVER) -> bool | None:
    """What the net itself says of a verdict, without a look at its markings; None where it does not.

    Raises `TimeIsOverError`.
    """
    match name:
        case "self-loops":
            return not any(t.self_loops for t in net.transitions)
        case "structural-conflicts":
            return not any(listed.pairs for listed in structural_conflicts(net))
        case "gate-races":
            return next(gate_races(net), None) is None
        case "output-signals-in-M0":
            return not any(place.marked and place.command is not None for place in net.places)
        case "steps-serialisable" if discipline is Discipline.STEP and _races_have_an_order(net, deadline):
            return True
    return None


def _races_have_an_order(net: Net, deadline: Deadline) -> bool:
    """Whether the gate races among transitions that may fire together are acyclic."""
    rivals = conflicts(net).rivals
    races = in_time(gate_races(net), deadline)
    closed_by: dict[int, list[int]] = {}
    waiting: dict[int, int] = {}  # for each transition, the gates that it closes of those that are not in order yet
    for t, u in races:
        if u not in rivals[t] and jointly_openable(net, (t, u)):
            closed_by.setdefault(u, []).append(t)
            waiting[t] = waiting.get(t, 0) + 1
    ready = [u for u in closed_by if u not in waiting]
    while ready:
        for t in in_time(closed_by.get(ready.pop(), ()), deadline):
            waiting[t] -= 1
            if not waiting[t]:
                ready.append(t)
    return not any(waiting.values())


def eager_cycle(net: Net, deadline: Deadline = NEVER) -> frozenset[str] | None:
    """What fires for ever in the arbitrated run with all gates open; None where there is none, or it takes too long.

    In it no time is ever over, so what fires only after one is counted with those that need not fire. A run that ends
    stays where it ends, and there nothing fires for ever.

    Raises `InputError` F2013 where the arbiters do not fit the conflicts, and `TimeIsOverError`.
    """
    player, arbitration = Player(net), Arbitration.of(net)
    marking, turns = net.initial_marking, arbitration.first_turns
    seen = {(marking, turns): 0}
    fired: list[tuple[int, ...]] = []
    timers = {signal.name for signal in net.signals if signal.kind is SignalKind.TIMER}
    able = [t for t, one in enumerate(net.transitions) if one.openable and not _waits_for(one, timers)]
    may_fire = _MayFire(net, able)
    for _ in in_time(range(STEPS_MAX), deadline):
        enabled = may_fire.at(marking)
        if not jointly_openable(net, enabled):
            return None
        step, turns = arbitration.decide(enabled, turns)
        marking = player.fire(marking, step)
        fired.append(tuple(step))
        if (start := seen.setdefault((marking, turns), len(fired))) < len(fired):
            return frozenset(net.transitions[t].name for step in fired[start:] for t in step) | _never_called(
                net, timers
            )
    return None


class _MayFire:
    """Which of some transitions are firable, marking after marking: only those are asked of which a place changed."""

    def __init__(self, net: Net, able: Iterable[int]) -> None:
        self.net, self.marking = net, net.initial_marking
        self.beside: list[list[int]] = [[] for _ in net.places]
        self.found = set[int]()
        for t in able:
            one = net.transitions[t]
            for name in {*one.inputs, *one.outputs, *one.permissive, *one.inhibitive}:
                self.beside[net.place_index[name]].append(t)
            self._ask(t)

    def at(self, marking: Marking) -> list[int]:
        """Those that are firable in the next marking."""
        changed, self.marking = self.marking ^ marking, marking
        again = set[int]()
        for p in bits(changed):
            again.update(self.beside[p])
        for t in again:
            self._ask(t)
        return sorted(self.found)

    def _ask(self, t: int) -> None:
        if firable(BOOL, self.net, t, holds_in(self.marking)):
            self.found.add(t)
        else:
            self.found.discard(t)


def _waits_for(transition: Transition, timers: AbstractSet[str]) -> bool:
    return any(gate.wanted and gate.signal in timers for gate in transition.external)


def _never_called(net: Net, timers: AbstractSet[str]) -> frozenset[str]:
    """What cannot fire before a time is over: it needs a place full that nothing else fills."""
    filled = {place.name for place in net.places if place.marked}
    late = {t.name: t for t in net.transitions} if timers else {}
    while more := [
        t for t in late.values() if not _waits_for(t, timers) and filled.issuperset((*t.inputs, *t.permissive))
    ]:
        for t in more:
            del late[t.name]
            filled.update(t.outputs)
    return frozenset(late)
