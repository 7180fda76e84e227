"""What the tests of bundles share."""

import pytest
from support.remembered import answered, examined, read


@pytest.fixture
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read of a text, answered to it or found of a document before is not asked again."""
    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", {"cvc5": answered})
    monkeypatch.setattr("firable.decompose.verification.documents.check_document", examined)
    monkeypatch.setattr("firable.decompose.verification.documents.document_from_text", read)
