"""Journals: what is written is there after a crash, all of a group or nothing, and nothing else is taken for it."""

import errno
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.executor.journal import sqlite_journal
from firable.executor.journal.journal import Journal, MemoryJournal, sync_now
from firable.executor.journal.sqlite_journal import FORMAT, SqliteJournal, machines_of, mark_of, mark_text
from firable.executor.protocol.messages import Firing, Keep, Stored
from firable.nets.diagnostics import InputError

MACHINES = ("a", "b")
Opener = Callable[[], Journal]


def sqlite(folder: Path, digest: str = "d1", machines: tuple[str, ...] = MACHINES) -> SqliteJournal:
    return SqliteJournal(folder / "cell.journal", digest, machines)


def crashed(journal: SqliteJournal, to: Path) -> Path:
    """What a process that is killed now leaves behind."""
    to.mkdir(exist_ok=True)
    for path in journal.path.parent.iterdir():
        if path.is_file():
            shutil.copy(path, to)
    return to


def refused(open_: Callable[[], object]) -> tuple[str, str]:
    with pytest.raises(InputError) as caught:
        open_()
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.hint
    return diagnostic.code, diagnostic.message


def filled(folder: Path) -> SqliteJournal:
    journal = sqlite(folder)
    for i in range(30):
        journal.write("a", [Keep("word", f"{i:x}"), Firing("t"), Keep(f"promise/{i}", ["G", "H"])])
        journal.write("b", [Keep("word", f"{-i:x}"), Keep(f"promise/{i - 3}", None)])
        journal.write("a", [Keep(f"promise/{i - 3}", None)])
        sync_now(journal)
    return journal


@pytest.fixture(params=["memory", "sqlite"])
def opener(request: pytest.FixtureRequest, tmp_path: Path) -> Opener:
    memory = MemoryJournal()
    return lambda: memory if request.param == "memory" else sqlite(tmp_path)


WRITES = st.lists(
    st.tuples(
        st.sampled_from(MACHINES),
        st.sampled_from(["word", "closed", "promise/1", "\0ü"]),
        st.none() | st.integers(-(2**70), 2**70) | st.text(max_size=5) | st.lists(st.integers(), max_size=3),
    ),
    max_size=8,
)


@examples(20)
@given(st.lists(WRITES, max_size=6))
@pytest.mark.parametrize("kind", ["memory", "sqlite"])
def test_what_is_synced_is_kept_as_a_dictionary_would(
    kind: str, tmp_path_factory: pytest.TempPathFactory, groups: list[list[tuple[str, str, Stored | None]]]
) -> None:
    folder = tmp_path_factory.mktemp("journal")
    journal: Journal = MemoryJournal() if kind == "memory" else sqlite(folder)
    expected: dict[str, dict[str, Stored]] = {machine: {} for machine in MACHINES}
    for group in groups:
        for machine, key, value in group:
            journal.write(machine, [Keep(key, value)])
            expected[machine].pop(key, None)
            if value is not None:
                expected[machine][key] = value
        sync_now(journal)
    assert {machine: journal.kept(machine) for machine in MACHINES} == expected
    journal.close()
    again = journal if kind == "memory" else sqlite(folder)
    assert {machine: again.kept(machine) for machine in MACHINES} == expected
    again.close()


def test_a_journal_is_as_old_as_what_is_durable_of_it_and_older_with_each_sync(tmp_path: Path) -> None:
    """Else a host would tell of what a crash may still take, and be refused by whom it has told."""
    journal = sqlite(tmp_path)
    assert journal.age == 0
    journal.write("a", [Keep("word", "1")])
    storing = journal.sync()
    assert storing is not None
    assert journal.age == 0
    before = sqlite(crashed(journal, tmp_path / "before"))
    assert (before.age, before.kept("a")) == (0, {})
    storing()
    assert journal.age == 1
    assert sqlite(crashed(journal, tmp_path / "after")).age == 1
    sync_now(journal)
    assert journal.age == 1, "nothing was written"
    journal.write("b", [Keep("word", "1")])
    sync_now(journal)
    assert journal.age == 2
    journal.connection.close()
    journal.write("b", [Keep("word", "2")])
    assert refused(lambda: sync_now(journal))[0] in {"F5032", "F5034"}
    assert journal.age == 2


def test_fresh_journal_has_kept_nothing(opener: Opener) -> None:
    assert opener().kept("a") == {}


def test_group_that_is_not_synced_is_lost_whole_and_the_groups_before_are_there(tmp_path: Path) -> None:
    journal = filled(tmp_path)
    before = {machine: journal.kept(machine) for machine in MACHINES}
    journal.write("a", [Keep("word", "lost"), Keep("new", 1)])
    journal.write("b", [Keep("word", "lost")])
    again = sqlite(crashed(journal, tmp_path / "left"))
    assert {machine: again.kept(machine) for machine in MACHINES} == before


def test_journal_of_another_bundle_is_refused(tmp_path: Path) -> None:
    filled(tmp_path).close()
    assert refused(lambda: sqlite(tmp_path, "d2")) == (
        "F5031",
        f"{tmp_path}/cell.journal: the journal is of the bundle d1, and this one is d2",
    )


def test_of_the_journal_of_another_bundle_it_is_told_that_it_may_be_taken_over(tmp_path: Path) -> None:
    filled(tmp_path).close()
    with pytest.raises(InputError) as error:
        sqlite(tmp_path, "d2")
    assert error.value.diagnostics[0].hint.endswith(
        "`firable takeover` lets a new bundle go on where that one has stopped"
    )
    with pytest.raises(InputError) as error:
        sqlite(tmp_path, machines=("a", "c"))
    assert "takeover" not in error.value.diagnostics[0].hint


def test_journal_of_other_machines_is_refused(tmp_path: Path) -> None:
    filled(tmp_path).close()
    code, message = refused(lambda: sqlite(tmp_path, machines=("a", "c")))
    assert code == "F5031"
    assert message == f"{tmp_path}/cell.journal: the journal is of 'a', 'b', and not of 'a', 'c'"


def test_journal_that_was_copied_without_what_belongs_to_it_is_refused_and_not_begun_anew(tmp_path: Path) -> None:
    journal = filled(tmp_path)  # open as long as it is copied
    (tmp_path / "copy").mkdir()
    shutil.copy(tmp_path / "cell.journal", tmp_path / "copy/cell.journal")
    reads = (lambda: machines_of(tmp_path / "copy/cell.journal"), lambda: sqlite(tmp_path / "copy"))
    for read in (*reads, *reads):  # no reading leaves anything behind that the next one would take for a journal
        with pytest.raises(InputError) as caught:
            read()
        (problem,) = caught.value.diagnostics
        assert problem.code == "F5032"
        assert problem.message.endswith("nothing stands in it")
        expected = "where it was copied without cell.journal-wal and cell.journal.generation, copy these, too; else"
        assert problem.hint.startswith(expected)
    journal.close()


def test_journal_whose_process_was_killed_while_it_was_made_is_begun_again(tmp_path: Path) -> None:
    """First there is the witness, empty, then the file, then what stands in it, and then a number in the witness."""
    (tmp_path / "cell.journal.generation").touch()
    with closing(sqlite3.connect(tmp_path / "cell.journal")) as connection:
        connection.execute("pragma journal_mode = wal")
    assert (tmp_path / "cell.journal").stat().st_size > 0
    sqlite(tmp_path).close()
    (tmp_path / "cell.journal.generation").write_text("")
    filled(tmp_path).close()
    assert sqlite(tmp_path).kept("a") != {}


def test_journal_that_lost_its_log_is_not_begun_again_where_a_power_cut_has_set_its_witness_back(
    tmp_path: Path,
) -> None:
    """Only the first number of it is synced."""
    journal = filled(tmp_path)
    (tmp_path / "copy").mkdir()
    shutil.copy(tmp_path / "cell.journal", tmp_path / "copy/cell.journal")
    (tmp_path / "copy/cell.journal.generation").write_text(f"{0:020}\n")
    code, message = refused(lambda: sqlite(tmp_path / "copy"))
    assert code == "F5032"
    assert message.endswith("it is gone or empty, and cell.journal.generation beside it tells of one")
    journal.close()


def test_journal_of_which_nothing_was_stored_yet_has_its_witness_or_is_refused(tmp_path: Path) -> None:
    sqlite(tmp_path).close()  # which puts all into the one file
    assert (tmp_path / "cell.journal.generation").read_text() == f"{0:020}\n"
    (tmp_path / "cell.journal.generation").unlink()
    code, message = refused(lambda: sqlite(tmp_path))
    assert code == "F5032"
    assert message.endswith("cell.journal.generation beside it is missing or empty")


@pytest.mark.parametrize("its_format", [FORMAT - 1, FORMAT + 1])
def test_journal_of_another_format_is_ended_by_the_firable_that_wrote_it(tmp_path: Path, its_format: int) -> None:
    journal = filled(tmp_path)
    journal.connection.execute("update header set format = ?", (its_format,))
    journal.close()
    says = f"F5031.*has format {its_format}, and this firable writes {FORMAT}"
    with pytest.raises(InputError, match=says) as refusal:
        sqlite(tmp_path)
    hint = refusal.value.diagnostics[0].hint
    assert hint.startswith("end its run with the firable that has written it, with the machines at the initial marking")
    assert "bundle" not in hint, "the right one would be refused as well"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("update kept set value = '\"1c\"' where machine = 'a' and key = 'word'", "what 'a' kept under 'word'"),
        ("update kept set value = x'00' where machine = 'a' and key = 'word'", "what 'a' kept under 'word'"),
        ("delete from kept where machine = 'a' and key = 'word'", "rows are missing"),
        ("delete from header", "its header is missing"),
        ("drop table kept", "no such table"),
        ("update header set generation = 12", "it is at sync 12, and 30 were done"),
    ],
)
def test_change_of_a_row_by_another_program_is_noticed(tmp_path: Path, change: str, says: str) -> None:
    journal = filled(tmp_path)
    journal.connection.execute(change)
    journal.close()
    code, message = refused(lambda: sqlite(tmp_path))
    assert code == "F5032"
    assert says in message


def opened_or_refused(folder: Path) -> dict[str, object] | None:
    try:
        journal = sqlite(folder)
    except InputError as error:
        if error.diagnostics[0].code not in {"F5031", "F5032"}:
            raise
        return None
    kept = {machine: journal.kept(machine) for machine in MACHINES}
    journal.close()
    return dict(kept)


@pytest.mark.parametrize("name", ["cell.journal", "cell.journal-wal", "cell.journal.generation"])
def test_flipped_byte_is_refused_or_changes_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / "made").mkdir()
    journal = filled(tmp_path / "made")
    if name == "cell.journal":
        journal.connection.execute("pragma wal_checkpoint(truncate)")
    left = crashed(journal, tmp_path / "left")
    expected = {machine: journal.kept(machine) for machine in MACHINES}
    data = (left / name).read_bytes()
    refusals = 0
    for at in range(0, len(data), max(1, len(data) // 150)):
        damaged = tmp_path / "damaged"
        shutil.copytree(left, damaged)
        (damaged / name).write_bytes(data[:at] + bytes([data[at] ^ 0x41]) + data[at + 1 :])
        opened = opened_or_refused(damaged)
        assert opened in (None, expected)
        refusals += opened is None
        shutil.rmtree(damaged)
    assert refusals > 0


@pytest.mark.parametrize("name", ["cell.journal", "cell.journal-wal", "cell.journal.generation"])
def test_truncated_file_is_refused_or_changes_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / "made").mkdir()
    journal = filled(tmp_path / "made")
    if name == "cell.journal":
        journal.connection.execute("pragma wal_checkpoint(truncate)")
    left = crashed(journal, tmp_path / "left")
    expected = {machine: journal.kept(machine) for machine in MACHINES}
    data = (left / name).read_bytes()
    refusals = 0
    for length in {0, 1, *range(0, len(data), max(1, len(data) // 30)), len(data) - 1}:
        damaged = tmp_path / "damaged"
        shutil.copytree(left, damaged)
        (damaged / name).write_bytes(data[:length])
        opened = opened_or_refused(damaged)
        assert opened in (None, expected), length
        refusals += opened is None
        shutil.rmtree(damaged)
    assert refusals > (0 if name.endswith("generation") else 20)


def test_file_that_is_no_journal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cell.journal").write_text("dear diary, " * 1000)
    assert refused(lambda: sqlite(tmp_path)) == (
        "F5032",
        f"{tmp_path}/cell.journal: the journal is damaged: file is not a database",
    )


def test_damaged_journal_names_the_files_that_belong_to_it(tmp_path: Path) -> None:
    (tmp_path / "cell.journal").write_text("dear diary, " * 1000)
    with pytest.raises(InputError) as caught:
        sqlite(tmp_path)
    files = "cell.journal, cell.journal-wal, cell.journal.generation and cell.journal.cell"
    assert f"move {files} away" in caught.value.diagnostics[0].hint
    assert caught.value.diagnostics[0].hint.startswith(
        "where cell.journal was never a journal, name the one that is; else "
    )


def test_folder_that_is_not_there_is_told_in_the_words_of_the_system(tmp_path: Path) -> None:
    assert refused(lambda: sqlite(tmp_path / "no")) == (
        "F5034",
        f"{tmp_path}/no/cell.journal: the journal cannot be opened: No such file or directory",
    )


def test_path_with_a_nul_is_refused(tmp_path: Path) -> None:
    code, message = refused(lambda: sqlite(tmp_path / "a\0b"))
    assert code in {"F5032", "F5034"}
    assert "\0" not in message


def test_file_that_is_a_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cell.journal").mkdir()
    code, message = refused(lambda: sqlite(tmp_path))
    assert code == "F5034"
    assert "Is a directory" in message


@pytest.mark.parametrize("name", ["SQLITE_IOERR_SHMOPEN", "SQLITE_READONLY_DIRECTORY", "SQLITE_CANTOPEN"])
def test_a_disk_that_may_only_be_read_is_told_in_the_words_of_the_system(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite says "disk I/O error" of it."""

    def connect(*_: object, **__: object) -> None:
        error = sqlite3.OperationalError("disk I/O error")
        error.sqlite_errorname = name
        raise error

    def only_to_be_read(*_: object) -> int:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(sqlite3, "connect", connect)
    monkeypatch.setattr(os, "open", only_to_be_read)
    with pytest.raises(InputError, match="the journal cannot be opened: Read-only file system"):
        SqliteJournal(tmp_path / "journal", "", ["a"])


def test_write_that_fails_ends_the_journal(tmp_path: Path) -> None:
    journal = filled(tmp_path)
    journal.connection.execute("pragma max_page_count = 1")
    journal.write("a", [Keep("word", "x" * 100_000)])
    with pytest.raises(InputError) as caught:
        sync_now(journal)
    (found,) = caught.value.diagnostics
    code, message = found.code, found.message
    assert code == "F5034"
    assert "full" in message
    assert "make room on its disk" in found.hint
    assert "folder" not in found.hint, "in another one the run would begin anew, beside machines in the middle of it"
    journal.connection.execute("pragma max_page_count = 100000")
    assert refused(lambda: sync_now(journal)) == (code, message)  # not tried again: nobody knows what is stored
    left = sqlite(crashed(journal, tmp_path / "left"))
    assert left.kept("a")["word"] == "1d"


def test_journal_without_the_file_beside_it_is_refused(tmp_path: Path) -> None:
    filled(tmp_path).close()
    (tmp_path / "cell.journal.generation").unlink()
    with pytest.raises(InputError) as caught:
        sqlite(tmp_path)
    (problem,) = caught.value.diagnostics
    assert problem.code == "F5032"
    assert problem.message.endswith("cell.journal.generation beside it is missing or empty")
    assert problem.hint.startswith(
        "where it was copied without cell.journal-wal and cell.journal.generation, copy these"
    )


def test_a_journal_that_is_gone_while_the_file_beside_it_is_there_is_refused_in_these_words(tmp_path: Path) -> None:
    filled(tmp_path).close()
    (tmp_path / "cell.journal").unlink()
    for _ in range(2):  # the refusal leaves nothing behind that a second start would take for a journal
        code, message = refused(lambda: sqlite(tmp_path))
        assert code == "F5032"
        assert message.endswith("it is gone or empty, and cell.journal.generation beside it tells of one")


HOLDER = """
import sys, time
from firable.executor.journal.journal import sync_now
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.protocol.messages import Keep
journal = SqliteJournal(sys.argv[1], "d1", ("a", "b"))
journal.write("a", [Keep("word", "7")])
sync_now(journal)
journal.write("a", [Keep("word", "8")])
print("open", flush=True)
time.sleep(60)
"""


def test_journal_is_locked_by_its_process_until_that_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "cell.journal")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        try:
            assert holder.stdout is not None
            assert holder.stdout.readline() == "open\n"
            assert refused(lambda: sqlite(tmp_path)) == (
                "F5033",
                f"{tmp_path}/cell.journal: the journal is in use by another process",
            )
        finally:
            os.kill(holder.pid, signal.SIGKILL)
    assert sqlite(tmp_path).kept("a") == {"word": "7"}


def test_a_journal_that_another_process_makes_meanwhile_is_in_use_and_not_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[SqliteJournal] = []
    told = sqlite_journal._durable

    def makes(path: Path) -> str | None:
        if not made:
            monkeypatch.undo()
            made.append(SqliteJournal(tmp_path / "cell.journal", "d1", ("a",)))
            made[0].write("a", [Keep("epoch", 1)])
            sync_now(made[0])
        return told(path)

    monkeypatch.setattr(sqlite_journal, "_durable", makes)
    with pytest.raises(InputError, match="F5033"):
        SqliteJournal(tmp_path / "cell.journal", "d1", ("a",))
    made[0].close()


def test_a_journal_that_was_taken_over_into_what_cannot_be_looked_at_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "cell.journal").touch()
    mark_of(tmp_path / "cell.journal").write_text(mark_text("cell", tmp_path / ("n" * 300), [tmp_path / ("n" * 300)]))
    with pytest.raises(
        InputError, match=r"F5036.*'cell' goes on in .*\n  hint: run it where its journals were brought"
    ):
        SqliteJournal(tmp_path / "cell.journal", "d1", ("a",))
