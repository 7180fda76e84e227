"""The ordinary net under an extended one: what the theorems of net theory are about.

An ordinary transition may fire where all its inputs hold a token, and its self-loops are reads. An extended one may be
held back by more. What is the same, and what is not:

- a *permissive gate* is a read: the place becomes an input and an output (unless it is an input anyway);
- an *external gate* opens under some valuation, and analysis leaves the valuation free: it restricts nothing;
- a transition that contradicts itself never fires and is left out: a signal wanted both 1 and 0, or a place that would
  have to hold a token and hold none (as input and output, input and inhibitive gate, and so on);
- an *inhibitive gate* has no counterpart: `inhibited` says that there is one;
- the *contact rule* has none either: without contact it never holds a transition back, with contact it does.

So every firing of the extended net is a firing of the ordinary one, and whatever no firing of the ordinary net can
break (an invariant, a marked trap, an empty siphon) the extended net keeps too. In the other direction, a net without
inhibitive gates that is contact-free *behaves exactly* as its ordinary net (SEMANTICS), and every theorem about that
net is one about it; only then. Where the ordinary net is 1-safe, the extended one is contact-free for its
transitions that are not left out: a full output place would get its second token.

Everything is in indexes: bit masks of thousands of places for each of a hundred thousand transitions fill the memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from firable.nets.net import Net


@dataclass(frozen=True)
class Ordinary:
    """An ordinary net in indexes: `transitions[k]` is the index in the extended net, `inputs[k]` its inputs and reads.

    `outputs[k]` are its outputs and reads, `marked` the places with a token in M0; `places[p]` is the index of the
    place in the extended net, where some are left out.
    """

    n_places: int
    transitions: tuple[int, ...]
    inputs: tuple[tuple[int, ...], ...]
    outputs: tuple[tuple[int, ...], ...]
    marked: frozenset[int]
    inhibited: bool
    places: tuple[int, ...]

    @cached_property
    def consumers(self) -> tuple[tuple[int, ...], ...]:
        """For each place, the positions of the transitions that take a token from it or read it."""
        return _adjacent(self.n_places, self.inputs)

    @cached_property
    def producers(self) -> tuple[tuple[int, ...], ...]:
        """For each place, the positions of the transitions that put a token on it or read it."""
        return _adjacent(self.n_places, self.outputs)


def ordinary(net: Net) -> Ordinary:
    """The ordinary net under an extended one.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q"), Place("r")),
    ...           (Transition("t", ("p",), ("q",), permissive=("r",)), Transition("dead", ("p",), ("p",))))
    >>> found = ordinary(net)
    >>> found.transitions, found.inputs, found.outputs
    ((0,), ((0, 2),), ((1, 2),))
    """
    index = net.place_index
    transitions, inputs, outputs, inhibited = [], [], [], False
    for t, transition in enumerate(net.transitions):
        full, empty = {*transition.inputs, *transition.permissive}, {*transition.outputs, *transition.inhibitive}
        if full & empty or not transition.openable:
            continue
        reads = [name for name in transition.permissive if name not in transition.inputs]
        transitions.append(t)
        inputs.append(tuple(index[name] for name in (*transition.inputs, *reads)))
        outputs.append(tuple(index[name] for name in (*transition.outputs, *reads)))
        inhibited |= bool(transition.inhibitive)
    marked = frozenset(i for i, place in enumerate(net.places) if place.marked)
    places = tuple(range(len(net.places)))
    return Ordinary(len(places), tuple(transitions), tuple(inputs), tuple(outputs), marked, inhibited, places)


def markable(of: Ordinary) -> frozenset[int]:
    """The places that could ever get a token if none were taken away; the others are a siphon that is empty in M0.

    Cost: linear in the net.
    """
    found, todo = set(of.marked), list(of.marked)
    missing = [len(inputs) for inputs in of.inputs]
    ready = [k for k, count in enumerate(missing) if not count]
    while todo or ready:
        while ready:
            for place in of.outputs[ready.pop()]:
                if place not in found:
                    found.add(place)
                    todo.append(place)
        if todo:
            for k in of.consumers[todo.pop()]:
                missing[k] -= 1
                if not missing[k]:
                    ready.append(k)
    return frozenset(found)


def _adjacent(n_places: int, sides: Sequence[Iterable[int]]) -> tuple[tuple[int, ...], ...]:
    found: list[list[int]] = [[] for _ in range(n_places)]
    for k, places in enumerate(sides):
        for place in places:
            found[place].append(k)
    return tuple(map(tuple, found))
