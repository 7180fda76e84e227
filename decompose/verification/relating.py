"""That opening the tasks of a net keeps what it can do: one relation between both nets, which no transition leaves.

A marking of the detailed net is *related* where each block is as its task, closed, can be while it runs, and empty
while its place is, and of each resource that tasks release at most one is so: it is idle, or some block holds it and
still has to release it. A related marking shows one of the conceptual net: a resource of this kind is idle in it where
it is idle or still to be released, and every other place is as it is. The relation is then asked of each transition
alone, over the few places that it touches:

- *starts*: the marking at the start is related, and shows the one of the conceptual net;
- *follows.t*: where t fires, it can fire in what is shown, and what is shown after is that after t; all stays related;
- *hidden.u*: where a move u inside a task fires, its task, closed, can fire it and is then as the steps are; what is
  shown stays, and all stays related;
- *fires.t*: where t can fire in what is shown, and the tasks that it has to do with are where they can end, it can
  fire;
- *fires.u*: where a task, closed, can fire u, and the tasks that u ends are where they can end, u can fire;
- *contact.t*: it has contact only where it has contact in what is shown; *contact.u*: a move has none.

That t has no contact in what is shown is assumed, since it is a marking that the conceptual net reaches. With that each
task always can end, which documents show of the tasks alone, the relation is a branching bisimulation with the moves
inside tasks hidden (docs/refinement.md). Nothing here knows the theorem of which that is an instance, nor its premises:
what a resource must do at the border of a task is not checked but asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from functools import cached_property

from firable.decompose.verification.closed_tasks import ClosedTask
from firable.decompose.verification.formulas import spelled
from firable.decompose.verification.naming_anew import Named
from firable.decompose.verification.opening import Block
from firable.nets.net import Net, Transition
from firable.nets.source import printable

KINDS = {
    "starts": "the marking at the start is related, and shows the one of the conceptual net",
    "follows": "where it fires, the conceptual net can fire it, and shown is the marking after it",
    "hidden": "a move inside a task that fires is one of its task, and what is shown stays",
    "fires": "what can fire in what is shown, or in the task alone, can fire when the tasks concerned can end",
    "contact": "it has contact only where the conceptual net has",
}
"""The kinds of obligations, and what each says."""

Values = Mapping[str, bool]
"""Places of the detailed net of which the value is known; of the others it is their constant."""


def _and(texts: Iterable[str]) -> str:
    found = [*dict.fromkeys(text for text in texts if text != "true")]
    return found[0] if len(found) == 1 else f"(and {' '.join(found)})" if found else "true"


def _or(texts: Iterable[str]) -> str:
    found = [*dict.fromkeys(text for text in texts if text != "false")]
    return found[0] if len(found) == 1 else f"(or {' '.join(found)})" if found else "false"


def _not(text: str) -> str:
    return f"(not {text})"


def _symbol(*words: str) -> str:
    return f"|{spelled(' '.join(words))}|"


class Relation:
    """The obligations on a conceptual net, its detailed net, and the blocks between them."""

    def __init__(self, named: Named, detailed: Net) -> None:
        self.named, self.detailed, self.net = named, detailed, named.opening.net
        self.blocks = {block.key: block for block in named.opening.blocks}
        self.of_place = {key: self.blocks[key] for key in named.places if key in self.blocks}
        """The blocks by the keys of the places that they stand for."""
        self.holders: dict[str, list[tuple[Block, str]]] = {}
        """For each resource that tasks release: the blocks that do, and the role that it has in each."""
        self.within: dict[str, list[Block]] = {}
        """The blocks that a place of the detailed net belongs to: as their own place, or inside."""
        self._closed: dict[str, ClosedTask] = {}
        self.rank = {key: i for i, key in enumerate(self.blocks)}
        self.key_of = {name: key for key, name in named.places.items()}
        for block in self.blocks.values():
            for place in self.places_of(block):
                self.within.setdefault(place, []).append(block)
            for role in sorted(block.task.released):
                self.holders.setdefault(block.filled[role], []).append((block, role))

    # --- Blocks

    def closed(self, name: str) -> ClosedTask:
        """A task, closed."""
        if name not in self._closed:
            self._closed[name] = ClosedTask(self.named.opening.tasks[name])
        return self._closed[name]

    def inner(self, block: Block) -> list[str]:
        """The places of the steps and subtasks of a block, in the order of its task."""
        return [self.named.places[block.inner(name)] for name in self.closed(block.task.name).inner]

    def places_of(self, block: Block) -> list[str]:
        """The place that a block stands for, and those inside."""
        return [self.named.places[block.key], *self.inner(block)]

    def definitions(self) -> Iterator[str]:
        """Functions of the places of a task: whether it may look like that, and still has to release a role."""
        for name in dict.fromkeys(block.task.name for block in self.blocks.values()):
            closed = self.closed(name)
            steps = {step: _symbol("it is at", step) for step in closed.inner}
            head = " ".join(f"({symbol} Bool)" for symbol in ("|it runs|", *steps.values()))

            def at(marking: Set[str], steps: Mapping[str, str] = steps) -> str:
                return _and(symbol if step in marking else _not(symbol) for step, symbol in steps.items())

            running = _or(at(marking) for marking in closed.inside)
            empty = _and(_not(symbol) for symbol in steps.values())
            yield f"(define-fun {_symbol('in', name)} ({head}) Bool (ite |it runs| {running} {empty}))"
            for role in sorted(closed.task.released):
                some = (at(marking) for marking, pending in closed.inside.items() if role in pending)
                text = _and(["|it runs|", _or(some)])
                yield f"(define-fun {_symbol(name, 'still holds', role)} ({head}) Bool {text})"

    # --- Formulas over the detailed net

    @staticmethod
    def at(place: str, then: Values) -> str:
        """A place of the detailed net."""
        return str(then[place]).lower() if place in then else _symbol(place)

    def call(self, function: str, block: Block, then: Values) -> str:
        """A function of the places of a block."""
        return f"({function} {' '.join(self.at(place, then) for place in self.places_of(block))})"

    def shown(self, place: str, then: Values) -> str:
        """What is shown of a place of the conceptual net."""
        idle = self.at(self.named.places[place], then)
        pending = (
            self.call(_symbol(block.task.name, "still holds", role), block, then)
            for block, role in self.holders.get(place, ())
        )
        return _or([idle, *pending])

    def related(self, blocks: Iterable[Block], resources: Iterable[str], then: Values) -> list[str]:
        """That these blocks and resources are as they may be."""
        found = [self.call(_symbol("in", block.task.name), block, then) for block in blocks]
        for resource in resources:
            ways = [self.at(self.named.places[resource], then)]
            ways += [
                self.call(_symbol(block.task.name, "still holds", role), block, then)
                for block, role in self.holders[resource]
            ]
            found += [_not(_and([a, b])) for i, a in enumerate(ways) for b in ways[i + 1 :]]
        return found

    def can_end(self, block: Block) -> str:
        """That a block, where it runs, is where it can end, and so are those that it ends with."""
        return f"(or {_not(_symbol(self.named.places[block.key]))} {self._at_end(block)})"

    def _at_end(self, block: Block) -> str:
        keys = [block.inner(step) for step in block.task.end.sources]
        ends = (self._at_end(self.of_place[key]) for key in keys if key in self.of_place)
        return _and([*(_symbol(self.named.places[key]) for key in keys), *ends])

    # --- The obligations

    @cached_property
    def obligations(self) -> tuple[tuple[str, list[str]], ...]:
        """Each obligation: its name, and what is asserted, which must be contradictory."""
        return tuple(self._obligations())

    def _obligations(self) -> Iterator[tuple[str, list[str]]]:
        start = {place.name: place.marked for place in self.detailed.places}
        same = (self.shown(p.name, start) if p.marked else _not(self.shown(p.name, start)) for p in self.net.places)
        yield "starts", [_not(_and([*self.related(self.blocks.values(), self.holders, start), *same]))]
        for key, name in self.named.transitions.items():
            t = self.detailed.transition(name)
            if key in self.net.transition_index:
                yield from self._conceptual(self.net.transition(key), t)
            else:
                yield from self._inside(key, t)

    def _conceptual(self, of: Transition, t: Transition) -> Iterator[tuple[str, list[str]]]:
        then = _changes(t)
        about = {*of.inputs, *of.outputs, *of.permissive, *of.inhibitive}
        blocks, resources = self._concerned(t, about)
        given = self.related(blocks, resources, {})
        full = [self.shown(place, {}) for place in (*of.inputs, *of.permissive)]
        empty = [_not(self.shown(place, {})) for place in of.inhibitive]
        free = [_not(self.shown(place, {})) for place in of.outputs]
        there = _and([*full, *empty, *free]) if of.openable else "false"
        around = _and(_not(self.shown(place, {})) for place in of.outputs if place not in of.inputs)
        no_contact = f"(or {' '.join([*map(_not, [*full, *empty]), around])})"
        after = [
            *(self.shown(place, then) for place in of.outputs),
            *(_not(self.shown(place, then)) for place in of.inputs),
            *self._unchanged({*of.inputs, *of.outputs}, t, then),
        ]
        fires, contact = self._firable(t), self._contact(t)
        kept = self.related(blocks, resources, then)
        yield f"follows.{t.name}", [*given, no_contact, fires, _not(_and([there, *after, *kept]))]
        ends = [self.can_end(block) for block in blocks]
        yield f"fires.{t.name}", [*given, *ends, there, _not(fires)]
        if contact != "false":
            yield f"contact.{t.name}", [*given, no_contact, contact]

    def _inside(self, key: str, t: Transition) -> Iterator[tuple[str, list[str]]]:
        block = self.named.opening.moves[key].block
        assert block is not None
        of = self.closed(block.task.name).net.transition(key.removeprefix(block.inner("")))
        inner, then = self.closed(block.task.name).inner, _changes(t)
        place = {name: self.named.places[block.inner(name)] for name in inner}
        blocks, resources = self._concerned(t, ())
        given = self.related(blocks, resources, {})
        alone = [
            *(_symbol(place[name]) for name in (*of.inputs, *of.permissive)),
            *(_not(_symbol(place[name])) for name in (*of.outputs, *of.inhibitive) if name in place),
        ]
        there = _and([_symbol(self.named.places[block.key]), *alone]) if of.openable else "false"
        steps = {place[name]: False for name in of.inputs} | {place[name]: True for name in of.outputs if name in place}
        others = (self.key_of[p] for p in then if p not in place.values())
        as_alone = all(then.get(p) == steps.get(p) for p in place.values()) and all(
            key in self.holders or block.holds(key) for key in others
        )
        fires, contact = self._firable(t), self._contact(t)
        kept = [*self._unchanged(set(), t, then), *self.related(blocks, resources, then)]
        yield f"hidden.{t.name}", [*given, fires, _not(_and([there, str(as_alone).lower(), *kept]))]
        ended = [self.of_place[key] for key in map(block.inner, of.inputs) if key in self.of_place]
        yield f"fires.{t.name}", [*given, *map(self.can_end, ended), there, _not(fires)]
        if contact != "false":
            yield f"contact.{t.name}", [*given, contact]

    def _concerned(self, t: Transition, about: Iterable[str]) -> tuple[list[Block], list[str]]:
        """The blocks and resources that a transition touches, and the blocks that hold these resources."""
        touched = (*t.inputs, *t.outputs)
        near = {block.key for place in touched for block in self.within.get(place, ())}
        found = {key for key in (*map(self.key_of.__getitem__, touched), *about) if key in self.holders}
        found |= {self.blocks[key].filled[role] for key in near for role in self.blocks[key].task.released}
        near |= {block.key for resource in found for block, _ in self.holders[resource]}
        return [self.blocks[key] for key in sorted(near, key=self.rank.__getitem__)], sorted(found)

    def _unchanged(self, but: Set[str], t: Transition, then: Values) -> Iterator[str]:
        """That the places of the conceptual net which the transition touches, but for some, are shown as before."""
        _, resources = self._concerned(t, ())
        touched = {key for key in map(self.key_of.__getitem__, then) if key in self.net.place_index} | {*resources}
        for place in sorted(touched - but, key=self.net.place_index.__getitem__):
            yield f"(= {self.shown(place, {})} {self.shown(place, then)})"

    @staticmethod
    def _firable(t: Transition) -> str:
        if not t.openable:
            return "false"
        full, empty = (*t.inputs, *t.permissive), (*t.outputs, *t.inhibitive)
        return _and([*map(_symbol, full), *(_not(_symbol(place)) for place in empty)])

    @staticmethod
    def _contact(t: Transition) -> str:
        outputs = [_symbol(place) for place in t.outputs if place not in t.inputs]
        around = [*map(_symbol, (*t.inputs, *t.permissive)), *(_not(_symbol(place)) for place in t.inhibitive)]
        return _and([*around, _or(outputs)]) if outputs else "false"

    @property
    def text(self) -> str:
        """The file."""
        comments = (
            f"refinement of '{self.net.name}' to '{self.detailed.name}': opening its tasks keeps what it can do",
            "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
            "The constants: a place of the detailed net holds a token. Functions: what a task is like by its places.",
            "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
        )
        lines = [*(f"; {printable(comment)}" for comment in comments), "(set-logic QF_UF)"]
        lines += [f"(declare-const {_symbol(place.name)} Bool)" for place in self.detailed.places]
        lines += self.definitions()
        for name, asserted in self.obligations:
            kind = name.partition(".")[0]
            lines += ["", f"; {KINDS[kind]}", "(push 1)", f'(echo "{spelled(name)}")']
            lines += [f"(assert {one})" for one in asserted]
            lines += ["(check-sat)", "(pop 1)"]
        return "".join(f"{line}\n" for line in lines)


def _changes(t: Transition) -> dict[str, bool]:
    return dict.fromkeys(t.inputs, False) | dict.fromkeys(t.outputs, True)
