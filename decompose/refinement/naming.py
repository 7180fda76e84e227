"""Naming: an opened net as a net, with the names and numbers that an engineer would give.

A transition with several participants is a row of the coordinator table. Rows are named G1, G2, ... in the order of the
flow: the transitions of the conceptual net in the order of its file, and after each one the moves inside the tasks that
it starts. They are numbered apart from that: a transition of the conceptual net keeps its number, and moves get the
next ones, so that a number that stands in a drawing goes on meaning the same. A move with one participant is local, and
named after its controller and its label in the task, `t1-a`. A local transition of the conceptual net keeps its name.

A step is named by its task. Where two would have one name, because one resource does the same task for two places, all
of them are followed by the names of their places: `to_mc_loading`, so that no name depends on which task came first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count

from firable.decompose.refinement.opening import Opened, OpenPlace, OpenTransition
from firable.decompose.splitting.cut import controller_numbers
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Arbiter, ExternalGate, Net, Place, Signal, SignalKind, TimeLimit, Transition
from firable.nets.printing import in_file_order
from firable.nets.time_limits import fault_transition, fault_transition_name, timer_name


@dataclass(frozen=True)
class Named:
    """An opened net with its names; `places` and `transitions` give the name of each key."""

    net: Net
    places: Mapping[str, str]
    transitions: Mapping[str, str]


def named(net: Net, opened: Opened, cell: str = "") -> Named:
    """Give an opened net its names; properties are left to the caller, and so are arbiters that no longer fit.

    Raises `InputError`: F4014 where two steps of one task have one name, and the codes of `Net` for whatever else the
    filled templates make impossible.
    """
    return _Naming(net, opened).named(cell or net.name)


class _Naming:
    def __init__(self, net: Net, opened: Opened) -> None:
        self.net, self.opened = net, opened
        self.flow = [*self.in_flow()]
        started = [path for key in self.flow for path in opened.transitions[key].starts]
        self.paths = [*dict.fromkeys([*started, *opened.bound])]
        self.numbers = controller_numbers(net)

    def in_flow(self) -> Iterator[str]:
        """The keys of all transitions, each followed by the moves of the tasks that it is the first to start."""
        seen = set[str]()
        waiting = [*reversed(self.net.transitions)]
        todo = [t.name for t in waiting]
        while todo:
            key = todo.pop()
            yield key
            for path in reversed([path for path in self.opened.transitions[key].starts if path not in seen]):
                seen.add(path)
                todo += reversed(self.opened.moves[path])
        for path, moves in self.opened.moves.items():
            if path not in seen:
                yield from (key for key in moves if key not in seen)

    def named(self, cell: str) -> Named:
        order = self.ordered()
        names = self.place_names(order)
        rank = {place.key: number for number, place in enumerate(order)}
        places = tuple(
            Place(
                names[place.key], place.owner, place.marked, place.command, _full(place.completion, place.owner),
                place.description, within=self.timed(place, names[place.key]),
            )
            for place in order
        )  # fmt: skip
        titles, numbers = self.transition_names(names)
        by_name = {place.name: place for place in places}
        completions = {place.name: place.completion for place in places}

        def arcs(keys: list[str]) -> tuple[str, ...]:
            return tuple(names[key] for key in sorted(dict.fromkeys(keys), key=rank.__getitem__))

        def transition(key: str) -> Transition:
            t = self.opened.transitions[key]
            if t.late:
                return fault_transition(by_name[names[t.inputs[0]]], names[t.outputs[0]], titles[key])
            inputs = arcs(t.inputs)
            said = [ExternalGate(_full(name, owner) or "", wanted) for owner, name, wanted in t.external]
            done = (ExternalGate(signal) for source in inputs if (signal := completions[source]))
            # A fault transition wants the completion 0, as the net says already.
            implied = [gate for gate in done if ExternalGate(gate.signal, wanted=False) not in said]
            gates = dict.fromkeys([*implied, *said])
            return Transition(
                titles[key], inputs, arcs(t.outputs), arcs(t.permissive), arcs(t.inhibitive), tuple(gates),
                numbers.get(key, t.number), _described(t),
            )  # fmt: skip

        arbiters = tuple(
            Arbiter(arbiter.name, tuple(titles[t] for t in arbiter.among), arbiter.by) for arbiter in self.net.arbiters
        )
        made = Net(
            cell, places, tuple(transition(key) for key in self.in_file_order(titles)), tuple(self.signals(places)),
            self.net.controllers, arbiters, description=self.net.description,
        )  # fmt: skip
        return Named(in_file_order(made), names, titles)

    def ordered(self) -> list[OpenPlace]:
        """Places as in a file: by controller what is conceptual, then each resource with its steps in the flow."""
        position = {path: number for number, path in enumerate(self.paths)}
        resources = {place.name: number for number, place in enumerate(self.net.places)}
        controllers = {controller.name: number for number, controller in enumerate(self.net.controllers)}
        keys = {key: number for number, key in enumerate(self.opened.places)}

        def rank(place: OpenPlace) -> tuple[int, int, int, int]:
            return (
                controllers.get(place.owner or "", len(controllers)),
                -1 if place.resource is None else resources[place.resource],
                position[place.path] if place.path else -1,
                keys[place.key],
            )

        return sorted(self.opened.places.values(), key=rank)

    def place_names(self, order: list[OpenPlace]) -> dict[str, str]:
        wished = {place.key: place.full or _full(place.local, place.owner) or "" for place in order}
        wanted = Counter(wished.values())
        names = {}
        for place in order:
            name = wished[place.key]
            names[place.key] = name if place.full or wanted[name] == 1 else f"{name}_{self.suffix(place.path)}"
        if twice := [name for name, times in Counter(names.values()).items() if times > 1]:
            keys = [key for key, name in names.items() if name == twice[0]]
            message = f"two places would be '{twice[0]}': {' and '.join(keys)}"
            hint = "give steps of one task names of their own with `place`, and open resources to places of their own"
            raise InputError([Diagnostic("F4014", message, hint, ("places", keys[-1].partition("/")[0]))])
        return names

    def timed(self, place: OpenPlace, name: str) -> TimeLimit | None:
        """The time limit of a place: that of a step has its timer under the name of the place."""
        limit = place.within
        return limit if limit is None or limit.timer else replace(limit, timer=timer_name(name))

    def transition_names(self, places: Mapping[str, str]) -> tuple[dict[str, str], dict[str, int]]:
        """The name of each transition, and the numbers of those that get one."""
        transitions = self.opened.transitions
        rows = [key for key in self.flow if len(self.participants(transitions[key])) > 1]
        coordinated = frozenset(rows)
        local = [key for key in self.flow if key not in coordinated]
        kept = {key for key in local if not transitions[key].path}
        free = (name for name in (f"G{n}" for n in count(1)) if name not in kept)
        titles = {key: next(free) for key in rows}
        wished = {
            key: fault_transition_name(places[transitions[key].inputs[0]])
            if transitions[key].late
            else self.local_name(transitions[key])
            for key in local
        }
        wanted = Counter([*wished.values(), *titles.values()])
        for key, name in wished.items():
            titles[key] = name if key in kept or wanted[name] == 1 else f"{name}-{self.suffix(transitions[key].path)}"
        bound_numbers = {t.number for t in self.net.transitions if t.number is not None}
        following = (number for number in count(max(bound_numbers, default=0) + 1))
        return titles, {key: next(following) for key in rows if transitions[key].number is None}

    def local_name(self, t: OpenTransition) -> str:
        if not t.path:
            return t.key
        (owner,) = self.participants(t)
        return f"t{self.numbers.get(owner or '', '')}-{t.label}"

    def in_file_order(self, titles: Mapping[str, str]) -> list[str]:
        """Rows first, and local transitions of the conceptual net; then moves by their resource, in the flow."""
        position = {place.name: number for number, place in enumerate(self.net.places)}
        places = self.opened.places

        def of(key: str) -> int:
            t = self.opened.transitions[key]
            if not t.path or len(self.participants(t)) > 1:
                return -1
            found = [position[r] for one in (*t.inputs, *t.outputs) if (r := places[one].resource) is not None]
            return min(found, default=len(position))

        return sorted((key for key in self.flow if key in titles), key=of)

    def participants(self, t: OpenTransition) -> dict[str | None, None]:
        places = [*t.inputs, *t.outputs, *t.permissive, *t.inhibitive]
        owners = [self.opened.places[key].owner for key in places] + [owner for owner, _, _ in t.external]
        return dict.fromkeys(owners)

    def suffix(self, path: str) -> str:
        root, *inner = path.split("/")
        return "_".join((self.opened.places[root].local, *inner))

    def signals(self, places: tuple[Place, ...]) -> Iterator[Signal]:
        found = {signal.name: signal for signal in self.net.signals}
        for place in places:
            if place.completion:
                found.setdefault(place.completion, Signal(place.completion, place.owner, SignalKind.COMPLETION))
            if place.within:
                found.setdefault(place.within.timer, Signal(place.within.timer, place.owner, SignalKind.TIMER))
        for t in self.opened.transitions.values():
            for owner, name, _ in t.external:
                full = _full(name, owner) or ""
                found.setdefault(full, Signal(full, owner))
        yield from found.values()


def without_arbiters(net: Net, names: set[str]) -> Net:
    """The net without some of its arbiters."""
    return replace(net, arbiters=tuple(arbiter for arbiter in net.arbiters if arbiter.name not in names))


def _described(t: OpenTransition) -> str:
    words = [word for word in t.words if word]
    return " = ".join(words) if words and not t.path else t.description or " = ".join(words)


def _full(name: str | None, owner: str | None) -> str | None:
    return name if name is None or owner is None else f"{owner}.{name}"
