"""Queries: questions to a net that are asked from outside of its file, and the text they are written in.

A file of queries is one query a line, `name: query`; blank lines and lines that begin with `#` are left out. A query
is a formula of CTL or LTL (which of the two, its operators tell; the words `ctl` and `ltl` before it are allowed), or

    bound tokens(p, q)    the greatest number of tokens on these places together, in any reachable marking
    live, quasi_live      every transition can fire again and again, or at least once
    stable_marking        some place never changes
    one_safe              as an ordinary net, without the contact rule, no place ever holds two tokens

docs/queries.md says what each means. The other form of the file is the property XML of the model checking contest
(`firable.nets.property_xml`). Names are checked against the net while reading, so that each problem has its position.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Problems, bounded
from firable.nets.formula import (
    CONSTANT_ATOMS,
    Compare,
    Count,
    FormulaError,
    Holds,
    Sign,
    format_count,
    parse_formula,
)
from firable.nets.formula_tokens import tokens_of
from firable.nets.net import Net
from firable.nets.source import Source, quoted, read_bytes, source_of
from firable.nets.temporal import Logic, Temporal, format_temporal, logics, parse_temporal
from firable.nets.temporal_parts import atoms_in
from firable.nets.well_formed import is_name, unknown_in_formula

SIZE_BYTES_MAX: Final = 64 * 1024 * 1024


class QueryKind(StrEnum):
    """What is asked."""

    CTL = "ctl"
    LTL = "ltl"
    BOUND = "bound"
    LIVE = "live"
    QUASI_LIVE = "quasi_live"
    STABLE_MARKING = "stable_marking"
    ONE_SAFE = "one_safe"


@dataclass(frozen=True, slots=True)
class Query:
    """A question to a net: a `formula` of CTL or LTL, the `bound` of `places`, or of a kind with neither."""

    name: str
    kind: QueryKind
    formula: Temporal | None = None
    places: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, formula: Temporal) -> Query:
        """The query whether a formula holds; CTL where it belongs to both logics."""
        return cls(name, QueryKind.CTL if Logic.CTL in logics(formula) else QueryKind.LTL, formula)


_ALONE: Final = frozenset({QueryKind.LIVE, QueryKind.QUASI_LIVE, QueryKind.STABLE_MARKING, QueryKind.ONE_SAFE})
_NO_SEMICOLON: Final = "a query has no semicolon"


def parse_query(text: str, name: str = "query") -> Query:
    """Read one query; its names are not looked up.

    Raises `FormulaError` with the column where the text stops being one.

    >>> parse_query("bound tokens(p, q)").places
    ('p', 'q')
    >>> parse_query("ltl G (p -> F q)") == parse_query("G (p -> F q)")
    True
    """
    word, rest = (*re.split(r"\s", text, maxsplit=1), "")[:2]
    offset = len(text) - len(rest)
    match word:
        case _ if word in _ALONE:
            if rest.strip():
                raise FormulaError(f"nothing follows {word!r}", offset)
            return Query(name, QueryKind(word))
        case QueryKind.BOUND:
            return Query(name, QueryKind.BOUND, places=_counted(rest, offset))
        case QueryKind.CTL | QueryKind.LTL:
            formula = _shifted(rest, offset)
            if Logic(word) not in logics(formula):
                raise FormulaError(f"this is no formula of {word.upper()}", offset)
            return Query(name, QueryKind(word), formula)
    return Query.of(name, parse_temporal(text))


def _shifted(text: str, offset: int) -> Temporal:
    try:
        return parse_temporal(text)
    except FormulaError as error:
        raise FormulaError(error.message, error.column + offset) from None


def _counted(text: str, offset: int) -> tuple[str, ...]:
    """The places of `tokens(p, q)`: the left side of a comparison whose right side is made up."""
    try:
        match parse_formula(f"{text} <= 0"):
            case Compare(Count(places, 0), Sign.AT_MOST, Count((), 0)) if places:
                return places
    except FormulaError as error:
        if error.column < len(text):
            raise FormulaError(error.message, error.column + offset) from None
    raise FormulaError("expected `tokens(...)` and nothing after it", offset)


def format_query(query: Query) -> str:
    """Print a query, without its name, so that `parse_query` reads it back.

    >>> format_query(parse_query("AG EF p"))
    'ctl AG EF p'
    """
    if query.formula is not None:
        return f"{query.kind} {format_temporal(query.formula)}"
    return f"{query.kind} {format_count(Count(query.places))}" if query.places else str(query.kind)


def read_queries(path: str | Path, net: Net, renamed: Mapping[str, str] | None = None) -> tuple[Query, ...]:
    """Read a file of queries to a net, text or property XML; `renamed` are names of PNML that the net changed.

    Raises `InputError`: F1001-F1004 for the file, F1012 for a formula, F1018 for anything else that is no query, F2001
    for two queries of one name, F2002 and F2004 for unknown places and transitions.
    """
    data = read_bytes(path, SIZE_BYTES_MAX)
    if data.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<"):
        from firable.nets.property_xml import parse_property_xml

        return parse_property_xml(data, net, renamed or {}, str(path))
    return parse_queries(source_of(path, data).text, net, str(path))


def parse_queries(text: str, net: Net, file: str = "<queries>") -> tuple[Query, ...]:
    """Read the lines of a file of queries; raises `InputError` as `read_queries` does."""
    from firable.nets.document_errors import of_another_kind

    source = Source(file, text)
    if (problem := of_another_kind(source)) is not None:
        raise InputError([problem])
    reading = _Lines(source, net)
    queries = tuple(reading.queries())
    if reading.problems:
        raise InputError(bounded(reading.problems))
    if not queries:
        raise source.refuse("F1002", "there is no query in the file", "write `name: AG not deadlock`, one query a line")
    return queries


class _Lines:
    """The lines of one file on their way to queries."""

    def __init__(self, source: Source, net: Net) -> None:
        self.source, self.net = source, net
        self.problems = Problems()

    def refuse(self, code: str, message: str, hint: str, line: int, column: int) -> None:
        self.problems.report(Diagnostic(code, message, hint, span=self.source.span(line, column)))

    def queries(self) -> Iterator[Query]:
        names: dict[str, int] = {}
        known = KnownNames(self.net)
        for number, line in enumerate(self.source.lines, 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            name, colon, text = line.partition(":")
            column, name = len(name) + len(colon) + len(text) - len(text.lstrip()) + 1, name.strip()
            if not colon or not is_name(name):
                hint = "write `name: AG not deadlock`, one query a line"
                self.refuse("F1018", f"no name and colon before the query {quoted(line.strip())}", hint, number, 1)
                continue
            if (other := names.setdefault(name, number)) != number:
                self.refuse("F2001", f"'{name}' also names the query on line {other}", "rename one", number, 1)
            try:
                query = parse_query(text.strip(), name)
            except FormulaError as error:
                hint = _hint_on(text)
                self.refuse("F1012", f"not a query: {error.message}", hint, number, column + error.column)
                continue
            for problem in known.problems(query):
                at, length = _named(problem, text.strip())
                self.problems.report(replace(problem, span=self.source.span(number, column + at, length)))
            yield query


class KnownNames:
    """The names of a net, against which those of queries are checked."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self._places, self._transitions = frozenset(net.place_index), frozenset(net.transition_index)
        self._asked: set[tuple[str, str]] = set()

    def problems(self, query: Query) -> Iterator[Diagnostic]:
        """A problem with each name of the query that the net does not have, each name once a file."""
        if isinstance(query.formula, Holds):  # a word alone
            yield from self._unknown("place", query.formula.place, self._places, CONSTANT_ATOMS | _ALONE)
        atoms = [] if query.formula is None else list(atoms_in(query.formula))
        for name in (*query.places, *(atom.place for atom in atoms if isinstance(atom, Holds))):
            yield from self.place(name)
        for atom in atoms:
            if not isinstance(atom, Holds):
                yield from self.transition(atom.transition)

    def place(self, name: str) -> Iterator[Diagnostic]:
        """The problem with the name of a place, if it is unknown and not yet reported."""
        yield from self._unknown("place", name, self._places)

    def transition(self, name: str) -> Iterator[Diagnostic]:
        """The problem with the name of a transition, if it is unknown and not yet reported."""
        yield from self._unknown("transition", name, self._transitions)

    def _unknown(self, kind: str, name: str, known: Set[str], words: Set[str] = CONSTANT_ATOMS) -> Iterator[Diagnostic]:
        if name not in known and (kind, name) not in self._asked:
            self._asked.add((kind, name))
            hint = f"a query names the {kind}s of the net"
            problem = unknown_in_formula(kind, name, self.net, (name,), hint, words)
            if (before := name.removesuffix(";")) != name:
                write = f"write `{before}`" if before in known | words else "leave it out"
                problem = replace(problem, hint=f"{_NO_SEMICOLON}: {write}")
            yield problem


def query_named(text: str, net: Net, name: str = "query") -> Query:
    """Read one query that stands alone, such as an argument of a command; it may have several lines.

    Raises `InputError`: F1012 where it is none, F2002 and F2004 for unknown names.
    """
    source = Source(f"<{name}>", text)
    try:
        query = parse_query(text.strip(), name)
    except FormulaError as error:
        hint = _hint_on(text)
        span = source.span_at(len(text) - len(text.lstrip()) + error.column)
        raise InputError([Diagnostic("F1012", f"not a query: {error.message}", hint, span=span)]) from None
    if problems := list(KnownNames(net).problems(query)):
        raise InputError(replace(problem, span=source.span_at(*_named(problem, text))) for problem in problems)
    return query


def _hint_on(text: str) -> str:
    """What helps who wrote this for a query."""
    if text.rstrip().endswith(";"):
        return f"{_NO_SEMICOLON}: leave it out"
    return "`firable explain F1012` shows how queries are written"


def _named(problem: Diagnostic, text: str) -> tuple[int, int]:
    """Where (from 0) the name that a problem is about stands in the text of a query, and its length."""
    (name,) = problem.subject
    return next((token.column for token in tokens_of(text) if token.text == name), 0), len(name)
