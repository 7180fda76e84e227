"""From the subjects of diagnostics back to the places of the text.

`Net` names what a problem is about by a path such as `("transitions", "G1", "from", "conveyor.cvx")`, in the full names
of the net. The text nests, shortens and lists. This table is made from the tree, once and only when there is something
to report; where a subject has no place of its own, that of its longest known prefix is taken.

One wrong name used in twenty transitions is one mistake: diagnostics that repeat the same finding are joined, and the
first one tells on which lines the others are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from firable.nets.diagnostics import Diagnostic, Span, Subject, bounded
from firable.nets.source import Source
from firable.nets.time_limits import fault_transition_name, timer_name
from firable.nets.yaml_tree import (
    Node,
    Scalar,
    Sequence,
    entries_of,
    items_of,
    node_span,
    nodes_along,
    scalars_of,
    value_of,
)

_SECOND: Final = frozenset({"F2001", "F2006", "F2007", "F2022"})
"""What is about the second of two equal names."""

_UNKNOWN: Final = frozenset({"F2002", "F2003", "F2004", "F2021"})


@dataclass(frozen=True, slots=True)
class _Within:
    """A part of a scalar: where it begins in the text of the scalar (from 0), and its length."""

    scalar: Scalar
    at: int
    length: int


_Found = Node | _Within


class Positions:
    """Where the subjects of one net file stand in its text."""

    def __init__(self, source: Source, tree: Node) -> None:
        self.source = source
        self.tree = tree

    def called(self, file: str) -> Positions:
        """The same positions in a file that goes by another name."""
        return Positions(replace(self.source, file=file), self.tree)

    def place(self, problems: Iterable[Diagnostic]) -> list[Diagnostic]:
        """The diagnostics with their spans, in the order of the text, joined and bounded."""
        placed = [problem if problem.span else replace(problem, span=self.span(problem)) for problem in problems]
        placed.sort(key=lambda problem: (problem.span.line, problem.span.column) if problem.span else (0, 0))
        return bounded(_joined(placed))

    def span(self, problem: Diagnostic) -> Span:
        """The span of the subject, or of its longest prefix that has one."""
        first, second = self._table
        subject = problem.subject
        found = second.get(subject) if problem.code in _SECOND else None
        while found is None and subject:
            found = first.get(subject)
            subject = subject[:-1]
        match found:
            case None:
                return node_span(self.source, self.tree)
            case _Within(scalar, at, length):
                return self._inside(scalar, at, length)
            case _:
                return node_span(self.source, found)

    def of(self, *path: str) -> Span | None:
        """The span of a subject that stands in the file, such as `("transitions", "G1")`; None where it does not."""
        match self._table[0].get(path):
            case None:
                return None
            case _Within(scalar, at, length):
                return self._inside(scalar, at, length)
            case node:
                return node_span(self.source, node)

    @cached_property
    def whole(self) -> Span:
        """The span for what concerns the net as a whole: its name, or the first line."""
        return node_span(self.source, value_of(self.tree, "cell") or self.tree)

    def in_formula(self, subject: Subject, column: int) -> Span:
        """The span of a character (from 0) of the formula whose text is the value at this path."""
        path: tuple[str | int, ...] = subject
        found = list(nodes_along(self.tree, path))
        if len(found) <= len(path) and isinstance(found[-1][1], Sequence):  # `leads_to: [p, q]`
            found = list(nodes_along(self.tree, (*path[:-1], 0 if path[-1] == "from" else 1)))
        node = found[-1][1]
        return self._inside(node, column, 1) if isinstance(node, Scalar) else node_span(self.source, node)

    def _inside(self, node: Scalar, column: int, length: int) -> Span:
        """A part of a scalar, where the scalar stands in the text letter by letter; else all of it."""
        line = self.source.lines[node.line - 1]
        begin = node.column - 1 + (0 if node.plain else 1)
        if line[begin : begin + len(node.text)] != node.text:
            return node_span(self.source, node)
        return self.source.span(node.line, begin + column + 1, length)

    @cached_property
    def _table(self) -> tuple[dict[Subject, _Found], dict[Subject, _Found]]:
        first: dict[Subject, _Found] = {}
        second: dict[Subject, _Found] = {}
        for subject, found in self._walk():
            (second if subject in first else first).setdefault(subject, found)
        return first, second

    def _walk(self) -> Iterator[tuple[Subject, _Found]]:
        if (cell := value_of(self.tree, "cell")) is not None:
            yield ("cell",), cell
        for name, key, controller in entries_of(self.tree, "controllers"):
            yield ("controllers", name), key
            if (under := value_of(controller, "under")) is not None:
                yield ("controllers", name, "under"), under
            yield from self._scope(controller, ("controllers", name), f"{name}.")
        yield from self._scope(self.tree, (), "")
        for name, key, transition in entries_of(self.tree, "transitions"):
            yield ("transitions", name), key
            for which in ("from", "to", "if", "unless"):
                for item in items_of(value_of(transition, which)):
                    yield ("transitions", name, which, item.text), item
            if (number := value_of(transition, "number")) is not None:
                yield ("transitions", name, "number"), number
        scopes = [(f"{name}.", node) for name, _, node in entries_of(self.tree, "controllers")]
        for prefix, scope in (*scopes, ("", self.tree)):
            for local, _, place in entries_of(scope, "places"):
                yield from _fault(prefix + local, prefix, value_of(place, "within"))
        for name, key, arbiter in entries_of(self.tree, "arbiters"):
            yield ("arbiters", name), key
            if (among := value_of(arbiter, "among")) is not None:
                yield ("arbiters", name, "among"), among
            for item in items_of(value_of(arbiter, "among")):
                yield ("arbiters", name, "among", item.text), item
        for name, key, body in entries_of(self.tree, "properties"):
            yield ("properties", name), key
            for formula in scalars_of(body):
                # A formula names its places between blanks, brackets, commas and quotes.
                for match in re.finditer(r"[^\s()\[\],\"]+", formula.text):
                    yield ("properties", name, match.group()), _Within(formula, match.start(), len(match.group()))

        for name, key, _ in entries_of(self.tree, "expect"):
            yield ("expect", name), key

    def _scope(self, scope: Node, path: Subject, prefix: str) -> Iterator[tuple[Subject, _Found]]:
        for item in items_of(value_of(scope, "start")):
            yield (*path, "start", item.text), item
        for item in items_of(value_of(scope, "inputs")):
            yield ("signals", prefix + item.text), item
        declared: set[str] = set()
        for local, key, place in entries_of(scope, "places"):
            yield ("places", prefix + local), key
            for meaning in ("task", "opens"):
                for part, _, value in entries_of(place, meaning):
                    yield ("places", prefix + local, meaning, part), value
            until = value_of(place, "until")
            if isinstance(until, Scalar):
                yield ("places", prefix + local, "until"), until
                if until.text not in declared:
                    yield ("signals", prefix + until.text), until
                declared.add(until.text)
            yield from _limit(prefix + local, prefix, value_of(place, "within"))


def _joined(problems: list[Diagnostic]) -> list[Diagnostic]:
    """One diagnostic for each unknown name, and no diagnostic twice."""
    groups: dict[tuple[str, str], list[Diagnostic]] = {}
    for problem in problems:
        key = problem.message if problem.code in _UNKNOWN else f"{problem.message} {problem.span}"
        groups.setdefault((problem.code, key), []).append(problem)
    joined = []
    for group in groups.values():
        first = group[0]
        lines = dict.fromkeys(problem.span.line for problem in group[1:] if problem.span)
        if first.code in _UNKNOWN and lines:
            shown = ", ".join(map(str, list(lines)[:5])) + (", ..." if len(lines) > 5 else "")
            word = "line" if len(lines) == 1 else "lines"
            first = replace(first, message=f"{first.message} (also on {word} {shown})")
        joined.append(first)
    return joined


def _limit(place: str, prefix: str, within: Node | None) -> Iterator[tuple[Subject, _Found]]:
    """A time limit and its parts; its timer, where that name is taken, stands there."""
    if within is None:
        return
    subject: Subject = ("places", place, "within")
    yield subject, within
    for key in ("time", "to", "transition", "timer"):
        if (value := value_of(within, key)) is not None:
            yield (*subject, key), value
    timer = value_of(within, "timer")
    yield ("signals", prefix + timer.text if isinstance(timer, Scalar) else timer_name(place)), timer or within


def _fault(place: str, prefix: str, within: Node | None) -> Iterator[tuple[Subject, _Found]]:
    """The fault transition that a time limit gives, and where it says to what place that leads."""
    if within is None:
        return
    named, to = value_of(within, "transition"), value_of(within, "to")
    subject: Subject = ("transitions", named.text if isinstance(named, Scalar) else fault_transition_name(place))
    yield subject, named or within
    if isinstance(to, Scalar):
        yield (*subject, "to", prefix + to.text), to
