"""Names that no file can have, and folders named where a file is wanted: one clear error, and nothing is made."""

from pathlib import Path

import pytest

from firable.cli.main import main
from firable.nets import signing

LONG = "x" * 300
NET = "catalogue:one_robot"


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bundle, the journal of a run of it that has stopped, and a key."""
    folder = tmp_path_factory.mktemp("stopped")
    bundle, journal = str(folder / "cell.bundle"), str(folder / "cell.journal")
    assert main(["bundle", NET, "-o", bundle]) == 0
    assert main(["run", bundle, "--plant", NET, "--speed", "max", "--workpieces", "1", "--journal", journal]) == 0
    signing.make_key(folder / "key")
    return folder


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("sign --make-key .", "F1017"),
        ("sign --make-key /", "F1017"),
        (f"sign --make-key {LONG}", "F1017"),
        (f"sign --make-key {'y' * 253}", "F1017"),
        ("run cell.bundle --plant catalogue:one_robot --journal .", "F5034"),
        ("run cell.bundle --plant catalogue:one_robot --journal ./", "F5034"),
        ("run cell.bundle --plant catalogue:one_robot --journal /", "F5034"),
        (f"run cell.bundle --plant catalogue:one_robot --journal {LONG}", "F5034"),
        (
            f"run cell.bundle --plant catalogue:one_robot --speed 10 --serve 127.0.0.1:0 --token-file {LONG}",
            "F1017",
        ),
        (f"takeover cell.bundle cell.bundle --journal {LONG} --into new.journal", "F1001"),
        ("takeover cell.bundle cell.bundle --journal . --into new.journal", "F1001"),
        (f"takeover cell.bundle cell.bundle --journal cell.journal --into {LONG}", "F1017"),
        ("takeover cell.bundle cell.bundle --journal cell.journal --into .", "F1017"),
    ],
)
def test_a_name_that_cannot_be_that_of_a_file_is_one_clear_error(
    line: str, code: str, stopped: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(stopped)
    before = sorted(stopped.iterdir())
    capsys.readouterr()
    assert main(line.split()) == 2
    said = capsys.readouterr().err
    assert said.count("error[") == 1
    assert f"error[{code}]" in said
    assert sorted(stopped.iterdir()) == before


def test_a_bundle_with_the_longest_name_is_drawn_and_cannot_be_signed(
    stopped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    longest = tmp_path / ("b" * 255)
    longest.write_bytes((stopped / "cell.bundle").read_bytes())
    assert main(["draw", str(longest)]) == 0
    assert main(["sign", str(longest), "--key", str(stopped / "key")]) == 2
    assert "error[F1017]" in capsys.readouterr().err
    assert main(["verify", str(longest), "--trust", str(stopped / "key.pub")]) == 2
    assert "error[F5023]" in capsys.readouterr().err
