"""The JSON of a document of evidence, as records that refuse whatever is not of their shape."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from firable.analysis.evidence.certificate_records import CertificateRecord
from firable.analysis.evidence.claim_records import AscendingRecord, ClaimRecord, DiagramRecord, MarkingsRecord
from firable.nets.records import Many, Record


class BeforeRecord(Record):
    """The certificate that an earlier verdict of the document has for the same claim."""

    kind: Literal["before"]


class _ShownRecord(Record):
    claim: ClaimRecord
    certificate: CertificateRecord | BeforeRecord


class _VerdictRecord(Record):
    name: str
    status: Literal["proved", "violated"]
    query: str
    lacking: str
    shown: Many[_ShownRecord]


class EvidenceRecord(Record):
    """The whole document."""

    firable_evidence: Annotated[int, Field(ge=2, le=2)]  # no Literal: 2.0 equals 2
    seal: str
    digest: str
    discipline: Literal["interleaving", "step"]
    verdicts: Many[_VerdictRecord]
    sets: Many[Annotated[MarkingsRecord | AscendingRecord | DiagramRecord, Field(discriminator="kind")]]
    net: dict[str, Any]
