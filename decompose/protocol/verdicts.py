"""The verdicts on the protocol of a decomposition, and the evidence for them.

All of them rest on a file of obligations, in which an invariant of the protocol's net is kept by each of its steps
(`inductive`). The sentences of refinement are besides properties of that net, so what shows them is also what shows any
property: a document that `firable verify` checks from the firing rule alone, for the whole cell a diagram that is
found closed under all steps. It holds the protocol's net as text, and says nothing of how that net was made; a bundle
holds the obligations, which its checker states anew from the central net.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.claims import Claim, ClaimKind, tidy
from firable.analysis.evidence.document import Document, Record
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.goal import Limits
from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.exploring import Exploration, explore_protocol
from firable.decompose.protocol.inductive_script import Proof, prove_inductively
from firable.decompose.protocol.outages import fault_exploration, fault_verdicts
from firable.decompose.protocol.shown import file_of, with_proof
from firable.nets.decomposition import Decomposition
from firable.nets.net import Property
from firable.nets.verdict import Status, Verdict

EVIDENCE: Final = "protocol.evidence.json"
EVIDENCE_SECONDS: Final = 60.0
FAULTS_EVIDENCE: Final = "protocol-faults.evidence.json"
TIMEOUT_MS: Final = 10_000


@dataclass(frozen=True)
class ProtocolVerdicts:
    """Verdicts, and for each family (`explored`, `faults`) the exploration that they are of and the proof of them."""

    verdicts: tuple[Verdict, ...]
    explorations: Mapping[str, Exploration]
    proofs: Mapping[str, Proof]

    @property
    def protocols(self) -> dict[str, ProtocolNet]:
        """For each verdict the protocol that its runs are of."""
        of = {family: exploration.protocol for family, exploration in self.explorations.items()}
        return {verdict.name: of[verdict.name.partition(".")[0]] for verdict in self.verdicts}

    def evidence(self, limits: Limits | None = None) -> dict[str, str | bytes]:
        """The obligations and the documents, by the names of their files.

        A document that is large is packed, and its name ends in `.gz`.
        """
        files: dict[str, str | bytes] = {file_of(family): proof.text for family, proof in self.proofs.items()}
        for family, exploration in self.explorations.items():
            data = document(exploration, limits).to_bytes()
            name = EVIDENCE if family == "explored" else FAULTS_EVIDENCE
            files[name if data.startswith(b"{") else f"{name}.gz"] = data
        return files


def protocol_verdicts(
    decomposition: Decomposition,
    limits: Callable[[], Limits] = Limits,
    *,
    faults: bool = False,
    timeout_ms: int = TIMEOUT_MS,
) -> ProtocolVerdicts:
    """What holds of the protocol of a decomposition without faults, and with `faults` under all that pass.

    The limits are made anew for each of the two explorations, `timeout_ms` is for each obligation on the invariant.
    """
    quiet = explore_protocol(decomposition, limits=limits())
    explorations, found = {"explored": quiet}, {"explored": quiet.verdicts}
    if faults:
        explorations["faults"] = fault_exploration(decomposition, limits())
        found["faults"] = fault_verdicts(explorations["faults"])
    proofs = {family: prove_inductively(of.protocol, timeout_ms) for family, of in explorations.items()}
    verdicts = tuple(one for family, some in found.items() for one in with_proof(some, proofs[family]))
    return ProtocolVerdicts(verdicts, explorations, proofs)


def document(exploration: Exploration, limits: Limits | None = None) -> Document:
    """The evidence for the sentences of refinement that are decided; what nothing shows says why."""
    net, space = exploration.protocol.net, exploration.space
    limits = limits or Limits(Deadline.after(EVIDENCE_SECONDS))
    certifier = Certifier(net, space.discipline, limits, space if space.complete else None)
    verdicts = {verdict.name.partition(".")[2]: verdict for verdict in exploration.safety}
    records = []
    for of in net.properties:
        verdict = verdicts[of.name]
        if verdict.status is not Status.UNKNOWN and isinstance(of, Property):
            proved = verdict.status is Status.PROVED
            claim = Claim(ClaimKind.NEVER if proved else ClaimKind.REACHABLE, tidy(of.formula))
            name = f"property.{of.name}"
            try:
                records.append(Record(name, proved, certifier.shown(claim, verdict.witness)))
            except LackingError as error:
                records.append(Record(name, proved, (), str(error)))
    return Document(net, space.discipline, tuple(records))
