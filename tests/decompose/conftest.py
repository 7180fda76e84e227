"""What the tests of bundles share."""

import pytest
from support.remembered import answered, examined


@pytest.fixture
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was answered to a text or found of a document before is not asked again."""
    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", {"cvc5": answered})
    monkeypatch.setattr("firable.decompose.verification.documents.check_document", examined)
