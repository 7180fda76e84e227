"""Which votes stand, as `prove`, `split` and `bundle` say it: of all votes, and never by counting obligations."""

from __future__ import annotations

import json
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from firable.cli.main import main
from firable.cli.votes import Votes, votes_told
from firable.nets.verdict import Status, Verdict, Weight, Witness

FALL = "2 fall, as the markings show, and must promise:"
STANDS = Verdict("persistent.a", Status.PROVED, "", "z3", Weight.INFORMATION, evidence=("persistence.smt2",))
FALLS = Verdict(
    "persistent.b", Status.VIOLATED, "", "", Weight.INFORMATION, subjects=("t",), witness=Witness((("t",),))
)


def told(capsys: pytest.CaptureFixture[str], *command: str) -> str:
    assert main(list(command)) == 0
    return capsys.readouterr().out


@cache
def explored() -> tuple[str, str]:
    """What `prove --protocol` prints of the cell, and its page: it takes seconds, and is the same each time."""
    with TemporaryDirectory() as folder, redirect_stdout(StringIO()) as printed:
        page = Path(folder) / "page.html"
        assert main(["prove", "catalogue:one_robot", "--protocol", "--report", str(page)]) == 0
        return printed.getvalue(), page.read_text("utf-8")


def section(page: str, anchor: str) -> str:
    start = page.index(f'<section id="{anchor}"')
    return page[start : page.index("</section>", start)]


def test_prove_leaves_votes_to_the_markings_only_where_these_are_not_asked(capsys: pytest.CaptureFixture[str]) -> None:
    alone = told(capsys, "prove", "catalogue:one_robot")
    assert "22 of 24 are persistent, by arcs and units: no other transition takes the yes back\n" in alone
    assert "2 are not asked about, for only markings decide them: t1-21, t1-41; --protocol explores them\n" in alone
    assert "need no promise" not in alone
    asked, _ = explored()
    assert "15 of these need no promise" in asked
    assert f"  {FALL}\n  · t1-21: taken back by G6, as after … G5, t2-a, t2-b, G6\n" in asked
    assert "· t1-41: taken back by G2, as after G1, G2\n" in asked
    assert "not asked" not in asked


def test_no_count_of_obligations_passes_for_the_votes() -> None:
    asked, _ = explored()
    assert "23 of 23" not in asked


def test_json_of_prove_holds_a_verdict_on_each_vote_that_the_protocol_rests_on(
    capsys: pytest.CaptureFixture[str],
) -> None:
    report = json.loads(told(capsys, "prove", "catalogue:one_robot", "--protocol", "--format", "json"))["reports"][0]
    votes = {one["name"]: one for one in report["verdicts"] if one["name"].startswith("persistent.")}
    assert len(votes) == sum(len(row["parts"]) for row in report["table"]) == 24
    assert [name for name, one in votes.items() if one["status"] != "proved"] == [
        "persistent.t1-21",
        "persistent.t1-41",
    ]
    assert {one["weight"] for one in votes.values()} == {"information"}


@pytest.mark.parametrize("command", [("prove",), ("split",), ("bundle", "-o", "made.bundle")])
def test_the_page_says_how_many_votes_stand_which_fall_and_by_which_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    if command[0] == "prove":
        _, page = explored()
    else:
        assert main([command[0], "catalogue:one_robot", *command[1:], "--report", "page.html"]) == 0
        page = Path("page.html").read_text("utf-8")
    votes = section(page, "votes")
    assert "22 of 24 are persistent, by arcs and units: no other transition takes the yes back" in votes
    assert "15 of these need no promise" in votes
    assert FALL in votes
    if command[0] == "bundle":
        assert "t1-41: taken back, as persistence.evidence.json shows" in votes
    else:
        assert "t1-41: taken back by G2, as after G1, G2" in votes
        assert votes.count('<table class="strip') == 2, "the run of each"
    assert "23 of 23" not in page
    assert "persistent." not in page.replace(votes, ""), "a vote that falls is no counterexample, and told once"


def test_a_vote_that_is_not_decided_is_neither_said_to_stand_nor_to_fall() -> None:
    open_ = replace(FALLS, status=Status.UNKNOWN, witness=None, bound="no time")
    assert list(votes_told(Votes([STANDS, open_], ["c"]), None)) == [
        "1 of 3 is persistent, by arcs and units: no other transition takes the yes back",
        "? b: not decided (no time); t may take it back",
        "1 is not asked about, for only markings decide it: c; --protocol explores it",
    ]


def test_what_shows_votes_is_told_where_it_differs_and_markings_only_where_they_show_it() -> None:
    by_markings = replace(STANDS, name="persistent.d", evidence=(), method="exploration")
    refuted = replace(FALLS, subjects=(), evidence=STANDS.evidence, witness=Witness(assignment=(("p", True),)))
    assert list(votes_told(Votes([STANDS, by_markings, refuted], []), 0)) == [
        "2 of 3 are persistent, 1 by arcs and units, 1 by the markings: no other transition takes the yes back",
        "none of these may do without the promise, which locks places from the yes to the order",
        "1 falls, and must promise:",
        "· b: not shown to stand",
    ]


def test_a_cell_without_votes_says_nothing_of_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(votes_told(Votes([], []), 0)) == []
    assert "\nvotes\n" not in told(capsys, "prove", "catalogue:conceptual_one_robot")
