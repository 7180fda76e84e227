"""The theorem decided by z3, and brought to one decomposition by the side conditions.

The files are the same for every net, so the verdicts are found once in a process and given to every net. z3 reads the
very text of the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Final

import z3

from firable.analysis.induction.smt import SEED
from firable.decompose.protocol.parametric.side_conditions import side_conditions
from firable.decompose.protocol.parametric.theorem import ParametricObligation, parametric_obligations
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict

TIMEOUT_MS: Final = 10_000
"""For each obligation; each takes some hundredths of a second."""


def parametric_verdicts(
    decomposition: Decomposition, *, timeout_ms: int = TIMEOUT_MS
) -> tuple[tuple[Verdict, ...], Mapping[str, str]]:
    """The verdicts `protocol.*` on one decomposition, and the text of each SMT-LIB 2 file by its name.

    The protocol does what the central net does, for whatever decomposition fulfils the side conditions; so all of them
    must be proved, those of the theorem and the `protocol.side.*` of this decomposition. Some seconds for the first
    net of a process, then linear in its arcs and gates.
    """
    verdicts, files = theorem(timeout_ms)
    return (*verdicts, *side_conditions(decomposition)), dict(files)


@cache
def theorem(timeout_ms: int = TIMEOUT_MS) -> tuple[tuple[Verdict, ...], tuple[tuple[str, str], ...]]:
    """The verdict on each obligation of the theorem, and the names and texts of the files."""
    verdicts, files = [], []
    for obligation in parametric_obligations():
        text = obligation.text
        files.append((file_name(obligation), text))
        verdicts.append(_verdict(obligation, text, timeout_ms))
    return tuple(verdicts), tuple(files)


def file_name(obligation: ParametricObligation) -> str:
    """The name of the file of an obligation, as `proofs.proving.evidence_name` forms it.

    >>> from firable.decompose.protocol.parametric.theorem import parametric_obligations
    >>> file_name(next(parametric_obligations()))
    'protocol-starts.smt2'
    """
    return f"protocol-{obligation.name}.smt2"


def decide_text(text: str, *, timeout_ms: int = TIMEOUT_MS) -> tuple[z3.CheckSatResult, z3.Solver]:
    """What z3 answers to a file, and the solver, which has a model where the answer is `sat`."""
    solver = z3.Solver(ctx=z3.Context())
    solver.set("random_seed", SEED)
    solver.set("timeout", timeout_ms)
    solver.from_string(text)
    return solver.check(), solver


def _verdict(obligation: ParametricObligation, text: str, timeout_ms: int) -> Verdict:
    answer, solver = decide_text(text, timeout_ms=timeout_ms)
    name, file = f"protocol.{obligation.name}", file_name(obligation)
    method = "z3, of the negated obligation, for every net"
    if answer == z3.unsat:
        return Verdict(name, Status.PROVED, obligation.statement, method, evidence=(file,))
    if answer == z3.sat:
        hint = "the protocol itself is at fault, for every net: do not run it"
        return Verdict(name, Status.VIOLATED, obligation.statement, method, code="F4002", hint=hint, evidence=(file,))
    bound = f"z3 gave up: {solver.reason_unknown()}"
    return Verdict(
        name, Status.UNKNOWN, obligation.statement, method, bound=bound, hint="allow more time", evidence=(file,)
    )
