"""A closed set of markings as a decision diagram: what the checker computes on one, by a few lines of its own.

A zero-suppressed decision diagram (Minato 1993) as the certificate gives it. That the set is closed is asked of each
transition apart: who goes down from the nodes at its highest place, from the markings before on one side and those
after on the other, meets pairs of nodes, and at its lowest place asks whether the first is a subset of the second.
Only the part between these two places is gone through, and two equal nodes need no look; so for a net in a good order
the cost is about that of reading the diagram. Labels are found by going back: an "until" of some run by one
transition after the other, as the certificate names them, an "until" of every run by rounds.

The condition of a firing and what it changes are `firable.semantics.firing`, evaluated in an algebra of literals. The
engine's diagrams share nothing with this but the idea. Nothing recurses; a deadline ends what takes too long.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Back, Diagram, Label, Root, Rounds, Whole
from firable.analysis.evidence.checking.cubes import Cube, firable_cube, firings
from firable.analysis.evidence.checking.nodes import EMPTY, UNIT, Key, Made, Nodes
from firable.analysis.evidence.refusal import refuse
from firable.nets.formula import And, Deadlock, Firable, Formula, Holds, Not, Or, Start
from firable.nets.net import Net
from firable.semantics.formulas import evaluate


@dataclass(frozen=True, slots=True)
class _Event:
    """A firing, from the highest level down: the level, the value before and the value after."""

    literals: tuple[tuple[int, bool, bool], ...]


class Diagrams(Nodes):
    """The sets of one certificate, and those that are made of them; refused where the first is not closed."""

    def __init__(self, net: Net, of: Diagram, deadline: Deadline = NEVER) -> None:
        super().__init__(deadline)
        self.net = net
        if sorted(of.order) != sorted(net.place_index):
            refuse("the order of the diagram does not name each place once")
        self.level_of = {net.place_index[name]: level for level, name in enumerate(of.order, start=1)}
        self._backs: dict[int, dict[Key, int]] = {}
        self.roots = self._read(of)
        self.whole = self.roots[0]
        self._require_closed()

    @property
    def method(self) -> str:
        """What was gone through, in words."""
        n = len(self.net.transitions)
        return f"a decision diagram of {self.n_nodes:,} nodes found closed under {n:,} transitions"

    def _read(self, of: Diagram) -> list[int]:
        numbers = [EMPTY, UNIT]
        for level, lo, hi in of.rows:
            below = max(lo, hi) < len(numbers) and min(lo, hi) >= 0 and level <= len(self.level_of)
            if not below or max(self.levels[numbers[lo]], self.levels[numbers[hi]]) >= level:
                refuse("a row of the diagram does not stand above its parts")
            numbers.append(self.node(level, numbers[lo], numbers[hi]))
            if self.levels[numbers[-1]] != level:  # it is what is below it, which who reads rows alone would miss
                refuse("a row of the diagram holds nothing with a token at its level")
        if not of.roots or not all(0 <= root < len(numbers) for root in of.roots):
            refuse("the diagram has no such root")
        self.n_nodes = len(self.levels) - 2
        return [numbers[root] for root in of.roots]

    @cached_property
    def _events(self) -> dict[int, _Event]:
        """The transitions that can fire, by index."""
        found = {}
        for t, (cube, flips) in firings(self.net).items():
            literals = [(self.level_of[p], value, value ^ (p in flips)) for p, value in cube.items()]
            found[t] = _Event(tuple(sorted(literals, reverse=True)))
        return found

    def _with(self, node: int, cube: Cube) -> int:
        return self.having(node, {self.level_of[place]: value for place, value in cube.items()})

    def holds_initially(self, node: int) -> bool:
        """Whether M0 is in a set."""
        return self.contains(node, {self.level_of[p] for p, place in enumerate(self.net.places) if place.marked})

    def _cube(self, t: int) -> Cube | None:
        return firable_cube(self.net, t)

    def _require_closed(self) -> None:
        if not self.holds_initially(self.whole):
            refuse("the initial marking is not in the set")
        entries = self._entries({event.literals[0][0] for event in self._events.values() if event.literals})
        for t, event in self._events.items():
            if event.literals and not self._stays(event, entries[event.literals[0][0]]):
                refuse(f"a firing of {self.net.transitions[t].name} leads out of the set")

    def _entries(self, tops: set[int]) -> dict[int, set[int]]:
        """For each level the nodes that a marking comes to there: at most as high, and below something higher."""
        levels, found = sorted(tops), {level: set[int]() for level in tops}
        seen, todo = set[int](), [(len(self.level_of) + 1, self.whole)]
        while todo:
            above, node = todo.pop()
            self.tick()
            if node == EMPTY:
                continue
            for level in levels[bisect_left(levels, self.levels[node]) : bisect_left(levels, above)]:
                found[level].add(node)
            if node not in seen and node > UNIT:
                seen.add(node)
                todo += [(self.levels[node], self.lows[node]), (self.levels[node], self.highs[node])]
        return found

    def _stays(self, event: _Event, entries: Iterable[int]) -> bool:
        literals = event.literals
        todo = [(node, node, 0) for node in entries]
        seen = set(todo)
        while todo:
            a, b, i = todo.pop()
            self.tick()
            if i == len(literals):
                if not self.includes(b, a):
                    return False
                continue
            at, before, after = literals[i]
            level = max(self.levels[a], self.levels[b], at)
            if level > at:
                pairs = [(self.part(a, level, value=v), self.part(b, level, value=v), i) for v in (False, True)]
            else:
                pairs = [(self.part(a, at, value=before), self.part(b, at, value=after), i + 1)]
            for pair in pairs:
                if pair[0] != EMPTY and pair not in seen:
                    seen.add(pair)
                    todo.append(pair)
        return True

    def back(self, targets: int, t: int) -> int:
        """The markings of the set in which a transition may fire into a target."""
        event = self._events.get(t)
        if event is None:
            return EMPTY
        literals, nothing = event.literals, (EMPTY, EMPTY, 0)

        def parts(key: Key) -> Made:
            a, b, i = key
            if EMPTY in (a, b):
                return EMPTY
            if i == len(literals):
                return self.both(a, b)
            at, before, after = literals[i]
            if max(self.levels[a], self.levels[b]) > at:
                level, (a0, b0), (a1, b1) = self.split(a, b)
                return level, (a0, b0, i), (a1, b1, i)
            below = self.part(a, at, value=before), self.part(b, at, value=after), i + 1
            return (at, nothing, below) if before else (at, below, nothing)

        # Most of a set that grows stays as it was, and so does what leads into it.
        known = self._backs.setdefault(t, {nothing: EMPTY})
        return self.made((self.whole, targets, 0), known, parts)

    @cached_property
    def deadlocks(self) -> int:
        """The markings in which no transition may fire."""
        left = self.whole
        for t in self._events:
            left = self.less(left, self._with(left, self._cube(t) or {}))
        return left

    def is_cube(self, formula: Formula) -> bool:
        """Whether a state formula is a conjunction of literals, which one look at the diagram finds."""
        return isinstance(formula, Firable) or _literals(self.net, formula) is not None

    # What a labelling asks.

    def where(self, formula: Formula) -> int:
        """The markings of the set in which a state formula holds."""
        literals = _literals(self.net, formula)
        if literals is not None:
            return self._with(self.whole, literals)
        match formula:
            case Firable(name):
                t = self.net.transition_index[name]
                return self._with(self.whole, self._cube(t) or {}) if t in self._events else EMPTY
            case Deadlock():
                return self.deadlocks
            case Not(operand):
                return self.less(self.whole, self.where(operand))
            case And(operands):
                return self.all_of(map(self.where, operands))
            case Or(operands):
                return self.any_of(map(self.where, operands))
        return evaluate(_Sets(self), self.net, formula, lambda place: self._with(self.whole, {place: True}))

    def all_of(self, sets: Iterable[int]) -> int:
        """The markings in all of the subsets."""
        found = self.whole
        for one in sets:
            found = self.both(found, one)
        return found

    def any_of(self, sets: Iterable[int]) -> int:
        """The markings in some of the subsets."""
        found = EMPTY
        for one in sets:
            found = self.either(found, one)
        return found

    def neighbours(self, targets: int, *, every: bool) -> int:
        """The markings of which every next marking, or some, is a target."""
        if every:
            return self.less(self.whole, self.neighbours(self.less(self.whole, targets), every=False))
        return self.any_of(self.back(targets, t) for t in self._events)

    def least(self, label: Label, through: int, end: int, *, every: bool) -> int:
        """The markings found by going back from the end, by one transition after the other, or by rounds."""
        found = end
        match label:
            case Back(transitions) if not every:
                for name in transitions:
                    found = self.either(found, self.both(through, self.back(found, self.net.transition_index[name])))
            case Rounds(rounds) if every:
                through = self.less(through, self.deadlocks)
                for _ in range(rounds):
                    found = self.either(found, self.both(through, self.neighbours(found, every=True)))
            case _:
                refuse("an until on a diagram wants what to go back by as a label")
        return found

    def greatest(self, label: Label, end: int, through: int, *, every: bool) -> int:
        """The set of the label, in which `through` holds, and with it the end, or a next marking of it, or no other."""
        match label:
            case Whole():
                found = self.whole
            case Root(root) if 0 <= root < len(self.roots):
                found = self.both(self.whole, self.roots[root])
            case _:
                refuse("an always on a diagram wants a set as a label")
        if not self.includes(through, found):
            refuse("what is to hold always does not hold in all of the set that the label gives")
        if every and found == self.whole:
            return found  # no firing leads out of it
        stays = [end, self.neighbours(found, every=every)] + ([] if every else [self.deadlocks])
        if not self.includes(self.any_of(stays), found):
            refuse("what is to hold always can be left")
        return found


@dataclass(frozen=True, slots=True)
class _Sets:
    """The sets of a diagram as a Boolean algebra, for the formulas that count."""

    of: Diagrams

    def conjunction(self, operands: Iterable[int], /) -> int:
        return self.of.all_of(operands)

    def disjunction(self, operands: Iterable[int], /) -> int:
        return self.of.any_of(operands)

    def negation(self, operand: int, /) -> int:
        return self.of.less(self.of.whole, operand)


def _literals(net: Net, formula: Formula) -> Cube | None:
    """The literals that a formula is a conjunction of; None where it is none, or contradicts itself."""
    match formula:
        case Holds(name):
            return {net.place_index[name]: True}
        case Not(Holds(name)):
            return {net.place_index[name]: False}
        case Start():
            return {p: place.marked for p, place in enumerate(net.places)}
        case And(operands):
            found: Cube = {}
            for operand in operands:
                literals = _literals(net, operand)
                if literals is None or any(found.get(p, value) is not value for p, value in literals.items()):
                    return None
                found |= literals
            return found
    return None
