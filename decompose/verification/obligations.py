"""The static obligations of a bundle: each family's file says exactly what must be proved, and a solver says `unsat`.

Three things are compared with what `restating` makes of the net, the subnets and the table: the verdicts, every field
of them; the sentences of the file; and its formulas, in normal form. Then the solver answers the file itself. The
order counts, too, so that no obligation can be left out and no other one put in its place.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.formulas import Formulas, spelled
from firable.decompose.verification.reading import ObligationFile, ReadingError, read_file
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.restating import HEADS, Restated, Stated
from firable.decompose.verification.restating_votes import UNIT
from firable.decompose.verification.solvers import Answers, answers_to, gave_up
from firable.nets.source import printable
from firable.nets.verdict import Status, Verdict

_METHOD: Final = "z3, of the negated obligation"  # what each such verdict says of itself


def check_obligations(
    examination: Examination,
    cut: Cut,
    solver: str,
    answers: Answers,
    timeout_ms: int,
    families: Iterable[str] = HEADS,
) -> None:
    """Judge the verdicts of these families, of all unless somebody says which.

    Raises `NotShownError` where one is not shown.
    """
    stated_of = {family: compared(examination, cut, family) for family in families}
    # What needs no solver comes first, so that a bundle that says something else is refused at once.
    for family, stated in stated_of.items():
        if stated:
            shown = _answered(examination, family, stated, answers, timeout_ms)
            _judge(examination, stated, solver, shown)


def compared(examination: Examination, cut: Cut, family: str) -> list[Stated]:
    """What must be proved of a family, once its file and its verdicts have been found to say exactly this."""
    decomposition, formulas, name = examination.bundle.decomposition, Formulas(), _file(family)
    units = [verdict.subjects for verdict in examination.bundle.verdicts if verdict.name.startswith(UNIT)]
    stated = list(Restated(decomposition, cut, formulas, units).family(family))
    if stated:
        try:
            file = read_file(examination.text(name), formulas)
        except ReadingError as error:
            raise NotShownError(f"'{name}' is no file of obligations: {error}", "evidence", name) from None
        _compare(name, family, decomposition.net.name, file, stated)
    for one in stated:
        demanded = Verdict(
            one.name,
            Status.PROVED,
            one.sentence,
            _METHOD,
            one.weight,
            subjects=one.subjects,
            evidence=(name,),
            discipline=one.discipline,
        )
        if examination.verdict(one.name) != demanded:
            raise NotShownError(f"the verdict on '{one.name}' is not what its proof shows", "verdicts", one.name)
    return stated


def _file(family: str) -> str:
    return f"{family}.smt2"


def _compare(name: str, family: str, net: str, file: ObligationFile, stated: list[Stated]) -> None:
    if file.head != (
        printable(f"{family} of the decomposition of '{net}': {HEADS[family]}"),
        "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
        "The constants: a place holds a token, a signal is 1, a transition fires or is enabled, a fact is so.",
        "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
    ):
        raise NotShownError(f"'{name}' does not say of what it is", "evidence", name)
    for i, one in enumerate(stated):
        if i >= len(file.blocks):
            raise NotShownError(f"'{name}' lacks the obligation '{one.name}'", "evidence", name)
        block = file.blocks[i]
        if block.name != spelled(one.name):
            raise NotShownError(f"'{name}' has '{block.name}' where '{one.name}' must be proved", "evidence", name)
        if block.sentence != printable(one.sentence) or block.asserted != one.asserted:
            raise NotShownError(f"'{name}' states something else than '{one.name}'", "evidence", name)
    if len(file.blocks) > len(stated):
        extra = file.blocks[len(stated)].name
        raise NotShownError(f"'{name}' proves '{extra}', which nobody demands", "evidence", name)


def _answered(
    examination: Examination, family: str, stated: list[Stated], answers: Answers, timeout_ms: int
) -> list[bool]:
    """Of each obligation whether it is shown; an answer that refutes one is refused."""
    name = _file(family)
    found, names = [], [spelled(one.name) for one in stated]
    said = answers_to(name, examination.text(name), names, answers, timeout_ms)
    for one, answer in zip(stated, said, strict=True):
        if answer != "unsat" and not gave_up(answer):
            raise NotShownError(f"'{one.name}' is refuted: the solver says {answer}", "verdicts", one.name)
        found.append(answer == "unsat")
    return found


def _judge(examination: Examination, stated: list[Stated], solver: str, shown: list[bool]) -> None:
    for one, answered in zip(stated, shown, strict=True):
        is_shown = answered and all(examination.checked[name].shown for name in one.rests_on)
        method = f"{solver}, of the negated obligation stated anew" if is_shown else "nothing"
        late = "" if is_shown else f"{solver} gave up"
        examination.judge(examination.verdict(one.name), shown=is_shown, method=method, only_claimed=late)
