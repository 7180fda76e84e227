"""Ranks of a response are tight: one that says more than it must is refused, though the response is there."""

from collections.abc import Iterable
from dataclasses import replace

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


EITHER = Net(  # the answer comes at any time, and by another transition, which stands first, only now and then
    "either",
    SOMETIMES.places,
    (*SOMETIMES.transitions[:3], Transition("go", ("asked",), ("done",)), SOMETIMES.transitions[3]),
)
NESTED = Net(  # `now` is enabled in c only, to which `leave` leads from a only, and of a and b each leads to the other
    "nested",
    (Place("a", marked=True), Place("b"), Place("c"), Place("asked", marked=True), Place("done")),
    (
        *TURNS.transitions[:2],
        Transition("leave", ("a",), ("c",)),
        Transition("back", ("c",), ("a",)),
        Transition("now", ("asked",), ("done",), permissive=("c",)),
    ),
)
THROUGH = replace(  # the same, where c is two firings away from a
    NESTED,
    transitions=(NESTED.transitions[0], Transition("leave", ("b",), ("c",)), *NESTED.transitions[3:]),
)
ASTRAY = replace(NESTED, transitions=(*NESTED.transitions[:2], Transition("in", ("c",), ("a",)), NESTED.transitions[4]))
CHAIN = Net(  # who comes from a waits in b, where something fires at all times and changes nothing
    "chain",
    (Place("a", marked=True), Place("b"), Place("asked"), Place("done")),
    (Transition("on", ("a",), ("b",)), Transition("end", ("b",), ("done",)), Transition("idle")),
)


def response(
    of: Net, fairness: Fairness, asked: str, ranks: Iterable[str], *helpful: str, then: str = "done"
) -> Evidence:
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
    claim = Claim(ClaimKind.LEADS_TO, parse_formula(asked), parse_formula(then), fairness)
    return Evidence(of, Discipline.INTERLEAVING, claim, certificate)


def once(*ranks: str, helpful: str = "", asked: str = "a") -> Evidence:
    return response(ENDING, Fairness.WEAK, asked, ranks, *filter(None, [helpful]), then="b")


def twice(*helpful: str) -> Evidence:
    ranks = ("a asked: 1", "b asked: 1", "a half: 0", "b half: 0", "a done:", "b done:")
    return response(TWICE, Fairness.WEAK, "asked", ranks, *helpful)


def either(helpful: str) -> Evidence:
    return response(EITHER, Fairness.WEAK, "asked", ("a asked: 0", "b asked: 0", "a done:", "b done:"), helpful)


def nested(of: Net, *ranks: str, helpful: tuple[str, ...] = ("0: now", "0 0: leave")) -> Evidence:
    answered = ("a done:", "b done:", "c done:")
    return response(of, Fairness.STRONG, "asked", ("c asked: 0", *ranks, *answered), *helpful)


def sometimes(*ranks: str) -> Evidence:
    return response(SOMETIMES, Fairness.STRONG, "asked", (*ranks, "a done:", "b done:"), "0: now")


TIGHT = [
    once("a: 0", "b:"),
    once("a:", "b:", asked="b"),
    twice("0: by", "1: go"),
    sometimes("a asked: 0 0", "b asked: 0"),
    either("0: go"),
    nested(NESTED, "a asked: 0 0", "b asked: 0 0 0"),
    nested(THROUGH, "a asked: 0 1", "b asked: 0 0", helpful=("0: now",)),
    response(CHAIN, Fairness.WEAK, "asked", ("a:", "b:", "done:")),
]
LOOSE = {
    "what is answered has a rank": once("a: 0", "b: 0"),
    "what is not asked has a rank": once("a: 0", "b:", asked="b"),
    "what another one leads to, and nobody asks for, has a rank": response(
        CHAIN, Fairness.WEAK, "asked", ("a:", "b: 0", "done:"), "0: end"
    ),
    "there is a gap": once("a: 1", "b:"),
    "there is a gap further on": nested(NESTED, "a asked: 0 0", "b asked: 0 0 1"),
    "who helps is not always enabled": either("0: now"),
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


FALSE = {
    "nobody helps where the wait goes round": nested(ASTRAY, "a asked: 0 0", "b asked: 0 0", helpful=("0: now",)),
    "what comes next waits no more": response(ENDING, Fairness.NONE, "a", ("a: 0", "b:"), then="a and b"),
}


@pytest.mark.parametrize("name", FALSE)
def test_ranks_of_a_response_that_does_not_come_are_refused(name: str) -> None:
    assert not true(FALSE[name])
    with pytest.raises(InputError, match="a firing comes no nearer to the answer"):
        check_evidence(FALSE[name])


def test_who_is_not_enabled_all_the_time_does_not_help_under_weak_fairness() -> None:
    with pytest.raises(InputError, match=r"now is to help in \{a, asked\}, where it is not enabled"):
        check_evidence(either("0: now"))


@pytest.mark.parametrize("name", LOOSE)
def test_ranks_that_say_more_are_refused(name: str) -> None:
    assert true(LOOSE[name])
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(LOOSE[name])
