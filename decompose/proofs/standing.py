"""Where each of O1-O9 stands: proved statically, by the protocol proof, or assumed.

SEMANTICS lists nine obligations by which the distributed system does what the central net does. Eq. (7)-(10) are
identities of one instant and say nothing about most of them. So a report that lists only what was proved would hide
what was not; here every one of the nine has a line, whether a family proves it or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from firable.decompose.proofs.assumptions import assumptions
from firable.decompose.proofs.families import FAMILIES, SIDE_CONDITIONS
from firable.decompose.proofs.family import Kind, proved_of
from firable.nets.decomposition import Decomposition
from firable.nets.right_to_run import required_verdicts
from firable.nets.verdict import Status, Verdict, overall

SAYS: Final = {
    "O1": "a yes vote is a promise: nothing that it rests on changes until commit or abort",
    "O2": "transitions that compete have one decider, the coordinator where a global one is among them",
    "O3": "a gate source elsewhere makes its owner a participant; nothing is read from a copy",
    "O4": "an external gate that a vote saw open stays open until the transition fires",
    "O5": "orders carry a round, are applied once, repeated until acknowledged, all or nothing",
    "O6": "votes and decisions are in stable storage, and a promise outlasts a crash",
    "O7": "commands go to machines only after the local apply",
    "O8": "each coordinator decides what those below it take part in, and what competes meets in one",
    "O9": "synchronous steps are equal only in lock-step rounds",
}
"""What each obligation says, in a line."""

OTHERWISE: Final = {
    "O1": ("assumed", "of the protocol"),
    "O4": ("assumed", "of the cell; completion signals are levels, which their command clears"),
    "O5": ("assumed", "of the protocol"),
    "O6": ("assumed", "of the hosts and their storage"),
    "O7": ("assumed", "of the executor, which sends a command in the act of applying"),
    "O8": ("nothing to show", "there is one layer: no coordinator is under another one"),
    "O9": ("not claimed", "what is proved is the equivalence of interleaving"),
}
"""The status of an obligation that no family proves, and of whom it is assumed."""


ASSUMED_BY_THE_PROTOCOL: Final = frozenset(
    ("ownership", "o3", "eq7", "eq8", "eq9-10", "initial-marking", "commands", "arbitration"),
)
"""The families that prove of a split what the protocol proof assumes of it; the last: no row is there twice."""


@dataclass(frozen=True, slots=True)
class Standing:
    """Where one obligation stands: its status, and the families that show it or what is assumed."""

    name: str
    says: str
    status: str
    by: str


def standing(decomposition: Decomposition, given: Sequence[Verdict]) -> Iterator[Standing]:
    """The line of each of O1-O9, for the verdicts on a decomposition."""
    for name, says in SAYS.items():
        families = [family for family in FAMILIES if name in family.serves and proved_of(family, given)]
        if name == "O4" and (held := [verdict for verdict in given if verdict.name.startswith("o4.")]):
            shown = overall(held)
            status = "shown in the loop" if shown is Status.PROVED else shown.value
            yield Standing(name, says, status, "with the machines that were given")
            continue
        if not families:
            status, by = OTHERWISE.get(name, ("unknown", "no verdict is on it"))
            yield Standing(name, says, status, by + _listed(name, decomposition))
            continue
        found = overall(verdict for family in families for verdict in proved_of(family, given))
        kinds = list(dict.fromkeys(family.kind.value for family in families))
        by = ", ".join(family.title for family in families)
        if any(family.kind is Kind.PROTOCOL for family in families) and (
            doubted := list(_doubted(decomposition, given))
        ):
            found = found if found is Status.VIOLATED else Status.UNKNOWN
            by += f", which assumes of the split what is not proved here: {', '.join(doubted)}"
        yield Standing(name, says, " and ".join(kinds) if found is Status.PROVED else found.value, by)


def _doubted(decomposition: Decomposition, given: Sequence[Verdict]) -> Iterator[str]:
    """The titles of the families that stand in for what the protocol proof assumes, as far as they are not proved."""
    held = {verdict.name for verdict in given} - {verdict.name for verdict in given if not verdict.holds}
    demanded = [name for name in required_verdicts(decomposition) if name not in held]
    for family in FAMILIES:
        if family.name in ASSUMED_BY_THE_PROTOCOL and any(name.partition(".")[0] == family.name for name in demanded):
            yield family.title
    if not all(verdict.holds for verdict in proved_of(SIDE_CONDITIONS, given)):
        yield SIDE_CONDITIONS.title


def _listed(name: str, decomposition: Decomposition) -> str:
    if name != "O4" or not (n := len(assumptions(decomposition))):
        return ""
    return f"; and {n} more, each of them listed" if n > 1 else "; and one more, which is listed"
