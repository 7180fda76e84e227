"""Proving a decomposition: each obligation decided by z3 and written out for any other solver.

The verdict rests on the file of the same name, which holds the negated obligation: `unsat` proves it, whoever says so.
Where z3 finds a model instead, the verdict shows it in the net's own names, with what either side says of it, and the
file has the answer `sat`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from firable.analysis.induction.smt import Answer, Decision, Operator, decide, smtlib, value, variables
from firable.decompose.proofs.obligations import Obligation, obligations
from firable.nets.bundle import file_stem
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict, Witness

TIMEOUT_MS: Final = 60_000


@dataclass(frozen=True)
class ProofReport:
    """A verdict for each obligation, and the text of each SMT-LIB 2 file by its name."""

    verdicts: tuple[Verdict, ...]
    files: Mapping[str, str]

    @property
    def holds(self) -> bool:
        """Whether every obligation is proved."""
        return all(verdict.holds for verdict in self.verdicts)


def evidence_name(obligation: str) -> str:
    """The name of the file for an obligation.

    >>> evidence_name("eq7.G2"), evidence_name("eq9-10.robot.free"), evidence_name("ownership")
    ('eq7-G2.smt2', 'eq9-10-robot.free.smt2', 'ownership.smt2')
    """
    return f"{file_stem(obligation.replace('.', '-', 1))}.smt2"


def prove(decomposition: Decomposition, *, timeout_ms: int = TIMEOUT_MS) -> ProofReport:
    """Decide every obligation of a decomposition; `timeout_ms` is for each, and running out of it is UNKNOWN."""
    verdicts, files = [], {}
    for obligation in obligations(decomposition):
        file = evidence_name(obligation.name)
        files[file] = smtlib(obligation.asserted, _comments(decomposition, obligation))
        decision = decide(obligation.asserted, timeout_ms=timeout_ms)
        verdicts.append(_verdict(obligation, decision, file))
    return ProofReport(tuple(verdicts), files)


def _comments(decomposition: Decomposition, obligation: Obligation) -> list[str]:
    return [
        f"{obligation.name} of the decomposition of '{decomposition.net.name}'",
        f"To prove: {obligation.statement}.",
        "Asserted is that it does not hold, so the answer `unsat` proves it.",
        "The constants are: a place holds a token, a signal is 1, a transition fires or is enabled, a fact is so.",
    ]


def _verdict(obligation: Obligation, decision: Decision, file: str) -> Verdict:
    def verdict(status: Status, *, hint: str = "", bound: str = "", witness: Witness | None = None) -> Verdict:
        return Verdict(
            obligation.name,
            status,
            obligation.statement,
            "z3, of the negated obligation",
            code="F4002" if status is Status.VIOLATED else "",
            hint=hint,
            bound=bound,
            subjects=obligation.subjects,
            witness=witness,
            evidence=(file,),
        )

    match decision.answer:
        case Answer.UNSAT:
            return verdict(Status.PROVED)
        case Answer.UNKNOWN:
            return verdict(Status.UNKNOWN, bound=f"z3 gave up: {decision.reason}", hint="allow more time")
    return verdict(
        Status.VIOLATED,
        hint="split the net anew: subnets and table are not to be edited",
        witness=_witness(obligation, decision),
    )


def _witness(obligation: Obligation, decision: Decision) -> Witness:
    """The values that refute the obligation: of all its variables, or of those in the parts of its claim that fail."""
    claim = obligation.claim
    parts = claim.operands if claim.operator is Operator.AND else (claim,)
    failing = [part for part in parts if not value(part, decision.assignment)]
    assignment = tuple((name, decision.assignment[name]) for name in variables(failing))
    says = [f"{side}: {int(value(term, decision.assignment))}" for side, term in obligation.sides]
    return Witness(assignment=assignment, note=", ".join(says))
