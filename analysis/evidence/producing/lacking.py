"""How a producer of evidence says that there is none: a reason that the document keeps."""

from __future__ import annotations

import re
from typing import Final

NO_TIME: Final = "the time for evidence was over"


class LackingError(Exception):
    """No certificate was found, and why."""


def is_of_size(reason: str) -> bool:
    """Whether a reason is a limit of how many markings are written down, which more time does not move.

    >>> is_of_size("ranks for a response are written for up to 250,000 markings"), is_of_size(NO_TIME)
    (True, False)
    """
    return re.search("[0-9] markings$", reason) is not None
