"""What holds of a net: by its markings, held in a table or a diagram, by its structure, by a solver.

What a program imports from here: `explore` gives the `ReachabilityGraph` of a net within a `Budget`,
`explore_symbolically` its `SymbolicSpace`, and `report_on` the `CheckReport` of either, with every verdict and with the
`Figures` behind them. `p_invariants`, `t_invariants`, `minimal_siphons`, `minimal_traps` and `deadlock_trap` read the
arcs alone, and may be given a `Deadline`. `eager_run` is the run under the arbiters with all gates open; `isomorphic`,
`weakly_bisimilar` and `branching_bisimilar` compare two graphs. What needs the whole graph raises `IncompleteGraph`,
and `BudgetExceeded` where memory or time ends.

    from firable.analysis import Budget, explore, report_on

    report = report_on(explore(net, "step", Budget(seconds=60)))

`check` and `net_class` are functions that have the names of their modules, and are imported from there: `from
firable.analysis.check import check` chooses among these and all other techniques by itself.

The names are loaded when they are asked for: numpy and z3 take a second, and belong to the extra `prove`.
"""

from typing import TYPE_CHECKING, Final

from firable.nets.lazy import loaded_when_asked

if TYPE_CHECKING:
    from firable.analysis.deadline import Deadline
    from firable.analysis.report import CheckReport, Figures, report_on
    from firable.analysis.spaces.equivalence import branching_bisimilar, isomorphic, weakly_bisimilar
    from firable.analysis.spaces.reachability import Budget, BudgetExceeded, IncompleteGraph, ReachabilityGraph, explore
    from firable.analysis.spaces.symbolic import SymbolicSpace, explore_symbolically
    from firable.analysis.structure.commoner import deadlock_trap
    from firable.analysis.structure.invariants import p_invariants, t_invariants
    from firable.analysis.structure.siphons import minimal_siphons, minimal_traps
    from firable.analysis.verdicts.starvation import eager_run

__all__ = [
    "Budget",
    "BudgetExceeded",
    "CheckReport",
    "Deadline",
    "Figures",
    "IncompleteGraph",
    "ReachabilityGraph",
    "SymbolicSpace",
    "branching_bisimilar",
    "deadlock_trap",
    "eager_run",
    "explore",
    "explore_symbolically",
    "isomorphic",
    "minimal_siphons",
    "minimal_traps",
    "p_invariants",
    "report_on",
    "t_invariants",
    "weakly_bisimilar",
]

_MODULES: Final = {
    "report": ("CheckReport", "Figures", "report_on"),
    "deadline": ("Deadline",),
    "spaces.equivalence": ("branching_bisimilar", "isomorphic", "weakly_bisimilar"),
    "structure.commoner": ("deadlock_trap",),
    "structure.invariants": ("p_invariants", "t_invariants"),
    "spaces.reachability": ("Budget", "BudgetExceeded", "IncompleteGraph", "ReachabilityGraph", "explore"),
    "spaces.symbolic": ("SymbolicSpace", "explore_symbolically"),
    "structure.siphons": ("minimal_siphons", "minimal_traps"),
    "verdicts.starvation": ("eager_run",),
}

if not TYPE_CHECKING:  # type checkers read the imports above, and so see a name that is misspelt
    __getattr__ = loaded_when_asked(__name__, _MODULES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
