"""Asking z3 until a deadline, and not a tenth of a second longer.

Each technique has a context of its own, for contexts must not be shared by the threads that race each other. While
z3 thinks, another thread looks at the deadline, which may be the clock or the flag that a winner sets, and interrupts
the context; z3's own timeout knows the clock only.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from threading import Event, Thread
from typing import Final

import z3

from firable.analysis.deadline import Deadline
from firable.analysis.induction.smt import SEED

WEIGHTS_MAX: Final = 2**31 - 1
"""What the weights of a pseudo-Boolean constraint may come to together, or z3 refuses it."""
_POLL_SECONDS: Final = 0.05


def solver_of(context: z3.Context, *, logic: str = "") -> z3.Solver:
    """A solver that gives the same answers and models every time."""
    solver = z3.SolverFor(logic, ctx=context) if logic else z3.Solver(ctx=context)
    solver.set("random_seed", SEED)
    return solver


def answer(solver: z3.Solver, deadline: Deadline, assumed: Sequence[z3.BoolRef] = ()) -> z3.CheckSatResult:
    """What z3 says of the assertions and what is assumed: `unknown` where the deadline came first, or it gives up.

    Raises `KeyboardInterrupt` where the user ended it: z3 takes the signal for itself and calls it an answer.
    """
    if deadline.over:
        return z3.unknown
    if deadline.cancelled is None:
        if deadline.at_seconds != inf:
            solver.set("timeout", deadline.left_milliseconds)
        found = solver.check(*assumed)
        stopped = deadline.over
    else:
        done = Event()
        watcher = Thread(target=_watch, args=(solver.ctx, deadline, done), daemon=True)
        watcher.start()
        try:
            found = solver.check(*assumed)
        finally:
            done.set()
            watcher.join()
        stopped = deadline.over
    if found == z3.unknown and not stopped and "interrupted" in solver.reason_unknown():
        raise KeyboardInterrupt
    # Interrupted as it was about to answer, z3 may call it satisfiable and have no model.
    return z3.unknown if found == z3.sat and stopped else found


def _watch(context: z3.Context, deadline: Deadline, done: Event) -> None:
    while not done.wait(_POLL_SECONDS):
        if deadline.over:
            context.interrupt()
