"""The integer programme behind Parikh vectors: how often each transition fires on a shortest way into a goal.

Columns: for each transition of the ordinary net (`ordinary.py`) how often it fires; for each place whether it is full
in the end; the indicators of the goal. Rows: the state equation, so many tokens at first, and so many more and fewer by
what fires, make the last marking; the goal (`goal_rows.py`); cuts. Least is the sum of the firings.

The solver is HiGHS, which computes in floating point: what it finds is a plan and what it does not find proves nothing.
One thread, one seed and a gap that is relative, so the same programme has the same answer. The matrix is made by numpy:
made row by row, it takes longer than most programmes to solve.

Rejected: z3, which knows whole numbers for certain. Its plans are four times as long, so that most cannot be fired, and
of the largest nets it has none after minutes where HiGHS needs a second. SciPy brings HiGHS too, in 35 MB instead
of 3, and cannot be interrupted.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from itertools import chain
from threading import Event, Thread
from typing import Final

import numpy as np
from highspy import Highs, HighsModelStatus, HighsVarType, MatrixFormat, ObjSense, kHighsInf
from numpy.typing import NDArray

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.structure.goal_rows import OUT_OF_TIME, GoalRows
from firable.analysis.structure.ordinary import Ordinary

_GAP: Final = 0.2  # a plan a little longer than needed, found much sooner
_PROBING: Final = 1 << 15  # a rule of HiGHS's presolve, which may take longer than all else together
_SEED: Final = 1
_POLL_SECONDS: Final = 0.05
_SIZE_MAX: Final = 250_000
"""How many columns, rows and entries a programme may have: the solver is deaf while it prepares its search, for some
tenths of a second at this size, and for many seconds at four times as much."""
_BYTES_EACH: Final = 1_000  # of the solver, for each of these

Plan = dict[int, int]
"""How often transitions fire, by their positions in the ordinary net; those that do not are left out."""
Numbers = NDArray[np.float64]
Indexes = NDArray[np.int32]


def require_room(size: int, memory_bytes: int) -> None:
    """Raises `BudgetExceeded` where a programme of so many columns, rows and entries is none for the solver."""
    if size > _SIZE_MAX:
        raise BudgetExceeded("the integer programme is too large")
    if size * _BYTES_EACH > memory_bytes:
        raise BudgetExceeded("the budget of memory does not hold the integer programme")


class Programme:
    """The plans that lead from a marking into the goal, by the state equation; no transition fires too often."""

    def __init__(self, of: Ordinary, goal: GoalRows, firings_max: int, memory_bytes: int) -> None:
        """Raises `BudgetExceeded` where the programme is too large, in itself or for so many bytes."""
        self.of, self.firings_max = of, firings_max
        n_transitions, n_rows = len(of.transitions), of.n_places + len(goal.rows)
        n_columns = n_transitions + goal.n_columns
        rows = [_state_equation(of), _goal(goal, of.n_places, n_transitions)]
        entries = _Entries(*(np.concatenate(parts) for parts in zip(*(row.parts for row in rows), strict=True)))
        require_room(n_columns + n_rows + len(entries.row), memory_bytes)
        self._tokens = np.zeros(of.n_places)
        upper = np.ones(n_columns)
        upper[:n_transitions] = firings_max
        costs = np.zeros(n_columns)
        costs[:n_transitions] = 1
        least = np.array([least for _, least in goal.rows], np.float64)
        self._solver = _Solver()
        self._solver.passModel(
            n_columns,
            n_rows,
            len(entries.row),
            int(MatrixFormat.kRowwise),
            int(ObjSense.kMinimize),
            0.0,
            costs,
            np.zeros(n_columns),
            upper,
            np.concatenate([self._tokens, least]),
            np.concatenate([self._tokens, np.full(len(least), kHighsInf)]),
            *entries.rowwise(n_rows),
            np.full(n_columns, int(HighsVarType.kInteger), np.int32),
        )
        self._n_rows, self._n_columns = n_rows, n_columns

    def weigh(self, costs: Sequence[float]) -> None:
        """Give a firing of each transition another cost than 1."""
        self._solver.changeColsCost(len(costs), np.arange(len(costs), dtype=np.int32), np.array(costs))

    def start_from(self, full: Set[int]) -> None:
        """Lead from the marking in which these places are full, without cuts."""
        tokens = np.zeros(self.of.n_places)
        tokens[sorted(full)] = 1
        for p in np.flatnonzero(tokens != self._tokens).tolist():
            self._solver.changeRowBounds(p, -tokens[p], -tokens[p])  # firings - last marking = - first marking
        self._tokens = tokens
        rows, columns = self._solver.getNumRow(), self._solver.getNumCol()
        if rows > self._n_rows:
            self._solver.deleteRows(rows - self._n_rows, np.arange(self._n_rows, rows, dtype=np.int32))
            self._solver.deleteCols(columns - self._n_columns, np.arange(self._n_columns, columns, dtype=np.int32))

    def cut(self, transitions: Sequence[int], suppliers: Sequence[int]) -> None:
        """From now on each of these transitions fires only where one of the suppliers does."""
        # By a column that is above 0 only where a supplier fires: their pairs would be as many as the product of both.
        n, supplied = len(transitions), self._solver.getNumCol()
        self._solver.addCol(0.0, 0.0, 1.0, 0, [], [])
        columns = np.empty(2 * n + len(suppliers) + 1, np.int32)
        weights = np.ones(len(columns))
        columns[: 2 * n : 2], weights[: 2 * n : 2] = transitions, -1
        columns[1 : 2 * n : 2], weights[1 : 2 * n : 2] = supplied, self.firings_max
        columns[2 * n : -1] = suppliers
        columns[-1], weights[-1] = supplied, -1
        starts = np.arange(0, 2 * n + 1, 2, dtype=np.int32)
        self._solver.addRows(n + 1, np.zeros(n + 1), np.full(n + 1, kHighsInf), len(columns), starts, columns, weights)

    def plan(self, deadline: Deadline) -> Plan | None:
        """A plan that costs little, None where the solver finds that there is none.

        Raises `BudgetExceeded` where the deadline came first, or the solver gave up.
        """
        if (left := deadline.left_seconds) is not None:
            self._solver.setOptionValue("time_limit", self._solver.getRunTime() + left)
        _run(self._solver, deadline)
        said = self._solver.getModelStatus()
        if said in (HighsModelStatus.kInfeasible, HighsModelStatus.kUnboundedOrInfeasible):
            return None
        if said != HighsModelStatus.kOptimal:
            raise BudgetExceeded(OUT_OF_TIME if deadline.over else "the solver gave up")
        counts = np.rint(np.array(self._solver.getSolution().col_value[: len(self.of.transitions)])).astype(int)
        return {k: int(counts[k]) for k in np.flatnonzero(counts).tolist()}


class _Solver(Highs):
    """HiGHS as it is used here.

    Without its greeting, which comes with the callbacks, and so before anybody can set an option.
    """

    def __init__(self) -> None:
        Highs.__init__(self)
        options = {"threads": 1, "random_seed": _SEED, "mip_rel_gap": _GAP, "presolve_rule_off": _PROBING}
        for name, value in options.items():
            self.setOptionValue(name, value)
        self.HandleUserInterrupt = True

    def enableCallbacks(self) -> None:  # noqa: N802 - the name is HiGHS's
        self.silent()
        Highs.enableCallbacks(self)


def _run(solver: Highs, deadline: Deadline) -> None:
    """Let the solver work, in a thread that is gone afterwards, until it has an answer or the deadline is over."""
    done = Event()  # a thread whose `join` Ctrl-C interrupts calls itself dead from then on

    def work() -> None:
        try:
            solver.run()
        finally:
            done.set()

    worker = Thread(target=work, daemon=True)
    worker.start()
    try:
        while not done.wait(_POLL_SECONDS) and not deadline.over:
            pass
    finally:
        if not done.is_set():
            solver.cancelSolve()
            done.wait()
        worker.join()


@dataclass(frozen=True)
class _Entries:
    """The entries of a sparse matrix that are not 0."""

    row: Indexes
    column: Indexes
    weight: Numbers

    @property
    def parts(self) -> tuple[Indexes, Indexes, Numbers]:
        return self.row, self.column, self.weight

    def rowwise(self, n_rows: int) -> tuple[Indexes, Indexes, Numbers]:
        """Where each row starts, and the columns and weights of all, row after row."""
        order = np.argsort(self.row, kind="stable")
        starts = np.zeros(n_rows + 1, np.int32)
        np.cumsum(np.bincount(self.row, minlength=n_rows), out=starts[1:])
        return starts, self.column[order], self.weight[order]


def _state_equation(of: Ordinary) -> _Entries:
    """For each place what each transition adds to it and takes from it, and less the last marking."""
    puts, takes = _ends(of.outputs, of.n_places), _ends(of.inputs, of.n_places)
    reads = np.intersect1d(puts, takes, assume_unique=True)
    added, taken = (np.setdiff1d(ends, reads, assume_unique=True) for ends in (puts, takes))
    transition, place = np.divmod(np.concatenate([added, taken]), of.n_places or 1)
    places = np.arange(of.n_places)
    return _Entries(
        np.concatenate([place, places]).astype(np.int32),
        np.concatenate([transition, len(of.transitions) + places]).astype(np.int32),
        np.repeat([1.0, -1.0], [len(added), len(taken) + of.n_places]),
    )


def _ends(sides: Sequence[Sequence[int]], n_places: int) -> NDArray[np.int64]:
    """The arcs on one side of the transitions, each as one number: transition times places, and the place."""
    lengths = np.fromiter(map(len, sides), np.int64, len(sides))
    places = np.fromiter(chain.from_iterable(sides), np.int64, int(lengths.sum()))
    return np.repeat(np.arange(len(sides)), lengths) * n_places + places


def _goal(goal: GoalRows, first_row: int, first_column: int) -> _Entries:
    lengths = np.fromiter((len(weights) for weights, _ in goal.rows), np.int64, len(goal.rows))
    total = int(lengths.sum())
    columns = np.fromiter(chain.from_iterable(weights for weights, _ in goal.rows), np.int32, total)
    weighted = np.fromiter(chain.from_iterable(weights.values() for weights, _ in goal.rows), np.float64, total)
    rows = np.repeat(np.arange(first_row, first_row + len(goal.rows), dtype=np.int32), lengths)
    return _Entries(rows, columns + np.int32(first_column), weighted)
