"""What shows that a goal is never met: of several ways the first that leads to it, from what is at hand to a search.

At hand are the invariant of a finding, and the markings where they are few or a decision diagram holds them. Else few
places of the net may exclude the goal; or the net is made smaller for it, and what is left of it has mostly few
markings; else stubborn sets, a diagram, more places, or an inductive invariant show it of the net as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.evidence.certificate import (
    InductiveInvariant,
    Labelling,
    NeverCertificate,
    Reduction,
    StubbornSets,
)
from firable.analysis.evidence.meaning import contact
from firable.analysis.evidence.producing.lacking import NO_TIME, LackingError
from firable.analysis.evidence.producing.reductions import Plain, reduction
from firable.analysis.evidence.producing.spaces import Spaces
from firable.analysis.evidence.producing.stubborn import stubborn_sets
from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.induction.pdr import decide_by_pdr
from firable.analysis.projection.projected import ROOM, Room
from firable.analysis.projection.refining import decide_by_projection
from firable.analysis.spaces.symbolic import SymbolicSpace
from firable.analysis.structure.contact import decide_contact_by_invariants
from firable.analysis.structure.state_equation import decide_by_state_equation
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.semantics.trace import Discipline

_FEW: Final = Room(2**17, 0)
_NOTHING_FOUND: Final[Mapping[Formula, Finding]] = {}


class Nevers:
    """Certificates that goals are never met in one net."""

    def __init__(self, spaces: Spaces, findings: Mapping[Formula, Finding] = _NOTHING_FOUND) -> None:
        self.spaces, self.net, self.discipline = spaces, spaces.net, spaces.discipline
        self._findings = findings
        self._contact: NeverCertificate | None = None

    def certificate(self, goal: Formula) -> NeverCertificate | None:
        """What shows that a goal is never met; None where it is, or nothing was found that does."""
        finding, spaces = self._findings.get(goal), self.spaces
        if finding is not None and isinstance(finding.certificate, NeverCertificate):
            return finding.certificate
        if spaces.graph is not None and spaces.markings is not None:
            return self._listed(goal)
        if goal == self._contact_goal and (found := self._contact_free()) is not None:
            return found
        if isinstance(spaces.given, SymbolicSpace) and (found := self._on_diagram(goal)) is not None:
            return found
        less = self._projected(goal, _FEW) or self.reduced(goal) or self._stubborn(goal)
        more = less or self._on_diagram(goal) or self._on_many(goal) or self._projected(goal, ROOM)
        return more or self._induced(goal)

    def contact_excluded(self) -> NeverCertificate | None:
        """What shows that the net is contact-free."""
        return self.certificate(self._contact_goal)

    def _plain(self, goal: Formula) -> Plain | None:
        """The same without a reduction, of a net that was reduced."""
        if self.spaces.graph is not None and self.spaces.markings is not None:
            return self._listed(goal)
        return self._stubborn(goal) or self._on_diagram(goal) or self._induced(goal)

    def _listed(self, goal: Formula) -> Labelling | None:
        graph, markings = self.spaces.graph, self.spaces.markings
        return None if graph is None or markings is None or graph.satisfying(goal).any() else Labelling(markings)

    def _on_diagram(self, goal: Formula) -> Labelling | None:
        symbolic, diagram = self.spaces.symbolic, self.spaces.diagram
        return None if symbolic is None or diagram is None or symbolic.satisfying(goal) else Labelling(diagram)

    def _on_many(self, goal: Formula) -> Labelling | None:
        graph, many = self.spaces.many, self.spaces.many_markings
        return None if many is None or graph is None or graph.satisfying(goal).any() else Labelling(many)

    def reduced(self, goal: Formula) -> Reduction | None:
        """The goal shown of a smaller net, in half of the time that is left."""
        if self.discipline is Discipline.STEP:
            return None
        limits = Limits(self.spaces.part_of_a_search(0.5), self.spaces.limits.memory_bytes)

        def never(small: Net, of: Formula) -> Plain | None:
            return Nevers(Spaces(small, Discipline.INTERLEAVING, limits))._plain(of)

        try:
            return reduction(self.net, goal, limits, never)
        except (BudgetExceeded, LackingError):
            return None

    def _projected(self, goal: Formula, room: Room) -> Labelling | None:
        """All markings on a few places that exclude the goal, with any tokens on the others."""
        if self.discipline is Discipline.STEP:
            return None
        limits = Limits(self.spaces.part_of_a_search(0.2), self.spaces.limits.memory_bytes)
        found = decide_by_projection(self.net, goal, limits, room=room)
        return found.certificate if isinstance(found.certificate, Labelling) else None

    def _stubborn(self, goal: Formula) -> StubbornSets | None:
        """Few markings with stubborn sets, where they are few."""
        if self.discipline is Discipline.STEP:
            return None
        try:
            return stubborn_sets(
                self.net, goal, Limits(self.spaces.part_of_a_search(0.2), self.spaces.limits.memory_bytes)
            )
        except BudgetExceeded:
            return None

    @cached_property
    def _contact_goal(self) -> Formula:
        return contact(self.net)

    def _contact_free(self) -> NeverCertificate | None:
        """The invariants that exclude contact, of a net of any size; None where they do not."""
        if self._contact is None:
            limits = Limits(self.spaces.part(0.3), self.spaces.limits.memory_bytes)
            found = decide_contact_by_invariants(self.net, limits)
            self._contact = found.certificate if isinstance(found.certificate, InductiveInvariant) else None
        return self._contact

    def _induced(self, goal: Formula) -> InductiveInvariant | None:
        """An inductive invariant against a goal, by the methods that give one, from the quick to the thorough."""
        net, limits, part = self.net, self.spaces.limits, self.spaces.part
        if self.discipline is Discipline.STEP:
            tries: tuple[Callable[[], Finding], ...] = (
                lambda: decide_by_k_induction(net, goal, limits, discipline=self.discipline),
            )
        else:
            tries = (
                lambda: decide_by_state_equation(net, goal, replace(limits, deadline=part(0.3))),
                lambda: decide_by_k_induction(net, goal, replace(limits, deadline=part(0.3))),
                lambda: decide_by_pdr(net, goal, replace(limits, deadline=part(0.8))),
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
