"""Bundles, documents, answers of the second solver and what the checker finds, once a process for many mutants."""

from collections.abc import Callable, Iterator
from functools import cache, lru_cache

from firable.analysis.check import check
from firable.analysis.evidence.checking.checker import CheckedRecord, check_document
from firable.analysis.evidence.document import Document, document_from_text
from firable.decompose.bundling import make_bundle
from firable.decompose.verification.solvers import by_cvc5
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, family_net
from firable.nets.verdict import Verdict

Answers = tuple[str, ...]
"""The name of each obligation of a file, and behind it what a solver says of it."""

UNORDERED: tuple[Callable[[Answers], Answers], ...] = (
    lambda said: said[:-1],
    lambda said: said[:-2],
    lambda said: (*said[2:], *said[:2]),
    lambda _: (),
)
"""What makes of answers some that are not to one obligation of their file after the other."""

_found: dict[tuple[str, int], tuple[CheckedRecord, ...]] = {}


@lru_cache(512)
def answered(text: str, timeout_ms: int) -> Answers:
    """What cvc5 answers to a text."""
    return by_cvc5(text, timeout_ms)


@cache
def read(text: str, file: str = "") -> Document:
    """What a text is read as."""
    return document_from_text(text, file)


def examined(document: Document, timeout_ms: int) -> Iterator[CheckedRecord]:
    """What the checker finds of a document."""
    key = document.to_text(), timeout_ms
    if key not in _found:
        _found[key] = tuple(check_document(document, timeout_ms=timeout_ms))
    return iter(_found[key])


@cache
def bundled(name: str) -> Bundle:
    """A bundle of a cell of the catalogue, or of a member of a family."""
    return make_bundle(check(family_net(name) if "-" in name else catalogue_net(name)))


def rests_on_an_obligation(verdict: Verdict) -> bool:
    """Whether a verdict of a bundle names a file of obligations as its evidence."""
    return verdict.evidence[:1] != () and verdict.evidence[0].endswith(".smt2")
