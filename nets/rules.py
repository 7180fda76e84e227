"""The rule that a verdict is about: the code by which reports, code-scanning sites and `firable explain` know it.

A verdict has a name of its own net (`property.no_crash`, `eq7.G3`), too many to be rules; a site that groups alerts,
and an engineer who wants to read what is meant, need one code for all verdicts of a kind. A verdict that says its own
code keeps it (`F3001`, or `F3004` where a budget ended); the others are told by their names here. The alternative, a
code at each place that makes a verdict, would have the bundle and the cache carry what their names say already.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from firable.nets.verdict import Status, Verdict

_UNDECIDED: Final = "F3004"
_OBLIGATION: Final = "F4002"

_OF_THE_NET: Final[Mapping[str, str]] = {
    "contact-free": "F3010",
    "deadlock-free": "F3011",
    "doomed-markings": "F3012",
    "quasi-live": "F3013",
    "live": "F3014",
    "reversible": "F3015",
    "home-markings": "F3016",
    "structural-conflicts": "F3017",
    "effective-conflicts": "F3018",
    "gate-races": "F3019",
    "steps-serialisable": "F3020",
    "starvation": "F3021",
    "self-loops": "F2009",
    "machine-never-stopped": "F3001",
    "output-signals-in-M0": "F3002",
    "conflicting-commands": "F3003",
    "shared-completions": "F3005",
    "busy-machines": "F3030",
    "accidents": "F3031",
    "completions": "F3032",
    "gates-open": "F3033",
}
_FAMILIES: Final[Mapping[str, str]] = {
    "property": "F3022",
    "query": "F3023",
    "fault": "F3034",
    "persistent": "F4005",
    "protocol": "F4006",
    "explored": "F4006",
    "faults": "F4006",
}


def rule_of(verdict: Verdict) -> str:
    """The code of the rule that a verdict is about; what no table names is an obligation of the decomposition.

    >>> rule_of(Verdict("loop.property.no_crash", Status.VIOLATED, "...", "explicit"))
    'F3022'
    """
    if verdict.expected is not None and verdict.outcome is Status.VIOLATED:
        return "F3024"
    if verdict.code:
        return verdict.code
    if verdict.status is Status.UNKNOWN:
        return _UNDECIDED
    name = verdict.name.removeprefix("loop.")
    return _OF_THE_NET.get(name) or _FAMILIES.get(name.partition(".")[0], _OBLIGATION)
