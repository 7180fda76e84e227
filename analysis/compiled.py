"""A net, a goal and a deadline as the engine takes them: rows of indexes, a formula in negation normal form, seconds.

The engine knows no atoms but "this place is full" and "this place is empty". What is firable, a deadlock, the start or
so many tokens comes to it as a formula over these, which `semantics.formulas` evaluates in an algebra of nodes; so the
meaning of the atoms has one text. A value of this algebra is a node together with the node of its negation, both
built side by side: to negate is to swap them, and nothing has to be pushed inwards afterwards.

Nothing recurses over the formula: one that a program has built may be deeper than the interpreter's stack.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

from firable.analysis import _engine
from firable.analysis.deadline import Deadline
from firable.nets.formula import And, Formula, Not, Or
from firable.nets.net import Net
from firable.semantics.formulas import evaluate

Row = tuple[list[int], list[int], list[int], list[int], list[tuple[int, bool]]]
"""A transition of the engine: inputs, outputs, permissive and inhibitive gate places, external literals."""
Ends = tuple[bytes, bytes]
"""How many ends each transition has, and which they are, all end to end: native unsigned numbers of 32 bits."""
Flat = tuple[Ends, Ends, Ends, Ends, Ends]
"""The parts of all rows, end to end; an external literal is twice the signal, and one more where it is wanted."""
Node = tuple[int, list[int]]
"""A node of a formula of the engine: an operator, and a place or earlier nodes."""

EMPTY: Final = 0
FULL: Final = 1
ALL: Final = 2
ANY: Final = 3


def flat(net: Net) -> tuple[int, Flat, list[int]]:
    """The number of places, the transitions and the marked places of a net, by index, as the engine reads them fastest.

    In time linear in the arcs, and with no object for each: a row is six of them, which the interpreter has to make and
    to look through for cycles.

    >>> from firable.nets.net import Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    >>> n_places, (inputs, outputs, *_), marked = flat(net)
    >>> n_places, list(memoryview(inputs[1]).cast("I")), list(memoryview(outputs[1]).cast("I")), marked
    (2, [0], [1], [0])
    """
    transitions = _engine.flat(net.place_index, net.signal_index, net.transitions)
    return len(net.places), transitions, [i for i, of in enumerate(net.places) if of.marked]


def rows(net: Net) -> tuple[int, list[Row], list[int]]:
    """The same with a row for each transition, to be read or to have others added.

    >>> from firable.nets.net import Place, Transition
    >>> rows(Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),)))
    (2, [([0], [1], [], [], [])], [0])
    """
    place, signal = net.place_index, net.signal_index
    transitions = [
        (
            [place[name] for name in transition.inputs],
            [place[name] for name in transition.outputs],
            [place[name] for name in transition.permissive],
            [place[name] for name in transition.inhibitive],
            [(signal[gate.signal], gate.wanted) for gate in transition.external],
        )
        for transition in net.transitions
    ]
    return len(net.places), transitions, [i for i, of in enumerate(net.places) if of.marked]


def engine_limits(deadline: Deadline) -> dict[str, Any]:
    """What ends the engine's long work, as the keywords of its functions: the seconds left, and who else may end it."""
    flag = deadline.cancelled
    return {"max_seconds": deadline.left_seconds, "cancelled": None if flag is None else flag.is_set}


Pair = tuple[int, int]
"""A node and the node of its negation, by number."""


@dataclass
class Nodes:
    """The Boolean algebra of pairs of nodes; equal nodes are one, constants and repetitions go away."""

    nodes: list[tuple[int, tuple[int, ...]]] = field(default_factory=list)
    _known: dict[tuple[int, tuple[int, ...]], int] = field(default_factory=dict)

    def _node(self, operator: int, operands: tuple[int, ...]) -> int:
        key = (operator, operands)
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append(key)
        return self._known[key]

    def all_of(self, nodes: tuple[int, ...]) -> int:
        """The node that all of some nodes are true."""
        return self._node(ALL, nodes)

    @property
    def true(self) -> Pair:
        """The constant true: all of nothing."""
        return self._node(ALL, ()), self._node(ANY, ())

    def holds(self, place: int) -> Pair:
        """The place is full."""
        return self._node(FULL, (place,)), self._node(EMPTY, (place,))

    def negation(self, operand: Pair, /) -> Pair:
        """The NOT of the operand."""
        return operand[1], operand[0]

    def conjunction(self, operands: Iterable[Pair], /) -> Pair:
        """The AND of the operands."""
        true, false = self.true
        kept = tuple(pair for pair in dict.fromkeys(operands) if pair[0] != true)
        if any(node == false for node, _ in kept):
            return false, true
        if len(kept) == 1:
            return kept[0]
        return self._node(ALL, tuple(pair[0] for pair in kept)), self._node(ANY, tuple(pair[1] for pair in kept))

    def disjunction(self, operands: Iterable[Pair], /) -> Pair:
        """The OR of the operands."""
        return self.negation(self.conjunction([self.negation(pair) for pair in operands]))

    def value(self, net: Net, formula: Formula) -> Pair:
        """The value of a state formula of a net."""
        values: list[Pair] = []
        todo = [(formula, False)]
        while todo:
            part, ready = todo.pop()
            match part:
                case Not(operand) if not ready:
                    todo += [(part, True), (operand, False)]
                case And(operands) | Or(operands) if not ready:
                    todo.append((part, True))
                    todo += [(operand, False) for operand in reversed(operands)]
                case Not():
                    values.append(self.negation(values.pop()))
                case And(operands) | Or(operands):
                    first = len(values) - len(operands)
                    of, values = values[first:], values[:first]
                    values.append(self.conjunction(of) if isinstance(part, And) else self.disjunction(of))
                case _:
                    values.append(self.atom(net, part))
        return values.pop()

    def atom(self, net: Net, part: Formula) -> Pair:
        """The value of a formula that is no NOT, AND or OR."""
        return evaluate(self, net, part, self.holds)

    def needed_for(self, root: int) -> list[Node]:
        """The nodes that a node is made of, operands first and itself last, numbered anew."""
        needed = {root}
        for node in range(root, -1, -1):
            operator, operands = self.nodes[node]
            if node in needed and operator in (ALL, ANY):
                needed.update(operands)
        number = {node: i for i, node in enumerate(sorted(needed))}
        found: list[Node] = []
        for node in number:
            operator, operands = self.nodes[node]
            found.append((operator, [number[of] for of in operands] if operator in (ALL, ANY) else list(operands)))
        return found


def nodes_of(net: Net, formula: Formula) -> list[Node]:
    """A state formula as the engine takes it; a conjunction of conjunctions is one, so that each part is a choice.

    >>> from firable.nets.formula import parse_formula
    >>> from firable.nets.net import Place
    >>> nodes_of(Net("n", (Place("p"), Place("q"))), parse_formula("not (p or q)"))
    [(0, [0]), (0, [1]), (2, [0, 1])]
    """
    algebra = Nodes()
    root, _ = algebra.value(net, formula)
    parts: dict[int, None] = {}
    todo, seen = [root], set[int]()
    while todo:
        node = todo.pop()
        operator, operands = algebra.nodes[node]
        if node in seen:
            continue
        seen.add(node)
        if operator == ALL:
            todo.extend(reversed(operands))
        else:
            parts[node] = None
    if len(parts) > 1:
        root = algebra.all_of(tuple(parts))
    return algebra.needed_for(root)
