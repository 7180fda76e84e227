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
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import Source
from firable.nets.time_limits import fault_place_name, fault_transition_name, timer_name
from firable.nets.yaml_tree import Mapping as TreeMapping
from firable.nets.yaml_tree import Node, Scalar, entries_of, items_of, parse_tree, scalars_of, value_of

_WORD: Final = re.compile(r"(?:(?!->)[^\s()\[\],\">])+")
"""A word of a formula; an arrow may stand right behind one."""
_LOCAL: Final = re.compile(r"[\w-]+")


class Kind(StrEnum):
    """What a name is the name of."""

    CONTROLLER = "controller"
    PLACE = "place"
    SIGNAL = "signal"
    TRANSITION = "transition"
    ARBITER = "arbiter"
    PROPERTY = "property"


_NODES: Final = (Kind.PLACE, Kind.SIGNAL, Kind.TRANSITION)
"""What arcs, gates and formulas tell apart by name; the names of other kinds may be the same."""


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
class _Use:
    """A part of a scalar that is a name, of one of these kinds, but for the prefix that it leaves out."""

    scalar: Scalar
    kinds: tuple[Kind, ...]
    prefix: str
    at: int
    length: int

    @property
    def word(self) -> str:
        return self.scalar.text[self.at : self.at + self.length]


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
        self._folded: dict[tuple[int, int], Mapping[int, tuple[int, int] | None]] = {}
        """Where the letters of a scalar over several lines stand, by where it begins."""

    @cached_property
    def occurrences(self) -> tuple[Occurrence, ...]:
        """All of them, in the order of the text; a name that is declared nowhere has none, unless a limit gives it."""
        declared = list(self._declared())
        known = {(one.kind, name) for name, one in self.given.items()} | {(one.kind, one.name) for one in declared}
        found = {(one.line, one.column): one for one in declared}
        for use in self._used():
            name = use.prefix + use.word
            kind = next((kind for kind in use.kinds if (kind, name) in known), None)
            if kind and (place := self._inside(use.scalar, use.at, use.length)):
                found.setdefault(place, Occurrence(kind, name, *place, use.length, use.prefix))
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
        text = self.source.with_parts(parts)
        if one.kind is Kind.PLACE:
            self.demand_roles(text, changed)
        return text

    def _with_controller(self, old: str, new: str) -> str:
        """The text with another name of a controller, also in the full names of its parts, those to be among them."""
        parts = [
            (other.line, other.column, len(old), new)
            for other in self.occurrences
            if (other.kind, other.name) == (Kind.CONTROLLER, old)
            or (not other.prefix and other.name.startswith(f"{old}.") and other.kind is not Kind.CONTROLLER)
        ]
        for _, _, scope in self._scopes():
            for _, _, body in entries_of(scope, "places"):
                opens = value_of(body, "opens")
                for idle in items_of(value_of(opens, "to")) if opens is not None else ():
                    if idle.text.startswith(f"{old}.") and (place := self._inside(idle, 0, len(old))):
                        parts.append((*place, len(old), new))
        return self.source.with_parts(parts)

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
            (*place, use.length, names[use.word])
            for use in self._used_in_full()
            if use.word in names
            and not {*_NODES}.isdisjoint(use.kinds)
            and (place := self._inside(use.scalar, use.at, use.length))
        )

    def with_full_roles(self, name: str) -> str:
        """The text in which what fills the roles of tasks has its full name where it, or the task's place, is one.

        So either can go to another controller, where its short name would mean nothing, or another place.
        """
        return self.source.with_parts(
            (*place, 0, prefix)
            for _, prefix, scope in self._scopes()
            for local, _, body in entries_of(scope, "places")
            for use in self._roles(body, prefix)
            if use.prefix and name in {prefix + local, prefix + use.word} and (place := self._inside(use.scalar, 0, 1))
        )

    @cached_property
    def filled(self) -> frozenset[tuple[str, str]]:
        """The places that have tasks, each with those that fill the roles, by their full names."""
        return frozenset(
            (prefix + local, use.prefix + use.word)
            for _, prefix, scope in self._scopes()
            for local, _, body in entries_of(scope, "places")
            for use in self._roles(body, prefix)
        )

    def demand_roles(self, text: str, changed: Mapping[str, str]) -> None:
        """Raise `InputError` F2001 where, in a text with other names, another place fills the role of a task.

        A short name means the place of the same controller before that of nobody, which has no longer name.
        """
        wanted = {(changed.get(place, place), changed.get(role, role)) for place, role in self.filled}
        if wanted and (lost := wanted - Names(Source(self.source.file, text)).filled):
            place, role = min(lost)
            message = f"another place would fill the role that '{role}' has in the task of '{place}'"
            raise InputError([Diagnostic("F2001", message, "its short name would be that of both: choose another one")])

    def _scopes(self) -> Iterator[tuple[str, str, Node]]:
        """The controllers and the top level: name, the prefix of what is declared there, and where."""
        yield from ((name, f"{name}.", body) for name, _, body in entries_of(self.tree, "controllers"))
        yield "", "", self.tree

    @cached_property
    def _resources(self) -> frozenset[str]:
        """The full names of the places that say `opens`, which are what the roles of tasks name."""
        return frozenset(
            prefix + local
            for _, prefix, scope in self._scopes()
            for local, _, body in entries_of(scope, "places")
            if value_of(body, "opens") is not None
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

    def _used(self) -> Iterator[_Use]:
        for _, prefix, scope in self._scopes():
            yield from _whole(items_of(value_of(scope, "start")), prefix, Kind.PLACE)
            for _, _, body in entries_of(scope, "places"):
                yield from _whole(items_of(value_of(body, "until")), prefix, Kind.SIGNAL)
                if (within := value_of(body, "within")) is not None:
                    yield from _whole(items_of(value_of(within, "to")), prefix, Kind.PLACE)
                yield from (use for use in self._roles(body, prefix) if use.prefix)
        yield from self._used_in_full()

    def _used_in_full(self) -> Iterator[_Use]:
        """Where names stand that are full ones, whatever is declared around them."""
        for _, prefix, scope in self._scopes():
            yield from _whole(items_of(value_of(scope, "under")), "", Kind.CONTROLLER)
            for _, _, body in entries_of(scope, "places"):
                yield from (use for use in self._roles(body, prefix) if not use.prefix)
        for _, _, body in entries_of(self.tree, "transitions"):
            for part in ("from", "to", "if", "unless"):
                yield from _whole(items_of(value_of(body, part)), "", *_NODES)
        for _, _, body in entries_of(self.tree, "arbiters"):
            yield from _whole(items_of(value_of(body, "among")), "", Kind.TRANSITION)
        for _, _, body in entries_of(self.tree, "properties"):
            for scalar in scalars_of(body):
                yield from (_Use(scalar, _NODES, "", m.start(), len(m.group())) for m in _WORD.finditer(scalar.text))
        for name, key, _ in entries_of(self.tree, "expect"):
            family, dot, of = name.removeprefix("loop.").partition(".")
            if family + dot == "property.":
                yield _Use(key, (Kind.PROPERTY,), "", len(name) - len(of), len(of))

    def _roles(self, body: Node, prefix: str) -> Iterator[_Use]:
        """What fills the roles of a place's task: resources, by their short names if they have one here.

        The name of the task and the texts of its parameters are no names of the net, though they may read like one.
        """
        for key, _, value in entries_of(body, "task"):
            for scalar in scalars_of(value) if key != "name" else ():
                if prefix + scalar.text in self._resources:
                    yield from _whole([scalar], prefix, Kind.PLACE)
                elif scalar.text in self._resources:
                    yield from _whole([scalar], "", Kind.PLACE)

    def _inside(self, scalar: Scalar, at: int, length: int) -> tuple[int, int] | None:
        """Line and column of a part of a scalar, where it stands in the text letter by letter."""
        if not length or not 0 < scalar.line <= len(self.source.lines):
            return None
        line = self.source.lines[scalar.line - 1]
        begin = scalar.column - 1 + (0 if scalar.plain else 1)
        if line[begin : begin + len(scalar.text)] == scalar.text:
            return scalar.line, begin + at + 1
        where = (scalar.line, scalar.column)
        if where not in self._folded:
            self._folded[where] = dict(enumerate(self._letters(scalar)))
        letters = self._folded[where]
        return letters.get(at) if at + length - 1 in letters else None

    def _letters(self, scalar: Scalar) -> Iterator[tuple[int, int] | None]:
        """Line and column of each letter of a scalar over several lines, whose ends and indents it has as blanks.

        None for a blank; they end where the text has something else, as an escape between quotes is, but for one of a
        line end or of a blank.
        """
        lines, row, column = self.source.lines, scalar.line - 1, scalar.column - 1
        escapes = {"\\", "\\ "} if lines[row][column : column + 1] == '"' else set()
        if not scalar.plain:
            row, column = (row + 1, 0) if lines[row][column] in "|>" else (row, column + 1)
        is_blank = True
        for letter in scalar.text:
            if letter.isspace():
                is_blank = True
                yield None
                continue
            while is_blank and row < len(lines):
                column += len(lines[row][column:]) - len(lines[row][column:].lstrip())
                here = lines[row][column : column + 2]
                if is_blank := not here or here in escapes:
                    row, column = (row, column + 2) if here == "\\ " else (row + 1, 0)
            if row == len(lines) or lines[row][column : column + 1] != letter:
                return
            column += 1
            yield row + 1, column


def _whole(scalars: Iterable[Scalar], prefix: str, *kinds: Kind) -> Iterator[_Use]:
    return (_Use(scalar, kinds, prefix, 0, len(scalar.text)) for scalar in scalars)
