"""What a firing asks of the places and what it leaves in them, as literals: the arcs and gates follow from these.

A firing of the loop is many things at once: the cell's own transition, each command that it sends, each completion
that is cleared, what a machine takes at once, a sensor that sees it. Each of them says what it *wants* of some places
before and what it *leaves* there. One after the other they are put together: what comes later wants it of what earlier
ones have left, and where that contradicts, this combination cannot happen. In the end a place that was wanted 1 and is
left 0 is an input, 0 and 1 an output, 1 and 1 a permissive gate, 0 and 0 an inhibitive gate: the four arcs of the
extended net are exactly these four pairs, and a self-loop cannot arise.

Rejected: putting arcs together as sets of names, where two parts that each read and write one place (a STOP and a RUN
to the same machine in one firing) give a double arc or a transition that never fires.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from firable.nets.net import Transition
from firable.nets.well_formed import as_name

Literal = tuple[str, bool]
"""A place, and whether it holds a token."""


@dataclass(frozen=True, slots=True)
class Case:
    """One way in which something can go: what it wants, what it leaves, and a word to tell it from the others."""

    wants: tuple[Literal, ...] = ()
    leaves: tuple[Literal, ...] = ()
    tag: str = ""
    says: str = ""

    def with_(self, other: Case) -> Case:
        """This case and one of other places, as one; raises `ValueError` where a place is wanted by both."""
        if not {place for place, _ in self.wants}.isdisjoint(place for place, _ in other.wants):
            raise ValueError("two cases that are put together want something of one place")
        tag, says = "/".join(filter(None, (self.tag, other.tag))), "; ".join(filter(None, (self.says, other.says)))
        return Case((*self.wants, *other.wants), (*self.leaves, *other.leaves), tag, says)


@dataclass(frozen=True, slots=True)
class Moment:
    """A firing so far: what is wanted of places before it, and what is known of them after it."""

    before: Mapping[str, bool]
    after: Mapping[str, bool]
    tags: tuple[str, ...] = ()
    says: tuple[str, ...] = ()

    def then(self, case: Case) -> Moment | None:
        """The firing with one thing more; None where that contradicts what is known.

        >>> stop = NOTHING.then(Case((("busy", True),), (("busy", False),)))
        >>> stop.then(Case((("busy", True),))) is None
        True
        """
        before, after = dict(self.before), dict(self.after)
        for place, value in case.wants:
            if place not in after:
                before[place] = after[place] = value
            elif after[place] != value:
                return None
        for place, value in case.leaves:
            if place not in after:
                raise ValueError(f"'{place}' is left {value}, and was not wanted to be anything")
            after[place] = value
        tags = (*self.tags, case.tag) if case.tag else self.tags
        return Moment(before, after, tags, (*self.says, case.says) if case.says else self.says)

    def name(self, begins: str) -> str:
        """A name that begins so, and ends with the words that tell this firing from the others."""
        return "/".join((begins, *map(as_name, self.tags)))

    def transition(self, name: str, description: str) -> Transition:
        """The transition that this firing is."""
        arcs: dict[tuple[bool, bool], list[str]] = {}
        for place, value in self.before.items():
            arcs.setdefault((value, self.after[place]), []).append(place)
        return Transition(
            name,
            inputs=tuple(arcs.get((True, False), ())),
            outputs=tuple(arcs.get((False, True), ())),
            permissive=tuple(arcs.get((True, True), ())),
            inhibitive=tuple(arcs.get((False, False), ())),
            description=description,
        )


NOTHING: Final = Moment({}, {})
"""The firing that wants nothing and does nothing."""


def each(moments: Iterable[Moment], cases: Iterable[Case]) -> list[Moment]:
    """Every firing with every case that does not contradict it."""
    cases = tuple(cases)
    return [moment for one in moments for case in cases if (moment := one.then(case)) is not None]
