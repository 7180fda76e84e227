"""A session with z3 that ends when nobody wants the answer any more.

Methods that race each other run in threads, and each of them may be told at any moment that another one was first. A
solver in the middle of a question hears nothing of that, so a second thread listens for it and interrupts the solver.
It interrupts again and again until the session ends: an interruption that comes between two questions is lost.

Every session has a context of its own, because one context of z3 may be used by one thread only. The solver is z3's
for finite domains (`QF_FD`): clauses and sums over Booleans, learnt clauses kept from question to question, and what an
answer rested on as a core of the assumptions. The rejected alternative, a timeout of some milliseconds for each
question asked anew, throws away what the solver was about to learn.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from threading import Event, Thread, current_thread, main_thread
from types import TracebackType
from typing import Any, Final

import z3

from firable.analysis.goal import Limits
from firable.analysis.induction.smt import SEED, Answer, Term, subterms, z3_term

_LISTEN_SECONDS: Final = 0.03


class LimitReachedError(Exception):
    """The deadline came before the answer, or the memory was used up."""


class Session:
    """Solvers in one context of z3, ended by a deadline or by the memory that z3 takes; a context manager.

    >>> from firable.analysis.goal import Limits
    >>> from firable.analysis.induction.smt import Terms
    >>> terms = Terms()
    >>> p = terms.variable("p")
    >>> with Session(Limits()) as session:
    ...     solver = session.solver()
    ...     solver.add(session.translated([terms.negation(p)]))
    ...     session.ask(solver), session.ask(solver, session.variable("p"))
    (<Answer.SAT: 'sat'>, <Answer.UNSAT: 'unsat'>)
    """

    def __init__(self, limits: Limits) -> None:
        self.deadline = limits.deadline
        self._memory_mebibytes = max(1, limits.memory_bytes >> 20)
        self.context = z3.Context()
        self._translated: dict[Term, Any] = {}
        self._ended = Event()
        self._listener = Thread(target=self._listen, daemon=True)

    def __enter__(self) -> Session:
        self._listener.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._ended.set()
        self._listener.join()

    def _listen(self) -> None:
        while not self._ended.wait(_LISTEN_SECONDS):
            if self.deadline.over:
                self.context.interrupt()

    def solver(self) -> z3.Solver:
        """A solver for Boolean terms and weighted sums of them, that keeps what it has learnt."""
        solver = z3.SolverFor("QF_FD", ctx=self.context)
        solver.set("random_seed", SEED)
        solver.set("max_memory", self._memory_mebibytes)
        # z3 answers Ctrl-C by itself, in whatever thread it is; only the main thread may.
        solver.set("ctrl_c", current_thread() is main_thread())
        return solver

    def variable(self, name: str) -> z3.BoolRef:
        """The Boolean of this name."""
        return z3.Bool(name, self.context)

    def translated(self, terms: Sequence[Term]) -> list[z3.BoolRef]:
        """The terms as z3's own, in this context; what they share is shared, also with earlier ones.

        Raises `LimitReachedError` where the deadline comes first.
        """
        made = self._translated
        for count, term in enumerate(subterms(terms)):
            if count % 4096 == 4095:
                self.check_time()
            if term in made:
                continue
            made[term] = z3_term(term, [made[operand] for operand in term.operands], self.context)
        return [made[term] for term in terms]

    def some(self, operands: Iterable[z3.BoolRef]) -> z3.BoolRef:
        """The OR of z3's own terms, of none too."""
        operands = list(operands)
        return z3.Or(operands) if operands else z3.BoolVal(val=False, ctx=self.context)

    def check_time(self) -> None:
        """Raise `LimitReachedError` where the deadline has come."""
        if self.deadline.over:
            raise LimitReachedError

    def ask(self, solver: z3.Solver, *assumptions: z3.BoolRef) -> Answer:
        """Whether all that the solver holds can be true together with the assumptions; never UNKNOWN.

        Raises `LimitReachedError` at a limit, and `KeyboardInterrupt` where the user ends the solver.
        """
        self.check_time()
        try:
            found = solver.check(*assumptions)
        except z3.Z3Exception as error:
            if "memory" not in str(error):
                raise
            raise LimitReachedError(str(error)) from None
        if found == z3.unknown:
            self.check_time()
            reason = solver.reason_unknown()
            if "interrupted" in reason or "canceled" in reason:
                raise KeyboardInterrupt
            raise LimitReachedError(reason)
        return Answer.SAT if found == z3.sat else Answer.UNSAT
