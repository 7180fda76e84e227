"""Evidence from what a technique found: the finding with its claim, or the markings of a small net.

Nothing here needs to be right for a check to be sound: what is wrong is refused by the checker.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final

from firable.analysis.evidence.certificate import Certificate, FiringSequence, MarkingSet
from firable.analysis.evidence.document import Claim, ClaimKind, Evidence
from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.induction.pdr import decide_by_pdr
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.analysis.structure.contact import decide_contact_by_invariants
from firable.analysis.structure.state_equation import decide_by_state_equation
from firable.analysis.verdicts.behaviour import CONTACT_FREE, LIVE, REVERSIBLE
from firable.analysis.verdicts.goals import goals_of
from firable.nets.formula import Firable, Formula, Start
from firable.nets.net import Net, Property, PropertyKind
from firable.nets.verdict import Status, Verdict
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 20_000
_SECONDS: Final = 10.0  # for k-induction, where nobody sets a limit


def evidence_of_finding(
    net: Net, goal: Formula, finding: Finding, discipline: Discipline = Discipline.INTERLEAVING
) -> Evidence | None:
    """The evidence that a finding comes with: its witness, or its certificate; None where it has neither.

    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import Deadlock
    >>> net = family_net("token_ring-5")
    >>> found = evidence_of_finding(net, Deadlock(), decide_by_k_induction(net, Deadlock(), Limits()))
    >>> str(found.claim) if found else None
    'never (deadlock)'
    """
    if finding.reachable and finding.witness is not None:
        kind, certificate = ClaimKind.REACHABLE, FiringSequence(finding.witness.firings)
        return Evidence(net, discipline, Claim(kind, goal), certificate)
    if finding.reachable is False and finding.certificate is not None:
        return Evidence(net, discipline, Claim(ClaimKind.NEVER, goal), finding.certificate)
    return None


def evidence_of_graph(graph: ReachabilityGraph, claim: Claim) -> Evidence | None:
    """The markings of a complete and small graph as evidence of a claim; None where it is larger, or none of it.

    Of `always_possible` with the least number of firings that lead from each marking to the goal. Whether the claim
    holds is not asked, but for a goal that is out of reach, of which there is no distance.
    """
    if not graph.complete or graph.n_markings > MARKINGS_MAX or claim.kind is ClaimKind.REACHABLE:
        return None
    markings = tuple(graph.marking(i) for i in range(graph.n_markings))
    certificate: Certificate = MarkingSet(markings)
    if claim.kind is ClaimKind.ALWAYS_POSSIBLE:
        distances = _distances(graph, claim.goal)
        if None in distances:
            return None
        certificate = MarkingSet(markings, tuple(d for d in distances if d is not None))
    return Evidence(graph.net, graph.discipline, claim, certificate)


def _distances(graph: ReachabilityGraph, goal: Formula) -> list[int | None]:
    before: list[list[int]] = [[] for _ in range(graph.n_markings)]
    for i in range(graph.n_markings):
        for _, after in graph.successors(i):
            before[after].append(i)
    distances: list[int | None] = [None] * graph.n_markings
    todo = deque(i for i, holds in enumerate(graph.satisfying(goal)) if holds)
    for i in todo:
        distances[i] = 0
    while todo:
        target = todo.popleft()
        for i in before[target]:
            if distances[i] is None:
                distances[i] = (distances[target] or 0) + 1
                todo.append(i)
    return distances


def evidence_of_verdict(net: Net, verdict: Verdict, graph: ReachabilityGraph, limits: Limits) -> dict[str, Evidence]:
    """Evidence of each claim that a decided verdict comes down to, by name; what cannot be had is left out.

    The firing sequence of the verdict itself, the markings where `graph` holds all of them and they are few, or else an
    inductive invariant, looked for anew within the limits.
    """
    wanted = dict(_claims(net, verdict))
    found = {}
    for name, claim in wanted.items():
        evidence = _evidence(net, verdict, claim, graph, limits, single=len(wanted) == 1)
        if evidence is not None:
            found[name] = evidence
    return found


def _claims(net: Net, verdict: Verdict) -> Iterator[tuple[str, Claim]]:
    """What a decided verdict claims of the reachable markings, each with a name."""
    proved, name = verdict.status is Status.PROVED, verdict.name
    property_ = next((of for of in net.properties if f"property.{of.name}" == name), None)
    if verdict.status is Status.UNKNOWN:
        return
    if (asked := goals_of(net, name)) is not None:
        _, goals = asked
        for goal in goals:
            # Of several goals a verdict that is not proved says which failed by its subjects.
            if proved or len(goals) == 1 or (goal.wanted and set(goal.subjects) & set(verdict.subjects)):
                kind = ClaimKind.REACHABLE if goal.wanted is proved else ClaimKind.NEVER
                yield ".".join((name, *goal.subjects)), Claim(kind, goal.formula)
    elif proved and name == LIVE.name:
        for transition in net.transitions:
            yield f"{name}.{transition.name}", Claim(ClaimKind.ALWAYS_POSSIBLE, Firable(transition.name))
    elif proved and name == REVERSIBLE.name:
        yield name, Claim(ClaimKind.ALWAYS_POSSIBLE, Start())
    elif proved and isinstance(property_, Property) and property_.kind is PropertyKind.ALWAYS_POSSIBLE:
        yield name, Claim(ClaimKind.ALWAYS_POSSIBLE, property_.formula)


def _evidence(
    net: Net, verdict: Verdict, claim: Claim, graph: ReachabilityGraph, limits: Limits, *, single: bool
) -> Evidence | None:
    discipline = graph.discipline
    if claim.kind is ClaimKind.REACHABLE:
        witness = verdict.witness if single else None
        if witness is None:
            witness = graph.witness(graph.satisfying(claim.goal))
        return None if witness is None else Evidence(net, discipline, claim, FiringSequence(witness.firings))
    if (found := evidence_of_graph(graph, claim)) is not None:
        return found
    if claim.kind is ClaimKind.NEVER:
        finding = _contact_excluded(net, verdict, limits) or _proof(net, claim.goal, limits, discipline)
        return evidence_of_finding(net, claim.goal, finding, discipline)
    return None


def _contact_excluded(net: Net, verdict: Verdict, limits: Limits) -> Finding | None:
    """The invariants that exclude contact, of a net of any size; None where they do not, or another thing is asked."""
    if verdict.name != CONTACT_FREE.name:
        return None
    found = decide_contact_by_invariants(net, limits)
    return found if found.certificate is not None else None


def _proof(net: Net, goal: Formula, limits: Limits, discipline: Discipline) -> Finding:
    """An inductive invariant against a goal, by the methods that give one, from the quick to the thorough."""
    if discipline is Discipline.STEP:
        return decide_by_k_induction(net, goal, limits, discipline=discipline)
    found = decide_by_state_equation(net, goal, limits)
    if found.reachable is None:
        left = limits.deadline.left_seconds
        third = limits.deadline.within(_SECONDS if left is None else left / 3)
        found = decide_by_k_induction(net, goal, Limits(third, limits.memory_bytes))
    return decide_by_pdr(net, goal, limits) if found.reachable is None else found
