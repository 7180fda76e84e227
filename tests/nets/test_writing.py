"""A file is written whole or not at all, and every failure is the one diagnostic F1017."""

import errno
import os
import stat
from pathlib import Path

import pytest

from firable.nets.diagnostics import InputError
from firable.nets.writing import make_folder, write_secret, write_whole


def refused(path: Path | str, data: bytes | str = b"new") -> str:
    with pytest.raises(InputError) as refusal:
        write_whole(path, data)
    (diagnostic,) = refusal.value.diagnostics
    assert diagnostic.code == "F1017"
    assert diagnostic.hint
    return diagnostic.message


def test_a_file_is_written_and_replaced(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for data in (b"one\r\n", b"", b"three\0"):
        write_whole(path, data)
        assert path.read_bytes() == data
    write_whole(str(path), "é\n")
    assert path.read_bytes() == b"\xc3\xa9\n"
    assert [found.name for found in tmp_path.iterdir()] == ["file"]


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "other").touch()
    write_whole(tmp_path / "file", b"")
    assert (tmp_path / "file").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_what_replaces_a_private_file_is_never_open_to_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    modes: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: modes.append(stat.S_IMODE(os.fstat(descriptor).st_mode)))
    for mode in (0o600, 0o640, 0o444):
        path = tmp_path / f"{mode:o}"
        path.write_text("old")
        path.chmod(mode)
        write_whole(path, "new")
        assert stat.S_IMODE(path.stat().st_mode) == mode
    assert modes == [0o600] * 3


@pytest.mark.parametrize("name", ["", ".", "..", "/", "folder", "folder/", "new/", "none/file", "file/x", "a\0b"])
def test_what_names_no_file_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"old")
    assert refused(name)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "folder"]
    assert (tmp_path / "file").read_bytes() == b"old"


def test_a_name_that_is_too_long_is_refused_and_one_that_just_fits_is_written(tmp_path: Path) -> None:
    assert "too long" in refused(tmp_path / ("x" * 256))
    write_whole(tmp_path / ("x" * 255), b"")
    write_whole(tmp_path / ("é" * 127), b"")


def test_a_text_that_is_no_unicode_is_refused(tmp_path: Path) -> None:
    assert refused(tmp_path / "file", "\ud800")
    assert list(tmp_path.iterdir()) == []


def test_a_pipe_is_refused_and_stays_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert "not a regular file" in refused(tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder" / "file")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "folder" / "file").read_bytes() == b"new"


@pytest.mark.parametrize("ending", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_end_before_the_rename_leaves_the_old_file_and_no_litter(
    ending: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(fd: int) -> None:
        raise ending

    (tmp_path / "file").write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", ended)
    with pytest.raises(KeyboardInterrupt if isinstance(ending, KeyboardInterrupt) else InputError):
        write_whole(tmp_path / "file", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_bytes() == b"old"


def test_a_folder_is_made_with_those_around_it_or_refused(tmp_path: Path) -> None:
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "x", tmp_path / "a\0b"):
        with pytest.raises(InputError, match="F1017"):
            make_folder(path)


def test_a_secret_is_a_new_file_of_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    write_secret(path, b"mine")
    assert (path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (b"mine", 0o600)
    with pytest.raises(InputError, match=r"F1017.*File exists"):
        write_secret(path, b"other")
    assert path.read_bytes() == b"mine"


def test_a_disk_without_room_is_told_as_one_and_keeps_no_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def sync(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", sync)
    for write in (write_whole, write_secret):
        with pytest.raises(InputError, match="No space left") as refusal:
            write(tmp_path / "file", b"data")
        assert refusal.value.diagnostics[0].hint == "make room on its disk"
        assert not list(tmp_path.iterdir())
