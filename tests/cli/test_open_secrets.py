"""Keys and passwords that are no secret: who names them is told, and no bundle is signed by such a key."""

from pathlib import Path

import pytest
from support.certificates import Site

from firable.cli.main import main
from firable.cli.operate import ServeOptions, client_tls

BINDING = """firable_bind: 1
cell: c
devices:
  far: {driver: mqtt, host: 10.1.1.1, user: u, password: secret}
  near: {driver: mqtt, host: localhost, user: u, password: secret}
  encrypted: {driver: mqtt, host: 10.1.1.1, user: u, password: secret, tls: {key: a.key}}
  server: {driver: opcua, url: "opc.tcp://10.1.1.1:4840/", user: u, password: secret}
  nobody: {driver: opcua, url: "opc.tcp://10.1.1.1:4840/other"}
  missing: {driver: mqtt, host: localhost, tls: {ca: none.pem}}
"""


@pytest.mark.parametrize("is_open", [False, True])
def test_passwords_and_keys_of_a_binding_that_others_can_read_are_told(
    is_open: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind, key = tmp_path / "b.bind.yaml", tmp_path / "a.key"
    for file, text in ((bind, BINDING), (key, "a key")):
        file.write_text(text, encoding="utf-8")
        file.chmod(0o644 if is_open else 0o640)
    assert main(["io", str(bind), "--once"]) == 2, "a file is missing"
    told = capsys.readouterr().err
    assert [name for name in ("far", "near", "encrypted", "server") if f"the password of '{name}'" in told] == [
        "far",
        "server",
    ]
    assert "warning[F5027]" in told
    assert (f"warning[F5026]: {key}: everybody on this host can read this key" in told) == is_open
    assert (f"warning[F5026]: {bind}: everybody on this host can read this password" in told) == is_open
    assert "secret" not in told


@pytest.mark.parametrize("mode", [0o644, 0o602, 0o640])
def test_the_key_of_a_certificate_that_others_can_read_is_told(
    mode: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    host = Site(tmp_path / "site").host("host")
    Path(host.key).chmod(mode)
    ServeOptions("127.0.0.1:0", serve_tls=(host.certificate, host.key)).service("cell.bundle")
    client_tls(host.authority, (host.certificate, host.key))
    assert capsys.readouterr().err.count(f"warning[F5026]: {host.key}: everybody") == (0 if mode == 0o640 else 2)


def test_a_key_that_others_can_read_signs_no_bundle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle, key = tmp_path / "cell.bundle", tmp_path / "ours"
    assert main(["bundle", "catalogue:one_robot", "-o", str(bundle)]) == 0
    assert main(["sign", "--make-key", str(key)]) == 0
    key.chmod(0o644)
    assert main(["sign", str(bundle), "--key", str(key)]) == 2
    assert "error[F5026]: everybody on this host can read this key, or change it" in capsys.readouterr().err
    key.chmod(0o600)
    assert main(["sign", str(bundle), "--key", str(key)]) == 0
