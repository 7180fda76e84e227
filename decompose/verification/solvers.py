"""Solvers that answer a file: cvc5, which shares nothing with the one of the prover, or z3 where there is no cvc5.

Each reads the text itself, with its own parser, and nothing of it is built by us: so what it answers is the answer to
the file. Whoever has neither can take the files out (`firable verify BUNDLE --smt-dir DIR`) and ask a third one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final

from firable.decompose.verification.refusal import NotShownError

Answers = Callable[[str, int], tuple[str, ...]]
"""The lines that a solver prints for a text, without quotes, in so many milliseconds for each question."""


class SolverError(Exception):
    """The solver could not read a text."""


def gave_up(answer: str) -> bool:
    """Whether an answer is that of a solver that did not come to an end, for whatever reason it adds.

    >>> gave_up("unknown (TIMEOUT)"), gave_up("sat")
    (True, False)
    """
    return answer == "timeout" or answer.startswith(("unknown", "interrupted by "))


def answers_to(file: str, text: str, names: Iterable[str], answers: Answers, timeout_ms: int) -> tuple[str, ...]:
    """What a solver answers to each obligation of a file of a bundle, which prints these names before it asks.

    Raises `NotShownError` where it cannot read the file, or answers anything else than one question after the other.
    """
    try:
        said = answers(text, timeout_ms)
    except SolverError as error:
        raise NotShownError(f"the solver cannot read '{file}': {error}", "evidence", file) from None
    if said[::2] != tuple(names) or len(said) % 2:
        raise NotShownError(f"the solver does not answer one obligation of '{file}' after the other", "evidence", file)
    return said[1::2]


def by_cvc5(text: str, timeout_ms: int) -> tuple[str, ...]:
    """What cvc5 prints.

    >>> by_cvc5("(set-logic QF_UF)(assert false)(check-sat)", 1000)
    ('unsat',)
    """
    import cvc5

    solver = cvc5.Solver()
    solver.setOption("incremental", "true")
    solver.setOption("tlimit-per", str(timeout_ms))
    # Each fact that is given would be put into all others, one after the other: quadratic, and nothing gained.
    solver.setOption("simplification", "none")
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, text, "evidence")
    symbols = parser.getSymbolManager()
    said: list[str] = []
    try:
        while not (command := parser.nextCommand()).isNull():
            said += command.invoke(solver, symbols).splitlines()
    except RuntimeError as error:  # the one exception of its binding
        raise SolverError(str(error)) from None
    return tuple(line.strip('"') for line in said)


def by_z3(text: str, timeout_ms: int) -> tuple[str, ...]:
    """What z3 prints.

    >>> by_z3('(set-logic QF_UF)(echo "so")(assert true)(check-sat)', 1000)
    ('so', 'sat')
    """
    import z3

    context = z3.Context()
    z3.Z3_eval_smtlib2_string(context.ref(), f"(set-option :timeout {timeout_ms})")
    try:
        said: str = z3.Z3_eval_smtlib2_string(context.ref(), text)
    except z3.Z3Exception as error:
        raise SolverError(str(error)) from None
    return tuple(line.strip('"') for line in said.splitlines())


SOLVERS: Final[Mapping[str, Answers]] = MappingProxyType({"cvc5": by_cvc5, "z3": by_z3})
"""Each solver by its name, the one that is asked by default first."""
