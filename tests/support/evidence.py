"""Evidence as the tests of the techniques need it: of one finding, of one claim, and as a document."""

from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.goal import Finding, Limits
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.semantics.trace import Discipline


def evidence_of_finding(
    net: Net, goal: Formula, found: Finding, discipline: Discipline = Discipline.INTERLEAVING
) -> Evidence | None:
    """The evidence that a finding comes with: its witness, or its certificate; None where it has neither."""
    if found.witness is not None:
        sequence = FiringSequence(found.witness.firings)
        return Evidence(net, discipline, Claim(ClaimKind.REACHABLE, goal), sequence)
    if found.certificate is None:
        return None
    return Evidence(net, discipline, Claim(ClaimKind.NEVER, goal), found.certificate)


def certified(net: Net, claim: Claim, discipline: Discipline = Discipline.INTERLEAVING) -> Evidence | None:
    """The evidence that is found for a claim; None where none is."""
    try:
        return Evidence(net, discipline, claim, Certifier(net, discipline, Limits()).certify(claim))
    except LackingError:
        return None


def document(*evidence: Evidence, name: str = "") -> Document:
    """The document of claims that belong to no verdict, or to the proved verdict of this name."""
    shown = tuple((one.claim, one.certificate) for one in evidence)
    return Document(evidence[0].net, evidence[0].discipline, (Record(name, proved=True, shown=shown),))
