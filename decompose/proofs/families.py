"""The table of the families of obligations, in the order in which they are proved and reported.

To add a static one: its file, a function from `Sides` to obligations, and a row here. To add one that proves otherwise:
its row names a function from `Task` to `Proved`, with the files that its verdicts name as evidence. Either way what a
net requires of it goes into `firable.nets.right_to_run`, and what a bundle must then hold into the verifier.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from firable.decompose.proofs.arbitration import arbitration
from firable.decompose.proofs.commands import commands
from firable.decompose.proofs.deciders import deciders
from firable.decompose.proofs.discharging import static
from firable.decompose.proofs.family import Family, Kind, Proved, Task
from firable.decompose.proofs.firability import firability
from firable.decompose.proofs.initial_marking import initial_marking
from firable.decompose.proofs.layers import apart, layers
from firable.decompose.proofs.next_tokens import next_tokens
from firable.decompose.proofs.obligation import Obligation
from firable.decompose.proofs.openness import openness
from firable.decompose.proofs.ownership import ownership
from firable.decompose.proofs.persistent import persistent
from firable.decompose.proofs.reading import reading
from firable.decompose.proofs.sides import Sides
from firable.decompose.protocol.parametric.proving import FILE, theorem
from firable.decompose.protocol.parametric.side_conditions import side_conditions


def _static(
    name: str, title: str, says: str, obligations: Callable[[Sides], Iterator[Obligation]], *serves: str
) -> Family:
    return Family(name, title, says, static(name, says, obligations), serves)


def protocol(task: Task) -> Proved:
    """The theorem on the protocol, which is the same for every net.

    What it assumes of a decomposition, `SIDE_CONDITIONS` compare; a bundle needs no verdicts on them, since families
    above prove the same, each with its file: ownership, O3, Eq. (7)-(10), M0, commands, and
    of arbitration that no row is there twice.
    """
    verdicts, text = theorem(task.timeout_ms)
    return Proved(verdicts, {FILE: text})


SIDE: Final = "protocol.side"

_RUNS: Final = "whatever is lost or crashes, what runs is a run of the net"

PERSISTENCE: Final = replace(
    _static("persistence", "persistence", "a yes once given stays until its transition fires", persistent),
    words=("persistent", "unit"),
)
"""The votes that arcs and units settle. No net needs one that stands, and markings decide others."""

FAMILIES: Final[tuple[Family, ...]] = (
    _static("eq7", "Eq. (7)", "a transition is firable iff all its parts are", firability),
    _static("eq8", "Eq. (8)", "its external gates are open iff those of all its parts are", openness),
    _static("eq9-10", "Eq. (9)-(10)", "the next token of a place is the same in its subnet", next_tokens),
    _static("o2", "O2", "transitions that compete have one decider", deciders, "O2"),
    _static("o3", "O3", "what a transition touches is touched by its owner's part alone", reading, "O3"),
    _static("ownership", "ownership", "each place and signal is owned once, by its owner", ownership, "O3"),
    _static("initial-marking", "M0", "the initial markings of the subnets together are M0", initial_marking),
    _static("commands", "commands", "the subnets send the commands of the net, on the same places", commands),
    _static("o8", "O8", "votes add up layer by layer, and competitors meet in one coordinator", layers, "O8"),
    _static(
        "o8-apart", "O8 promises", "no coordinator's promise stands in the way of another coordinator", apart, "O8"
    ),
    _static("arbitration", "arbitration", "conflicts are decided as in the central net", arbitration, "O2"),
    PERSISTENCE,
    Family(
        "protocol",
        "protocol",
        _RUNS,
        protocol,
        ("O1", "O5"),
        Kind.PROTOCOL,
        SIDE,
    ),
)
"""Every family, in the order of a report."""

SIDE_CONDITIONS: Final = Family(
    SIDE,
    "side conditions",
    "what that assumes of this split, as do ownership, O3, Eq. (7)-(10), M0, commands, arbitration",
    lambda task: Proved(side_conditions(task.decomposition)),
)
"""What connects the theorem on the protocol with one decomposition: told of it, and nothing that a bundle holds."""

REPORTED: Final = (*(family for family in FAMILIES if family is not PERSISTENCE), SIDE_CONDITIONS)
"""Every family that a report on a decomposition counts; it tells of all votes together, whatever decided them."""
