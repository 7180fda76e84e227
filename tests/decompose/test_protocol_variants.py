"""Protocol variants against the central net: the reference cases, and what each obligation is needed for."""

import pytest
from support.reference import Case, cases, load_net, local

from firable.analysis.spaces.reachability import Budget
from firable.decompose.protocol.exploring import Exploration, explore_protocol
from firable.decompose.protocol.variant import Faults, Often, Variant, Votes, named
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import nonpersistent
from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.verdict import Status

CASES = [(case, name) for case in cases() for name in case.expect.get("dist", {})]
FALSIFIED = [case for case in cases() if "nonpersistent" in case.expect]

A, B = Controller("a"), Controller("b")


def decided(holds: bool) -> Status:
    return Status.PROVED if holds else Status.VIOLATED


def explored(net: Net, name: str, markings_max: int | None = None) -> Exploration:
    budget = None if markings_max is None else Budget(markings_max)
    return explore_protocol(net, *named(name), budget=budget)


def counterexample(found: Exploration) -> tuple[str, ...]:
    return found.events(found.counterexample)


def blocked(found: Exploration) -> tuple[str, ...]:
    return found.events(found.complete.witness)


def shown(found: Exploration) -> list[str]:
    return sorted("{" + ",".join(map(local, marking)) + "}" for marking in found.wrong)


def test_there_are_cases() -> None:
    assert len(CASES) >= 20
    assert FALSIFIED


@pytest.mark.parametrize(("case", "name"), CASES, ids=[f"{case} {name}" for case, name in CASES])
def test_variant_does_what_the_case_expects(case: Case, name: str) -> None:
    expect = case.expect["dist"][name]
    verdict = explored(case.net(), name)
    assert verdict.refines is decided(expect["refines"])
    assert bool(counterexample(verdict)) != expect["refines"]
    if "wrong" in expect:
        assert shown(verdict) == sorted(expect["wrong"])
    if "complete" in expect:
        assert verdict.complete.status is decided(expect["complete"])


@pytest.mark.parametrize("case", FALSIFIED, ids=str)
def test_nonpersistent_parts_are_those_of_the_case(case: Case) -> None:
    assert nonpersistent(split(case.net())) == case.expect["nonpersistent"]


def test_promises_make_the_whole_cell_refine_and_complete() -> None:
    verdict = explored(load_net("cell1"), "locked")
    assert verdict.refines is verdict.complete.status is Status.PROVED
    assert verdict.wrong == ()
    assert verdict.space.n_markings == 31_005


def test_counterexample_on_the_cell_gives_the_robot_a_second_task_while_it_carries_a_part() -> None:
    run = counterexample(explored(load_net("cell1"), "stale_serial"))
    decided = [event.partition(" is decided")[0] for event in run if "is decided" in event]
    assert [t for t in decided if t in {"G2", "G6", "G7"}][-3:] == ["G6", "G7", "G2"]
    assert run[-1] == "G2 is decided, though in the central net c1.Robot is empty"
    vote = "c1 votes yes on G2"
    assert run.index(vote) < run.index("G6 is decided")
    assert run.count(vote) == decided.count("G2")


@pytest.mark.parametrize("name", ["naive", "recheck", "gates", "fresh", "stale", "stale_serial", "locked"])
def test_every_protocol_refines_where_no_vote_can_be_falsified(name: str) -> None:
    verdict = explored(load_net("no_trouble"), name)
    assert verdict.refines is verdict.complete.status is Status.PROVED
    assert (verdict.counterexample, verdict.complete.witness, verdict.lost) == (None, None, None)


@pytest.mark.parametrize(
    "name", ["local_conflict", "local_output_conflict", "local_gate", "read_before_order", "remote_gate", "ring"]
)
def test_promises_refine_and_lose_nothing_on_every_net(name: str) -> None:
    verdict = explored(load_net(name), "locked")
    assert (verdict.refines, verdict.complete.status, verdict.wrong) == (Status.PROVED, Status.PROVED, ())


def test_promise_that_is_never_met_does_not_block_for_ever() -> None:
    """G waits for b.q in vain; its promise at `a` must not keep `l` from firing."""
    places = (Place("a.p", "a", marked=True), Place("a.e", "a"), Place("b.q", "b"))
    net = Net("n", places, (Transition("G", ("a.p", "b.q")), Transition("l", ("a.p",), ("a.e",))), (), (A, B))
    verdict = explored(net, "locked")
    assert verdict.refines is verdict.complete.status is Status.PROVED


def test_crash_after_a_yes_is_safe_and_says_what_is_lost() -> None:
    verdict = explored(load_net("ring"), "locked_crash")
    assert (verdict.refines, verdict.complete.status) == (Status.PROVED, Status.VIOLATED)
    assert verdict.complete.subjects[0] in {"G", "l", "m"}
    assert blocked(verdict)[-2].endswith("stops for ever")
    assert blocked(verdict)[-1] == "no fault happens from now on"


def test_late_duplicate_is_known_by_its_round() -> None:
    net = load_net("ring")
    assert explored(net, "locked_dup").refines is Status.PROVED
    run = counterexample(explored(net, "locked_dup_noepoch"))
    assert any(event.startswith("the late copy of the order for G") for event in run)
    assert run[-1] == "c1 fires l, though in the central net c1.q is empty"


def test_one_order_at_a_time_repairs_orders_that_overtake_but_no_stale_vote() -> None:
    assert explored(load_net("read_before_order"), "fresh").refines is Status.VIOLATED
    assert explored(load_net("read_before_order"), "stale_serial").refines is Status.PROVED
    assert explored(load_net("local_conflict"), "stale_serial").refines is Status.VIOLATED


def test_cached_copy_of_a_gate_fails_also_in_a_global_transition() -> None:
    """G is inhibited by c.h; `a` reads a copy and orders go out though h is full."""
    c = Controller("c")
    places = tuple(Place(name, name[0], marked) for name, marked in [("a.p", True), ("b.q", True), ("c.e", True)])
    net = Net(
        "n",
        (*places, Place("c.h", "c")),
        (Transition("G", ("a.p", "b.q"), inhibitive=("c.h",)), Transition("l", ("c.e",), ("c.h",))),
        controllers=(A, B, c),
    )
    assert explored(net, "locked").refines is Status.PROVED
    assert explored(net, "gates").refines is Status.VIOLATED


def test_transition_that_no_valuation_opens_takes_no_part() -> None:
    torn = (ExternalGate("b.s"), ExternalGate("b.s", wanted=False))
    net = Net(
        "n",
        (Place("a.p", "a", marked=True),),
        (Transition("G", ("a.p",), external=torn),),
        (Signal("b.s", "b"),),
        (A, B),
    )
    assert explored(net, "locked").space.n_markings == 1


def test_exploration_that_ends_early_proves_nothing() -> None:
    verdict = explored(load_net("cell1"), "locked", 100)
    assert (verdict.refines, verdict.complete.status) == (Status.UNKNOWN, Status.UNKNOWN)
    assert verdict.complete.bound
    assert (verdict.counterexample, verdict.complete.witness, verdict.wrong) == (None, None, ())


@pytest.mark.parametrize("name", ["naive_loss", "fresh", "stale", "locked_crash", "locked", "locked_dup_noepoch"])
@pytest.mark.parametrize("net_name", ["ring", "local_conflict", "read_before_order"])
def test_what_is_decided_within_any_budget_stays_decided(net_name: str, name: str) -> None:
    net = load_net(net_name)
    whole = explored(net, name)
    n_markings = whole.space.n_markings
    assert Status.UNKNOWN not in {whole.refines, whole.complete.status}
    for budget in range(1, n_markings, max(1, n_markings // 10)):
        some = explored(net, name, budget)
        assert some.refines in {Status.UNKNOWN, whole.refines} - {Status.PROVED}
        assert some.complete.status is Status.UNKNOWN
        assert set(some.wrong) <= set(whole.wrong)
        if some.refines is Status.VIOLATED:
            assert len(counterexample(some)) >= len(counterexample(whole))


def test_decomposition_may_be_given_in_place_of_the_net() -> None:
    net = load_net("ring")
    variant, faults = named("naive_loss")
    assert variant.votes is Votes.CACHED
    assert faults == Faults(loss=Often.ALWAYS, restart=False)
    assert explore_protocol(split(net), variant, faults).safety == explored(net, "naive_loss").safety


@pytest.mark.parametrize("name", ["", "lockd", "locked_", "locked_fire", "locked_loss_loss", "_loss", "dup"])
def test_unknown_variant_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match="no protocol variant"):
        Variant.named(name)
