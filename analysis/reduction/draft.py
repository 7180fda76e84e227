"""The net while it is being reduced: transitions as moves between literals, and the way back.

A place holds a token or it does not, so it is a Boolean variable, and the contact rule makes inputs and outputs
mirror images of each other: an input needs the value 1 and turns it into 0, an output needs 0 and turns it into 1, a
gate needs a value and leaves it. A transition is therefore a *move*: the literals that it needs, and the places among
them that it flips. In this form no rule has to speak of contact: that an output place must be empty is one more
literal. The form is closed under composition: "first h, then f" is again a move, in which a place that both flip is
only read, and so a gate. And what is proved of a place and its token is proved of its complement too.

The contract that every rule keeps, called *the contract* in this folder:

1. Each move stands for a sequence of firings of the original net, its `origin`. From M0, after what is fired `first`,
   a run of the draft is a run of the original net, and each place that is still in the draft has the same value at
   the end of both. So the draft reaches no marking that the original net does not reach, and a fact about reachable
   markings that was proved before a rule is true after it.
2. Where the original net reaches the goal, so does the draft.
3. Where the draft reaches the goal, the original net does so by the run of 1, or, for a deadlock, by that run and what
   the `tails` then fire.

External gates are free in analysis, so a transition that some valuation opens needs no signal, and one that none opens
is not taken over. Neither is one that needs a place both marked and empty, such as a transition with a self-loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Rule, Step
from firable.analysis.reduction.goals import Goal, Labels, Value
from firable.nets.net import Net, Place, Transition

_POLL: Final = 1_000  # transitions that are read between two looks at the deadline

Literal = int
"""A place with a value: twice the index of the place, plus the value."""

Origin = int | tuple[object, object]
"""A transition of the original net, or two origins, one after the other."""


def literal(place: int, value: bool) -> Literal:
    """The literal that the place has this value."""
    return 2 * place + value


@dataclass(frozen=True)
class Move:
    """A transition of the draft: the places whose value it needs, and those of them that it flips.

    `origin` is what it stands for, so many firings of the original net as `length` says.
    """

    needs: Mapping[int, bool]
    flips: frozenset[int]
    origin: Origin
    length: int = 1

    @cached_property
    def literals(self) -> tuple[Literal, ...]:
        """What it needs, as literals."""
        return tuple(literal(place, value) for place, value in self.needs.items())

    @cached_property
    def made(self) -> tuple[Literal, ...]:
        """The literals that it makes true."""
        return tuple(literal(place, not self.needs[place]) for place in self.flips)

    @property
    def reads(self) -> Iterator[int]:
        """The places that it needs and leaves as they are."""
        return (place for place in self.needs if place not in self.flips)

    def without(self, places: Iterable[int]) -> Move:
        """The move that neither needs nor flips these places."""
        gone = frozenset(places)
        return Move({p: v for p, v in self.needs.items() if p not in gone}, self.flips - gone, self.origin, self.length)


def composed(first: Move, then: Move) -> Move | None:
    """The one move that the two are, one directly after the other; None where the first makes the second impossible.

    >>> h, f = Move({0: True, 1: False}, frozenset({0, 1}), 0), Move({1: True, 0: False}, frozenset({0, 1}), 1)
    >>> both = composed(h, f)
    >>> both.needs, both.flips
    ({0: True, 1: False}, frozenset())
    >>> composed(h, h) is None
    True
    """
    needs = dict(first.needs)
    for place, value in then.needs.items():
        if place not in first.needs:
            needs[place] = value
        elif (first.needs[place] != (place in first.flips)) != value:
            return None
    return Move(needs, first.flips ^ then.flips, (first.origin, then.origin), first.length + then.length)


@dataclass(frozen=True, slots=True)
class Tail:
    """What is fired where a run that was lifted is followed by one of these moves: a deadlock may come only after it.

    `moves` are those of the draft as it was before the rule, so their places have the values of the original net.
    """

    moves: tuple[Move, ...]


@dataclass(slots=True)
class Draft:
    """A net under reduction, and what is preserved: the goal, labels, or, where None, what each transition can do.

    Raises `BudgetExceeded` where the deadline comes before the net is read: a part of it says nothing.

    `values` are those of M0; `at[l]` are the moves that need literal l. What a rule does goes through the methods, so
    that the index keeps up. A transition is the move of its index; `same_as` gives the one that it was merged into.
    `touched` are the places at which something has changed since a rule last took them, `steps` what was done so far,
    for those who check it.
    """

    net: Net
    goal: Goal | Labels | None
    deadline: Deadline = NEVER
    values: list[bool] = field(init=False)
    places: set[int] = field(init=False)
    moves: dict[int, Move] = field(default_factory=dict)
    at: list[set[int]] = field(init=False)
    touched: dict[int, None] = field(init=False)
    first: list[Origin] = field(default_factory=list)
    tails: list[Tail] = field(default_factory=list)
    applied: dict[str, int] = field(default_factory=dict)
    same_as: dict[int, int] = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)
    _next: int = 0
    _goal_literals: frozenset[Literal] | None = None

    def __post_init__(self) -> None:
        self.values = [place.marked for place in self.net.places]
        self.places = set(range(len(self.values)))
        self.touch_all()
        self.at = [set() for _ in range(2 * len(self.values))]
        for t, transition in enumerate(self.net.transitions):
            if t and t % _POLL == 0 and self.deadline.over:
                raise BudgetExceeded("the time was over before the net was read for its reduction")
            if (move := self._taken_over(t, transition)) is not None:
                self._put(t, move)
            else:
                self.count("dead transition")
        self._next = len(self.net.transitions)

    def _taken_over(self, t: int, transition: Transition) -> Move | None:
        if not transition.openable:
            return None
        needs: dict[int, bool] = {}
        for names, value in (
            (transition.inputs, True),
            (transition.permissive, True),
            (transition.outputs, False),
            (transition.inhibitive, False),
        ):
            for name in names:
                if needs.setdefault(self.net.place_index[name], value) != value:
                    return None
        flips = (self.net.place_index[name] for name in (*transition.inputs, *transition.outputs))
        return Move(needs, frozenset(flips), t)

    def count(self, rule: str, times: int = 1) -> None:
        """Note that a rule was applied."""
        if times:
            self.applied[rule] = self.applied.get(rule, 0) + times

    def note(self, rule: Rule, moves: Iterable[int] = (), places: Iterable[int] = ()) -> None:
        """Keep a step for those who check it; a goal that is false already needs no more of them."""
        if isinstance(self.goal, Goal) and not self.goal.is_false:
            self.steps.append(Step(rule, tuple(moves), tuple(self.net.places[p].name for p in places)))

    @property
    def deadlock(self) -> bool:
        """Whether deadlocks must be preserved."""
        return self.goal is None or self.goal.deadlock

    @property
    def goal_literals(self) -> frozenset[Literal]:
        """The literals that the goal may become true by; none where there is no goal."""
        if self._goal_literals is None:
            found = () if self.goal is None else self.goal.literals()
            index = self.net.place_index
            self._goal_literals = frozenset(literal(index[place], value) for place, value in found)
        return self._goal_literals

    def protected(self, place: int) -> bool:
        """Whether the goal speaks of the place."""
        return literal(place, value=True) in self.goal_literals or literal(place, value=False) in self.goal_literals

    def add(self, move: Move) -> int:
        """Add a move; its number."""
        number = self._next
        self._next += 1
        self._put(number, move)
        return number

    def _put(self, number: int, move: Move) -> None:
        self.moves[number] = move
        for one in move.literals:
            self.at[one].add(number)
            self.touched[one // 2] = None

    def remove(self, number: int) -> Move:
        """Remove a move."""
        move = self.moves.pop(number)
        for one in move.literals:
            self.at[one].discard(number)
            self.touched[one // 2] = None
        return move

    def replace(self, number: int, move: Move) -> None:
        """Put another move in the place of one, which keeps its number."""
        self.remove(number)
        self._put(number, move)

    def needing(self, place: int) -> set[int]:
        """The moves that need a value of the place."""
        return self.at[2 * place] | self.at[2 * place + 1]

    def drop(self, place: int) -> None:
        """Take a place out of the net and of all moves; the goal must not speak of it."""
        for number in self.needing(place):
            self.replace(number, self.moves[number].without((place,)))
        self.places.discard(place)
        self.touched.pop(place, None)

    def substitute(self, values: Mapping[int, Value]) -> None:
        """Replace places in the goal by what stands for them."""
        if self.goal is not None and any(self.protected(place) for place in values):
            named = {self.net.places[place].name: value for place, value in values.items()}
            self.settle(self.goal.rewritten(named))

    def settle(self, goal: Goal | Labels) -> None:
        """Put another goal in the place of the one there was, to which it must be equivalent."""
        self.goal, self._goal_literals = goal, None

    def touch_all(self) -> None:
        """Have every place looked at again."""
        self.touched = dict.fromkeys(sorted(self.places))

    def initially(self, move: Move) -> bool:
        """Whether the move can be made in M0."""
        return all(self.values[place] == value for place, value in move.needs.items())

    def as_net(self) -> tuple[Net, dict[str, int]]:
        """The draft as a net, and the move of each of its transitions; places and single transitions keep their names.

        Order is that of the original net, so the result is a function of it.
        """
        names = {x.name for kind in (self.net.places, self.net.transitions, self.net.signals) for x in kind}
        order = sorted(self.places)
        found: dict[str, int] = {}
        transitions = []
        for number in sorted(self.moves, key=lambda number: (_first(self.moves[number].origin), number)):
            move = self.moves[number]
            name = self.net.transitions[_first(move.origin)].name
            if not isinstance(move.origin, int):
                name = _fresh(f"{name}-{number}", names)
            found[name] = number
            transitions.append(self._transition(name, move))
        places = tuple(Place(self.net.places[p].name, marked=self.values[p]) for p in order)
        return Net(f"{self.net.name}-reduced" if self.net.name else "", places, tuple(transitions)), found

    def _transition(self, name: str, move: Move) -> Transition:
        sides: dict[tuple[bool, bool], list[str]] = {(f, v): [] for f in (False, True) for v in (False, True)}
        for place in sorted(move.needs):
            sides[place in move.flips, move.needs[place]].append(self.net.places[place].name)
        inputs, outputs = tuple(sides[True, True]), tuple(sides[True, False])
        return Transition(name, inputs, outputs, tuple(sides[False, True]), tuple(sides[False, False]))


def flat(origin: object) -> tuple[int, ...]:
    """The transitions of the original net that an origin stands for, in the order of firing.

    >>> flat(((1, 2), (3, 1)))
    (1, 2, 3, 1)
    """
    found: list[int] = []
    todo = [origin]
    while todo:
        match todo.pop():
            case int(t):
                found.append(t)
            case (first, then):
                todo += [then, first]
    return tuple(found)


def _first(origin: object) -> int:
    while isinstance(origin, tuple):
        origin = origin[0]
    assert isinstance(origin, int)
    return origin


def _fresh(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "-"
    taken.add(name)
    return name
