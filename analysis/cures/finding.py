"""The smallest change that makes a violated verdict proved, verified before it is offered.

A violation is a marking that must not be reached, or one from which something wanted cannot be reached again. Around it
lies a zone: the markings from which it can no longer be avoided. What enters the zone is a set of edges, and each of
them is the point of no return of some runs. A cure takes these firings away, and as few others as possible:

- a *gate* at a transition that enters the zone, on a place that is marked, or empty, wherever it enters;
- a *capacity place* that it takes and a later transition gives back: the monitor of supervisory control (Yamalidou and
  others, 1996), and what an engineer draws for "one workpiece at a time";
- an *arbiter*, where all that is missing is who decides.

Nothing follows from the zone alone: a change makes new deadlocks, or forbids what shall happen. So every candidate is
explored, and those that pass are checked whole. The violated verdict must come out proved, and what was proved must
stay so; no transition may become dead, or not live, that was not. Four losses are left to the engineer, and told: a
marking that the file wants reachable may be the very one that blocks the cell; a shared place brings a conflict to
decide; what is brought back to life may starve by the order of the file; and a query is a question, which need not hold
(it may ask whether the deadlock is reachable). So queries choose no candidate, and are asked again of what is offered.

What is offered is the smallest change that loses nothing, or else the smallest that passes (a gate counts one, a place
and each of its arcs one); among those of one size the one that cures most, then the one that keeps most markings; and
beside it the best of the other kind. How much is tried is bounded by numbers of nets and markings, never by time, so
the offer is the same on every machine. No offer says nothing: there may be a cure beyond what is tried.

Rejected: regions and integer programs, which find monitors with weights; a place here holds one token.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, islice, product, takewhile
from typing import Any, Final, Generic

from firable.analysis._engine import BudgetExceeded
from firable.analysis.check import check
from firable.analysis.methods import Method
from firable.analysis.report import CheckReport
from firable.analysis.spaces.reachability import REASONS, Budget, explore
from firable.analysis.spaces.space import S, StateSpace
from firable.analysis.temporal.queries import answer
from firable.analysis.verdicts.goals import goals_of
from firable.nets.changes import Change, Gate, arbitration, capacity, changed
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula, Or
from firable.nets.net import Net, Property, PropertyKind
from firable.nets.queries import Query
from firable.nets.rules import hints_of
from firable.nets.verdict import Cure, Status, Verdict, Weight, spelled
from firable.semantics.conflict import conflicts
from firable.semantics.player import Player
from firable.semantics.trace import Discipline
from firable.semantics.waiting import circle

MARKINGS_MAX: Final = 20_000
"""Of how many markings a net may be that a cure is looked for."""
_DEADLOCKS: Final = ("deadlock-free", "loop.deadlock-free")
_SEARCHES_MAX: Final = 4  # verdicts for which a cure of their own is looked for, each with the following room
_EXPLORED_MAX: Final = 1_000_000  # markings of all candidates together
_CHECKED_MAX: Final = 100_000  # markings of those that are checked whole
_AS_MANY_MARKINGS: Final = 10  # what each transition of a candidate counts for: to make a net costs, too
_CHECKED_NETS_MAX: Final = 40
_ENTRIES_MAX: Final = 6  # transitions that enter a zone, each of which is to be changed
_GATES_MAX: Final = 8  # for one such transition
_GIVERS_MAX: Final = 3
_ALIKE_MAX: Final = 8  # changes of one size that are compared
_CURED_WARNINGS: Final = frozenset({"effective-conflicts"})

_Changes = tuple[Change, ...]


def explained(report: CheckReport, queries: Sequence[Query] = ()) -> tuple[Verdict, ...]:
    """The verdicts of a report; deadlocks with who waits for whom, violated ones with the changes that cure them.

    `queries` are those that the report answers. Cures are looked for where all markings are known and at most
    `MARKINGS_MAX`, under interleaving, and the budget of the report has room for what is asked of them. Where there are
    more, the hint says that none was looked for.
    """
    told = tuple(with_circle(report.net, verdict) for verdict in report.verdicts)
    space = report.space
    if report.discipline is not Discipline.INTERLEAVING or not space.complete:
        return told
    if space.n_markings > MARKINGS_MAX:
        none = f"no cure was looked for, as {spelled(space.n_markings)} markings are more than {MARKINGS_MAX:,}"
        sought = (_is_to_be_cured(verdict) and _has_kinds(space.net, verdict.name) for verdict in told)
        return tuple(_with_hint(one, none) if is_sought else one for one, is_sought in zip(told, sought, strict=True))
    try:
        search = _Search(space, {verdict.name: verdict for verdict in told}, queries)
    except BudgetExceeded:
        return told
    for verdict in told:
        search.look(verdict)
    return tuple(replace(verdict, cures=search.cures(verdict)) for verdict in told)


def with_circle(net: Net, verdict: Verdict) -> Verdict:
    """The verdict on deadlock with the circle where its sequence ends.

    Of the loop with machines it is that of the cell itself, and none where the cell waits for its machines alone.
    """
    if verdict.name not in _DEADLOCKS or verdict.status is not Status.VIOLATED or verdict.witness is None:
        return verdict
    marking = net.marking(name for name in verdict.witness.marking if name in net.place_index)
    if not Player(net).deadlocked(marking):
        return verdict
    return replace(verdict, witness=replace(verdict.witness, waits=circle(net, marking)))


@dataclass(frozen=True, slots=True)
class _Cured:
    """A change that passed, with what it proves and what it loses."""

    changes: _Changes
    proves: tuple[str, ...]
    loses: tuple[str, ...]
    markings: int

    @property
    def size(self) -> int:
        """What the change adds to the net."""
        return sum(change.size for change in self.changes)

    @property
    def price(self) -> int:
        """0 where nothing is lost, 2 where somebody starves, 1 otherwise."""
        return 2 if "starvation" in self.loses else int(bool(self.loses))

    def told(self, name: str) -> Cure:
        """The cure of one of the verdicts that it proves."""
        proves = tuple(of for of in self.proves if of != name)
        return Cure(tuple(map(str, self.changes)), proves, self.loses, self.markings, self.changes)


class _Search(Generic[S]):
    """The changes of one net that are tried, and what was found of them."""

    def __init__(self, space: StateSpace[S], before: dict[str, Verdict], queries: Sequence[Query]) -> None:
        self._space, self._net, self._before, self._queries = space, space.net, before, queries
        self._fired = _fired(space)
        self._making = _AS_MANY_MARKINGS * len(self._net.transitions)
        self._explored = self._checked = self._checked_nets = self._searches = 0
        self._after: dict[_Changes, CheckReport | None] = {}
        self._found: list[_Cured] = []

    def look(self, verdict: Verdict) -> None:
        """Look for changes that cure a verdict, unless one is found that does."""
        if not _is_to_be_cured(verdict) or self._cured(verdict) or self._searches == _SEARCHES_MAX:
            return
        self._searches += 1
        self._explored = self._checked = self._checked_nets = 0
        with suppress(BudgetExceeded):  # what was found until then is kept
            for kind in self._kinds(verdict):
                if (best := self._best(verdict.name, kind)) is not None:
                    self._found.append(self._asked_again(best))

    def cures(self, verdict: Verdict) -> tuple[Cure, ...]:
        """The best change of each kind that cures a verdict, among all that were found, for whichever verdict."""
        if not _is_to_be_cured(verdict):
            return ()
        best: dict[type[Change], _Cured] = {}
        for one in sorted(self._cured(verdict), key=_rank):
            best.setdefault(type(one.changes[0]), one)
        return tuple(one.told(verdict.name) for one in best.values())

    def _cured(self, verdict: Verdict) -> list[_Cured]:
        return [one for one in self._found if verdict.name in one.proves]

    def _kinds(self, verdict: Verdict) -> Iterator[Iterator[_Changes]]:
        """The changes to try, in the order of their sizes: of each kind for itself."""
        if verdict.name == "effective-conflicts":
            yield self._arbiters(verdict)
            return
        zone = self._zone(verdict)
        if zone is None:
            return
        entries = self._entries(zone)
        if not 0 < len(entries) <= _ENTRIES_MAX:
            return
        yield self._gates(zone, entries)
        yield self._capacities(tuple(entries))

    def _best(self, name: str, candidates: Iterable[_Changes]) -> _Cured | None:
        """The best of the first size of which some change passes and loses nothing, or else the best that passes."""
        passed: list[_Cured] = []
        for changes in candidates:
            whole = [one for one in passed if not one.loses]
            if whole and (len(whole) == _ALIKE_MAX or sum(change.size for change in changes) > whole[0].size):
                break
            if changes not in self._after and not self._has_room:
                break
            if (cured := self._tried(name, changes)) is not None:
                passed.append(cured)
        return min(passed, key=_rank, default=None)

    # What must be avoided, and what leads there.

    def _zone(self, verdict: Verdict) -> S | None:
        """The markings from which the violation cannot be avoided; None where M0 is one, or nobody knows them."""
        space, algebra = self._space, self._space.algebra
        if verdict.name == "deadlock-free":
            return self._without_start(algebra.negation(space.endless()))
        if (restored := _restored(self._net, verdict.name)) is not None:
            return self._without_start(algebra.negation(space.backward(space.satisfying(restored))))
        asked = goals_of(self._net, verdict.name)
        if asked is None or any(goal.wanted for goal in asked[1]):
            return None
        bad = space.satisfying(Or(tuple(goal.formula for goal in asked[1])))
        lost = algebra.negation(space.endless(algebra.negation(bad)))
        return self._without_start(bad) if space.contains(lost, self._net.initial_marking) else lost

    def _without_start(self, zone: S) -> S | None:
        return None if self._space.contains(zone, self._net.initial_marking) else zone

    def _entries(self, zone: S) -> dict[int, S]:
        """For each transition that enters the zone, the markings outside in which it does."""
        space = self._space
        outside = space.algebra.negation(zone)
        entries = {}
        for t in range(len(self._net.transitions)):
            if space.deadline.over:
                raise BudgetExceeded(REASONS["time"])
            if space.count(sources := space.algebra.conjunction([outside, space.before(zone, [t])])):
                entries[t] = sources
        return entries

    # The changes of each kind.

    def _gates(self, zone: S, entries: dict[int, S]) -> Iterator[_Changes]:
        """One gate for each transition that enters, those first that forbid the fewest other firings."""
        choices = [list(islice(self._gates_of(zone, t, sources), _GATES_MAX)) for t, sources in entries.items()]
        many = _GATES_MAX if len(choices) == 1 else 3 if len(choices) == 2 else 1
        yield from product(*(choice[:many] for choice in choices))

    def _gates_of(self, zone: S, t: int, sources: S) -> Iterator[Gate]:
        net, space, algebra = self._net, self._space, self._space.algebra
        transition = net.transitions[t]
        touched = {*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive}
        own = {net.place(place).owner for place in (*transition.inputs, *transition.outputs)}
        others = algebra.conjunction([space.may_fire(t), algebra.negation(zone), algebra.negation(sources)])
        found: list[tuple[tuple[int, bool, int], Gate]] = []
        for p, place in enumerate(net.places):
            if place.name in touched:
                continue
            marked = space.marked(p)
            for permissive, shut in ((False, marked), (True, algebra.negation(marked))):
                if not space.count(algebra.conjunction([sources, algebra.negation(shut)])):
                    forbidden = space.count(algebra.conjunction([others, shut]))
                    found.append(
                        ((forbidden, place.owner not in own, p), Gate(transition.name, place.name, permissive))
                    )
        yield from (gate for _, gate in sorted(found, key=lambda one: one[0]))

    def _capacities(self, entries: tuple[int, ...]) -> Iterator[_Changes]:
        """A place that one, two or all of the transitions that enter take, and one for each of them gives back."""
        takers = [self._net.transitions[t].name for t in entries]
        givers = {taker: self._givers(taker) for taker in takers}
        for some in dict.fromkeys((*combinations(takers, 1), *combinations(takers, 2), tuple(takers))):
            for back in product(*(givers[taker][: _GIVERS_MAX if len(some) > 1 else None] for taker in some)):
                if not set(back) & set(some):
                    yield (capacity(self._net, some, tuple(dict.fromkeys(back))),)

    def _givers(self, taker: str) -> list[str]:
        """The transitions that can give back what the taker takes: each once after it, and nothing else is lost."""
        others = (one.name for one in self._net.transitions if one.name != taker)
        tried = takewhile(lambda _: self._has_room, others)
        return [other for other in tried if self._is_quiet(self._changed((capacity(self._net, (taker,), (other,)),)))]

    def _arbiters(self, verdict: Verdict) -> Iterator[_Changes]:
        """An arbiter for each conflict component in which transitions compete that none decides."""
        net, component_of = self._net, conflicts(self._net).component_of
        decided = {component_of[net.transition_index[name]] for arbiter in net.arbiters for name in arbiter.among}
        groups: dict[int, set[int]] = {}
        for pair in verdict.subjects:
            for t in (net.transition_index[name] for name in pair.split(" / ")):
                if component_of[t] not in decided:
                    groups.setdefault(component_of[t], set()).add(t)
        taken = {arbiter.name for arbiter in net.arbiters}
        changes: list[Change] = []
        for group in sorted(map(sorted, groups.values())):
            added = arbitration([net.transitions[t].name for t in group], taken)
            taken.add(added.arbiter.name)
            changes.append(added)
        if changes:
            yield tuple(changes)

    # Trying them.

    @property
    def _has_room(self) -> bool:
        """Whether one more candidate may be made."""
        return self._explored <= _EXPLORED_MAX and not self._space.deadline.over

    def _changed(self, changes: _Changes) -> Net | None:
        """The net after the changes, if they make one."""
        self._explored += self._making
        try:
            return changed(self._net, changes)
        except InputError:
            return None

    def _is_quiet(self, net: Net | None) -> bool:
        """Whether a changed net, explored, keeps every transition that fires, and comes into no contact."""
        if net is None:
            return False
        try:
            space = explore(net, budget=self._budget)
        except InputError:  # it has no room
            return False
        self._explored += space.n_markings
        return space.complete and not space.meet_contact() and self._fired <= _fired(space)

    def _tried(self, name: str, changes: _Changes) -> _Cured | None:
        """What the changes cure, as the check says; None where they do not cure this, or break more."""
        if changes not in self._after:
            self._after[changes] = self._checked_whole(changes)
        after = self._after[changes]
        if after is None:
            return None
        proves, lost = self._compared(after.verdicts)
        if name not in proves or not all(map(self._is_bearable, lost)):
            return None
        return _Cured(changes, proves, tuple(ended.name for ended in lost), after.figures.markings)

    def _asked_again(self, one: _Cured) -> _Cured:
        """The same with what becomes of the queries in the time that the report has; what stays open is no loss."""
        after = self._after[one.changes]
        if after is None:
            raise ValueError("a change that was not checked is no cure")
        space = after.space.until(self._space.deadline)
        decided = [query for query in self._queries if self._before[f"query.{query.name}"].status is not Status.UNKNOWN]
        answers = [answer(space, query) for query in decided]
        proves, lost = self._compared(verdict for verdict in answers if verdict.status is not Status.UNKNOWN)
        return replace(one, proves=(*one.proves, *proves), loses=(*one.loses, *(ended.name for ended in lost)))

    def _compared(self, after: Iterable[Verdict]) -> tuple[tuple[str, ...], list[Verdict]]:
        """Which verdicts are cured, by name, and which end worse than before."""
        pairs = [(self._before[verdict.name], verdict) for verdict in after if verdict.name in self._before]
        proves = tuple(before.name for before, ended in pairs if _is_cured(before, ended))
        return proves, [ended for before, ended in pairs if _is_lost(before, ended)]

    def _checked_whole(self, changes: _Changes) -> CheckReport | None:
        """The report on the changed net; None where exploring it says enough, or too much was checked already."""
        if self._checked > _CHECKED_MAX or self._checked_nets == _CHECKED_NETS_MAX or not self._has_room:
            return None
        net = self._changed(changes)
        if net is None or not self._is_quiet(net):
            return None
        after = check(net, budget=self._budget, method=Method.EXPLICIT)
        self._checked += self._making + after.figures.markings
        self._checked_nets += 1
        return None if self._space.deadline.over else after

    def _is_bearable(self, lost: Verdict) -> bool:
        """Whether a loss is the engineer's to judge; who starves after the change must have been lost before it."""
        if lost.name == "starvation":
            return set(lost.subjects) <= set(self._before["live"].subjects)
        return lost.name == "effective-conflicts" or any(
            isinstance(of, Property) and of.kind is PropertyKind.REACHABLE and lost.name == f"property.{of.name}"
            for of in self._net.properties
        )

    @property
    def _budget(self) -> Budget:
        """Room for a capacity place more, which at most doubles the markings, in the time that the report has."""
        return Budget(markings=2 * self._space.n_markings + 1, seconds=self._space.deadline.left_seconds)


def _is_to_be_cured(verdict: Verdict) -> bool:
    if verdict.status is not Status.VIOLATED:
        return False
    return verdict.weight is Weight.REQUIRED or (verdict.weight is Weight.WARNING and verdict.name in _CURED_WARNINGS)


def _has_kinds(net: Net, name: str) -> bool:
    """Whether there are changes to try for a verdict: it wants an arbiter, or that markings are avoided."""
    if name in {"deadlock-free", "effective-conflicts"} or _restored(net, name) is not None:
        return True
    asked = goals_of(net, name)
    return asked is not None and not any(goal.wanted for goal in asked[1])


def _restored(net: Net, name: str) -> Formula | None:
    """What must be reached again and again by the property that a verdict is on; None where it says something else."""
    of = next((of for of in net.properties if f"property.{of.name}" == name), None)
    return of.formula if isinstance(of, Property) and of.kind is PropertyKind.ALWAYS_POSSIBLE else None


def _with_hint(verdict: Verdict, more: str) -> Verdict:
    """A verdict with something more to be told behind its hint, or behind that of its rule."""
    return replace(verdict, hint="; ".join((*(hint for _, hint in hints_of(verdict)), more)))


def _fired(space: StateSpace[Any]) -> set[int]:
    return {t for t, count in enumerate(space.fired()) if count}


def _is_cured(before: Verdict, after: Verdict) -> bool:
    """Whether a verdict that failed or warned does so no longer."""
    if before.status is not Status.VIOLATED or before.weight is Weight.INFORMATION:
        return False
    return after.status is Status.PROVED or (after.weight is Weight.INFORMATION and after.status is Status.VIOLATED)


def _is_lost(before: Verdict, after: Verdict) -> bool:
    """Whether a verdict that fails or warns ends worse than before, or of more than before."""
    if before.weight is Weight.INFORMATION:
        return after.weight is not Weight.INFORMATION and after.status is not Status.PROVED
    if before.status is Status.PROVED or after.status is Status.PROVED:
        return before.status is Status.PROVED and after.status is not Status.PROVED
    return before.status is Status.VIOLATED and not set(after.subjects) <= set(before.subjects)


def _rank(one: _Cured) -> tuple[int, int, int, int, int]:
    return one.price, one.size, -len(one.proves), len(one.loses), -one.markings
