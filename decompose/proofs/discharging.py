"""Deciding the obligations of a static family: each by z3, from the text that is left for any other solver.

The verdict rests on the file of its family, in which the negated obligation stands under its name: `unsat` proves it,
whoever says so. Where z3 finds a model instead, the terms are asked for one whose values the verdict shows, in the
net's own names and with what either side says of it; the file then has the answer `sat`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from firable.analysis.induction.smt import Answer, Decision, Operator, decide, value, variables
from firable.decompose.proofs.family import Proved, Task
from firable.decompose.proofs.obligation import Obligation
from firable.decompose.proofs.script import Reader, block, head
from firable.decompose.proofs.sides import Sides
from firable.nets.bundle import file_stem
from firable.nets.verdict import Status, Verdict, Witness

METHOD = "z3, of the negated obligation"


def static(name: str, says: str, obligations: Callable[[Sides], Iterator[Obligation]]) -> Callable[[Task], Proved]:
    """The proof of a family that lists obligations: all verdicts, and one file of this name."""

    def prove(task: Task) -> Proved:
        file, reader = evidence_name(name), Reader(task.timeout_ms)
        text, verdicts = [head(comments(name, says, task.decomposition.net.name))], list[Verdict]()
        proved: set[str] = set()
        for obligation in obligations(task.sides):
            text.append(block(obligation.name, obligation.statement, obligation.asserted))
            answer = reader.answer(text[-1])
            verdict = _verdict(obligation, answer, task.timeout_ms, file)
            if verdict.holds and (doubted := [name for name in obligation.rests_on if name not in proved]):
                bound = f"it rests on '{doubted[0]}', which is not proved"
                verdict = replace(verdict, status=Status.UNKNOWN, bound=bound)
            verdicts.append(verdict)
            proved |= {verdict.name} if verdict.holds else set()
        return Proved(verdicts, {file: "".join(text)} if verdicts else {})

    return prove


def evidence_name(family: str) -> str:
    """The name of the file of a family.

    >>> evidence_name("eq9-10")
    'eq9-10.smt2'
    """
    return f"{file_stem(family)}.smt2"


def comments(name: str, says: str, net: str) -> list[str]:
    """What stands at the head of a file."""
    return [
        f"{name} of the decomposition of '{net}': {says}",
        "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
        "The constants: a place holds a token, a signal is 1, a transition fires or is enabled, a fact is so.",
        "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
    ]


def _verdict(obligation: Obligation, answer: Answer, timeout_ms: int, file: str) -> Verdict:
    def verdict(status: Status, *, hint: str = "", bound: str = "", witness: Witness | None = None) -> Verdict:
        return Verdict(
            obligation.name,
            status,
            obligation.statement,
            METHOD,
            obligation.weight,
            code="F4002" if status is Status.VIOLATED else "",
            hint=hint,
            bound=bound,
            subjects=obligation.subjects,
            witness=witness,
            evidence=(file,),
            discipline=obligation.discipline,
        )

    if answer is Answer.UNSAT:
        return verdict(Status.PROVED)
    decision = decide(obligation.asserted, timeout_ms=timeout_ms) if answer is Answer.SAT else Decision(answer)
    if decision.answer is Answer.SAT:
        return verdict(
            Status.VIOLATED,
            hint="split the net anew: subnets and table are not to be edited",
            witness=_witness(obligation, decision),
        )
    return verdict(Status.UNKNOWN, bound=f"z3 gave up{': ' * bool(decision.reason)}{decision.reason}", hint=_MORE_TIME)


_MORE_TIME = "allow more time"


def _witness(obligation: Obligation, decision: Decision) -> Witness:
    """The values that refute the obligation: of all its variables, or of those in the parts of its claim that fail."""
    claim = obligation.claim
    parts = claim.operands if claim.operator is Operator.AND else (claim,)
    failing = [part for part in parts if not value(part, decision.assignment)]
    steps = {of.operands[0].name: of.operands[1] for of in obligation.definitions}
    shown = dict.fromkeys(variables(failing))
    for step in reversed(steps):  # each is defined by those before it
        if step in shown:
            shown.update(dict.fromkeys(variables([steps[step]])))
    assignment = tuple((name, decision.assignment[name]) for name in shown if name not in steps)
    says = [f"{side}: {int(value(term, decision.assignment))}" for side, term in obligation.sides]
    return Witness(assignment=assignment, note=", ".join(says))
