"""Splitting and proving generated cells, and checking the proofs again: time for each transition, as the cell grows.

The curve is the point: a ratio to the smallest cell that stays near 1 says that everything is linear in the number of
transitions. Measured is all that `firable prove` does after reading: the split, every static obligation, its text and
z3's answer; and, apart, all that `firable verify` does with these files: the net cut anew, what must be proved stated
anew and compared, and cvc5's answers.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from measuring import MET, MISSED, Table, timed

from firable.decompose.proofs.proving import ProofReport, prove
from firable.decompose.splitting.cut import split
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.obligations import check_obligations
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.solvers import by_cvc5
from firable.nets.bundle import Bundle
from firable.nets.catalogue import family_net
from firable.nets.decomposition import Decomposition

MACHINES: Final = (10, 100, 1_000)
SECONDS_MAX: Final = 60.0
RATIO_MAX: Final = 1.5


def proved(name: str) -> tuple[Decomposition, ProofReport]:
    """The split of a net and its proofs."""
    decomposition = split(family_net(name))
    return decomposition, prove(decomposition)


def checked_again(decomposition: Decomposition, proof: ProofReport) -> int:
    """How many verdicts of a proof are shown by cvc5."""
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    check_obligations(examination, check_cut(decomposition), "cvc5", by_cvc5, 60_000)
    return sum(one.shown for one in examination.checked.values())


def tables(repeat: int) -> list[Table]:
    """One row for each size."""
    rows = []
    first: tuple[float, float] | None = None
    for machines in MACHINES:
        name = f"workshop-{machines}"
        runs = [timed(partial(proved, name)) for _ in range(repeat)]
        (decomposition, proof), seconds = runs[0][0], min(took for _, took in runs)
        again = [timed(partial(checked_again, decomposition, proof)) for _ in range(repeat)]
        seconds_again = min(took for _, took in again)
        n = len(decomposition.net.transitions)
        per = seconds / n, seconds_again / n
        first = first or per
        met = MET if seconds <= SECONDS_MAX else MISSED
        rows.append(
            (
                name, f"{n:,}", f"{len(proof.verdicts):,}", f"{seconds:.2f} (<= {SECONDS_MAX:g}: {met})",
                f"{per[0] * 1e3:.2f}", f"{per[0] / first[0]:.2f} (<= {RATIO_MAX:g}: {_met(per[0] / first[0])})",
                f"{seconds_again:.2f}", f"{per[1] / first[1]:.2f} (<= {RATIO_MAX:g}: {_met(per[1] / first[1])})",
                "yes" if proof.holds and again[0][0] == len(proof.verdicts) else "no",
            )
        )  # fmt: skip
    return [
        Table(
            "Static obligations of generated cells",
            "The family `workshop`: machines in cells of four, ten transitions each, which share robots and conveyors. "
            "Seconds to split and prove, milliseconds a transition, and these as a multiple of the smallest cell's; "
            "seconds to state it anew, compare and have cvc5 answer, and the same multiple; whether all is shown.",
            (
                "net", "transitions", "obligations", "prove, s", "ms/transition", "x smallest", "check again, s",
                "x smallest", "all shown",
            ),
            tuple(rows),
        )
    ]  # fmt: skip


def _met(ratio: float) -> str:
    return MET if ratio <= RATIO_MAX else MISSED
