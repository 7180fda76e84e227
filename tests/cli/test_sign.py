"""`firable sign`, and commands that demand a signature."""

import json
from pathlib import Path

import pytest

from firable.cli.main import main


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("signed") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    assert main(["sign", "--make-key", str(path.with_name("ours"))]) == 0
    assert main(["sign", "--make-key", str(path.with_name("theirs"))]) == 0
    return path


def test_a_site_that_demands_a_signature_runs_and_verifies_no_other_bundle(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trusting = ["--trust", f"{bundle.with_name('ours')}.pub"]
    for command in (["run", "--workpieces", "1"], ["verify", "--solver", "z3"]):
        assert main([*command, str(bundle), *trusting]) == 2
        assert "F5023" in capsys.readouterr().err
    assert main(["sign", str(bundle), "--key", str(bundle.with_name("ours"))]) == 0
    for command in (["run", "--workpieces", "1"], ["verify", "--solver", "z3"]):
        assert main([*command, str(bundle), *trusting]) == 0
        capsys.readouterr()
        assert main([*command, str(bundle), "--trust", f"{bundle.with_name('theirs')}.pub"]) == 2
        assert "none of the keys" in capsys.readouterr().err
    assert main(["verify", "--solver", "z3", str(bundle), *trusting, "--format", "json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["reports"][0]["bundle"]["signed_by"]) == 64


def test_what_is_missing_to_sign_is_told(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], [str(bundle)], ["--key", str(bundle.with_name("ours"))]):
        assert main(["sign", *arguments]) == 2
        assert "--make-key" in capsys.readouterr().err
    key = bundle.with_name("new")
    assert main(["sign", str(bundle), "--make-key", str(key)]) == 2
    assert f"--make-key makes a key and signs nothing with it: add `--key {key}`" in capsys.readouterr().err
    assert not key.exists()
    assert main(["verify", str(bundle.with_name("ours")), "--trust", f"{bundle.with_name('ours')}.pub"]) == 2
    assert "documents" in capsys.readouterr().err
