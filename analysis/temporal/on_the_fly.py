"""LTL on the fly: the first run that refutes a formula ends the search, so most of a space need not be there.

The product of the net and the automaton of the negation is walked depth first by the engine, which ends at the first
component that is accepted (Couvreur 1999; the search, and what was rejected for it, stand in
`analysis/engine/src/lasso/mod.rs`). A formula that fails is refuted by what was met up to then; one that holds takes
all markings that the automaton can follow, which are often few: what cannot refute it any more has no state.

Which order of firings comes round soonest cannot be seen beforehand. So the order of the net and drawn ones are tried
in turn, with budgets that grow; all is counted in vertices, not seconds. Edges of the automaton come in the order of
their distance to acceptance, and those that lead to none are left out.

Beside the net itself the net reduced for the formula is searched, and with fewer firings at each marking. A run in
either is one of the net, so both refute a formula, whatever it is. That it holds they show only where the formula is
blind for stuttering, and the search that leaves out firings does not then either (why, `sparing.rs` says).

The run is judged by the definitions (`temporal.lasso.satisfies`) and replayed, as each of them is. Sets of markings
(`temporal.product`), which decide all formulas of a space that is there, keep their place: a fixed point on a diagram
sees 10^20 markings at once, where this sees one after the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Final, NamedTuple

from firable.analysis._engine import BudgetExceeded, IncompleteGraph, Lasso, find_lasso
from firable.analysis.compiled import Flat, Node, engine_limits, flat, nodes_of
from firable.analysis.goal import Limits
from firable.analysis.question import Known, no, yes
from firable.analysis.reduction.reducer import Reducer
from firable.analysis.spaces.reachability import REASONS
from firable.analysis.spaces.space import WitnessError
from firable.analysis.temporal.automaton import Automaton, Edge, TimeEndedError, TooLargeError, automaton_of
from firable.analysis.temporal.lasso import Run, satisfies, witness_of
from firable.analysis.temporal.product import components, firings_of
from firable.analysis.temporal.rewriting import positive
from firable.nets.formula import And, Formula
from firable.nets.net import Net
from firable.nets.temporal import Temporal, negated
from firable.nets.temporal_parts import has_next
from firable.nets.verdict import Cost
from firable.semantics.trace import Discipline

if TYPE_CHECKING:
    from firable.analysis.reduction.reduce import ReducedRuns

METHOD: Final = "on the fly"
MARKS_MAX: Final = 64
"""How many untils an automaton may have to wait for at the same time."""
_VERTICES_MAX: Final = 2**32 - 2
_SPARED: Final = 4
"""So many times fewer, as each takes longer, where firings are left out."""
_REDUCING_SHARE: Final = 0.7
"""The part of the time left that the reduction may take: where it takes longer it is not begun."""
_BUDGETS: Final = (2**14, 2**18, 2**22)
"""Vertices of a search in the order of the net and of one in a drawn order, in turn; then one without a bound."""


class Turn(NamedTuple):
    """A search: the seed of its order, None for that of the net, and how many vertices it may meet.

    One that is `reduced` looks in the net reduced for the formula, and tells that there is no run only where the
    formula does not tell runs apart that stutter. One that is `sparing` leaves out firings that can wait; it cannot
    tell that.
    """

    seed: int | None
    vertices: int
    sparing: bool = False
    reduced: bool = False


Row = tuple[int, bool, list[int], bool, int, list[int]]
"""An edge of the engine: label, whether only the transitions listed are admitted, they, stutters, target, marks."""


def decide_ltl_on_the_fly(net: Net, formula: Temporal, limits: Limits, *, turns: Iterable[Turn] | None = None) -> Known:
    """Decide whether every maximal run from M0 satisfies a formula of LTL, under interleaving, gates free.

    `turns` are the searches that are tried, other than the usual ones. Raises `IncompleteGraph` where it is not
    decided, with how far was looked.

    Cost: for each vertex, a pair of a marking and a state of the automaton, the formulas at the state and the
    transitions that the last firing touched; 8 bytes a word of the marking and some 20 besides.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> net = catalogue_net("one_robot_mc_late")
    >>> [decide_ltl_on_the_fly(net, parse_temporal(text), Limits()).answer.holds for text in ("F start", "G F start")]
    [True, False]
    """
    return LtlOnTheFly(net)(formula, limits, turns=turns)


class LtlOnTheFly:
    """Formulas of LTL on one net; one that is asked again is not searched again as it was searched in vain."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self._searches: dict[Temporal, _Search] = {}
        self._reducer = Reducer(net)

    def __call__(self, formula: Temporal, limits: Limits, *, turns: Iterable[Turn] | None = None) -> Known:
        """As `decide_ltl_on_the_fly`."""
        if formula not in self._searches:
            refuting = positive(negated(formula))
            try:
                automaton = automaton_of(refuting, deadline=limits.deadline)
            except (TooLargeError, TimeEndedError) as error:
                raise IncompleteGraph(str(error) or "the time ended before the automaton was there") from error
            if automaton.n_marks > MARKS_MAX:
                raise IncompleteGraph(f"{automaton.n_marks} untils at one time are more than {MARKS_MAX}")
            self._searches[formula] = _Search(
                self.net, formula, automaton, self._reducer, stutters=not has_next(refuting)
            )
        return self._searches[formula].known(_turns() if turns is None else turns, limits)


def _turns() -> Iterator[Turn]:
    for seed, most in enumerate(_BUDGETS, 1):
        yield Turn(None, most)
        yield Turn(None, most, reduced=True)
        yield Turn(seed, most // _SPARED, sparing=True, reduced=True)
        yield Turn(seed, most)
        yield Turn(seed, most // _SPARED, sparing=True)
    yield Turn(None, _VERTICES_MAX)


class _Search:
    """The search for a run of a net that an automaton accepts, which refutes a formula.

    The automaton `stutters` where it does not matter to it how long a run stays with the same values of the atoms.
    """

    def __init__(self, net: Net, formula: Temporal, automaton: Automaton, reducer: Reducer, *, stutters: bool) -> None:
        self.net, self.formula, self.automaton, self.stutters = net, formula, automaton, stutters
        self._reducer = reducer
        self.vertices = self.edges = 0
        self.seconds = 0.0
        self._whole = _compiled(net, automaton)
        self._small: tuple[ReducedRuns, _Compiled] | None = None
        self._in_vain: set[Turn] = set()

    def known(self, turns: Iterable[Turn], limits: Limits) -> Known:
        """What the first turn says that decides it; those that did not are not tried again."""
        reduced, full, ended = self._small, set[Turn](), ""
        for turn in turns:
            kind = turn._replace(vertices=0)
            if not {turn, kind}.isdisjoint(self._in_vain | full):
                continue
            if turn.reduced and (reduced := reduced or self._reduced(limits)) is None:
                continue
            small = reduced if turn.reduced else None
            found = self._found(small[1] if small else self._whole, turn, limits)
            if not found.complete and found.reason not in {"markings", "memory"}:
                reason = REASONS.get(found.reason or "", found.reason)
                raise IncompleteGraph(f"{found.n_vertices:,} pairs of a marking and a state of the automaton: {reason}")
            if found.run is not None and small:
                if (run := self._lifted(small[0], found.run)) is not None:
                    return self._refuted(run, f"{METHOD}, after {small[0].summary}")
            elif found.run is not None:
                run = _run(*found.run)
                if satisfies(self.net, run, self.formula):
                    raise WitnessError("the run does not refute the formula")
                return self._refuted(run, METHOD)
            elif found.complete and not turn.sparing and (small is None or self.stutters):
                return Known(yes(), f"{METHOD}, after {small[0].summary}" if small else METHOD, self._cost)
            if found.reason == "memory":  # others may need less, and another time there may be more
                full.add(kind)
                ended = f": {REASONS['memory']}"
            elif small is None or small is self._small:  # one that has seen all sees no more with a larger budget
                self._in_vain.add(kind if found.complete else turn)
        raise IncompleteGraph(f"{self.vertices:,} pairs of a marking and a state of the automaton{ended}")

    @property
    def _cost(self) -> Cost:
        return Cost(self.vertices, self.edges, self.seconds)

    def _found(self, of: _Compiled, turn: Turn, limits: Limits) -> Lasso:
        found = find_lasso(
            *of.net,
            of.labels,
            of.rows,
            self.automaton.n_marks,
            seed=turn.seed,
            sparing=turn.sparing,
            max_vertices=turn.vertices,
            max_memory_bytes=limits.memory_bytes,
            **engine_limits(limits.deadline),
        )
        self.vertices, self.edges = self.vertices + found.n_vertices, self.edges + found.n_edges
        self.seconds += found.seconds
        return found

    def _reduced(self, limits: Limits) -> tuple[ReducedRuns, _Compiled] | None:
        """The net reduced for the atoms, and what the engine takes of it; one that time ended is not kept.

        None where edges speak of firings, of which a transition of the reduced net may be several, or time is short.
        """
        edges = [edge for edges in self.automaton.edges for edge in edges]
        if self._small is not None or any(edge.fires or edge.spared for edge in edges):
            return self._small
        left = limits.deadline.left_seconds
        if left is not None and _REDUCING_SHARE * left < self._reducer.takes_seconds:
            return None
        atoms = sorted({atom for edge in edges for atom in edge.atoms}, key=repr)
        within, began = replace(limits, deadline=limits.deadline.share(_REDUCING_SHARE)), perf_counter()
        try:
            reduced = self._reducer.for_runs(atoms, within)
        except BudgetExceeded:
            return None
        rows = [
            tuple(replace(edge, atoms=frozenset(reduced.labels[atom] for atom in edge.atoms)) for edge in edges)
            for edges in self.automaton.edges
        ]
        small = reduced, _compiled(reduced.net, replace(self.automaton, edges=tuple(rows)))
        self._small = None if within.deadline.over else small
        self.seconds += perf_counter() - began
        return small

    def _lifted(self, reduced: ReducedRuns, run: tuple[list[int], list[int]]) -> Run | None:
        """The run of the net that one of the reduced net stands for, if that one, too, does not satisfy the formula.

        It may: one that stays longer somewhere is no longer the same to an X.
        """
        names = [[reduced.net.transitions[t].name for t in part] for part in run]
        lifted = _run(*reduced.lift(*names))
        return None if satisfies(self.net, lifted, self.formula) else lifted

    def _refuted(self, run: Run, method: str) -> Known:
        end = "the cycle goes on for ever" if run.cycle else "the sequence ends in a deadlock"
        note = f"this run does not satisfy the formula: {end}"
        return Known(no(witness=witness_of(self.net, Discipline.INTERLEAVING, run, note)), method, self._cost)


def _run(prefix: Iterable[int], cycle: Iterable[int]) -> Run:
    return Run(tuple((t,) for t in prefix), tuple((t,) for t in cycle))


@dataclass(frozen=True, slots=True)
class _Compiled:
    """A net, the labels and the edges of an automaton as the engine takes them."""

    net: tuple[int, Flat, list[int]]
    labels: list[list[Node]]
    rows: list[list[Row]]


def _compiled(net: Net, automaton: Automaton) -> _Compiled:
    labels, rows = compiled(net, automaton)
    return _Compiled(flat(net), [nodes_of(net, label) for label in labels], rows)


def compiled(net: Net, automaton: Automaton) -> tuple[list[Formula], list[list[Row]]]:
    """The labels and edges of an automaton as the engine takes them, without those that lead to no acceptance.

    The edges of each state are in the order of their distance to acceptance.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> labels, rows = compiled(catalogue_net("one_robot"), automaton_of(positive(parse_temporal("F G start"))))
    >>> len(labels), [[target for *_, target, _ in row] for row in rows]
    (2, [[1, 0], [1]])
    """
    distance = _distances(automaton)
    labels: dict[frozenset[Formula], int] = {}
    rows = []
    for edges in automaton.edges:
        row: list[Row] = []
        for edge in sorted(edges, key=lambda edge: distance.get(edge.target, -1)):
            by = firings_of(net, edge.fires, edge.spared)
            if edge.target not in distance or (edge.fires and not by):
                continue
            label = labels.setdefault(edge.atoms, len(labels))
            marks = sorted(edge.marks)
            admitted = (True, sorted(by or ())) if edge.fires else (False, _indexes(net, edge))
            row.append((label, *admitted, not edge.fires, edge.target, marks))
        rows.append(row)
    return [And(tuple(sorted(atoms, key=repr))) for atoms in labels], rows


def _indexes(net: Net, edge: Edge) -> list[int]:
    return sorted(net.transition_index[name] for name in edge.spared)


def _distances(automaton: Automaton) -> dict[int, int]:
    """For each state how many edges it is away from a part of the automaton that can accept; none where it leads there.

    A part can accept if its inner edges have each mark.
    """
    distance: dict[int, int] = {}
    for part in components([[edge.target for edge in edges] for edges in automaton.edges]):
        inner = [edge for state in part for edge in automaton.edges[state] if edge.target in part]
        if inner and all(any(mark in edge.marks for edge in inner) for mark in range(automaton.n_marks)):
            distance.update(dict.fromkeys(part, 0))
    before: dict[int, list[int]] = {}
    for state, edges in enumerate(automaton.edges):
        for edge in edges:
            before.setdefault(edge.target, []).append(state)
    for state in (todo := list(distance)):
        for source in before.get(state, ()):
            if source not in distance:
                distance[source] = distance[state] + 1
                todo.append(source)
    return distance
