"""The names that an opened net gets, from docs/refinement.md, and whether the net of a bundle is that one.

Rows are numbered in the order of the flow: a transition of the conceptual net, then the moves of the tasks that it is
the first to start, and so on. What is no row is named by its controller, and what would have the name of another one by
its place too. So nothing here depends on the order of a set, and two nets are compared by what bears each name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import count
from typing import Any

from firable.decompose.verification.opening import Block, Kept, Opening
from firable.decompose.verification.refusal import NotShownError
from firable.nets.net import ExternalGate, Net, Place, Signal, SignalKind, TimeLimit
from firable.nets.time_limits import fault_transition, fault_transition_name, timer_name


class Named:
    """An opening with the name of each key: `places` and `transitions`."""

    def __init__(self, opening: Opening) -> None:
        self.opening = opening
        self.places = self._place_names()
        self.transitions, self.numbers = self._transition_names()

    # --- Names

    def _place_names(self) -> dict[str, str]:
        opening = self.opening
        wished = {key: kept.full or opening.full(kept.owner, kept.local) for key, kept in opening.places.items()}
        times = Counter(wished.values())
        names = {}
        for key, kept in opening.places.items():
            alone = kept.full or times[wished[key]] == 1
            names[key] = wished[key] if alone else f"{wished[key]}_{self._at(kept.block)}"
        if len({*names.values()}) < len(names):
            raise NotShownError("two steps of the tasks that the bundle holds would have one name")
        return names

    def _at(self, block: Block | None) -> str:
        """How a block is told from another one in a name."""
        if block is None:
            return ""
        return "_".join((self.opening.places[block.path[0]].local, *block.path[1:]))

    def _flow(self) -> list[str]:
        begun, flow = set[str](), list[str]()

        def follow(key: str) -> None:
            flow.append(key)
            first = [block for block in self.opening.moves[key].starts if block.key not in begun]
            begun.update(block.key for block in first)
            for block in first:
                for move in block.task.moves:
                    follow(block.inner(move.name))

        for t in self.opening.net.transitions:
            follow(t.name)
        return flow

    def _transition_names(self) -> tuple[dict[str, str], dict[str, int]]:
        opening, flow = self.opening, self._flow()
        if len(flow) < len(opening.moves):
            raise NotShownError("no transition of the conceptual net starts one of the tasks")
        shared = [key for key in flow if len(opening.participants(opening.moves[key])) > 1]
        local = [key for key in flow if key not in {*shared}]
        own = {key for key in local if opening.moves[key].block is None}
        rows = (name for name in map("G{}".format, count(1)) if name not in own)
        names = {key: next(rows) for key in shared}
        wished = {key: self._local_name(key) for key in local}
        times = Counter([*wished.values(), *names.values()])
        for key, name in wished.items():
            alone = key in own or times[name] == 1
            names[key] = name if alone else f"{name}-{self._at(opening.moves[key].block)}"
        if len({*names.values()}) < len(names):
            raise NotShownError("two transitions of the tasks that the bundle holds would have one name")
        taken = [t.number for t in opening.net.transitions if t.number is not None]
        numbers = {key: move.number for key, move in opening.moves.items() if move.number is not None}
        following = count(max(taken, default=0) + 1)
        numbers |= {key: next(following) for key in shared if key not in numbers}
        return names, numbers

    def _local_name(self, key: str) -> str:
        move = self.opening.moves[key]
        if move.block is None:
            return key
        if move.late:
            (late,) = move.inputs
            return fault_transition_name(self.places[late])
        (owner,) = self.opening.participants(move)
        others = count(1)
        number = {c.name: "0" if c.coordinator else str(next(others)) for c in self.opening.net.controllers}
        return f"t{number.get(owner or '', '')}-{move.label}"

    # --- The net

    def place(self, key: str) -> Place:
        """A place of the detailed net."""
        opening, kept = self.opening, self.opening.places[key]
        return Place(
            self.places[key],
            kept.owner,
            kept.of is not None and kept.of.marked,
            opening.command(kept),
            opening.completion(kept),
            kept.description,
            within=self._limit(key, kept),
        )

    def _limit(self, key: str, kept: Kept) -> TimeLimit | None:
        if kept.step is None:
            return kept.of.within if kept.of else None
        return TimeLimit(kept.step.within, timer_name(self.places[key])) if kept.step.within else None

    def transition(self, key: str) -> tuple[Any, ...]:
        """What a transition of the detailed net is, but for its name and the order of its arcs."""
        move = self.opening.moves[key]
        if move.late:
            (late,), (to,) = move.inputs, move.outputs
            t = fault_transition(self.place(late), self.places[to], "")
            return frozenset(t.inputs), frozenset(t.outputs), frozenset(), frozenset(), frozenset(t.external), *(
                self.numbers.get(key), t.description
            )  # fmt: skip
        gates = {ExternalGate(*literal) for literal in move.external}
        for source in move.inputs:
            done = self.opening.completion(self.opening.places[source])
            if done and ExternalGate(done, wanted=False) not in gates:
                gates.add(ExternalGate(done))
        words = " = ".join(word for word in move.words if word)
        told = words if words and move.block is None else move.description or words
        arcs = (move.inputs, move.outputs, move.permissive, move.inhibitive)
        named = (frozenset(self.places[one] for one in ones) for ones in arcs)
        return *named, frozenset(gates), self.numbers.get(key), told

    def signals(self) -> dict[str, Signal]:
        """The signals of the detailed net by name."""
        found = {signal.name: signal for signal in self.opening.net.signals}
        for place in map(self.place, self.opening.places):
            if place.completion:
                found.setdefault(place.completion, Signal(place.completion, place.owner, SignalKind.COMPLETION))
            if place.within:
                found.setdefault(place.within.timer, Signal(place.within.timer, place.owner, SignalKind.TIMER))
        return {**self.opening.signals, **found}

    def differences(self, net: Net) -> Iterator[str]:
        """What a net has otherwise than the opened one, in words; what it is called and asked is its own matter."""
        if net.controllers != self.opening.net.controllers:
            yield "its controllers are not those of the conceptual net"
        made = {place.name: place for place in map(self.place, self.opening.places)}
        yield from _differing("place", made, {place.name: place for place in net.places})
        yield from _differing("signal", self.signals(), {signal.name: signal for signal in net.signals})
        yield from _differing(
            "transition",
            {name: self.transition(key) for key, name in self.transitions.items()},
            {
                t.name: (
                    *(frozenset(ones) for ones in (t.inputs, t.outputs, t.permissive, t.inhibitive, t.external)),
                    t.number,
                    t.description,
                )
                for t in net.transitions
            },
        )


def _differing(kind: str, made: dict[str, Any], there: dict[str, Any]) -> Iterator[str]:
    for name in [*made, *(name for name in there if name not in made)]:
        if name not in there:
            yield f"the {kind} '{name}' is missing"
        elif name not in made:
            yield f"the {kind} '{name}' is no part of what the tasks make"
        elif made[name] != there[name]:
            yield f"the {kind} '{name}' is not as the tasks make it"
