"""The verdicts on the protocol of this very net: its net is made anew, and a second solver answers what is asked of it.

A bundle may hold them or not; where it holds one of a family, it holds them all. The file of the family must be the one
that is stated anew, byte for byte, so no step of the protocol and no place is another one, nothing is asked less, and
no other net's file will do. What the solver's answers come to is argued in docs/protocol.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.formulas import spelled
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers, answers_to, gave_up
from firable.decompose.verification.voting import Voting
from firable.decompose.verification.voting_obligations import Obligations
from firable.nets.verdict import NOTHING, Status, Verdict

TITLES: Final = {
    "explored": "the protocol of this very net does what the net does, and nothing is lost by it",
    "faults": "while messages are lost and doubled and everybody crashes and restarts, too",
}
"""The families, and what each says."""

_METHOD: Final = "z3, of an inductive invariant of the protocol's net"  # what each such verdict says of itself
_FAULTS: Final = "while messages are lost and doubled, and controllers and coordinators crash and restart"
_SAFE: Final = {
    "follows": "whatever the protocol fires, the central net can fire",
    "agrees": "where no order is on its way, the controllers hold the marking of the central net",
    "orders-fit": "an order to fire finds its part firable, or free of promise with inputs full and outputs empty",
}
_COMPLETE: Final = {
    "complete": (
        "whatever the central net may fire next, the protocol can still fire next "
        "(branching bisimilar, its steps hidden)"
    ),
    "one-token": (
        "no step finds a full place that it would fill, but where the central net has contact, "
        "or an order under way takes the token of a part free of promise"
    ),
    "divergence": (
        "while nothing fires, a run goes on for ever only by repeating requests, votes or orders, or giving rounds up"
    ),
}
_RESUMES: Final = "when faults have ceased, whatever the central net may fire next, the protocol can fire next"

_RESTS_ON: Final = {
    "follows": {"starts", "keeps", "follows"},
    "agrees": {"starts", "keeps", "agrees"},
    "orders-fit": {"starts", "keeps", "orders-fit"},
    "complete": {"starts", "keeps", "follows", "home", "homeward", "way"},
    "resumes": {"starts", "keeps", "follows", "home", "homeward", "way"},
    "one-token": {"starts", "keeps", "one-token"},
    "divergence": {"divergence"},
}
"""The kinds of obligations that show each verdict."""


def check_explored(examination: Examination, cut: Cut, solver: str, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on the protocol of the net that was cut; raises `NotShownError` where one is not shown."""
    for family in TITLES:
        if any(verdict.name.startswith(f"{family}.") for verdict in examination.bundle.verdicts):
            free = frozenset(examination.bundle.decomposition.free)
            stated = Obligations(Voting(cut, family == "faults", free))
            found = answered(examination, stated, answers, timeout_ms)
            for name, answer in found.refuted:  # each verdict of the family must hold, and all rest on the one file
                raise refuted(f"{family}.smt2", name, answer)
            _judge(examination, stated, solver, {name.partition(".")[0] for name in found.open_})


def same_text(examination: Examination, stated: Obligations) -> str:
    """The name of the file of a family, which must be the one that is stated anew."""
    file = f"{stated.family}.smt2"
    if examination.text(file) != stated.text:
        message = f"'{file}' is not what must be proved of the protocol of this net"
        raise NotShownError(message, "evidence", file)
    return file


def _sentences(stated: Obligations) -> dict[str, str]:
    """The verdicts of a family, by their names without it."""
    safe = {name: words for name, words in _SAFE.items() if name in stated.names}
    if not stated.voting.faults:
        return safe | _COMPLETE
    return {name: f"{words}, {_FAULTS}" for name, words in safe.items()} | {"resumes": _RESUMES}


@dataclass(frozen=True, slots=True)
class Found:
    """The obligations of a file that the solver gave up, and those that it refutes, with what it says of them."""

    open_: tuple[str, ...]
    refuted: tuple[tuple[str, str], ...]


def refuted(file: str, name: str, answer: str) -> NotShownError:
    """What is said where a verdict rests on what the solver refutes."""
    return NotShownError(f"'{name}' of '{file}' is refuted: the solver says {answer}", "evidence", file)


def answered(examination: Examination, stated: Obligations, answers: Answers, timeout_ms: int) -> Found:
    """What the solver answers to the file of a family, which must be the one that is stated anew."""
    file = same_text(examination, stated)
    said = answers_to(file, stated.text, map(spelled, stated.names), answers, timeout_ms)
    unshown = [(name, answer) for name, answer in zip(stated.names, said, strict=True) if answer != "unsat"]
    late = tuple(name for name, answer in unshown if gave_up(answer))
    return Found(late, tuple((name, answer) for name, answer in unshown if not gave_up(answer)))


def _judge(examination: Examination, stated: Obligations, solver: str, open_: set[str]) -> None:
    for name, words in _sentences(stated).items():
        verdict = examination.verdict(f"{stated.family}.{name}")
        file = f"{stated.family}.smt2"
        if verdict != Verdict(verdict.name, Status.PROVED, words, _METHOD, evidence=(file,)):
            message = f"the verdict on '{verdict.name}' is not what its proof shows"
            raise NotShownError(message, "verdicts", verdict.name)
        shown = open_.isdisjoint(_RESTS_ON[name])
        method = f"{solver}, of an inductive invariant of the protocol's net, made anew" if shown else NOTHING
        examination.judge(verdict, shown=shown, method=method, only_claimed="" if shown else f"{solver} gave up")
