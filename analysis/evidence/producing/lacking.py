"""How a producer of evidence says that there is none: a reason that the document keeps."""

from __future__ import annotations

import re
from typing import Final

NO_TIME: Final = "the time for evidence was over"
NO_MEMORY: Final = "the memory for evidence was used up"
NO_MARKINGS: Final = "the markings for evidence were used up"
_ENDED: Final = {"memory": NO_MEMORY, "markings": NO_MARKINGS, "time": NO_TIME}


class LackingError(Exception):
    """No certificate was found, and why."""


def which_ended(error: Exception) -> str:
    """Which budget for evidence ended, of an error that says that one did; of any other what it says.

    >>> which_ended(RuntimeError("the budget of memory is used up"))
    'the memory for evidence was used up'
    >>> which_ended(RuntimeError("80 markings found, 95 edges followed: the time was over"))
    'the time for evidence was over'
    """
    said = str(error)
    end = said.rpartition(": ")[2]  # before it stands how far the search came
    return next((reason for word, reason in _ENDED.items() if word in end), said)


def is_of_budget(reason: str) -> bool:
    """Whether a reason is a budget that ended, of which more may move it.

    >>> is_of_budget(NO_TIME), is_of_budget(f"a vote: {NO_MEMORY}"), is_of_budget("some run refutes the formula")
    (True, True, False)
    """
    return reason.endswith((NO_TIME, NO_MEMORY))


def what_to_allow(reason: str) -> str:
    """More of what a reason says that it ended, as a hint."""
    return "more memory, with --max-memory" if reason.endswith(NO_MEMORY) else "more time, with --max-seconds"


def is_of_size(reason: str) -> bool:
    """Whether a reason is a limit of how many markings are written down, which more time does not move.

    >>> is_of_size("ranks for a response are written for up to 250,000 markings"), is_of_size(NO_TIME)
    (True, False)
    """
    return reason.endswith(NO_MARKINGS) or re.search("[0-9] markings$", reason) is not None
