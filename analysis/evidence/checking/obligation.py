"""Evidence, and the obligations that come of it: terms that must not all be true together, for any solver."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Certificate
from firable.analysis.evidence.claims import Claim
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.induction.smt import Operator, Term, Terms, smtlib
from firable.nets.net import Net
from firable.semantics.trace import Discipline

_CLOCK_EVERY: Final = 256


@dataclass(frozen=True, slots=True)
class Evidence:
    """A claim about a net under a discipline, with what shows it."""

    net: Net
    discipline: Discipline
    claim: Claim
    certificate: Certificate


@dataclass(frozen=True, slots=True)
class Obligation:
    """Terms that must not all be true together; `statement` is what that shows."""

    name: str
    statement: str
    asserted: tuple[Term, ...]

    def text(self, evidence: Evidence) -> str:
        """The SMT-LIB 2 file, whose answer must be `unsat`."""
        return smtlib(self.asserted, comments(evidence, self.statement))


def comments(evidence: Evidence, statement: str) -> list[str]:
    """What stands at the head of the file of an obligation."""
    return [
        f"of '{evidence.net.name}' ({evidence.discipline}): {evidence.claim}",
        f"To show: {statement}.",
        "Asserted is that it does not hold, so the answer `unsat` shows it.",
    ]


@dataclass(frozen=True)
class TimedTerms(Terms):
    """Terms for as long as there is time; raises `TimeIsOverError` then."""

    deadline: Deadline = NEVER
    _made: Iterator[int] = field(default_factory=count, repr=False, compare=False)

    def _term(self, operator: Operator, operands: tuple[Term, ...] = (), name: str = "") -> Term:
        if next(self._made) % _CLOCK_EVERY == 0 and self.deadline.over:
            raise TimeIsOverError
        return super()._term(operator, operands, name)
