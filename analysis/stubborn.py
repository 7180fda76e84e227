"""Stubborn sets: goals, deadlocks and first firings by a search that leaves most orders of independent firings out.

In a marking only the members of a stubborn set are fired. The rules for such a set, derived for exactly our firing rule
(contact, both kinds of internal gates, external gates free), and the proof that the goal stays reachable, at the same
distance, stand in `analysis/engine/src/stubborn/mod.rs`; the search is the engine's. A set depends on the goal: what
must happen before the goal can hold is in it, or it could be put off for ever (Kristensen, Schmidt, Valmari 2006,
"Question-guided stubborn set methods for state properties"; Valmari, Hansen 2017, "Stubborn set intuition explained").

How long to think about each marking is not known beforehand: the thorough closure takes some five times as long as the
quick one and leaves a fortieth of the markings on one net, and more of them on the next. So both are tried in turn,
with budgets of markings that grow; the last word has the quick one. All of this is counted in markings, not seconds,
so the same net gives the same answer.

A firing is asked for each transition (`find_firings`), in rounds that grow: random walks make most of them fire
(`analysis/engine/src/stubborn/cover.rs`); then projections (`firable.analysis.projection.refining`) show many dead at
once, or lead to them, on a few components of the net. Where these close none, those that are open are asked for
together, which is one search where most of them fire, and then one by one, which is next to nothing where they are dead
for a reason nearby. What is dead because some tokens are too few for it the state equation sees at once.

The rejected alternative, stubborn sets that keep liveness or temporal properties, needs provisos on cycles and leaves
little to save; those questions are asked of the whole state space.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Any, Final, TypeVar

from firable.analysis._engine import BudgetExceeded, Search, Stubborn
from firable.analysis.compiled import engine_limits, flat, nodes_of
from firable.analysis.goal import Finding, Limits
from firable.analysis.projection.projected import ROOM, Explored, Room
from firable.analysis.projection.refining import Projections
from firable.analysis.question import Known, no, yes
from firable.analysis.spaces.reachability import REASONS
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.walk import SEED
from firable.nets.formula import Deadlock, Firable, Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.trace import Discipline

T = TypeVar("T")

METHOD: Final = "stubborn sets"
WALKS: Final = "random walks"
PROJECTION: Final = "projections"
EQUATION: Final = "state equation and traps"
_MARKINGS_MAX: Final = 2**32 - 2
_BUDGETS: Final = ((2**15, 2**13), (2**18, 2**16), (2**21, 2**19))
"""Markings of a quick and of a thorough search, in turn; then a quick one without a bound."""


Turn = tuple[bool, int]
"""A search: whether it is a thorough one, and how many markings it may find."""


def decide_by_stubborn_sets(net: Net, goal: Formula, limits: Limits, *, turns: Iterable[Turn] | None = None) -> Finding:
    """Decide whether a marking that satisfies the goal is reachable; where it is, with a shortest firing sequence.

    `turns` are the searches that are tried, other than the usual ones.

    Cost: for each marking of the reduced graph at most the net's size for each choice that the goal leaves; the reduced
    graph has between the length of the sequence and all markings.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = decide_by_stubborn_sets(catalogue_net("one_robot_mc_late"), Deadlock(), Limits())
    >>> found.reachable, found.witness is not None
    (True, True)
    """
    runs = _Runs(net, limits)
    if isinstance(goal, Deadlock):
        last = runs.in_turn(lambda engine, options: engine.deadlocks(all=False, **options), turns)
        found = next(iter(last.deadlocks()), None) if last else None
    else:
        nodes = nodes_of(net, goal)
        last = runs.in_turn(lambda engine, options: engine.reach(nodes, **options), turns)
        found = last.found if last else None
    if last is None:
        return Finding(None, METHOD, bound=_NO_ROOM, cost=runs.cost)
    if found is not None:
        return Finding(reachable=True, method=METHOD, witness=runs.witness(last, found), cost=runs.cost)
    if last.complete:
        return Finding(reachable=False, method=METHOD, cost=runs.cost)
    return Finding(None, METHOD, bound=_bound(last), cost=runs.cost)


@dataclass(frozen=True, slots=True)
class Deadlocks:
    """The deadlocks of a net: how many were found, whether these are all, and a shortest way to one of them."""

    found: int
    complete: bool
    witness: Witness | None = None
    bound: str = ""
    cost: Cost = field(default_factory=Cost)


def find_deadlocks(net: Net, limits: Limits) -> Deadlocks:
    """Count the reachable deadlocks; exact where `complete`.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = find_deadlocks(catalogue_net("one_robot_mc_late"), Limits())
    >>> found.found, found.complete
    (1, True)
    """
    runs = _Runs(net, limits)
    last = runs.in_turn(lambda engine, options: engine.deadlocks(**options))
    if last is None:
        return Deadlocks(0, complete=False, bound=_NO_ROOM, cost=runs.cost)
    all_found = last.deadlocks()
    witness = runs.witness(last, all_found[0]) if all_found else None
    return Deadlocks(len(all_found), last.complete, witness, _bound(last), runs.cost)


Moment = tuple[int, int]
"""So many firings of a way, by number."""


@dataclass(frozen=True, slots=True)
class Way:
    """A firing sequence from a moment of an earlier way, or from M0."""

    after: Moment | None
    firings: tuple[int, ...]


@dataclass(frozen=True)
class Firings:
    """Which transitions can fire: those that do on one of the `ways`, the dead ones, and those left undecided.

    `fires` gives the moment at which a transition is firable. `deadlock` is a firing sequence to a deadlock, where one
    was met. All of it was replayed, in the `original` net. `closed_by` and `dead_by` are the methods that found any of
    it, and any dead transition.
    """

    net: Net
    original: Net
    ways: tuple[Way, ...]
    fires: Mapping[int, Moment]
    dead: tuple[str, ...]
    undecided: tuple[str, ...]
    deadlock: tuple[int, ...] | None = None
    bound: str = ""
    cost: Cost = field(default_factory=Cost)
    closed_by: tuple[str, ...] = ()
    dead_by: tuple[str, ...] = ()

    def known(self) -> dict[str, Known]:
        """The verdicts `quasi-live` and `deadlock-free`, by name, where they are decided."""
        found = {}
        if (witness := self.way_to_deadlock("a marking of the net is a deadlock")) is not None:
            found["deadlock-free"] = Known(no((), witness), WALKS)
        if self.dead:
            found["quasi-live"] = Known(no(self.dead), ", ".join(self.dead_by))
        elif not self.undecided:
            found["quasi-live"] = Known(yes(), ", ".join(self.closed_by) or WALKS)
        return found

    def witness(self, name: str) -> Witness | None:
        """A firing sequence that ends with the firing of a transition, replayed; None where none was found."""
        last = self.net.transition_index[name]
        moment: Moment | None = self.fires.get(last)
        if moment is None:
            return None
        fired = [last]
        while moment is not None:
            way = self.ways[moment[0]]
            fired += reversed(way.firings[: moment[1]])
            moment = way.after
        return self._shown(reversed(fired))

    def way_to_deadlock(self, note: str) -> Witness | None:
        """The firing sequence to the deadlock that was met, replayed; None where none was."""
        return None if self.deadlock is None else self._shown(self.deadlock, note)

    def _shown(self, fired: Iterable[int], note: str = "") -> Witness:
        replay = _Replay(self.net, self.original)
        firings = [(replay.number[t],) for t in fired]
        reached = replay.witnesses.play(self.original.initial_marking, firings)
        return replay.witnesses.named(firings, reached, note=note)


class _Replay:
    """Plays what fires in a net in the original one, whose transitions it calls by the same names."""

    def __init__(self, net: Net, original: Net) -> None:
        self.start = original.initial_marking
        self.witnesses = Witnesses(original, Discipline.INTERLEAVING)
        self.number = [original.transition_index[transition.name] for transition in net.transitions]

    def play(self, marking: Marking, firings: Iterable[int]) -> Marking:
        """The marking of the original net after a firing sequence; raises `WitnessError` where it is none."""
        return self.witnesses.play(marking, ((self.number[t],) for t in firings))


_WALKED: Final = (2**14, 2**20)
_TOGETHER_FIRST: Final = 2**12
_ALONE_LEAST: Final = 2**8
_PROJECTED: Final = 2**16
"""How many markings a projection may have at first; it is to be a fraction of a second."""
_PROJECTIONS_MAX: Final = 8
"""How many times that many all of them may have that close nothing."""
_FAILED_MAX: Final = 4
"""How many transitions are given up in a row, at first."""
_REFUTED_MAX: Final = 16
"""How many transitions are asked of the state equation in a turn."""
_REFUTING_SECONDS: Final = 2.0
_DIAGRAMS_FROM: Final = 3
"""From which turn on a projection of more markings may be a diagram, which takes seconds."""


def find_firings(net: Net, limits: Limits, original: Net | None = None) -> Firings:
    """Find for each transition whether it can ever fire (quasi-liveness); each run was replayed.

    Where the net is a reduction of an `original` one whose transitions fire in it by the same names, it is replayed
    there.

    Cost: in each round some firings at random and some markings of projections, and where these close nothing as many
    markings for all open transitions together as for all of them one by one; four times as many in the next.

    >>> from firable.nets.net import Place, Transition
    >>> places = (Place("p", marked=True), Place("q"), Place("r"))
    >>> net = Net("n", places, (Transition("t", ("p",), ("q",)), Transition("u", ("q", "r"), ("p",))))
    >>> found = find_firings(net, Limits())
    >>> found.dead, found.undecided, found.witness("t").firings
    (('u',), (), (('t',),))
    """
    return FiringSearch(net, original).found(limits)


def known_firings(net: Net, limits: Limits) -> Mapping[str, Known]:
    """The verdicts `quasi-live` and `deadlock-free`, by name, where they are decided.

    Some transition is dead, or each was found firing; a deadlock was met on the way.
    """
    return FiringSearch(net).found(limits, until_dead=True).known()


class FiringSearch:
    """The search of `find_firings`: what is open, and what is known. Asked again it goes on where it was ended."""

    def __init__(self, net: Net, original: Net | None = None) -> None:
        self.original = net if original is None else original
        self.runs = _Runs(net, Limits())
        self.replay = _Replay(net, self.original)
        self.open = set(range(len(net.transitions)))
        self.ways: list[Way] = []
        self.fires: dict[int, Moment] = {}
        self.dead: set[int] = set()
        self.deadlock: tuple[int, ...] | None = None
        self.projections = Projections(net, self.runs.limits)
        self.closed_by: dict[str, None] = {}
        self.dead_by: dict[str, None] = {}
        self.budget, self.turn, self.walks = _TOGETHER_FIRST, 0, 0
        self.until_dead = False

    def found(self, limits: Limits, *, until_dead: bool = False) -> Firings:
        """What was found by the end of these limits.

        With `until_dead` that is over as soon as a transition is known to be dead; others may be so that are open then.
        """
        self.runs.limits = self.projections.limits = limits
        self.until_dead = until_dead
        bound = ""
        while self._goes_on and not bound:
            turn, budget = self.turn, self.budget
            self._by(WALKS, partial(self._walk, turn))
            if self._goes_on and not (turn > 0 and self._by(PROJECTION, partial(self._project, turn))):
                if turn > 0:
                    self._by(EQUATION, partial(self._refute, turn))
                bound = self._by(METHOD, partial(self._round, budget, one_by_one=turn > 0)) if self._goes_on else ""
                if bound:
                    break  # the same turn once more, if there is another time
                self.budget = min(4 * budget, _MARKINGS_MAX)
            self.turn += 1
        self.projections.forget()
        names = self.runs.net.transitions
        dead, undecided = (tuple(names[t].name for t in sorted(of)) for of in (self.dead, self.open))
        return Firings(
            self.runs.net,
            self.original,
            tuple(self.ways),
            self.fires,
            dead,
            undecided,
            self.deadlock,
            bound if undecided else "",
            self.runs.cost,
            tuple(self.closed_by),
            tuple(self.dead_by),
        )

    @property
    def _goes_on(self) -> bool:
        return bool(self.open) and not (self.until_dead and self.dead)

    def _by(self, method: str, stage: Callable[[], T]) -> T:
        """What a stage says; the method is noted where it closes transitions."""
        before = len(self.open), len(self.dead)
        said = stage()
        if len(self.open) < before[0]:
            self.closed_by[method] = None
        if len(self.dead) > before[1]:
            self.dead_by[method] = None
        return said

    def _walk(self, turn: int) -> None:
        """Make open transitions fire by random walks.

        Each turn walks anew, and towards all transitions, because those that are easily met lead to the others; it ends
        when so many firings in a row have met none: no other stage meets as many.
        """
        everything, firings = range(len(self.runs.net.transitions)), _WALKED[min(turn, 1)] * 2 ** max(0, turn - 1)
        limits = engine_limits(self.runs.limits.deadline)
        found, deadlock, steps = self.runs.engine.cover(
            list(everything), seed=SEED + self.walks, max_vain=firings, **limits
        )
        self.runs.edges += steps
        self.walks += 1
        needed = set[int]()
        for way, (after, _, firable) in reversed(list(enumerate(found))):
            if way in needed or any(t in self.open for t, _ in firable):
                needed.add(way)
                needed.update(() if after is None else after[:1])
        ends: dict[int, tuple[int, dict[int, Marking]]] = {}  # of a way its number here, and markings to go on from
        for way in sorted(needed):
            after, fired, firable = found[way]
            if after is None:
                moment, marking = None, self.replay.start
            else:
                number, reached = ends[after[0]]
                moment, marking = (number, after[1]), reached[after[1]]
            ends[way] = len(self.ways), self._play(Way(moment, tuple(fired)), marking, firable)
        if deadlock is not None and self.deadlock is None:
            if not self.replay.witnesses.player.deadlocked(self.replay.play(self.replay.start, deadlock)):
                raise WitnessError("a walk to a deadlock ends in a marking that is none")
            self.deadlock = tuple(deadlock)

    def _play(self, way: Way, marking: Marking, firable: Sequence[tuple[int, int]]) -> dict[int, Marking]:
        """Replay a way, and each transition that is said to be firable after some of its firings; the markings there.

        They, and all that fire on the way, are no longer open.
        """
        number, played = len(self.ways), 0
        reached: dict[int, Marking] = {}
        for t, end in firable:
            marking = self.replay.play(marking, way.firings[played:end])
            self.replay.play(marking, (t,))
            self._close(t, (number, end))
            reached[end], played = marking, end
        for end, t in enumerate(way.firings[:played]):
            self._close(t, (number, end))
        self.ways.append(way)
        return reached

    def _close(self, t: int, moment: Moment) -> None:
        if t in self.open:
            self.open.remove(t)
            self.fires[t] = moment

    def _project(self, turn: int) -> bool:
        """Find open transitions dead, or runs to them, on few places of the net, in room that grows by turns.

        This is given up for the turn after so many markings of projections, or so many transitions, that close none.
        Whether it closed some.
        """
        search, failed, before = self.projections, 0, len(self.open)
        search.room = Room(_PROJECTED * 4**turn, 0 if turn < _DIAGRAMS_FROM else ROOM.diagram_bytes)
        most = search.markings + _PROJECTIONS_MAX * search.room.markings
        for t in sorted(self.open):
            if failed > _FAILED_MAX * 4**turn or search.markings > most or self.runs.limits.deadline.over:
                break
            if t not in self.open:
                continue
            try:
                found = search.firing(t)
            except BudgetExceeded:
                failed += 1
                continue
            failed, most = 0, search.markings + _PROJECTIONS_MAX * search.room.markings
            if isinstance(found, Explored):
                search.dead.add(t)
            else:
                self._play(Way(None, found), self.replay.start, [(t, len(found))])
            dead = search.dead & self.open
            self.dead |= dead
            self.open -= dead
            if not self._goes_on:
                break
        return len(self.open) < before

    def _refute(self, turn: int) -> None:
        """Show open transitions dead by the state equation: one, and others only as long as they are.

        It sees what is dead for a sum of tokens, which is spread over the whole net where no search and no few places
        see it. Such transitions are many, so one in each turn is asked for.
        """
        from firable.analysis.structure.state_equation import decide_by_state_equation  # here: it loads a solver

        asked = sorted(self.open)
        begin = turn * len(asked) // _REFUTED_MAX % len(asked)
        for t in (*asked[begin:], *asked[:begin])[:_REFUTED_MAX]:
            limits = replace(self.runs.limits, deadline=self.runs.limits.deadline.within(_REFUTING_SECONDS))
            goal = Firable(self.runs.net.transitions[t].name)
            if decide_by_state_equation(self.runs.net, goal, limits).reachable is not False:
                return
            self.dead.add(t)
            self.open.remove(t)
            if not self._goes_on:
                return

    def _round(self, budget: int, *, one_by_one: bool) -> str:
        """All together, then one by one, which is left to later rounds; why it must be the last, or nothing."""
        bound = self._ask(sorted(self.open), budget, thorough=False)
        alone = max(_ALONE_LEAST, budget // max(1, len(self.open)))
        for t in sorted(self.open) if one_by_one else ():
            if bound or not self._goes_on:
                break
            if t in self.open:
                bound = self._ask([t], alone, thorough=True)
        return bound

    def _ask(self, transitions: list[int], budget: int, *, thorough: bool) -> str:
        search = self.runs.one(
            lambda engine, options: engine.fire(transitions, **options), thorough=thorough, markings=budget
        )
        if search is None:
            return _NO_ROOM
        self._note(search)
        if search.complete:
            dead = self.open.intersection(transitions)
            self.dead |= dead
            self.open -= dead
        # What the budget of markings ended is asked again, with more; whatever else ended it ends all.
        return "" if search.complete or search.reason == "markings" else _bound(search)

    def _note(self, search: Search) -> None:
        """Keep a run for each open transition that was found firable, the longest first: they hold others."""
        firable = search.firable()
        deepest = sorted(((index, t) for t in self.open if (index := firable[t]) is not None), reverse=True)
        for index, last in deepest:
            if last in self.open:
                path = tuple(search.path_to(index))
                self._play(Way(None, path), self.replay.start, [(last, len(path))])


_Ask = Callable[[Stubborn, dict[str, Any]], Search]
_NO_ROOM: Final = "the budget of memory does not hold the net itself"


class _Runs:
    """The searches of one net within limits, and what they cost together."""

    def __init__(self, net: Net, limits: Limits) -> None:
        self.net = net
        self.limits = limits
        self.witnesses = Witnesses(net, Discipline.INTERLEAVING)
        self.engine = Stubborn(*flat(net))
        self.markings = self.edges = 0
        self.began = perf_counter()

    @property
    def cost(self) -> Cost:
        """What all searches so far have cost."""
        return Cost(self.markings, self.edges, perf_counter() - self.began)

    def in_turn(self, ask: _Ask, turns: Iterable[Turn] | None = None) -> Search | None:
        """The first search that answers, quick and thorough ones in turn; else the last one; None: no room for any."""
        last = None
        for thorough, markings in turns or _turns():
            last = self.one(ask, thorough=thorough, markings=markings)
            if last is None or last.complete or last.reason != "markings":
                break
        return last

    def one(self, ask: _Ask, *, thorough: bool, markings: int) -> Search | None:
        """One search; None where the budget does not hold the net."""
        options = engine_limits(self.limits.deadline)
        options |= {"max_markings": markings, "max_memory_bytes": self.limits.memory_bytes, "thorough": thorough}
        try:
            search = ask(self.engine, options)
        except BudgetExceeded:
            return None
        self.markings += search.n_markings
        self.edges += search.n_edges
        return search

    def witness(self, search: Search, index: int) -> Witness:
        """The firing sequence to a marking, replayed by the reference player."""
        return self.witnesses.replayed([(t,) for t in search.path_to(index)], search.marking(index))


def _bound(search: Search) -> str:
    """How far an incomplete search went, in words; empty for a complete one."""
    if search.complete:
        return ""
    return f"{search.n_markings:,} markings of a reduced graph: {REASONS.get(search.reason or '', search.reason)}"


def _turns() -> Iterator[Turn]:
    for quick, thorough in _BUDGETS:
        yield False, quick
        yield True, thorough
    yield False, _MARKINGS_MAX
