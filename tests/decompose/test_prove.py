"""The obligations hold for every split, are refuted for every edited one, and other solvers agree."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import cvc5
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.reference import load_net

from firable.analysis.check import check
from firable.analysis.induction.smt import Terms, value
from firable.analysis.report import CheckReport
from firable.decompose.bundling import make_bundle
from firable.decompose.proofs.obligations import greedy
from firable.decompose.proofs.proving import ProofReport, prove
from firable.decompose.splitting.cut import split
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.decomposition import Decomposition, Part
from firable.nets.diagnostics import InputError
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Signal,
    SignalKind,
    Transition,
)
from firable.nets.right_to_run import CHECKED, required_verdicts, unproved
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.arbitration import Arbitration
from firable.semantics.trace import Discipline

SPLITTABLE = [
    *("cell1", "cell1_mc_late", "cell1_mc_late_cap", "cell2_separate", "cell2_shared", "fig4_parallel"),
    *(
        "local_conflict",
        "local_gate",
        "local_output_conflict",
        "no_trouble",
        "read_before_order",
        "remote_gate",
        "ring",
    ),
]


def gated_net() -> Net:
    """Everything that a split can cut: gates of each kind elsewhere, commands, completions, conflicts of each kind."""
    return Net(
        "gated",
        (
            Place("a.p", "a", marked=True),
            Place("a.x", "a"),
            Place("b.q", "b", marked=True),
            Place("b.run", "b", command=Command("M", "RUN", (("n", "1"),)), completion="b.done"),
            Place("c.ok", "c", marked=True),
            Place("c.stop", "c"),
        ),
        (
            Transition("G", ("a.p", "b.q"), ("b.run",), ("c.ok",), ("c.stop",), (ExternalGate("c.s"),), 1),
            Transition("H", ("b.run",), ("b.q", "a.p"), external=(ExternalGate("b.done"),), number=2),
            Transition("l", ("a.p",), ("a.x",)),
            Transition("k", ("a.x",), ("a.p",), external=(ExternalGate("a.r", wanted=False),)),
            Transition("m", ("c.ok",), ("c.stop",)),
            Transition("n", ("c.ok",)),
        ),
        (Signal("a.r", "a"), Signal("b.done", "b", SignalKind.COMPLETION), Signal("c.s", "c")),
        (Controller("a", coordinator=True), Controller("b"), Controller("c")),
        (Arbiter("next", ("l", "G", "l"), ArbitrationRule.ORDER),),
    )


def refuted(decomposition: Decomposition) -> dict[str, Verdict]:
    report = prove(decomposition)
    assert all(verdict.status in {Status.PROVED, Status.VIOLATED} for verdict in report.verdicts)
    return {verdict.name: verdict for verdict in report.verdicts if verdict.status is Status.VIOLATED}


def by_cvc5(text: str) -> str:
    solver = cvc5.Solver()
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, text, "evidence.smt2")
    answer = ""
    while not (command := parser.nextCommand()).isNull():
        answer += command.invoke(solver, parser.getSymbolManager())
    return answer.strip()


@pytest.fixture(scope="module", params=["reference", "catalogue"])
def cell(request: pytest.FixtureRequest) -> ProofReport:
    return prove(split(load_net("cell1") if request.param == "reference" else catalogue_net("one_robot")))


@pytest.mark.parametrize("name", SPLITTABLE)
def test_every_obligation_of_a_split_is_proved(name: str) -> None:
    decomposition = split(load_net(name))
    report = prove(decomposition)
    assert report.holds
    assert {verdict.name for verdict in report.verdicts} == set(required_verdicts(decomposition)) - set(CHECKED)


def test_gated_net_is_proved() -> None:
    assert refuted(split(gated_net())) == {}


def test_another_solver_confirms_every_file_of_the_cell(cell: ProofReport) -> None:
    assert len(cell.files) == len(cell.verdicts) == 15 * 2 + 28 + 4 + 2
    assert {name: by_cvc5(text) for name, text in cell.files.items()} == dict.fromkeys(cell.files, "unsat")


def test_file_says_what_it_proves_in_the_names_of_the_net(cell: ProofReport) -> None:
    text = cell.files["eq7-G2.smt2"]
    head = [line for line in text.splitlines() if line.startswith(";")]
    assert "'G2' is firable in the central net iff each of its parts is firable" in head[1]
    assert "`unsat`" in head[2]
    assert "(declare-const |c1.Robot| Bool)" in text or "(declare-const |robot.free| Bool)" in text
    assert "(set-logic QF_UF)" in text


def test_verdict_names_its_evidence(cell: ProofReport) -> None:
    assert {verdict.evidence for verdict in cell.verdicts} == {(name,) for name in cell.files}


# --------------------------------------------------------------------------------------------------------------------
# Mutations


def edited(decomposition: Decomposition, controller: str, edit: Callable[[Net], Net]) -> Decomposition:
    subnets = tuple(edit(s) if s.name == controller else s for s in decomposition.subnets)
    return replace(decomposition, subnets=subnets)


def changed_transitions(transition: Transition, subnet: Net) -> Iterator[Transition]:
    """Every single arc or gate dropped, added or flipped."""
    # A gate on an input or output place that only repeats what the arc demands changes nothing: no assignment differs.
    repeats = {"permissive": transition.inputs, "inhibitive": transition.outputs}
    for kind in ("inputs", "outputs", "permissive", "inhibitive"):
        of_kind: tuple[str, ...] = getattr(transition, kind)
        for place in subnet.places:
            if place.name in repeats.get(kind, ()):
                continue
            now = tuple(p for p in of_kind if p != place.name)
            changes: dict[str, Any] = {kind: now if place.name in of_kind else (*of_kind, place.name)}
            yield replace(transition, **changes)
    for one, other in (("inputs", "outputs"), ("permissive", "inhibitive")):
        exchanged: dict[str, Any] = {one: getattr(transition, other), other: getattr(transition, one)}
        swapped = replace(transition, **exchanged)
        if swapped != transition:
            yield swapped
    for gate in transition.external:
        others = tuple(g for g in transition.external if g != gate)
        yield replace(transition, external=others)
        yield replace(transition, external=(*others, replace(gate, wanted=not gate.wanted)))
    for signal in subnet.signals:
        for wanted in (True, False):
            if ExternalGate(signal.name, wanted) not in transition.external:
                yield replace(transition, external=(*transition.external, ExternalGate(signal.name, wanted)))


def changed_places(place: Place, subnet: Net) -> Iterator[Place]:
    yield replace(place, marked=not place.marked)
    if place.completion is None:
        yield replace(place, command=None if place.command else Command("M", "GO"))
    if place.command is not None:
        yield replace(place, command=replace(place.command, command="OTHER"))
        yield replace(place, command=replace(place.command, parameters=(("n", "2"),)))
        yield replace(place, command=replace(place.command, machine="OTHER"))
    if place.completion is not None:
        yield replace(place, completion=None)


def subnet_mutants(subnet: Net) -> Iterator[Net]:
    for i, transition in enumerate(subnet.transitions):
        before, after = subnet.transitions[:i], subnet.transitions[i + 1 :]
        yield replace(subnet, transitions=(*before, *after))
        for changed in changed_transitions(transition, subnet):
            try:
                yield replace(subnet, transitions=(*before, changed, *after))
            except (ValueError, InputError):
                continue  # not even a net: a completion that gates nothing
    yield replace(subnet, transitions=(*subnet.transitions, Transition("extra")))
    if subnet.places:
        yield replace(subnet, transitions=(*subnet.transitions, Transition("extra", (subnet.places[0].name,))))
    for i, place in enumerate(subnet.places):
        for moved in changed_places(place, subnet):
            yield replace(subnet, places=(*subnet.places[:i], moved, *subnet.places[i + 1 :]))
    yield replace(subnet, places=(*subnet.places, Place(f"{subnet.name}.extra", subnet.name)))
    yield replace(subnet, signals=(*subnet.signals, Signal(f"{subnet.name}.extra", subnet.name)))
    yield replace(subnet, arbiters=(Arbiter("own", tuple(t.name for t in subnet.transitions[:2])),))
    yield replace(subnet, controllers=tuple(replace(c, coordinator=not c.coordinator) for c in subnet.controllers))


def table_mutants(decomposition: Decomposition) -> Iterator[Decomposition]:
    rows = decomposition.coordinated
    for i, row in enumerate(rows):
        before, after = rows[:i], rows[i + 1 :]
        yield replace(decomposition, coordinated=(*before, *after))
        yield replace(decomposition, coordinated=(*rows, row))
        for j in range(len(row.parts)):
            fewer = replace(row, parts=row.parts[:j] + row.parts[j + 1 :])
            yield replace(decomposition, coordinated=(*before, fewer, *after))
        if len(row.parts) > 1:
            (first, second), rest = row.parts[:2], row.parts[2:]
            swapped = (Part(first.controller, second.name), Part(second.controller, first.name), *rest)
            yield replace(decomposition, coordinated=(*before, replace(row, parts=swapped), *after))
        yield replace(decomposition, coordinated=(*before, replace(row, parts=(*row.parts, row.parts[0])), *after))
    for i, j in combinations(range(len(rows)), 2):
        # The parts of one controller exchanged between two rows.
        for mine, other in product(rows[i].parts, rows[j].parts):
            if mine.controller == other.controller:
                crossed = list(rows)
                crossed[i] = replace(rows[i], parts=tuple(other if p == mine else p for p in rows[i].parts))
                crossed[j] = replace(rows[j], parts=tuple(mine if p == other else p for p in rows[j].parts))
                yield replace(decomposition, coordinated=tuple(crossed))
    groups = decomposition.groups
    for i, group in enumerate(groups):
        before_g, after_g = groups[:i], groups[i + 1 :]
        yield replace(decomposition, groups=(*before_g, *after_g))
        yield replace(decomposition, groups=(*groups, group))
        for changed in (
            replace(group, sequence=group.sequence[::-1], rest=group.rest[::-1]),
            replace(group, sequence=(), rest=tuple(dict.fromkeys((*group.sequence, *group.rest)))),
            replace(group, rest=group.rest[1:], sequence=group.sequence[: len(group.sequence) - (not group.rest)]),
            replace(group, by=ArbitrationRule.ROTATION),
            replace(group, controller="b" if group.controller is None else None),
            replace(group, controller=""),
            replace(group, controller="the coordinator"),
        ):
            if changed != group:
                yield replace(decomposition, groups=(*before_g, changed, *after_g))


def test_every_single_change_of_a_subnet_is_refuted() -> None:
    decomposition = split(gated_net())
    count = 0
    for subnet in decomposition.subnets:
        for mutant in subnet_mutants(subnet):
            count += 1
            subnets = tuple(mutant if s is subnet else s for s in decomposition.subnets)
            found = refuted(replace(decomposition, subnets=subnets))
            assert found, f"not refuted: {mutant}"
            assert all(v.witness and v.code == "F4002" and v.hint for v in found.values())
            # Where a side is constant, nothing need be assigned: then the note says what either side is.
            assert all(v.witness.assignment or v.witness.note for v in found.values() if v.witness)
    assert count > 120


def test_every_single_change_of_the_table_is_refuted() -> None:
    decomposition = split(gated_net())
    mutants = list(table_mutants(decomposition))
    assert len(mutants) > 30
    for mutant in mutants:
        assert refuted(mutant), f"not refuted: {mutant.coordinated} {mutant.groups}"


def test_exchanged_or_missing_subnets_are_refuted() -> None:
    decomposition = split(gated_net())
    a, b, c = decomposition.subnets
    for subnets in [(a, b), (a, a, b, c), (replace(b, name="a"), replace(a, name="b"), c), (a, b, Net("c"))]:
        assert refuted(replace(decomposition, subnets=subnets))


def test_place_under_the_wrong_owner_is_refuted() -> None:
    decomposition = split(gated_net())
    a, b, c = decomposition.subnets
    moved = replace(a, places=a.places[:1], transitions=a.transitions[:2])
    taken = replace(b, places=(*b.places, replace(a.places[1], owner=None)))
    found = refuted(replace(decomposition, subnets=(moved, taken, c)))
    assert found["ownership"].witness is not None
    shown = dict(found["ownership"].witness.assignment)
    assert shown["a owns a.x"] is False
    assert shown["b owns a.x"] is True


def test_verdicts_are_about_the_central_net_that_is_given() -> None:
    net = gated_net()
    decomposition = split(net)
    for mutant in (
        replace(net, arbiters=()),
        replace(net, transitions=(replace(net.transitions[0], permissive=()), *net.transitions[1:])),
        replace(net, transitions=(*net.transitions, Transition("late", ("a.x",)))),
    ):
        assert refuted(replace(decomposition, net=mutant))


def test_refutation_shows_the_differing_assignment_in_the_names_of_the_net() -> None:
    decomposition = split(load_net("cell1"))
    robot = decomposition.subnet("c1")
    dropped = tuple(replace(t, inputs=()) if t.name == "t1-21" else t for t in robot.transitions)
    found = refuted(edited(decomposition, "c1", lambda subnet: replace(subnet, transitions=dropped)))
    assert set(found) == {"eq7.G2", "eq9-10.c1.Robot", "arbitration.conflict-1"} | {
        name for name in found if name.startswith("arbitration.")
    }
    witness = found["eq7.G2"].witness
    assert witness is not None
    assert witness.note == "in the central net: 0, in the subnets: 1"
    assert dict(witness.assignment)["c1.Robot"] is False
    assert dict(witness.assignment)["c0.Carrying_in"] is True
    assert set(dict(witness.assignment)) <= {place.name for place in decomposition.net.places}


def test_out_of_time_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    from firable.analysis.induction.smt import Answer, Decision

    monkeypatch.setattr(
        "firable.decompose.proofs.proving.decide", lambda *_, **__: Decision(Answer.UNKNOWN, {}, "timeout")
    )
    report = prove(split(load_net("ring")))
    assert {verdict.status for verdict in report.verdicts} == {Status.UNKNOWN}
    assert all("timeout" in verdict.bound for verdict in report.verdicts)


# --------------------------------------------------------------------------------------------------------------------
# Arbitration, and the bundle


@given(st.data())
@examples(100)
def test_granted_term_is_what_the_arbiter_decides(data: st.DataObject) -> None:
    sets = st.frozensets(st.sampled_from("pqr"), min_size=1, max_size=2).map(sorted).map(tuple)
    transitions = tuple(Transition(f"t{i}", data.draw(sets)) for i in range(4))
    net = Net("n", tuple(Place(p) for p in "pqr"), transitions)
    arbitration = Arbitration.of(net)
    enabled = data.draw(st.frozensets(st.sampled_from(range(4))))
    terms = Terms()
    variables = {t.name: terms.variable(t.name) for t in transitions}
    rivals = {t.name: {f"t{u}" for u in arbitration.conflicts.rivals[i]} for i, t in enumerate(transitions)}
    granted = greedy(terms, variables, [t.name for t in transitions], rivals)
    assignment = {f"t{i}": i in enabled for i in range(4)}
    decided, _ = arbitration.decide(enabled, arbitration.first_turns)
    assert [value(granted[f"t{i}"], assignment) for i in range(4)] == [i in decided for i in range(4)]


def test_cell_is_bundled_with_all_its_proofs() -> None:
    report = check(catalogue_net("one_robot"))
    bundle = make_bundle(report)
    assert unproved(bundle) == ()
    assert bundle.net == report.net
    assert Bundle.from_bytes(bundle.to_bytes()) == bundle


@pytest.mark.parametrize("name", catalogue_names())
def test_check_and_prove_give_exactly_the_required_verdicts_each_once(name: str) -> None:
    net = catalogue_net(name)
    decomposition = split(net)
    verdicts = (*check(net).verdicts, *prove(decomposition).verdicts)
    given = [verdict.name for verdict in verdicts if verdict.weight is Weight.REQUIRED]
    assert sorted(given) == sorted(required_verdicts(decomposition))
    assert len({verdict.name for verdict in verdicts}) == len(verdicts)


def not_bundled(report: CheckReport) -> str:
    with pytest.raises(InputError) as refusal:
        make_bundle(report)
    assert {diagnostic.code for diagnostic in refusal.value.diagnostics} == {"F4003"}
    return str(refusal.value)


def test_net_with_anything_unproved_is_not_bundled() -> None:
    report = check(load_net("ring"))
    doubted = tuple(replace(verdict, status=Status.UNKNOWN) for verdict in report.verdicts)
    for verdicts in ((), report.verdicts[:1], doubted):
        not_bundled(replace(report, verdicts=verdicts))
    lost = tuple(replace(verdict, evidence=("lost.smt2",)) for verdict in report.verdicts)
    assert "evidence" in not_bundled(replace(report, verdicts=lost))


def test_deadlocking_net_is_not_bundled_with_the_verdicts_on_a_good_one() -> None:
    good, late = check(catalogue_net("one_robot")), check(catalogue_net("one_robot_mc_late"))
    assert "'deadlock-free' is violated" in not_bundled(late)
    assert "another net" in not_bundled(replace(good, net=late.net))


def test_verdicts_on_steps_are_no_reason_to_run() -> None:
    net = load_net("ring")
    for discipline in (Discipline.INTERLEAVING, Discipline.STEP):
        assert "interleaving" in not_bundled(replace(check(net, Discipline.STEP), discipline=discipline))
    assert make_bundle(check(net)).net == net
