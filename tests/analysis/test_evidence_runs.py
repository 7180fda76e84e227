"""Runs as evidence: each thing that is asked of one is needed, or a claim that is false would be shown by it."""

from dataclasses import replace

import pytest
from support.evidence_examples import ENDING, LOOP, RACING, TURNS, net
from support.true_claims import true

from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.nets.diagnostics import InputError
from firable.nets.formula import parse_formula
from firable.nets.net import Fairness, Net, Place, Transition
from firable.nets.temporal import parse_temporal
from firable.semantics.trace import Discipline

FIVE = net("five", "a", ("a", "b"), ("b", "c"), ("c", "d"), ("d", "e"), ("e", "a"))
ANSWERING = Net("answering", TURNS.places[2:], TURNS.transitions[2:])
IDLING = Net("idling", (Place("asked", marked=True), Place("done")), (Transition("idle"),))


def run(of: Net, claim: Claim, firings: str, cycle: str) -> Evidence:
    parts = [tuple((name,) for name in names.split()) for names in (firings, cycle)]
    return Evidence(of, Discipline.INTERLEAVING, claim, FiringSequence(*parts))


def refuting(of: Net, text: str, firings: str, cycle: str = "") -> Evidence:
    return run(of, Claim(ClaimKind.NOT_LTL, parse_temporal(text)), firings, cycle)


def unanswered(
    of: Net, asked: str, answer: str, firings: str, cycle: str = "", fairness: Fairness = Fairness.NONE
) -> Evidence:
    claim = Claim(ClaimKind.NOT_LEADS_TO, parse_formula(asked), parse_formula(answer), fairness)
    return run(of, claim, firings, cycle)


FALSE = {
    "the cycle does not close before the end comes": refuting(FIVE, "F c", "", "t0"),
    "what is met comes before the cycle is over": refuting(FIVE, "X X F b", "", "t0 t1 t2 t3 t4"),
    "what is met comes last": refuting(FIVE, "F e", "", "t0 t1 t2 t3 t4"),
    "what fires first is no part of the cycle": refuting(LOOP, "fires(t0)", "t0", "t1 t0"),
    "what fires in the end fires in the cycle": refuting(LOOP, "X X fires(t0)", "t0", "t1 t0"),
    "the answer comes first in the cycle": unanswered(ANSWERING, "asked", "done", "go", "again go"),
    "the answer comes as it is asked for": unanswered(TURNS, "done", "done", "go again", "tick tock"),
}
TRUE = {
    "in the end nothing fires": refuting(ENDING, "X fires(end)", "end"),
    "it was asked for at first": unanswered(ENDING, "a", "false", "end"),
    "it is asked for now and then": unanswered(TURNS, "asked and b", "done", "", "tick tock"),
    "what is enabled all the time fires": unanswered(IDLING, "asked", "done", "", "idle", Fairness.WEAK),
    "what is enabled at times fires": unanswered(IDLING, "asked", "done", "", "idle", Fairness.STRONG),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_run_is_refused_where(name: str) -> None:
    assert not true(FALSE[name])
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(FALSE[name])


@pytest.mark.parametrize("name", TRUE)
def test_a_run_is_taken_where(name: str) -> None:
    assert true(TRUE[name])
    assert check_evidence(TRUE[name]).shown


def test_the_step_without_order_is_the_last_of_its_run() -> None:
    ways = (*RACING.transitions, Transition("on", (), ("c",), inhibitive=("a", "b")))
    of = replace(RACING, places=(*RACING.places, Place("c")), transitions=ways)
    both = Evidence(of, Discipline.STEP, Claim(ClaimKind.UNORDERED), FiringSequence((("t", "u"),)))
    assert true(both)
    assert check_evidence(both).shown
    for firings in ((), (("t", "u"), ("on",))):
        with pytest.raises(InputError, match="can be replayed one firing after the other"):
            check_evidence(replace(both, certificate=FiringSequence(firings)))
