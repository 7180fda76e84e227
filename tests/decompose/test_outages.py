"""What faults do: safe while they last, everything resumes, and what stands still while somebody is dead."""

import pytest
from support.reference import load_net

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.document import document_from_text
from firable.analysis.goal import Limits
from firable.decompose.protocol.building import protocol_net
from firable.decompose.protocol.faulty import GO_ON, KINDS, budget
from firable.decompose.protocol.outages import Outage, outage_text, outage_verdict, outages
from firable.decompose.protocol.variant import ANY_FAULTS, ONE_OF_EACH, PROTOCOL
from firable.decompose.protocol.verdicts import document, protocol_verdicts
from firable.decompose.splitting.cut import split
from firable.nets.net import Command, Controller, Net, Place, Transition
from firable.nets.verdict import Status, Weight

A, B, C = Controller("a"), Controller("b"), Controller("c")


def cell() -> Net:
    """`a` and `b` hand over to each other; `c` goes round by itself; `a` and `c` command machines."""
    places = (
        Place("a.p", "a", marked=True),
        Place("a.q", "a", command=Command("arm", "MOVE")),
        Place("b.r", "b", marked=True),
        Place("b.s", "b"),
        Place("c.u", "c", marked=True),
        Place("c.v", "c", command=Command("mill", "RUN")),
    )
    transitions = (
        Transition("G", ("a.p", "b.r"), ("a.q", "b.s")),
        Transition("l", ("a.q",), ("a.p",)),
        Transition("m", ("b.s",), ("b.r",)),
        Transition("on", ("c.u",), ("c.v",)),
        Transition("off", ("c.v",), ("c.u",)),
    )
    return Net("cell", places, transitions, (), (A, B, C))


def by_name(net: Net) -> dict[str, Outage]:
    return {outage.who: outage for outage in outages(split(net))}


def test_what_needs_a_dead_controller_stands_still_and_the_rest_goes_on() -> None:
    found = by_name(cell())
    assert (found["a"].at_once, found["a"].at_last, found["a"].goes_on) == (("l",), ("G", "m"), ("on", "off"))
    assert (found["a"].still, found["a"].running) == (("arm",), ("mill",))
    assert (found["c"].at_once, found["c"].at_last) == (("on", "off"), ())
    assert found["c"].goes_on == ("G", "l", "m")
    assert (found["c"].still, found["c"].running) == (("mill",), ("arm",))


def test_dead_coordinator_decides_nothing_and_what_is_local_finishes() -> None:
    outage = by_name(cell())[""]
    assert outage.name == "the coordinator"
    assert (outage.at_once, outage.at_last, outage.goes_on) == (("G",), ("l", "m"), ("on", "off"))


def test_firing_that_was_decided_before_the_crash_can_still_be_finished_by_the_others() -> None:
    """`b` obeys, and fires `m`, though `a` is dead; so `m` stands still at last, not at once."""
    assert "m" in by_name(cell())["a"].at_last


def test_transition_that_never_fires_is_not_blamed_on_the_fault() -> None:
    places = (Place("a.p", "a"), Place("b.q", "b", marked=True))
    net = Net("n", places, (Transition("G", ("a.p", "b.q")),), (), (A, B))
    assert all((*o.at_once, *o.at_last, *o.goes_on) == () for o in outages(split(net)))


def start_up() -> Net:
    """`b` switches a heater on and a lamp, once each, turns a fan on and off, and uses the heater together with `a`."""
    places = (
        Place("a.p", "a", marked=True),
        Place("a.q", "a"),
        Place("b.cold", "b", marked=True),
        Place("b.warm", "b", command=Command("heater", "HEAT")),
        Place("b.free", "b", marked=True),
        Place("b.used", "b", command=Command("heater", "HOLD")),
        Place("b.dark", "b", marked=True),
        Place("b.lit", "b", command=Command("lamp", "LIGHT")),
        Place("b.fan", "b", marked=True),
        Place("b.wind", "b", command=Command("fan", "TURN")),
    )
    transitions = (
        Transition("warm", ("b.cold",), ("b.warm",)),
        Transition("use", ("a.p", "b.free"), ("a.q", "b.used")),
        Transition("put", ("a.q", "b.used"), ("a.p", "b.free")),
        Transition("light", ("b.dark",), ("b.lit",)),
        Transition("on", ("b.fan",), ("b.wind",)),
        Transition("off", ("b.wind",), ("b.fan",)),
    )
    return Net("start-up", places, transitions, (), (A, B))


@pytest.mark.parametrize("name", ["warm", "light", "on"])
@pytest.mark.parametrize("who", ["a", ""])
def test_what_fires_once_at_start_up_is_not_kept_back_by_who_has_no_part_in_it(who: str, name: str) -> None:
    outage = by_name(start_up())[who]
    assert name in outage.goes_on
    assert "use" in (*outage.at_once, *outage.at_last)
    assert by_name(start_up())["b"].goes_on == ()


def test_machine_that_is_commanded_at_start_up_alone_does_not_stand_still() -> None:
    found = by_name(start_up())
    assert "lamp" in found["a"].running
    assert "lamp" in found["b"].still


def test_machine_stands_still_if_its_use_does_though_it_is_switched_on_freely() -> None:
    outage = by_name(start_up())["a"]
    assert outage.goes_on == ("warm", "light", "on", "off")
    assert (outage.still, outage.running) == (("heater",), ("lamp", "fan"))


def test_what_another_choice_has_ruled_out_is_not_kept_back() -> None:
    """`c` goes left or right for good, and round there; that it never goes right again is no fault of `a`."""
    left_or_right = ("left", "right")
    places = [Place(f"c.{name}", "c", marked=name == "start") for name in ("start", *left_or_right)]
    transitions = [Transition(name, ("c.start",), (f"c.{name}",)) for name in left_or_right]
    net = cell()
    net = Net("n", (*net.places, *places), (*net.transitions, *transitions), (), (A, B, C))
    outage = by_name(net)["a"]
    assert outage.goes_on == ("on", "off", "left", "right")


def waiting_later() -> Net:
    """`b` may fire `t` by itself from M0, and then again after `a` has helped it back."""
    places = (
        Place("a.p", "a", marked=True),
        Place("a.q", "a"),
        Place("b.x", "b", marked=True),
        Place("b.y", "b"),
    )
    transitions = (
        Transition("t", ("b.x",), ("b.y",)),
        Transition("G", ("a.p", "b.y"), ("a.q", "b.x")),
        Transition("l", ("a.q",), ("a.p",)),
    )
    return Net("n", places, transitions, (), (A, B))


def test_transition_that_still_fires_from_the_start_and_then_never_again_stands_still() -> None:
    assert by_name(waiting_later())["a"].at_last == ("t", "G")


def test_a_diagram_says_what_a_table_says(monkeypatch: pytest.MonkeyPatch) -> None:
    known = [by_name(net) for net in (cell(), waiting_later())]
    monkeypatch.setattr("firable.decompose.protocol.outages.FIRST_MARKINGS", 1)
    assert [by_name(net) for net in (cell(), waiting_later())] == known


def test_net_without_coordinated_transitions_has_no_coordinator_to_lose() -> None:
    net = Net("n", (Place("a.p", "a", marked=True),), (Transition("l", ("a.p",)),), (), (A,))
    assert [outage.who for outage in outages(split(net))] == ["a"]


@pytest.mark.parametrize("name", ["ring", "local_conflict", "cell1"])
def test_one_fault_of_each_kind_is_a_case_of_any_number_of_them(name: str) -> None:
    """Each step of the one net is one of the other, which demands of its other places the same, or less."""
    one, many = (protocol_net(split(load_net(name)), PROTOCOL, faults) for faults in (ONE_OF_EACH, ANY_FAULTS))
    spent = {budget(kind) for kind in KINDS}
    assert {place.name for place in one.net.places} - spent == {place.name for place in many.net.places} - {GO_ON}
    for t in one.net.transitions:
        u = many.net.transition(t.name)
        assert {*t.inputs} - spent == {*u.inputs}
        assert {*t.outputs} == {*u.outputs}
        assert {*t.permissive} == {*u.permissive} - {GO_ON}  # which holds a token until faults cease
        assert {*t.inhibitive} == {*u.inhibitive}
    assert {u.name for u in many.net.transitions} - {t.name for t in one.net.transitions} == {"cease"}


@pytest.mark.parametrize("name", ["ring", "local_conflict", "remote_gate"])
def test_any_faults_are_safe_and_everything_resumes(name: str) -> None:
    found = protocol_verdicts(split(load_net(name)), faults=True)
    assert {verdict.status for verdict in found.verdicts} == {Status.PROVED}
    names = [verdict.name for verdict in found.verdicts]
    assert names[:3] == ["explored.follows", "explored.agrees", "explored.orders-fit"]
    assert names[-4:] == ["faults.follows", "faults.agrees", "faults.orders-fit", "faults.resumes"]


def test_outage_is_not_known_where_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.decompose.protocol.outages.FIRST_MARKINGS", 1)
    found = list(outages(split(load_net("cell1")), lambda: Limits(Deadline.after(0))))
    assert all(outage.bound for outage in found)
    verdict = outage_verdict(found[0])
    assert (verdict.status, verdict.weight) == (Status.UNKNOWN, Weight.INFORMATION)
    assert "not known: " in outage_text(found)


def test_long_rows_of_an_outage_are_folded_under_their_names() -> None:
    many = tuple(f"cell-{i}.transition" for i in range(40))
    lines = outage_text([Outage("robot", many)], 80).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[1].startswith("  stands still at once     cell-0.transition, ")
    assert lines[2].startswith(f"{'':27}cell-")
    assert " ".join(" ".join(lines).split()).count("cell-") == 40


def test_evidence_for_the_protocol_is_checked_by_who_knows_nothing_of_protocols() -> None:
    found = protocol_verdicts(split(load_net("ring")))
    text = document(found.explorations["explored"]).to_text()
    checked = list(check_document(document_from_text(text)))
    assert [one.record.name for one in checked] == ["property.follows", "property.agrees", "property.orders-fit"]
    assert all(one.shown for one in checked)


def test_evidence_is_a_file_for_each_exploration() -> None:
    found = protocol_verdicts(split(load_net("local_gate")))
    assert list(found.evidence()) == ["explored.smt2", "protocol.evidence.json"]
