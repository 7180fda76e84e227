"""The properties of a net file against their definitions; leads_to against every set of recurring markings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain, combinations, pairwise
from typing import Any

import networkx as nx
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.examples import examples
from support.ring_nets import ring_nets

from firable.analysis._engine import BudgetExceeded
from firable.analysis.spaces.bottoms import FIRINGS_MAX, SEARCHES
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace, WitnessError
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.verdicts.leads_to import check_lasso
from firable.analysis.verdicts.properties import SEARCHED_MAX, decide_property, statement
from firable.nets.formula import Formula, parse_formula
from firable.nets.net import Fairness, Marking, Net, Place, Property, PropertyKind, Transition
from firable.nets.verdict import Status, Verdict
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, Player, holds_in
from firable.semantics.trace import Discipline

STATED = [
    *("a", "b", "not a", "a and not b", "a or b", "start", "deadlock"),
    *("firable(t0)", "not firable(t1)", "false", "true"),
]
FORMULAS = st.sampled_from(STATED).map(parse_formula)
SITUATIONS = st.tuples(ring_nets(signals=True), st.sampled_from(Discipline)).filter(
    lambda drawn: len(drawn[0].transitions) > 1
)


MANY = SEARCHED_MAX + 1


def prop(kind: PropertyKind, p: Formula, q: Formula | None = None, fairness: Fairness = Fairness.WEAK) -> Property:
    return Property("x", kind, p, q, fairness)


def satisfying(net: Net, formula: Formula, markings: set[Marking]) -> set[Marking]:
    return {m for m in markings if evaluate(BOOL, net, formula, holds_in(m))}


def graph_of(net: Net, discipline: Discipline) -> nx.MultiDiGraph[Marking]:
    graph: nx.MultiDiGraph[Marking] = nx.MultiDiGraph()
    for marking, edges in Player(net).reachable(step=discipline is Discipline.STEP).items():
        graph.add_node(marking)
        for fired, target in edges:
            graph.add_edge(marking, target, fired=fired)
    return graph


@examples(75)
@given(SITUATIONS, FORMULAS)
def test_properties_of_markings_are_decided_by_their_definitions(
    situation: tuple[Net, Discipline], formula: Formula
) -> None:
    net, discipline = situation
    truth, graph = graph_of(net, discipline), explore(net, discipline)
    markings = set(truth)
    good = satisfying(net, formula, markings)
    may_come_back = {m for m in markings if (nx.descendants(truth, m) | {m}) & good}
    away = nx.single_source_shortest_path_length(truth, net.initial_marking)
    for kind, shown in (
        (PropertyKind.NEVER, good),
        (PropertyKind.ALWAYS, markings - good),
        (PropertyKind.REACHABLE, good),
        (PropertyKind.ALWAYS_POSSIBLE, markings - may_come_back),
    ):
        verdict = decide_property(graph, prop(kind, formula))
        holds = bool(shown) if kind is PropertyKind.REACHABLE else not shown
        assert verdict.status is (Status.PROVED if holds else Status.VIOLATED)
        assert (verdict.witness is not None) == bool(shown)
        if verdict.witness is not None:
            assert net.marking(verdict.witness.marking) in shown
            assert len(verdict.witness.firings) == min(away[m] for m in shown)


HELD: dict[str, Callable[[Net], StateSpace[Any]]] = {
    "graph": explore,
    "graph of steps": partial(explore, discipline=Discipline.STEP),
    "diagram": explore_symbolically,
}


def many(net: Net, *texts: str) -> Net:
    """The net with more properties to be always possible than are searched for one by one."""
    formulas = [parse_formula(text) for text in texts]
    assert len(formulas) > SEARCHED_MAX
    stated = (replace(prop(PropertyKind.ALWAYS_POSSIBLE, of), name=f"x{i}") for i, of in enumerate(formulas))
    return replace(net, properties=tuple(stated))


@pytest.mark.parametrize("held", HELD)
@examples(40)
@given(net=ring_nets(signals=True).filter(lambda net: len(net.transitions) > 1))
def test_of_many_properties_to_be_always_possible_the_same_hold(held: str, net: Net) -> None:
    space = HELD[held](many(net, *STATED))
    truth = graph_of(net, space.discipline)
    for of in space.net.possibilities:
        good = satisfying(net, of.formula, set(truth))
        lost = {m for m in truth if not (nx.descendants(truth, m) | {m}) & good}
        verdict = decide_property(space, of)
        assert verdict.status is (Status.VIOLATED if lost else Status.PROVED)
        assert (verdict.witness is not None) == bool(lost)
        if verdict.witness is not None:
            assert net.marking(verdict.witness.marking) in lost
            assert verdict.witness.note.endswith("can never be reached again")


def way(length: int, *rings: tuple[str, ...]) -> Net:
    """A way up, from each place of it to one on a way down, and from the end of that into rings of places."""
    up, down = [f"u{i}" for i in range(length)], [f"d{i}" for i in reversed(range(length))]
    moves = [*pairwise(up), *pairwise(down), *zip(up, reversed(down), strict=True)]
    moves += [pair for ring in rings for pair in (("d0", ring[0]), *zip(ring, (*ring[1:], ring[0]), strict=True))]
    names = dict.fromkeys(name for pair in moves for name in pair)
    places = tuple(Place(name, marked=name == "u0") for name in names)
    return Net("way", places, tuple(Transition(f"t{i}", (a,), (b,)) for i, (a, b) in enumerate(moves)))


def test_where_a_goal_is_lost_long_before_the_end_that_is_shown() -> None:
    steps = [f"s{i}" for i in range(2 * FIRINGS_MAX)]
    names = ["m0", *steps]
    places = tuple(Place(name, marked=name == "m0") for name in names)
    chain = Net("chain", places, tuple(Transition(f"t{a}", (a,), (b,)) for a, b in pairwise(names)))
    for space in (explore(many(chain, *["m0"] * MANY)), explore_symbolically(many(chain, *["m0"] * MANY))):
        for of in space.net.possibilities:
            witness = decide_property(space, of).witness
            assert witness is not None
            assert len(witness.firings) == 1


def test_a_bottom_component_at_the_end_of_a_long_way_is_found_in_few_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    net, searches = way(1000, ("a", "b"), ("c", "d")), list[int]()
    forward = ReachabilityGraph.forward

    def counted(graph: ReachabilityGraph, sources: Any) -> Any:
        searches.append(1)
        return forward(graph, sources)

    monkeypatch.setattr(ReachabilityGraph, "forward", counted)
    graph = explore(many(net, *["a or c"] * (MANY - 1), "a"))
    assert [decide_property(graph, of).holds for of in graph.net.possibilities] == [True] * (MANY - 1) + [False]
    assert 2 <= len(searches) < 60


def test_components_that_take_too_long_are_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = list[int]()

    def home(_: object) -> Any:
        begun.append(1)
        raise BudgetExceeded("the time was over")

    monkeypatch.setattr(ReachabilityGraph, "home", home)
    graph = explore(many(way(3, ("a", "b")), *["a"] * (MANY - 1), "u0"))
    assert [decide_property(graph, of).holds for of in graph.net.possibilities] == [True] * (MANY - 1) + [False]
    assert len(begun) == 1


def test_a_run_that_takes_too_long_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    net = Net("ends", (Place("m0", marked=True), Place("a")), (Transition("t", ("m0",), ("a",)),))
    graph = explore(many(net, *["m0"] * MANY))
    asked, witness = list[int](), ReachabilityGraph.witness

    def first_too_late(space: ReachabilityGraph, targets: Any, note: str = "") -> Any:
        asked.append(1)
        if len(asked) == 1:
            raise BudgetExceeded("the time was over")
        return witness(space, targets, note)

    monkeypatch.setattr(ReachabilityGraph, "witness", first_too_late)
    assert not any(decide_property(graph, of).holds for of in graph.net.possibilities)
    assert len(asked) == 1 + MANY


def test_bottom_components_that_are_not_looked_for_leave_no_property_wrongly_proved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, bottom_after = list[int](), ReachabilityGraph.bottom_after

    def counted(graph: ReachabilityGraph, markings: Any) -> Any:
        found.append(1)
        return bottom_after(graph, markings)

    monkeypatch.setattr(ReachabilityGraph, "bottom_after", counted)
    choices = range(6)
    places = [Place("m0", marked=True), *(Place(f"{side}{i}") for i in choices for side in "ab")]
    enter = [Transition(f"enter{i}", ("m0",), (f"a{i}",)) for i in choices]
    there = [Transition(f"there{i}", (f"a{i}",), (f"b{i}",)) for i in choices]
    back = [Transition(f"back{i}", (f"b{i}",), (f"a{i}",)) for i in choices]
    all_but = [" or ".join(f"b{i}" for i in choices if i != without) for without in choices]
    texts = [*all_but, " or ".join(f"b{i}" for i in choices), "a0 or not a0", "a0"]
    assert len(texts) < SEARCHES * len(choices)
    graph = explore(many(Net("choices", tuple(places), (*enter, *there, *back)), *texts))
    verdicts = [decide_property(graph, of) for of in graph.net.possibilities]
    assert [verdict.holds for verdict in verdicts] == [*(False for _ in choices), True, True, False]
    assert len(found) == len(texts) // SEARCHES


def recurs(net: Net, truth: nx.MultiDiGraph[Marking], among: frozenset[Marking], fairness: Fairness) -> bool:
    """Whether a fair run may visit exactly these markings again and again."""
    part = truth.subgraph(among)
    if not part.number_of_edges() or not nx.is_strongly_connected(part):
        return False
    fired: set[int] = set()
    for _, _, data in part.edges(data=True):
        fired.update(data["fired"])
    enabled = [set(Player(net).may_fire(m)) for m in among]
    owed = {Fairness.NONE: set[int](), Fairness.WEAK: set.intersection(*enabled), Fairness.STRONG: set.union(*enabled)}
    return owed[fairness] <= fired


def fails(net: Net, truth: nx.MultiDiGraph[Marking], p: Formula, q: Formula, fairness: Fairness) -> bool:
    """Whether a fair run or a run into a deadlock meets p and then never q, by trying every set of markings."""
    markings = set(truth)
    without = markings - satisfying(net, q, markings)
    part = truth.subgraph(without)
    ends = {m for m in without if not truth.out_degree(m)}
    sets = chain.from_iterable(combinations(sorted(without), n) for n in range(1, len(without) + 1))
    for chosen in sets:
        if not set(chosen) <= ends and recurs(net, truth, frozenset(chosen), fairness):
            ends |= set(chosen)
    return any((nx.descendants(part, m) | {m}) & ends for m in satisfying(net, p, without))


@pytest.mark.parametrize("fairness", Fairness)
@examples(30)
@given(situation=SITUATIONS, p=FORMULAS, q=FORMULAS)
def test_leads_to_fails_iff_some_set_of_markings_recurs_fairly(
    fairness: Fairness, situation: tuple[Net, Discipline], p: Formula, q: Formula
) -> None:
    net, discipline = situation
    truth = graph_of(net, discipline)
    assume(len(truth) <= 10)
    verdict = decide_property(explore(net, discipline), prop(PropertyKind.LEADS_TO, p, q, fairness))
    expected = Status.VIOLATED if fails(net, truth, p, q, fairness) else Status.PROVED
    assert verdict.status is expected
    if expected is Status.VIOLATED:
        refutes(net, truth, verdict, (p, q, fairness))


def refutes(net: Net, truth: nx.MultiDiGraph[Marking], verdict: Verdict, of: tuple[Formula, Formula, Fairness]) -> None:
    """The witness is a run of the graph that meets p, never q from there on, and ends or recurs fairly."""
    assert verdict.witness is not None
    p, q, fairness = of

    def along(marking: Marking, firings: tuple[tuple[str, ...], ...]) -> list[Marking]:
        markings = [marking]
        for names in firings:
            label: FiringSet = tuple(sorted(net.transition_index[name] for name in names))
            markings.append(next(to for _, to, d in truth.out_edges(markings[-1], data=True) if d["fired"] == label))
        return markings

    prefix = along(net.initial_marking, verdict.witness.firings)
    cycle = along(prefix[-1], verdict.witness.cycle)
    meets = [k for k, m in enumerate(prefix) if m in satisfying(net, p, {m})]
    avoided = [k for k in meets if not satisfying(net, q, {*prefix[k:], *cycle})]
    assert avoided
    if not verdict.witness.cycle:
        assert not truth.out_degree(prefix[-1])
        return
    assert cycle[0] == cycle[-1]
    fired = {net.transition_index[name] for names in verdict.witness.cycle for name in names}
    enabled = [set(Player(net).may_fire(m)) for m in cycle]
    owed = {Fairness.NONE: set[int](), Fairness.WEAK: set.intersection(*enabled), Fairness.STRONG: set.union(*enabled)}
    assert owed[fairness] <= fired


def shuttle() -> Net:
    """A token goes between a and b; from a it may leave to c; a second shuttle d-e never stops."""
    places = tuple(Place(name, marked=name in "ad") for name in "abcde")
    return Net(
        "shuttle",
        places,
        (
            Transition("go", ("a",), ("b",)),
            Transition("back", ("b",), ("a",)),
            Transition("leave", ("a",), ("c",)),
            Transition("x", ("d",), ("e",)),
            Transition("y", ("e",), ("d",)),
        ),
    )


@pytest.mark.parametrize(
    ("p", "q", "holds"),
    [
        ("a", "b or c", (False, True, True)),  # without fairness the other shuttle may run alone
        ("a", "c", (False, False, True)),  # `leave` is enabled again and again, never for ever
        ("c", "a", (False, False, False)),  # what has left does not come back
        ("false", "false", (True, True, True)),
    ],
)
def test_weak_fairness_serves_what_stays_enabled_and_strong_fairness_what_recurs(
    p: str, q: str, holds: tuple[bool, bool, bool]
) -> None:
    graph = explore(shuttle())
    of = [prop(PropertyKind.LEADS_TO, parse_formula(p), parse_formula(q), fairness) for fairness in Fairness]
    assert tuple(decide_property(graph, each).holds for each in of) == holds


def test_a_deadlock_after_p_and_before_q_refutes_leads_to_under_any_fairness() -> None:
    net = Net("n", (Place("a", marked=True), Place("b")), (Transition("t", ("a",), ("b",)),))
    for fairness in Fairness:
        verdict = decide_property(
            explore(net), prop(PropertyKind.LEADS_TO, parse_formula("b"), parse_formula("a"), fairness)
        )
        assert verdict.status is Status.VIOLATED
        assert verdict.witness is not None
        assert (verdict.witness.firings, verdict.witness.cycle) == ((("t",),), ())


def test_the_statement_says_which_fairness_and_that_gates_open() -> None:
    of = prop(PropertyKind.LEADS_TO, parse_formula("a"), parse_formula("b"), Fairness.STRONG)
    assert "strong fairness" in statement(of)
    assert "external gates do open" in statement(of)
    assert "weak fairness" in statement(replace(of, fairness=Fairness.WEAK))


def chain_of(length: int) -> ReachabilityGraph:
    """A token that goes down a chain of places, explored to its third marking."""
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(length))
    moves = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(length - 1))
    return explore(Net("chain", places, moves), budget=Budget(markings=3))


@pytest.mark.parametrize(
    ("kind", "p", "expected"),
    [
        (PropertyKind.NEVER, "p2", Status.VIOLATED),
        (PropertyKind.NEVER, "p7", Status.UNKNOWN),
        (PropertyKind.ALWAYS, "p0", Status.VIOLATED),
        (PropertyKind.ALWAYS, "not p7", Status.UNKNOWN),
        (PropertyKind.REACHABLE, "p1", Status.PROVED),
        (PropertyKind.REACHABLE, "p7", Status.UNKNOWN),
        (PropertyKind.ALWAYS_POSSIBLE, "true", Status.UNKNOWN),
        (PropertyKind.LEADS_TO, "p0", Status.UNKNOWN),
    ],
)
def test_from_a_part_of_the_graph_only_what_a_marking_shows_is_concluded(
    kind: PropertyKind, p: str, expected: Status
) -> None:
    q = parse_formula("true") if kind is PropertyKind.LEADS_TO else None
    verdict = decide_property(chain_of(9), prop(kind, parse_formula(p), q))
    assert verdict.status is expected
    assert (verdict.code == "F3004") == (expected is Status.UNKNOWN)
    assert ("3 markings" in verdict.bound) == (expected is Status.UNKNOWN)


def pruned() -> Net:
    """A loop in which `escape` is enabled only after a detour that a strongly fair run need not take.

    Of the four markings of p / p2 and k / k2, `escape` is enabled where p and k2 hold a token. A run that goes
    through the other three fires all the other transitions again and again. Beside it, chosen at the start, is a loop
    of x and y.
    """
    places = tuple(Place(name, marked=name in {"s", "k"}) for name in ("s", "p", "p2", "k", "k2", "e", "x", "y"))
    moves = (
        Transition("into", ("s",), ("p",)),
        Transition("beside", ("s",), ("x",)),
        Transition("u", ("p",), ("p2",)),
        Transition("r", ("p2",), ("p",)),
        Transition("w", ("k",), ("k2",), ("p2",)),
        Transition("w2", ("k2",), ("k",), ("p2",)),
        Transition("escape", ("p", "k2"), ("e",)),
        Transition("there", ("x",), ("y",)),
        Transition("back", ("y",), ("x",)),
    )
    return Net("pruned", places, moves)


def test_strong_fairness_looks_into_components_that_are_unfair_as_a_whole() -> None:
    of = prop(PropertyKind.LEADS_TO, parse_formula("p"), parse_formula("e"), Fairness.STRONG)
    net = pruned()
    # In one of the two orders the component found in the second round has the number of one found in the first.
    for order in (net.transitions, net.transitions[::-1]):
        verdict = decide_property(explore(replace(net, transitions=order)), of)
        assert verdict.status is Status.VIOLATED
        assert verdict.witness is not None
        assert {name for step in verdict.witness.cycle for name in step} == {"u", "r", "w", "w2"}


def test_a_lasso_that_refutes_nothing_is_an_internal_error() -> None:
    net, index = pruned(), pruned().transition_index
    graph = explore(net)

    def lasso(prefix: str, cycle: str, *, trigger: int = 1, fairness: Fairness = Fairness.STRONG, q: str = "e") -> None:
        before: list[FiringSet] = [(index[name],) for name in prefix.split()]
        around: list[FiringSet] = [(index[name],) for name in cycle.split()]
        of = prop(PropertyKind.LEADS_TO, parse_formula("p"), parse_formula(q), fairness)
        check_lasso(graph.witnesses, of, before, trigger, around)

    lasso("into", "u w w2 r")
    lasso("into", "u r", fairness=Fairness.WEAK)
    with pytest.raises(WitnessError, match="not fair"):
        lasso("into", "u r")  # w is enabled again and again
    with pytest.raises(WitnessError, match="does not close"):
        lasso("into", "u")
    with pytest.raises(WitnessError, match="deadlock"):
        lasso("into", "")
    with pytest.raises(WitnessError, match=r"may not fire|not firable"):
        lasso("into", "w w2")
    with pytest.raises(WitnessError, match="does not refute"):
        lasso("into", "u w w2 r", trigger=0)  # p does not hold there
    with pytest.raises(WitnessError, match="does not refute"):
        lasso("into", "u w w2 r", q="p2")
