"""The bundle: one file with a net, its subnets and coordinator table, the verdicts on them, and their evidence.

A bundle is what runs on hardware, so it has to carry its right to run. `manifest.json` holds the SHA-256 of every
other file and a digest over itself; `verdicts.json` names the digests of exactly the net, subnets and table that were
judged, so that verdicts cannot be kept while a subnet is exchanged. What a bundle *must* prove is not read from the
verdicts but derived from the net (`right_to_run`).

Reading rebuilds everything from its content, writes it again and compares: there is one spelling of a bundle, and a
change of any byte is refused. So is a `split.json`, what each controller must know, that does not follow from the rest.
That finds damage and edits by hand; it is no signature, since whoever can write a bundle can write its hashes. Pickle,
or a folder of loose files, were rejected: the one runs code, the other is copied in part.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NoReturn, TypeVar
from urllib.parse import quote

from pydantic import BaseModel, ValidationError
from pydantic_core import from_json

from firable.nets.archive import SIGNATURE, ArchiveError, pack, unpack
from firable.nets.bundle_records import JudgedRecord, ManifestRecord, TableRecord, VersionRecord, table_to_json
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.interchange import FORMAT, canonical_json, net_from_json, net_to_json
from firable.nets.knowledge import split_to_json
from firable.nets.net import Net
from firable.nets.source import printable, read_bytes
from firable.nets.verdict import Verdict
from firable.nets.writing import write_whole

VERSION: Final = 2
SIZE_BYTES_MAX: Final = 256 * 1024 * 1024
_HINT: Final = "make the bundle anew with `firable bundle`"


@dataclass(frozen=True)
class Bundle:
    """A decomposition, the verdicts on it, and the text of each file of evidence by its name."""

    decomposition: Decomposition
    verdicts: tuple[Verdict, ...]
    evidence: Mapping[str, str] = field(default_factory=dict)

    @property
    def net(self) -> Net:
        """The central net."""
        return self.decomposition.net

    @cached_property
    def members(self) -> Mapping[str, bytes]:
        """The files of the bundle by name, but for the manifest."""
        judged = {
            "net.json": canonical_json(net_to_json(self.net)),
            "table.json": canonical_json(table_to_json(self.decomposition)),
            "split.json": canonical_json(split_to_json(self.decomposition)),
            **{
                f"subnets/{file_stem(subnet.name)}.json": canonical_json(net_to_json(subnet))
                for subnet in self.decomposition.subnets
            },
        }
        verdicts = {
            "of": {name: _sha256(data) for name, data in sorted(judged.items())},
            "verdicts": [verdict.to_json() for verdict in self.verdicts],
        }
        evidence = {f"evidence/{name}": text.encode() for name, text in self.evidence.items()}
        return {**judged, "verdicts.json": canonical_json(verdicts), **evidence}

    @cached_property
    def digest(self) -> str:
        """The SHA-256 over the names and hashes of all files: the identity of the bundle."""
        return _sha256(canonical_json(self._manifest))

    @property
    def _manifest(self) -> dict[str, Any]:
        hashes = {name: _sha256(data) for name, data in sorted(self.members.items())}
        return {"firable_bundle": VERSION, "cell": self.net.name, "members": hashes}

    def to_bytes(self) -> bytes:
        """The bundle as the bytes of its file; raises `InputError` F4003 where it is too large for one."""
        manifest = canonical_json({**self._manifest, "digest": self.digest})
        try:
            archive = pack({**self.members, "manifest.json": manifest})
        except ArchiveError as error:
            raise InputError([Diagnostic("F4003", str(error), "split the cell into smaller ones")]) from None
        if len(archive) > SIZE_BYTES_MAX:
            message = f"the bundle has {len(archive):,} bytes, more than may be read ({SIZE_BYTES_MAX:,})"
            raise InputError([Diagnostic("F4003", message, "split the cell into smaller ones")])
        return archive

    @classmethod
    def from_bytes(cls, archive: bytes, file: str = "<bundle>") -> Bundle:
        """Read a bundle back; raises `InputError` F5001 for any bytes that `to_bytes` does not make."""
        try:
            bundle = _bundle(unpack(archive))
        except _OtherVersionError as other:
            message = f"the bundle was made by another version of firable: {printable(str(other))}"
            raise InputError([Diagnostic("F5001", message, _HINT, span=Span(printable(file), 1, 1))]) from None
        except (_DamageError, ArchiveError) as damage:
            _refuse(file, printable(str(damage)))
        if bundle.to_bytes() != archive:
            _refuse(file, "its content is not as it was written")
        return bundle


class _OtherVersionError(Exception):
    """The bundle is whole, and written in the format of another version."""


class _DamageError(Exception):
    """The members are not those of a bundle, and why."""


def file_stem(name: str) -> str:
    """A name of the net as part of a file name, which no `/` or `..` in it can lead elsewhere.

    >>> file_stem("robot/1"), file_stem("..")
    ('robot%2F1', '%2E%2E')
    """
    spelled = quote(name, safe="")
    return spelled.replace(".", "%2E") if not spelled.strip(".") else spelled


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _bundle(members: Mapping[str, bytes]) -> Bundle:
    """The bundle that the members hold, once all their hashes agree."""
    files = {name: data for name, data in members.items() if name != "manifest.json"}
    version = _record(VersionRecord, members, "manifest.json").firable_bundle
    if version != VERSION:
        raise _DamageError(f"version {version} of the format is not known")
    manifest = _record(ManifestRecord, members, "manifest.json")
    if set(manifest.members) != set(files):
        raise _DamageError("files were added to it or taken out")
    for name, data in sorted(files.items()):
        if manifest.members[name] != _sha256(data):
            raise _DamageError(f"'{name}' has been changed")

    net = _net(files, "net.json")
    subnets = tuple(_net(files, f"subnets/{file_stem(controller.name)}.json") for controller in net.controllers)
    for controller, subnet in zip(net.controllers, subnets, strict=True):
        if subnet.name != controller.name:
            raise _DamageError(f"the subnet of '{controller.name}' has another name")
    table = _record(TableRecord, files, "table.json")
    judged = _record(JudgedRecord, files, "verdicts.json")
    if changed := sorted(name for name, sha in judged.of.items() if _sha256(files.get(name, b"")) != sha):
        raise _DamageError(f"'{changed[0]}' is not the one that the verdicts are about")
    return Bundle(
        Decomposition(net, subnets, table.rows(), table.arbitration_groups(), table.free),
        judged.read(),
        {name.removeprefix("evidence/"): _text(files, name) for name in files if name.startswith("evidence/")},
    )


R = TypeVar("R", bound=BaseModel)


def _record(record: type[R], files: Mapping[str, bytes], name: str) -> R:
    try:
        return record.model_validate_json(_member(files, name))
    except ValidationError:
        raise _DamageError(f"the content of '{name}' is not that of a bundle") from None


def _net(files: Mapping[str, bytes], name: str) -> Net:
    try:
        data = from_json(_member(files, name))
    except ValueError:
        raise _DamageError(f"'{name}' is not JSON") from None
    written = data.get("format") if isinstance(data, dict) else None
    if isinstance(written, str) and written != FORMAT and written.startswith(FORMAT.partition("/")[0] + "/"):
        raise _OtherVersionError(f"'{name}' is '{written[:40]}', and this one reads '{FORMAT}'")
    try:
        return net_from_json(data)
    except InputError as error:
        raise _DamageError(f"'{name}' is no net: {error.diagnostics[0].message}") from None


def _text(files: Mapping[str, bytes], name: str) -> str:
    try:
        return files[name].decode()
    except UnicodeDecodeError:
        raise _DamageError(f"'{name}' is not text") from None


def _member(files: Mapping[str, bytes], name: str) -> bytes:
    if name not in files:
        raise _DamageError(f"'{name}' is missing")
    return files[name]


def _refuse(file: str, reason: str) -> NoReturn:
    message = f"the bundle is damaged or has been changed: {reason}"
    raise InputError([Diagnostic("F5001", message, _HINT, span=Span(printable(file), 1, 1))])


def read_bundle(path: str | Path) -> Bundle:
    """Read a bundle file.

    Raises `InputError`: F1001 where it cannot be read, F1003 where it is too large for a bundle, F5001 where it is
    damaged, changed, or none. Whether it may run is another question: `right_to_run`.
    """
    archive = read_bytes(path, SIZE_BYTES_MAX)
    if not archive.startswith(SIGNATURE):
        span = Span(printable(str(path)), 1, 1)
        raise InputError(
            [Diagnostic("F5001", "this is no bundle", "`firable bundle NET -o FILE` makes one", span=span)]
        )
    return Bundle.from_bytes(archive, str(path))


def write_bundle(path: str | Path, bundle: Bundle) -> None:
    """Write a bundle file: whole, or not at all; a file that stands there is replaced.

    Raises `InputError` F1017 where it cannot be written, F4003 where the bundle is too large.
    """
    write_whole(path, bundle.to_bytes())
