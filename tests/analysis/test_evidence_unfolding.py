"""The tableau of the checker: it accepts just the runs that refute a formula, does no work twice, and ends in time."""

import random
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples, seeds
from support.lively_nets import lively_nets
from support.ring_nets import ring_nets
from support.temporal_formulas import ltl_formulas
from support.true_claims import true

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Labelling, Markings, Unfolded
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.listed import Part
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.runs import Lasso
from firable.analysis.evidence.checking.unfolding import Unfolding
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record
from firable.analysis.evidence.producing.labels import TooLargeError
from firable.analysis.evidence.producing.unfolding import unfolded_markings
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.spaces.reachability import explore
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import Holds
from firable.nets.net import Net, Place, Transition
from firable.nets.temporal import Temporal, parse_temporal
from firable.semantics.trace import Discipline

NET = Net(
    "letters",
    (Place("p", marked=True), Place("q"), Place("r"), Place("s")),
    (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))),
)
NESTED = (
    "not G (p R (q W r))",
    "not G (p R (G (q W s) W r))",
    "not G (p R (G ((p R r) W s) W r))",
    "p W q W r W s W p W q W r W s W p W q W r W s W (X p) W (X q) W (X r) W (X s)",
)
CLAUSES = "not (" + " and ".join(f"({'X ' * i}p or {'X ' * i}q)" for i in range(1, 30)) + ")"
"""Its negation can begin in 2^29 ways, of which none owes less than another."""


class Run(Part):
    """One run as a set of markings, whatever the net would fire: a word of letters that the tableau reads."""

    def __init__(self, run: Lasso) -> None:
        self.net, self.discipline, self.markings, self.start = run.net, Discipline.INTERLEAVING, run.markings, 0
        fired = [tuple(run.net.transition_index[name] for name in names) for names in run.fired]
        self.edges = [[(names, after)] for names, after in zip(fired, [*range(1, len(fired)), run.loop], strict=True)]


class Countdown(Event):
    """A flag that is set after so many looks at it."""

    def __init__(self, looks: int) -> None:
        super().__init__()
        self.looks = looks

    def is_set(self) -> bool:
        self.looks -= 1
        return self.looks < 0


def lasso(letters: list[tuple[int, str]], loop: int) -> Lasso:
    markings, fired = zip(*letters, strict=True)
    return Lasso(NET, markings, tuple(frozenset(names) for names in fired), loop)


def satisfied(run: Lasso, formula: Temporal, deadline: Deadline = NEVER) -> bool:
    """What the tableau says of a run."""
    try:
        Unfolding(Run(run), formula, deadline).check()
    except InputError:
        return False
    return True


@st.composite
def runs(draw: st.DrawFn) -> Lasso:
    letters = draw(st.lists(st.tuples(st.integers(0, 15), st.sampled_from(["", "t", "u"])), min_size=1, max_size=5))
    return lasso(letters, draw(st.integers(0, len(letters) - 1)))


@given(run=runs(), formula=ltl_formulas(list("pqrs"), list("tu"), leaves=8))
@examples(150)
def test_the_tableau_refuses_a_run_iff_it_does_not_satisfy_the_formula(run: Lasso, formula: Temporal) -> None:
    assert satisfied(run, formula) is run.values(formula)[0]


@pytest.mark.parametrize(
    ("letters", "text"),
    [
        ([1, 2, 2], "not G F p"),  # only all three together are a part in which the until is not put off for ever
        ([2, 2, 1, 2], "not G F p"),
        ([9], "not G ((p U X s) and X (p U X s))"),  # what is put off owes less, and must not stand for what is met
        ([9, 1], "not G ((p U X s) and X (p U X s))"),
    ],
)
def test_a_run_that_refutes_a_formula_is_found(letters: list[int], text: str) -> None:
    run, formula = lasso([(letter, "t") for letter in letters], 0), parse_temporal(text)
    assert not run.values(formula)[0]
    assert not satisfied(run, formula)


@pytest.mark.parametrize(
    "other", ["G q", "(q R q)", "(p R q)", "F q", "X q", "(q U q)", "(p U q)", "(X q or q)", "(q W q)"]
)
def test_what_is_owed_beside_something_is_not_forgotten(other: str) -> None:
    run, formula = lasso([(2, "t")], 0), parse_temporal(f"not (G p and {other})")
    assert run.values(formula)[0]
    assert satisfied(run, formula)


@pytest.mark.parametrize("text", NESTED)
def test_nested_operators_are_unfolded_right_with_few_looks_at_the_deadline(text: str) -> None:
    formula = parse_temporal(text)
    answers = set()
    for seed in seeds(20):
        draw = random.Random(seed)
        letters = [(draw.choice((0, 15, draw.randrange(16))), draw.choice("tu")) for _ in range(draw.randint(1, 6))]
        run = lasso(letters, draw.randrange(len(letters)))
        answers.add(value := run.values(formula)[0])
        for asked, truth in ((formula, value), (parse_temporal(f"not ({text})"), not value)):
            assert satisfied(run, asked, Deadline(cancelled=Countdown(5_000))) is truth
    assert answers == {True, False}


def test_nothing_is_unfolded_when_the_time_is_over() -> None:
    with pytest.raises(TimeIsOverError):
        satisfied(lasso([(1, "t")], 0), parse_temporal("G p"), Deadline.after(0))


def test_the_time_is_looked_at_while_one_node_is_unfolded() -> None:
    with pytest.raises(TimeIsOverError):
        satisfied(lasso([(1, "t")], 0), parse_temporal(CLAUSES), Deadline(cancelled=Countdown(200)))


def test_a_formula_that_cannot_be_unfolded_in_time_is_only_claimed() -> None:
    claim, certificate = Claim(ClaimKind.LTL, parse_temporal(CLAUSES)), Unfolded(Markings((1, 2)))
    assert check_evidence(Evidence(NET, Discipline.INTERLEAVING, claim, certificate), timeout_ms=50).shown is None
    document = Document(NET, Discipline.INTERLEAVING, (Record("", True, ((claim, certificate),)),))
    (checked,) = check_document(document, timeout_ms=50)
    assert (checked.shown, checked.only_claimed) == (False, "the time was over")


def test_the_time_is_looked_at_at_every_node_though_what_is_owed_there_is_known() -> None:
    with pytest.raises(TimeIsOverError):
        satisfied(lasso([(1, "t")] * 100, 0), parse_temporal("G p"), Deadline(cancelled=Countdown(50)))


@st.composite
def asked(draw: st.DrawFn) -> tuple[Net, Temporal]:
    net = draw(st.one_of(ring_nets(signals=True), dense_nets(signals=True), lively_nets()))
    return net, draw(ltl_formulas([place.name for place in net.places], list(net.transition_index)))


def unfolded(net: Net, formula: Temporal, markings: Markings) -> Evidence:
    return Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.LTL, formula), Unfolded(markings))


def shows(evidence: Evidence) -> bool:
    try:
        return check_evidence(evidence).shown is True
    except InputError:
        return False


@given(question=asked(), data=st.data())
@examples(38)
def test_the_markings_that_a_formula_asks_for_show_it_iff_it_holds_and_none_can_be_spared(
    question: tuple[Net, Temporal], data: st.DataObject
) -> None:
    net, formula = question
    found = unfolded_markings(net, formula, 1_000, NEVER)
    whole = explore(net)
    everything = Markings(tuple(whole.marking(i) for i in range(whole.n_markings)))
    holds = true(unfolded(net, formula, everything))
    assert (found is not None) is holds
    assert shows(unfolded(net, formula, everything)) is holds
    if found is not None:
        assert shows(unfolded(net, formula, found))
        assert set(found.markings) <= set(everything.markings)
        for i in range(len(found.markings)):
            assert not shows(unfolded(net, formula, Markings(found.markings[:i] + found.markings[i + 1 :])))
    part = data.draw(st.lists(st.sampled_from(everything.markings), unique=True))
    assert holds or not shows(unfolded(net, formula, Markings(tuple(part))))


def test_a_formula_that_is_decided_early_is_shown_by_few_of_many_markings() -> None:
    net = family_net("machines-40")  # 2^40 markings
    formula = parse_temporal(f"{net.places[0].name} or X X {net.places[1].name} or not {net.places[0].name}")
    found = unfolded_markings(net, formula, 1_000, NEVER)
    assert found is not None
    assert len(found.markings) == 1
    assert shows(unfolded(net, formula, found))


def test_more_markings_than_are_listed_are_told() -> None:
    formula = parse_temporal("G not r")
    with pytest.raises(TooLargeError):
        unfolded_markings(NET, formula, 1, NEVER)
    assert unfolded_markings(NET, formula, 2, NEVER) is not None
    with pytest.raises(BudgetExceeded):
        unfolded_markings(NET, formula, 2, Deadline.after(0))


def test_a_part_that_serves_a_formula_shows_nothing_that_wants_a_closed_set() -> None:
    part = Markings((NET.initial_marking,))
    formula = parse_temporal("p")
    claim = Claim(ClaimKind.NEVER, Holds("q"))
    shown = ((Claim(ClaimKind.LTL, formula), Unfolded(part)), (claim, Labelling(part)))
    document = Document(NET, Discipline.INTERLEAVING, (Record("", True, shown[:1]),))
    assert [one.shown for one in check_document(document)] == [True]
    with pytest.raises(InputError, match="leads out of the set"):
        list(check_document(Document(NET, Discipline.INTERLEAVING, (Record("", True, shown),))))


def test_each_formula_is_unfolded_on_the_markings_of_its_own() -> None:
    first, second = (Claim(ClaimKind.LTL, parse_temporal(text)) for text in ("p", "G (p or q)"))
    start, after = NET.marking("p"), NET.marking("q")

    def told(of_second: Markings) -> list[bool]:
        shown = ((first, Unfolded(Markings((start,)))), (second, Unfolded(of_second)))
        return [one.shown for one in check_document(Document(NET, Discipline.INTERLEAVING, (Record("", True, shown),)))]

    assert told(Markings((start, after))) == [True]
    with pytest.raises(InputError, match="the initial marking is not in the set"):
        told(Markings((after,)))
