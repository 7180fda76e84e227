"""Response under fairness by sets of markings, against the components of the reachability graph."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.naive_space import NaiveSpace
from support.ring_nets import ring_nets

from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.spaces.reachability import explore
from firable.analysis.verdicts.properties import decide_property
from firable.nets.formula import parse_formula
from firable.nets.net import Fairness, Net, Property, PropertyKind
from firable.nets.verdict import Status
from firable.semantics.trace import Discipline

TEXTS = ("a", "b", "not a", "a and not b", "a or b", "deadlock", "firable(t0)", "not firable(t1)", "true")
FORMULAS = st.sampled_from(TEXTS).map(parse_formula)


@pytest.mark.parametrize("fairness", Fairness)
@pytest.mark.parametrize("discipline", Discipline)
@examples(30)
@given(net=ring_nets(signals=True).filter(lambda net: len(net.transitions) > 1), data=st.data())
def test_sets_decide_response_as_components_do(
    discipline: Discipline, fairness: Fairness, net: Net, data: st.DataObject
) -> None:
    p, q = data.draw(FORMULAS), data.draw(FORMULAS)
    of = Property("x", PropertyKind.LEADS_TO, p, q, fairness)
    by_components = decide_property(explore(net, discipline), of)
    by_sets = decide_property(NaiveSpace(net, discipline), of)
    assert by_sets.status is by_components.status
    if by_sets.status is Status.VIOLATED:
        assert by_sets.witness is not None
        run = FiringSequence(by_sets.witness.firings, by_sets.witness.cycle)
        claim = Claim(ClaimKind.NOT_LEADS_TO, p, q, fairness)
        assert check_evidence(Evidence(net, discipline, claim, run)).shown
