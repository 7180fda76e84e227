"""What a bundle holds of a cell with its machines: every verdict of each closed loop, with a document that shows it.

There are three loops with a document each: commands sent late, for what votes rely on (O4); machines that do not fail;
and, where the plant file says that some may, one that fails for good. The second shows as well that no accident follows
from a fault, and what follows from one that is repaired (`firable.nets.machines.slower`). A verdict is sealed as what
the document shows of it: its status, and of which transitions or places it is violated. How it was found, the run and
the hint stay behind, since the document holds the run of each violation; but a verdict that must hold and does not is
left as it is, because of it no bundle is made.

What `firable check --machines` tells in one verdict, what stands still after a fault and which places hang, are two
here, as they were asked. Properties that are not asked of a loop (a deadlock, where a sensor never rests) have none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from threading import Event
from typing import Final

from firable.analysis.check import AGAIN
from firable.analysis.evidence.document import Record
from firable.analysis.goal import Limits
from firable.analysis.loop.families import Answered, Family
from firable.analysis.loop.faults import ask_faults
from firable.analysis.loop.verdicts import LIVE, ask_loop, without
from firable.analysis.spaces.reachability import Budget
from firable.decompose.proofs.held_gates import EVIDENCE, held_gates
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import UncomparedError
from firable.decompose.verification.same_loop import compare
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.machines.closing import close
from firable.nets.machines.loop import Faults, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.verdict import Status, Verdict, Weight

PREFIXES: Final = ("o4.", "loop.", "fault.")
PLANT: Final = "plant.yaml"
LOOP: Final = "loop.evidence.json"
FAILING: Final = "loop.failing.evidence.json"
UNDECIDED: Final = "not decided within the limits"


def sealed_loops(
    decomposition: Decomposition, plant: str, limits: Callable[[], Limits]
) -> tuple[tuple[Verdict, ...], dict[str, str], dict[str, str]]:
    """The verdicts on a net with the machines of a plant file, given as its text, and the files that they name.

    `limits` are those of each document, and of what is asked for information alone. A verdict of which a part is not
    shown names no evidence, and the third that is returned tells by its name why. One Ctrl-C ends the questions to all
    loops. Raises `InputError` as `close` does, and as `check` does, and F4003 where a loop could not be held against
    the plant file again.
    """
    net, model = decomposition.net, parse_plant(plant)
    _see_compared(net, model)
    sealing, interrupted = _Sealing(plant, limits), Event()
    held = held_gates(decomposition, model, interrupted=interrupted)
    sealing.add(EVIDENCE, held.asked, held.verdicts)
    loop = ask_loop(net, model, interrupted=interrupted)
    lost = sealing.add(LOOP, loop, loop.verdicts)[LIVE]
    # A fault takes nothing of what is not live without it: but only of what is shown not to be.
    # And what comes to stand still then is for information: what takes longer to find than evidence may, has none.
    within = Budget(seconds=limits().deadline.left_seconds)
    faults = ask_faults(loop, model, within, without(loop, lost), interrupted=interrupted)
    if faults.for_good is not None:
        sealing.add(FAILING, faults.for_good, faults.for_good.verdicts)
    if faults.following is not None:
        sealing.tell(LOOP, faults.following, faults.following.verdicts)
    return tuple(sealing.verdicts), sealing.files, sealing.lacking


def _see_compared(net: Net, model: PlantModel) -> None:
    """See, before anything is explored, that who checks the bundle can hold each loop against the plant file.

    Raises `InputError` F4003 where one is too large for that.
    """
    for sending, faults in ((Sending.LATE, Faults.NONE), *((Sending.AT_ONCE, faults) for faults in Faults)):
        loop, plant = close(net, model, faults, sending), Plant(net, model, sending, faults)
        if faults is not Faults.NONE and not plant.may_fail:
            continue  # the loop without faults
        try:
            compare(plant, loop)
        except UncomparedError as error:
            message = f"nobody could see again whether the loop is what the plant file says: {error}"
            hint = "do less in one firing: send the commands one after the other, in transitions of their own"
            raise InputError([Diagnostic("F4003", message, hint, ("transitions", error.happening))]) from None


class _Sealing:
    """What a bundle comes to hold of the loops."""

    def __init__(self, plant: str, limits: Callable[[], Limits]) -> None:
        self.limits = limits
        self.method = f"closed loop with the machines of the plant {sha256(plant.encode()).hexdigest()}"
        self.verdicts: list[Verdict] = []
        self.files = {PLANT: plant}
        self.records: dict[str, dict[str, Record]] = {}
        """For each document, its records by their names."""
        self.lacking: dict[str, str] = {}

    def add(self, file: str, asked: Answered, told: Sequence[Verdict]) -> dict[str, list[str]]:
        """Add the document on a loop, and its verdicts; for each of what its violation is shown."""
        document = asked.document(self.limits())
        self.files[file] = document.to_text()
        self.records[file] = {record.name: record for record in document.records}
        self.tell(file, asked, told)
        return {family.name: _shown_to_fail(family, self.records[file]) for family in asked.families}

    def tell(self, file: str, asked: Answered, told: Sequence[Verdict]) -> None:
        """Add verdicts that a document shows which was added before."""
        records = self.records[file]
        for family, verdict in zip(asked.families, told, strict=True):
            unproved = verdict.weight is Weight.REQUIRED and not verdict.holds
            self.verdicts.append(verdict if unproved else _as_shown(family, records, file, self.method, verdict.hint))
            of = filter(None, (records.get(f"property.{prop.name}") for prop in family.of.values()))
            if why := next((record.lacking for record in of if record.lacking), ""):
                self.lacking[family.name] = why


def _shown_to_fail(family: Family, records: Mapping[str, Record]) -> list[str]:
    """Of what a family is about, that of which the document shows a violation."""
    of = ((of, records.get(f"property.{prop.name}")) for of, prop in family.of.items())
    return [one for one, record in of if record is not None and not record.proved and not record.lacking]


def _as_shown(family: Family, records: Mapping[str, Record], file: str, method: str, hint: str) -> Verdict:
    """The verdict on a family as the records on its properties show it; of its hint stays that Ctrl-C left it open."""
    decided = {of: records[f"property.{p.name}"] for of, p in family.of.items() if f"property.{p.name}" in records}
    violated = [of for of, record in decided.items() if not record.proved]
    whole = Status.PROVED if len(decided) == len(family.of) else Status.UNKNOWN
    status = Status.VIOLATED if violated else whole
    shown = status is not Status.UNKNOWN and not any(record.lacking for record in decided.values())
    return Verdict(
        family.name,
        status,
        family.statement,
        method,
        family.weight,
        hint=AGAIN if status is Status.UNKNOWN and hint == AGAIN else "",
        bound=UNDECIDED if status is Status.UNKNOWN else "",
        subjects=tuple(of for of in violated if of),
        evidence=(file, PLANT) if shown else (),
        discipline="interleaving",
    )
