"""What the tests of bundles share."""

import pytest
from support.remembered import examined, read


@pytest.fixture
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read of a text or found of a document before is not asked again."""
    monkeypatch.setattr("firable.decompose.verification.documents.check_document", examined)
    monkeypatch.setattr("firable.decompose.verification.documents.document_from_text", read)
