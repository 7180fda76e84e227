"""Where the names of a net stand in its file: each use and each definition, for editors that go to one or change all.

`Positions` finds the place of a problem, the first one of its subject. An editor asks the other way round, from a place
to the name that stands there, and wants every place of that name, in the form that is written there: inside its
controller a place has its short name, elsewhere the full one. The names are read from the tree of the text alone, so
that an editor can find its way in a net that is not well formed yet.

A time limit gives a place three names that follow from its own (`nets/time_limits`). They are used like any other, and
follow it when it is renamed, also where the fault place is declared. Who renames that one means another name for the
place to which the limit leads, so `within` then says it (`to`); else the limit would lead to a new place.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import Source
from firable.nets.time_limits import fault_place_name, fault_transition_name, timer_name
from firable.nets.yaml_tree import Mapping as TreeMapping
from firable.nets.yaml_tree import Node, Scalar, entries_of, items_of, parse_tree, scalars_of, value_of

_WORD: Final = re.compile(r"[^\s()\[\],\"]+")
_LOCAL: Final = re.compile(r"[\w-]+")


class Kind(StrEnum):
    """What a name is the name of."""

    CONTROLLER = "controller"
    PLACE = "place"
    SIGNAL = "signal"
    TRANSITION = "transition"
    ARBITER = "arbiter"
    PROPERTY = "property"


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One place where a name stands: its full name, and line, column (from 1) and length of what is written there.

    `prefix` is what the written form leaves out of the full name: `robot.` inside the controller.
    """

    kind: Kind
    name: str
    line: int
    column: int
    length: int
    prefix: str = ""
    defines: bool = False


@dataclass(frozen=True, slots=True)
class Given:
    """A name that follows from that of a place with a time limit: how it does, and where the limit stands."""

    kind: Kind
    place: str
    named: Callable[[str], str]
    within: Node


_GIVEN: Final = (
    ("timer", Kind.SIGNAL, timer_name),
    ("to", Kind.PLACE, fault_place_name),
    ("transition", Kind.TRANSITION, fault_transition_name),
)
"""What a time limit gives, by the key of `within` that names it otherwise."""


class Names:
    """The names of a net file; raises `InputError` where the text is not YAML.

    >>> text = "firable: 1\\ncell: c\\nplaces: {p: , q: }\\nstart: p\\ntransitions: {t: {from: p, to: q}}\\n"
    >>> names = Names(Source("c.firable.yaml", text))
    >>> found = names.at(5, 25)
    >>> found.name, [(one.line, one.column) for one in names.of(found)]
    ('p', [(3, 10), (4, 8), (5, 25)])
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self.tree = parse_tree(source)

    @cached_property
    def occurrences(self) -> tuple[Occurrence, ...]:
        """All of them, in the order of the text; a name that is declared nowhere has none, unless a limit gives it."""
        declared = list(self._declared())
        kinds = {name: one.kind for name, one in self.given.items()} | {one.name: one.kind for one in declared}
        found = {(one.line, one.column): one for one in declared}
        for scalar, prefix, at, length in self._used():
            word = scalar.text[at : at + length]
            if (place := self._inside(scalar, at, length)) and (kind := kinds.get(prefix + word)):
                found.setdefault(place, Occurrence(kind, prefix + word, *place, length, prefix))
        return tuple(sorted(found.values(), key=lambda one: (one.line, one.column)))

    @cached_property
    def given(self) -> Mapping[str, Given]:
        """The names that follow from time limits, declared or not, by their full names."""
        scopes = [("", self.tree), *((f"{name}.", body) for name, _, body in entries_of(self.tree, "controllers"))]
        found = {}
        for prefix, scope in scopes:
            for local, _, body in entries_of(scope, "places"):
                if (within := value_of(body, "within")) is None:
                    continue
                for key, kind, named in _GIVEN:
                    if value_of(within, key) is None:
                        found[named(prefix + local)] = Given(kind, prefix + local, named, within)
        return found

    def at(self, line: int, column: int) -> Occurrence | None:
        """The name at a line and column (from 1), the column after its last character included."""
        here = (one for one in self.occurrences if one.line == line and one.column <= column <= one.column + one.length)
        return next(here, None)

    def of(self, one: Occurrence) -> tuple[Occurrence, ...]:
        """All places of the name that stands at one of them."""
        return tuple(other for other in self.occurrences if (other.kind, other.name) == (one.kind, one.name))

    def definition(self, one: Occurrence) -> Occurrence:
        """Where a name is declared; of one that a time limit gives and nothing declares, its place."""
        found = next((other for other in self.of(one) if other.defines), None)
        if found is not None:
            return found
        return next(other for other in self.occurrences if other.defines and other.name == self.given[one.name].place)

    def renames(self, one: Occurrence, new: str) -> Mapping[str, str]:
        """The full names that a rename changes, with the new ones: of a controller also those of its parts, of a place
        with a time limit also those that the limit gives.

        `new` is the short name; the full one will do. Raises `InputError` F2012 where it is no name, F2001 where
        something has it already, F1020 for a name that a time limit gives and nothing declares.
        """
        if not any(other.defines for other in self.of(one)):
            hint = "it follows from a time limit: name it there, beside `within`"
            raise InputError([Diagnostic("F1020", f"the name '{one.name}' stands nowhere in the file by itself", hint)])
        prefix, _, old = one.name.rpartition(".") if one.kind in {Kind.PLACE, Kind.SIGNAL} else ("", "", one.name)
        new = new.removeprefix(f"{prefix}.") if prefix else new
        if not _LOCAL.fullmatch(new):
            message = f"{new!r} is not a name"
            raise InputError([Diagnostic("F2012", message, "use letters, digits, '_' and '-'")])
        full = f"{prefix}.{new}" if prefix else new
        changed = {one.name: full}
        if one.kind is Kind.PLACE:
            changed |= {name: limit.named(full) for name, limit in self.given.items() if limit.place == one.name}
        taken = ({other.name for other in self.occurrences} | self.given.keys()) - changed.keys()
        if twice := sorted(taken.intersection(changed.values())):
            raise InputError([Diagnostic("F2001", f"there is a '{twice[0]}' already", "choose another name")])
        if one.kind is Kind.CONTROLLER:
            of_it = (other for other in self.occurrences if other.defines and other.name.startswith(f"{old}."))
            changed |= {other.name: new + other.name[len(old) :] for other in of_it}
            limits = ((name, limit) for name, limit in self.given.items() if limit.place in changed)
            changed |= {name: limit.named(changed[limit.place]) for name, limit in limits}
        return changed

    def renamed(self, one: Occurrence, new: str) -> str:
        """The text with a name changed wherever it stands, and those that follow; raises `InputError` as `renames`."""
        changed = self.renames(one, new)
        if one.kind is Kind.CONTROLLER:
            return self._with_controller(one.name, changed[one.name])
        short = changed[one.name].rpartition(".")[2]
        kinds = {one.name: one.kind} | {name: self.given[name].kind for name in changed if name != one.name}
        parts = [
            (other.line, other.column, other.length, changed[other.name].removeprefix(other.prefix))
            for other in self.occurrences
            if kinds.get(other.name) is other.kind
        ]
        if one.kind is Kind.PLACE and one.name in self.given:
            parts += self._leading_to(self.given[one.name].within, short)
        return self.source.with_parts(parts)

    def _with_controller(self, old: str, new: str) -> str:
        """The text with another name of a controller, also in the full names of its parts."""
        return self.source.with_parts(
            (other.line, other.column, len(old), new)
            for other in self.occurrences
            if (other.kind, other.name) == (Kind.CONTROLLER, old)
            or (not other.prefix and other.name.startswith(f"{old}.") and other.kind is not Kind.CONTROLLER)
        )

    def _leading_to(self, within: Node, place: str) -> Iterator[tuple[int, int, int, str]]:
        """What makes a time limit name its fault place: in `{...}` as on lines of its own, or for a time alone."""
        if isinstance(within, Scalar):
            yield within.line, within.column, 0, "{time: "
            yield within.line, within.column + within.length, 0, f", to: {place}}}"
        elif isinstance(within, TreeMapping):
            key, _ = next(iter(within.entries.values()))
            is_flow = self.source.lines[within.line - 1][within.column - 1] == "{"
            newline = "\r\n" if "\r\n" in self.source.text else "\n"
            yield key.line, key.column, 0, f"to: {place}" + (", " if is_flow else newline + " " * (key.column - 1))

    def replaced(self, names: Mapping[str, str]) -> str:
        """The text in which each full name that is a key of `names` is used under another; declarations stay."""
        return self.source.with_parts(
            (*place, length, names[word])
            for scalar, prefix, at, length in self._used()
            if not prefix
            and (word := scalar.text[at : at + length]) in names
            and (place := self._inside(scalar, at, length))
        )

    def _declared(self) -> Iterator[Occurrence]:
        for name, key, body in entries_of(self.tree, "controllers"):
            yield from self._defined(Kind.CONTROLLER, key, name)
            yield from self._declared_in(body, f"{name}.")
        yield from self._declared_in(self.tree, "")
        tables = {"transitions": Kind.TRANSITION, "arbiters": Kind.ARBITER, "properties": Kind.PROPERTY}
        for table, kind in tables.items():
            for name, key, _ in entries_of(self.tree, table):
                yield from self._defined(kind, key, name)

    def _declared_in(self, scope: Node, prefix: str) -> Iterator[Occurrence]:
        for item in items_of(value_of(scope, "inputs")):
            yield from self._defined(Kind.SIGNAL, item, prefix + item.text, prefix)
        seen: set[str] = set()
        for local, key, body in entries_of(scope, "places"):
            yield from self._defined(Kind.PLACE, key, prefix + local, prefix)
            until = value_of(body, "until")
            if isinstance(until, Scalar) and until.text and until.text not in seen:
                seen.add(until.text)
                yield from self._defined(Kind.SIGNAL, until, prefix + until.text, prefix)
            within = value_of(body, "within")
            for part, kind in (("transition", Kind.TRANSITION), ("timer", Kind.SIGNAL)):
                named = value_of(within, part) if within is not None else None
                if isinstance(named, Scalar):
                    given = prefix if kind is Kind.SIGNAL else ""
                    yield from self._defined(kind, named, given + named.text, given)

    def _defined(self, kind: Kind, at: Scalar, name: str, prefix: str = "") -> Iterator[Occurrence]:
        if place := self._inside(at, 0, len(at.text)):
            yield Occurrence(kind, name, *place, len(at.text), prefix, defines=True)

    def _used(self) -> Iterator[tuple[Scalar, str, int, int]]:
        """Scalars, the prefix of what they name, and the part of them that is a name."""
        for name, _, body in entries_of(self.tree, "controllers"):
            yield from _whole(items_of(value_of(body, "under")), "")
            yield from self._used_in(body, f"{name}.")
        yield from self._used_in(self.tree, "")
        for _, _, body in entries_of(self.tree, "transitions"):
            for part in ("from", "to", "if", "unless"):
                yield from _whole(items_of(value_of(body, part)), "")
        for _, _, body in entries_of(self.tree, "arbiters"):
            yield from _whole(items_of(value_of(body, "among")), "")
        for _, _, body in entries_of(self.tree, "properties"):
            for scalar in scalars_of(body):
                yield from ((scalar, "", m.start(), len(m.group())) for m in _WORD.finditer(scalar.text))
        for name, key, _ in entries_of(self.tree, "expect"):
            begin = len(name) - len(name.removeprefix("loop.").removeprefix("property."))
            yield key, "", begin, len(name) - begin

    def _used_in(self, scope: Node, prefix: str) -> Iterator[tuple[Scalar, str, int, int]]:
        yield from _whole(items_of(value_of(scope, "start")), prefix)
        for _, _, body in entries_of(scope, "places"):
            yield from _whole(items_of(value_of(body, "until")), prefix)
            if (within := value_of(body, "within")) is not None:
                yield from _whole(items_of(value_of(within, "to")), prefix)
            if (task := value_of(body, "task")) is not None:
                yield from _whole(scalars_of(task), "")

    def _inside(self, scalar: Scalar, at: int, length: int) -> tuple[int, int] | None:
        """Line and column of a part of a scalar, where the scalar stands in the text letter by letter."""
        if not length or not 0 < scalar.line <= len(self.source.lines):
            return None
        line = self.source.lines[scalar.line - 1]
        begin = scalar.column - 1 + (0 if scalar.plain else 1)
        if line[begin : begin + len(scalar.text)] != scalar.text:
            return None
        return scalar.line, begin + at + 1


def _whole(scalars: Iterator[Scalar], prefix: str) -> Iterator[tuple[Scalar, str, int, int]]:
    return ((scalar, prefix, 0, len(scalar.text)) for scalar in scalars)
