"""`firable verify`: what it prints of evidence that shows its claim, and how it refuses what does not."""

import gzip
import json
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest
from support.evidence import document
from support.pigeons import pigeon_evidence
from support.second_solver import by_cvc5

from firable.analysis.evidence.certificate import FiringSequence, Labelling
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record, read_document, seal
from firable.analysis.evidence.producing.labels import listed
from firable.analysis.goal import Limits
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.spaces.reachability import explore
from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import Deadlock, Start
from firable.semantics.trace import Discipline


@pytest.fixture
def invariant(tmp_path: Path) -> Path:
    """Evidence that a ring has no deadlock."""
    net, path = family_net("token_ring-5"), tmp_path / "deadlock-free.evidence.json"
    found = decide_by_k_induction(net, Deadlock(), Limits())
    assert found.certificate is not None
    claim = Claim(ClaimKind.NEVER, Deadlock())
    path.write_text(
        document(Evidence(net, Discipline.INTERLEAVING, claim, found.certificate), name="deadlock-free").to_text()
    )
    return path


def test_evidence_that_shows_its_claim_is_told_so(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(invariant)]) == 0
    told = capsys.readouterr().out
    assert "✓ shown  deadlock-free  never (deadlock)" in told
    assert "discharged by z3" in told


def test_the_obligations_go_to_another_solver(invariant: Path, tmp_path: Path) -> None:
    assert main(["verify", str(invariant), "--smt-dir", str(tmp_path / "smt")]) == 0
    texts = sorted((tmp_path / "smt").iterdir())
    assert {"deadlock-free.goal.smt2", "deadlock-free.sums.smt2"} <= {file.name for file in texts}
    assert {by_cvc5(file.read_text()) for file in texts} == {"unsat"}


def test_a_report_of_verify_is_as_published(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(invariant), "--format", "json"]) == 0
    data = json.loads(capsys.readouterr().out)
    schema = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    (report,) = data["reports"]
    assert (report["status"], report["discipline"]) == ("proved", "interleaving")


def test_evidence_that_claims_nothing_shows_nothing(
    invariant: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file := tmp_path / "nothing.json").write_text(replace(read_document(invariant), records=()).to_text(), "utf-8")
    assert main(["verify", str(file)]) == 3
    assert "the document claims nothing" in capsys.readouterr().out
    assert main(["verify", str(file), str(invariant)]) == 3
    capsys.readouterr()
    assert main(["verify", "--format", "json", str(file)]) == 3
    assert '"status": "unknown"' in capsys.readouterr().out


def test_damaged_evidence_is_refused(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    invariant.write_text(invariant.read_text().replace("deadlock", "start", 1))
    assert main(["verify", str(invariant)]) == 2
    assert "error[F6001]" in capsys.readouterr().err


def test_evidence_of_a_false_claim_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph, path = explore(catalogue_net("one_robot_mc_late")), tmp_path / "false.evidence.json"
    claim = Claim(ClaimKind.NEVER, Deadlock())
    found = Evidence(graph.net, Discipline.INTERLEAVING, claim, Labelling(listed(graph)))
    path.write_text(document(found, name="deadlock-free").to_text())
    assert main(["verify", str(path)]) == 2
    told = capsys.readouterr().err
    assert "error[F6002]: deadlock-free: the evidence does not show what it claims" in told


def test_evidence_on_another_net_is_refused(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(invariant), "--net", "catalogue:token_ring-5"]) == 0
    assert main(["verify", str(invariant), "--net", "catalogue:token_ring-6"]) == 2
    assert "error[F6002]" in capsys.readouterr().err


def test_evidence_that_takes_too_long_is_unknown(tmp_path: Path) -> None:
    path = tmp_path / "pigeons.evidence.json"
    path.write_text(document(pigeon_evidence()).to_text())
    assert main(["verify", str(path), "--timeout", "0.001"]) == 3


def test_the_obligations_of_several_inputs_of_one_name_are_all_written(
    invariant: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other"
    assert main(["check", "catalogue:machines-2", "--method", "structure", "--evidence", str(other)]) == 0
    (found,) = other.iterdir()
    found.rename(other / invariant.name)
    monkeypatch.chdir(tmp_path)
    both = str(invariant), str(other / invariant.name)
    assert main(["verify", *both, "--smt-dir", "all"]) == 0
    written = {}
    for number, one in enumerate(both):
        assert main(["verify", one, "--smt-dir", str(number)]) == 0
        written[one] = {file.name: file.read_text() for file in Path(str(number)).iterdir()}
    folders = sorted(Path("all").iterdir())
    assert len(folders) == 2
    for folder in folders:
        assert {file.name: file.read_text() for file in folder.iterdir()} in written.values()
    assert written[both[0]] != written[both[1]]


def test_it_is_told_that_there_are_no_obligations_to_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "here.evidence.json"
    claim = Claim(ClaimKind.REACHABLE, Start())
    found = Evidence(catalogue_net("one_robot"), Discipline.INTERLEAVING, claim, FiringSequence(()))
    run.write_text(document(found).to_text())
    assert main(["verify", str(run), "--smt-dir", str(tmp_path / "smt")]) == 0
    assert "\n  no SMT-LIB 2 files: nothing here is shown by obligations\n" in capsys.readouterr().out


def test_a_solver_is_asked_of_bundles_alone(invariant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for solver in ("z3", "cvc5"):
        assert main(["verify", str(invariant), "--solver", solver]) == 2
        assert "--solver is for bundles" in capsys.readouterr().err


def test_the_worst_of_several_documents_decides(invariant: Path, tmp_path: Path) -> None:
    (tmp_path / "none.json").write_text(json.dumps({}))
    assert main(["verify", str(invariant), str(invariant), "--smt-dir", str(tmp_path / "smt")]) == 0
    assert main(["verify", str(invariant), str(tmp_path / "none.json")]) == 2
    assert main(["verify", str(tmp_path / "missing.json")]) == 2


@pytest.mark.parametrize("discipline", ["interleaving", "step"])
@pytest.mark.parametrize("cell", ["one_robot", "one_robot_mc_late"])
def test_all_that_check_decides_of_a_cell_is_verified(
    cell: str, discipline: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = f"catalogue:{cell}"
    main(["check", net, "--discipline", discipline, "--evidence", str(tmp_path), "--no-cache", "--format", "json"])
    (report,) = json.loads(capsys.readouterr().out)["reports"]
    (path,) = report["files"]
    assert main(["verify", path, "--net", net, "--format", "json"]) == 0
    (verified,) = json.loads(capsys.readouterr().out)["reports"]
    assert [v["name"] for v in verified["verdicts"]] == [v["name"] for v in report["verdicts"]]
    assert {v["status"] for v in verified["verdicts"]} == {"proved"}


def test_the_formula_of_a_query_is_told_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    queries = ("AG EF start", "EF p1.eating and p2.eating", "F p1.eating", "bound tokens(p1.eating, p2.eating)")
    asked = [word for query in queries for word in ("--query", query)]
    net = "catalogue:philosophers-2"
    main(["check", net, *asked, "--evidence", str(tmp_path), "--no-cache"])
    capsys.readouterr()
    assert main(["verify", *map(str, tmp_path.iterdir())]) == 0
    told = [line.split("  ")[-1] for line in capsys.readouterr().out.splitlines() if "query.query-" in line]
    assert told[:3] == [
        "CTL: not AG EF start",
        "CTL: not (EF p1.eating and p2.eating)",
        "a run does not satisfy LTL: F p1.eating",
    ]
    assert told[3].endswith("(bound tokens(p1.eating, p2.eating))")


def test_the_evidence_of_a_deadlock_is_the_way_into_it(tmp_path: Path) -> None:
    assert main(["check", "catalogue:one_robot_mc_late", "--evidence", str(tmp_path), "--no-cache"]) == 1
    (path,) = tmp_path.iterdir()
    record = next(v for v in json.loads(path.read_text())["verdicts"] if v["name"] == "deadlock-free")
    (shown,) = record["shown"]
    assert (shown["claim"]["kind"], shown["certificate"]["kind"]) == ("reachable", "firing-sequence")


def test_a_net_too_large_to_list_has_an_invariant_as_evidence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["catalogue:token_ring-40", "--max-seconds", "60", "--evidence", str(tmp_path), "--no-cache"]
    main(["check", *arguments, "--method", "k-induction"])
    (path,) = tmp_path.iterdir()
    record = next(v for v in json.loads(path.read_text())["verdicts"] if v["name"] == "deadlock-free")
    assert record["shown"][0]["certificate"]["kind"] == "inductive-invariant"
    capsys.readouterr()
    main(["verify", str(path), "--format", "json"])
    (report,) = json.loads(capsys.readouterr().out)["reports"]
    (verified,) = (verdict for verdict in report["verdicts"] if verdict["name"] == "deadlock-free")
    assert verified["status"] == "proved"
    assert "discharged by z3" in verified["method"]


def test_what_is_shown_to_be_violated_is_told_so_and_how_much_it_matters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "evidence"
    assert main(["check", "catalogue:one_robot_mc_late", "--evidence", str(folder)]) == 1
    capsys.readouterr()
    (file,) = folder.iterdir()
    assert main(["verify", str(file)]) == 0
    told = capsys.readouterr().out
    must_hold, besides = told[told.index("\nmust hold\n") :].split("\ntold besides\n")
    assert re.search(r"✗ shown: violated  deadlock-free +\(deadlock\) is reachable", must_hold)
    assert re.search(r"✓ shown            contact-free +never ", must_hold)
    assert re.search(r"! shown: violated  live +from some reachable marking", besides)
    assert re.search(r"· shown: violated  reversible ", besides)
    assert re.search(r"✓ shown            self-loops +no place is both", besides), (
        "its sentence, where no claim is told"
    )
    assert "1 marking and 0 firings gone through" in besides
    assert "20 shown (9 to be violated, 3 of which must hold)" in told


def test_what_the_dead_hold_up_and_claims_of_no_verdict_are_told_besides(
    invariant: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["prove", "catalogue:conceptual_one_robot", "--faults", "--smt-dir", str(tmp_path / "proof")]) == 0
    unnamed = tmp_path / "unnamed.evidence.json"
    of = read_document(invariant)
    unnamed.write_text(replace(of, records=tuple(replace(record, name="") for record in of.records)).to_text())
    dead = sorted((tmp_path / "proof").glob("faults.dead*.evidence.json"))
    assert len(dead) == 4
    for file in (*dead, unnamed):
        capsys.readouterr()
        assert main(["verify", str(file)]) == 0
        told = capsys.readouterr().out
        assert "\ntold besides\n" in told
        assert "must hold" not in told


def test_a_verdict_that_nothing_shows_is_only_claimed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net, path = family_net("token_ring-5"), tmp_path / "claimed.evidence.json"
    records = (Record("live", True, (), "nobody has looked"), Record("self-loops", True, ()))
    path.write_text(Document(net, Discipline.INTERLEAVING, records).to_text())
    assert main(["verify", str(path)]) == 3
    told = capsys.readouterr().out
    assert "? claimed  live        from every reachable marking" in told
    assert "✓ shown    self-loops" in told
    assert "only claimed: nobody has looked" in told
    assert "by nothing" not in told
    assert "1 shown, 1 not shown" in told


def test_a_claim_that_says_less_than_the_verdict_shows_nothing_of_it(tmp_path: Path, invariant: Path) -> None:
    data = json.loads(invariant.read_text())
    data["verdicts"][0]["name"] = "live"
    path = tmp_path / "renamed.evidence.json"
    path.write_text(json.dumps(data | {"seal": seal(data)}))
    assert main(["verify", str(path)]) == 3


def test_a_large_document_is_compressed_and_read_like_any_other(
    tmp_path: Path, invariant: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    packed = tmp_path / "packed.evidence.json.gz"
    packed.write_bytes(gzip.compress(invariant.read_bytes()))
    assert main(["verify", str(packed)]) == 0
    packed.write_bytes(gzip.compress(invariant.read_bytes())[:-9])
    assert main(["verify", str(packed)]) == 2
    assert "error[F6001]" in capsys.readouterr().err


@pytest.mark.parametrize("data", [b"garbage", b"\xff\xfe\x00garbage", b""])
def test_what_is_neither_a_bundle_nor_evidence_is_told_so(
    data: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bad.bundle"
    file.write_bytes(data)
    assert main(["verify", str(file)]) == 2
    said = capsys.readouterr().err
    assert "this is neither a bundle nor a document of evidence" in said
    assert "Expecting value" not in said
