"""Each condition on a decision diagram is needed: a false claim for each, on a diagram that breaks this one alone."""

import random
from collections.abc import Iterable, Sequence
from dataclasses import replace

import pytest
from support.evidence_examples import LOOP, net
from support.examples import seeds
from support.lively_nets import lively_net
from support.true_claims import true

from firable.analysis.evidence.certificate import Back, Diagram, Label, Labelling, Ranks, Root, Rounds, Whole
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.labelling import Least, fixpoints, normal
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.nets.diagnostics import InputError
from firable.nets.formula import Compare, Count, Deadlock, Firable, Holds, Sign, Start, parse_formula
from firable.nets.net import ExternalGate, Marking, Net, Signal, Transition
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Next,
    Temporal,
    Until,
    all_of,
    any_of,
    format_temporal,
    negated,
    parse_temporal,
)
from firable.semantics.player import Player
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


def drawn(order: Sequence[str], *sets: Iterable[Iterable[str]]) -> Diagram:
    """The diagram of sets of markings, each with the places that hold a token in it; the first place has level 1."""
    rows: dict[tuple[int, int, int], int] = {}

    def number(markings: frozenset[frozenset[str]], level: int) -> int:
        if not level or not markings:
            return len(markings)
        name = order[level - 1]
        lo = number(frozenset(one for one in markings if name not in one), level - 1)
        hi = number(frozenset(one - {name} for one in markings if name in one), level - 1)
        return rows.setdefault((level, lo, hi), len(rows) + 2) if hi else lo

    roots = tuple(number(frozenset(map(frozenset, markings)), len(order)) for markings in sets)
    return Diagram(tuple(order), tuple(rows), roots)


def diagram(order: str, *sets: str) -> Diagram:
    """The same in letters: "a bc" are the marking with a token on a alone, and that with tokens on b and c."""
    return drawn(order, *map(str.split, sets))


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


def closed(of: Net, markings: Iterable[Marking]) -> set[Marking]:
    """These markings, and all that are reached from them."""
    player, found = Player(of), set(markings)
    todo = list(found)
    while todo:
        after = {marking for _, marking in player.successors(todo.pop())} - found
        found |= after
        todo += after
    return found


def a_formula(chance: random.Random, of: Net, depth: int = 2) -> Temporal:
    """Some formula of CTL."""

    def part() -> Temporal:
        return a_formula(chance, of, depth - 1)

    if not depth or chance.random() < 0.3:
        places = [place.name for place in of.places]
        some = Count(tuple(chance.choice(places) for _ in range(2)))
        firable = Firable(chance.choice(of.transitions).name) if of.transitions else Deadlock()
        compared = Compare(some, chance.choice(list(Sign)), Count(added=chance.randrange(3)))
        return chance.choice((Holds(chance.choice(places)), firable, Deadlock(), Start(), compared))
    path = chance.choice((Until(part(), part()), *(kind(part()) for kind in (Next, Eventually, Globally))))
    quantified = chance.choice((Exists, ForAll))(path)
    return chance.choice((quantified, quantified, negated(part()), all_of((part(), part())), any_of((part(), part()))))


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(10))
def test_no_diagram_shows_a_claim_that_is_false(seed: int) -> None:
    chance = random.Random(seed)
    for _ in range(10):
        of = lively_net(chance, most_places=6)
        order, names = [place.name for place in of.places], [transition.name for transition in of.transitions]
        chance.shuffle(order)
        for _ in range(5):
            more = chance.sample(range(2 ** len(order)), chance.randrange(3))
            whole = closed(of, {of.initial_marking, *more}) - {chance.randrange(2 ** len(order))}
            part = {marking for marking in whole if chance.random() < 0.7}
            formula = parse_temporal(format_temporal(a_formula(chance, of)))
            labels: list[Label] = []
            for one in fixpoints(normal(formula)):
                ways = tuple(chance.choice(names) for _ in range(chance.randrange(5) if names else 0))
                until = Rounds(chance.randrange(4)) if one.every else Back(ways)
                labels.append(until if isinstance(one, Least) else chance.choice((Whole(), Root(1))))
            space = drawn(order, map(of.names, whole), map(of.names, part))
            evidence = labelled(of, format_temporal(formula), space, *labels)
            try:
                shown = check_evidence(evidence).shown
            except InputError:
                continue
            assert not shown or true(evidence), evidence
