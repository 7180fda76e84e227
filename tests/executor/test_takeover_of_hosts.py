"""A cell on several hosts is taken over whole or not at all, and each machine stays where it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing, nullcontext
from pathlib import Path

import pytest
from support.takeovers import OLD, bundle, joint_marking, journal, old_and_new

from firable.cli.main import main
from firable.executor.journal.journal import sync_now
from firable.executor.journal.memory import HOSTS, remembered
from firable.executor.journal.sqlite_journal import SqliteJournal, machines_of
from firable.executor.links.link import COORDINATOR
from firable.executor.links.storages import Memory, Met, Storage
from firable.executor.operating.acquaintances import Acquaintances
from firable.executor.operating.dispatch import TAKEN
from firable.executor.protocol.messages import Keep, Stored
from firable.nets.bundle import read_bundle
from firable.nets.diagnostics import InputError
from firable.nets.writing import write_whole


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return old_and_new(tmp_path_factory.mktemp("bundles"))


HOSTS_OF_OLD = {"system": (COORDINATOR, "line"), "robot": ("robot",), "table": ("table",)}


def hosts(bundles: tuple[Path, Path], folder: Path, *without: str) -> list[str]:
    """The options of a takeover on several hosts, at the end of the robot's work."""
    options = []
    for name, machines in HOSTS_OF_OLD.items():
        if name not in without:
            at = journal(folder / f"{name}.old", bundles[0], {"robot.worked_out", "table.full"}, machines)
            options += ["--journal", str(at), "--into", str(folder / f"{name}.new")]
    return options


def test_a_cell_on_several_hosts_is_taken_over_together_and_its_hosts_know_each_other(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["takeover", *map(str, bundles), *hosts(bundles, tmp_path)]) == 0
    told = capsys.readouterr().out
    assert f"  next: firable run {bundles[1]} --controller robot --journal {tmp_path / 'robot.new'}, with" in told
    old = tmp_path / "robot.old"
    assert f"  {old} is not run on any more: {old}.taken-over beside it says so; bring that back to its host" in told
    read = read_bundle(bundles[1])
    kept, memories = dict[str, Mapping[str, Stored]](), dict[str, Memory]()
    for name, machines in HOSTS_OF_OLD.items():
        with closing(SqliteJournal(tmp_path / f"{name}.new", read.digest, machines)) as opened:
            kept |= {machine: opened.kept(machine) for machine in machines}
            memories[name] = remembered(opened.kept(HOSTS), opened.age)
    assert joint_marking(read.decomposition, kept) == {"robot.worked_out", "table.full"}
    storages = {
        machine: Met(memories[name].storage.name) for name, machines in HOSTS_OF_OLD.items() for machine in machines
    }
    assert len(set(storages.values())) == len(HOSTS_OF_OLD)
    for name, machines in HOSTS_OF_OLD.items():
        assert memories[name].known == {of: storage for of, storage in storages.items() if of not in machines}


def test_of_several_hosts_one_with_an_older_copy_of_its_journal_is_not_taken_over(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options, digest = hosts(bundles, tmp_path), read_bundle(bundles[0]).digest

    def remembers(name: str, age: int) -> None:
        """The journal of the line was let in by the robot's, which has heard of it at this age since."""
        with closing(SqliteJournal(tmp_path / "system.old", digest, HOSTS_OF_OLD["system"])) as of_line:
            line = Acquaintances(of_line, is_linked=True)
            line.met("robot", Storage(name))
            line.write()
            sync_now(of_line)
            with closing(SqliteJournal(tmp_path / "robot.old", digest, HOSTS_OF_OLD["robot"])) as of_robot:
                robot = Acquaintances(of_robot, is_linked=True)
                robot.met("line", line.storage)
                robot.heard("line", of_line.age + age)
                robot.write()
                sync_now(of_robot)
                name = robot.storage.name
            line.known["robot"] = Met(name)
            line.write()
            sync_now(of_line)

    remembers("", 7)
    assert main(["takeover", *map(str, bundles), *options]) == 2
    told = capsys.readouterr().err
    older = f"{tmp_path}/system.old: the journal is an older copy: it does not hold what {tmp_path}/robot.old knows of"
    assert f"error[F5050]: {older} 'line'" in told
    assert not list(tmp_path.glob("*.new*"))
    remembers("", 1)
    assert main(["takeover", *map(str, bundles), *options]) == 0


def test_a_takeover_of_several_hosts_that_fails_leaves_none_of_its_journals(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = hosts(bundles, tmp_path)
    last = options[-1]
    options[-1] = str(tmp_path / "no folder" / "table.new")
    assert main(["takeover", *map(str, bundles), *options]) == 2
    assert "error[F1017]: " in capsys.readouterr().err
    assert not list(tmp_path.glob("*.new*"))
    assert main(["takeover", *map(str, bundles), *options[:-1], last]) == 0


def test_what_a_machine_has_taken_is_taken_over(bundles: tuple[Path, Path], tmp_path: Path) -> None:
    options = hosts(bundles, tmp_path)
    with closing(SqliteJournal(tmp_path / "robot.old", read_bundle(bundles[0]).digest, ("robot",))) as of_robot:
        of_robot.write(TAKEN, [Keep("robot.working", 3)])
        sync_now(of_robot)
    assert main(["takeover", *map(str, bundles), *options]) == 0
    with closing(SqliteJournal(tmp_path / "robot.new", read_bundle(bundles[1]).digest, ("robot",))) as of_robot:
        assert of_robot.kept(TAKEN) == {"robot.working": 3}


def test_a_marking_is_taken_over_whole_from_one_journal_for_each_machine(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    takeover = ["takeover", *map(str, bundles)]
    assert main([*takeover, *hosts(bundles, tmp_path, "table")]) == 2
    told = capsys.readouterr().err
    assert told.count("error[") == 1
    assert "error[F5050]: none of the journals is of 'table'" in told
    again = journal(tmp_path / "again.old", bundles[0], {"robot.free"}, ("robot",))
    twice = ["--journal", str(again), "--into", str(tmp_path / "again.new")]
    assert main([*takeover, *hosts(bundles, tmp_path), *twice]) == 2
    assert "error[F5050]: 'robot' is in 2 journals: " in capsys.readouterr().err
    assert main([*takeover, *hosts(bundles, tmp_path), "--journal", str(again)]) == 2
    assert "name a file --into for each --journal" in capsys.readouterr().err
    same = hosts(bundles, tmp_path)
    same[-1] = same[-5]
    assert main([*takeover, *same]) == 2
    assert "--into would overwrite what another --into writes" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.new*"))


def test_a_journal_is_named_once_however_it_is_spelled(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    takeover = ["takeover", *map(str, bundles)]
    whole = str(journal(tmp_path / "whole", bundles[0], {"robot.worked_out", "table.full"}))
    assert (
        main([*takeover, "--journal", whole, "--into", f"{whole}.1", "--journal", whole, "--into", f"{whole}.2"]) == 2
    )
    assert "error[F5050]: " in (said := capsys.readouterr().err)
    assert "the journal is named twice" in said
    same = hosts(bundles, tmp_path)
    (tmp_path / "folder").mkdir()
    same[-1] = str(tmp_path / "folder" / ".." / "robot.new")
    assert main([*takeover, *same]) == 2
    assert "--into would overwrite what another --into writes" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.new*"))


def coordinators_of(bundles: tuple[Path, Path], folder: Path) -> dict[str, tuple[str, ...]]:
    """The machines of the journals of the hosts of the new cell, as a run of each opens them."""
    read = read_bundle(bundles[1])
    found = {}
    for name in HOSTS_OF_OLD:
        machines = machines_of(folder / f"{name}.new")
        with closing(SqliteJournal(folder / f"{name}.new", read.digest, machines)):
            found[name] = machines
    return found


def test_the_coordinator_goes_to_the_host_where_the_new_net_has_it(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = OLD.replace("line: {coordinator: true, places: {}}", "line: {places: {}}")
    other = other.replace("  robot:\n", "  robot:\n    coordinator: true\n")
    new = (bundles[0], bundle(tmp_path, "other", other))
    assert main(["takeover", *map(str, new), *hosts(new, tmp_path)]) == 0
    assert coordinators_of(new, tmp_path) == {"system": ("line",), "robot": ("", "robot"), "table": ("table",)}
    assert "--coordinator" not in capsys.readouterr().out
    folder = tmp_path / "nobody"
    folder.mkdir()
    nobody = (bundles[0], bundle(folder, "nobody", OLD.replace("line: {coordinator: true, ", "line: {")))
    assert main(["takeover", *map(str, nobody), *hosts(nobody, folder)]) == 0
    assert coordinators_of(nobody, folder) == {"system": ("", "line"), "robot": ("robot",), "table": ("table",)}
    told = capsys.readouterr().out
    assert f"firable run {nobody[1]} --controller line --coordinator --journal {folder / 'system.new'}, with" in told
    assert f"firable run {nobody[1]} --controller robot --journal {folder / 'robot.new'}, with" in told


def test_a_controller_that_only_the_new_net_has_needs_a_host(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = OLD.replace("transitions:", "  lamp: {start: dark, places: {dark: , lit: }}\ntransitions:")
    more += "  light: {from: lamp.dark, to: lamp.lit}\n  darken: {from: lamp.lit, to: lamp.dark}\n"
    new = bundle(tmp_path, "more", more)
    assert main(["takeover", str(bundles[0]), str(new), *hosts(bundles, tmp_path)]) == 2
    assert "error[F5050]: no host runs 'lamp', which only the new net has" in capsys.readouterr().err


def test_a_host_of_which_the_new_net_has_nothing_has_no_journal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = bundle(tmp_path, "old", OLD.replace("  table:\n", "  spare: {places: {}}\n  table:\n"))
    new = bundle(tmp_path, "new", OLD)
    of_spare = journal(tmp_path / "spare.old", old, set(), ("spare",))
    options = [*hosts((old, new), tmp_path), "--journal", str(of_spare), "--into", str(tmp_path / "spare.new")]
    assert main(["takeover", str(old), str(new), *options]) == 0
    assert "spare.new is not written: 'cell' has none of the machines of that host" in capsys.readouterr().out
    assert (tmp_path / "robot.new").exists()
    assert not (tmp_path / "spare.new").exists()
    with pytest.raises(InputError, match="was taken over: 'cell' goes on\\n"):
        SqliteJournal(of_spare, read_bundle(old).digest, ("spare",))


def breaking(left: int) -> Callable[[Path | str, bytes | str], None]:
    """What writes so many files whole, and is interrupted at the next."""
    written: list[Path | str] = []

    def write(path: Path | str, data: bytes | str) -> None:
        if len(written) == left:
            raise KeyboardInterrupt
        written.append(path)
        write_whole(path, data)

    return write


@pytest.mark.parametrize("at", range(9))
def test_a_takeover_that_breaks_off_leaves_no_journal_that_begins_anew(
    bundles: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    monkeypatch.setattr("firable.nets.writing.write_whole", breaking(at))
    assert main(["takeover", *map(str, bundles), *hosts(bundles, tmp_path)]) == 3
    for name, machines in HOSTS_OF_OLD.items():
        new = tmp_path / f"{name}.new"
        if new.exists():
            with closing(SqliteJournal(new, read_bundle(bundles[1]).digest, machines)) as opened:
                assert all(opened.kept(machine) for machine in machines)
        elif Path(f"{new}.generation").exists():
            with pytest.raises(InputError, match="F5032"):
                SqliteJournal(new, read_bundle(bundles[1]).digest, machines)
        assert not Path(f"{tmp_path / name}.old.taken-over").exists()


@pytest.mark.parametrize("at", range(9))
def test_a_takeover_that_is_killed_lets_no_host_begin_anew_beside_one_that_goes_on(
    bundles: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    monkeypatch.setattr("firable.cli.takeover._removed_if_it_fails", lambda *_: nullcontext())
    monkeypatch.setattr("firable.nets.writing.write_whole", breaking(at))
    assert main(["takeover", *map(str, bundles), *hosts(bundles, tmp_path)]) == 3
    journals = [tmp_path / f"{name}.new" for name in HOSTS_OF_OLD]
    goes_on = any(new.exists() for new in journals)
    assert goes_on is (at > 2 * len(journals))
    if at > len(journals):  # the old bundle is not run on where the new one might be
        with pytest.raises(InputError, match="F5036"):
            SqliteJournal(tmp_path / "system.old", read_bundle(bundles[0]).digest, HOSTS_OF_OLD["system"])
    for name, machines in HOSTS_OF_OLD.items() if goes_on else ():
        with pytest.raises(InputError, match="F5036"):
            SqliteJournal(tmp_path / f"{name}.old", read_bundle(bundles[0]).digest, machines)
    for new, machines in zip(journals, HOSTS_OF_OLD.values(), strict=True):
        if at >= len(journals) and not new.exists():
            with pytest.raises(InputError, match="F5032"):
                SqliteJournal(new, read_bundle(bundles[1]).digest, machines)
