"""What is said of votes that markings decide: nothing that was not looked at, and no freedom that is not shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from support.free_parts import BY_A_UNIT

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import NO_TIME, LackingError
from firable.analysis.goal import Limits
from firable.analysis.settling import Settling
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import WitnessError
from firable.decompose.splitting import persistence as module
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import EVIDENCE, freed, nonpersistent, persistence
from firable.decompose.splitting.votes import FALSIFIERS_MAX, votes
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Controller, Net, Place, Transition
from firable.nets.verdict import TOKENS_MAX, Status


def net_of(marked: str, *transitions: Transition) -> Net:
    """A net of the controllers `a` and `b`, whose places are those that the transitions name."""
    names = dict.fromkeys(n for t in transitions for n in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive))
    places = tuple(Place(name, name[0], marked=name in marked.split()) for name in names)
    return Net("n", places, transitions, controllers=(Controller("a"), Controller("b")))


CROSSING = Transition("G", ("b.p",), ("b.q",), ("a.g",))
BY_MARKINGS = net_of(
    "a.g b.p", CROSSING, Transition("l", ("a.g", "a.x"), ("a.h",)), Transition("m", ("a.z",), ("a.x",))
)
"""`l` would take what the part of `G` at `a` reads, and has never what it needs besides: no arc and no unit says so."""
TWO_FALL = net_of("a.g b.p", CROSSING, Transition("k", ("a.g",), ("a.h",)), Transition("l", ("a.g",), ("a.i",)))
"""Two local transitions take back the yes of the part of `G` at `a`."""


def test_markings_that_are_not_all_prove_no_vote_persistent() -> None:
    net = catalogue_net("one_robot")
    some = explore(net, budget=Budget(markings=1))
    assert not some.complete
    found = persistence(split(net), some)
    assert found.of("t1-21").status is Status.VIOLATED
    assert found.space is not some


def test_markings_that_somebody_has_are_asked_before_any_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WALK_VOTES", 0)
    graph = explore(BY_MARKINGS)
    found = persistence(split(BY_MARKINGS), graph)
    assert found.space is graph
    walked = persistence(split(TWO_FALL), explore(TWO_FALL))
    assert walked.of("t1-11").method == graph.method


def test_votes_that_somebody_has_are_not_looked_for_again() -> None:
    cast = votes(split(TWO_FALL))[:1]
    assert persistence(split(TWO_FALL), cast=cast).votes == cast


def test_where_arcs_settle_all_no_marking_is_looked_at() -> None:
    found = persistence(split(net_of("a.g b.p", CROSSING)))
    assert found.space is None
    assert all(verdict.holds for verdict in found.verdicts)
    assert found.with_evidence() == ((), {})


def test_a_vote_that_arcs_settle_is_told_from_one_that_a_unit_settles() -> None:
    verdicts = persistence(split(BY_A_UNIT)).verdicts
    assert {verdict.discipline for verdict in verdicts} == {"interleaving"}
    assert {verdict.name: verdict.method for verdict in verdicts} == {
        "persistent.t1-11": "arcs and sets of places with one token at most",
        "persistent.t2-12": "arcs: no other transition can take it back",
    }


def test_a_part_is_free_of_promise_where_evidence_shows_that_its_vote_stands() -> None:
    found = persistence(split(BY_MARKINGS))
    assert found.free_of_promise == ("t1-11", "t2-12")
    verdicts, files = found.with_evidence()
    assert [(verdict.name, verdict.evidence) for verdict in verdicts] == [("persistent.t1-11", (EVIDENCE,))]
    assert files.keys() == {EVIDENCE}
    assert found.free == found.free_as_shown(verdicts) == (("G", "a"), ("G", "b"))
    assert freed(split(BY_MARKINGS)).free == (("G", "a"), ("G", "b"))


def test_a_part_of_which_the_yes_falls_has_to_promise() -> None:
    assert persistence(split(TWO_FALL)).free == freed(split(TWO_FALL)).free == (("G", "b"),)


def test_a_part_of_which_nothing_shows_that_its_vote_stands_has_to_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    def lacks(*_: object) -> None:
        raise LackingError(NO_TIME)

    monkeypatch.setattr(Certifier, "certify", lacks)
    found = persistence(split(BY_MARKINGS))
    ((verdict,), _) = found.with_evidence()
    assert verdict.holds
    assert not verdict.evidence
    assert [record.lacking for record in found.evidence().records] == [f"t1-11: {NO_TIME}"]
    assert found.free_as_shown((verdict,)) == (("G", "b"),)
    assert freed(split(BY_MARKINGS)).free == (("G", "b"),)


def test_of_what_is_not_decided_there_is_no_record() -> None:
    found = persistence(split(catalogue_net("one_robot")), limits=Limits(Deadline.after(0)))
    assert any(verdict.status is Status.UNKNOWN for verdict in found.verdicts)
    assert found.evidence().records == ()
    verdicts, files = found.with_evidence()
    assert not any(verdict.evidence for verdict in verdicts)
    assert files == {}


def test_votes_that_are_not_proved_to_stand_are_those_of_the_global_transitions_alone() -> None:
    net = net_of("a.p", Transition("G", ("a.p",), ("b.q",)), Transition("l", ("a.p",), ("a.r",)))
    assert [vote.part for vote in votes(split(net))] == ["t1-11", "t2-12", "l"]
    assert nonpersistent(split(net)) == {"t1-11": ["l"]}


def test_a_vote_that_nobody_looks_at_is_not_proved_to_stand() -> None:
    crossing = tuple(Transition(f"t{i}", ("a.p",), (f"b.q{i}",)) for i in range(FALSIFIERS_MAX + 2))
    assert nonpersistent(split(net_of("a.p", *crossing)))["t1-11"] == []


def test_what_a_space_does_not_answer_in_time_is_raced_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def has_no_time(*_: object) -> None:
        raise BudgetExceeded("the time was over")

    monkeypatch.setattr(ReachabilityGraph, "satisfying", has_no_time)
    for net, status in ((BY_MARKINGS, Status.PROVED), (TWO_FALL, Status.VIOLATED)):
        found = persistence(split(net))
        assert isinstance(found.space, ReachabilityGraph)
        assert found.of("t1-11").status is status
        assert found.findings.keys() == {"persistent.t1-11"}


def test_what_a_race_does_not_decide_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module._Deciding, "_held", lambda _: None)
    monkeypatch.setattr(Settling, "ask", lambda *_: None)
    verdict = persistence(split(BY_MARKINGS)).of("t1-11")
    assert (verdict.status, verdict.subjects) == (Status.UNKNOWN, ("l",))


def test_a_walk_accuses_whom_it_has_met(monkeypatch: pytest.MonkeyPatch) -> None:
    def meets_one(*_: object) -> Mapping[str, Any]:
        return {"t1-11": {"l": ()}}

    monkeypatch.setattr(module, "WALK_VOTES", 0)
    monkeypatch.setattr(module, "fallen", meets_one)
    verdict = persistence(split(TWO_FALL)).of("t1-11")
    assert verdict.subjects == ("l",)
    assert verdict.witness is not None
    assert verdict.witness.firings == (("l",),)
    assert verdict.witness.note == "before the last firing 't1-11' votes yes, after it no"
    assert verdict.hint == "nothing has to be done: the part promises, and then l cannot take its yes back"


def deciding(net: Net) -> module._Deciding:
    return module._Deciding(net, Limits(), None)


def test_a_run_after_which_the_yes_does_not_stand_shows_nothing() -> None:
    """`l` fires in M0, where the output of `G` is full."""
    net = net_of("a.g b.p b.q", CROSSING, Transition("l", ("b.p",), ("b.r",)))
    (vote,) = (vote for vote in votes(split(net)) if vote.part == "t2-12")
    with pytest.raises(WitnessError, match="'l' does not take back the yes of 't2-12'"):
        deciding(net)._taken_back(vote, [], ["l"])


@pytest.mark.parametrize("puts", [True, False])
def test_a_firing_after_which_the_yes_still_stands_shows_nothing(puts: bool) -> None:
    """But one that fills an output of the part is a firing that takes it back."""
    into = ("b.q",) if puts else ("b.r",)
    net = net_of("a.g b.p b.s", CROSSING, Transition("l", ("b.s",), into))
    (vote,) = (vote for vote in votes(split(net)) if vote.part == "t2-12")
    if puts:
        assert deciding(net)._taken_back(vote, [], ["l"]).holds is False
        return
    with pytest.raises(WitnessError, match="'l' does not take back the yes of 't2-12'"):
        deciding(net)._taken_back(vote, [], ["l"])


def test_of_very_many_tokens_the_witness_tells_none() -> None:
    more = tuple(Transition(f"t{i}", (f"a.p{i}",), (f"a.q{i}",)) for i in range(TOKENS_MAX))
    marked = " ".join(("a.g", "b.p", *(f"a.p{i}" for i in range(TOKENS_MAX))))
    few, many = TWO_FALL, net_of(marked, *TWO_FALL.transitions, *more)
    for net, told in ((few, ("b.p", "a.h")), (many, ())):
        (vote,) = (vote for vote in votes(split(net)) if vote.part == "t1-11")
        witness = deciding(net)._taken_back(vote, [], ["k"]).witness
        assert witness is not None
        assert witness.marking == told


def test_there_is_no_verdict_on_a_part_that_is_none() -> None:
    with pytest.raises(KeyError, match="t9-19"):
        persistence(split(TWO_FALL)).of("t9-19")
