"""Queries from the command line, and the examples of docs/queries.md."""

import json
import re
from pathlib import Path

import pytest

from firable.analysis.spaces.reachability import explore
from firable.analysis.verdicts.properties import decide_stated
from firable.cli.main import main
from firable.nets.formula import parse_formula
from firable.nets.text import parse_net
from firable.nets.verdict import Status

PAGE = (Path(__file__).parents[2] / "docs" / "queries.md").read_text("utf-8")


def example(kind: str) -> str:
    (found,) = re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)
    return str(found)


def test_the_net_of_the_page_has_the_properties_that_it_states() -> None:
    space = explore(parse_net(example("yaml")))
    verdicts = [decide_stated(space, of) for of in space.net.properties]
    assert [(verdict.name, verdict.status) for verdict in verdicts] == [
        ("property.again", Status.PROVED),
        ("property.in_turn", Status.PROVED),
        ("property.one", Status.PROVED),
    ]


def test_the_state_formulas_of_the_page_are_formulas() -> None:
    for text in ("p -> q", "not p", "firable(t)", "tokens(a, b, c) <= 2", "tokens(a) + 1 < tokens(b)", '"start"'):
        parse_formula(text)


def report(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, str]]:
    capsys.readouterr()
    code = main(["check", "catalogue:one_robot", "--format", "json", *arguments])
    data = json.loads(capsys.readouterr().out)
    verdicts = data["reports"][0]["verdicts"]
    return code, {v["name"]: v["status"] for v in verdicts if v["name"].startswith("query.")}


def test_queries_are_answered_beside_the_verdicts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FIRABLE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "q").write_text("home: AG EF start\nmost: bound tokens(robot.free)\n", "utf-8")
    asked = ("--queries", str(tmp_path / "q"), "--query", "EF deadlock", "--query", "live")
    found = {"query.home": "proved", "query.most": "proved", "query.query-1": "violated", "query.query-2": "proved"}
    for _ in range(2):  # the second time from the cache
        assert report(capsys, *asked) == (1, found)
    assert report(capsys, "--query", "AG not deadlock") == (0, {"query.query-1": "proved"})


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--query", "AG EF"), "error[F1012]: not a query: the formula ends too early"),
        (("--query", "EF nowhere"), "error[F2002]: there is no place 'nowhere'"),
        (("--queries", "nowhere"), "error[F1001]"),
        (("--queries", "FILE"), "error[F1018]"),
        (("--queries", "NET"), "NET:2:1: error[F1018]: this is a net file, and no file of queries"),
        (("--queries", "SAME", "--query", "live"), "error[F2001]: 'query-1'"),
    ],
)
def test_a_query_that_is_none_is_refused(
    arguments: tuple[str, ...], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "FILE").write_text("AG EF start\n", "utf-8")
    (tmp_path / "SAME").write_text("query-1: AG EF start\n", "utf-8")
    (tmp_path / "NET").write_text("# a cell\nfirable: 1\ncell: other\n", "utf-8")
    placed = [str(tmp_path / one) if one in {"FILE", "SAME", "NET"} else one for one in arguments]
    assert main(["check", "catalogue:one_robot", *placed]) == 2
    assert told in capsys.readouterr().err
