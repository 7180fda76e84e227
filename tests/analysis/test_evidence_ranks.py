"""Ranks of a response are tight: one that says more than it must is refused, though the response is there."""

from collections.abc import Iterable

import pytest
from support.evidence_examples import ENDING, SOMETIMES, TURNS
from support.true_claims import true

from firable.analysis.evidence.certificate import Labelling, Markings, Progress
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record
from firable.nets.diagnostics import InputError
from firable.nets.formula import parse_formula
from firable.nets.net import Fairness, Net, Place, Transition
from firable.semantics.trace import Discipline

TWICE = Net(  # the answer comes in two steps, the second one by either of two transitions
    "twice",
    (Place("a", marked=True), Place("b"), Place("asked", marked=True), Place("half"), Place("done")),
    (
        *TURNS.transitions[:2],
        Transition("go", ("asked",), ("half",)),
        Transition("by", ("half",), ("done",)),
        Transition("on", ("half",), ("done",)),
    ),
)


def response(of: Net, fairness: Fairness, asked: str, ranks: Iterable[str], *helpful: str) -> Evidence:
    """Ranks of markings, "a asked: 0 1" being one, and who helps, "0: go" being one."""
    rank_of = {
        of.marking(names.split()): numbers.split() for names, _, numbers in (one.partition(":") for one in ranks)
    }
    helping = ((numbers.split(), name.strip()) for numbers, _, name in (one.partition(":") for one in helpful))
    certificate = Progress(
        Markings(tuple(sorted(rank_of))),
        tuple(tuple(map(int, rank_of[marking])) for marking in sorted(rank_of)),
        tuple((tuple(map(int, numbers)), name) for numbers, name in helping),
    )
    then = parse_formula("b" if of is ENDING else "done")
    claim = Claim(ClaimKind.LEADS_TO, parse_formula(asked), then, fairness)
    return Evidence(of, Discipline.INTERLEAVING, claim, certificate)


def once(*ranks: str, helpful: str = "", asked: str = "a") -> Evidence:
    return response(ENDING, Fairness.WEAK, asked, ranks, *filter(None, [helpful]))


def twice(*helpful: str) -> Evidence:
    ranks = ("a asked: 1", "b asked: 1", "a half: 0", "b half: 0", "a done:", "b done:")
    return response(TWICE, Fairness.WEAK, "asked", ranks, *helpful)


def sometimes(*ranks: str) -> Evidence:
    return response(SOMETIMES, Fairness.STRONG, "asked", (*ranks, "a done:", "b done:"), "0: now")


TIGHT = [
    once("a: 0", "b:"),
    once("a:", "b:", asked="b"),
    twice("0: by", "1: go"),
    sometimes("a asked: 0 0", "b asked: 0"),
]
LOOSE = {
    "what is answered has a rank": once("a: 0", "b: 0"),
    "what is not asked has a rank": once("a: 0", "b:", asked="b"),
    "there is a gap": once("a: 1", "b:"),
    "a rank is too long": once("a: 0 0", "b:"),
    "a rank is too short": sometimes("a asked: 0", "b asked: 0"),
    "nobody has to help": once("a: 0", "b:", helpful="0: end"),
    "nobody is helped": once("a: 0", "b:", helpful="1: end"),
    "another one is the first that helps": twice("0: on", "1: go"),
    "the ranks that are helped are not in order": twice("1: go", "0: by"),
    "a rank is helped twice": twice("0: on", "0: by", "1: go"),
}


def test_ranks_that_say_what_they_must_are_taken() -> None:
    for evidence in TIGHT:
        assert true(evidence)
        assert check_evidence(evidence).shown


def test_ranks_are_looked_at_one_by_one_where_other_claims_are_in_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
    for evidence in TIGHT:
        assert isinstance(evidence.certificate, Progress)
        both = (Claim(ClaimKind.NEVER, parse_formula("a and b")), Labelling(evidence.certificate.space))
        shown = (both, (evidence.claim, evidence.certificate))
        (checked,) = check_document(Document(evidence.net, evidence.discipline, (Record("", True, shown),)))
        assert checked.shown
        assert [" in columns" in method for method in checked.methods] == [True, False]


@pytest.mark.parametrize("name", LOOSE)
def test_ranks_that_say_more_are_refused(name: str) -> None:
    assert true(LOOSE[name])
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(LOOSE[name])
