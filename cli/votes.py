"""Which votes of a split stand, in words: one wording for `firable split`, for `firable prove` and for the page.

No net needs a vote that stands, so they are told apart from the obligations, and never by how many obligations are
proved of them: what is proved of a vote is proved of those alone that arcs and units settle, and beside these are the
units. What is told is of all votes: how many stand, by what, which fall, after which firings, and which nobody asked
about.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from firable.cli.report import Report
    from firable.nets.verdict import Verdict

NAMES_MAX: Final = 10
"""Of how many votes that nobody asked about the names are told."""
FALLEN_MAX: Final = 30
"""Of how many votes that fall it is told what takes them back."""
_FIRINGS_MAX: Final = 4
_PREFIX: Final = "persistent."
_OBLIGATIONS: Final = "persistence.smt2"


@dataclass(frozen=True, slots=True)
class Votes:
    """The verdicts on the votes of a split, and the parts whose votes nobody asked about."""

    verdicts: Sequence[Verdict]
    unasked: Sequence[str]

    @classmethod
    def of(cls, report: Report) -> Votes:
        """Those of a report on a decomposition."""
        verdicts = [verdict for verdict in report.verdicts if is_vote(verdict)]
        if report.decomposition is None:
            return cls(verdicts, ())
        asked = {part_of(verdict) for verdict in verdicts}
        parts = (part.name for row in report.decomposition.coordinated for part in row.parts)
        return cls(verdicts, [part for part in parts if part not in asked])

    @property
    def standing(self) -> Sequence[Verdict]:
        """Those of which no other transition takes the yes back."""
        return [verdict for verdict in self.verdicts if verdict.holds]

    @property
    def others(self) -> Sequence[Verdict]:
        """Those that fall, and those that are not decided."""
        return [verdict for verdict in self.verdicts if not verdict.holds]

    @property
    def head(self) -> str:
        """How many stand, and what shows it; empty without votes."""
        n, stands = len(self.verdicts) + len(self.unasked), len(self.standing)
        if not n:
            return ""
        is_ = "is" if stands == 1 else "are"
        return f"{stands:,} of {n:,} {is_} persistent{self._shown()}: no other transition takes the yes back"

    def _shown(self) -> str:
        """By what it is shown that votes stand."""
        settled = sum(_by_obligations(verdict) for verdict in self.standing)
        ways = ((settled, "by arcs and units"), (len(self.standing) - settled, "by the markings"))
        told = [(n, way) for n, way in ways if n]
        return f", {told[0][1]}" if len(told) == 1 else "".join(f", {n:,} {way}" for n, way in told)

    @property
    def fall(self) -> str:
        """How many fall, and what shows it; empty where none does."""
        fallen = [verdict for verdict in self.others if verdict.status.value == "violated"]
        if not fallen:
            return ""
        n, by_markings = len(fallen), not any(map(_by_obligations, fallen))
        return f"{n:,} {'falls' if n == 1 else 'fall'}{', as the markings show' * by_markings}, and must promise:"

    @property
    def left(self) -> str:
        """Which votes nobody asked about, and who does; empty where there are none."""
        if not self.unasked:
            return ""
        n, more = len(self.unasked), len(self.unasked) - NAMES_MAX
        names = ", ".join(self.unasked[:NAMES_MAX]) + (f" and {more:,} more" if more > 0 else "")
        is_, ask = ("is", "it") if n == 1 else ("are", "them")
        return f"{n:,} {is_} not asked about, for only markings decide {ask}: {names}; --protocol explores {ask}"


def free_told(free: int) -> tuple[str, ...]:
    """How many of the votes that stand are given without a promise, and what that is, folded as for a terminal."""
    if not free:
        return ("none of these may do without the promise, which locks places from the yes to the order",)
    return (
        f"{free:,} of these {'needs' if free == 1 else 'need'} no promise, which locks places from the yes to the "
        "order: their firing takes",
        "back no other yes at their controller, and no command sent meanwhile clears a gate that they read",
    )


def fall_told(verdict: Verdict) -> str:
    """What takes a vote back, and after which firings; or how far was looked.

    >>> from firable.nets.verdict import Status, Verdict, Weight, Witness
    >>> run = Witness((("G1",), ("G2",)))
    >>> fall_told(Verdict("persistent.t1", Status.VIOLATED, "", "", Weight.INFORMATION, subjects=("G2",), witness=run))
    't1: taken back by G2, as after G1, G2'
    """
    more = len(verdict.subjects) - NAMES_MAX
    names = ", ".join(verdict.subjects[:NAMES_MAX]) + (f" and {more:,} more" if more > 0 else "")
    if verdict.status.value == "unknown":
        may = f"; {names} may take it back" if names else ""
        return f"{part_of(verdict)}: not decided ({verdict.bound}){may}"
    if _by_obligations(verdict):
        return f"{part_of(verdict)}: not shown to stand"
    firings = verdict.witness.firings if verdict.witness else ()
    if not firings:  # of a bundle
        return f"{part_of(verdict)}: taken back, as {' and '.join(verdict.evidence) or verdict.method} shows"
    way = ", ".join(name for fired in firings[-_FIRINGS_MAX:] for name in fired)
    return f"{part_of(verdict)}: taken back by {names}, as after {'… ' * (len(firings) > _FIRINGS_MAX)}{way}"


def votes_told(votes: Votes, free: int | None) -> Iterator[str]:
    """The votes as lines; `free` is how many need no promise, where that was asked."""
    if not votes.head:
        return
    yield votes.head
    if free is not None and votes.standing:
        yield from free_told(free)
    if votes.fall:
        yield votes.fall
    for verdict in votes.others[:FALLEN_MAX]:
        yield f"{'?' if verdict.status.value == 'unknown' else '·'} {fall_told(verdict)}"
    if (more := len(votes.others) - FALLEN_MAX) > 0:
        yield f"and {more:,} more that are not; --format json has them all"
    if votes.left:
        yield votes.left


def is_vote(verdict: Verdict) -> bool:
    """Whether a verdict says of a vote whether it stands."""
    return verdict.name.startswith(_PREFIX)


def part_of(verdict: Verdict) -> str:
    """The part whose vote the verdict is on."""
    return verdict.name.removeprefix(_PREFIX)


def _by_obligations(verdict: Verdict) -> bool:
    return _OBLIGATIONS in verdict.evidence or verdict.method.startswith("arcs")
