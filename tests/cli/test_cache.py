"""The cache of `firable check`: the same net is not checked twice, and nothing but the same net is taken for it."""

from __future__ import annotations

import importlib
import json
from hashlib import sha256
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest
from support.interrupting import ended

from firable.analysis.check import check
from firable.analysis.report import CheckReport
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.cli.cache import Cache, Kept, key_of
from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net

NET = """firable: 1
cell: two places
controllers:
  a: {start: p, places: {p: , q: }}
transitions:
  t: {from: a.p, to: a.q}
  u: {from: a.q, to: a.p}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FIRABLE_CACHE", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def explored(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The nets that the command has had checked."""
    nets: list[str] = []

    def note(net: Net, *args: Any, **kwargs: Any) -> CheckReport:
        nets.append(str(net))
        return check(net, *args, **kwargs)

    importlib.import_module("firable.analysis.cures.finding")  # whose own checks are not the command's
    monkeypatch.setattr("firable.analysis.check.check", note)
    return nets


def checked(folder: Path, text: str, capsys: pytest.CaptureFixture[str], *options: str) -> str:
    (folder / "net.firable.yaml").write_text(text, encoding="utf-8")
    assert main(["check", str(folder / "net.firable.yaml"), "--format", "json", *options]) == 0
    return capsys.readouterr().out


def test_the_same_net_is_checked_once_and_reported_byte_by_byte(
    folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    first = checked(folder, NET, capsys)
    assert checked(folder, NET, capsys) == first
    assert len(explored) == 1


def test_comments_layout_and_descriptions_keep_the_answer(
    folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    checked(folder, NET, capsys)
    told = NET.replace("t: {from: a.p, to: a.q}", "t: {from: a.p, to: a.q, description: there}  # and back")
    assert told != NET
    checked(folder, told, capsys)
    assert len(explored) == 1


@pytest.mark.parametrize(
    ("change", "options"),
    [
        (("u: {from: a.q, to: a.p}", "u: {from: a.q, to: a.p}\n  v: {from: a.q, to: a.p}"), ()),
        (("", ""), ("--discipline", "step")),
        (("", ""), ("--max-markings", "77")),
        (("", ""), ("--no-cache",)),
    ],
)
def test_another_net_or_question_is_another_answer(
    folder: Path,
    explored: list[str],
    capsys: pytest.CaptureFixture[str],
    change: tuple[str, str],
    options: tuple[str, ...],
) -> None:
    checked(folder, NET, capsys)
    checked(folder, NET.replace(*change), capsys, *options)
    assert len(explored) == 2


def test_the_answer_goes_by_the_modules_of_the_program_and_by_nothing_that_lies_among_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def touch(*files: str) -> str:
        for file in files:
            path = tmp_path / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(file, encoding="utf-8")
        return key_of(catalogue_net("one_robot"), {})

    monkeypatch.setattr("firable.__file__", str(tmp_path / "__init__.py"))
    before = touch("analysis/__init__.py", "analysis/check.py", "analysis/_engine.abi3.so", "cli/__init__.py")
    assert touch("analysis/engine/target/sdist/check.py", "analysis/notes.txt", "executor/__init__.py") == before
    for module in ("analysis/spaces/__init__.py", "analysis/_other.pyd", "cli/main.py", "nets/__init__.py"):
        before, last = touch(module), before
        assert before != last


def test_the_answer_of_another_solver_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"z3-solver": "4.13.0", "numpy": "2.1"}

    def version(name: str) -> str:
        try:
            return versions[name]
        except KeyError:
            raise PackageNotFoundError(name) from None  # it came otherwise than as a package

    monkeypatch.setattr("importlib.metadata.version", version)
    before = key_of(catalogue_net("one_robot"), {})
    assert key_of(catalogue_net("one_robot"), {}) == before
    versions["z3-solver"] = "4.14.0"
    assert key_of(catalogue_net("one_robot"), {}) != before


def test_a_damaged_entry_is_no_answer(folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    first = checked(folder, NET, capsys)
    (entry,) = (folder / "cache").iterdir()
    whole = entry.read_text(encoding="utf-8")
    for damaged in ("", whole[:-1], whole.replace("proved", "violated", 1), "{}", whole.split("\n", 1)[0] + "\n{}"):
        entry.write_text(damaged, encoding="utf-8")
        before = len(explored)
        assert checked(folder, NET, capsys) == first
        assert len(explored) == before + 1


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "[]", '{"verdicts": 1}', '{"verdicts": [], "figures": {}, "course": 1}']
)
def test_an_entry_that_somebody_else_has_written_is_no_answer(
    text: str, folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    first = checked(folder, NET, capsys)
    (entry,) = (folder / "cache").iterdir()
    entry.write_text(f"{sha256(text.encode()).hexdigest()}\n{text}", encoding="utf-8")
    assert checked(folder, NET, capsys) == first
    assert len(explored) == 2


FIGURES: list[dict[str, object]] = [
    {"markings": None},
    {"markings": -1},
    {"edges": "3"},
    {"complete": 1},
    {"dead": [1]},
    {"gate_races": [["t"]]},
    {"contacts": []},
    {"effective_conflicts": {"by_input": []}},
    {"structure": {}},
    {"structure": None},
    {"note": ""},
]


@pytest.mark.parametrize("changed", [*FIGURES, "course"], ids=str)
def test_an_entry_of_another_shape_is_no_answer(
    changed: dict[str, object] | str, folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    first = checked(folder, NET, capsys)
    (entry,) = (folder / "cache").iterdir()
    data = json.loads(entry.read_text(encoding="utf-8").partition("\n")[2])
    if isinstance(changed, str):
        data["course"] = "explored"
    else:
        data["figures"] |= changed
    text = json.dumps(data)
    entry.write_text(f"{sha256(text.encode()).hexdigest()}\n{text}", encoding="utf-8")
    assert checked(folder, NET, capsys) == first
    assert len(explored) == 2


@pytest.mark.parametrize(
    "options", [["--structure"], ["--discipline", "step", "--structure"], ["--method", "symbolic"]], ids=" ".join
)
def test_figures_of_each_kind_are_read_again(
    options: list[str], folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    first = checked(folder, NET, capsys, *options)
    assert checked(folder, NET, capsys, *options) == first
    assert len(explored) == 1


def test_what_is_unknown_is_asked_again(folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "net.firable.yaml"
    path.write_text(NET, encoding="utf-8")
    arguments = ["check", str(path), "--max-markings", "1", "--method", "explicit"]
    assert main(arguments) == main(arguments) == 3
    assert len(explored) == 2
    assert not (folder / "cache").exists()


def test_a_cache_that_cannot_be_written_is_no_reason_to_fail(
    folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "cache").write_text("a file", encoding="utf-8")
    first = checked(folder, NET, capsys)
    assert checked(folder, NET, capsys) == first
    assert len(explored) == 2


def test_what_has_too_many_markings_to_be_read_again_is_not_kept(folder: Path) -> None:
    Cache(folder / "cache").write("key", Kept((), {"markings": 10**5000}, ()))
    assert not (folder / "cache").exists()


def test_a_structure_that_its_time_cut_short_is_asked_again(
    folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cut = {"ended_early": "time"}
    monkeypatch.setattr("firable.cli.check.structure_json", lambda *_, **__: cut)
    monkeypatch.setattr("firable.cli.check.structure_lines", lambda _: ())
    path = folder / "net.firable.yaml"
    path.write_text(NET, encoding="utf-8")
    for _ in range(2):
        assert main(["check", str(path), "--structure"]) == 0
    assert len(explored) == 2
    assert not (folder / "cache").exists()


def test_what_was_decided_though_it_was_interrupted_is_asked_again(
    folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = importlib.import_module("firable.analysis.check")
    report_on, calls = module.report_on, list[int]()

    def interrupted(*of: Any, **by: Any) -> CheckReport:
        calls.append(len(calls))
        if len(calls) == 1:
            raise KeyboardInterrupt
        report: CheckReport = report_on(*of, **by)
        return report

    monkeypatch.setattr(module, "report_on", interrupted)
    assert '"interrupted"' in checked(folder, NET, capsys, "--method", "symbolic")
    assert '"interrupted"' not in checked(folder, NET, capsys, "--method", "symbolic")
    assert len(explored) == 2


def test_an_exploration_that_was_interrupted_is_not_kept_though_it_decided_all(
    folder: Path, explored: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = importlib.import_module("firable.analysis.check")
    explore = module.explore

    def interrupted(*of: Any, **by: Any) -> ReachabilityGraph:
        return ended(explore(*of, **by))

    with monkeypatch.context() as patch:
        patch.setattr(module, "explore", interrupted)
        assert '"interrupted"' in checked(folder, NET, capsys, "--method", "explicit")
        assert '"interrupted"' in checked(folder, NET, capsys)
    for method in ((), ("--method", "explicit")):
        assert '"interrupted"' not in checked(folder, NET, capsys, *method)
    assert len(explored) == 4
