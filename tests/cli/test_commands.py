"""The commands as a person types them: what they print, what they write, and how they exit."""

import json
import re
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from textwrap import indent
from typing import Any

import jsonschema
import pytest
from support.published import COORDINATOR_TABLE

from firable.cli.main import COMMANDS, main
from firable.nets.bundle import read_bundle

ROOT = Path(__file__).parents[2]
HEADER = (
    '{"firable_trace": 1, "net": "one-robot", "digest": "", "discipline": "interleaving", '
    '"signals": true, "commands": true}'
)
SCHEMA = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A bundle of the one-robot cell."""
    path = tmp_path_factory.mktemp("bundle") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return str(path)


def as_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, Any]:
    """The exit code and the JSON of a command, which has to fit the published schema."""
    capsys.readouterr()
    code = main([*arguments, "--format", "json"])
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    assert data["exit_code"] == code
    return code, data


def test_a_bundle_that_is_made_tells_the_warnings_that_it_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bundle", "catalogue:one_robot", "-o", str(tmp_path / "cell.bundle")]) == 0
    told = capsys.readouterr().out
    assert "\nwarnings\n  ! warning   machine-never-stopped  every machine" in told
    assert "all hold: 152 proved, 1 warning\n" in told
    assert "structural-conflicts" not in told


def test_the_published_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


def test_the_schema_refuses_a_report_of_another_shape() -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(SCHEMA).validate({"firable_report": 2})


def test_the_one_robot_cell_holds(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "check", "catalogue:one_robot")
    (report,) = data["reports"]
    assert (code, report["status"]) == (0, "proved")
    assert (report["figures"]["markings"], report["figures"]["edges"]) == (40, 70)


def test_a_deadlock_is_told_step_by_step_and_replays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "catalogue:one_robot_mc_late", "--trace-dir", str(tmp_path / "traces")]) == 1
    told = capsys.readouterr().out
    assert "✗ violated  deadlock-free" in told
    assert " 15. t1-b  arrived at MC with the workpiece" in told
    trace = str(tmp_path / "traces" / "deadlock-free.trace.jsonl")
    assert f"firable replay {trace} --net catalogue:one_robot_mc_late" in told
    assert main(["replay", trace, "--net", "catalogue:one_robot_mc_late"]) == 0
    assert "deadlock: nothing is firable here" in capsys.readouterr().out


def test_every_counterexample_replays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for discipline in ("interleaving", "step"):
        folder = tmp_path / discipline
        arguments = ["check", "catalogue:one_robot_mc_late", "--discipline", discipline, "--trace-dir", str(folder)]
        assert main(arguments) == 1
        traces = sorted(folder.iterdir())
        assert len(traces) >= 3
        for trace in traces:
            code, _ = as_json(capsys, "replay", str(trace), "--net", "catalogue:one_robot_mc_late")
            assert code == 0, trace


def test_the_structure_is_told_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "check", "catalogue:one_robot", "--structure")
    structure = data["reports"][0]["figures"]["structure"]
    assert (code, len(structure["p_invariants"]["minimal"]), structure["p_invariants"]["dimension"]) == (0, 68, 14)
    assert structure["p_invariants"]["uncovered"] == []
    assert main(["check", "catalogue:one_robot", "--structure"]) == 0
    assert "P-invariants  68 minimal, dimension 14; all places are in one" in capsys.readouterr().out
    _, data = as_json(capsys, "check", "catalogue:conceptual_one_robot_mc_late", "--structure")
    assert data["reports"][0]["figures"]["structure"]["siphons_without_marked_trap"]


@pytest.mark.parametrize("sent", ["SIGINT", "SIGTERM"])
def test_an_interrupted_check_shows_what_is_known(tmp_path: Path, sent: str) -> None:
    count = 60  # philosophers: far more markings than anyone waits for
    seats = range(count)
    places = [f"  {kind}{i}:" for i in seats for kind in ("thinking", "eating", "fork")]
    taken = [f"thinking{i}, fork{i}, fork{(i + 1) % count}" for i in seats]
    transitions = [
        line
        for i in seats
        for line in (
            f"  take{i}: {{from: [{taken[i]}], to: eating{i}}}",
            f"  put{i}: {{from: eating{i}, to: [{taken[i]}]}}",
        )
    ]
    start = ", ".join(f"thinking{i}, fork{i}" for i in seats)
    net = tmp_path / "table.firable.yaml"
    lines = ["firable: 1", "cell: table", f"start: [{start}]", "places:", *places, "transitions:", *transitions]
    net.write_text("\n".join(lines) + "\n")
    # The signal comes once the exploration runs: the interpreter's own thread sends it from beside the engine.
    script = (
        "import os, signal, sys, threading, firable.analysis.spaces.reachability as r\n"
        "from firable.cli.main import main\n"
        "engine = r._engine.explore\n"
        "def explore(*arguments, **options):\n"
        f"    threading.Timer(0.2, os.kill, (os.getpid(), signal.{sent})).start()\n"
        "    r._engine.explore = engine\n"
        "    return engine(*arguments, **options)\n"
        "r._engine.explore = explore\n"
        f"sys.exit(main(['check', '--method', 'explicit', {str(net)!r}]))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 3, done.stdout + done.stderr
    assert "markings found" in done.stdout
    assert "interrupted" in done.stdout
    assert done.stderr == ""


def test_several_nets_get_a_report_each_and_the_worst_exit_code(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "check", "catalogue:one_robot", "catalogue:one_robot_mc_late")
    assert (code, [report["status"] for report in data["reports"]]) == (1, ["proved", "violated"])
    code, data = as_json(capsys, "check", "catalogue:one_robot_mc_late", "no-such.firable.yaml")
    assert (code, len(data["reports"]), [error["code"] for error in data["errors"]]) == (2, 1, ["F1001"])


def test_a_budget_that_ends_is_unknown_and_never_passes(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "check", "catalogue:one_robot", "--max-markings", "10", "--method", "explicit")
    (report,) = data["reports"]
    assert (code, report["status"], report["figures"]["complete"]) == (3, "unknown", False)
    assert report["figures"]["deadlocks"] is None
    assert main(["check", "catalogue:one_robot", "--max-markings", "10", "--method", "explicit"]) == 3
    assert "? unknown   deadlock-free" in capsys.readouterr().out


def test_the_same_input_gives_the_same_report(capsys: pytest.CaptureFixture[str]) -> None:
    for format_ in ("text", "json"):
        outputs = set()
        for _ in range(2):
            main(["check", "catalogue:one_robot_mc_late", "--format", format_])
            outputs.add(capsys.readouterr().out)
        assert len(outputs) == 1


def test_the_coordinator_table_is_printed_as_published(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", "catalogue:one_robot"]) == 0
    output = capsys.readouterr().out
    assert output.split("\n\n")[1] == "coordinator table\n" + indent(COORDINATOR_TABLE, "  ").rstrip("\n")
    assert "15 of 15  Eq. (7)" in output
    assert "28 of 28  Eq. (9)-(10)" in output


def test_obligations_are_written_as_smtlib(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "prove", "catalogue:one_robot", "--smt-dir", str(tmp_path / "smt"))
    (report,) = data["reports"]
    assert code == 0
    assert {Path(file) for file in report["files"]} == set((tmp_path / "smt").iterdir())
    texts = {Path(file).name: Path(file).read_text() for file in report["files"]}
    assert all(f'(echo "{v["name"]}")' in texts[file] for v in report["verdicts"] for file in v.get("evidence", ()))
    assert [line["name"] for line in report["standing"]] == [f"O{n}" for n in range(1, 10)]
    assert len(report["table"]) == 9


def test_a_net_that_may_deadlock_gets_no_bundle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bundle", "catalogue:one_robot_mc_late", "-o", str(tmp_path / "late.bundle")]) == 1
    assert "no bundle was made" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_where_no_bundle_is_made_an_older_one_that_stands_there_is_told(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    older = tmp_path / "late.bundle"
    older.write_bytes(Path(bundle).read_bytes())
    identity = read_bundle(older).digest[:16]
    said = f"{older} was not made by this call: it is an older bundle, of 'one-robot', identity {identity}"
    assert main(["bundle", "catalogue:one_robot_mc_late", "-o", str(older)]) == 1
    told = capsys.readouterr()
    assert told.out.endswith("no bundle was made: only what is proved may run\n")
    assert f"warning[F4003]: {said}\n  hint: take it away, so that nothing goes on with it" in told.err
    code, data = as_json(capsys, "bundle", "catalogue:one_robot_mc_late", "-o", str(older))
    assert (code, [note["message"] for note in data["reports"][0]["notes"]]) == (1, [said])
    assert older.read_bytes() == Path(bundle).read_bytes()


def test_where_the_net_is_refused_what_stands_at_the_place_of_the_bundle_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cell.firable.yaml").write_text("firable: 1\ncell: c\nplace: {p: }\n")
    (tmp_path / "cell.bundle").write_text("of yesterday")
    for there in (True, False):
        if not there:
            (tmp_path / "cell.bundle").unlink()
        assert main(["bundle", str(tmp_path / "cell.firable.yaml"), "-o", str(tmp_path / "cell.bundle")]) == 2
        said = f"; {tmp_path}/cell.bundle was not made by this call: it is an older file"
        assert (said in capsys.readouterr().err) == there


def test_a_run_leaves_a_trace_of_the_net(bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trace = str(tmp_path / "run.trace.jsonl")
    code, data = as_json(capsys, "run", bundle, "--workpieces", "25", "--trace", trace)
    run = data["reports"][0]["run"]
    assert (code, run["state"], len(run["delivered"])) == (0, "done", 25)
    assert run["lost"] == run["doubled"] == []
    code, data = as_json(capsys, "replay", trace, "--net", bundle)
    assert (code, data["reports"][0]["run"]["firings"]["G9"]) == (0, 25)


def test_a_trace_with_one_firing_left_out_is_refuted(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "run.trace.jsonl"
    assert main(["run", bundle, "--workpieces", "1", "--trace", str(trace)]) == 0
    lines = trace.read_text().splitlines()
    trace.write_text("".join(f"{line}\n" for line in lines if '"G3"' not in line))
    code, data = as_json(capsys, "replay", str(trace), "--net", bundle)
    assert (code, data["reports"][0]["verdicts"][0]["code"]) == (1, "F5004")
    trace.write_text("".join(f"{line}\n" for line in lines[:-1]))
    code, _ = as_json(capsys, "replay", str(trace), "--net", bundle)
    assert code == 3


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ((HEADER, '{"at": 1.0, "fired": ["nobody"]}'), "the trace is none of the net"),
        ((HEADER, '{"at": 1.0, "command": "nobody"}'), "the trace is none of the net"),
        ((HEADER.replace("interleaving", "step"),), "and this is a trace of steps"),
        ((HEADER.replace("true", "false"), '{"at": 1.0, "fired": ["G1"]}'), "records no signals and commands"),
    ],
)
def test_of_machines_nothing_is_said_by_a_trace_that_does_not_show_them(
    lines: tuple[str, ...], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "a.trace.jsonl"
    trace.write_text("".join(f"{line}\n" for line in lines))
    cell = "catalogue:one_robot"
    _, data = as_json(capsys, "replay", str(trace), "--net", cell, "--machines", cell)
    verdict = data["reports"][0]["verdicts"][1]
    assert (verdict["name"], verdict["status"]) == ("machines", "unknown")
    assert says in verdict["bound"]


@pytest.mark.parametrize("note", ["restarted", "emergency stop"])
def test_machines_are_judged_up_to_where_a_run_was_broken_off(
    note: str, bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell, trace = "catalogue:one_robot", tmp_path / "run.trace.jsonl"
    assert main(["run", bundle, "--workpieces", "1", "--trace", str(trace)]) == 0
    lines = trace.read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if '"robot.to_cv1"' in line)
    now = json.loads(lines[at])["at"]
    # The robot stands for an hour, and then its completion comes.
    later = [{**json.loads(line), "at": json.loads(line)["at"] + 3600} for line in lines[at + 1 :]]
    broken = [*map(json.loads, lines[: at + 1]), {"at": now, "note": note}, *later]
    trace.write_text("".join(f"{json.dumps(line)}\n" for line in broken))
    code, data = as_json(capsys, "replay", str(trace), "--net", bundle, "--machines", cell)
    verdict = data["reports"][0]["verdicts"][1]
    assert (code, verdict["status"]) == (3, "unknown")
    assert verdict["bound"].startswith(f"until {now:.2f} s, where the run was broken off")
    trace.write_text("".join(f"{json.dumps(line)}\n" for line in broken if line.get("note") != note))
    code, _ = as_json(capsys, "replay", str(trace), "--net", bundle, "--machines", cell)
    assert code == 1, "a run that was not broken off"


def test_a_bundle_with_one_changed_byte_does_not_run(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = bytearray(Path(bundle).read_bytes())
    data[len(data) // 2] ^= 1
    changed = tmp_path / "changed.bundle"
    changed.write_bytes(data)
    assert main(["run", str(changed)]) == 2
    assert "F5001" in capsys.readouterr().err


def test_a_net_survives_the_way_to_pnml_and_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pnml, back = str(tmp_path / "cell.pnml"), str(tmp_path / "back.firable.yaml")
    assert main(["convert", "catalogue:conceptual_one_robot", "-o", pnml]) == 0
    assert "warning[F1016]" in capsys.readouterr().err
    assert main(["convert", pnml, "-o", back]) == 0
    capsys.readouterr()
    _, data = as_json(capsys, "check", back)
    assert (data["reports"][0]["figures"]["markings"], data["reports"][0]["figures"]["edges"]) == (14, 23)


def test_a_net_of_a_family_is_checked_and_converted_by_name(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, data = as_json(capsys, "check", "catalogue:philosophers-5")
    assert code == 1
    assert data["reports"][0]["figures"]["markings"] == 82
    copy = str(tmp_path / "copy.firable.yaml")
    assert main(["convert", "catalogue:philosophers(5)", "-o", copy]) == 0
    again = as_json(capsys, "check", copy)[1]
    assert again["reports"][0]["digest"] == data["reports"][0]["digest"]


def test_a_net_file_is_printed_as_it_means(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = str(tmp_path / "copy.firable.yaml")
    assert main(["convert", "catalogue:one_robot", "-o", copy]) == 0
    digests = {as_json(capsys, "check", net)[1]["reports"][0]["digest"] for net in ("catalogue:one_robot", copy)}
    assert len(digests) == 1


def test_the_picture_in_the_documentation_is_the_one_that_is_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["draw", "catalogue:one_robot"]) == 0
    assert capsys.readouterr().out == (ROOT / "docs" / "one-robot.svg").read_text(encoding="utf-8")


def test_a_marking_is_drawn_instead_of_the_initial_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["draw", "catalogue:conceptual_one_robot", "--marking", "system.loading, system.cv2"]) == 0
    # A token for each place named, and the one in the legend.
    assert capsys.readouterr().out.count('class="token"') == 3


@pytest.mark.parametrize("kind", ["net", "plant", "report"])
def test_schemas_are_printed(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", kind]) == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["properties"]


def test_a_budget_that_does_not_hold_the_net_is_unknown_and_no_crash(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "check", "catalogue:machines-10000", "--max-memory", "1")
    assert code == 3
    assert [error["code"] for error in data["errors"]] == ["F3004"]
    assert "symbolic" not in data["errors"][0]["hint"]  # it was tried


def test_a_budget_that_holds_the_markings_and_not_what_is_asked_of_them_is_unknown_and_no_crash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor is a cure looked for where there is no room for it."""
    net = tmp_path / "ring.firable.yaml"
    places = "".join(f"  p{i}:\n" for i in range(3000))
    moves = "".join(f"  t{i}: {{from: p{i}, to: p{(i + 1) % 3000}}}\n" for i in range(3000))
    net.write_text(f"firable: 1\ncell: ring\nplaces:\n{places}start: p0\ntransitions:\n{moves}", encoding="utf-8")
    code, data = as_json(capsys, "check", str(net), "--max-memory", "1")
    assert code == 3
    assert data["reports"][0]["figures"]["markings"] == 3000
    found = {verdict["name"]: verdict for verdict in data["reports"][0]["verdicts"]}
    assert found["quasi-live"]["status"] == "unknown"
    assert "the budget of memory is used up" in found["quasi-live"]["bound"]


def test_methods_and_costs_are_told_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    for verbose in (True, False):
        assert main(["check", "catalogue:one_robot", *(["-v"] if verbose else [])]) == 0
        told = re.search(
            r"by reachability graph, interleaving, 40 markings, 70 edges, [0-9.e-]+ s\n", capsys.readouterr().out
        )
        assert (told is not None) is verbose


def test_prove_tells_the_side_conditions_of_the_protocol_theorem_in_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["prove", "catalogue:conceptual_one_robot"]) == 0
    told = capsys.readouterr().out
    assert "  ✓  51 of 51  protocol " in told
    assert "  ✓   7 of 7   side conditions  what that assumes of this split, as do ownership, O3" in told
    code, data = as_json(capsys, "prove", "catalogue:conceptual_one_robot")
    side = [v for v in data["reports"][0]["verdicts"] if v["name"].startswith("protocol.side.")]
    assert code == 0
    assert [(v["name"].rpartition(".")[2], v["status"]) for v in side] == [
        (name, "proved") for name in ("owner", "parts", "locals", "strangers", "gates", "start", "free")
    ]


@pytest.mark.parametrize(
    ("done", "left_out"),
    [
        ("main(['--help'])", {"pydantic", "numpy", "networkx", "z3", "highspy"}),
        (
            "main(['check', 'catalogue:philosophers-8', '--no-cache'])",
            {"pydantic", "networkx", "z3", "highspy", "firable.cli.run"},
        ),
        (
            "explore(family_net('philosophers-8')).n_markings",
            {"pydantic", "numpy", "networkx", "z3", "highspy", "firable.nets.text"},
        ),
    ],
)
def test_what_is_not_needed_is_not_loaded(done: str, left_out: set[str]) -> None:
    code = (
        "import sys, firable.analysis.check\n"
        "from firable.analysis.spaces.reachability import explore\n"
        "from firable.cli.main import main\n"
        "from firable.nets.catalogue import family_net\n"
        f"{done}\n"
        "sys.stderr.write(' '.join(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert left_out & set(run.stderr.split()) == set()


def test_every_command_is_loaded_by_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    for name in COMMANDS:
        assert main([name, "--help"]) == 0
        assert capsys.readouterr().out.startswith(f"Usage: firable {name}")
    assert sorted(COMMANDS) == list(COMMANDS)


def test_a_net_file_that_is_written_names_the_schema_of_its_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "net.schema.json").touch()  # above the project, so not the project's
    project = tmp_path / "project"
    (project / "cells").mkdir(parents=True)
    monkeypatch.chdir(project)
    assert main(["schema", "net"]) == 0
    schema = capsys.readouterr().out

    def first_line(file: str, *arguments: str) -> str:
        assert main(list(arguments)) == 0
        line, named = (project / file).read_text("utf-8").splitlines()[0].split("=")
        assert line == "# yaml-language-server: $schema"
        assert (project / file).parent.joinpath(named).read_text("utf-8") == schema
        return named

    convert = ("convert", "catalogue:one_robot", "-o", "cells/cell.firable.yaml")
    refine = ("refine", "catalogue:conceptual_one_robot", "-o", "refined.firable.yaml", "--format", "json")
    split = ("split", "catalogue:one_robot", "--subnets", "parts/one", "--format", "json")
    written = "written: cells/net.schema.json, by which editors complete and check cells/cell.firable.yaml\n"
    assert first_line("cells/cell.firable.yaml", *convert) == "net.schema.json"
    assert capsys.readouterr().out == written
    (project / "cells/net.schema.json").unlink()
    assert first_line("refined.firable.yaml", *refine) == "net.schema.json"
    assert json.loads(capsys.readouterr().out)["reports"][0]["files"] == ["refined.firable.yaml", "net.schema.json"]
    assert first_line("cells/cell.firable.yaml", *convert) == "../net.schema.json"
    assert capsys.readouterr().out == ""
    assert first_line("parts/one/robot.firable.yaml", *split) == "../../net.schema.json"
    (project / "net.schema.json").unlink()
    capsys.readouterr()
    assert first_line("parts/one/mc.firable.yaml", *split) == "net.schema.json"
    files = json.loads(capsys.readouterr().out)["reports"][0]["files"]
    assert files.count("parts/one/net.schema.json") == 1
    assert len(files) == 5
    with (project / "parts/one/net.schema.json").open("a") as stream:
        stream.write("\n")  # the project's own, whatever it holds, is left alone
    schema += "\n"
    assert first_line("parts/one/robot.firable.yaml", *split) == "net.schema.json"


def test_what_cannot_be_written_leaves_no_schema_behind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "taken.firable.yaml").mkdir()
    assert main(["convert", "catalogue:one_robot", "-o", str(tmp_path / "taken.firable.yaml")]) == 2
    assert "taken.firable.yaml: cannot be written: this is a directory" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["taken.firable.yaml"]


NET_WRITERS = (
    ("refine", "catalogue:conceptual_one_robot", "-o"),
    ("split", "catalogue:one_robot", "--suggest", "2", "-o"),
    ("check", "catalogue:one_robot", "--machines", "catalogue:one_robot", "--loop-net"),
)


@pytest.mark.parametrize("arguments", NET_WRITERS)
def test_a_net_never_goes_amid_the_report(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*arguments, "-"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "the net cannot go to standard output, where the report goes: name a file" in printed.err


@pytest.mark.parametrize("arguments", NET_WRITERS)
def test_a_net_file_is_written_under_no_name_by_which_it_is_not_read(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("net.txt", "net", "net.pnml"):
        assert main([*arguments, name]) == 2
        said = f"'{name}' is not named like a net file: name a file *.firable.yaml"
        assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_what_fails_before_anything_fires_is_not_told_by_the_firings_of_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.firable.yaml"
    path.write_text("firable: 1\ncell: c\nplaces: {a: , b: }\nstart: a\ntransitions: {t: {from: a, to: b}}\n", "utf-8")
    queries = ("--query", "ctl b and EF a", "--query", "ctl not a and EF b")
    assert main(["check", str(path), "--method", "k-induction", *queries]) == 1
    out = capsys.readouterr().out
    assert out.count("already in the initial marking:") == 2
    assert "the same firings" not in out


def test_the_package_is_run_as_the_command_is() -> None:
    told = subprocess.run([sys.executable, "-m", "firable", "--version"], capture_output=True, text=True, check=True)
    assert told.stdout.startswith("firable ")


def test_what_is_proved_because_there_is_nothing_of_the_kind_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "catalogue:one_robot_mc_late"]) == 1
    told = capsys.readouterr().out
    assert re.search(r"✓ proved +starvation .*\n      no transition is live, so none starves\n", told)
    assert main(["check", "catalogue:one_robot"]) == 0
    assert "none starves" not in capsys.readouterr().out
