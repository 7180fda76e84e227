"""A run in which an answer never comes, from a space of sets, which tells at first only the way to where it begins."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.naive_space import NaiveSpace
from support.ring_nets import ring_nets
from support.whole_nets import formulas

from firable.analysis._engine import BudgetExceeded
from firable.analysis.check import check
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Certificate, FiringSequence
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.verdicts.leads_to import leads_to
from firable.analysis.verdicts.unanswered import unanswered
from firable.nets.formula import Formula, Holds, Start
from firable.nets.net import Fairness, Net, Place, Property, PropertyKind, Transition
from firable.nets.verdict import Status, Witness
from firable.semantics.trace import Discipline


def asked(net: Net, given: Formula, then: Formula, fairness: Fairness) -> Net:
    of = Property("asked", PropertyKind.LEADS_TO, given, then, fairness)
    return Net(net.name, net.places, net.transitions, net.signals, properties=(of,))


UNFAIR = Net(
    "unfair",
    (Place("p0"), Place("p1", marked=True), Place("p2")),
    (
        Transition("t0", ("p0",)),
        Transition("t1", (), ("p0",)),
        Transition("t2", ("p1",)),
        Transition("t3", (), ("p1",)),
    ),
)
ANSWERED = Net(
    "answered",
    (Place("p0", marked=True), Place("p1"), Place("p2")),
    (
        Transition("t0", ("p0",), ("p1",)),
        Transition("t1", ("p1",), ("p0",)),
        Transition("t2", ("p0",), ("p2",)),
        Transition("t3", ("p2",), ("p0",)),
    ),
)


@pytest.mark.parametrize(
    "net",
    [
        asked(UNFAIR, Start(), Holds("p2"), Fairness.WEAK),
        asked(UNFAIR, Start(), Holds("p2"), Fairness.STRONG),
        asked(ANSWERED, Holds("p0"), Holds("p1"), Fairness.NONE),
    ],
)
def test_a_response_that_a_diagram_refutes_has_a_run_that_is_fair_and_never_answers(net: Net) -> None:
    report = check(net, method="symbolic")
    verdict = report.verdict("property.asked")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert verdict.witness.cycle
    assert verdict.witness.note.endswith("never comes: the cycle is fair")
    checked = check_document(evidence_of_report(report))
    assert next(one for one in checked if one.record.name == "property.asked").shown


@st.composite
def responses(draw: st.DrawFn) -> tuple[Net, Property]:
    net = draw(st.one_of(ring_nets(signals=True), dense_nets(signals=True)))
    some = formulas([place.name for place in net.places], list(net.transition_index))
    return net, Property("asked", PropertyKind.LEADS_TO, draw(some), draw(some), draw(st.sampled_from(Fairness)))


@pytest.mark.parametrize("discipline", Discipline)
@given(question=responses())
@examples(60)
def test_a_run_is_gone_on_with_through_the_sets_of_any_space(
    discipline: Discipline, question: tuple[Net, Property]
) -> None:
    net, of = question
    assert of.then is not None
    claim = Claim(ClaimKind.NOT_LEADS_TO, of.formula, of.then, of.fairness)

    def is_shown(run: Certificate) -> bool:
        return check_evidence(Evidence(net, discipline, claim, run)).shown is True

    spaces: list[StateSpace[Any]] = [NaiveSpace(net, discipline)]
    if discipline is Discipline.INTERLEAVING:
        spaces.append(explore_symbolically(net, Limits()))
    for space in spaces:
        witness = leads_to(space, of).witness
        if witness is not None:
            assert is_shown(FiringSequence(witness.firings, witness.cycle))


@pytest.mark.parametrize("net", [asked(UNFAIR, Start(), Holds("p2"), fairness) for fairness in Fairness])
def test_where_there_was_no_time_to_go_on_the_evidence_does(net: Net, monkeypatch: pytest.MonkeyPatch) -> None:
    (of,), space = net.properties, explore_symbolically(net, Limits())
    assert isinstance(of, Property)
    whole = leads_to(space, of).witness
    with monkeypatch.context() as patch:
        patch.setattr("firable.analysis.verdicts.leads_to.GOING_ON_SECONDS", 0.0)
        begun = leads_to(space, of).witness
    assert whole is not None
    assert begun is not None
    assert begun.note == "here (start) holds, and (p2) need never come"
    assert (begun.firings, begun.cycle) == (whole.firings[: len(begun.firings)], ())
    assert of.then is not None
    claim = Claim(ClaimKind.NOT_LEADS_TO, of.formula, of.then, of.fairness)
    run = Certifier(net, Discipline.INTERLEAVING, Limits()).certify(claim, begun)
    assert run == FiringSequence(whole.firings, whole.cycle)


def test_no_layer_is_looked_for_when_the_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    chain = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(9))
    net = Net("chain", tuple(Place(f"p{i}", marked=i == 0) for i in range(10)), chain)
    space = NaiveSpace(net, Discipline.INTERLEAVING)
    begun = Witness(marking=("p0",))
    everywhere, nowhere = space.algebra.conjunction([]), space.algebra.disjunction([])
    whole = unanswered(space, everywhere, nowhere, Fairness.NONE, begun, NEVER)
    assert whole is not None
    assert (len(whole.firings), whole.cycle) == (9, ())
    monkeypatch.setattr(NaiveSpace, "before", lambda *_: pytest.fail("no time is left for it"))
    with pytest.raises(BudgetExceeded):
        unanswered(space, everywhere, nowhere, Fairness.NONE, begun, Deadline.after(0))
