"""Upper bounds by goals: exact as over all markings, shown, and found of nets that no memory holds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.lively_nets import lively_nets
from support.naive_space import NaiveSpace

import firable.analysis.check as checking
from firable.analysis.check import check
from firable.analysis.goal import Finding, Limits
from firable.analysis.spaces.reachability import Budget
from firable.analysis.spaces.space import WitnessError
from firable.analysis.stubborn import decide_by_stubborn_sets
from firable.analysis.verdicts.bounds import greatest
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.queries import parse_query
from firable.nets.verdict import Status, Verdict, Witness


@examples(20)
@given(st.data(), lively_nets())
def test_a_bound_by_goals_is_that_over_all_markings(data: st.DataObject, net: Net) -> None:
    places = tuple(data.draw(st.lists(st.sampled_from([place.name for place in net.places]), min_size=1, max_size=6)))
    asked: list[Formula] = []

    def reached(goal: Formula) -> Finding:
        asked.append(goal)
        return decide_by_stubborn_sets(net, goal, Limits())

    found = greatest(net, places, reached)
    assert found is not None
    assert found[0] == NaiveSpace(net).fullest([net.place_index[place] for place in places])[0]
    assert len(asked) == len(found[1]) <= len(places).bit_length()


def test_a_finding_that_is_missing_leaves_the_bound_open_and_a_false_one_is_noticed() -> None:
    net, places = catalogue_net("one_robot"), ("robot.free", "mc.free", "robot.put_mc")
    assert greatest(net, places, lambda _: None) is None
    less = Finding(reachable=True, method="a liar", witness=Witness((), (), ("mc.free",)))
    with pytest.raises(WitnessError):
        greatest(net, places, lambda _: less)


def verdict_of(net: Net, text: str, seconds: float = 30.0) -> Verdict:
    budget = Budget(markings=100, seconds=seconds)
    return check(net, budget=budget, queries=[parse_query(text, "most")]).verdict("query.most")


def test_bounds_are_found_where_no_technique_holds_all_markings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "FIRST_MARKINGS", 5)
    monkeypatch.setattr(checking, "SPACES", {})
    net = family_net("machines-40")
    for text, bound in (("bound tokens(m1.idle, m1.busy)", 1), ("bound tokens(m1.busy, m2.busy, m3.busy)", 3)):
        verdict = verdict_of(net, text)
        assert verdict.status is Status.PROVED
        assert verdict.statement.endswith(f" is {bound}")
        assert verdict.witness is not None
        assert f"= {bound}" in verdict.witness.note
