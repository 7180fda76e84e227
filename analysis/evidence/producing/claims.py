"""A certificate for a claim, from what the run that decided it has left, or else by a technique that leaves one.

First comes what is at hand: the invariant or the firing sequence of a finding, the markings where the run held all of
them, listed where they are few and as a decision diagram otherwise. Where the run that decided left nothing behind
(stubborn sets, a reduced net, a graph with too many markings to list), another technique is asked within the time that
is left: a decision diagram, invariants, the state equation, k-induction, property-directed reachability. Nothing here
needs to be right for a check to be sound: what is wrong is refused by the checker.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import (
    Certificate,
    Continuation,
    Diagram,
    FiringSequence,
    InductiveInvariant,
    Labelling,
    Markings,
    NeverCertificate,
    StubbornSets,
    Theorem,
    Unfolded,
)
from firable.analysis.evidence.checking.theorems import check_premises
from firable.analysis.evidence.claims import Claim, ClaimKind, as_ctl, is_marking, without_start
from firable.analysis.evidence.meaning import contact, tidy
from firable.analysis.evidence.producing.labels import TooLargeError, drawn, labelling, listed
from firable.analysis.evidence.producing.lacking import NO_TIME, LackingError
from firable.analysis.evidence.producing.ranks import progress
from firable.analysis.evidence.producing.runs import (
    InOrder,
    NotFoundError,
    maximal,
    parting,
    run_in_order,
    runs_by_search,
    runs_on_graph,
)
from firable.analysis.evidence.producing.stubborn import stubborn_sets
from firable.analysis.evidence.producing.theorems import theorem_on
from firable.analysis.evidence.producing.unfolding import unfolded_markings
from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.induction.pdr import decide_by_pdr
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import SymbolicSpace, explore_symbolically
from firable.analysis.structure.contact import decide_contact_by_invariants
from firable.analysis.structure.state_equation import decide_by_state_equation
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.temporal import Temporal
from firable.nets.verdict import Witness
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 20_000
"""How many markings are listed where a decision diagram would do as well."""
WIDE_MAX: Final = 100_000
"""How many markings are listed where none would, or none is at hand: for responses, LTL, synchronous steps, CTL."""
_SECONDS: Final = 30.0


class Certifier:
    """Makes certificates for claims on one net."""

    def __init__(
        self,
        net: Net,
        discipline: Discipline,
        limits: Limits,
        space: StateSpace[Any] | None = None,
        findings: Iterable[tuple[Formula, Finding]] = (),
    ) -> None:
        self.net, self.discipline, self.limits, self._given = net, discipline, limits, space
        self._findings: Mapping[Formula, Finding] = {tidy(goal): found for goal, found in findings}
        self._contact: NeverCertificate | None = None
        self._ends: list[tuple[Continuation, Callable[[Formula], bool]]] = []
        self.deadlock: Witness | None = None

    @cached_property
    def graph(self) -> ReachabilityGraph | None:
        """All markings as a graph, where they are few enough to be listed for whatever is claimed."""
        return self._explored(MARKINGS_MAX if self.discipline is Discipline.INTERLEAVING else WIDE_MAX)

    @cached_property
    def wide(self) -> ReachabilityGraph | None:
        """The same, where only listed markings will do."""
        return self.graph or self._explored(WIDE_MAX)

    def _explored(self, most: int) -> ReachabilityGraph | None:
        graph = self._given
        if isinstance(graph, SymbolicSpace) and graph.n_markings > most:
            return None
        if not isinstance(graph, ReachabilityGraph) or not graph.complete:
            budget = Budget(most, self.limits.memory_bytes)
            graph = explore(self.net, self.discipline, budget, deadline=self._part(0.2))
        return graph.until(self.limits.deadline) if graph.complete and graph.n_markings <= most else None

    @cached_property
    def markings(self) -> Markings | None:
        """The markings of `graph` as they are written."""
        return None if self.graph is None else listed(self.graph)

    @cached_property
    def wide_markings(self) -> Markings | None:
        """The markings of `wide` as they are written."""
        return self.markings or (None if self.wide is None else listed(self.wide))

    @cached_property
    def symbolic(self) -> SymbolicSpace | None:
        """All markings as a decision diagram, where they are too many to be listed."""
        if self.graph is not None or self.discipline is Discipline.STEP:
            return None
        if isinstance(self._given, SymbolicSpace):
            return self._given.until(self.limits.deadline)
        try:
            return explore_symbolically(self.net, Limits(self._part(0.3), self.limits.memory_bytes)).until(
                self.limits.deadline
            )
        except BudgetExceeded:
            return None

    @cached_property
    def diagram(self) -> Diagram | None:
        """The same markings as they are written."""
        try:
            return None if self.symbolic is None else drawn(self.symbolic)
        except TooLargeError:
            return None

    def _part(self, share: float) -> Deadline:
        left = self.limits.deadline.left_seconds
        return self.limits.deadline.within(_SECONDS if left is None else left * share)

    def certify(self, claim: Claim, witness: Witness | None = None) -> Certificate:
        """A certificate for a claim; `witness` is the run that the verdict came with.

        Raises `LackingError` where none is found.
        """
        try:
            found = self._certificate(claim, witness)
        except (BudgetExceeded, IncompleteGraph):
            raise LackingError(NO_TIME) from None
        except TooLargeError as error:
            raise LackingError(str(error)) from None
        if found is None:
            raise LackingError(f"no certificate was found for '{claim}'")
        return found

    def _certificate(self, claim: Claim, witness: Witness | None) -> Certificate | None:
        match claim.kind:
            case ClaimKind.NEVER:
                return self._never(claim.state_goal)
            case ClaimKind.REACHABLE:
                found = witness or self._way(lambda space: space.satisfying(claim.state_goal))
                return None if found is None else FiringSequence(found.firings)
            case ClaimKind.LOST:
                return self._lost(claim.state_goal, witness)
            case ClaimKind.NOT_LTL | ClaimKind.NOT_LEADS_TO:
                return None if witness is None else maximal(self.net, self.discipline, witness)
            case ClaimKind.LTL:
                return self._unfolded(claim)
            case ClaimKind.LEADS_TO:
                if self.wide is None or self.wide_markings is None:
                    raise LackingError(f"ranks for a response are written for up to {WIDE_MAX:,} markings")
                return progress(self.wide, self.wide_markings, claim)
            case ClaimKind.ORDERED:
                return None if self.markings is None else Labelling(self.markings)
            case ClaimKind.UNORDERED:
                return None if witness is None else self._unordered(witness)
            case ClaimKind.LIVE | ClaimKind.HOME:
                return self.theorem(claim)
            case ClaimKind.FIRES:
                raise LackingError("runs are looked for together")
        return self._labelled(claim)

    def _unfolded(self, claim: Claim) -> Unfolded | None:
        """Markings that serve every formula, where they are few; else those that this one asks for; else all."""
        if self.markings is not None:
            return Unfolded(self.markings)
        if self.discipline is Discipline.INTERLEAVING:
            try:
                found = unfolded_markings(self.net, claim.goal, WIDE_MAX, self._part(0.2))
                return None if found is None else Unfolded(found)
            except (TooLargeError, BudgetExceeded):
                pass  # all markings, which a graph finds faster, may be few enough
        if self.wide_markings is None:
            raise LackingError(f"a tableau is unfolded on up to {WIDE_MAX:,} markings")
        return Unfolded(self.wide_markings)

    def asked_for(self, formula: Temporal) -> Unfolded:
        """What shows a formula of LTL of which it is not known yet whether it holds; raises `LackingError`."""
        if self.discipline is Discipline.STEP:
            raise LackingError("what fires is not spoken of in steps")
        try:
            found = unfolded_markings(self.net, formula, WIDE_MAX, self._part(0.3))
        except (TooLargeError, BudgetExceeded):
            raise LackingError(NO_TIME) from None
        if found is None:
            raise LackingError("some run refutes the formula")
        return Unfolded(found)

    def _unordered(self, witness: Witness) -> FiringSequence | None:
        """The run, with the step after it that has no order."""
        player = Player(self.net)
        for step in sorted(player.steps(self.net.marking(witness.marking))):
            if not player.serialisable(step):
                names = tuple(self.net.transitions[t].name for t in step)
                return FiringSequence((*witness.firings, names))
        return None

    def _labelled(self, claim: Claim) -> Labelling | None:
        formula = as_ctl(claim)
        if formula is None:
            return None
        if self.graph is not None and self.markings is not None:
            return labelling(self.graph, self.markings, formula)
        if self.symbolic is not None and self.diagram is not None:
            return labelling(self.symbolic, self.diagram, formula)
        if self.wide is not None and self.wide_markings is not None:
            return labelling(self.wide, self.wide_markings, formula)
        raise LackingError(f"there are more than {WIDE_MAX:,} markings, and no decision diagram of them at hand")

    def _never(self, goal: Formula) -> NeverCertificate | None:
        finding = self._findings.get(goal)
        if finding is not None and isinstance(finding.certificate, NeverCertificate):
            return finding.certificate
        if self.graph is not None and self.markings is not None:
            return None if self.graph.satisfying(goal).any() else Labelling(self.markings)
        if goal == self._contact_goal and (found := self.contact_free()) is not None:
            return found
        if not isinstance(self._given, SymbolicSpace) and (sets := self._stubborn(self.net, goal)) is not None:
            return sets
        if self.symbolic is not None and self.diagram is not None:
            return None if self.symbolic.satisfying(goal) else Labelling(self.diagram)
        return self._induced(self.net, goal)

    def _stubborn(self, net: Net, goal: Formula) -> StubbornSets | None:
        """Few markings with stubborn sets, where they are few."""
        if self.discipline is Discipline.STEP:
            return None
        try:
            return stubborn_sets(net, goal, Limits(self._part(0.2), self.limits.memory_bytes))
        except BudgetExceeded:
            return None

    @cached_property
    def _contact_goal(self) -> Formula:
        return contact(self.net)

    def _contact_excluded(self) -> NeverCertificate | None:
        return self._never(self._contact_goal)

    def contact_free(self) -> NeverCertificate | None:
        """The invariants that exclude contact, of a net of any size; None where they do not."""
        if self._contact is None:
            found = decide_contact_by_invariants(self.net, Limits(self._part(0.3), self.limits.memory_bytes))
            self._contact = found.certificate if isinstance(found.certificate, InductiveInvariant) else None
        return self._contact

    def _induced(self, net: Net, goal: Formula) -> InductiveInvariant | None:
        """An inductive invariant against a goal, by the methods that give one, from the quick to the thorough."""
        limits = self.limits
        if self.discipline is Discipline.STEP:
            tries: tuple[Callable[[], Finding], ...] = (
                lambda: decide_by_k_induction(net, goal, limits, discipline=self.discipline),
            )
        else:
            tries = (
                lambda: decide_by_state_equation(net, goal, replace(limits, deadline=self._part(0.3))),
                lambda: decide_by_k_induction(net, goal, replace(limits, deadline=self._part(0.3))),
                lambda: decide_by_pdr(net, goal, replace(limits, deadline=self._part(0.8))),
            )
        for attempt in tries:
            if limits.deadline.over:  # to begin with any of them takes a while on a large net
                raise BudgetExceeded(NO_TIME)
            found = attempt()
            if isinstance(found.certificate, InductiveInvariant):
                return found.certificate
            if found.reachable:
                return None
        raise LackingError("no technique that leaves an invariant found one within the time for evidence")

    def _way(self, targets: Callable[[StateSpace[Any]], Any]) -> Witness | None:
        """A way into a set, from whichever space there is."""
        space: StateSpace[Any] | None = self.graph or self.symbolic or self._given
        return None if space is None else space.witness(targets(space))

    def _lost(self, goal: Formula, witness: Witness | None) -> Continuation | None:
        spelled = tidy(without_start(self.net, goal))
        for known, misses in self._ends:
            if misses(spelled):
                return known

        def lost(space: StateSpace[Any]) -> Any:
            return space.algebra.negation(space.backward(space.satisfying(goal)))

        space: StateSpace[Any] | None = self.graph or self.symbolic
        if space is not None and (
            witness is None or not space.contains(lost(space), self.net.marking(witness.marking))
        ):
            witness = self._way(lost)
        for way in (witness, self.deadlock):
            if way is not None and (found := self._never_after(way, goal, spelled)) is not None:
                return found
        return None

    def _never_after(self, way: Witness, goal: Formula, spelled: Formula) -> Continuation | None:
        """What shows that after this run the goal is never reached; kept, since it shows the same of other goals."""
        marking, net = self.net.marking(way.marking), self.net
        places = tuple(replace(place, marked=bool(marking >> p & 1)) for p, place in enumerate(net.places))
        net = replace(net, places=places, properties=())
        if self.symbolic is not None:
            symbolic = self.symbolic
            after = symbolic.engine.forward(
                symbolic.engine.single([i for i in range(marking.bit_length()) if marking >> i & 1])
            )
            if after & symbolic.satisfying(goal):
                return None
            found = Continuation(way.firings, Labelling(_alone(drawn(symbolic, [after]))))
            self._ends.append((found, lambda other: not after & symbolic.satisfying(other)))
            return found
        graph = explore(net, self.discipline, Budget(MARKINGS_MAX, self.limits.memory_bytes), deadline=self._part(0.3))
        if graph.complete:
            if graph.satisfying(spelled).any():
                return None
            found = Continuation(way.firings, Labelling(listed(graph)))
            self._ends.append((found, lambda other: not graph.satisfying(other).any()))
            return found
        shown = self._stubborn(net, spelled) or self._induced(net, spelled)
        return None if shown is None else Continuation(way.firings, shown)

    def theorem(self, claim: Claim) -> Theorem:
        """A theorem that says the claim; raises `LackingError` where none does."""
        found = self._theorem
        if isinstance(found, str):
            raise LackingError(found)
        try:
            check_premises(self.net, self.discipline, claim, found)
        except InputError as error:
            raise LackingError(error.diagnostics[0].message) from None
        return found

    @cached_property
    def _theorem(self) -> Theorem | str:
        """The theorem that is about the net, or why there is none: looked for once, whatever comes of it."""
        try:
            if self.discipline is Discipline.STEP:
                raise LackingError("no theorem on a class of nets applies")
            return theorem_on(self.net, self._contact_excluded, self._part(0.5))
        except LackingError as error:
            return str(error)
        except (BudgetExceeded, IncompleteGraph):
            return NO_TIME

    def runs_firing(self, names: Iterable[str], home: Marking | None = None) -> list[FiringSequence]:
        """Runs that fire all these transitions, each as many as it can; after they met a home marking, if it is given.

        Raises `LackingError` where a transition fires in none of them.
        """
        try:
            if self.graph is not None:
                return runs_on_graph(self.graph, tuple(names), home)
            prefix: tuple[tuple[str, ...], ...] = ()
            net = self.net
            if home is not None and home != net.initial_marking:
                way = self._way(lambda space: _one(space, home))
                if way is None:
                    raise LackingError("no way to the home marking was found")
                prefix = way.firings
                places = tuple(replace(place, marked=bool(home >> p & 1)) for p, place in enumerate(net.places))
                net = replace(net, places=places, properties=())
            if self.discipline is Discipline.STEP:
                raise LackingError(f"there are more than {MARKINGS_MAX:,} markings")
            found = runs_by_search(net, tuple(names), Limits(self._part(0.5), self.limits.memory_bytes))
            return [FiringSequence((*prefix, *run)) for run in found]
        except NotFoundError as error:
            raise LackingError(str(error)) from None
        except (BudgetExceeded, IncompleteGraph):
            raise LackingError(NO_TIME) from None

    def run_in_order(self, one: tuple[str, ...], others: tuple[str, ...]) -> InOrder | None:
        """A run that fires one of these, and one of those at a moment before or after it, and which two."""
        if self.graph is not None:
            return run_in_order(self.graph, one, others) or run_in_order(self.graph, others, one)
        for pair in ((t, u) for t in one for u in others if t != u):
            try:
                runs = self.runs_firing(pair)
            except LackingError:
                continue
            for run in runs:
                fired = [name for (name,) in run.firings]  # a search is by single firings
                if {*pair} <= {*fired}:
                    return (pair if fired.index(pair[0]) < fired.index(pair[1]) else pair[::-1]), run
        return None

    def homes(self) -> Marking | None:
        """A home marking, M0 if it is one; None where there is none or it is not known."""
        space: StateSpace[Any] | None = self.graph or (self.symbolic if self.diagram is not None else None)
        if space is None:
            return None
        try:
            if space.reversible():
                return self.net.initial_marking
            home = space.home()
            if not space.count(home):
                return None
            found = space.witness(home)
        except BudgetExceeded:
            return None
        return None if found is None else self.net.marking(found.marking)

    def parted(self) -> Formula | None:
        """Something that holds for ever from one marking and never again from another: why there is no home marking."""
        space: StateSpace[Any] | None = self.graph or self.symbolic
        return None if space is None else parting(space)


def _one(space: StateSpace[Any], marking: Marking) -> Any:
    return space.satisfying(is_marking(space.net, marking))


def _alone(diagram: Diagram) -> Diagram:
    """The diagram with its second root alone."""
    return replace(diagram, roots=(diagram.roots[1],))
