"""Upper bounds of tokens where no technique holds all markings: each step of the halving is a goal.

Whether at least k tokens can stand on some places together is a state formula, so whoever decides goals may answer: the
state equation, which is where place invariants say that k is too many, a walk that meets k, or a search. Each answer
halves what is open: where k is reached the marking that shows it often holds more than k, and where it is not all
greater numbers are excluded. What is told is exact, or nothing.

Rejected: the greatest sum that the state equation alone allows, by linear programming. It may be too great, and then
says nothing about what is reached; as an answer to "at least k?" it is used anyway.
"""

from __future__ import annotations

from collections.abc import Callable

from firable.analysis.goal import Finding
from firable.analysis.spaces.space import WitnessError
from firable.nets.formula import Compare, Count, Formula, Sign
from firable.nets.net import Marking, Net

Reached = Callable[[Formula], Finding | None]
"""What is found of a goal; None where that is not decided."""


def greatest(net: Net, places: tuple[str, ...], reached: Reached) -> tuple[int, tuple[Finding, ...]] | None:
    """The greatest number of tokens on some places together in a reachable marking, and the findings it rests on.

    A place that stands twice counts twice. None where a finding is missing. The last finding that reaches its goal, if
    there is one, leads to a marking with the bound.

    >>> from firable.nets.catalogue import catalogue_net
    >>> greatest(catalogue_net("one_robot"), ("robot.free", "mc.free"), lambda goal: None)
    (2, ())
    """

    def held(marking: Marking) -> int:
        return sum(marking >> net.place_index[place] & 1 for place in places)

    low, high = held(net.initial_marking), len(places)
    findings: list[Finding] = []
    while low < high:
        middle = (low + high + 1) // 2
        finding = reached(Compare(Count(places), Sign.AT_LEAST, Count(added=middle)))
        if finding is None:
            return None
        findings.append(finding)
        if not finding.reachable:
            high = middle - 1
        elif finding.witness is None or (more := held(net.marking(finding.witness.marking))) < middle:
            raise WitnessError(f"{finding.method} shows a marking with fewer tokens than it says")
        else:
            low = more
    return low, tuple(findings)
