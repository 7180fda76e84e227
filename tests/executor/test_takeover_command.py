"""`firable takeover`: what it reads and writes, and which files it refuses."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from support.takeovers import OLD, bundle, joint_marking, journal, old_and_new

import firable.cli.takeover as cli_takeover
from firable.cli.main import main
from firable.executor.journal.journal import sync_now
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.links.link import COORDINATOR
from firable.executor.protocol.messages import Keep
from firable.nets.bundle import read_bundle
from firable.nets.diagnostics import InputError


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return old_and_new(tmp_path_factory.mktemp("bundles"))


def test_the_command_writes_a_journal_that_the_new_bundle_opens(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.worked_out", "table.full"})
    content, into = before.read_bytes(), tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 0
    assert "robot.worked_out, table.full" in capsys.readouterr().out
    assert before.read_bytes() == content
    read = read_bundle(new)
    opened = SqliteJournal(into, read.digest, [COORDINATOR, *(s.name for s in read.decomposition.subnets)])
    kept = {s.name: dict(opened.kept(s.name)) for s in read.decomposition.subnets}
    opened.close()
    assert joint_marking(read.decomposition, kept) == {"robot.worked_out", "table.full"}


def test_the_old_bundle_is_not_run_on_beside_the_new_one_and_goes_on_by_a_takeover_back(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = map(str, bundles)
    before = str(journal(tmp_path / "old.journal", bundles[0], {"robot.worked_out", "table.full"}))
    after, again = str(tmp_path / "new.journal"), str(tmp_path / "again.journal")
    assert main(["takeover", old, new, "--journal", before, "--into", after]) == 0
    refused = f"error[F5036]: {before}: the journal was taken over: 'cell' goes on in {after}"
    capsys.readouterr()
    assert main(["takeover", old, new, "--journal", before, "--into", again]) == 2
    assert refused in capsys.readouterr().err
    assert not Path(again).exists()
    assert main(["takeover", new, old, "--journal", after, "--into", again]) == 0
    assert main(["takeover", new, old, "--journal", after, "--into", f"{again}.2"]) == 2
    assert f"'cell' goes on in {again}" in capsys.readouterr().err


def test_a_journal_that_was_moved_away_from_its_mark_is_not_begun_anew(
    bundles: tuple[Path, Path], tmp_path: Path
) -> None:
    before = journal(tmp_path / "old.journal", bundles[0], {"robot.worked_out", "table.full"})
    command = ["takeover", *map(str, bundles), "--journal", str(before), "--into", str(tmp_path / "new.journal")]
    assert main(command) == 0
    for name in ("old.journal", "old.journal.generation"):
        (tmp_path / name).unlink()
    with pytest.raises(InputError, match="F5036"):
        SqliteJournal(before, read_bundle(bundles[0]).digest, (COORDINATOR, "line", "robot", "table"))
    assert not before.exists()


def test_a_journal_that_was_taken_over_is_known_by_every_name(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    digest, machines = read_bundle(bundles[0]).digest, (COORDINATOR, "line", "robot", "table")
    before = journal(tmp_path / "old.journal", bundles[0], {"robot.worked_out", "table.full"})
    link = tmp_path / "link"
    link.symlink_to(before)
    monkeypatch.chdir(tmp_path)
    assert main(["takeover", *map(str, bundles), "--journal", "old.journal", "--into", "new.journal"]) == 0
    Path(f"{link}.generation").symlink_to(f"{before}.generation")
    for name in (before, link):
        with pytest.raises(InputError, match=r"F5036.* goes on in new\.journal\n  hint: run that one"):
            SqliteJournal(name, digest, machines)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=f"'cell' goes on in {tmp_path}/new.journal"):
        SqliteJournal(before, digest, machines)
    (tmp_path / "new.journal").unlink()
    with pytest.raises(
        InputError, match=r"F5032.*it is gone or empty, and new\.journal\.generation beside it tells of"
    ):
        SqliteJournal(tmp_path / "new.journal", read_bundle(bundles[1]).digest, machines)
    assert not (tmp_path / "new.journal").exists(), "to try it makes none"
    with pytest.raises(InputError, match=f"where its journals were brought; .* take away .* {before}.taken-over"):
        SqliteJournal(before, digest, machines)
    Path(f"{before}.taken-over").write_text("by hand")
    with pytest.raises(InputError, match="'another bundle' goes on"):
        SqliteJournal(before, digest, machines)


def test_a_journal_that_is_taken_over_while_it_is_waited_for_is_not_run_on(
    bundles: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = journal(tmp_path / "old.journal", bundles[0], {"robot.worked_out", "table.full"})
    command = ["takeover", *map(str, bundles), "--journal", str(before), "--into", str(tmp_path / "new.journal")]
    connect = sqlite3.connect

    def taken_over(*of: Any, **by: Any) -> sqlite3.Connection:
        monkeypatch.undo()
        assert main(command) == 0
        made: sqlite3.Connection = connect(*of, **by)
        return made

    monkeypatch.setattr(sqlite3, "connect", taken_over)
    with pytest.raises(InputError, match="F5036"):
        SqliteJournal(before, read_bundle(bundles[0]).digest, (COORDINATOR, "line", "robot", "table"))


def test_a_marking_that_the_new_net_never_reaches_is_refused_and_nothing_written(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    before, into = journal(tmp_path / "old.journal", old, {"robot.free", "table.full"}), tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
    said = capsys.readouterr().err
    assert "error[F5051]: 'cell' never comes into the marking robot.free, table.full, so nothing is proved of" in said
    assert "which the old net has not" not in said
    assert not into.exists()


def test_a_place_of_the_new_net_alone_that_begins_with_a_token_is_named_where_its_token_is_missing(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with_light = OLD.replace("start: empty", "start: [empty, light]").replace(
        "      full:\n", "      full:\n      light:\n"
    )
    with_light = with_light.replace("[robot.free, table.empty], to", "[robot.free, table.empty, table.light], to")
    with_light = with_light.replace("to: [robot.free, table.empty]", "to: [robot.free, table.empty, table.light]")
    old, new = bundles[0], bundle(tmp_path, "light", with_light)
    capsys.readouterr()
    before, into = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"}), tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
    said = capsys.readouterr().err
    assert "table.light, which the old net has not, begins with a token and would have none" in said
    assert "a marking that both nets reach: in the new net with no token on table.light; where there is none" in said
    assert not into.exists()
    meanwhile = journal(tmp_path / "later.journal", old, {"robot.worked_out", "table.full"})
    assert main(["takeover", str(old), str(new), "--journal", str(meanwhile), "--into", str(into)]) == 0


def test_files_that_stand_in_the_way_or_are_missing_are_told_of(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    missing, into = tmp_path / "none.journal", tmp_path / "new.journal"
    assert main(["takeover", str(old), str(new), "--journal", str(missing), "--into", str(into)]) == 2
    assert "F1001" in capsys.readouterr().err
    assert not missing.exists(), "a journal is not made by looking for one"
    before = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"})
    into.write_text("precious")
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
    assert "F1017" in capsys.readouterr().err
    assert into.read_text() == "precious"
    into.unlink()
    for end in (".cell", ".generation", "-journal"):
        left = Path(f"{into}{end}")
        left.write_text("precious")
        assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(into)]) == 2
        assert f"error[F1017]: {left}: what an earlier journal of that name has left" in capsys.readouterr().err
        assert left.read_text() == "precious"
        left.unlink()
    assert not into.exists()
    assert main(["takeover", str(new), str(old), "--journal", str(before), "--into", str(into)]) == 2
    assert "F5031" in capsys.readouterr().err


@pytest.mark.parametrize("end", ["", ".cell", ".generation", "-wal"])
def test_no_journal_is_written_where_something_of_the_old_one_belongs(
    end: str, bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = journal(tmp_path / "old.journal", bundles[0], {"robot.free", "table.empty"})
    stood = sorted(tmp_path.iterdir())
    command = ["takeover", *map(str, bundles), "--journal", str(before), "--into", f"{before}{end}"]
    assert main(command) == 2
    assert f"error[F1017]: {before}{end}: --into would overwrite what the command reads" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == stood


def test_nobody_runs_the_old_bundle_on_while_it_is_taken_over(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"})
    names = [COORDINATOR, *(subnet.name for subnet in read_bundle(old).decomposition.subnets)]
    command = ["takeover", str(old), str(new), "--journal", str(before), "--into", str(tmp_path / "new.journal")]
    alive = SqliteJournal(before, read_bundle(old).digest, names)
    assert main(command) == 2
    assert "error[F5033]" in capsys.readouterr().err
    assert not (tmp_path / "new.journal").exists()
    alive.close()
    refused: list[str] = []

    def deciding(*_: object) -> None:
        with pytest.raises(InputError) as caught:
            SqliteJournal(before, read_bundle(old).digest, names)
        refused.append(caught.value.diagnostics[0].code)

    monkeypatch.setattr(cli_takeover, "_demand_reachable", deciding)
    assert main(command) == 0
    assert refused == ["F5033"]


def test_what_a_killed_run_has_left_of_its_journal_is_not_taken_for_the_end_of_the_new_one(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = journal(tmp_path / "whole", bundles[0], {"robot.worked_out", "table.full"})
    new = tmp_path / "new"
    takeover = ["takeover", *map(str, bundles), "--journal", str(whole), "--into", str(new)]
    assert main(takeover) == 0
    names = (COORDINATOR, "line", "robot", "table")
    with closing(SqliteJournal(new, read_bundle(bundles[1]).digest, names)) as running:
        running.write("robot", [Keep("word", "1")])
        sync_now(running)
        left = Path(f"{new}-wal").read_bytes()  # it is killed here
    for file in (new, Path(f"{new}.generation")):
        file.unlink()
    Path(f"{new}-wal").write_bytes(left)
    assert main(takeover) == 2
    assert f"error[F1017]: {new}-wal: what an earlier journal of that name has left" in capsys.readouterr().err
    assert not new.exists()
