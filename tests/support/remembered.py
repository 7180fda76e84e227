"""Documents, answers of the second solver and findings of the checker that many mutants share, found once a process."""

from collections.abc import Iterator
from functools import cache, lru_cache

from firable.analysis.evidence.checking.checker import CheckedRecord, check_document
from firable.analysis.evidence.document import Document, document_from_text
from firable.decompose.verification.solvers import by_cvc5

_found: dict[tuple[str, int], tuple[CheckedRecord, ...]] = {}


@lru_cache(512)
def answered(text: str, timeout_ms: int) -> tuple[str, ...]:
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
