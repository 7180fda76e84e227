"""The obligation on siphons has a model exactly if some siphon contains no marked trap: by traps, and by ranks."""

import random
from itertools import combinations

import pytest
from support.evidence_examples import CHOICE, by_ranks
from support.examples import seeds
from support.lively_nets import lively_net
from support.reduction_forging import sparse_net
from support.second_solver import by_cvc5
from support.small_text import net_of

from firable.analysis.evidence.certificate import Equation, InductiveInvariant, Theorem, TheoremName
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.siphons import of_siphons
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.goal import Limits
from firable.analysis.induction.smt import Answer, Terms, decide
from firable.nets.diagnostics import InputError
from firable.nets.net import Net
from firable.semantics.trace import Discipline

Places = frozenset[str]


def arcs(net: Net) -> list[tuple[Places, Places]]:
    """What each transition takes, and what it puts; a read is both."""
    return [
        (frozenset((*t.inputs, *t.permissive)), frozenset(t.outputs) | (frozenset(t.permissive) - frozenset(t.inputs)))
        for t in net.transitions
    ]


def closed(net: Net, among: Places, *, trap: bool) -> bool:
    sides = ((put, taken) if not trap else (taken, put) for taken, put in arcs(net))
    return all(not before & among or after & among for before, after in sides)


def some_siphon_has_no_marked_trap(net: Net) -> bool:
    joined = sorted(frozenset().union(*(taken | put for taken, put in arcs(net))))
    sets = [frozenset(some) for n in range(1, len(joined) + 1) for some in combinations(joined, n)]
    marked = frozenset(place.name for place in net.places if place.marked)
    traps = [some for some in sets if some & marked and closed(net, some, trap=True)]
    return any(closed(net, some, trap=False) and not any(trap <= some for trap in traps) for some in sets)


@pytest.mark.seeds
def test_ranks_are_satisfiable_iff_some_siphon_contains_no_marked_trap() -> None:
    answers = set()
    for seed in seeds(20):
        draw = random.Random(seed)
        net = lively_net(draw, 6) if seed % 2 else sparse_net(draw, 6)
        (obligation,) = of_siphons(net, Theorem(TheoremName.FREE_CHOICE, InductiveInvariant()), Terms())
        bare = some_siphon_has_no_marked_trap(net)
        assert decide(obligation.asserted).answer is (Answer.SAT if bare else Answer.UNSAT), seed
        answers.add(bare)
    assert answers == {False, True}


def test_a_theorem_by_ranks_is_shown_to_two_solvers() -> None:
    claim = Claim(ClaimKind.LIVE)
    theorem = Certifier(CHOICE, Discipline.INTERLEAVING, Limits()).theorem(claim)
    evidence = by_ranks(Evidence(CHOICE, Discipline.INTERLEAVING, claim, theorem))
    assert check_evidence(evidence).shown
    assert isinstance(evidence.certificate, Theorem)
    (obligation,) = of_siphons(CHOICE, evidence.certificate, Terms())
    assert by_cvc5(obligation.text(evidence)) == "unsat"


def test_where_more_traps_would_be_listed_than_are_the_theorem_is_shown_by_ranks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("firable.analysis.structure.commoner.EXCLUDED_MAX", 0)
    found = Certifier(CHOICE, Discipline.INTERLEAVING, Limits()).theorem(Claim(ClaimKind.LIVE))
    assert found.traps == ()
    assert check_evidence(Evidence(CHOICE, Discipline.INTERLEAVING, Claim(ClaimKind.LIVE), found)).shown


@pytest.mark.parametrize(
    "net",
    [
        net_of("a", "t: a -> b", "u: a -> c", "v: b -> a"),  # c is a siphon's end: a and b run empty
        net_of("", "t: a -> b", "u: b -> a"),  # nothing is marked
        net_of("a", "t: a -> b if a", "u: b -> c"),  # what is read is taken too
        net_of(
            "a c", "t: a -> b if c", "u: a, c -> b", "v: b -> a"
        ),  # who reads c puts it back, and who takes it does not
        # One after the other is emptied, which wants as many numbers as there are places.
        net_of("a", "t: a -> b", "u: b -> c", "v: c -> d", "w: d -> a", "x: d -> "),
    ],
)
def test_a_theorem_by_ranks_does_not_show_a_net_that_is_not_live(net: Net) -> None:
    theorem = Theorem(TheoremName.FREE_CHOICE, InductiveInvariant())
    with pytest.raises(InputError, match="does not show what it claims"):
        check_evidence(Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.LIVE), theorem))
    (obligation,) = of_siphons(net, theorem, Terms())
    assert decide(obligation.asserted).answer is Answer.SAT


@pytest.mark.parametrize("traps", [(), (("a", "b"), ("c",))])
def test_a_theorem_shows_a_live_net_in_which_something_is_read(traps: tuple[tuple[str, ...], ...]) -> None:
    net = net_of("a c", "t: a -> b if c", "u: b -> a")  # c is a siphon, and a trap, since who reads puts back
    apart = InductiveInvariant((Equation((("a", 1), ("b", 1)), 1),))
    theorem = Theorem(TheoremName.FREE_CHOICE, apart, traps)
    assert check_evidence(Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.LIVE), theorem)).shown
