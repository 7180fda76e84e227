"""How a producer of evidence says that there is none: a reason that the document keeps."""

from __future__ import annotations

from typing import Final

NO_TIME: Final = "the time for evidence was over"


class LackingError(Exception):
    """No certificate was found, and why."""
