"""What one fault does: a line for each kind, which says what becomes of it and the verdicts that show it.

The verdicts on faults (`outages`) are on any number of faults of every kind at once, which is more than what is asked
of them: what does one lost message do, one crash, one dead controller. One fault of one kind is a case of that, so
nothing is proved here. A finding on a kind of fault has the worst status of the verdicts that it rests on, and one
that rests on a verdict which is not there is not known: nothing is said to be proved by its kind.

Which verdicts these are is read off what each family allows (`shown.FAMILIES`). A message that is late or overtakes
another is no fault of its own: every run that is explored has such messages, those without faults too. What is down
keeps back no more than what is dead, for until it restarts it does the same; who is dead is one that has crashed and
never restarts, so that all verdicts on safety, in which nobody has to restart, are of it too.

The alternative, an exploration for each kind of fault by itself, has larger diagrams and weaker answers
(docs/protocol.md, "Faults").
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.bereft import deaths, verdict_name
from firable.decompose.protocol.building import AGREES, FIT, FOLLOWS
from firable.decompose.protocol.parts import Parts
from firable.decompose.protocol.shown import FAMILIES
from firable.decompose.protocol.variant import PROTOCOL
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict

LEAD: Final = (
    "The verdicts are on any number of faults of every kind, in any run; one fault is a case of that. Messages that "
    "are late or overtake each other are in all runs, also in those without faults."
)

MESSAGES: Final = {
    "loss": (
        "a message is lost",
        "its round, until it is sent again, with what competes or would disturb a promise to it",
    ),
    "duplication": (
        "a message comes twice",
        "nobody: the second is what repeating sends anyway, or one of a round that is over, and ignored",
    ),
    "": (
        "a message is late, or overtakes another",
        "its round, until it comes, with what competes or would disturb a promise to it",
    ),
}
CRASHES: Final = {"crash": "a controller crashes, and restarts", "coordinator": "a coordinator crashes, and restarts"}
DEATHS: Final = {"crash": "a controller is dead", "coordinator": "a coordinator is dead"}

LACKING_MAX: Final = 4
"""Of how many verdicts that are not proved it is said why; the others are counted."""
TITLES: Final = ("blocked safely", "stands still", "resumes")
"""What is said of each fault, in this order."""
_SAFE: Final = "nothing fires that the central net could not fire"
_RESUMES: Final = "when faults have ceased, whatever the central net may fire next can fire next"
_COMES: Final = "whatever the central net may fire next, the protocol can still fire next"
_WHILE_DOWN: Final = "until the restart, no more than what may stand still while it is dead, told below"
_WHILE_DEAD: Final = "for ever, no more than what may stand still while it is dead, told below; every other goes on"
_NEVER: Final = "nothing of what stands still, since it never restarts"


@dataclass(frozen=True, slots=True)
class Finding:
    """What is said of a fault: by these verdicts, with their worst status; without one where nothing is claimed.

    `lacking` says of which of the verdicts it is not proved, and why.
    """

    says: str
    status: Status | None = None
    by: tuple[str, ...] = ()
    lacking: str = ""


@dataclass(frozen=True, slots=True)
class OneFault:
    """A kind of fault, as the steps of the protocol's net name it (none for a late message), and what becomes of it.

    The findings are those of `TITLES`.
    """

    kind: str
    fault: str
    findings: tuple[Finding, Finding, Finding]


def single_faults(decomposition: Decomposition, verdicts: Iterable[Verdict]) -> tuple[OneFault, ...]:
    """What one fault of each kind does, by these verdicts on the protocol of a decomposition."""
    return tuple(_Findings(decomposition, {verdict.name: verdict for verdict in verdicts}).told())


@dataclass(frozen=True)
class _Findings:
    decomposition: Decomposition
    verdicts: Mapping[str, Verdict]

    def told(self) -> Iterator[OneFault]:
        parts = Parts(self.decomposition, PROTOCOL)
        dead: dict[str, list[str]] = {kind: [] for kind in CRASHES}
        for one in deaths(parts):
            dead["crash" if one.who else "coordinator"].append(verdict_name(one.who, one.coordinator))
        safe = (FOLLOWS, AGREES, FIT) if parts.coordinated else (FOLLOWS, AGREES)
        for kind, (fault, waits) in MESSAGES.items() if parts.coordinated else ():
            resumes = self.by(kind, _RESUMES, ["resumes"]) if kind else self.by(kind, _COMES, ["complete"])
            yield OneFault(kind, fault, (self.by(kind, _SAFE, safe), Finding(waits), resumes))
        for kind, fault in CRASHES.items():
            if dead[kind]:
                down = self.by(kind, _WHILE_DOWN, dead[kind])
                yield OneFault(kind, fault, (self.by(kind, _SAFE, safe), down, self.by(kind, _RESUMES, ["resumes"])))
        for kind, fault in DEATHS.items():
            if dead[kind]:
                still = self.by(kind, _WHILE_DEAD, dead[kind])
                yield OneFault(kind, fault, (self.by(kind, _SAFE, safe), still, Finding(_NEVER)))

    def by(self, kind: str, says: str, some: Sequence[str]) -> Finding:
        """The finding that these verdicts show, of the family in which such a fault happens; its worst status."""
        family = next(of for of, faults in FAMILIES.items() if not kind or getattr(faults, kind))
        names = tuple(f"{family}.{name}" for name in some)
        found = {name: self.verdicts.get(name) for name in names}
        statuses = {Status.UNKNOWN if verdict is None else verdict.status for verdict in found.values()}
        worst = next((one for one in (Status.VIOLATED, Status.UNKNOWN) if one in statuses), Status.PROVED)
        lacking = [
            f"{name} is {'not there' if of is None else of.status.value}{f' ({of.bound})' if of and of.bound else ''}"
            for name, of in found.items()
            if of is None or not of.holds
        ]
        more = [f"and {len(lacking) - LACKING_MAX:,} more"] if len(lacking) > LACKING_MAX else []
        return Finding(says, worst, names, "; ".join([*lacking[:LACKING_MAX], *more]))
