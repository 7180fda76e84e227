"""Signatures of bundles: what a site that demands one refuses."""

import errno
import json
import os
import stat
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from firable.decompose import split
from firable.nets.bundle import Bundle, read_bundle, write_bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.signing import demand_signature, make_key, sign, signatures_path


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """A bundle, and two keys beside it; what it proves is not asked here."""
    path = tmp_path / "cell.bundle"
    write_bundle(path, Bundle(split(catalogue_net("one_robot")), ()))
    make_key(tmp_path / "ours")
    make_key(tmp_path / "theirs")
    return path


def refused(path: Path, *trusted: str) -> str:
    with pytest.raises(InputError) as refusal:
        demand_signature(read_bundle(path), path, [path.with_name(name) for name in trusted])
    return str(refusal.value)


def test_a_signed_bundle_is_trusted_by_who_trusts_the_key(bundle: Path) -> None:
    name = sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    trusted = [bundle.with_name("theirs.pub"), bundle.with_name("ours.pub")]
    assert demand_signature(read_bundle(bundle), bundle, trusted) == (name,)


def test_a_bundle_without_a_signature_is_refused(bundle: Path) -> None:
    assert "F5023" in (said := refused(bundle, "ours.pub"))
    assert "not signed" in said


def test_a_bundle_signed_by_another_key_is_refused(bundle: Path) -> None:
    sign(read_bundle(bundle), bundle, bundle.with_name("theirs"))
    assert "F5023" in (said := refused(bundle, "ours.pub"))
    assert "none of the keys" in said


def test_two_may_sign_and_either_is_enough(bundle: Path) -> None:
    first = sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    second = sign(read_bundle(bundle), bundle, bundle.with_name("theirs"))
    assert demand_signature(read_bundle(bundle), bundle, [bundle.with_name("ours.pub")]) == (first,)
    assert demand_signature(read_bundle(bundle), bundle, [bundle.with_name("theirs.pub")]) == (second,)


def test_the_signature_of_another_bundle_is_refused(bundle: Path) -> None:
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    write_bundle(bundle, Bundle(split(catalogue_net("two_robots_shared")), ()))
    assert "F5023" in (said := refused(bundle, "ours.pub"))
    assert "another bundle" in said


def test_a_signature_that_names_the_new_bundle_is_forged(bundle: Path) -> None:
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    changed = Bundle(split(catalogue_net("two_robots_shared")), ())
    write_bundle(bundle, changed)
    at = signatures_path(bundle)
    at.write_text(json.dumps({**json.loads(at.read_text()), "bundle": changed.digest}))
    assert "F5023" in (said := refused(bundle, "ours.pub"))
    assert "forged" in said


def test_a_signature_under_the_name_of_a_trusted_key_is_forged(bundle: Path) -> None:
    ours = sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    at = signatures_path(bundle)
    at.unlink()
    theirs = sign(read_bundle(bundle), bundle, bundle.with_name("theirs"))
    record = json.loads(at.read_text())
    at.write_text(json.dumps({**record, "signatures": {ours: record["signatures"][theirs]}}))
    assert "forged" in refused(bundle, "ours.pub")


def test_any_changed_digit_of_a_signature_is_seen(bundle: Path) -> None:
    name = sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    at = signatures_path(bundle)
    record = json.loads(at.read_text())
    good = record["signatures"][name]
    for i in range(0, len(good), 7):
        wrong = good[:i] + ("0" if good[i] != "0" else "1") + good[i + 1 :]
        at.write_text(json.dumps({**record, "signatures": {name: wrong}}))
        assert "F5023" in refused(bundle, "ours.pub")


def test_the_bundle_stays_the_same_file(bundle: Path) -> None:
    before = bundle.read_bytes()
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    assert bundle.read_bytes() == before


def test_signatures_of_a_bundle_that_stood_there_before_are_dropped(bundle: Path) -> None:
    sign(read_bundle(bundle), bundle, bundle.with_name("theirs"))
    write_bundle(bundle, Bundle(split(catalogue_net("two_robots_shared")), ()))
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    assert "none of the keys" in refused(bundle, "theirs.pub")


@pytest.mark.parametrize("version", ['"firable_signatures": true,', '"firable_signatures": 1.0,', ""])
def test_a_file_of_signatures_in_no_version_is_refused(bundle: Path, version: str) -> None:
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    at = signatures_path(bundle)
    written = at.read_text()
    assert written.count('"firable_signatures":1,') == 1
    at.write_text(written.replace('"firable_signatures":1,', version))
    assert "F5024" in refused(bundle, "ours.pub")


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"firable_signatures":1,"bundle":"x","signatures":{}}', "\0" * 10])
def test_a_damaged_file_of_signatures_is_refused(bundle: Path, text: str) -> None:
    signatures_path(bundle).write_text(text)
    assert "F5024" in refused(bundle, "ours.pub")
    with pytest.raises(InputError, match="F5024") as error:
        sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    assert error.value.diagnostics[0].hint.startswith("remove it")
    signatures_path(bundle).unlink()
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))


def test_what_is_no_key_is_refused(bundle: Path) -> None:
    sign(read_bundle(bundle), bundle, bundle.with_name("ours"))
    other = ec.generate_private_key(ec.SECP256R1())
    pem, pkcs8 = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    bundle.with_name("other").write_bytes(other.private_bytes(pem, pkcs8, serialization.NoEncryption()))
    public = other.public_key().public_bytes(pem, serialization.PublicFormat.SubjectPublicKeyInfo)
    bundle.with_name("other.pub").write_bytes(public)
    locked = Ed25519PrivateKey.generate().private_bytes(pem, pkcs8, serialization.BestAvailableEncryption(b"x"))
    bundle.with_name("locked").write_bytes(locked)
    for name in ("ours", "other.pub", "cell.bundle"):  # a secret key is not what one gives away
        assert "F5024" in refused(bundle, name)
    for name in ("ours.pub", "other", "locked", "cell.bundle"):
        with pytest.raises(InputError, match="F5024") as error:
            sign(read_bundle(bundle), bundle, bundle.with_name(name))
        assert ("without .pub" in error.value.diagnostics[0].hint) == name.endswith(".pub")
    assert "F1001" in refused(bundle, "missing.pub")


def test_a_secret_key_is_its_owners_alone_and_never_overwritten(tmp_path: Path) -> None:
    key = tmp_path / "key"
    make_key(key)
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    before = key.read_bytes()
    for path in (key, tmp_path / "no folder" / "key"):
        with pytest.raises(InputError, match="F1017"):
            make_key(path)
    with pytest.raises(InputError, match="this is a directory"):
        make_key(tmp_path)
    key.unlink()
    with pytest.raises(InputError, match="F1017"):  # its public half still stands there
        make_key(key)
    assert before


@pytest.mark.parametrize("halves", [0, 1])
def test_a_key_that_finds_no_room_leaves_no_half_of_it(
    halves: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = iter(range(halves))

    def sync(_descriptor: int) -> None:
        if next(room, None) is None:
            raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", sync)
        with pytest.raises(InputError, match="No space left") as error:
            make_key(tmp_path / "key")
    assert "make room" in error.value.diagnostics[0].hint
    assert not list(tmp_path.iterdir())
    make_key(tmp_path / "key")
