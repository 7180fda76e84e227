"""The property XML of the model checking contest, as queries to a net.

The contest (https://mcc.lip6.fr) asks its questions in one XML dialect: reachability, CTL and LTL over cardinality
(`integer-le` of `tokens-count`) and fireability (`is-fireable`), `place-bound` for upper bounds, `deadlock`; tools add
elements for liveness, quasi-liveness, stable marking and safeness. All of it is read as it is. The quantifier around an
LTL formula is implied here and taken off; what is in both logics is CTL, which says the same of every net but for
`next`: in a deadlock `AX p` holds, and `X p` iff p does. The contest asks for each logic in a file of its own: the
category in the <id>, or else in the name of the file, tells which is meant, and else the other properties of the file,
where those that can be of one logic only are of LTL. `next` that is told by nothing is that of CTL.

What is not known is refused, never skipped: a formula of which a part is left out is another formula.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Problems, bounded
from firable.nets.formula import Compare, Constant, Count, Deadlock, Firable, Formula, FormulaError, Or, Sign
from firable.nets.net import Net
from firable.nets.queries import KnownNames, Query, QueryKind
from firable.nets.source import Source, quoted, xml_text
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Logic,
    Next,
    Temporal,
    Until,
    all_of,
    any_of,
    logics,
    negated,
    operands_of,
)
from firable.nets.well_formed import is_name
from firable.nets.xml_tree import Element, parse_elements

_UNARY: Final[dict[str, type[Next | Eventually | Globally]]] = {
    "next": Next,
    "finally": Eventually,
    "globally": Globally,
}
_SIGNS: Final = {
    "integer-le": Sign.AT_MOST,
    "integer-lt": Sign.LESS,
    "integer-eq": Sign.EQUAL,
    "integer-ne": Sign.UNEQUAL,
    "integer-ge": Sign.AT_LEAST,
    "integer-gt": Sign.MORE,
}
_WHOLE: Final = {
    "liveness": QueryKind.LIVE,
    "quasi-liveness": QueryKind.QUASI_LIVE,
    "stable-marking": QueryKind.STABLE_MARKING,
}
_CATEGORY: Final = re.compile("(CTL|LTL)(?:Cardinality|Fireability)")
_HINT: Final = "the property XML of the model checking contest is read, with nothing else in it"


def parse_property_xml(data: bytes, net: Net, renamed: Mapping[str, str], file: str = "<xml>") -> tuple[Query, ...]:
    """The queries of a property XML file.

    Raises `InputError`: F1002 and F1018 where it is none, F1012 for a mixture of CTL and LTL, F2001 for two queries of
    one name, F2002 and F2004 for unknown places and transitions.
    """
    source = Source(file, xml_text(data))
    reading = _Reading(source, net, renamed)
    queries = tuple(reading.queries(parse_elements(source, data, "F1018")))
    if reading.problems:
        raise InputError(bounded(reading.problems))
    if not queries:
        raise source.refuse(
            "F1002", "there is no query in the file", "a <property-set> has a <property> for each query"
        )
    return tuple(_in_its_logic(queries, Path(file).name))


class _Reading:
    """One file on its way to queries."""

    def __init__(self, source: Source, net: Net, renamed: Mapping[str, str]) -> None:
        self.source, self.renamed = source, renamed
        self.known = KnownNames(net)
        self.problems = Problems()

    def refuse(self, element: Element, message: str) -> InputError:
        span = self.source.span(element.line, element.column, len(element.tag) + 1)
        return InputError([Diagnostic("F1018", message, _HINT, span=span)])

    def queries(self, root: Element) -> Iterator[Query]:
        names: dict[str, int] = {}
        if root.tag != "property-set":
            raise self.refuse(root, f"the root is <{quoted(root.tag)[1:-1]}>, not <property-set>")
        for element in root.children:
            try:
                query = self.query(element)
            except InputError as error:
                for problem in error.diagnostics:
                    self.problems.report(problem)
                continue
            if (other := names.setdefault(query.name, element.line)) != element.line:
                span = self.source.span(element.line, element.column)
                message = f"{quoted(query.name)} also names the property on line {other}"
                self.problems.report(Diagnostic("F2001", message, "rename one of them", span=span))
            yield query

    def query(self, element: Element) -> Query:
        if element.tag != "property":
            raise self.refuse(element, f"<{quoted(element.tag)[1:-1]}> where a <property> is expected")
        name = next((child.text for child in element.children if child.tag == "id"), "")
        formulas = [child for child in element.children if child.tag == "formula"]
        if not name or len(formulas) != 1:
            raise self.refuse(element, "a <property> has an <id> and one <formula>")
        if not is_name(name):
            raise self.refuse(element, f"the <id> {quoted(name)} is not a name")
        inner = self.one(formulas[0])
        if inner.tag == "place-bound":
            return Query(name, QueryKind.BOUND, places=self.places(inner))
        if inner.tag in _WHOLE:
            return Query(name, _WHOLE[inner.tag])
        if inner.tag == "k-safe":
            if self.count(self.one(inner)) != Count(added=1):
                raise self.refuse(inner, "only 1-safeness is asked of nets whose places hold one token at most")
            return Query(name, QueryKind.ONE_SAFE)
        formula = self.temporal(inner)
        try:
            if isinstance(formula, ForAll) and not _is_ctl(formula):
                formula = formula.path
                if Logic.LTL not in logics(formula):
                    raise FormulaError("CTL and LTL are mixed", 0)
            return Query.of(name, formula)
        except FormulaError as error:
            span = self.source.span(inner.line, inner.column)
            hint = "a quantifier stands before every temporal operator, or one before the whole formula"
            raise InputError([Diagnostic("F1012", f"{quoted(name)}: {error.message}", hint, span=span)]) from None

    def temporal(self, element: Element) -> Temporal:
        children = element.children
        match element.tag:
            case "true" | "false":
                return Constant(element.tag == "true")
            case "deadlock":
                return Deadlock()
            case "negation":
                return negated(self.temporal(self.one(element)))
            case "conjunction" | "disjunction" if children:
                operands = tuple(map(self.temporal, children))
                return all_of(operands) if element.tag == "conjunction" else any_of(operands)
            case "implication":
                left, right = map(self.temporal, self.two(element))
                return any_of((negated(left), right))
            case "equivalence" | "exclusive-disjunction":
                left, right = map(self.temporal, self.two(element))
                if element.tag == "exclusive-disjunction":
                    right = negated(right)
                return any_of((all_of((left, right)), all_of((negated(left), negated(right)))))
            case "is-fireable" if children:
                firable = tuple(Firable(self.transition(child)) for child in children)
                return firable[0] if len(firable) == 1 else Or(firable)
            case "invariant":
                return ForAll(Globally(self.temporal(self.one(element))))
            case "impossibility":
                return ForAll(Globally(negated(self.temporal(self.one(element)))))
            case "possibility":
                return Exists(Eventually(self.temporal(self.one(element))))
            case "exists-path":
                return Exists(self.temporal(self.one(element)))
            case "all-paths":
                return ForAll(self.temporal(self.one(element)))
            case "until":
                before, reach = self.two(element)
                if (before.tag, reach.tag) != ("before", "reach"):
                    raise self.refuse(element, "an <until> holds <before> and <reach>")
                return Until(self.temporal(self.one(before)), self.temporal(self.one(reach)))
            case tag if tag in _UNARY:
                return _UNARY[tag](self.temporal(self.one(element)))
            case tag if tag in _SIGNS:
                left_count, right_count = map(self.count, self.two(element))
                return Compare(left_count, _SIGNS[tag], right_count)
        raise self.refuse(element, f"<{quoted(element.tag)[1:-1]}> is not known here")

    def count(self, element: Element) -> Count:
        match element.tag:
            case "tokens-count":
                return Count(self.places(element))
            case "integer-constant" if element.text.isdecimal() and len(element.text) <= 9:
                return Count(added=int(element.text))
            case "integer-sum" if element.children:
                parts = [self.count(child) for child in element.children]
                return Count(tuple(p for part in parts for p in part.places), sum(part.added for part in parts))
        raise self.refuse(element, f"<{quoted(element.tag)[1:-1]}> with {quoted(element.text)} is no count of tokens")

    def one(self, element: Element) -> Element:
        if len(element.children) != 1:
            raise self.refuse(element, f"<{element.tag}> holds {len(element.children)} elements, and not one")
        return element.children[0]

    def two(self, element: Element) -> list[Element]:
        if len(element.children) != 2:
            raise self.refuse(element, f"<{element.tag}> holds {len(element.children)} elements, and not two")
        return element.children

    def places(self, element: Element) -> tuple[str, ...]:
        if not element.children:
            raise self.refuse(element, f"<{element.tag}> names no place")
        return tuple(self.place(child) for child in element.children)

    def place(self, element: Element) -> str:
        return self.name(element, "place")

    def transition(self, element: Element) -> str:
        return self.name(element, "transition")

    def name(self, element: Element, kind: str) -> str:
        if element.tag != kind:
            raise self.refuse(element, f"<{quoted(element.tag)[1:-1]}> where a <{kind}> is expected")
        name = self.renamed.get(element.text, element.text)
        unknown = self.known.place(name) if kind == "place" else self.known.transition(name)
        for problem in unknown:
            span = self.source.span(element.line, element.column, len(element.tag) + 2)
            self.problems.report(replace(problem, span=span))
        return name


def _in_its_logic(queries: Sequence[Query], file: str) -> Iterator[Query]:
    """The queries, with `next` over a state formula in the logic of its file."""
    told = {query.kind for query in queries if _is_of_one_logic(query)}
    for query in queries:
        match query.formula:
            case ForAll(Next(operand) as path) if isinstance(operand, Formula):
                named = _CATEGORY.findall(query.name) or _CATEGORY.findall(file)
                is_ltl = named[-1] == "LTL" if named else told == {QueryKind.LTL}
                yield Query(query.name, QueryKind.LTL, path) if is_ltl else query
            case _:
                yield query


def _is_of_one_logic(query: Query) -> bool:
    """Whether a formula, as the XML has it, can be meant in one of the two logics only."""
    match query.formula:
        case ForAll(path):
            return not all(isinstance(operand, Formula) for operand in operands_of(path))
        case None:
            return False
    return not isinstance(query.formula, Formula)


def _is_ctl(formula: Temporal) -> bool:
    try:
        return Logic.CTL in logics(formula)
    except FormulaError:
        return False
