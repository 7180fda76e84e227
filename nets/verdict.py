"""Verdicts: what is known about a property of a net, and what it rests on.

A verdict is PROVED, VIOLATED or UNKNOWN, never a Boolean, so that "not decided" cannot be mistaken for either answer;
it says by which method, at which cost, and carries its evidence: a firing sequence that the reference player replays,
or the names of the files an independent checker reads. The record lies in this lowest room because `analysis` and
`decompose` write it, bundles carry it, and the executor reads it without importing either.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from decimal import Decimal
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

from firable.nets.source import one_line, quoted

if TYPE_CHECKING:
    from firable.nets.changes import Change

NOTHING: Final = "nothing"
"""The method of what nothing has shown."""
TOKENS_MAX: Final = 200
"""Of a marking with more tokens a witness may tell none: thousands of runs of a large net would fill a report."""


class Status(StrEnum):
    """How a property ended."""

    PROVED = "proved"
    VIOLATED = "violated"
    UNKNOWN = "unknown"


class Weight(StrEnum):
    """What a verdict other than PROVED means for the whole: it fails it, warns, or only informs."""

    REQUIRED = "required"
    WARNING = "warning"
    INFORMATION = "information"


@dataclass(frozen=True, slots=True)
class Wait:
    """A token that waits in a deadlock: `transition` would take it from `place`, and lacks something of another place.

    It lacks a token on `lacks` where one is `wanted`, or else finds one there. `holder` is the place whose token would
    change that, by the transitions `by` in their order.
    """

    place: str
    transition: str
    lacks: str
    wanted: bool
    holder: str
    by: tuple[str, ...] = ()

    def told(self, description: str = "") -> str:
        """The wait as a sentence, with what its place is described as.

        >>> Wait("hand.full", "put", "table.free", True, "table.taken", ("clear",)).told("hand with a part")
        'hand.full (hand with a part) waits in put for table.free, which comes from table.taken by clear'
        """
        what = f"{self.lacks}, which comes from {self.holder} by" if self.wanted else f"{self.lacks} to be emptied by"
        place = f"{self.place} ({one_line(description)})" if description else self.place
        return f"{place} waits in {self.transition} for {what} {' and '.join(self.by)}"

    def to_json(self) -> dict[str, Any]:
        """The wait as JSON data."""
        return {
            "place": self.place,
            "transition": self.transition,
            "lacks": self.lacks,
            "wanted": self.wanted,
            "holder": self.holder,
            "by": list(self.by),
        }


@dataclass(frozen=True, slots=True)
class Cure:
    """A change of the net after which a violated verdict is proved, as checking the changed net has shown.

    `changes` say what to write, a sentence each; `proves` names the verdicts that come out well besides, and `loses`
    those that do no longer; `markings` is how many the changed net has. `parts` are the changes themselves, for who
    makes them: known where the cure was found, and not where it was read from a file, which tells them in words alone.
    """

    changes: tuple[str, ...]
    proves: tuple[str, ...]
    loses: tuple[str, ...]
    markings: int
    parts: tuple[Change, ...] = field(default=(), compare=False)

    def to_json(self) -> dict[str, Any]:
        """The cure as JSON data."""
        return {
            "changes": list(self.changes),
            "proves": list(self.proves),
            "loses": list(self.loses),
            "markings": self.markings,
        }


@dataclass(frozen=True, slots=True)
class Witness:
    """A firing sequence from M0: each element is the set of transitions fired together.

    A `cycle` that is not empty is fired for ever after the sequence. `marking` holds the places with a token where the
    sequence (not the cycle) ends; it may be empty where these are more than `TOKENS_MAX`. `assignment` is a witness of
    another kind: values of the net's own names at one instant that refute an obligation.
    """

    firings: tuple[tuple[str, ...], ...] = ()
    cycle: tuple[tuple[str, ...], ...] = ()
    marking: tuple[str, ...] = ()
    assignment: tuple[tuple[str, bool], ...] = ()
    note: str = ""
    waits: tuple[Wait, ...] = ()


@dataclass(frozen=True, slots=True)
class Cost:
    """What a verdict took; `seconds` is measured, so it is neither compared nor bundled."""

    markings: int | None = None
    edges: int | None = None
    seconds: float | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on the property `name`, which says `statement`.

    `discipline` says how transitions fire, where the verdict depends on it: `interleaving` or `step`. `bound` says how
    far an UNKNOWN was looked at. `subjects` are the transitions or places concerned. `evidence` names
    the files that an independent checker reads. `expected` is how the net file says that it ends. `cures` are changes
    of the net that make a violated one proved, the best first.
    """

    name: str
    status: Status
    statement: str
    method: str
    weight: Weight = Weight.REQUIRED
    code: str = ""
    hint: str = ""
    bound: str = ""
    subjects: tuple[str, ...] = ()
    witness: Witness | None = None
    evidence: tuple[str, ...] = ()
    cost: Cost = Cost()
    discipline: str = ""
    expected: Status | None = None
    cures: tuple[Cure, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether the property is proved."""
        return self.status is Status.PROVED

    @property
    def matters(self) -> bool:
        """Whether this verdict can fail the whole: it must hold, or the file says how it ends."""
        return self.weight is Weight.REQUIRED or self.expected is not None

    @property
    def told_as(self) -> Weight:
        """The weight under which it is told: what the file says the end of has to end so."""
        return self.weight if self.expected is None else Weight.REQUIRED

    @property
    def outcome(self) -> Status:
        """What the verdict means for the whole: where the file expects one, whether it ended so."""
        if self.expected is None or self.status is Status.UNKNOWN:
            return self.status
        return Status.PROVED if self.status is self.expected else Status.VIOLATED

    def _repr_html_(self) -> str:
        from firable.nets.notebook import verdict_html

        return verdict_html(self)

    def to_json(self) -> dict[str, Any]:
        """The verdict as JSON data, without measured times; what is empty is left out."""
        data: dict[str, Any] = {
            "name": self.name,
            "status": self.status.value,
            "statement": self.statement,
            "method": self.method,
            "weight": self.weight.value,
        }
        for key in ("discipline", "code", "hint", "bound"):
            if getattr(self, key):
                data[key] = getattr(self, key)
        for key in ("subjects", "evidence"):
            if getattr(self, key):
                data[key] = list(getattr(self, key))
        if self.witness is not None:
            data["witness"] = {
                "firings": [list(fired) for fired in self.witness.firings],
                "cycle": [list(fired) for fired in self.witness.cycle],
                "marking": list(self.witness.marking),
                "assignment": [[name, value] for name, value in self.witness.assignment],
                "note": self.witness.note,
            }
            if self.witness.waits:
                data["witness"]["waits"] = [wait.to_json() for wait in self.witness.waits]
        if self.cures:
            data["cures"] = [cure.to_json() for cure in self.cures]
        if self.expected is not None:
            data["expected"] = self.expected.value
        for key in ("markings", "edges"):
            if getattr(self.cost, key) is not None:
                data[key] = getattr(self.cost, key)
        return data


@dataclass(frozen=True, slots=True)
class Expectation:
    """How a net file says that one of the verdicts of `firable check` ends: proved or violated, and no change of it."""

    verdict: str
    status: Status


def held_to(expected: Iterable[Expectation], verdicts: Iterable[Verdict]) -> tuple[Verdict, ...]:
    """The verdicts, each with how the net file expects it to end.

    Raises `InputError` F2030 for an expectation of a verdict that is none of them. Those of a cell with its machines
    (`loop.*`, `fault.*`) and those of the net alone are never among each other, and wait for one another.
    """
    from firable.nets.diagnostics import Diagnostic, InputError, did_you_mean

    given = tuple(verdicts)
    known = {verdict.name for verdict in given}
    by_name = {one.verdict: one.status for one in expected}
    with_machines = any(map(_of_machines, known))
    unknown = [name for name in by_name if name not in known and _of_machines(name) is with_machines]
    if unknown:
        raise InputError(
            Diagnostic(
                "F2030",
                f"`expect` names the verdict {quoted(name)}, which is none of this net",
                did_you_mean(name, sorted(known)) + "write the name as `firable check` prints it",
                ("expect", name),
            )
            for name in unknown
        )
    return tuple(replace(verdict, expected=by_name.get(verdict.name)) for verdict in given)


def _of_machines(name: str) -> bool:
    return name.startswith(("loop.", "fault."))


def spelled(count: int) -> str:
    """A number of markings for a person: all its digits, or the first four where nobody would read them.

    >>> spelled(1_331_714), spelled(2**200)
    ('1,331,714', '1.607e+60')
    """
    return f"{count:,}" if count < 10**15 else f"{Decimal(count):.3e}"


def counted(n: int, word: str) -> str:
    """A number with its noun.

    >>> counted(1, "place"), counted(1200, "marking")
    ('1 place', '1,200 markings')
    """
    return f"{spelled(n)} {word}{'' if n == 1 else 's'}"


def overall(verdicts: Iterable[Verdict]) -> Status:
    """The outcome of all verdicts that matter together: unknown never passes, and a violation outweighs it.

    Expectations are taken into account: PROVED also says that what is violated is so as the net file expects.
    """
    statuses = {verdict.outcome for verdict in verdicts if verdict.matters}
    if Status.VIOLATED in statuses:
        return Status.VIOLATED
    return Status.UNKNOWN if Status.UNKNOWN in statuses else Status.PROVED
