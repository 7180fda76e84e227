"""What follows from verdicts that are known: deadlock, liveness and reversibility are not independent of each other.

Where no technique holds all markings, the verdicts are found one by one, and mostly it is a deadlock that is found. It
settles more than itself:

| known | so | because |
|---|---|---|
| a deadlock can be reached | the net is not live | nothing can fire again after it |
| | not reversible | unless M0 is the deadlock, nothing leads back from it |
| | some marking is doomed, no transition starves | the deadlock is doomed; starvation is that of live transitions |
| no deadlock can be reached | no marking is doomed | each run from a doomed marking ends in a deadlock |
| a transition is dead | the net is not live | |
| live | each transition can fire, no deadlock, no doomed marking | a deadlock would be followed by nothing |
| reversible | M0 is a home marking | |
| reversible, something fires in M0 | no deadlock | M0 cannot be reached from one |
| reversible, each transition can fire once | live | back to M0, and from there to where it fires |

They hold under either discipline: of its firing rule they use that a run is a path, and that nothing fires in a
deadlock. A conclusion names the method of what it rests on, and a violation shows the same firing sequence.

The rejected alternative, asking a technique for each of these again, costs each time what it cost the first time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.question import Answer, Known, no, yes
from firable.analysis.verdicts.starvation import NONE_STARVES
from firable.nets.net import Net
from firable.nets.verdict import Status, Verdict
from firable.semantics.player import Player

Rule = Callable[["_Known"], Iterator[tuple[str, Answer, str]]]
"""What follows, as (name of the verdict, its answer, name of the verdict that it rests on)."""


def consequences(net: Net, verdicts: Mapping[str, Verdict]) -> dict[str, Known]:
    """What follows from the verdicts on a net, by name, for those names that the verdicts leave undecided.

    >>> from firable.analysis.check import check
    >>> from firable.nets.catalogue import catalogue_net
    >>> net = catalogue_net("one_robot_mc_late")
    >>> found = consequences(net, {"deadlock-free": check(net).verdict("deadlock-free")})
    >>> {name: known.answer.holds for name, known in found.items()}
    {'live': False, 'doomed-markings': False, 'starvation': True, 'reversible': False}
    """
    decided = {name: verdict for name, verdict in verdicts.items() if verdict.status is not Status.UNKNOWN}
    known = _Known(net, {name: (verdict.holds, verdict.method, verdict) for name, verdict in decided.items()})
    found: dict[str, Known] = {}
    again = True
    while again:
        again = False
        for rule in _RULES:
            for name, answer, basis in rule(known):
                if name not in known.of:
                    method = known.of[basis][1]
                    said = method if method.startswith("follows from") else f"follows from {basis}: {method}"
                    known.of[name] = (answer.holds is True, said, known.of[basis][2])
                    found[name] = Known(answer, said)
                    again = True
    return found


@dataclass(frozen=True, slots=True)
class _Known:
    """Of the verdicts that are decided: whether each holds, by which method, and the one with the evidence."""

    net: Net
    of: dict[str, tuple[bool, str, Verdict]]

    def holds(self, name: str) -> bool:
        return name in self.of and self.of[name][0]

    def violated(self, name: str) -> bool:
        return name in self.of and not self.of[name][0]

    @property
    def begins(self) -> bool:
        """Whether something can fire in M0."""
        return not Player(self.net).deadlocked(self.net.initial_marking)


def _deadlock(known: _Known) -> Iterator[tuple[str, Answer, str]]:
    if not known.violated("deadlock-free"):
        return
    into = known.of["deadlock-free"][2].witness

    def shown(note: str, subjects: tuple[str, ...] = ()) -> Answer:
        return no(subjects, None if into is None else replace(into, note=note))

    if known.net.transitions:
        all_of_them = tuple(transition.name for transition in known.net.transitions)
        yield "live", shown("no transition can ever fire after this", all_of_them), "deadlock-free"
    yield "doomed-markings", shown("a deadlock is doomed; the way to it may have been so before"), "deadlock-free"
    yield "starvation", NONE_STARVES, "deadlock-free"
    if known.begins:
        yield "reversible", shown("the initial marking can never be reached again"), "deadlock-free"


def _no_deadlock(known: _Known) -> Iterator[tuple[str, Answer, str]]:
    if known.holds("deadlock-free"):
        yield "doomed-markings", yes(), "deadlock-free"


def _dead(known: _Known) -> Iterator[tuple[str, Answer, str]]:
    if known.violated("quasi-live"):
        yield "live", no(known.of["quasi-live"][2].subjects), "quasi-live"


def _live(known: _Known) -> Iterator[tuple[str, Answer, str]]:
    if known.holds("live"):
        yield "quasi-live", yes(), "live"
        if known.net.transitions:
            yield "deadlock-free", yes(), "live"


def _reversible(known: _Known) -> Iterator[tuple[str, Answer, str]]:
    if known.holds("reversible"):
        yield "home-markings", yes(), "reversible"
        if known.holds("quasi-live"):
            yield "live", yes(), "reversible"
        if known.begins:
            yield "deadlock-free", yes(), "reversible"


_RULES: Final[tuple[Rule, ...]] = (_deadlock, _no_deadlock, _dead, _live, _reversible)
