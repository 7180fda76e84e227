"""LTL on the fly: as the definitions say, whatever the order of the search; its runs, its ends, and nets of no size."""

import random
from dataclasses import replace
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.block_nets import block_net
from support.dense_nets import dense_nets
from support.examples import examples, seeds
from support.lively_nets import lively_net, lively_nets
from support.ring_nets import ring_nets
from support.temporal_formulas import ltl_formulas

import firable.analysis.check as checking
from firable.analysis._engine import IncompleteGraph, find_lasso
from firable.analysis.check import check
from firable.analysis.compiled import flat, nodes_of
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.reduction.reduce import facts_on, reduce_for_runs
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.temporal.automaton import automaton_of
from firable.analysis.temporal.lasso import Run, satisfies, witness_of
from firable.analysis.temporal.ltl import refuting
from firable.analysis.temporal.on_the_fly import METHOD, LtlOnTheFly, Turn, compiled, decide_ltl_on_the_fly
from firable.analysis.temporal.rewriting import positive
from firable.analysis.temporal.sets import Sets
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import Holds
from firable.nets.net import Net, Place, TemporalProperty, Transition
from firable.nets.queries import parse_query
from firable.nets.temporal import Logic, Temporal, format_temporal, negated, parse_temporal
from firable.nets.temporal_parts import has_next
from firable.nets.verdict import Status, Verdict
from firable.semantics.trace import Discipline

FIXED, DRAWN = Turn(None, 2**20), Turn(7, 2**20)
REDUCED = Turn(None, 2**20, reduced=True)
SPARING = Turn(None, 2**20, sparing=True)
SPARING_DRAWN = Turn(3, 2**20, sparing=True)
SPARING_REDUCED = Turn(5, 2**20, sparing=True, reduced=True)
MEMORY = 2**28


def names(net: Net) -> tuple[list[str], list[str]]:
    return [place.name for place in net.places], [transition.name for transition in net.transitions]


def decided_as_over_sets(net: Net, formula: Temporal, turn: Turn) -> bool | None:
    """Whether the formula holds; the same over sets of markings, and a run that is one refutes what does not.

    None where the turn does not decide it, which those may that leave something out.
    """
    try:
        found = decide_ltl_on_the_fly(net, formula, Limits(), turns=[turn]).answer
    except IncompleteGraph:
        assert turn.sparing or turn.reduced
        return None
    assert found.holds is (refuting(Sets(explore(net)), formula) is None), format_temporal(formula)
    if not found.holds:
        assert found.witness is not None
        firings, cycle = (
            tuple((net.transition_index[name],) for (name,) in part)
            for part in (found.witness.firings, found.witness.cycle)
        )
        run = Run(firings, cycle)
        witness_of(net, Discipline.INTERLEAVING, run, "")
        assert not satisfies(net, run, formula)
    return bool(found.holds)


@pytest.mark.parametrize("turn", [FIXED, DRAWN])
@examples(15)
@given(st.data(), st.one_of(ring_nets(), ring_nets(signals=True), lively_nets(), dense_nets(signals=True)))
def test_a_formula_is_decided_as_over_sets_in_either_order(turn: Turn, data: st.DataObject, net: Net) -> None:
    formula = data.draw(ltl_formulas(*names(net), leaves=6))
    kept = [decided_as_over_sets(net, one, turn) for one in (formula, negated(formula))]
    assert kept != [True, True]  # there is a run


@examples(15)
@given(st.data(), st.one_of(ring_nets(), ring_nets(signals=True), lively_nets(), dense_nets(signals=True)))
def test_in_the_reduced_net_a_formula_is_decided_as_over_sets_and_each_one_that_has_no_x(
    data: st.DataObject, net: Net
) -> None:
    formula = data.draw(ltl_formulas(*names(net), leaves=6, events=False))
    for one in (formula, negated(formula)):
        held = decided_as_over_sets(net, one, REDUCED)
        assert held is not None or has_next(positive(negated(one))), format_temporal(one)


ORDERS = (
    "not {p} U {q}", "not {q} U {p}", "F ({p} and {q})", "G (not {p} or not {q})", "G F {p}", "F G not {p}",
    "G ({p} -> F {q})", "F (deadlock and {p})", "G ({p} -> ({p} U ({q} or {r})))", "F ({p} and F ({q} and F {r}))",
)  # fmt: skip


def test_in_the_reduced_net_what_happens_side_by_side_is_told_apart_as_over_sets() -> None:
    held, reduced = list[bool | None](), 0
    for seed in seeds(60):
        draw = random.Random(seed)
        net = block_net(draw)
        places = names(net)[0]
        for pattern in ORDERS:
            p, q, r = (draw.choice(places) for _ in range(3))
            held.append(decided_as_over_sets(net, parse_temporal(pattern.format(p=p, q=q, r=r)), REDUCED))
        reduced += len(reduce_for_runs(net, [Holds(places[0])]).net.places) < len(places)
    assert None not in held
    assert 0.2 < held.count(True) / len(held) < 0.8
    assert reduced > 30


def test_facts_that_were_proved_for_all_formulas_reduce_as_those_that_are_proved_for_one() -> None:
    nets = [family_net(name) for name in ("pipeline-8", "slotted_ring-3", "interlocked-4")]
    nets += [block_net(random.Random(seed), depth=4) for seed in seeds(20)]
    for net in nets:
        facts, labels = facts_on(net, Limits()), [Holds(net.places[0].name)]
        assert facts is not None
        with_facts, without = reduce_for_runs(net, labels, Limits(), facts), reduce_for_runs(net, labels)
        assert with_facts.net.places == without.net.places
        assert len(with_facts.net.transitions) == len(without.net.transitions)


def test_a_run_into_a_deadlock_of_the_reduced_net_goes_on_in_the_net_until_it_is_one_there() -> None:
    # A line of buffers that nobody empties: where the reduced net is stuck, the original fills those left out.
    places = tuple(Place(name) for name in ("d", "c", "b", "a", "never"))
    steps = (("in", (), ("a",)), ("t", ("a",), ("b",)), ("u", ("b",), ("c",)), ("v", ("c",), ("d",)))
    net = Net("line", places, tuple(Transition(*step) for step in steps))
    found = decide_ltl_on_the_fly(net, parse_temporal("F never"), Limits(), turns=[REDUCED])
    assert "openers late" in found.method
    assert found.answer.witness is not None
    assert set(found.answer.witness.marking) == {"a", "b", "c", "d"}


def test_who_is_asked_again_goes_on_where_it_was_ended() -> None:
    net, formula = family_net("counter-17"), parse_temporal("G F start")
    on_the_fly = LtlOnTheFly(net)
    for _ in range(2):
        with pytest.raises(IncompleteGraph, match="1,000 pairs of a marking and a state"):
            on_the_fly(formula, Limits(), turns=[Turn(None, 1_000)])
    nobody = Event()
    nobody.set()
    with pytest.raises(IncompleteGraph):
        on_the_fly(parse_temporal('G F "counter.one0"'), Limits(Deadline(cancelled=nobody)), turns=[REDUCED])
    known = on_the_fly(parse_temporal('G F "counter.one0"'), Limits(), turns=[REDUCED])
    assert "no rule" not in known.method  # what time had ended was not kept


def test_a_search_that_memory_ends_is_no_end_for_one_in_the_reduced_net() -> None:
    net = family_net("machines-14")
    first = net.transitions[0]
    formula = parse_temporal(f'G ("{first.inputs[0]}" or "{first.outputs[0]}")')
    limits = Limits(memory_bytes=200_000)
    with pytest.raises(IncompleteGraph, match="memory"):
        decide_ltl_on_the_fly(net, formula, limits, turns=[FIXED])
    found = decide_ltl_on_the_fly(net, formula, limits, turns=[FIXED, REDUCED])
    assert found.answer.holds
    assert "reduction" in found.method


def test_a_search_that_has_seen_all_in_vain_is_not_tried_with_a_larger_budget() -> None:
    net = family_net("machines-4")
    on_the_fly = LtlOnTheFly(net)
    held = parse_temporal(f'X X ("{net.places[0].name}" or not "{net.places[0].name}")')
    turns = [Turn(None, 2**most, sparing=True) for most in (10, 12, 14)]
    with pytest.raises(IncompleteGraph) as once:
        on_the_fly(held, Limits(), turns=turns[:1])
    with pytest.raises(IncompleteGraph) as again:
        on_the_fly(held, Limits(), turns=turns)
    assert str(once.value) == str(again.value)


@pytest.mark.parametrize("turn", [SPARING, SPARING_DRAWN, SPARING_REDUCED])
@examples(15)
@given(st.data(), st.one_of(ring_nets(), lively_nets(), dense_nets(signals=True)))
def test_a_search_that_spares_firings_finds_only_runs_and_concludes_nothing_from_finding_none(
    turn: Turn, data: st.DataObject, net: Net
) -> None:
    formula = data.draw(ltl_formulas(*names(net), leaves=6))
    for one in (formula, negated(formula)):
        assert decided_as_over_sets(net, one, turn) in {False, None}


PATTERNS = (
    "G F {p}", "F G {p}", "G F {p} -> G F {q}", "G F {p} and G F {q} -> F G {r}", "G ({p} -> F {q})",
    "G (fires({t}) -> F fires({u}))", "not fires({t}) U fires({u})", "G F fires({t}) -> G F fires({u})",
    "F G not fires({t}) or G F {p}", "X X ({p} R {q})", "G ({p} -> X ({q} W {r}))", "F ({p} and X F ({q} and X F {r}))",
)  # fmt: skip


def test_patterns_that_people_ask_are_decided_as_over_sets_on_nets_whose_transitions_compete() -> None:
    held = list[bool | None]()
    for seed in seeds(30):
        draw = random.Random(seed)
        net = lively_net(draw, 10)
        places, transitions = names(net)
        p, q, r = draw.sample(places, 3)
        t, u = draw.sample(transitions, 2)
        for pattern in PATTERNS:
            formula = parse_temporal(pattern.format(p=p, q=q, r=r, t=t, u=u))
            held.append(decided_as_over_sets(net, formula, draw.choice((FIXED, DRAWN))))
    assert None not in held
    assert 0.05 < held.count(True) / len(held) < 0.95


def test_patterns_that_people_ask_are_refuted_by_a_search_that_spares_firings_or_in_the_reduced_net() -> None:
    failing, refuted = 0, dict.fromkeys((REDUCED, SPARING, SPARING_DRAWN, SPARING_REDUCED), 0)
    for seed in seeds(20):
        draw = random.Random(seed)
        net = lively_net(draw, 10)
        p, q, r = draw.sample(names(net)[0], 3)
        for pattern in (one for one in PATTERNS if "fires" not in one):
            formula = parse_temporal(pattern.format(p=p, q=q, r=r))
            failing += refuting(Sets(explore(net)), formula) is not None
            for turn in refuted:
                refuted[turn] += decided_as_over_sets(net, formula, turn) is False
    assert failing > 50
    assert min(refuted.values()) > 0.9 * failing


def test_firings_that_can_wait_are_not_tried_in_every_order() -> None:
    chains = range(8)  # of three places each: 3^8 markings, none of which the formula tells from another
    places = (Place(f"{a}{i}", marked=a == "a") for i in chains for a in "abc")
    steps = (Transition(f"{a}{b}{i}", (f"{a}{i}",), (f"{b}{i}",)) for i in chains for a, b in ("ab", "bc"))
    net = Net("chains", (*places, Place("never")), tuple(steps))
    automaton = automaton_of(positive(parse_temporal("F never")))
    labels, rows = compiled(net, automaton)
    met = {}
    for sparing in (False, True):
        met[sparing] = find_lasso(
            *flat(net),
            [nodes_of(net, label) for label in labels],
            rows,
            automaton.n_marks,
            sparing=sparing,
            max_vertices=2**20,
            max_memory_bytes=MEMORY,
            max_seconds=None,
        )
    assert all(found.complete and found.run is None for found in met.values())
    assert [found.n_vertices for found in met.values()] == [3**8, 2 * 8 + 1]


def test_the_first_run_that_refutes_ends_the_search_in_a_net_that_no_memory_holds() -> None:
    net = family_net("machines-200")  # 2^200 markings
    place = net.places[0].name
    found = decide_ltl_on_the_fly(net, parse_temporal(f'G F "{place}"'), Limits())
    assert found.answer.holds is False
    assert found.method == METHOD
    assert (found.cost.markings or 0) < 1_000


def test_what_no_run_can_refute_any_more_is_not_followed() -> None:
    net = family_net("machines-200")
    name = net.places[0].name
    held = parse_temporal(f'"{name}" or G F start')
    assert decide_ltl_on_the_fly(net, held, Limits()).cost.markings == 1


def test_a_way_as_deep_as_the_net_has_markings_overflows_no_stack() -> None:
    net = family_net("counter-17")  # one run, through 2^17 markings
    found = decide_ltl_on_the_fly(net, parse_temporal("G F start"), Limits())
    assert found.answer.holds
    assert found.cost.markings is not None
    assert found.cost.markings > 2**17


def test_the_run_that_is_shown_is_short_though_the_search_was_deep() -> None:
    # From `a` a long way round comes first, and the way to `z` last; beside them a chain that is never needed.
    chain = 500
    places = (Place("a", marked=True), Place("z"), *(Place(f"c{i}") for i in range(chain)))
    steps = (Transition(f"t{i:03}", ("a" if i == 0 else f"c{i - 1}",), (f"c{i}",)) for i in range(chain))
    net = Net(
        "detour",
        places,
        (*steps, Transition("t999", (f"c{chain - 1}",), ("z",)), Transition("u", ("a",), ("z",)),
         Transition("v", ("z",), ("a",))),
    )  # fmt: skip
    witness = decide_ltl_on_the_fly(net, parse_temporal('not G F "z"'), Limits(), turns=[FIXED]).answer.witness
    assert witness is not None
    assert len(witness.firings) + len(witness.cycle) <= 3


def test_a_budget_that_ends_leaves_it_undecided_and_says_how_far_was_looked() -> None:
    net, formula = family_net("counter-17"), parse_temporal("G F start")
    with pytest.raises(IncompleteGraph, match="2,000 pairs of a marking and a state"):
        decide_ltl_on_the_fly(net, formula, Limits(), turns=[Turn(None, 1_000), Turn(1, 1_000)])
    with pytest.raises(IncompleteGraph, match="memory"):
        decide_ltl_on_the_fly(net, formula, Limits(memory_bytes=300_000))
    with pytest.raises(IncompleteGraph, match="time"):
        decide_ltl_on_the_fly(net, formula, Limits(Deadline.after(0)))
    nobody = Event()
    nobody.set()
    with pytest.raises(IncompleteGraph):
        decide_ltl_on_the_fly(net, formula, Limits(Deadline(cancelled=nobody)))
    accept_none = [[(0, False, list[int](), True, 0, list[int]())]]
    found = find_lasso(*flat(net), [[(2, [])]], accept_none, 1, max_vertices=2**20, max_memory_bytes=MEMORY,
                       max_seconds=None, cancelled=lambda: True)  # fmt: skip
    assert (found.complete, found.reason, found.run) == (False, "cancelled", None)
    assert 0 < found.n_vertices < 2**17


def test_memory_that_ends_anywhere_is_an_end_and_no_wrong_answer() -> None:
    net, formula = family_net("philosophers_either-6"), parse_temporal("G F start")
    decided = []
    for kilobytes in range(8, 160, 4):
        try:
            decided.append(decide_ltl_on_the_fly(net, formula, Limits(memory_bytes=1_000 * kilobytes)).answer.holds)
        except IncompleteGraph:
            decided.append(None)
    assert set(decided) == {None, False}
    assert decided == sorted(decided, key=lambda holds: holds is not None)


@pytest.mark.parametrize(
    ("labels", "rows", "n_marks"),
    [
        ([[(1, [9])]], [[(0, False, [], True, 0, [])]], 0),
        ([[(2, [])]], [[(1, False, [], True, 0, [])]], 0),
        ([[(2, [])]], [[(0, False, [2], True, 0, [])]], 0),
        ([[(2, [])]], [[(0, False, [], True, 1, [])]], 0),
        ([[(2, [])]], [[(0, False, [], True, 0, [0])]], 0),
        ([[(2, [])]], [[(0, False, [], True, 0, [64])]], 1),
        ([[(2, [])]], [[(0, False, [], True, 0, [])]], 65),
        ([[(2, [])]], [], 0),
    ],
)
def test_an_automaton_that_names_what_is_not_there_is_refused(
    labels: list[list[tuple[int, list[int]]]],
    rows: list[list[tuple[int, bool, list[int], bool, int, list[int]]]],
    n_marks: int,
) -> None:
    ring = Net(
        "ring",
        (Place("a", marked=True), Place("b")),
        (Transition("t", ("a",), ("b",)), Transition("u", ("b",), ("a",))),
    )
    with pytest.raises(ValueError, match=r".+"):
        find_lasso(*flat(ring), labels, rows, n_marks, max_vertices=10, max_memory_bytes=MEMORY, max_seconds=None)


def test_an_accepted_run_takes_an_edge_with_each_of_sixty_four_marks() -> None:
    ring = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{(i + 1) % 64}",)) for i in range(64))
    net = Net("ring", tuple(Place(f"p{i}", marked=i == 0) for i in range(64)), ring)
    full = [nodes_of(net, Holds(f"p{i}")) for i in range(64)]
    rows = [[(i, False, list[int](), True, 0, [i]) for i in range(64)]]
    found = find_lasso(*flat(net), full, rows, 64, max_vertices=100, max_memory_bytes=MEMORY, max_seconds=None)
    assert found.run == ([], list(range(64)))


def test_states_that_lead_to_no_acceptance_are_left_out_and_the_nearest_come_first() -> None:
    net = catalogue_net("one_robot")
    _, rows = compiled(net, automaton_of(positive(parse_temporal("F (start and X F G not start)"))))
    assert [target for *_, target, _ in rows[0]] == sorted((target for *_, target, _ in rows[0]), reverse=True)


def verdict_of(net: Net, text: str, method: str = "auto", budget: Budget | None = None) -> Verdict:
    return check(net, budget=budget, method=method, queries=[parse_query(text, "asked")]).verdict("query.asked")


def test_by_its_name_it_decides_formulas_of_ltl_and_nothing_else() -> None:
    net = catalogue_net("one_robot")
    for text, status in (("G F start", Status.VIOLATED), ("not fires(G5) U fires(G2)", Status.PROVED)):
        verdict = verdict_of(net, text, method="on-the-fly")
        assert (verdict.status, verdict.method) == (status, METHOD)
    assert check(net, method="on-the-fly").verdict("deadlock-free").status is Status.UNKNOWN


def test_auto_asks_it_where_no_technique_holds_all_markings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(checking, "SPACES", {})
    verdict = verdict_of(family_net("machines-40"), "G F start", budget=Budget(markings=100, seconds=20.0))
    assert (verdict.status, verdict.method) == (Status.VIOLATED, METHOD)


def test_a_property_of_the_net_is_asked_before_sets_of_markings_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "FIRST_MARKINGS", 5)
    again = TemporalProperty("again", Logic.LTL, parse_temporal("G F start"))
    net = replace(catalogue_net("one_robot"), properties=(again,))
    verdict = check(net).verdict("property.again")
    assert (verdict.status, verdict.method, verdict.witness is not None) == (Status.VIOLATED, METHOD, True)
