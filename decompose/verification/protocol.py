"""The theorem on the protocol: a bundle must hold it as it is published, and a second solver must confirm it.

It is the same for every net, so nothing is stated anew: `protocol.smt2` beside this file is the theorem that people
have read (docs/protocol-invariant.md explains it), and the file of the bundle must be this one, byte for byte. Each of
its blocks has its verdict. What the theorem assumes of a decomposition are comparisons of names, all of which are made
when the net is cut anew.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from typing import Final

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers, answers_to, gave_up
from firable.nets.verdict import NOTHING, Status, Verdict

FILE: Final = "protocol.smt2"
TITLE: Final = "whatever is lost or crashes, what runs is a run of the net"
_BLOCK: Final = re.compile(r'^; (.+)\n\(push 1\)\n\(echo "(protocol\..+)"\)$', re.MULTILINE)
_METHOD: Final = "z3, of the negated obligation, for nets of any size"


@cache
def published() -> str:
    """The theorem as it is published."""
    return files(__package__).joinpath(FILE).read_text("ascii")


def blocks() -> tuple[tuple[str, str], ...]:
    """The name and the sentence of each obligation of the theorem."""
    return tuple((name, sentence) for sentence, name in _BLOCK.findall(published()))


def check_protocol(examination: Examination, solver: str, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on the protocol, after the net was cut anew; raises `NotShownError` where one is not shown."""
    if examination.text(FILE) != published():
        raise NotShownError(f"'{FILE}' is not the theorem on the protocol", "evidence", FILE)
    said = answers_to(FILE, published(), (name for name, _ in blocks()), answers, timeout_ms)
    for (name, sentence), answer in zip(blocks(), said, strict=True):
        if answer != "unsat" and not gave_up(answer):
            raise NotShownError(f"'{name}' is refuted: the solver says {answer}", "verdicts", name)
        shown = answer == "unsat"
        demanded = Verdict(name, Status.PROVED, sentence, _METHOD, evidence=(FILE,))
        method = f"{solver}, of the theorem as it is published" if shown else NOTHING
        verdict = examination.verdict(name)
        if verdict != demanded:
            raise NotShownError(f"the verdict on '{name}' is not what its proof shows", "verdicts", name)
        late = "" if shown else f"{solver} gave up"
        examination.judge(verdict, shown=shown, method=method, only_claimed=late)
