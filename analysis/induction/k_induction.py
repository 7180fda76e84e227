"""k-induction: a goal that is not reached in k firings, and after k markings without it cannot come next.

Sheeran, Singh and Stålmarck (2000, "Checking safety properties using induction and a SAT-solver"). The base is bounded
model checking; the step asks for a run of k + 1 markings, from anywhere, of which only the last is in the goal. If
there is none, the goal is unreachable. Alone this proves next to nothing of a Petri net: "anywhere" holds markings with
two tokens where there is one. With the facts of `firable.analysis.induction.strengthening` in every marking it proves
philosophers of any number at the first attempt, and often the facts alone exclude the goal, without any firing.

A run that refutes the step starts in some marking; if a trap that is marked in M0 is empty there, the marking is
unreachable, the trap is a new fact, and the question is asked again. Only a run that no trap excludes makes k grow.

The base runs over firings in parallel, which reach further for the same k; the step over the discipline's own, so that
the certificate is about what the net really does. Not tried: markings that are all different, which makes the
method complete and on nets, whose runs without repetition are as long as there are markings, only slower.
"""

from __future__ import annotations

from time import perf_counter
from typing import Final

from firable.analysis.evidence.certificate import InductiveInvariant
from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.bounded import BoundedSearch
from firable.analysis.induction.encoding import interleaving_relation, step_relation
from firable.analysis.induction.session import LimitReachedError, Session
from firable.analysis.induction.smt import Term
from firable.analysis.induction.strengthening import Facts, Traps, structural_facts
from firable.analysis.induction.unrolling import Unrolling
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.formulas import evaluate
from firable.semantics.trace import Discipline

METHOD: Final = "k-induction with invariants and traps"
DEPTH_MAX: Final = 50


def decide_by_k_induction(
    net: Net,
    goal: Formula,
    limits: Limits,
    *,
    discipline: Discipline = Discipline.INTERLEAVING,
    depth_max: int = DEPTH_MAX,
) -> Finding:
    """Prove that no reachable marking satisfies the goal, or find a run into it, or neither.

    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import And, Holds
    >>> goal = And((Holds("p1.eating"), Holds("p2.eating")))
    >>> found = decide_by_k_induction(family_net("philosophers-30"), goal, Limits())
    >>> found.reachable, found.certificate.depth
    (False, 0)
    """
    start, proof = perf_counter(), None
    try:
        with Session(limits) as session:
            proof = _Proof(session, net, goal, discipline)
            reachable = proof.decide(depth_max)
    except LimitReachedError:
        reachable = None
    cost = Cost(seconds=perf_counter() - start)
    if proof is None or reachable is None:
        depth = 0 if proof is None else proof.depth
        return Finding(None, METHOD, bound=f"induction over up to {depth} firings shows nothing", cost=cost)
    if reachable:
        return Finding(reachable, METHOD, proof.found, cost=cost)
    certificate = InductiveInvariant(proof.facts.equations, proof.facts.clauses, proof.depth)
    return Finding(reachable, METHOD, cost=cost, certificate=certificate)


class _Proof:
    """What is known at one moment: the facts, and up to which depth neither base nor step has answered."""

    def __init__(self, session: Session, net: Net, goal: Formula, discipline: Discipline) -> None:
        self.session, self.net, self.goal, self.discipline = session, net, goal, discipline
        self.facts = Facts()
        self.depth = 0
        self.found: Witness | None = None

    def decide(self, depth_max: int) -> bool | None:
        """Whether the goal is reachable; None where `depth_max` comes first."""
        net = self.net
        base = BoundedSearch(self.session, net, self.goal, self.discipline)
        if (found := base.witness(0)) is not None:
            self.found = found
            return True
        self.facts, self.traps = structural_facts(net, self.session.deadline), Traps(net, self.discipline)
        encode = interleaving_relation if self.discipline is Discipline.INTERLEAVING else step_relation
        runs = Unrolling(self.session, net, encode)
        runs.learn((*self.facts.equations, *self.facts.clauses))
        goal = evaluate(runs.terms, net, self.goal, runs.places.__getitem__)
        while self._step_refuted(runs, goal):
            if self.depth == depth_max:
                return None
            self.depth += 1
            if (found := base.witness(self.depth)) is not None:
                self.found = found
                return True
            runs.solver.add(runs.at(self.depth - 1, runs.terms.negation(goal)))
            runs.extend()
        return False

    def _step_refuted(self, runs: Unrolling, goal: Term) -> bool:
        """Whether a run, no marking of which a marked trap excludes, has the goal in its last marking only."""
        while runs.ask_at(self.depth, goal):
            model = runs.solver.model()
            markings = (runs.marking(model, k) for k in range(runs.depth + 1))
            traps = (self.traps.against(marking, self.session.deadline) for marking in markings)
            if (trap := next(filter(None, traps), None)) is None:
                return True
            self.session.check_time()
            self.facts = Facts(self.facts.equations, (*self.facts.clauses, trap))
            runs.learn([trap])
        return False
