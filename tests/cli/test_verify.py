"""`firable verify`: what it prints of evidence that shows its claim, and how it refuses what does not."""

import json
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest
from support.pigeons import pigeon_evidence
from support.second_solver import by_cvc5

from firable.analysis.evidence.document import Claim, ClaimKind
from firable.analysis.evidence.producing import evidence_of_finding, evidence_of_graph
from firable.analysis.goal import Limits
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.spaces.reachability import explore
from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import Deadlock


@pytest.fixture
def invariant(tmp_path: Path) -> Path:
    """Evidence that a ring has no deadlock."""
    net, path = family_net("token_ring-5"), tmp_path / "deadlock-free.evidence.json"
    found = evidence_of_finding(net, Deadlock(), decide_by_k_induction(net, Deadlock(), Limits()))
    assert found is not None
    path.write_text(found.to_text())
    return path


def test_evidence_that_shows_its_claim_is_told_so(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(invariant)]) == 0
    told = capsys.readouterr().out
    assert "✓ proved    evidence  never (deadlock)" in told
    assert "discharged by z3" in told


def test_the_obligations_go_to_another_solver(invariant: Path, tmp_path: Path) -> None:
    assert main(["verify", str(invariant), "--smt-dir", str(tmp_path / "smt")]) == 0
    texts = sorted((tmp_path / "smt").iterdir())
    assert {"goal.smt2", "sums.smt2"} <= {file.name for file in texts}
    assert {by_cvc5(file.read_text()) for file in texts} == {"unsat"}


def test_a_report_of_verify_is_as_published(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(invariant), "--format", "json"]) == 0
    data = json.loads(capsys.readouterr().out)
    schema = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    (report,) = data["reports"]
    assert (report["status"], report["discipline"]) == ("proved", "interleaving")


def test_damaged_evidence_is_refused(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    invariant.write_text(invariant.read_text().replace("deadlock", "start", 1))
    assert main(["verify", str(invariant)]) == 2
    assert "error[F6001]" in capsys.readouterr().err


def test_evidence_of_a_false_claim_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph, path = explore(catalogue_net("one_robot_mc_late")), tmp_path / "false.evidence.json"
    found = evidence_of_graph(graph, Claim(ClaimKind.NEVER, Deadlock()))
    assert found is not None
    path.write_text(found.to_text())
    assert main(["verify", str(path)]) == 2
    assert "error[F6002]" in capsys.readouterr().err


def test_evidence_on_another_net_is_refused(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(invariant), "--net", "catalogue:token_ring-5"]) == 0
    assert main(["verify", str(invariant), "--net", "catalogue:token_ring-6"]) == 2
    assert "error[F6002]" in capsys.readouterr().err


def test_evidence_that_takes_too_long_is_unknown(tmp_path: Path) -> None:
    path = tmp_path / "pigeons.evidence.json"
    path.write_text(pigeon_evidence().to_text())
    assert main(["verify", str(path), "--timeout", "0.001"]) == 3


def test_the_worst_of_several_documents_decides(invariant: Path, tmp_path: Path) -> None:
    (tmp_path / "none.json").write_text(json.dumps({}))
    assert main(["verify", str(invariant), str(invariant), "--smt-dir", str(tmp_path / "smt")]) == 0
    assert main(["verify", str(invariant), str(tmp_path / "none.json")]) == 2
    assert main(["verify", str(tmp_path / "missing.json")]) == 2


@pytest.mark.parametrize("discipline", ["interleaving", "step"])
def test_all_that_check_decides_of_the_cell_is_verified(
    discipline: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["check", "catalogue:one_robot", "--discipline", discipline, "--evidence", str(tmp_path), "--no-cache"])
    assert "documents of evidence: firable verify" in capsys.readouterr().out
    documents = sorted(tmp_path.glob("*.evidence.json"))
    names = {document.name.removesuffix(".evidence.json").partition(".")[0] for document in documents}
    assert {"contact-free", "deadlock-free", "quasi-live", "live", "reversible"} <= names
    assert main(["verify", *map(str, documents)]) == 0


def test_the_evidence_of_a_deadlock_is_the_way_into_it(tmp_path: Path) -> None:
    assert main(["check", "catalogue:one_robot_mc_late", "--evidence", str(tmp_path), "--no-cache"]) == 1
    document = json.loads((tmp_path / "deadlock-free.evidence.json").read_text())
    assert (document["claim"]["kind"], document["certificate"]["kind"]) == ("reachable", "firing-sequence")
    assert main(["verify", str(tmp_path / "deadlock-free.evidence.json")]) == 0


def test_a_net_too_large_to_list_has_an_invariant_as_evidence(tmp_path: Path) -> None:
    arguments = ["catalogue:token_ring-40", "--max-seconds", "5", "--evidence", str(tmp_path), "--no-cache"]
    main(["check", *arguments, "--method", "k-induction"])
    document = json.loads((tmp_path / "deadlock-free.evidence.json").read_text())
    assert document["certificate"]["kind"] == "inductive-invariant"
    assert main(["verify", str(tmp_path / "deadlock-free.evidence.json")]) == 0
