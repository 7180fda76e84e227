"""The rule that a verdict is about: the code by which reports, code-scanning sites and `firable explain` know it.

With it goes what to write instead where the verdict does not hold: what the one who decided it says of this net, or
else what is said of every verdict of the rule.

A verdict has a name of its own net (`property.no_crash`, `eq7.G3`), too many to be rules; a site that groups alerts,
and an engineer who wants to read what is meant, need one code for all verdicts of a kind. A verdict that says its own
code keeps it (`F3001`, or `F3004` where a budget ended); the others are told by their names here. The alternative, a
code at each place that makes a verdict, would have the bundle and the cache carry what their names say already.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
_OF_A_RUN: Final[Mapping[str, str]] = {
    "workpieces-carried-through": "F5007",
    "workpieces-intact": "F5007",
    "ran-until-stopped": "F5007",
    "host-ended-in-order": "F5007",
    "machines": "F5008",
    "machines-as-modelled": "F5008",
    "rehearsal": "F4006",
}
"""Verdicts on what has happened, of which no budget leaves one undecided."""
_FAMILIES: Final[Mapping[str, str]] = {
    "property": "F3022",
    "query": "F3023",
    "fault": "F3034",
    "persistent": "F4005",
    "protocol": "F4006",
    "explored": "F4006",
    "faults": "F4006",
    "wrong": "F4006",
    "bisimilar": "F3010",
}


_OTHERWISE: Final = "F3024"
"""The rule that a verdict is as the file expects it."""
_SAID_OF_ALL: Final[Mapping[str, str]] = {
    "F3015": "where the cell has to come back, give it a way to; `{name}: proved` under `expect` holds `check` to that",
    "F3016": "the cell divides for good: where it must not, give one of the ways a transition back to the other",
    "F3017": "where they must not compete, give each a place of its own; `effective-conflicts` tells of those that do",
    "F3018": "an arbiter of the file decides between all of these; gates that exclude each other take the choice away",
    "F3019": "where the order of the two matters, make one wait for the other by a place",
    "F3022": "mend the net or the property; till then `{name}: violated` under `expect` passes `check`, not `bundle`",
    "F3023": "mend the net or the query; a formula that has to hold belongs under `properties` of the file",
    "F5007": "`firable view NET --trace FILE` plays what `--trace` wrote, and tells what each transition waits for",
}


def rule_of(verdict: Verdict) -> str:
    """The code of the rule that a verdict is about; what no table names is an obligation of the decomposition.

    >>> rule_of(Verdict("loop.property.no_crash", Status.VIOLATED, "...", "explicit"))
    'F3022'
    """
    return _OTHERWISE if _is_otherwise(verdict) else _own_rule(verdict)


def hints_of(verdict: Verdict) -> Iterator[tuple[str, str]]:
    """What to write instead, each with its code; of a verdict that ends otherwise than the file expects, about both.

    >>> list(hints_of(Verdict("gate-races", Status.VIOLATED, "...", "structure")))
    [('F3019', 'where the order of the two matters, make one wait for the other by a place')]
    """
    if _is_otherwise(verdict):
        ended = f"the file expects {verdict.expected}, and it is {verdict.status}"
        write = f"write `{verdict.name}: {verdict.status}` under `expect`, or take its line out"
        yield _OTHERWISE, f"{ended}; where that is right, {write}"
    elif verdict.expected is not None and verdict.outcome is Status.PROVED:
        return
    if not verdict.holds:
        code = _own_rule(verdict)
        if hint := verdict.hint or _SAID_OF_ALL.get(code, "").format(name=verdict.name):
            yield code, hint


def _is_otherwise(verdict: Verdict) -> bool:
    return verdict.expected is not None and verdict.outcome is Status.VIOLATED


def _own_rule(verdict: Verdict) -> str:
    if verdict.code:
        return verdict.code
    if code := _OF_A_RUN.get(verdict.name):
        return code
    if verdict.status is Status.UNKNOWN:
        return _UNDECIDED
    name = verdict.name.removeprefix("loop.")
    return _OF_THE_NET.get(name) or _FAMILIES.get(name.partition(".")[0], _OBLIGATION)
