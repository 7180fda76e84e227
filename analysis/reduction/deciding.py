"""Decide a goal on the reduced net, by any technique, and answer for the original one.

Every technique that decides a goal is a function of a net, a goal and limits (`firable.analysis.goal`), so a reduction
stands in front of any of them. Where it leaves nothing to decide, the goal having become true or false, it answers by
itself. The witness is lifted and replayed on the original net, so a fault in a rule cannot become a wrong
counterexample; against a wrong "not reachable" there is the proof in each rule, and the tests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from firable.analysis.goal import Finding, Limits
from firable.analysis.reduction.reduce import reduce_for_goal
from firable.nets.formula import Constant, Formula
from firable.nets.net import Net


def decide_reduced(
    net: Net, goal: Formula, limits: Limits, decide: Callable[[Net, Formula, Limits], Finding]
) -> Finding:
    """Reduce the net for the goal, let `decide` decide the rest, and lift its witness.

    The method names the rules. Raises `WitnessError` where a witness does not replay on the original net.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import Deadlock
    >>> def nothing_left(net, goal, limits):
    ...     raise NotImplementedError
    >>> finding = decide_reduced(catalogue_net("one_robot"), Deadlock(), Limits(), nothing_left)
    >>> finding.reachable, finding.method[:44]
    (False, 'structural reduction from 28/15 to 0/0 place')
    """
    reduced = reduce_for_goal(net, goal, limits)
    if isinstance(reduced.goal, Constant):
        witness = reduced.lift(()) if reduced.goal.value else None
        return Finding(reduced.goal.value, f"structural {reduced.summary}", witness)
    finding = decide(reduced.net, reduced.goal, limits)
    witness = finding.witness
    if witness is not None:
        witness = reduced.lift((name for (name,) in witness.firings), witness.note)
    method = f"{finding.method}, after {reduced.summary}"
    return replace(finding, method=method, witness=witness, certificate=None)  # a certificate is one of the small net
