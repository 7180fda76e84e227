"""Which verdicts a document of evidence speaks of, read without anything that could check it.

Who runs a bundle imports no solver and no analysis, so it cannot tell whether evidence shows what it says; that is the
matter of `firable verify`. It can tell whether there is any: a document about this very net, under the discipline of
the executor, that has a record on the verdict, with the status that the verdict claims, and lacking nothing. So a net
cannot run by a verdict that somebody wrote, on which nobody ever had evidence. Rejected: to look for the name of the
file alone, which any verdict can name.
"""

from __future__ import annotations

import json
from typing import Any, Final

from firable.nets.net import Net

VERSION: Final = 2
"""The version of a document of evidence."""


def named_as_proved(text: str, net: Net, discipline: str) -> frozenset[str]:
    """The verdicts on a net under a discipline that a text, as a document of evidence, has a record of, as proved.

    None for any other text. Takes time linear in the text and the net.
    """
    from firable.nets.interchange import net_digest  # loads a reader of nets, which the right to run alone does not

    try:
        data: Any = json.loads(text)
        about = (version := data["firable_evidence"], data["discipline"], data["digest"])
        if not isinstance(version, int) or about != (VERSION, discipline, net_digest(net)):  # 2.0 equals 2
            return frozenset()
        return frozenset(one["name"] for one in data["verdicts"] if (one["status"], one["lacking"]) == ("proved", ""))
    except (ValueError, KeyError, TypeError, RecursionError):  # no JSON, or that of something else
        return frozenset()
