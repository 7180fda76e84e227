"""Signatures of bundles: who says that this bundle may run here (Ed25519, RFC 8032).

The hashes in a bundle show damage, not forgery: whoever can write a bundle can write its hashes. A signature is made
with a key that stays where bundles are released, and a site that names the public key lets nothing else run.

What is signed is the identity of the bundle, its digest over the hashes of all members, behind a line that says what
the signature is for. Signatures stand *beside* the bundle, in `NAME.bundle.signatures`. In the bundle they could not be
covered by its identity, so one bundle would have many files, and to sign would be to change the file that has been
checked; beside it, a bundle stays the same bytes for everyone, and who wrote it, who tested it and who runs it may each
sign. The price is a second file to carry along, and it is missed loudly.

Keys are PEM files as other tools write them (PKCS 8, SubjectPublicKeyInfo). Rejected: certificates. They add names and
expiry, and an authority to be kept; a site trusts a handful of keys, and names them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from firable.nets.bundle import Bundle
from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.interchange import canonical_json
from firable.nets.secret_files import is_open_to_all
from firable.nets.source import printable, read_bytes
from firable.nets.writing import stands, write_secret, write_whole

SUFFIX: Final = ".signatures"
_SIZE_BYTES_MAX: Final = 1 << 20
_PURPOSE: Final = b"firable bundle signature 1\n"
_Hex32 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
_Hex64 = Annotated[str, Field(pattern="^[0-9a-f]{128}$")]


class SignaturesRecord(BaseModel):
    """The file of signatures: the bundle that they are of, and for each public key its signature."""

    model_config = ConfigDict(defer_build=True, extra="forbid", strict=True)
    firable_signatures: Annotated[int, Field(ge=1, le=1)]  # no Literal: True and 1.0 equal 1
    bundle: _Hex32
    signatures: dict[_Hex32, _Hex64]


def signatures_path(bundle_path: str | Path) -> Path:
    """Where the signatures of a bundle stand.

    >>> signatures_path("cell.bundle").name
    'cell.bundle.signatures'
    """
    path = Path(bundle_path)
    return Path(f"{path}{SUFFIX}")


def make_key(path: str | Path) -> str:
    """Make a key: the secret one in `path`, readable by its owner alone, the public one in `path.pub`; its name.

    Raises `InputError` F1017 where a file cannot be written, or stands there already: a key is never overwritten.
    """
    path = Path(path)
    public_path = Path(f"{path}.pub")
    key = Ed25519PrivateKey.generate()
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    public = key.public_key().public_bytes(serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo)
    for file in (path, public_path):
        if stands(file):
            if file.is_dir():
                raise _refusal("F1017", file, "this is a directory", "name a file in it")
            raise _refusal("F1017", file, "a file stands there, and may be a key in use", "name another file")
    write_secret(path, secret)
    with ExitStack() as undone:  # one half would keep the other from being made under this name
        undone.callback(path.unlink)
        write_whole(public_path, public)
        undone.pop_all()
    return _name(key.public_key())


def sign(bundle: Bundle, bundle_path: str | Path, key_path: str | Path) -> str:
    """Sign a bundle with the secret key in a file, beside the signatures that it has; the name of the key.

    Raises `InputError` F5024 where that is no secret key, or the file of signatures is damaged; F5026 where the key is
    no secret; F1017.
    """
    key = _secret(key_path)
    at = signatures_path(bundle_path)
    record = SignaturesRecord(firable_signatures=1, bundle=bundle.digest, signatures={})
    if stands(at):
        found = _record(at)
        if found.bundle == bundle.digest:  # those of the bundle that stood here before are worth nothing now
            record = found
    name = _name(key.public_key())
    signatures = {**record.signatures, name: key.sign(_signed(bundle)).hex()}
    write_whole(at, canonical_json(record.model_copy(update={"signatures": signatures}).model_dump()) + b"\n")
    return name


def demand_signature(bundle: Bundle, bundle_path: str | Path, trusted_paths: Sequence[str | Path]) -> tuple[str, ...]:
    """The names of the trusted keys that have signed a bundle; there must be one.

    Raises `InputError` F5023 where none has, or a signature of one is forged; F5024 where a key or the file of
    signatures is none.
    """
    trusted = {_name(key): key for key in map(_public, trusted_paths)}
    at = signatures_path(bundle_path)
    if not stands(at):
        hint = f"its signatures are expected in {printable(at.name)}, beside it; `firable sign` writes them there"
        raise _refusal("F5023", bundle_path, "the bundle is not signed, and a signature is demanded", hint)
    record = _record(at)
    if record.bundle != bundle.digest:
        message = f"the signatures are of another bundle, {record.bundle[:16]}…, and this one is {bundle.digest[:16]}…"
        raise _refusal("F5023", at, message, "let who may release bundles sign this one")
    found = tuple(name for name in record.signatures if name in trusted)
    for name in found:
        try:
            trusted[name].verify(bytes.fromhex(record.signatures[name]), _signed(bundle))
        except InvalidSignature:
            message = f"the signature by the key {name[:16]}… is forged or damaged: that key has not made it"
            raise _refusal("F5023", at, message, "do not run this bundle before you know where it comes from") from None
    if not found:
        signers, wanted = _listed(record.signatures), _listed(trusted)
        message = f"the bundle is signed by {signers or 'nobody'}, and by none of the keys trusted here: {wanted}"
        raise _refusal("F5023", at, message, "let who may release bundles sign it, or trust another key")
    return found


def _signed(bundle: Bundle) -> bytes:
    """What a signature covers."""
    return _PURPOSE + bundle.digest.encode("ascii") + b"\n"


def _record(at: Path) -> SignaturesRecord:
    try:
        return SignaturesRecord.model_validate_json(read_bytes(at, _SIZE_BYTES_MAX), strict=True)
    except ValidationError:
        hint = "remove it, and let all who have signed the bundle sign it anew"
        raise _refusal("F5024", at, "this is no file of signatures, or it is damaged", hint) from None


def _secret(path: str | Path) -> Ed25519PrivateKey:
    data = read_bytes(path, _SIZE_BYTES_MAX)
    try:
        key = serialization.load_pem_private_key(data, password=None)
    except TypeError:  # what the library says of a key with a passphrase
        raise _refusal("F5024", path, "the key is locked by a passphrase", "unlock it for signing") from None
    except (ValueError, UnsupportedAlgorithm):
        hint = "`firable sign --make-key FILE` makes one"
        if str(path).endswith(".pub"):
            hint = "name the file without .pub: the public key is for who trusts it"
        raise _refusal("F5024", path, "this is no secret key", hint) from None
    if not isinstance(key, Ed25519PrivateKey):
        raise _refusal("F5024", path, "this is a key of another kind than Ed25519", "make one of that kind")
    if is_open_to_all(path):
        hint = f"make another one, where somebody may have done that; else `chmod o-rw {printable(str(path))}`"
        raise _refusal("F5026", path, "everybody on this host can read this key, or change it", hint)
    return key


def _public(path: str | Path) -> Ed25519PublicKey:
    data = read_bytes(path, _SIZE_BYTES_MAX)
    try:
        key = serialization.load_pem_public_key(data)
    except (ValueError, UnsupportedAlgorithm):
        message, hint = "this is no public key", "name the file that ends in .pub; the secret one is for signing alone"
        raise _refusal("F5024", path, message, hint) from None
    if not isinstance(key, Ed25519PublicKey):
        raise _refusal("F5024", path, "this is a key of another kind than Ed25519", "make one of that kind")
    return key


def _name(key: Ed25519PublicKey) -> str:
    """A public key as it is named: its 32 bytes in hexadecimal."""
    return key.public_bytes(serialization.Encoding.Raw, serialization.PublicFormat.Raw).hex()


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"{name[:16]}…" for name in names)


def _refusal(code: str, path: str | Path, message: str, hint: str) -> InputError:
    return InputError([Diagnostic(code, message, hint, span=Span(printable(str(path)), 1, 1))])
