"""The theorem decided by z3, and brought to one decomposition by the side conditions.

One file holds the whole theorem: what is assumed of every net, the protocol's relations, the invariant, and each
obligation in a block of its own, as in the files of `firable.decompose.proofs`. It is the same for every net, so
it is proved once in a process. z3 reads the very text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

from firable.analysis.induction.smt import Answer
from firable.decompose.proofs.script import Reader
from firable.decompose.protocol.parametric.fragment import dependencies, order
from firable.decompose.protocol.parametric.invariant import INVARIANT, Conjunct
from firable.decompose.protocol.parametric.side_conditions import side_conditions
from firable.decompose.protocol.parametric.system import PROTOCOL, Protocol
from firable.decompose.protocol.parametric.theorem import ParametricObligation, parametric_obligations, theory
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict

TIMEOUT_MS: Final = 10_000
"""For each obligation; each takes some thousandths of a second."""

FILE: Final = "protocol.smt2"


def parametric_verdicts(
    decomposition: Decomposition, *, timeout_ms: int = TIMEOUT_MS
) -> tuple[tuple[Verdict, ...], Mapping[str, str]]:
    """The verdicts `protocol.*` on one decomposition, and the text of each SMT-LIB 2 file by its name.

    The protocol does what the central net does, for whatever decomposition fulfils the side conditions; so all of them
    must be proved, those of the theorem and the `protocol.side.*` of this decomposition. Less than a second for the
    first net of a process, then linear in its arcs and gates.
    """
    verdicts, text = theorem(timeout_ms)
    return (*verdicts, *side_conditions(decomposition)), {FILE: text}


def theorem(timeout_ms: int = TIMEOUT_MS) -> tuple[tuple[Verdict, ...], str]:
    """The verdict on each obligation of the theorem, and the file that holds all of them."""
    try:
        return _proved(timeout_ms)
    except _NotProvedError as error:
        return error.verdicts, error.text


class _NotProvedError(Exception):
    """Something is not proved, which is not remembered: with more time it may be."""

    def __init__(self, verdicts: tuple[Verdict, ...], text: str) -> None:
        super().__init__()
        self.verdicts, self.text = verdicts, text


@cache
def _proved(timeout_ms: int) -> tuple[tuple[Verdict, ...], str]:
    obligations = tuple(parametric_obligations())
    sorts = order(dependencies(formula for obligation in obligations for formula in obligation.script.formulas))
    assert sorts is not None, "the theorem is outside the decidable fragment"
    head = "".join(f"; {line}\n" for line in (*_HEAD, f"  {', '.join(sort.name for sort in sorts)}."))
    beginning = head + start()
    reader = Reader(timeout_ms, beginning)
    verdicts = tuple(_verdict(obligation, reader.answer(obligation.block)) for obligation in obligations)
    text = beginning + "".join(obligation.block for obligation in obligations)
    if not all(verdict.holds for verdict in verdicts):
        raise _NotProvedError(verdicts, text)
    return verdicts, text


def start(protocol: Protocol = PROTOCOL, conjuncts: Sequence[Conjunct] = INVARIANT) -> str:
    """What stands in the file before the first obligation."""
    return "\n".join(theory(protocol, conjuncts).lines()) + "\n"


_HEAD: Final = (
    "The voting protocol does what the central net does: for any net, any number of controllers and of rounds",
    "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
    "The relations: what there is in a net, who holds what, what the coordinator knows, which messages were sent.",
    "A relation with a number, as marked.1, is what a step makes of it; a definition with one speaks of these.",
    "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
    "It can be decided, for functions and what depends on what go one way through the sorts:",
)


def _verdict(obligation: ParametricObligation, answer: Answer) -> Verdict:
    def verdict(status: Status, code: str = "", hint: str = "", bound: str = "") -> Verdict:
        name, method = f"protocol.{obligation.name}", "z3, of the negated obligation, for nets of any size"
        return Verdict(name, status, obligation.statement, method, code=code, hint=hint, bound=bound, evidence=(FILE,))

    match answer:
        case Answer.UNSAT:
            return verdict(Status.PROVED)
        case Answer.SAT:
            return verdict(Status.VIOLATED, "F4006", "the protocol itself is at fault: run no net by it, and report it")
        case Answer.UNKNOWN:
            return verdict(Status.UNKNOWN, hint="allow more time", bound="z3 gave up")
