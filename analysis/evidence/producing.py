"""Evidence from what a technique found: the finding with its claim, or the markings of a small net.

Nothing here needs to be right for a check to be sound: what is wrong is refused by the checker.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from firable.analysis.evidence.certificate import Certificate, FiringSequence, MarkingSet
from firable.analysis.evidence.document import Claim, ClaimKind, Evidence
from firable.analysis.goal import Finding
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 20_000


def evidence_of_finding(
    net: Net, goal: Formula, finding: Finding, discipline: Discipline = Discipline.INTERLEAVING
) -> Evidence | None:
    """The evidence that a finding comes with: its witness, or its certificate; None where it has neither.

    >>> from firable.analysis.goal import Limits
    >>> from firable.analysis.induction.k_induction import decide_by_k_induction
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
