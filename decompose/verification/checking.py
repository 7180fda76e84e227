"""Checking a bundle again, from the bundle alone: does what it holds show what it claims?

It trusts nobody who made it. Hashes and seals say that nothing was damaged on the way; whoever edits a bundle can make
them anew. So everything is derived a second time, by code that shares nothing with the first:

1. the net is cut anew, and subnets, table and groups must be that cut, name for name (`recut`);
2. what must be proved is stated anew; each SMT-LIB 2 file must say exactly this, and a second solver answer `unsat`
   after every name (`restating`, `reading`, `obligations`);
3. the theorem on the protocol must be the one that is published, and the second solver confirm it (`protocol`); where
   the bundle speaks of the protocol of this very net, the net of that is made anew, too (`explored`), and what is left
   of the central net when somebody is dead (`outages`); where it says of which conceptual net and tasks its net is
   made, they are opened anew, and both nets related (`refinement`);
4. where the bundle names machines, the loops that they close are closed anew, and their documents must show that they
   keep each gate that a vote relies on, what the cell does with them, and what their faults lead to (`machines`); the
   verdicts on the central net must be those that its documents of evidence show (`documents`), and each part that is
   free of promise must be one by the arcs, and its vote shown to be persistent, by an obligation or a document
   (`free_parts`);
5. nothing is left over: no file that nobody needs, no verdict that nobody knows; and nothing is left out: each verdict
   that every net has is there, warnings too.

There are three endings. Everything is shown; something is only claimed, since no evidence is on it, a solver gave up or
it was left undecided; or something says what is not so, and then the bundle is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from firable.decompose.verification.checked import CheckedVerdict, Examination
from firable.decompose.verification.documents import check_verdicts_on_the_net
from firable.decompose.verification.explored import check_explored
from firable.decompose.verification.free_parts import check_free_parts
from firable.decompose.verification.machines import check_machines
from firable.decompose.verification.obligations import check_obligations
from firable.decompose.verification.outages import check_outages
from firable.decompose.verification.protocol import check_protocol
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.refinement import check_refinement
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import SOLVERS, Answers
from firable.nets.bundle import Bundle
from firable.nets.diagnostics import InputError
from firable.nets.right_to_run import unproved
from firable.nets.verdict import NOTHING

TIMEOUT_MS: Final = 60_000


def check_bundle(
    bundle: Bundle,
    *,
    solver: str = "cvc5",
    timeout_ms: int = TIMEOUT_MS,
    begins: Callable[[str], object] = lambda _: None,
) -> tuple[CheckedVerdict, ...]:
    """Judge every verdict of a bundle, in their order; `timeout_ms` is for each question.

    `begins` is told what is done next. Ctrl-C ends the check: what was not judged yet is only claimed then.

    Raises `InputError`: F5002 where a verdict that the net requires is not proved, F6002 where the bundle does not show
    what it claims, and `ModuleNotFoundError` where the solver is not installed. Takes time linear in the bundle, but
    for what its documents of evidence take.
    """
    if problems := unproved(bundle):
        raise InputError(problems)
    try:
        return _checked(bundle, solver, timeout_ms, begins)
    except NotShownError as error:
        raise error.as_input_error() from None


def _checked(
    bundle: Bundle, solver: str, timeout_ms: int, begins: Callable[[str], object]
) -> tuple[CheckedVerdict, ...]:
    answers = SOLVERS[solver]
    answers("(set-logic QF_UF)", timeout_ms)  # a solver that is not there is missed before the work is done
    examination = Examination(bundle)
    try:
        _judge_all(examination, solver, answers, timeout_ms, begins)
    except KeyboardInterrupt:
        left = list(examination.unjudged())
        if not left:  # what follows the last verdict was not seen to its end, and nothing would say so
            raise
        for verdict in left:
            examination.judge(verdict, shown=False, method=NOTHING, only_claimed="interrupted")
    return tuple(examination.checked[verdict.name] for verdict in bundle.verdicts)


def _judge_all(
    examination: Examination, solver: str, answers: Answers, timeout_ms: int, begins: Callable[[str], object]
) -> None:
    bundle = examination.bundle
    begins("cutting the net anew")
    cut = check_cut(bundle.decomposition)
    begins(f"the obligations, stated anew and answered by {solver}")
    check_obligations(examination, cut, solver, answers, timeout_ms)
    begins("the theorem on the protocol")
    check_protocol(examination, solver, answers, timeout_ms)
    begins("the protocol of this net")
    check_explored(examination, cut, solver, answers, timeout_ms)
    check_outages(examination, cut, answers, timeout_ms)
    check_machines(examination, cut, answers, timeout_ms)
    begins("the refinement")
    check_refinement(examination, solver, answers, timeout_ms)
    begins("the evidence on the net")
    check_verdicts_on_the_net(examination, answers, timeout_ms)
    check_free_parts(examination, cut)
    for verdict in list(examination.unjudged()):
        raise NotShownError(f"nobody knows what '{verdict.name}' is on", "verdicts", verdict.name)
    if unused := sorted(set(bundle.evidence) - examination.used):
        raise NotShownError(f"no verdict rests on '{unused[0]}'", "evidence", unused[0])
