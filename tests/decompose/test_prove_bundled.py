"""What is proved of a split goes into a bundle with its evidence, and nothing else does."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from support.reference import load_net

from firable.analysis.check import check
from firable.analysis.evidence.document import Document
from firable.analysis.evidence.producing.lacking import NO_MARKINGS, NO_MEMORY, NO_TIME
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.analysis.report import CheckReport
from firable.cli.main import main
from firable.decompose.bundling import UnbundledError, make_bundle
from firable.decompose.proofs.families import FAMILIES
from firable.decompose.proofs.family import Proved, Task
from firable.decompose.proofs.proving import prove
from firable.decompose.proofs.standing import standing
from firable.decompose.protocol.parametric.side_conditions import side_conditions
from firable.decompose.splitting.cut import split
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_names, catalogue_net, catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.queries import Query
from firable.nets.right_to_run import required_verdicts, unproved
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.trace import Discipline


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
    assert {v.name for v in verdicts if v.weight is Weight.REQUIRED} == {*required_verdicts(decomposition)}
    assert len({verdict.name for verdict in verdicts}) == len(verdicts)


def not_bundled(report: CheckReport) -> str:
    with pytest.raises(InputError) as refusal:
        make_bundle(report)
    assert {diagnostic.code for diagnostic in refusal.value.diagnostics} == {"F4003"}
    return str(refusal.value)


def test_what_ctrl_c_has_ended_is_not_bundled_and_tells_what_was_known(monkeypatch: pytest.MonkeyPatch) -> None:
    report, begun = check(load_net("ring")), list[str]()

    def solving(_: Task) -> Proved:
        raise KeyboardInterrupt

    with monkeypatch.context() as interrupted:
        interrupted.setattr("firable.decompose.proofs.proving.FAMILIES", (replace(FAMILIES[0], prove=solving),))
        with pytest.raises(UnbundledError, match=r"error\[F3004\]: interrupted: Eq\. \(7\)") as ended:
            make_bundle(report, begins=begun.append)
    assert begun == ["votes", FAMILIES[0].title]
    assert ended.value.verdicts[: len(report.verdicts)] == report.verdicts
    left = {verdict.name: verdict.status for verdict in ended.value.verdicts[len(report.verdicts) :]}
    assert left == {FAMILIES[0].name: Status.UNKNOWN, "bundle": Status.UNKNOWN}
    begun.clear()
    make_bundle(report, begins=begun.append)
    assert begun[-1] == "seal"


def test_net_with_anything_unproved_is_not_bundled() -> None:
    report = check(load_net("ring"))
    doubted = tuple(replace(verdict, status=Status.UNKNOWN) for verdict in report.verdicts)
    for verdicts in ((), report.verdicts[:1], doubted):
        not_bundled(replace(report, verdicts=verdicts))
    lost = tuple(replace(verdict, evidence=("lost.smt2",)) for verdict in report.verdicts)
    bundle = make_bundle(replace(report, verdicts=lost))  # what was found elsewhere is none of its evidence
    assert {file for verdict in bundle.verdicts for file in verdict.evidence} == set(bundle.evidence)


def lines(decomposition: Decomposition, verdicts: Sequence[Verdict]) -> dict[str, tuple[str, str]]:
    return {one.name: (one.status, one.by) for one in standing(decomposition, verdicts)}


def protocol_lines(decomposition: Decomposition, verdicts: Sequence[Verdict]) -> list[tuple[str, str]]:
    return [line for name, line in lines(decomposition, verdicts).items() if name in {"O1", "O5"}]


LEVELS = "of the cell; completion signals are levels, which their command clears"
NOT_PROVED = {
    "O1": ("assumed", "of the protocol"),
    "O2": ("unknown", "no verdict is on it"),
    "O3": ("unknown", "no verdict is on it"),
    "O4": ("assumed", f"{LEVELS}; and 2 more, each of them listed"),
    "O5": ("assumed", "of the protocol"),
    "O6": ("assumed", "of the hosts and their storage"),
    "O7": ("assumed", "of the executor, which sends a command in the act of applying"),
    "O8": ("nothing to show", "there is one layer: no coordinator is under another one"),
    "O9": ("not claimed", "what is proved is the equivalence of interleaving"),
}
PROVED = {
    "O1": ("by the protocol proof", "protocol"),
    "O2": ("proved statically", "O2, arbitration"),
    "O3": ("proved statically", "O3, ownership"),
    "O5": ("by the protocol proof", "protocol"),
}


def test_each_of_the_nine_obligations_has_a_line_whether_it_is_proved_or_not() -> None:
    decomposition = split(catalogue_net("one_robot"))
    verdicts = prove(decomposition).verdicts
    assert lines(decomposition, ()) == NOT_PROVED
    assert lines(decomposition, verdicts) == NOT_PROVED | PROVED
    by_machines = (*verdicts, Verdict("o4.commands", Status.PROVED, "it is so", "the loop"))
    shown = {"O4": ("shown in the loop", "with the machines that were given")}
    assert lines(decomposition, by_machines) == NOT_PROVED | PROVED | shown
    two_cells = split(catalogue_net("two_cells"))
    assert lines(two_cells, prove(two_cells).verdicts)["O8"] == ("proved statically", "O8, O8 promises")


@pytest.mark.parametrize(
    ("gates", "more"), [((), ""), ((ExternalGate("b.s"),), "; and one more, which is listed")], ids=["none", "one"]
)
def test_gates_that_must_stay_open_are_counted_beside_completions(gates: tuple[ExternalGate, ...], more: str) -> None:
    reads = Transition("t", ("a.p",), ("b.p",), external=gates)
    places, signals = (Place("a.p", "a", marked=True), Place("b.p", "b")), (Signal("b.s", "b"),)
    net = Net("gate", places, (reads,), signals, (Controller("a"), Controller("b")))
    assert lines(split(net), ())["O4"] == ("assumed", LEVELS + more)


ASSUMED = ("ownership", "o3", "eq7", "eq8", "eq9-10", "initial-marking", "commands", "arbitration")
"""Of these the theorem on the protocol says that they must be proved of a split."""


def test_protocol_proof_says_of_a_split_what_it_says_where_all_that_it_assumes_is_proved() -> None:
    decomposition = split(catalogue_net("conceptual_one_robot"))
    verdicts = prove(decomposition).verdicts
    assert protocol_lines(decomposition, verdicts) == [("by the protocol proof", "protocol")] * 2
    for family in ASSUMED:
        (title,) = (one.title for one in FAMILIES if one.name == family)
        one = next(v for v in verdicts if v.name.partition(".")[0] == family)
        others = tuple(v for v in verdicts if v != one)
        for told in (others, *((*others, replace(one, status=s)) for s in (Status.UNKNOWN, Status.VIOLATED))):
            assert (
                protocol_lines(decomposition, told)
                == [("unknown", f"protocol, which assumes of the split what is not proved here: {title}")] * 2
            )
    side = side_conditions(replace(decomposition, subnets=decomposition.subnets[1:]))
    assert not all(verdict.holds for verdict in side)
    doubted = "protocol, which assumes of the split what is not proved here: side conditions"
    assert protocol_lines(decomposition, (*verdicts, *side)) == [("unknown", doubted)] * 2
    o2 = tuple(v for v in verdicts if not v.name.startswith("o2."))
    assert protocol_lines(decomposition, o2) == [("by the protocol proof", "protocol")] * 2
    (owned,) = (v for v in verdicts if v.name == "ownership")
    doubted = "protocol, which assumes of the split what is not proved here: ownership"
    twice = (*verdicts, replace(owned, status=Status.VIOLATED))
    assert protocol_lines(decomposition, twice) == [("unknown", doubted)] * 2, "proved and violated is not proved"
    broken = (replace(v, status=Status.VIOLATED) if v.name.startswith("protocol.") else v for v in verdicts)
    assert protocol_lines(decomposition, [v for v in broken if v is not owned]) == [("violated", doubted)] * 2


def test_what_serves_no_obligation_of_a_split_leaves_all_but_those_of_the_protocol_as_they_are() -> None:
    decomposition = split(catalogue_net("one_robot"))
    without = [v for v in prove(decomposition).verdicts if v.name != "commands"]
    doubted = ("unknown", "protocol, which assumes of the split what is not proved here: commands")
    assert lines(decomposition, without) == NOT_PROVED | PROVED | dict.fromkeys(("O1", "O5"), doubted)


def test_each_obligation_is_violated_where_a_family_that_serves_it_has_a_verdict_that_is() -> None:
    decomposition = split(catalogue_net("conceptual_one_robot"))
    verdicts = prove(decomposition).verdicts
    serves = {
        "o2": {"O2"},
        "arbitration": {"O2"},
        "o3": {"O3"},
        "ownership": {"O3"},
        "o8": {"O8"},
        "o8-apart": {"O8"},
        "protocol": {"O1", "O5"},
    }
    assert serves.keys() < {family.name for family in FAMILIES}
    for family in FAMILIES:
        for name in (family.name, f"{family.name}.t"):
            told = (*verdicts, Verdict(name, Status.VIOLATED, "it is so", "z3"))
            violated = {one.name for one in standing(decomposition, told) if one.status == "violated"}
            assert violated == serves.get(family.name, set()), name


@pytest.mark.parametrize(
    ("of_one", "says"),
    [(Status.PROVED, "shown in the loop"), (Status.UNKNOWN, "unknown"), (Status.VIOLATED, "violated")],
)
def test_gates_stay_open_where_the_machines_show_it_of_each(of_one: Status, says: str) -> None:
    decomposition = split(catalogue_net("one_robot"))
    verdicts = [Verdict(f"o4.{name}", Status.PROVED, "it stays open", "the loop") for name in ("one", "two", "three")]
    verdicts[1] = replace(verdicts[1], status=of_one)
    (line,) = (one for one in standing(decomposition, verdicts) if one.name == "O4")
    assert (line.status, line.by) == (says, "with the machines that were given")


@pytest.mark.parametrize(
    ("why", "code", "hint"),
    [
        ("nothing shows it", "F4003", "allow more time to look for evidence, with --max-seconds"),
        (NO_TIME, "F3004", "allow more time to look for evidence, with --max-seconds"),
        (NO_MEMORY, "F3004", "allow more memory, with --max-memory"),
        (NO_MARKINGS, "F4003", "that is a limit of size, which no time moves"),
        ("ranks are written for up to 250,000 markings", "F4003", "that is a limit of size, which no time moves"),
    ],
)
def test_net_is_not_bundled_where_no_evidence_on_it_was_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, why: str, code: str, hint: str
) -> None:
    def without(report: CheckReport, queries: Sequence[Query], limits: Limits) -> Document:
        document = evidence_of_report(report, queries, limits)
        lacking = {"deadlock-free", "live"}  # of which the one is required
        records = (replace(r, shown=(), lacking=why) if r.name in lacking else r for r in document.records)
        return replace(document, records=tuple(records))

    monkeypatch.setattr("firable.decompose.bundling.evidence_of_report", without)
    with pytest.raises(InputError) as refusal:
        make_bundle(check(catalogue_net("one_robot")))
    (one,) = refusal.value.diagnostics
    assert (one.code, one.subject) == (code, ("verdicts", "deadlock-free"))
    assert one.message == f"'deadlock-free' is proved, and there is no evidence that shows it again: {why}"
    assert one.hint.startswith(hint)
    made = tmp_path / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(made)]) == (3 if code == "F3004" else 2)
    assert not made.exists()


def test_a_property_without_evidence_is_told_at_its_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def without(report: CheckReport, queries: Sequence[Query], limits: Limits) -> Document:
        document = evidence_of_report(report, queries, limits)
        lacks = "property.restart"
        records = (replace(r, shown=(), lacking="nothing") if r.name == lacks else r for r in document.records)
        return replace(document, records=tuple(records))

    monkeypatch.setattr("firable.decompose.bundling.evidence_of_report", without)
    path = tmp_path / "cell.firable.yaml"
    path.write_text(catalogue_path("one_robot").read_text("utf-8"), "utf-8")
    at = next(i for i, line in enumerate(path.read_text("utf-8").splitlines(), 1) if line.startswith("  restart:"))
    assert main(["bundle", str(path), "-o", str(tmp_path / "cell.bundle")]) == 2
    assert capsys.readouterr().err.startswith(f"{path}:{at}:3: error[F4003]: 'property.restart' is proved, and there")


def test_deadlocking_net_is_not_bundled_with_the_verdicts_on_a_good_one() -> None:
    good, late = check(catalogue_net("one_robot")), check(catalogue_net("one_robot_mc_late"))
    assert "'deadlock-free' is violated" in not_bundled(late)
    assert "another net" in not_bundled(replace(good, net=late.net))


def test_verdicts_on_steps_are_no_reason_to_run() -> None:
    net = load_net("ring")
    for discipline in (Discipline.INTERLEAVING, Discipline.STEP):
        assert "interleaving" in not_bundled(replace(check(net, Discipline.STEP), discipline=discipline))
    assert make_bundle(check(net)).net == net
