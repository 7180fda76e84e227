"""Inductive invariants checked marking by marking: every marking of the net that satisfies one, reachable or not."""

from firable.analysis.evidence.certificate import Certificate, InductiveInvariant
from firable.analysis.goal import Finding
from firable.analysis.structure.ordinary import markable, ordinary
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in


def holds(net: Net, formula: Formula, marking: int) -> bool:
    return evaluate(BOOL, net, formula, holds_in(marking))


def certified(net: Net, certificate: Certificate | None, marking: int) -> bool:
    """Whether a marking satisfies the equations, inequalities and clauses."""
    assert isinstance(certificate, InductiveInvariant)
    full = set(net.names(marking))
    return (
        all(sum(w for p, w in e.weights if p in full) == e.tokens for e in certificate.equations)
        and all(sum(w for p, w in i.weights if p in full) >= i.tokens for i in certificate.inequalities)
        and all(full & set(clause.marked) or set(clause.empty) - full for clause in certificate.clauses)
    )


def check_finding(net: Net, goal: Formula, found: Finding) -> None:
    """A refuted goal is not reachable; the certificate holds in M0, is kept by every firing and excludes the goal."""
    assert found.reachable in (False, None)
    if found.reachable is None:
        assert found.bound
        assert found.certificate is None
        return
    player = Player(net)
    assert not any(holds(net, goal, marking) for marking in player.reachable())
    if found.certificate is None:
        assert len(dead_by_themselves(net)) > 0
        return
    assert isinstance(found.certificate, InductiveInvariant)
    for equation in found.certificate.equations:
        assert set(changes(net, equation.weights)) <= {0}
    for inequality in found.certificate.inequalities:
        assert min(changes(net, inequality.weights), default=0) >= 0
    assert certified(net, found.certificate, net.initial_marking)
    for marking in range(1 << len(net.places)):
        if certified(net, found.certificate, marking):
            assert not holds(net, goal, marking)
            assert all(certified(net, found.certificate, after) for _, after in player.successors(marking))


def changes(net: Net, weights: tuple[tuple[str, int], ...]) -> list[int]:
    """By how much each transition without a self-loop changes a sum of tokens."""
    of = dict(weights)
    return [
        sum(of.get(p, 0) for p in t.outputs) - sum(of.get(p, 0) for p in t.inputs)
        for t in net.transitions
        if not t.self_loops
    ]


def dead_by_themselves(net: Net) -> set[str]:
    """Transitions that contradict themselves, or wait for a place that cannot be marked."""
    reachable = markable(ordinary(net))
    fires = {
        net.transitions[t].name
        for t, inputs in zip(ordinary(net).transitions, ordinary(net).inputs, strict=True)
        if set(inputs) <= reachable
    }
    return {t.name for t in net.transitions} - fires
