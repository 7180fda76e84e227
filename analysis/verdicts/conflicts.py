"""Verdicts on conflict: who competes with whom, who decides, and which steps no order can replay.

A *structural* conflict is a shared input or output place; an *effective* one is a structural conflict of two
transitions that are both firable at one reachable marking and both openable by one valuation: there, somebody must
choose. Transitions with complementary external gates are never in effective conflict. Sharing nothing, two
transitions may still meet in a *gate race*: one closes an internal gate of the other. Under interleaving that is only
an order; in a synchronous step both fire, and where the races of a step form a cycle the step reaches a marking that
no order of single firings reaches.

That conflict exists is no defect, it is what arbiters are for: these verdicts inform. An effective conflict that no
arbiter of the file names is decided by the order of the file, which nobody reads as a decision: it warns. So does
a step that cannot be serialised, because the net then means two things, one for each discipline.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Generic

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.question import Answer, Question, listed, no, unknown, yes
from firable.analysis.spaces.reachability import REASONS, ReachabilityGraph
from firable.analysis.spaces.space import S, StateSpace
from firable.nets.changes import arbitration
from firable.nets.net import Net
from firable.nets.verdict import Verdict, Weight
from firable.semantics.conflict import (
    PAIRS_MAX,
    Listed,
    conflicts,
    gate_races,
    jointly_openable,
    listed_races,
    structural_conflicts,
)
from firable.semantics.firing import firable
from firable.semantics.trace import Discipline

Pair = tuple[str, str]

_RACES_MAX: Final = 1_000_000
_ONLY_THE_FIRST: Final = f"there are more: only the first {PAIRS_MAX:,} pairs are listed"
_NONE_OF_THE_FIRST: Final = f"none of the first {PAIRS_MAX:,} pairs that share a place compete, and there are more"
_ONE_BY_ONE: Final = "ask of two that no signal keeps apart: --query 'EF (firable(T) and firable(U))'"


@dataclass(frozen=True, slots=True)
class Pairs:
    """Conflicting pairs of transitions in the order of the net, by what they share; `more`: only the first of them."""

    by_input: tuple[Pair, ...] = ()
    by_output: tuple[Pair, ...] = ()
    more: bool = False

    @property
    def all(self) -> tuple[Pair, ...]:
        """All pairs, each once."""
        return tuple(dict.fromkeys((*self.by_input, *self.by_output)))


@dataclass(frozen=True)
class ConflictAnalysis(Generic[S]):
    """The conflicts and races of the net of a state space; each is computed once, when asked for."""

    space: StateSpace[S]

    @cached_property
    def structural(self) -> Pairs:
        """The pairs that share an input or an output place."""
        by_input, by_output = structural_conflicts(self.space.net)
        return Pairs(self._named(by_input.pairs), self._named(by_output.pairs), by_input.more or by_output.more)

    @cached_property
    def met(self) -> tuple[Pair, ...]:
        """The pairs in effective conflict at a marking found, among the structural ones that are listed."""
        pairs = [self._indexes(pair) for pair in self.structural.all]
        pairs = [pair for pair in pairs if jointly_openable(self.space.net, pair)]
        found = self.space.firable_together(pairs)
        return self._named(tuple(pair for pair, met in zip(pairs, found, strict=True) if met))

    def meeting(self, pair: Pair) -> S:
        """The markings found in which two transitions are both firable by Eq. (1)."""
        t, u = self._indexes(pair)
        net = self.space.net
        return self.space.where(lambda a, holds: a.conjunction([firable(a, net, t, holds), firable(a, net, u, holds)]))

    @cached_property
    def effective(self) -> Pairs:
        """The pairs in effective conflict; raises `IncompleteGraph` where more may come."""
        self.require_complete()
        met = set(self.met)
        return Pairs(
            tuple(pair for pair in self.structural.by_input if pair in met),
            tuple(pair for pair in self.structural.by_output if pair in met),
        )

    def require_complete(self) -> None:
        """Raise `IncompleteGraph` unless all pairs are listed and all markings known."""
        self.space.require_complete()
        if self.structural.more:
            raise IncompleteGraph(_ONLY_THE_FIRST)

    @cached_property
    def _races(self) -> Listed:
        return listed_races(self.space.net)

    @cached_property
    def races(self) -> tuple[Pair, ...]:
        """The gate races (t, u): t closes an internal gate of u."""
        return self._named(self._races.pairs)

    @property
    def more_races(self) -> bool:
        """Whether only the first races are listed."""
        return self._races.more

    def _indexes(self, pair: Pair) -> tuple[int, int]:
        return self.space.net.transition_index[pair[0]], self.space.net.transition_index[pair[1]]

    def _named(self, pairs: tuple[tuple[int, int], ...]) -> tuple[Pair, ...]:
        names = [transition.name for transition in self.space.net.transitions]
        return tuple((names[t], names[u]) for t, u in pairs)


def races_may_cycle(net: Net) -> bool:
    """Whether the gate races among transitions that may fire together form a cycle: if not, every step has an order.

    Where more pairs than are listed race each other in a cycle of places, it is taken to be one. Cost: linear in the
    arcs, and in the pairs that are looked at.
    """
    around = _closing_in_a_cycle(net)
    relation = conflicts(net)
    after: dict[int, set[int]] = {}
    last, rivals = -1, frozenset[int]()
    for looked, (t, u) in enumerate(gate_races(net, around)):
        if looked == _RACES_MAX:
            return True
        if t != last:
            last, rivals = t, relation.rivals[t]
        if u not in rivals and jointly_openable(net, (t, u)):
            after.setdefault(t, set()).add(u)
    return bool(_in_or_before_a_cycle(after))


def _closing_in_a_cycle(net: Net) -> list[int]:
    """The transitions that close gates in a cycle of transitions and gates, or lead to one: no pair is looked at.

    A gate is a place and the value at which it is open; who takes the place from it closes it for all who read it.
    """
    first_gate, place = len(net.transitions), net.place_index
    after: dict[int, set[int]] = {}
    for t, of in enumerate(net.transitions):
        closed = [(name, 1) for name in of.inputs] + [(name, 0) for name in of.outputs]
        after[t] = {first_gate + 2 * place[name] + value for name, value in closed}
        for name, value in [(name, 1) for name in of.permissive] + [(name, 0) for name in of.inhibitive]:
            after.setdefault(first_gate + 2 * place[name] + value, set()).add(t)
    return sorted(node for node in _in_or_before_a_cycle(after) if node < first_gate)


def _in_or_before_a_cycle(after: Mapping[int, Collection[int]]) -> set[int]:
    """The nodes of a graph from which a path leads on for ever.

    Those that nothing comes after are taken away until none is left, or a cycle is.
    """
    before: dict[int, list[int]] = {}
    left = {t: len(closed) for t, closed in after.items() if closed}
    for t, closed in after.items():
        for u in closed:
            before.setdefault(u, []).append(t)
    ends = [u for u in before if u not in left]
    while ends:
        for t in before.get(ends.pop(), ()):
            left[t] -= 1
            if not left[t]:
                del left[t]
                ends.append(t)
    return set(left)


@dataclass(frozen=True)
class Steps:
    """The steps of a step graph that no order of single firings replays.

    Raises `ValueError` for an interleaving graph, which has no steps.
    """

    graph: ReachabilityGraph

    def __post_init__(self) -> None:
        if self.graph.discipline is not Discipline.STEP:
            raise ValueError("only the step graph has steps")

    @cached_property
    def may_cycle(self) -> bool:
        """Whether there may be steps without an order."""
        return races_may_cycle(self.graph.net)

    @cached_property
    def unordered(self) -> dict[tuple[str, ...], int]:
        """The steps found that no order can replay, with the lowest marking at which each may fire.

        Of a part of the graph there may be more.
        """
        found: dict[tuple[str, ...], int] = {}
        if not self.may_cycle:
            return found
        player = self.graph.witnesses.player
        for index in range(self.graph.n_markings):
            if self.graph.moment.over:
                raise BudgetExceeded(REASONS["time"])
            for fired, _ in self.graph.successors(index):
                if len(fired) > 1 and not player.serialisable(fired):
                    found.setdefault(self.graph.witnesses.names(fired), index)
        return found

    @cached_property
    def nonserialisable(self) -> tuple[tuple[str, ...], ...]:
        """The steps that no order can replay; raises `IncompleteGraph` where more may come."""
        if self.may_cycle:
            self.graph.require_complete()
        return tuple(self.unordered)


def structural_conflict_free(analysis: ConflictAnalysis[Any]) -> Verdict:
    """No two transitions share an input or an output place."""
    question = Question(
        "structural-conflicts", "no two transitions share an input or an output place", Weight.INFORMATION
    )
    pairs = analysis.structural.all
    hint = _ONLY_THE_FIRST if analysis.structural.more else ""
    return question.ask(analysis.space, lambda: Answer(not pairs, _spelled(pairs), hint=hint))


def effective_conflict_free(analysis: ConflictAnalysis[Any]) -> Verdict:
    """No two transitions that share a place are firable at one reachable marking and openable by one valuation.

    Warns where an effective conflict is decided by no arbiter of the file; informs where all are.
    """
    net = analysis.space.net
    decided = [set(arbiter.among) for arbiter in net.arbiters]
    try:
        competing = list(analysis.met)
    except (IncompleteGraph, BudgetExceeded):
        competing = list(analysis.structural.all)  # unknown: any of them may compete
    undecided = [pair for pair in competing if not any(set(pair) <= among for among in decided)]
    question = Question(
        "effective-conflicts",
        "no two transitions compete for a place at a reachable marking",
        Weight.WARNING if undecided else Weight.INFORMATION,
    )

    def find() -> Answer:
        space = analysis.space
        if not analysis.met:
            space.require_complete()
            return unknown(_NONE_OF_THE_FIRST, _ONE_BY_ONE, "F3004") if analysis.structural.more else yes()
        hint = _ONLY_THE_FIRST if analysis.structural.more else ""
        if undecided:
            nobody = f"no arbiter names {' and '.join(undecided[0])}: the order of the file decides"
            hint = f"{nobody}; {_who_may_decide(net, undecided)}"
        pair = (undecided or analysis.met)[0]
        witness = space.witness(analysis.meeting(pair), f"here {' and '.join(pair)} compete")
        return no(_spelled(analysis.met), witness, hint)

    return question.ask(analysis.space, find)


def _who_may_decide(net: Net, undecided: Sequence[Pair]) -> str:
    """How to have an arbiter decide between the first pair: a conflict component has one arbiter at most."""
    component_of = conflicts(net).component_of
    here = component_of[net.transition_index[undecided[0][0]]]
    for arbiter in net.arbiters:
        if component_of[net.transition_index[arbiter.among[0]]] == here:
            return f"name them in `among` of the arbiter '{arbiter.name}', too"
    competing = {net.transition_index[name] for pair in undecided for name in pair}
    among = [net.transitions[t].name for t in sorted(competing) if component_of[t] == here]
    return str(arbitration(among, [arbiter.name for arbiter in net.arbiters]))


def race_free(analysis: ConflictAnalysis[Any]) -> Verdict:
    """No transition closes an internal gate of another."""
    question = Question("gate-races", "no transition closes an internal gate of another one", Weight.INFORMATION)
    races = tuple(f"{t} -> {u}" for t, u in analysis.races)
    hint = _ONLY_THE_FIRST if analysis.more_races else ""
    return question.ask(analysis.space, lambda: Answer(not races, races, hint=hint))


def steps_serialisable(steps: Steps) -> Verdict:
    """Every step of the step graph can be replayed one firing after the other."""
    question = Question(
        "steps-serialisable",
        "every step can be replayed by some order of single firings",
        Weight.WARNING,
        hint="these transitions close each other's gates and fire together in one scan: make them share an input place",
    )

    def find() -> Answer:
        found = steps.unordered
        if found:
            step, index = min(found.items(), key=lambda item: item[1])
            witness = steps.graph.witness_at(index, f"here the step of {listed(step)} has no order")
            return no(tuple(" + ".join(step) for step in found), witness)
        if steps.may_cycle:
            steps.graph.require_complete()
        return yes()

    return question.ask(steps.graph, find)


def _spelled(pairs: tuple[Pair, ...] | list[Pair]) -> tuple[str, ...]:
    return tuple(f"{t} / {u}" for t, u in pairs)
