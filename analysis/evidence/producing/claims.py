"""A certificate for a claim, from what the run that decided it has left, or else by a technique that leaves one.

First comes what is at hand: the invariant or the firing sequence of a finding, the markings where the run held all of
them (`spaces`). Where the run that decided left nothing behind, another technique is asked within the time that is left
(`nevers` for what is never so). Nothing here needs to be right for a check to be sound: what is wrong is refused by the
checker.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.evidence.certificate import (
    Certificate,
    Continuation,
    Diagram,
    FiringSequence,
    Labelling,
    Markings,
    Reduction,
    Theorem,
    Unfolded,
)
from firable.analysis.evidence.checking.theorems import check_premises
from firable.analysis.evidence.claims import NEVER_FALSE, Claim, ClaimKind, as_ctl, tidy, without_start
from firable.analysis.evidence.producing.labels import TooLargeError, drawn, labelling
from firable.analysis.evidence.producing.lacking import LackingError, which_ended
from firable.analysis.evidence.producing.nevers import Nevers
from firable.analysis.evidence.producing.ranks import progress
from firable.analysis.evidence.producing.runs import (
    InOrder,
    NotFoundError,
    maximal,
    parting,
    run_by_way_of,
    run_in_order,
    runs_by_search,
    runs_on_graph,
)
from firable.analysis.evidence.producing.spaces import WIDE_MAX, Spaces
from firable.analysis.evidence.producing.theorems import theorem_on
from firable.analysis.evidence.producing.unfolding import unfolded_markings
from firable.analysis.goal import Finding, Limits
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.analysis.spaces.space import StateSpace
from firable.analysis.verdicts.fair_runs import fair_markings
from firable.analysis.verdicts.unanswered import unanswered
from firable.nets.bits import bits
from firable.nets.diagnostics import InputError
from firable.nets.formula import Firable, Formula
from firable.nets.net import Marking, Net, holding
from firable.nets.temporal import Temporal
from firable.nets.verdict import Witness
from firable.semantics.player import Player
from firable.semantics.trace import Discipline


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
        self.net, self.discipline, self.limits = net, discipline, limits
        self.spaces = Spaces(net, discipline, limits, space)
        self.nevers = Nevers(self.spaces, {tidy(goal): found for goal, found in findings})
        self._ends: list[tuple[Continuation, Callable[[Formula], bool]]] = []
        self.deadlock: Witness | None = None

    def shown(self, claim: Claim, witness: Witness | None = None) -> tuple[tuple[Claim, Certificate], ...]:
        """A claim with its certificate, as a record has it: nothing where it needs none. Raises `LackingError`."""
        return () if claim == NEVER_FALSE else ((claim, self.certify(claim, witness)),)

    def certify(self, claim: Claim, witness: Witness | None = None) -> Certificate:
        """A certificate for a claim; `witness` is the run that the verdict came with.

        Raises `LackingError` where none is found.
        """
        try:
            found = self._certificate(claim, witness)
        except (BudgetExceeded, IncompleteGraph) as error:
            raise LackingError(which_ended(error)) from None
        except TooLargeError as error:
            raise LackingError(str(error)) from None
        if found is None:
            raise LackingError(f"no certificate was found for '{claim}'")
        return found

    def _certificate(self, claim: Claim, witness: Witness | None) -> Certificate | None:
        match claim.kind:
            case ClaimKind.NEVER:
                return self.nevers.certificate(claim.state_goal)
            case ClaimKind.REACHABLE:
                found = witness or self.spaces.way(lambda space: space.satisfying(claim.state_goal))
                return None if found is None else FiringSequence(found.firings)
            case ClaimKind.LOST:
                return self._lost(claim.state_goal, witness)
            case ClaimKind.NOT_LTL:
                return None if witness is None else maximal(self.net, self.discipline, witness)
            case ClaimKind.NOT_LEADS_TO:
                return None if witness is None else self._unanswered(claim, witness)
            case ClaimKind.LTL:
                return self._unfolded(claim)
            case ClaimKind.LEADS_TO:
                if self.spaces.wide is None or self.spaces.wide_markings is None:
                    many = f"ranks for a response are written for up to {WIDE_MAX:,} markings"
                    raise LackingError(self.spaces.ended(WIDE_MAX) or many)
                return progress(self.spaces.wide, self.spaces.wide_markings, claim)
            case ClaimKind.ORDERED:
                return None if self.spaces.markings is None else Labelling(self.spaces.markings)
            case ClaimKind.UNORDERED:
                return None if witness is None else self._unordered(witness)
            case ClaimKind.LIVE | ClaimKind.HOME:
                return self.theorem(claim)
            case ClaimKind.FIRES | ClaimKind.LATER:
                raise LackingError("runs are looked for together")
        return self._labelled(claim)

    def _unfolded(self, claim: Claim) -> Unfolded | None:
        """Markings that serve every formula, where they are few; else those that this one asks for; else all."""
        if self.spaces.markings is not None:
            return Unfolded(self.spaces.markings)
        if self.discipline is Discipline.INTERLEAVING:
            try:
                found = unfolded_markings(self.net, claim.goal, WIDE_MAX, self.spaces.part(0.2))
                return None if found is None else Unfolded(found)
            except (TooLargeError, BudgetExceeded):
                pass  # all markings, which a graph finds faster, may be few enough
        if self.spaces.wide_markings is None:
            raise LackingError(self.spaces.ended(WIDE_MAX) or f"a tableau is unfolded on up to {WIDE_MAX:,} markings")
        return Unfolded(self.spaces.wide_markings)

    def asked_for(self, formula: Temporal) -> Unfolded:
        """What shows a formula of LTL of which it is not known yet whether it holds; raises `LackingError`."""
        if self.discipline is Discipline.STEP:
            raise LackingError("what fires is not spoken of in steps")
        try:
            found = unfolded_markings(self.net, formula, WIDE_MAX, self.spaces.part(0.3))
        except TooLargeError as error:
            raise LackingError(str(error)) from None
        except BudgetExceeded as error:
            raise LackingError(which_ended(error)) from None
        if found is None:
            raise LackingError("some run refutes the formula")
        return Unfolded(found)

    def _unanswered(self, claim: Claim, witness: Witness) -> FiringSequence | None:
        """The run of the witness, gone on with where it does not go on for ever and may."""
        if witness.cycle or Player(self.net).deadlocked(self.net.marking(witness.marking)):
            return FiringSequence(witness.firings, witness.cycle)
        if (space := self.spaces.asked) is None:
            raise LackingError("there are too many markings to find the run that goes on without an answer")
        without = space.algebra.negation(space.satisfying(claim.then))
        around = fair_markings(space, without, claim.fairness)
        whole = unanswered(space, without, around, claim.fairness, witness, space.deadline)
        return None if whole is None else FiringSequence(whole.firings, whole.cycle)

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
        if self.spaces.graph is not None and self.spaces.markings is not None:
            return labelling(self.spaces.graph, self.spaces.markings, formula)
        if self.spaces.symbolic is not None and self.spaces.diagram is not None:
            return labelling(self.spaces.symbolic, self.spaces.diagram, formula)
        if self.spaces.many is not None and self.spaces.many_markings is not None:
            return labelling(self.spaces.many, self.spaces.many_markings, formula, self.spaces.distances)
        raise LackingError("there are more markings than are listed, and no decision diagram of them at hand")

    def _lost(self, goal: Formula, witness: Witness | None) -> Continuation | None:
        spelled = tidy(without_start(self.net, goal))
        for known, misses in self._ends:
            if misses(spelled):
                return known
        # After a deadlock there is one marking, and whatever does not hold in it is lost.
        dead = self.deadlock
        if dead is not None and (found := self._never_after(dead, goal, spelled)) is not None:
            return found

        def lost(space: StateSpace[Any]) -> Any:
            return space.algebra.negation(space.backward(space.satisfying(goal)))

        space = self.spaces.asked
        if space is not None and (
            witness is None or not space.contains(lost(space), self.net.marking(witness.marking))
        ):
            witness = self.spaces.way(lost)
        return None if witness is None else self._never_after(witness, goal, spelled)

    def _never_after(self, way: Witness, goal: Formula, spelled: Formula) -> Continuation | None:
        """What shows that after this run the goal is never reached; kept, since it shows the same of other goals."""
        marking = self.net.marking(way.marking)
        net = replace(self.net, places=holding(self.net.places, marking), properties=())
        spaces = Spaces(net, self.discipline, self.limits)
        if spaces.graph is not None:
            return self._never_on(spaces.graph, spaces.markings, way, spelled)
        if self.spaces.symbolic is not None:
            symbolic = self.spaces.symbolic
            after = symbolic.engine.forward(symbolic.engine.single(list(bits(marking))))
            if after & symbolic.satisfying(goal):
                return None
            found = Continuation(way.firings, Labelling(_alone(drawn(symbolic, [after]))))
            self._ends.append((found, lambda other: not after & symbolic.satisfying(other)))
            return found
        if self.spaces.many is not None and spaces.many is not None:
            return self._never_on(spaces.many, spaces.many_markings, way, spelled)
        shown = Nevers(spaces).certificate(spelled)
        return None if shown is None else Continuation(way.firings, shown)

    def _never_on(
        self, graph: ReachabilityGraph, markings: Markings | None, way: Witness, goal: Formula
    ) -> Continuation | None:
        """The markings after a run as a closed set, where none of them meets the goal."""
        if markings is None or graph.satisfying(goal).any():
            return None
        found = Continuation(way.firings, Labelling(markings))
        self._ends.append((found, lambda other: not graph.satisfying(other).any()))
        return found

    def never_fires(self, name: str) -> Reduction | None:
        """What shows on a smaller net that a transition is dead, where the run that decided left no markings behind."""
        return self.nevers.reduced(Firable(name)) if self.spaces.given is None else None

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
            return theorem_on(self.net, self.nevers.contact_excluded, self.spaces.part(0.5))
        except LackingError as error:
            return str(error)
        except (BudgetExceeded, IncompleteGraph) as error:
            return which_ended(error)

    def runs_firing(self, names: Iterable[str], home: Marking | None = None) -> list[FiringSequence]:
        """Runs that fire all these transitions, each as many as it can; after they met a home marking, if it is given.

        Raises `LackingError` where a transition fires in none of them.
        """
        try:
            if self.spaces.graph is not None:
                return runs_on_graph(self.spaces.graph, tuple(names), home)
            prefix: tuple[tuple[str, ...], ...] = ()
            net = self.net
            if home is not None and home != net.initial_marking:
                way = self.spaces.way_to(home)
                if way is None:
                    raise LackingError("no way to the home marking was found")
                prefix = way.firings
                net = replace(net, places=holding(net.places, home), properties=())
            if self.discipline is Discipline.STEP:
                raise LackingError(self.spaces.ended(WIDE_MAX) or f"there are more than {WIDE_MAX:,} markings")
            found, left = runs_by_search(
                net, tuple(names), Limits(self.spaces.part_of_a_run(), self.limits.memory_bytes)
            )
            found += [self._run_firing(name, home) for name in left]
            return [FiringSequence((*prefix, *run)) for run in found]
        except NotFoundError as error:
            raise LackingError(str(error)) from None
        except (BudgetExceeded, IncompleteGraph) as error:
            raise LackingError(which_ended(error)) from None

    def _run_firing(self, name: str, home: Marking | None) -> tuple[tuple[str, ...], ...]:
        """A run from M0 that fires a transition which no search met, from whichever space there is."""
        way = None
        if home is None or home == self.net.initial_marking:
            way = self.spaces.way(lambda space: space.satisfying(Firable(name)))
        if way is None:
            raise LackingError(f"no run was found that fires {name}")
        return (*way.firings, (name,))

    def run_in_order(self, one: tuple[str, ...], others: tuple[str, ...]) -> InOrder | None:
        """A run that fires one of these, and one of those at a moment before or after it, and which two."""
        if self.spaces.graph is not None:
            return run_in_order(self.spaces.graph, one, others) or run_in_order(self.spaces.graph, others, one)
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

    def later(self, goal: Formula) -> FiringSequence:
        """A run that meets the home marking, and then the goal; raises `LackingError` where none is found."""
        home, found = self.home, None
        try:
            if home is None:
                raise LackingError("no home marking is known")
            if (graph := self.spaces.many) is not None:
                found = run_by_way_of(graph, home, graph.satisfying(goal))
            elif home == self.net.initial_marking:
                way = self.spaces.way(lambda space: space.satisfying(goal))
                found = None if way is None else FiringSequence(way.firings)
        except (BudgetExceeded, IncompleteGraph) as error:
            raise LackingError(which_ended(error)) from None
        if found is None:
            raise LackingError("no run was found from the home marking to the goal")
        return found

    @cached_property
    def home(self) -> Marking | None:
        """A home marking, M0 if it is one; None where there is none or it is not known."""
        try:
            space: StateSpace[Any] | None = self.spaces.graph or (
                self.spaces.symbolic if self.spaces.diagram is not None else self.spaces.many
            )
            if space is None:
                return None
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
        """Something that holds for ever from one marking and never again from another: why there is no home marking.

        Raises `LackingError` where time or memory do not suffice.
        """
        try:
            space = self.spaces.asked
            return None if space is None else parting(space)
        except (BudgetExceeded, IncompleteGraph) as error:
            raise LackingError(which_ended(error)) from None


def _alone(diagram: Diagram) -> Diagram:
    """The diagram with its second root alone."""
    return replace(diagram, roots=(diagram.roots[1],))
