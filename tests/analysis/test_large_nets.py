"""Nets that are wide, dense at one place, or deep go through `check` whole.

No test here looks at a clock: the sizes are such that whatever is quadratic would take minutes or all memory, and
whatever recurses would run out of its stack.
"""

from dataclasses import replace

import pytest

from firable.analysis.check import check
from firable.analysis.spaces.reachability import Budget, explore
from firable.nets.catalogue import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import NESTING_MAX, parse_formula
from firable.nets.net import Net, Place, Property, PropertyKind, Transition
from firable.nets.verdict import Status


def chain(n: int) -> Net:
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n))
    return Net("chain", places, tuple(Transition(f"t{i}", (f"p{i}",), (f"p{(i + 1) % n}",)) for i in range(n)))


def hub(n: int) -> Net:
    places = (Place("hub", marked=True), *(Place(f"p{i}") for i in range(n)))
    out = (Transition(f"a{i}", ("hub",), (f"p{i}",)) for i in range(n))
    back = (Transition(f"b{i}", (f"p{i}",), ("hub",)) for i in range(n))
    return Net("hub", places, (*out, *back))


def test_a_chain_of_thousands_of_places_is_decided() -> None:
    report = check(chain(4_000))
    assert report.figures.markings == 4_000
    assert {verdict.status for verdict in report.verdicts} == {Status.PROVED}


def test_a_place_with_thousands_of_consumers_is_decided_and_its_conflicts_are_listed_in_part() -> None:
    report = check(hub(1_500))
    assert report.figures.markings == 1_501
    assert report.figures.cut_short == ("structural_conflicts",)
    assert report.verdict("live").status is Status.PROVED
    assert report.verdict("structural-conflicts").status is Status.VIOLATED
    assert "only the first 20,000" in report.verdict("structural-conflicts").hint
    assert report.verdict("effective-conflicts").status is Status.VIOLATED


def test_effective_conflicts_stay_unknown_where_not_all_pairs_are_listed_and_none_meets() -> None:
    net = hub(300)
    unmarked = Net("dry", (Place("hub"), *net.places[1:]), net.transitions)
    report = check(unmarked)
    verdict = report.verdict("effective-conflicts")
    assert (verdict.status, verdict.bound) == (
        Status.UNKNOWN,
        "none of the first 20,000 pairs that share a place compete, and there are more",
    )
    assert "--query" in verdict.hint
    assert report.figures.effective_conflicts is None


def test_a_formula_nested_to_the_limit_is_decided() -> None:
    depth = NESTING_MAX // 2 - 1  # `not` and its bracket are a level each
    deep = parse_formula("not (" * depth + "p0" + ")" * depth)
    net = replace(chain(3), properties=(Property("deep", PropertyKind.ALWAYS_POSSIBLE, deep),))
    assert check(net).verdict("property.deep").status is Status.PROVED


def test_a_marking_a_hundred_thousand_firings_deep_has_its_witness() -> None:
    graph = explore(family_net("counter-17"))
    assert graph.complete
    last = graph.n_markings - 1
    assert len(graph.witness_at(last).firings) == last == 2**17 - 1


def test_a_net_of_a_hundred_thousand_transitions_is_explored() -> None:
    n = 2_000
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n))
    transitions = tuple(Transition(f"t{t}", (f"p{t % n}",), (f"p{(t % n + 1 + t // n) % n}",)) for t in range(100_000))
    graph = explore(Net("wide", places, transitions), budget=Budget(markings=2_000))
    assert (graph.complete, graph.n_markings, graph.n_edges) == (True, n, 100_000)


@pytest.mark.parametrize(
    ("machines", "told"),
    [
        (2000, "explicit engine gave up: the budget of 2,097,152 bytes does not hold the net itself"),
        (4000, "the explicit engine has no room for the net itself"),
    ],
)
def test_a_net_too_wide_for_the_explicit_engine_is_decided_by_a_diagram(machines: int, told: str) -> None:
    report = check(family_net(f"machines-{machines}"), budget=Budget(memory_bytes=2**22))
    assert any(line.startswith(told) for line in report.course)
    assert report.figures.markings == 2**machines
    assert report.verdict("reversible").status is Status.PROVED


def test_a_net_that_no_technique_has_room_for_is_refused() -> None:
    with pytest.raises(InputError, match="does not hold the net itself"):
        check(family_net("machines-4000"), budget=Budget(memory_bytes=2**16))
