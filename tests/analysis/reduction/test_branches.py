"""The net reduced for CTL without X satisfies what the original satisfies, and the techniques that ask it say so."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence
from threading import Event
from time import monotonic

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.block_nets import block_net
from support.cell_nets import cell_nets
from support.dense_nets import dense_nets
from support.examples import examples, seeds
from support.lively_nets import lively_net, lively_nets
from support.ring_nets import ring_nets
from support.stuttering import stutter_blocks
from support.temporal_formulas import ctl_formulas

from firable.analysis._engine import IncompleteGraph
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.question import Known
from firable.analysis.reduction.reduce import ReducedBranches, facts_on, reduce_for_branches, reduce_for_runs
from firable.analysis.reduction.reducer import Reducer
from firable.analysis.spaces.reachability import explore
from firable.analysis.temporal.by_parts import decide_ctl_by_parts
from firable.analysis.temporal.ctl import Ctl, satisfied
from firable.analysis.temporal.in_reduced import CtlInReduced
from firable.analysis.temporal.sets import Sets
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import And, Firable, Formula, Holds, Not
from firable.nets.net import Net, Place, Transition
from firable.nets.temporal import Temporal, format_temporal, parse_temporal
from firable.nets.temporal_parts import has_next

TECHNIQUES = ("_locally", "_by_exploring", "_by_diagram")
NETS = st.one_of(cell_nets(), lively_nets(), ring_nets(signals=True), dense_nets(signals=True))


def graph_of(net: Net, labels: Sequence[Formula]) -> tuple[list[list[int]], list[tuple[bool, ...]]]:
    """The successors of each reachable marking, of which the first is M0, and which labels hold there."""
    graph = explore(net)
    columns = [graph.satisfying(label) for label in labels]
    successors = [[target for _, target in graph.successors(v)] for v in range(graph.n_markings)]
    return successors, [tuple(bool(column[v]) for column in columns) for v in range(graph.n_markings)]


def same_branches(net: Net, labels: Sequence[Formula], facts: bool = False) -> ReducedBranches:
    """The reduced net, if its M0 satisfies the same formulas of CTL without X over these labels."""
    limits = Limits()
    reduced = reduce_for_branches(net, labels, limits, facts_on(net, limits) if facts else None)
    successors, values = graph_of(net, labels)
    small, smaller = graph_of(reduced.net, [reduced.labels[label] for label in labels])
    first = len(successors)
    blocks = stutter_blocks(
        [*successors, *([target + first for target in targets] for targets in small)], [*values, *smaller]
    )
    assert blocks[0] == blocks[first], (net, labels, reduced.summary)
    # Each marking has one of the reduced net that says the same.
    assert set(blocks[:first]) == set(blocks[first:]), (net, labels, reduced.summary)
    return reduced


@st.composite
def labelled(draw: st.DrawFn, nets: st.SearchStrategy[Net] = NETS) -> tuple[Net, list[Formula]]:
    net = draw(nets)
    places = st.sampled_from([Holds(place.name) for place in net.places])
    some: list[st.SearchStrategy[Formula]] = [
        places,
        places.map(Not),
        st.builds(lambda one, other: And((one, Not(other))), places, places),
    ]
    if net.transitions:
        some.append(st.sampled_from([Firable(transition.name) for transition in net.transitions]))
    return net, draw(st.lists(st.one_of(some), min_size=1, max_size=2, unique=True))


@examples(60)
@given(labelled(), st.booleans())
def test_what_can_still_happen_is_kept(question: tuple[Net, list[Formula]], facts: bool) -> None:
    same_branches(*question, facts=facts)


def test_what_can_still_happen_is_kept_where_much_is_put_together() -> None:
    applied, seen = Counter[str](), 0
    for seed in seeds(150):
        draw = random.Random(seed)
        net = block_net(draw) if seed % 2 else lively_net(draw, 9)
        places = [Holds(place.name) for place in net.places]
        reduced = same_branches(net, draw.sample(places, min(len(places), draw.choice((1, 2)))), facts=seed % 3 == 0)
        applied.update(reduced.applied.keys())
        seen += 1
    for rule in ("closers early", "openers late", "early firing", "implied place", "subsumed transition"):
        assert 10 * applied[rule] > seen, applied


def chain(*steps: tuple[tuple[str, ...], tuple[str, ...]], marked: Sequence[str] = ("a",)) -> Net:
    names = dict.fromkeys(name for step in steps for side in step for name in side)
    places = tuple(Place(name, marked=name in marked) for name in names)
    return Net("net", places, tuple(Transition(f"t{n}", *step) for n, step in enumerate(steps)))


def test_a_choice_of_closers_is_not_made_by_the_opener() -> None:
    # From p the token goes over x or over y. At p both ends are possible still, which runs do not show.
    net = chain((("a",), ("p",)), (("p",), ("x",)), (("p",), ("y",)), (("x",), ("left",)), (("y",), ("right",)))
    labels = [Holds("a"), Holds("left"), Holds("right")]
    assert "p" in {place.name for place in same_branches(net, labels).net.places}
    assert "p" not in {place.name for place in reduce_for_runs(net, labels).net.places}


def test_what_is_told_of_places_that_go_leaves_a_choice_where_it_was() -> None:
    # As above, with a label that is a constant, which the labels are told before the choice is looked at.
    ways = (("a",), ("p",)), (("p",), ("x",)), (("p",), ("y",)), (("x",), ("left",)), (("y",), ("right",))
    net = chain(*ways, (("z",), ("z2",)))
    formula = parse_temporal("EF (not a and not z and EF left and EF right)")
    found = CtlInReduced(Reducer(net)).decided(formula, Limits())
    assert found is not None
    assert found[0]
    labels = [Holds(name) for name in ("a", "z", "left", "right")]
    assert "p" in {place.name for place in same_branches(net, labels).net.places}


def test_an_opener_that_is_in_a_choice_is_not_put_off() -> None:
    # From a the token goes to b, or over p to c: at p it cannot go to b any more.
    ways = (("z",), ("a",)), (("a",), ("p",)), (("p",), ("c",))
    labels = [Holds("z"), Holds("c")]
    chosen = same_branches(chain(*ways, (("a",), ("b",)), marked=("z",)), [*labels, Holds("b")])
    assert {"a", "p"} <= {place.name for place in chosen.net.places}
    # With nothing to choose one of the two is enough.
    alone = same_branches(chain(*ways, marked=("z",)), labels)
    assert len({"a", "p"} & {place.name for place in alone.net.places}) == 1


def net_of(marked: str, *transitions: Transition) -> Net:
    names = dict.fromkeys(name for of in transitions for name in (*of.inputs, *of.outputs))
    return Net("net", tuple(Place(name, marked=name in marked.split()) for name in names), transitions)


def test_of_two_openers_that_keep_each_other_away_none_is_put_off() -> None:
    # A token goes over p to w, from a or from b; then x brings another one to where it came from, or y does.
    net = net_of(
        "a b x y",
        Transition("from_a", ("a",), ("p",), inhibitive=("w",)),
        Transition("from_b", ("b",), ("p",), inhibitive=("w",)),
        Transition("f", ("p",), ("w",)),
        Transition("to_a", ("w", "x"), ("a",)),
        Transition("to_b", ("w", "y"), ("b",)),
    )
    labels = [Holds("w"), Holds("x"), Holds("y")]
    assert "p" in {place.name for place in same_branches(net, labels).net.places}
    assert "p" not in {place.name for place in reduce_for_runs(net, labels).net.places}


@examples(60)
@given(st.data(), NETS)
def test_formulas_without_x_have_the_value_that_they_have_over_sets(data: st.DataObject, net: Net) -> None:
    names = [place.name for place in net.places], [transition.name for transition in net.transitions]
    formula = data.draw(ctl_formulas(*names, leaves=6))
    found = CtlInReduced(Reducer(net)).decided(formula, Limits())
    expected = satisfied(Ctl(Sets(explore(net))), formula)
    if found is None:
        text = format_temporal(formula)
        assert has_next(formula) or "deadlock" in text or "start" in text, text
    else:
        assert found[0] is expected, format_temporal(formula)
        assert ", after reduction from" in found[1]
    assert decide_ctl_by_parts(net, formula, Limits()).answer.holds is expected


def gives_up(net: Net, formula: Temporal, limits: Limits) -> Known:
    """A technique that decides nothing."""
    raise IncompleteGraph("not this one")


class Counting(Reducer):
    """A reducer that counts for how many formulas it is asked."""

    asked = 0

    def for_branches(self, labels: Sequence[Formula], limits: Limits) -> ReducedBranches:
        self.asked += 1
        return super().for_branches(labels, limits)


def test_what_was_not_decided_is_asked_again_only_with_twice_the_time() -> None:
    # Of each of 17 digits the formula says something, so that nothing is left out; 3 kB hold no search.
    digits = " and ".join(f"EF counter.one{n}" for n in range(17))
    formula, reducer = parse_temporal(f"AG ({digits})"), Counting(family_net("counter-17"))
    asked = CtlInReduced(reducer)
    cancelled = Event()
    cancelled.set()
    assert asked.decided(formula, Limits(Deadline(monotonic() + 600, cancelled))) is None
    for seconds, times in ((20.0, 2), (20.0, 2), (30.0, 2), (90.0, 3)):
        assert asked.decided(formula, Limits(Deadline.after(seconds), memory_bytes=3000)) is None
        assert reducer.asked == times, "who was ended from outside is asked again, as it had not all of its time"
    found = asked.decided(formula, Limits())
    assert found is not None
    assert found[0]


@pytest.mark.parametrize("alone", TECHNIQUES)
@pytest.mark.parametrize(
    ("text", "holds"), [("AG EF counter.zero0", True), ("AF counter.one1", True), ("EG counter.zero0", False)]
)
def test_each_technique_decides_alone(monkeypatch: pytest.MonkeyPatch, alone: str, text: str, holds: bool) -> None:
    for name in set(TECHNIQUES) - {alone}:
        monkeypatch.setattr(f"firable.analysis.temporal.in_reduced.{name}", gives_up)
    found = CtlInReduced(Reducer(family_net("counter-17"))).decided(parse_temporal(text), Limits())
    assert found is not None
    assert found[0] is holds


def test_a_formula_is_asked_as_a_whole_before_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.temporal.by_parts.decide_ctl_on_the_fly", gives_up)
    net, formula = family_net("counter-17"), parse_temporal("AF counter.one1 and AG EF counter.zero0")
    found = decide_ctl_by_parts(net, formula, Limits())
    assert found.answer.holds
    assert found.method.count("after reduction from") == 1
    assert ";" not in found.method


def test_what_needs_two_that_are_never_together_fails_though_it_has_an_x(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.temporal.by_parts.decide_ctl_on_the_fly", gives_up)
    formula = parse_temporal("EF (EG counter.zero0 and EG counter.one0 and EX counter.one1)")
    assert decide_ctl_by_parts(family_net("counter-17"), formula, Limits()).answer.holds is False


def test_no_reduction_is_begun_for_what_it_cannot_say_or_in_no_time() -> None:
    reducer = Counting(catalogue_net("one_robot"))
    asked = CtlInReduced(reducer)
    for text in ("AG EX mc.free", "AG EF start", "AG (mc.free or not deadlock)"):
        assert asked.decided(parse_temporal(text), Limits()) is None
    assert asked.decided(parse_temporal("AG EF mc.free"), Limits(Deadline.after(0))) is None
    assert not reducer.asked
    found = asked.decided(parse_temporal("AG EF mc.free"), Limits())
    assert found is not None
    assert found[0]


def test_next_markings_are_asked_in_nets_that_begin_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.temporal.by_parts.decide_ctl_on_the_fly", gives_up)
    # The next marking has a 1 in the first digit alone, which turns to 0 before there is one in the second.
    net = family_net("counter-17")
    until = "[counter.one0 and not counter.one1 U counter.zero0 and counter.one1]"
    for text, holds in ((f"AX (A{until} and AG EF counter.zero0)", True), ("EX E[counter.one0 U counter.one2]", False)):
        found = decide_ctl_by_parts(net, parse_temporal(text), Limits())
        assert found.answer.holds is holds
        assert "after reduction from" in found.method
        with pytest.raises(IncompleteGraph):
            decide_ctl_by_parts(net, parse_temporal(text), Limits(Deadline.after(0)))
