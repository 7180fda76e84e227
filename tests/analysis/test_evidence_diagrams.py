"""Each condition on a decision diagram is needed: a false claim for each, on a diagram that breaks this one alone."""

from dataclasses import replace

import pytest
from support.evidence_examples import LOOP, net
from support.true_claims import true

from firable.analysis.evidence.certificate import Back, Diagram, Label, Labelling, Ranks, Root, Rounds, Whole
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.nets.diagnostics import InputError
from firable.nets.formula import parse_formula
from firable.nets.net import ExternalGate, Net, Signal, Transition
from firable.nets.temporal import parse_temporal
from firable.semantics.trace import Discipline

FORK = net("fork", "a", ("a", "b"), ("a", "c"))
TOGETHER = net("together", "z", ("z", "xy"))
PAIR = net("pair", "ac", ("a", "b"), ("c", "d"))
IDLING = replace(
    LOOP, transitions=(*LOOP.transitions, Transition("idle"))
)  # which asks for nothing, and changes nothing
UNFIRED = Net(  # `shut` is never opened, `stuck` never firable
    "unfired",
    LOOP.places,
    (
        *LOOP.transitions,
        Transition("shut", ("a",), external=(ExternalGate("s", wanted=True), ExternalGate("s", wanted=False))),
        Transition("stuck", ("z",)),
    ),
    (Signal("s"),),
)


def diagram(order: str, *sets: str) -> Diagram:
    """The diagram of sets of markings, "a bc" being the two of a alone and of b and c, in the order of the levels."""
    rows: dict[tuple[int, int, int], int] = {}

    def number(markings: frozenset[str], level: int) -> int:
        if not level or not markings:
            return len(markings)
        name = order[level - 1]
        lo = number(frozenset(one for one in markings if name not in one), level - 1)
        hi = number(frozenset(one.replace(name, "") for one in markings if name in one), level - 1)
        return rows.setdefault((level, lo, hi), len(rows) + 2) if hi else lo

    roots = tuple(number(frozenset(markings.split()), len(order)) for markings in sets)
    return Diagram(tuple(order), tuple(rows), roots)


def labelled(of: Net, text: str, space: Diagram, *labels: Label) -> Evidence:
    claim = Claim(ClaimKind.CTL, parse_temporal(text))
    return Evidence(of, Discipline.INTERLEAVING, claim, Labelling(space, labels))


def never(of: Net, goal: str, space: Diagram) -> Evidence:
    return Evidence(of, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, parse_formula(goal)), Labelling(space))


OF_LOOP, OF_FORK = diagram("abz", "a b", "a", ""), diagram("abcz", "a b c", "a b")
FALSE = {
    "a place has two levels": never(LOOP, "a or z", diagram("abza", "a b")),
    "a firing leads out where a place between is empty": never(LOOP, "b and not z", diagram("azb", "a az bz")),
    "a firing leads to another target": labelled(PAIR, "EX (b and d)", diagram("cdabz", "ac ad bc bd")),
    "firable is meant": never(LOOP, "firable(t0)", OF_LOOP),
    "it is never opened": labelled(UNFIRED, "EF firable(shut)", OF_LOOP, Back(())),
    "it is never firable": labelled(UNFIRED, "EF firable(stuck)", OF_LOOP, Back(())),
    "tokens are counted": labelled(LOOP, "AG tokens(a, b, z) >= 2", OF_LOOP, Whole()),
    "a place is full where a higher one is": never(TOGETHER, "x", diagram("xyz", "z xy")),
    "not both hold": labelled(LOOP, "AG ((a or z) and (b or z))", OF_LOOP, Whole()),
    "a literal contradicts another one": labelled(LOOP, "EF (not a and a)", OF_LOOP, Back(())),
    "some contradict others": labelled(LOOP, "EF ((not a and not z) and (a and not z))", OF_LOOP, Back(())),
    "always is left": labelled(LOOP, "AG a", OF_LOOP, Root(1)),
    "another way does not lead there": labelled(FORK, "AF b", OF_FORK, Back(("t0",))),
    "another way does not lead there in so many rounds": labelled(FORK, "AF b", OF_FORK, Rounds(1)),
}
TRUE = {
    "what changes nothing fires": never(IDLING, "a and b", OF_LOOP),
    "who never fires is gone back by": labelled(UNFIRED, "EF b", OF_LOOP, Back(("shut", "t0"))),
    "a run ends well": labelled(FORK, "EG not c", OF_FORK, Root(1)),
    "an always is over on some run": labelled(LOOP, "not A[b U not a]", OF_LOOP, Root(1)),
    "an always is over on every run": labelled(LOOP, "not E[b U not a]", OF_LOOP, Root(1)),
    "an always holds nowhere": labelled(LOOP, "a or EG a", OF_LOOP, Root(2)),
    "nothing is said": never(Net("nothing", (), ()), "false", Diagram((), (), (1,))),
}
WRONG = {
    "a place has no level": never(LOOP, "a and b", diagram("ab", "a b")),
    "there is no root": never(LOOP, "a and b", replace(OF_LOOP, roots=())),
    "ranks": labelled(LOOP, "EF a", OF_LOOP, Ranks((0, 0))),
    "a set to go back": labelled(LOOP, "EF a", OF_LOOP, Whole()),
    "rounds of one way": labelled(LOOP, "EF b", OF_LOOP, Rounds(1)),
    "rounds for an always": labelled(LOOP, "AG (a or b)", OF_LOOP, Rounds(0)),
    **{f"the root {root}": labelled(LOOP, "EG (a or b)", OF_LOOP, Root(root)) for root in (-1, 3)},
    **{
        f"the root of number {root}": never(LOOP, "a and b", replace(OF_LOOP, roots=(*OF_LOOP.roots, root)))
        for root in (-1, 4)
    },
}


@pytest.mark.parametrize("name", FALSE)
def test_a_false_claim_is_refused_of_whose_diagram(name: str) -> None:
    assert not true(FALSE[name])
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(FALSE[name])


@pytest.mark.parametrize("name", TRUE)
def test_a_true_claim_is_shown_where(name: str) -> None:
    assert true(TRUE[name])
    assert check_evidence(TRUE[name]).shown


@pytest.mark.parametrize("name", WRONG)
def test_a_true_claim_is_refused_whose_diagram_has(name: str) -> None:
    assert true(WRONG[name])
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(WRONG[name])


@pytest.mark.parametrize(
    "rows",
    [
        ((2, 0, 1), (1, 2, 1)),  # what is below stands higher
        ((2, 0, 1), (1, 0, 2)),
        ((1, 0, 1), (1, 2, 1)),  # or as high
        ((1, 0, 1), (1, 1, 2)),
        ((4, 0, 1),),
        ((0, 0, 1),),
        ((1, -1, 1),),
        ((1, 0, -1),),
        ((1, 0, 2),),
        ((1, 2, 1),),
    ],
    ids=str,
)
def test_a_row_of_a_diagram_stands_above_parts_that_there_are(rows: tuple[tuple[int, int, int], ...]) -> None:
    with pytest.raises(InputError, match="does not stand above its parts"):
        check_evidence(never(LOOP, "a and b", replace(OF_LOOP, rows=rows, roots=(1 + len(rows),))))
