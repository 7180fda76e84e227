"""`firable verify BUNDLE`: what it prints of a bundle, and how it refuses one that was edited and sealed anew."""

import builtins
import json
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from firable.analysis.evidence.document import document_from_text
from firable.cli.main import main
from firable.decompose.verification.documents import UNDECIDED
from firable.decompose.verification.solvers import SOLVERS
from firable.nets.bundle import read_bundle, write_bundle
from firable.nets.verdict import Status


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bundle") / "cell.bundle"
    assert main(["bundle", "catalogue:conceptual_one_robot", "-o", str(path)]) == 0
    return path


def test_a_bundle_is_shown_family_by_family_and_verdict_by_verdict(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(bundle)]) == 0
    told = capsys.readouterr().out
    assert "obligations, answered by cvc5" in told
    assert "6 of 6    eq7 " in told
    must_hold, besides = told[told.index("\nmust hold\n") :].split("\ntold besides\n")
    assert "✓ shown            deadlock-free" in must_hold
    assert "violated" not in must_hold
    assert "✓ shown            doomed-markings" in besides
    assert (
        "· shown: violated  structural-conflicts              no two transitions share an input or an output place\n"
        in besides
    )
    assert "it is violated" not in told
    assert "shown (1 to be violated, which need not hold)" in told


def test_of_votes_it_is_told_how_many_are_shown_to_stand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "cell.bundle")
    assert main(["bundle", "catalogue:one_robot", "-o", path]) == 0
    assert main(["verify", path]) == 0
    said = "24 of 24   persistent       of each vote it is shown whether it is persistent: 22 hold, 2 do not\n"
    assert said in capsys.readouterr().out


@pytest.mark.parametrize("solver", ["cvc5", "z3"])
def test_a_report_on_a_bundle_is_as_published(bundle: Path, solver: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(bundle), "--solver", solver, "--format", "json"]) == 0
    data = json.loads(capsys.readouterr().out)
    schema = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    (report,) = data["reports"]
    assert (report["status"], report["bundle"]["solver"]) == ("proved", solver)
    assert [v["name"] for v in report["verdicts"]] == [v.name for v in read_bundle(bundle).verdicts]


def test_a_bundle_of_another_net_is_refused(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(bundle), "--net", "catalogue:conceptual_one_robot"]) == 0
    assert main(["verify", str(bundle), "--net", "catalogue:one_robot"]) == 2
    assert "error[F6002]" in capsys.readouterr().err


def test_the_files_of_a_bundle_go_to_another_solver(bundle: Path, tmp_path: Path) -> None:
    assert main(["verify", str(bundle), "--smt-dir", str(tmp_path / "smt")]) == 0
    assert {"eq7.smt2", "arbitration.smt2"} <= {file.name for file in (tmp_path / "smt").iterdir()}


def test_a_bundle_may_hold_the_proof_on_its_own_protocol(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = tmp_path / "cell.bundle"
    assert main(["bundle", "catalogue:conceptual_one_robot", "-o", str(made), "--faults"]) == 0
    capsys.readouterr()
    assert main(["verify", str(made), "--smt-dir", str(tmp_path / "smt")]) == 0
    told = capsys.readouterr().out
    assert "5 of 5    explored         the protocol of this very net does what the net does" in told
    assert "3 of 3    faults           while messages are lost" in told
    assert {"explored.smt2", "faults.smt2", "dead.smt2"} <= {file.name for file in (tmp_path / "smt").iterdir()}


def test_a_damaged_bundle_is_refused(bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = bytearray(bundle.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "damaged").write_bytes(data)
    assert main(["verify", str(tmp_path / "damaged")]) == 2
    assert "error[F5001]" in capsys.readouterr().err


def test_a_bundle_that_was_edited_and_sealed_anew_is_refused(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = read_bundle(bundle)
    text = whole.evidence["eq7.smt2"].replace("(assert (not", "(assert (or", 1)
    write_bundle(tmp_path / "weak", replace(whole, evidence={**whole.evidence, "eq7.smt2": text}))
    assert main(["verify", str(tmp_path / "weak")]) == 2
    told = capsys.readouterr().err
    assert "error[F6002]: the bundle does not show what it claims: 'eq7.smt2'" in told
    assert "hint: make the bundle anew" in told


def test_a_bundle_without_evidence_on_its_net_is_refused_and_not_run(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = read_bundle(bundle)
    kept = {file: text for file, text in whole.evidence.items() if file.endswith(".smt2")}
    bare = tuple(replace(v, evidence=tuple(f for f in v.evidence if f in kept)) for v in whole.verdicts)
    write_bundle(tmp_path / "bare", replace(whole, verdicts=bare, evidence=kept))
    for command in ("verify", "run"):
        assert main([command, str(tmp_path / "bare")]) == 2
        said = capsys.readouterr().err
        assert "'contact-free' is said to be proved, without evidence" in said
        assert "the same of 8 more: 'deadlock-free', " in said


def test_a_warning_that_nothing_shows_is_only_claimed(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, file = read_bundle(bundle), "check.evidence.json"
    document = document_from_text(whole.evidence[file], file)
    records = tuple(replace(r, shown=(), lacking="no time") if r.name == "live" else r for r in document.records)
    bare = tuple(replace(v, evidence=()) if v.name == "live" else v for v in whole.verdicts)
    text = replace(document, records=records).to_text()
    write_bundle(tmp_path / "bare", replace(whole, verdicts=bare, evidence={**whole.evidence, file: text}))
    assert main(["verify", str(tmp_path / "bare")]) == 3
    assert "? claimed          live" in capsys.readouterr().out


def test_what_the_bundle_leaves_undecided_is_told_and_claims_nothing(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, file = read_bundle(bundle), "check.evidence.json"
    document = document_from_text(whole.evidence[file], file)
    text = replace(document, records=tuple(r for r in document.records if r.name != "starvation")).to_text()
    unknown: dict[str, Any] = {"status": Status.UNKNOWN, "evidence": (), "bound": UNDECIDED}
    verdicts = tuple(replace(v, **unknown) if v.name == "starvation" else v for v in whole.verdicts)
    doubted = replace(whole, verdicts=verdicts, evidence={**whole.evidence, file: text})
    write_bundle(tmp_path / "doubted", doubted)
    assert main(["verify", str(tmp_path / "doubted")]) == 0
    told = capsys.readouterr().out
    assert "left undecided by the bundle itself\n  ? starvation  every live transition" in told
    assert "shown (1 to be violated, which need not hold), 1 left undecided\n" in told
    write_bundle(tmp_path / "edited", replace(doubted, evidence=whole.evidence))
    assert main(["verify", str(tmp_path / "edited")]) == 2
    assert "'starvation' is unknown, and the evidence says otherwise" in capsys.readouterr().err.replace("\n", " ")


def test_no_time_at_all_refutes_nothing(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(bundle), "--timeout", "0.001"]) in {0, 3}  # as fast as the machine is
    assert "refuted" not in capsys.readouterr().err


def test_a_missing_second_solver_is_named(
    bundle: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = builtins.__import__

    def without_cvc5(name: str, *arguments: Any) -> Any:
        if name == "cvc5":
            raise ModuleNotFoundError("No module named 'cvc5'", name="cvc5")
        return real(name, *arguments)

    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", SOLVERS)  # not what they said before
    monkeypatch.setattr(builtins, "__import__", without_cvc5)
    assert main(["verify", str(bundle)]) == 2
    assert "pip install 'firable[verify]'" in capsys.readouterr().err
    assert main(["verify", str(bundle), "--solver", "z3"]) == 0


def test_a_bundle_without_a_theorem_is_refused_with_one_message_and_all_in_json(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = read_bundle(bundle)
    verdicts = tuple(verdict for verdict in whole.verdicts if not verdict.name.startswith("protocol."))
    evidence = {name: text for name, text in whole.evidence.items() if name != "protocol.smt2"}
    old = tmp_path / "old.bundle"
    write_bundle(old, replace(whole, verdicts=verdicts, evidence=evidence))
    lacking = len(whole.verdicts) - len(verdicts)
    assert main(["verify", str(old)]) == 2
    said = capsys.readouterr().err
    assert said.count("error[") == 1
    assert f"{old}:1:1: error[F5002]: there is no verdict on 'protocol.starts'" in said
    assert f"the same of {lacking - 1} more: 'protocol.keeps.ask', " in said
    assert main(["verify", str(old), "--format", "json"]) == 2
    errors = json.loads(capsys.readouterr().out)["errors"]
    assert [error["code"] for error in errors] == ["F5002"] * lacking


@pytest.mark.parametrize("net", ["catalogue:one_robot", "cells/one_robot.firable.yaml"])
def test_a_net_is_no_evidence_and_is_told_how_to_become_a_bundle(net: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", net]) == 2
    said = capsys.readouterr().err
    assert f"`firable bundle {net} -o one_robot.bundle`, then `firable verify one_robot.bundle`" in said
