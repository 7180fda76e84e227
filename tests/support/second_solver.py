"""cvc5, the solver that shares nothing with the one of the product."""

from functools import lru_cache

import cvc5


@lru_cache(64)
def by_cvc5(text: str) -> str:
    """What cvc5 answers to an SMT-LIB 2 file."""
    solver = cvc5.Solver()
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, text, "test.smt2")
    answer = ""
    while not (command := parser.nextCommand()).isNull():
        answer += command.invoke(solver, parser.getSymbolManager())
    return answer.strip()
