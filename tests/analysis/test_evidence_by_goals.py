"""A formula of CTL that comes down to goals is shown by claims on them, and by no others."""

import random
from functools import partial

import pytest
from support.evidence_examples import CHOICE, ENDING
from support.examples import seeds
from support.lively_nets import lively_net
from support.true_claims import true

from firable.analysis.check import check
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.by_goals import said_by_goals
from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind, negation_in_ctl
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.nets.net import Net
from firable.nets.queries import query_named
from firable.nets.temporal import Temporal, parse_temporal
from firable.semantics.trace import Discipline

PARTS = ("EF (p0 and not p1)", "AG (p2 or not p3)", "p0", "not EF deadlock", "AG not (p1 and p2)", "not AG p3", "AF p1")


def holds(net: Net, claim: Claim) -> bool:
    return true(Evidence(net, Discipline.INTERLEAVING, claim, FiringSequence(())))


def in_m0(net: Net, formula: Temporal) -> bool:
    return holds(net, Claim(ClaimKind.CTL, formula))


@pytest.mark.seeds
def test_what_true_claims_on_goals_say_of_a_formula_is_true() -> None:
    said = 0
    for seed in seeds(30):
        draw = random.Random(seed)
        net = lively_net(draw, 7)
        one, two, three = draw.sample(PARTS, 3)
        formula = parse_temporal(draw.choice([f"{one} and ({two} or {three})", f"not ({one} or not ({two}))", one]))
        for wanted in (True, False):
            if said_by_goals(net, formula, partial(holds, net), holds=wanted):
                said += 1
                assert in_m0(net, formula if wanted else negation_in_ctl(formula)), (seed, formula)
            assert not said_by_goals(net, parse_temporal("AF p1"), lambda _: True, holds=wanted)
    assert said > 20


@pytest.mark.parametrize(
    "text",
    ["EF b and AG (a or b or c)", "AG a or not EF (b and c)", "not (EF (a and b)) and a", "AG not b", "EF c or AF b"],
)
def test_a_query_that_comes_down_to_goals_is_shown_without_its_labels(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firable.analysis.evidence.producing.spaces.MARKINGS_MAX", 1)
    query = query_named(text, CHOICE, "q")
    document = evidence_of_report(check(CHOICE, queries=[query]), [query], Limits(Deadline.after(20)))
    (record,) = (record for record in document.records if record.name == "query.q")
    assert not record.lacking
    assert {claim.kind for claim, _ in record.shown} <= {ClaimKind.NEVER, ClaimKind.REACHABLE}
    (checked,) = (one for one in check_document(document) if one.record.name == "query.q")
    assert checked.shown


def test_a_formula_that_says_more_than_goals_wants_a_claim_on_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.producing.spaces.MARKINGS_MAX", 1)
    query = query_named("AF b", ENDING, "q")
    document = evidence_of_report(check(ENDING, queries=[query]), [query], Limits(Deadline.after(20)))
    (record,) = (record for record in document.records if record.name == "query.q")
    assert [claim.kind for claim, _ in record.shown] == [ClaimKind.CTL]
