"""Evidence as a document: the net, what is claimed of it, and the certificates, in one JSON file.

It holds all that a check needs, so that it can be checked years later and far away. Three things tie it together. The
*seal* is the SHA-256 of all the rest: a byte that was damaged on the way is seen before anything is computed. The
*digest* is that of the net without descriptions, the same that verdicts and bundles carry, so that one sees at a glance
which net it speaks of. And the *check* (`firable.analysis.evidence.checking.checker`) trusts neither: whoever edits
the document and seals it anew has either made another proof, or none.

    firable_evidence  2
    seal              SHA-256 of the canonical JSON of the other keys
    digest            of the net
    discipline        interleaving or step
    net               as in bundles (`firable.nets.interchange`)
    sets              the sets of markings, named by their numbers: listed, in hexadecimal, bit i being place i of the
                      net, many of them by the steps from each to the next one; or a decision diagram
    verdicts          for each its name (none: bare claims), status, the query that it answers; `shown`: claims, each
                      with its certificate, which is only named (`before`) where an earlier verdict has the claim with
                      the same one; `lacking`: why nothing shows it, where that is so

A verdict that nothing shows stands there too, and why: what is only claimed is to be seen. A document larger than a
mebibyte is compressed (gzip); it is read like any other, but only as far as a hundred times its file, so that who reads
a small file needs little memory. Rejected: a file for each verdict, which repeats net and markings a hundred times; to
name the net by its digest only, which makes evidence worthless where the file of the net is lost; and to keep the
obligations instead of the data they come from, which would let a forger choose what is to be proved.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from firable.analysis.evidence.certificate import Certificate, sets_of
from firable.analysis.evidence.certificate_records import certificate_to_json
from firable.analysis.evidence.claim_records import Sets, claim_to_json
from firable.analysis.evidence.claims import NEVER_FALSE, Claim
from firable.analysis.evidence.document_records import BeforeRecord, EvidenceRecord
from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.formula import FormulaError
from firable.nets.interchange import canonical_json, net_digest, net_from_json, net_to_json
from firable.nets.net import Net
from firable.nets.queries import KnownNames, parse_query
from firable.nets.source import printable, quoted, read_bytes
from firable.nets.well_formed import is_name
from firable.semantics.trace import Discipline

VERSION: Final = 2
SIZE_BYTES_MAX: Final = 2**28
"""The largest document that is read, compressed or not."""
PLAIN_BYTES_MAX: Final = 2**20
"""The largest document that is written without compressing it."""
PACKED_MAX: Final = 100
"""How many times as large as its file a document may be; one that would be more is written without compressing it."""
_GZIP: Final = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class Record:
    """What is shown for one verdict: claims with their certificates, or why there are none.

    The claims are in order (`order_of`), each once. A record without a name is that of claims that belong to no
    verdict. `query` is the text of a query's own.
    """

    name: str
    proved: bool
    shown: tuple[tuple[Claim, Certificate], ...]
    lacking: str = ""
    query: str = ""


@dataclass(frozen=True, slots=True)
class Document:
    """Verdicts on a net under a discipline, with what shows them."""

    net: Net
    discipline: Discipline
    records: tuple[Record, ...]

    def to_text(self) -> str:
        """The document; `document_from_text` reads it back."""
        sets, before = Sets(), _Before()
        verdicts = [
            {
                "name": record.name,
                "status": "proved" if record.proved else "violated",
                "query": record.query,
                "lacking": record.lacking,
                "shown": [
                    {
                        "claim": claim_to_json(claim),
                        "certificate": {"kind": "before"}
                        if before.has(claim, certificate)
                        else certificate_to_json(certificate, sets),
                    }
                    for claim, certificate in record.shown
                ],
            }
            for record in self.records
        ]
        data = {
            "firable_evidence": VERSION,
            "digest": net_digest(self.net),
            "discipline": self.discipline.value,
            "verdicts": verdicts,
            "sets": sets.to_json(),
            "net": net_to_json(self.net),
        }
        return _laid_out({"seal": seal(data), **data})

    def to_bytes(self) -> bytes:
        """The document as a file holds it: compressed where it is large, and always the same."""
        data = self.to_text().encode()
        packed = gzip.compress(data, mtime=0) if len(data) > PLAIN_BYTES_MAX else data
        return packed if len(data) <= PACKED_MAX * len(packed) else data


class _Before:
    """The claims of a document from its beginning on, each with the first certificate that it has there."""

    def __init__(self) -> None:
        self.known: dict[Claim, Certificate] = {}

    def has(self, claim: Claim, certificate: Certificate) -> bool:
        """Whether the claim stood there before with this very certificate; if it never did, it does from now on."""
        if claim in self.known:
            return self.known[claim] is certificate
        self.known[claim] = certificate
        return False

    def certificate(self, claim: Claim) -> Certificate:
        """The certificate that the claim had before; `ValueError` where it had none."""
        if claim not in self.known:
            raise ValueError(f"no verdict before has '{claim}'")
        return self.known[claim]


def order_of(claim: Claim) -> bytes:
    """By what the claims of a record are put in order."""
    return canonical_json(claim_to_json(claim))


def _laid_out(data: Mapping[str, Any]) -> str:
    """One line for each verdict, and one for each other key."""

    def line(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False, separators=(",", ":"))

    lines = []
    for key, value in data.items():
        if key == "verdicts" and value:
            inner = ",\n  ".join(map(line, value))
            lines.append(f"{line(key)}: [\n  {inner}\n ]")
        else:
            lines.append(f"{line(key)}: {line(value)}")
    return "{\n " + ",\n ".join(lines) + "\n}\n"


def seal(data: Mapping[str, Any]) -> str:
    """The SHA-256 of the document without its seal, in hexadecimal."""
    return hashlib.sha256(canonical_json({key: value for key, value in data.items() if key != "seal"})).hexdigest()


def read_document(path: str | Path) -> Document:
    """Read a document of evidence; whether it shows what it claims is another question.

    Raises `InputError`: F1001 and F1003 where it cannot be read, F6001 where it is damaged or malformed.
    """
    file, data = str(path), read_bytes(path, SIZE_BYTES_MAX)
    if data.startswith(_GZIP):
        data = _unpacked(file, data)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        raise _neither(file) from None
    if not text.lstrip().startswith("{"):
        raise _neither(file)
    return document_from_text(text, file)


def _unpacked(file: str, packed: bytes) -> bytes:
    """What a compressed document holds; to read it takes memory in proportion to its file, as of one that is not."""
    unpacker, most = zlib.decompressobj(wbits=31), min(SIZE_BYTES_MAX, PACKED_MAX * len(packed))
    try:
        data = unpacker.decompress(packed, most + 1)
    except zlib.error as error:
        raise _damaged(file, f"it cannot be unpacked: {error}") from None
    if len(data) > most:
        raise _damaged(file, f"it unpacks to more than {most:,} bytes")
    if not unpacker.eof or unpacker.unused_data:
        raise _damaged(file, "it unpacks not to its end, or to more than one document")
    return data


def document_from_text(text: str, file: str = "") -> Document:
    """The document that `Document.to_text` wrote; raises `InputError` F6001 for a text that it does not write.

    Blanks between the values and the order of keys are free.
    """
    try:
        data = json.loads(text, object_pairs_hook=_without_doubles, parse_constant=_no_constant)
        record = EvidenceRecord.model_validate(data)
        if seal(data) != record.seal:
            raise ValueError("its seal is not that of its content")
        document = _document(record)
    except InputError as error:
        raise _damaged(file, error.diagnostics[0].message) from None
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise _damaged(file, f"{'.'.join(map(str, first['loc'])) or 'the whole'}: {first['msg']}") from None
    except FormulaError as error:
        raise _damaged(file, f"a formula cannot be read: {error.message}") from None
    except (ValueError, RecursionError) as error:  # not JSON, or what is raised here
        raise _damaged(file, str(error)) from None
    return document


def _neither(file: str) -> InputError:
    message = "this is neither a bundle nor a document of evidence"
    hint = "`firable bundle NET -o FILE` makes a bundle, and `firable check --evidence DIR` writes evidence"
    return InputError([Diagnostic("F6001", message, hint, span=Span(printable(file), 1, 1))])


def _damaged(file: str, reason: str) -> InputError:
    message = f"the evidence is damaged or malformed: {printable(reason)}"
    hint = "make it anew: `firable check --evidence DIR` writes it"
    return InputError([Diagnostic("F6001", message, hint, span=Span(printable(file), 1, 1) if file else None)])


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key stands twice in one object")
    return found


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no value of JSON")


def _document(record: EvidenceRecord) -> Document:
    net = net_from_json(record.net)
    if net_digest(net) != record.digest:
        raise ValueError("the digest is not that of the net")
    names = [verdict.name for verdict in record.verdicts if verdict.name]
    if len(set(names)) != len(names):
        raise ValueError("a verdict stands twice")
    sets, before = [one.space(net) for one in record.sets], _Before()
    records = []
    names_of_net = KnownNames(net)
    for verdict in record.verdicts:
        if verdict.name and not is_name(verdict.name):
            raise ValueError(f"{quoted(verdict.name)} is not the name of a verdict")
        if not verdict.query.isprintable() or not verdict.lacking.isprintable():
            raise ValueError(f"what is said of '{verdict.name}' is not one line in visible characters")
        if verdict.query:
            if not verdict.name.startswith("query."):
                raise ValueError(f"'{verdict.name}' is no query, and comes with the text of one")
            for problem in names_of_net.problems(parse_query(verdict.query)):
                raise ValueError(problem.message)
        shown = []
        for one in verdict.shown:
            claim, of = one.claim.of(net), one.certificate
            if claim == NEVER_FALSE and verdict.name:
                raise ValueError("that something false is never so needs nothing to show it")
            certificate = before.certificate(claim) if isinstance(of, BeforeRecord) else of.of(net, sets)
            before.has(claim, certificate)
            shown.append((claim, certificate))
        if any(one >= after for one, after in pairwise(order_of(claim) for claim, _ in shown)):
            raise ValueError(f"the claims of '{verdict.name}' are not in order, each once")
        records.append(Record(verdict.name, verdict.status == "proved", tuple(shown), verdict.lacking, verdict.query))
    named = {id(space) for record in records for _, certificate in record.shown for space in sets_of(certificate)}
    if spare := [number for number, space in enumerate(sets) if id(space) not in named]:
        raise ValueError(f"nothing rests on set {spare[0]}")
    return Document(net, Discipline(record.discipline), tuple(records))
