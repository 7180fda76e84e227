"""The obligations hold for every split, are refuted for every edited one, and other solvers agree."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import pytest
import z3
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples, some
from support.reference import load_net
from support.second_solver import by_cvc5

from firable.analysis.induction.smt import Answer, Decision, Operator, Terms, value
from firable.decompose.proofs.arbitration import Competition, Steps, arbitration, choice
from firable.decompose.proofs.discharging import static
from firable.decompose.proofs.family import Task
from firable.decompose.proofs.obligation import Obligation, claimed
from firable.decompose.proofs.proving import ProofReport, prove
from firable.decompose.proofs.script import Reader, ScriptError, block
from firable.decompose.proofs.standing import ASSUMED_BY_THE_PROTOCOL
from firable.decompose.protocol.parametric.side_conditions import side_conditions
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net, family_net
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
from firable.nets.right_to_run import CHECKED, required_verdicts
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.arbitration import Arbitration

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
    violated = {verdict.name.partition(".")[0] for verdict in report.verdicts if verdict.status is Status.VIOLATED}
    # What the theorem on the protocol assumes is proved by static families, as every report says: none fails alone.
    if not all(verdict.holds for verdict in side_conditions(decomposition)):
        assert violated & ASSUMED_BY_THE_PROTOCOL
    found = {verdict.name: verdict for verdict in report.verdicts if verdict.status is Status.VIOLATED}
    assert report.holds is (not found)
    return found


@pytest.fixture(scope="module", params=["reference", "catalogue"])
def cell(request: pytest.FixtureRequest) -> ProofReport:
    return prove(split(load_net("cell1") if request.param == "reference" else catalogue_net("one_robot")))


def of_the_net(verdicts: Iterable[Verdict]) -> set[str]:
    """The names of the verdicts but for those of the protocol, which is proved for every net at once."""
    return {verdict.name for verdict in verdicts if not verdict.name.startswith("protocol.")}


@pytest.mark.parametrize("name", SPLITTABLE)
def test_every_obligation_of_a_split_is_proved(name: str) -> None:
    decomposition = split(load_net(name))
    report = prove(decomposition)
    assert report.holds
    required = {verdict.name for verdict in report.verdicts if verdict.weight is Weight.REQUIRED}
    assert required == set(required_verdicts(decomposition)) - set(CHECKED)


def test_gated_net_is_proved() -> None:
    assert refuted(split(gated_net())) == {}


def test_another_solver_confirms_every_obligation_of_the_cell(cell: ProofReport) -> None:
    assert len(of_the_net(cell.verdicts)) == 15 * 3 + 28 + 10 + 3 + 3 + 1 + 22
    answers = [line.strip('"') for text in cell.files.values() for line in by_cvc5(text).splitlines()]
    assert answers[::2] == [verdict.name for verdict in cell.verdicts]
    assert set(answers[1::2]) == {"unsat"}


def test_file_says_what_it_proves_in_the_names_of_the_net(cell: ProofReport) -> None:
    text = cell.files["eq7.smt2"]
    head = [line for line in text.splitlines() if line.startswith(";")]
    assert "a transition is firable iff all its parts are" in head[0]
    assert "`unsat`" in head[1]
    assert "; 'G2' is firable in the central net iff each of its parts is firable in its subnet" in head
    assert "(declare-const |c1.Robot| Bool)" in text or "(declare-const |robot.free| Bool)" in text
    assert "(set-logic QF_UF)" in text


def test_verdict_names_its_evidence(cell: ProofReport) -> None:
    for verdict in cell.verdicts:
        (file,) = verdict.evidence
        assert f'(echo "{verdict.name}")' in cell.files[file]
    assert {file for verdict in cell.verdicts for file in verdict.evidence} == set(cell.files)


# --------------------------------------------------------------------------------------------------------------------
# Mutations


def edited(decomposition: Decomposition, controller: str, edit: Callable[[Net], Net]) -> Decomposition:
    subnets = tuple(edit(s) if s.name == controller else s for s in decomposition.subnets)
    return replace(decomposition, subnets=subnets)


def changed_transitions(transition: Transition, subnet: Net) -> Iterator[Transition]:
    """Every single arc or gate dropped, added or flipped."""
    for kind in ("inputs", "outputs", "permissive", "inhibitive"):
        of_kind: tuple[str, ...] = getattr(transition, kind)
        for place in subnet.places:
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


@pytest.mark.seeds
def test_every_single_change_of_a_subnet_is_refuted() -> None:
    decomposition = split(gated_net())
    mutants = [(subnet, mutant) for subnet in decomposition.subnets for mutant in subnet_mutants(subnet)]
    assert len(mutants) > 120
    for subnet, mutant in some(mutants, 5):
        subnets = tuple(mutant if s is subnet else s for s in decomposition.subnets)
        found = refuted(replace(decomposition, subnets=subnets))
        assert found, f"not refuted: {mutant}"
        assert all(v.witness and v.code == "F4002" and v.hint for v in found.values())
        # Where a side is constant, nothing need be assigned: then the note says what either side is.
        assert all(v.witness.assignment or v.witness.note for v in found.values() if v.witness)


@pytest.mark.seeds
def test_every_single_change_of_the_table_is_refuted() -> None:
    decomposition = split(gated_net())
    mutants = list(table_mutants(decomposition))
    assert len(mutants) > 30
    for mutant in some(mutants, 3):
        assert refuted(mutant), f"not refuted: {mutant.coordinated} {mutant.groups}"


def test_exchanged_or_missing_subnets_are_refuted() -> None:
    decomposition = split(gated_net())
    a, b, c = decomposition.subnets
    for subnets in [(a, b), (a, a, b, c), (replace(b, name="a"), replace(a, name="b"), c), (a, b, Net("c"))]:
        assert refuted(replace(decomposition, subnets=subnets))


def test_part_that_stands_there_once_more_under_the_name_of_its_transition_is_refuted() -> None:
    """It would fire by itself, without any vote; and no equation sees it, since the transition itself does the same."""
    decomposition = split(gated_net())
    again = replace(decomposition.subnet("b").transition("t1-11"), name="G")
    alone = edited(decomposition, "b", lambda b: replace(b, transitions=(*b.transitions, again)))
    assert set(refuted(alone)) == {"ownership"}


def test_decider_in_a_net_of_one_layer_is_refuted() -> None:
    """G and l are in conflict: with one of them decided elsewhere, both could be granted."""
    decomposition = split(gated_net())
    rows, groups = decomposition.coordinated, decomposition.groups
    of_row = replace(decomposition, coordinated=(replace(rows[0], at="b"), *rows[1:]))
    of_group = replace(decomposition, groups=(replace(groups[0], at="b"), *groups[1:]))
    for elsewhere in (of_row, of_group):
        assert set(refuted(elsewhere)) == {"arbitration"}
    assert refuted(replace(decomposition, coordinated=(replace(rows[0], at="a"), *rows[1:]))) == {}, "it is the one"


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
    assert set(found) == {"eq7.G2", "eq9-10.c1.Robot", "o3.G2", "arbitration.conflict-1"}
    witness = found["eq7.G2"].witness
    assert witness is not None
    assert witness.note == "in the central net: 0, in the subnets: 1"
    assert dict(witness.assignment)["c1.Robot"] is False
    assert dict(witness.assignment)["c0.Carrying_in"] is True
    assert set(dict(witness.assignment)) <= {place.name for place in decomposition.net.places}


def test_out_of_time_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.decompose.proofs.script.Reader.answer", lambda *_: Answer.UNKNOWN)
    report = prove(split(load_net("ring")))
    its = [verdict for verdict in report.verdicts if verdict.name in of_the_net(report.verdicts)]
    assert {verdict.status for verdict in its} == {Status.UNKNOWN}
    assert all("gave up" in verdict.bound for verdict in its)


def test_no_model_in_time_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.decompose.proofs.script.Reader.answer", lambda *_: Answer.SAT)
    monkeypatch.setattr(
        "firable.decompose.proofs.discharging.decide", lambda *_, **__: Decision(Answer.UNKNOWN, {}, "timeout")
    )
    report = prove(split(load_net("ring")))
    its = of_the_net(report.verdicts)
    assert {verdict.bound for verdict in report.verdicts if verdict.name in its} == {"z3 gave up: timeout"}


def test_what_z3_does_not_answer_is_no_proof() -> None:
    with pytest.raises(ScriptError):
        Reader(1000).answer('(echo "a")\n(echo "unsat")\n(assert false)\n(check-sat)\n')
    with pytest.raises(ScriptError):
        Reader(1000).answer('(echo "a")\n(echo "b")\n')
    with pytest.raises(ScriptError):
        Reader(1000, "(set-logic QF_UF)\n(assert false)\n(check-sat)\n").answer(block("a", "so", ()))


def test_a_part_in_the_table_that_its_controller_does_not_have_refutes_what_is_read() -> None:
    whole = split(catalogue_net("one_robot"))
    row = next(row for row in whole.coordinated if row.name == "G3")
    other = next(c.name for c in whole.net.controllers if c.name not in {part.controller for part in row.parts})
    rows = (replace(r, parts=(*r.parts, Part(other, "t9-39"))) if r is row else r for r in whole.coordinated)
    (found,) = (one for one in prove(replace(whole, coordinated=tuple(rows))).verdicts if one.name == "o3.G3")
    assert found.status is Status.VIOLATED
    assert found.witness is not None
    assert (f"{other} has no t9-39", True) in found.witness.assignment


@pytest.mark.parametrize("ended", [z3.Z3Exception('(error "line 6 column 7: push canceled")\nb\nunsat'), "b\nunsat"])
def test_nothing_is_believed_of_z3_once_time_ended_within_a_command(
    monkeypatch: pytest.MonkeyPatch, ended: z3.Z3Exception | str
) -> None:
    reader = Reader(1000, "(set-logic QF_UF)\n(declare-const p Bool)\n")
    assert reader.answer(block("a", "so", ())) is Answer.SAT  # the beginning is read by now
    read = z3.Z3_eval_smtlib2_string

    def out_of_time(context: object, text: str) -> str:
        if isinstance(ended, str):
            return f'(error "line 7 column 6: pop canceled")\n{ended}\n'
        read(context, "(assert (and p (not p)))")  # what a block that was not taken back leaves
        raise ended

    with monkeypatch.context() as patched:
        patched.setattr(
            z3, "Z3_eval_smtlib2_string", lambda context, text: _once(patched, read, out_of_time, context, text)
        )
        assert reader.answer(block("b", "so", ())) is Answer.UNKNOWN
    assert reader.answer('(push 1)\n(echo "c")\n(assert p)\n(check-sat)\n(pop 1)\n') is Answer.SAT


def _once(patched: pytest.MonkeyPatch, read: Any, first: Any, context: object, text: str) -> str:
    """What the first call answers; z3 answers the others."""
    patched.setattr(z3, "Z3_eval_smtlib2_string", read)
    return str(first(context, text))


# --------------------------------------------------------------------------------------------------------------------
# Arbitration


@given(st.data())
@examples(50)
def test_choice_is_what_the_arbiter_decides_in_every_turn(data: st.DataObject) -> None:
    sets = st.frozensets(st.sampled_from("pqr"), min_size=1, max_size=2).map(sorted).map(tuple)
    net = Net(
        "n",
        tuple(Place(p) for p in "pqrxyz"),
        tuple(Transition(f"t{i}", data.draw(sets), (data.draw(st.sampled_from("xyz")),)) for i in range(4)),
    )
    by = data.draw(st.sampled_from(ArbitrationRule))
    if components := Arbitration.of(net).conflicts.components:
        among = data.draw(st.lists(st.sampled_from(components[0]), min_size=2, max_size=4))
        among = among if by is ArbitrationRule.ORDER else list(dict.fromkeys(among))
        if len(set(among)) > 1:
            net = replace(net, arbiters=(Arbiter("next", tuple(f"t{t}" for t in among), by),))
    arbiters = Arbitration.of(net)
    enabled = data.draw(st.frozensets(st.sampled_from(range(4))))
    rotating = [group.sequence and group.by is not ArbitrationRule.PRIORITY for group in arbiters.groups]
    turns = tuple(
        data.draw(st.integers(0, len(group.sequence) - 1)) if turn else 0
        for group, turn in zip(arbiters.groups, rotating, strict=True)
    )
    decided, after = arbiters.decide(enabled, turns)
    terms, competition = Terms(), Competition.of([(net, lambda t: f"t{t}")])
    for group, turn, then in zip(arbiters.groups, turns, after, strict=True):
        sequence, rest = ([f"t{t}" for t in part] for part in (group.sequence, group.rest))
        turned = group.by is not ArbitrationRule.PRIORITY
        steps = Steps(terms)
        chosen = choice(terms, steps, sequence, rest, competition, turns=turned)
        assignment = {f"enabled(t{t})": t in enabled for t in range(4)}
        assignment |= {f"turn({i})": i == turn for i in range(len(sequence))}
        for is_so in steps.definitions():
            assignment[is_so.operands[0].name] = value(is_so.operands[1], assignment)
        for t in (*group.sequence, *group.rest):
            assert value(chosen.granted[f"t{t}"], assignment) == (t in decided)
        if turned:
            members = group.preference({*group.sequence, *group.rest}, turn)
            winners = {t for t in members if value(chosen.winning[f"t{t}"], assignment)}
            losers = {t for t in enabled - set(decided) if arbiters.conflicts.input_rivals[t] & winners}
            assert then == group.turn_after(winners, losers, turn)


def test_net_and_table_share_every_step_of_the_choice_and_no_step_is_an_or_of_ors() -> None:
    """So a solver has nothing to search for in what is equal, and nothing grows with the competitors of a place."""
    sides = Task(split(family_net("vehicles-3-8")), 60_000).sides
    assert all(len(sides.central_groups[name].rest) > 20 for name in sides.groups)
    for obligation in list(arbitration(sides))[1:]:
        for claim in obligation.claim.operands:
            assert claim.operator is Operator.EQUAL
            assert claim.operands[0] is claim.operands[1]
        assert obligation.definitions
        for definition in obligation.definitions:
            assert all(operand.operator is not Operator.OR for operand in definition.operands[1].operands)


def test_refuted_choice_is_told_without_its_steps() -> None:
    decomposition = split(robot_with_jobs(4, ArbitrationRule.PRIORITY))
    (group,) = decomposition.groups
    turned = replace(decomposition, groups=(replace(group, rest=group.rest[::-1], sequence=group.sequence[::-1]),))
    witness = refuted(turned)[f"arbitration.{group.name}"].witness
    assert witness is not None
    assert {name.partition("(")[0] for name, _ in witness.assignment} == {"enabled"}


def robot_with_jobs(n: int, by: ArbitrationRule) -> Net:
    """A robot of its own controller, for which n machines compete."""
    machines = [f"m{i}" for i in range(n)]
    return Net(
        "jobs",
        (Place("r.free", "r", marked=True), *(Place(f"{m}.p", m, marked=True) for m in machines)),
        tuple(Transition(f"{m}_job", ("r.free", f"{m}.p")) for m in machines),
        controllers=(Controller("r"), *map(Controller, machines)),
        arbiters=(Arbiter("next", tuple(f"{m}_job" for m in machines), by),),
    )


@pytest.mark.parametrize("by", ArbitrationRule)
def test_arbiter_over_many_is_proved_at_a_size_linear_in_its_arcs(by: ArbitrationRule) -> None:
    sizes = []
    for n in (100, 200):
        report = prove(split(robot_with_jobs(n, by)))
        assert report.holds
        sizes.append(len(report.files["arbitration.smt2"]))
    assert sizes[1] < 2.2 * sizes[0]


def test_an_obligation_is_open_where_what_it_rests_on_is_and_refuted_whatever_that_is() -> None:
    terms = Terms()
    p, q = terms.variable("p"), terms.variable("q")
    so = terms.equal(p, p)

    def obligations(_: object) -> Iterator[Obligation]:
        yield claimed(terms, "first", "p holds", p)
        yield replace(claimed(terms, "second", "q holds", q), rests_on=("first",))
        yield replace(claimed(terms, "third", "p is p", so), rests_on=("first",))
        yield claimed(terms, "fourth", "p is p", so)
        yield replace(claimed(terms, "fifth", "p is p", so), rests_on=("fourth", "third"))
        yield replace(claimed(terms, "sixth", "p is p", so), rests_on=("fourth",))

    found = static("some", "it is so", obligations)(Task(split(catalogue_net("one_robot")), 10_000))
    violated, open_, proved = Status.VIOLATED, Status.UNKNOWN, Status.PROVED
    assert [v.status for v in found.verdicts] == [violated, violated, open_, proved, open_, proved]
    assert [v.bound for v in found.verdicts if v.bound] == [
        "it rests on 'first', which is not proved",
        "it rests on 'third', which is not proved",
    ]
    assert found.files["some.smt2"].count("(check-sat)") == len(found.verdicts)
