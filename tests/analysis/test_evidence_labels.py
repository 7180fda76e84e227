"""A formula of CTL is brought to the form that labels are of, and each label to the part that it belongs to."""

import pytest
from support.evidence_examples import LOOP, net
from support.true_claims import true

from firable.analysis.evidence.certificate import Labelling, Markings, Ranks
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.nets.diagnostics import InputError
from firable.nets.net import Net
from firable.nets.temporal import format_temporal, parse_temporal
from firable.semantics.trace import Discipline

FORK = net("fork", "a", ("a", "b"), ("a", "c"))


def labelled(of: Net, text: str, *labels: tuple[int, ...]) -> Evidence:
    """Labels of the markings with one token each, in the order of the net's places."""
    space = Markings(tuple(1 << i for i in range(len(of.places) - 1)))
    claim = Claim(ClaimKind.CTL, parse_temporal(text))
    return Evidence(of, Discipline.INTERLEAVING, claim, Labelling(space, tuple(map(Ranks, labels))))


FALSE = [
    labelled(LOOP, "not EF b", (0, 1)),  # as if it were AF not b
    labelled(LOOP, "not AF b", (0, 1)),  # as if it were EF not b
    labelled(LOOP, "not EG (a or b)", (0, 0)),
    labelled(LOOP, "not AG (a or b)", (0, 0)),
    labelled(LOOP, "not E[a U b]", (0, -1)),
    labelled(LOOP, "not A[a U b]", (0, -1)),
    labelled(FORK, "not EX b"),
    labelled(FORK, "AX b and EX b"),
    labelled(LOOP, "EF b and EF z", (1, 0), (-1, -1)),
    labelled(LOOP, "EF z and EF b", (-1, -1), (1, 0)),
]
TRUE = [
    labelled(LOOP, "not EF z", (0, 0)),
    labelled(FORK, "not AF b", (0, -1, 0)),
    labelled(LOOP, "not EG a", (1, 0)),
    labelled(FORK, "not AG (a or b)", (1, -1, 0)),
    labelled(LOOP, "not E[b U z]", (0, 0)),
    labelled(LOOP, "not A[z U b]", (0, -1)),
    labelled(LOOP, "E[a U b]", (1, 0)),
    labelled(LOOP, "A[a U b]", (1, 0)),
    labelled(FORK, "not AX b"),
    labelled(LOOP, "EF b and EG (a or b)", (1, 0), (0, 0)),
    labelled(LOOP, "EG (a or b) and EF b", (0, 0), (1, 0)),
    labelled(LOOP, "EF b and AX EF b", (1, 0)),  # one label for the part that stands twice
    labelled(LOOP, "EF (b and EG (a or b))", (0, 0), (1, 0)),  # what is inside first
]


@pytest.mark.parametrize("edges_max", [100_000, 0])
@pytest.mark.parametrize("evidence", FALSE, ids=lambda of: format_temporal(of.claim.goal))
def test_labels_of_another_formula_show_nothing(
    evidence: Evidence, edges_max: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", edges_max)
    assert not true(evidence)
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(evidence)


@pytest.mark.parametrize("edges_max", [100_000, 0])
@pytest.mark.parametrize("evidence", TRUE, ids=lambda of: format_temporal(of.claim.goal))
def test_labels_of_a_formula_show_it(evidence: Evidence, edges_max: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", edges_max)
    assert true(evidence)
    assert check_evidence(evidence).shown
