"""A file of obligations is read as what it says, or refused: nothing else in it reaches a solver."""

import pytest

from firable.decompose.verification.formulas import Formulas
from firable.decompose.verification.reading import ReadingError, read_file

FILE = """\
; eq7 of the decomposition of 'c': it is so
(set-logic QF_UF)

; it is so
(push 1)
(echo "eq7.t")
(declare-const |a.p| Bool)
(declare-const |a.q| Bool)
(define-fun shared1 () Bool (and |a.p| |a.q|))
(define-fun shared2 () Bool (or shared1 |a.q|))
(assert (not (= shared1 shared2)))
(assert |a.q|)
(check-sat)
(pop 1)

; it is so again
(push 1)
(echo "eq7.u")
(declare-const |a.p| Bool)
(assert |a.p|)
(check-sat)
(pop 1)
"""
ASSERTED = "(assert (not (= shared1 shared2)))\n"


def test_definitions_are_written_out_and_blocks_know_nothing_of_each_other() -> None:
    of = Formulas()
    p, q = of.symbol("a.p"), of.symbol("a.q")
    both = of.all_of([p, q])
    first, second = read_file(FILE, of).blocks
    assert (first.name, first.sentence, second.name) == ("eq7.t", "it is so", "eq7.u")
    assert first.asserted == (of.negation(of.equal(both, of.any_of([both, q]))), q)
    assert second.asserted == (p,)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('(echo "eq7.t")', "(echo |eq7.t|)", "stands in quotes"),
        ('(echo "eq7.t")', "(echo xeq7.tx)", "stands in quotes"),
        ("(declare-const |a.p| Bool)\n(declare", "(declare-const xa.px Bool)\n(declare", "xa.px cannot be declared"),
        ("(declare-const |a.q| Bool)", "(declare-const |a.p| Bool)", "cannot be declared here"),
        ("|a.q|", "|shared1|", "shared1 cannot be defined here"),  # one symbol for every solver
        ("shared2", "shared1", "shared1 cannot be defined here"),
        ("shared2", "shared3", "shared3 cannot be defined here"),
        ("shared2", "other2", "other2 cannot be defined here"),
        ("(define-fun shared1", "(declare-const |a.r| Bool)\n(define-fun shared1", "is of no use"),
        (ASSERTED, "(assert (not shared1))\n", "shared2 is of no use"),
        (ASSERTED, f"{ASSERTED}(declare-const |a.r| Bool)\n", "'declare-const' may not stand here"),
        (ASSERTED, f"{ASSERTED}(define-fun shared3 () Bool |a.p|)\n", "'define-fun' may not stand here"),
        (f"{ASSERTED}(assert |a.q|)\n", "", "'check-sat' may not stand here"),
        ("(check-sat)", "(exit)", "'exit' may not stand here"),
        (ASSERTED, "(assert)\n", r"'\)' is nothing that was declared"),
        ("(assert |a.q|)", "(assert |a.r|)", "nothing that was declared"),
        ("(assert |a.q|)", "(assert shared3)", "nothing that was declared"),
        ("(= shared1 shared2)", "(= shared1 shared1 shared2)", "nobody writes '='"),
        ("(= shared1 shared2)", "(xor shared1 shared2)", "nobody writes 'xor'"),
        ("(or shared1 |a.q|)", "(or |a.q| shared1 |a.q|)", "nobody writes 'or'"),
        ("(or shared1 |a.q|)", "(or shared1 false)", "nobody writes 'or'"),
        ("(and |a.p| |a.q|)", "(and |a.p| true)", "nobody writes 'and'"),
        ("(and |a.p| |a.q|)", "(and |a.p|)", "nobody writes 'and'"),
        ("(= shared1 shared2)", "(not shared1)", "nobody writes 'not'"),
        ("(= shared1 shared2)", "true", "nobody writes 'not'"),
        (ASSERTED, "(assert (not (not shared2)))\n", "nobody writes 'not'"),
        ("\n; it is so\n", "\n; it is so\n; or so\n", "one sentence"),
        ("\n\n; it is so\n", "\n", "one sentence"),
    ],
)
def test_whatever_else_stands_in_a_file_is_refused(old: str, new: str, says: str) -> None:
    text = FILE.replace(old, new) if old.startswith(("|", "shared")) else FILE.replace(old, new, 1)
    assert text != FILE
    with pytest.raises(ReadingError, match=says):
        read_file(text, Formulas())


def test_a_file_that_is_cut_off_anywhere_but_between_obligations_is_refused() -> None:
    whole = {part for part in (FILE[:i] for i in range(len(FILE) + 1)) if part.endswith(("QF_UF)\n", "(pop 1)\n"))}
    assert len(whole) == 3
    for part in whole:
        read_file(part, Formulas())
    for i in range(1, len(FILE)):
        for text in {FILE[:i], f"{FILE[:i]}\n"} - whole:
            with pytest.raises(ReadingError):
                read_file(text, Formulas())
