"""One SMT-LIB 2 file for all obligations of a family, and what z3 says to it.

The file is a sequence of blocks, each of which stands alone between `push` and `pop`: the sentence that is to be
proved, a name to echo, declarations, what is asserted, `check-sat`. An engineer finds an obligation by its name; a
solver answers all of them in one run, with `unsat` after every name.

    ; 'G2' is firable in the central net iff each of its parts is firable in its subnet
    (push 1)
    (echo "eq7.G2")
    (declare-const |robot.free| Bool)
    ...
    (assert (not (= ...)))
    (check-sat)
    (pop 1)

z3 reads the very text that is left as evidence, block by block: nothing can be proved that the file does not say, and
no second encoding has to be kept equal. Rejected: a file for each obligation, which are tens of thousands for a large
cell; terms built in z3 through its interface, which takes a hundred times as long as the answers.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import z3

from firable.analysis.induction.smt import SEED, Answer, Term, in_ascii, smtlib_lines
from firable.nets.source import printable

LOGIC: Final = "(set-logic QF_UF)"


class ScriptError(Exception):
    """z3 did not answer a block with one of the three words: a fault of the text that was written."""


def head(lines: Iterable[str]) -> str:
    """The beginning of a file: comments, and the logic."""
    return "".join(f"; {printable(line)}".rstrip() + "\n" for line in lines) + f"{LOGIC}\n"


def block(name: str, statement: str, assertions: tuple[Term, ...]) -> str:
    """The text of one obligation.

    >>> from firable.analysis.induction.smt import Terms
    >>> print(block("eq7.G", "it is so", (Terms().variable("p"),)), end="")
    <BLANKLINE>
    ; it is so
    (push 1)
    (echo "eq7.G")
    (declare-const |p| Bool)
    (assert |p|)
    (check-sat)
    (pop 1)
    """
    lines = [f"; {printable(statement)}", "(push 1)", f'(echo "{in_ascii(name)}")', *smtlib_lines(assertions)]
    return "\n" + "\n".join([*lines, "(check-sat)", "(pop 1)"]) + "\n"


class Reader:
    """z3, which reads the beginning of a file when it is asked for its first block; `timeout_ms` is for each answer.

    Time may end in the midst of any command, a `push` or a `pop` too. What the context holds then is not what the file
    says, so nothing more is believed of it: the block is unknown, and a new context reads the beginning again.
    """

    def __init__(self, timeout_ms: int, beginning: str = f"{LOGIC}\n") -> None:
        self._beginning = f"(set-option :smt.random_seed {SEED})\n{beginning}\n(set-option :timeout {timeout_ms})\n"
        self._context: z3.Context | None = None

    def _begun(self) -> z3.Context:
        context = z3.Context()
        if said := z3.Z3_eval_smtlib2_string(context.ref(), self._beginning):
            raise ScriptError(f"z3 said {said} to\n{self._beginning}")
        return context

    def answer(self, text: str) -> Answer:
        """The answer to a block."""
        self._context = self._context or self._begun()
        try:
            told: str = z3.Z3_eval_smtlib2_string(self._context.ref(), text)
        except z3.Z3Exception as error:
            told = str(error)
        said = told.splitlines()
        if len(said) == 2 and said[1] in set(Answer):
            return Answer(said[1])
        if "canceled" not in told:
            raise ScriptError(f"z3 said {said} to\n{text}")
        self._context = None
        return Answer.UNKNOWN
