"""Stubborn sets show that a goal is never met iff it is not, and forged ones show nothing that is false."""

import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.evidence import document
from support.evidence_examples import BOTH_EAT, LOOP, net
from support.examples import examples, seeds
from support.lively_nets import lively_net, lively_nets
from support.ring_nets import ring_nets
from support.searched import goals
from support.stubborn_forging import forged, goal_of

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Continuation, Labelling, Markings, Reduction, StubbornSets
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.columns import columns, numbers
from firable.analysis.evidence.checking.cubes import firings
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.stubborn import Stubborn
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import document_from_text
from firable.analysis.evidence.producing import stubborn as producing
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.stubborn import stubborn_sets
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import explore
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import Deadlock, Formula, Holds, parse_formula
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
from firable.semantics.trace import Discipline

NETS = st.one_of(lively_nets(), ring_nets(signals=True), dense_nets(signals=True))


def never(of: Net, goal: Formula, certificate: StubbornSets) -> Evidence:
    return Evidence(of, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, goal), certificate)


def refusal(evidence: Evidence) -> str:
    """Why the evidence is refused; empty where it is shown."""
    try:
        assert check_evidence(evidence).shown
    except InputError as error:
        return error.diagnostics[0].message
    return ""


@given(data=st.data())
@examples(38)
def test_a_goal_has_stubborn_sets_iff_it_is_never_met(data: st.DataObject) -> None:
    of = data.draw(NETS)
    graph = explore(of)
    for goal in (data.draw(goals(of)), data.draw(goals(of)), Deadlock()):
        found = stubborn_sets(of, goal, Limits())
        assert (found is None) is bool(graph.satisfying(goal).any())
        if found is not None:
            assert refusal(never(of, goal, found)) == ""
            text = document(never(of, goal, found)).to_text()
            assert document_from_text(text).records[0].shown[0][1] == found


def test_forged_sets_show_nothing_that_is_false() -> None:
    false = shown = 0
    for seed in seeds(63):
        draw = random.Random(seed)
        of = lively_net(draw, 9)
        graph = explore(of)
        for goal in (goal_of(draw, of) for _ in range(4)):
            met = bool(graph.satisfying(goal).any())
            for certificate in filter(None, (forged(draw, of, goal) for _ in range(3))):
                refused = refusal(never(of, goal, certificate)) != ""
                assert refused or not met, (seed, goal)
                false += met
                shown += not refused
    assert false
    assert shown  # a forger who forgets nothing by chance has a proof


def test_sets_with_a_member_left_out_show_nothing_that_is_false() -> None:
    # From sets that show one goal, asked of another that is reachable, or with each member left out in turn.
    left_out = 0
    for seed in seeds(30):
        draw = random.Random(seed)
        of = lively_net(draw, 9)
        graph = explore(of)
        for goal in (goal_of(draw, of) for _ in range(3)):
            found = stubborn_sets(of, goal, Limits())
            if found is None:
                continue
            for i, one in enumerate(found.sets):
                for t in (t for t in range(len(of.transitions)) if one >> t & 1):
                    less = (*found.sets[:i], one ^ 1 << t, *found.sets[i + 1 :])
                    left_out += refusal(never(of, goal, replace(found, sets=less))) != ""
            other = goal_of(draw, of)
            assert refusal(never(of, other, found)) or not graph.satisfying(other).any()
    assert left_out


# What one marking leaves out, and the goal that is met by just that.
SIDE = net("side", "ac", ("a", "b"), ("c", "d"))
CONFLICT = net("conflict", "ac", ("a", "b"), ("c", "d"), ("ad", "e"))
READING = Net(
    "reading",
    (Place("a", marked=True), Place("b"), Place("c", marked=True), Place("d")),
    (Transition("t0", ("a",), ("b",)), Transition("t1", ("c",), ("d",), permissive=("a",))),
)
SHY = Net(
    "shy",
    (Place("a", marked=True), Place("b"), Place("c", marked=True), Place("d")),
    (Transition("t0", ("a",), ("b",)), Transition("t1", ("c",), ("d",), inhibitive=("b",))),
)
FILLING = Net(  # both fill d; only contact keeps them apart
    "filling",
    (Place("a", marked=True), Place("c", marked=True), Place("d"), Place("e")),
    (Transition("t0", ("a",), ("d",)), Transition("t1", ("c",), ("d",)), Transition("t2", ("d",), ("e",))),
)


def sets_of(of: Net, **fired: str) -> StubbornSets:
    """Of each marking, named by its places, the transitions of its set, by their numbers."""
    markings = tuple(of.marking(list(places)) for places in fired)
    sets = tuple(sum(1 << int(t) for t in numbered) for numbered in fired.values())
    return StubbornSets(Markings(markings), sets, tuple(range(len(sets))))


FALSE = {
    "the goal is inside": (SIDE, "b", sets_of(SIDE, ac="0", bc=""), "holds in"),
    "the goal may be met by others": (SIDE, "d", sets_of(SIDE, ac="0", bc=""), "without a member"),
    "nothing fires": (SIDE, "d", sets_of(SIDE, ac=""), "without a member"),
    "M0 is left out": (SIDE, "a", sets_of(SIDE, bd="01"), "initial marking"),
    "a firing leads out": (SIDE, "d", sets_of(SIDE, ac="01"), "leads out"),
    "who is in conflict by an input": (
        net("conflict", "a", ("a", "b"), ("a", "c")),
        "c",
        sets_of(net("conflict", "a", ("a", "b"), ("a", "c")), a="0", b=""),
        "without a member",
    ),
    "who may enable a member": (CONFLICT, "e", sets_of(CONFLICT, ac="2"), "may enable"),
    "the other operand of either": (SIDE, "b and c and d or d", sets_of(SIDE, ac="0", bc=""), "without a member"),
    "a goal that counts": (SIDE, "tokens(b, d) >= 1 and c", sets_of(SIDE, ac="1", ad="1"), "without a member"),
}


@pytest.mark.parametrize("what", FALSE)
def test_each_rule_is_needed(what: str) -> None:
    of, goal, certificate, reason = FALSE[what]
    assert explore(of).satisfying(parse_formula(goal)).any()
    assert reason in refusal(never(of, parse_formula(goal), certificate))


@pytest.mark.parametrize(
    ("of", "goal", "fired"),
    [
        # t0 first, and t1 never can any more: the goal wants t1 to have fired before t0.
        (READING, "b and d", {"ac": "0", "bc": "1"}),
        (SHY, "b and d", {"ac": "0", "bc": "1"}),
        (FILLING, "a and e", {"ac": "02", "cd": "02", "ce": "012", "de": "012"}),
    ],
    ids=["permissive gate", "inhibitive gate", "contact"],
)
def test_who_reads_what_a_member_flips_is_not_left_out(of: Net, goal: str, fired: dict[str, str]) -> None:
    assert explore(of).satisfying(parse_formula(goal)).any()
    assert "in conflict" in refusal(never(of, parse_formula(goal), sets_of(of, **fired)))


def test_sets_that_do_not_fit_the_markings_are_refused() -> None:
    fitting = sets_of(LOOP, a="0", b="1")
    goal = Holds("z")
    assert refusal(never(LOOP, goal, fitting)) == ""
    for chosen in ((), (0,), (0, 1, 1), (0, 2)):
        assert "not each marking has a set" in refusal(never(LOOP, goal, replace(fitting, chosen=chosen)))


def test_they_show_nothing_of_steps_and_no_other_claim() -> None:
    found = sets_of(LOOP, a="0", b="1")
    evidence = never(LOOP, Holds("z"), found)
    assert "under interleaving only" in refusal(replace(evidence, discipline=Discipline.STEP))
    for kind in (ClaimKind.ALWAYS_POSSIBLE, ClaimKind.LOST, ClaimKind.REACHABLE):
        assert "cannot show" in refusal(replace(evidence, claim=Claim(kind, Holds("z"))))


def test_what_never_fires_is_no_member_whatever_is_written() -> None:
    both = (ExternalGate("s", wanted=True), ExternalGate("s", wanted=False))
    shut = Net(
        "shut",
        (Place("a", marked=True), Place("b")),
        (Transition("t0", ("a",), ("b",), external=both), Transition("t1", ("a",), ("a",))),
        (Signal("s"),),
    )
    assert firings(shut) == {}
    assert refusal(never(shut, Holds("b"), sets_of(shut, a="01"))) == ""
    assert refusal(never(shut, Holds("b"), sets_of(shut, a=""))) == ""


def test_after_a_run_they_show_that_something_is_lost() -> None:
    after = sets_of(LOOP, b="1", a="0")
    claim = Claim(ClaimKind.LOST, Holds("z"))
    evidence = Evidence(LOOP, Discipline.INTERLEAVING, claim, Continuation((("t0",),), after))
    assert refusal(evidence) == ""
    assert refusal(replace(evidence, claim=Claim(ClaimKind.LOST, Holds("a")))) != ""


def test_a_net_whose_markings_nobody_lists_is_shown_by_few() -> None:
    of = family_net("workshop-30")  # more than 10^20 markings
    found = stubborn_sets(of, Deadlock(), Limits())
    assert found is not None
    assert len(found.space.markings) < 1_000
    assert refusal(never(of, Deadlock(), found)) == ""


def test_more_digits_than_are_written_give_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert stubborn_sets(LOOP, Holds("z"), Limits()) is not None
    monkeypatch.setattr(producing, "DIGITS_MAX", 1)
    assert stubborn_sets(LOOP, Holds("z"), Limits()) is None


def test_a_search_that_is_ended_says_so() -> None:
    with pytest.raises(BudgetExceeded):
        stubborn_sets(family_net("philosophers-40"), BOTH_EAT, Limits(Deadline.after(0)))


def test_more_markings_than_are_listed_give_none() -> None:
    assert stubborn_sets(family_net("philosophers-40"), BOTH_EAT, Limits()) is None


def test_looking_through_ends_in_time() -> None:
    found = stubborn_sets(LOOP, Holds("z"), Limits())
    assert found is not None
    with pytest.raises(TimeIsOverError):
        Stubborn(LOOP, found, Deadline.after(0)).check(Holds("z"))


def test_the_certifier_takes_few_markings_of_a_small_net_before_a_diagram_of_all() -> None:
    certifier = Certifier(family_net("workshop-30"), Discipline.INTERLEAVING, Limits())
    found = certifier.certify(Claim(ClaimKind.NEVER, Deadlock()))
    assert isinstance(found, Reduction)
    assert isinstance(found.then, Labelling)
    assert isinstance(found.then.space, Markings)


@given(
    st.integers(0, 9).flatmap(lambda width: st.tuples(st.just(width), st.lists(st.integers(0, 2 ** (width + 1) - 1))))
)
def test_columns_are_the_rows_turned(matrix: tuple[int, list[int]]) -> None:
    width, rows = matrix
    turned = [[i for i, row in enumerate(rows) if row >> k & 1] for k in range(width)]
    assert [list(numbers(column)) for column in columns(rows, width)] == turned


def test_more_rows_than_are_turned_at_once() -> None:
    rows = [i * i % 8 for i in range(10_000)]
    assert columns(rows, 3) == [sum((row >> k & 1) << i for i, row in enumerate(rows)) for k in range(3)]
