"""The verdicts on a cell with its machines: each loop is closed anew, and its document must show what is asked of it.

A bundle that has them holds the plant file itself, and each verdict names the SHA-256 of it. There are three loops with
a document each: of commands sent late, what votes rely on (O4); of machines that do not fail, `loop.*`; of machines of
which one fails for good, what comes to stand still then. That a fault is safe, and what comes of one that is repaired,
follows from the second, once the loops of such machines are seen to be those of machines that take longer
(`firable.nets.machines.slower`). What is asked is stated anew, of O4 here: of each gate
that a vote relies on, whether a marking of the loop can be reached in which the part could vote, its places as Eq. (1)
wants them and the gate open, and a move may close the gate; of the others in `loop_questions`. That a document shows
this of the loop is checked as of any net.

The net of each loop is made by the same text as in the prover, `firable.nets.machines`, and then held against a second
reading of the plant file that shares nothing with it (`same_loop`), in every state. That the plant is like the real
machines nobody can show; it is assumed instead of O4.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Final, NamedTuple

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.documents import ShownRecord, checked_document
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.loop_questions import Asked, Question
from firable.decompose.verification.plant import DiffersError, UncomparedError
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.same_loop import compare
from firable.decompose.verification.solvers import Answers
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Firable, Formula, Holds, Not, Or
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ACCIDENT, OVERRUN, ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.machines.slower import difference
from firable.nets.net import ExternalGate, Net, Property, PropertyKind, SignalKind
from firable.nets.verdict import Status, Verdict

PREFIXES: Final = ("o4.", "loop.", "fault.")
PLANT: Final = "plant.yaml"
METHOD: Final = "closed loop with the machines of the plant"
O4: Final = "o4.evidence.json"
LOOP: Final = "loop.evidence.json"
FAILING: Final = "loop.failing.evidence.json"
TITLES: Final = {
    "o4": "the machines of the plant keep each gate that a vote relies on (O4)",
    "loop": "what the cell does with its machines, as the plant file says they go",
    "fault": "what it leads to that one of them fails",
}
"""What the verdicts of each prefix show, in a line."""
UNDECIDED: Final = "not decided within the limits"

_ENDED: Final = Or((Holds(ACCIDENT), Holds(OVERRUN)))
_COMPLETIONS: Final = "a completion that a coordinated transition waits for stays from the vote until it fires"
_COMMANDS: Final = "no machine is given what it cannot do, however late its controller sends the command"


def check_machines(examination: Examination, cut: Cut, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on a cell with its machines, if there are any; raises `NotShownError` where one is not shown.

    Whoever speaks of the machines at all must say everything: O4, the loop, and each fault that the plant declares.
    """
    if not any(verdict.name.startswith(PREFIXES) for verdict in examination.bundle.verdicts):
        return
    text = examination.text(PLANT)
    try:
        model = parse_plant(text, PLANT)
    except InputError as error:
        raise _closes_nothing(error) from None
    judging = _Judging(examination, cut, model, f"{METHOD} {sha256(text.encode()).hexdigest()}", answers, timeout_ms)
    late, well = (judging.closed(sending, Faults.NONE) for sending in (Sending.LATE, Sending.AT_ONCE))
    judging.judge(O4, late, _asked(cut, late.loop))
    shown, lost = judging.judge(LOOP, well, well.asked.of_the_loop())
    if not Plant(cut.net, model, faults=Faults.FOR_GOOD).may_fail:
        return
    failing, repaired = (judging.closed(Sending.AT_ONCE, faults) for faults in (Faults.FOR_GOOD, Faults.REPAIRED))
    for one in (failing, repaired):
        if told := difference(well.loop.net, one.loop, repaired=one is repaired):
            raise NotShownError(f"a machine that fails is not one that takes longer: {told}", "evidence", PLANT)
    judging.judge_one(well.asked.of_any_fault(), LOOP, shown)
    # A fault takes nothing of what is not live without it. Where there is no evidence on that, or it could not be
    # checked in time, the verdicts on faults are left without their premise.
    live = [t.name for t in cut.net.transitions if t.name not in lost["loop.live"]]
    if not live:
        return
    if not examination.checked["loop.live"].shown:
        judging = replace(judging, premise="it rests on 'loop.live', which is not shown")
    for question in well.asked.of_repairs(repaired.plant.may_fail, live):
        judging.judge_one(question, LOOP, shown)
    judging.judge(FAILING, failing, failing.asked.of_faults(live))


def _closes_nothing(error: InputError) -> NotShownError:
    message = f"'{PLANT}' closes no loop with the net: {error.diagnostics[0].message}"
    return NotShownError(message, "evidence", PLANT)


class _Closed(NamedTuple):
    """A loop, and the second reading of the plant file that it was held against."""

    plant: Plant
    loop: ClosedLoop

    @property
    def asked(self) -> Asked:
        """The questions to it."""
        return Asked(self.plant, self.loop.net)


@dataclass(frozen=True)
class _Judging:
    """A bundle whose verdicts on the machines of `model` are judged; `method` is what each says of itself."""

    examination: Examination
    cut: Cut
    model: PlantModel
    method: str
    answers: Answers
    timeout_ms: int
    premise: str = ""
    """What the verdicts rest on and is only claimed, if anything."""

    def closed(self, sending: Sending, faults: Faults) -> _Closed:
        """One loop, once it is seen to be what the plant file says."""
        plant = Plant(self.cut.net, self.model, sending, faults)
        try:
            loop = close(self.cut.net, self.model, faults, sending)
            compare(plant, loop)
        except DiffersError as error:
            message = f"the loop with '{PLANT}' is not what that says: {error}"
            raise NotShownError(message, "evidence", PLANT) from None
        except UncomparedError as error:
            message = f"it cannot be seen here whether the loop with '{PLANT}' is what that says: {error}"
            raise NotShownError(message, "evidence", PLANT) from None
        except InputError as error:
            raise _closes_nothing(error) from None
        return _Closed(plant, loop)

    def judge(
        self, file: str, closed: _Closed, questions: Iterable[Question]
    ) -> tuple[dict[str, ShownRecord], dict[str, set[str]]]:
        """Judge the verdicts that one document shows, of one loop: what it says, of each property by its name.

        And for each verdict, of what there is evidence that it is violated.
        """
        questions = list(questions)
        net = replace(closed.loop.net, properties=tuple(prop for one in questions for prop in one.of.values()))
        records = self.records(file, net)
        return records, {question.name: self.judge_one(question, file, records) for question in questions}

    def records(self, file: str, net: Net) -> dict[str, ShownRecord]:
        """What a document says of the properties of a loop, by their names; of nothing else."""
        names, found = {f"property.{prop.name}" for prop in net.properties}, dict[str, ShownRecord]()
        for one in checked_document(self.examination, file, net, self.answers, self.timeout_ms):
            if one.record.name not in names:
                raise NotShownError(f"'{file}' speaks of '{one.record.name}' as no bundle does", "evidence", file)
            found[one.record.name] = one
        return found

    def judge_one(self, question: Question, file: str, records: Mapping[str, ShownRecord]) -> set[str]:
        """Hold a verdict against the records of all that it comes down to: it must say what they say."""
        some = {of: records.get(f"property.{prop.name}") for of, prop in question.of.items()}
        decided = {of: one for of, one in some.items() if one is not None}
        against = [of for of, one in decided.items() if not one.record.proved]
        status = Status.VIOLATED if against else Status.PROVED if len(decided) == len(some) else Status.UNKNOWN
        shown = status is not Status.UNKNOWN and not any(one.record.lacking for one in decided.values())
        subjects = tuple(of for of in against if of)
        verdict = Verdict(
            question.name,
            status,
            question.sentence,
            self.method,
            question.weight,
            bound=UNDECIDED if status is Status.UNKNOWN else "",
            subjects=subjects,
            evidence=(file, PLANT) if shown else (),
            discipline="interleaving",
        )
        name = question.name
        if self.examination.verdict(name) != verdict:
            raise NotShownError(f"the verdict on '{name}' is not what its proof shows", "verdicts", name)
        methods = "; ".join(dict.fromkeys(method for one in decided.values() for method in one.methods))
        late = next((one.only_claimed for one in decided.values() if not one.shown), "")
        if status is Status.UNKNOWN:
            late = "undecided: the bundle itself does not say"
        late = late or self.premise
        how = f"the loop closed anew with {PLANT}: {methods or 'there is nothing of the kind'}"
        self.examination.judge(verdict, shown=not late, method=how, only_claimed=late)
        return {of for of in against if not decided[of].record.lacking}


def _asked(cut: Cut, loop: ClosedLoop) -> Iterator[Question]:
    """What votes rely on (O4), by the properties of the loop that it comes down to."""
    completions = dict[str, Property]()
    for row in cut.coordinated:
        for gate in cut.net.transition(row.name).external:
            kind = cut.net.signal(gate.signal).kind
            if gate.wanted and kind is SignalKind.TIMER:
                continue  # the promise keeps it: like a completion, only a command clears it
            question = _closes_after_vote(cut, loop, row.name, gate)
            if gate.wanted and kind is SignalKind.COMPLETION:
                completions[f"{gate.signal} for {row.name}"] = _never(f"o4.completion.{len(completions)}", question)
                continue
            name = f"o4.{row.name}/{gate.signal}"
            sentence = f"'{gate.signal}' stays {int(gate.wanted)} from the vote for '{row.name}' until it fires"
            yield Question(name, sentence, {gate.signal: _never(name, question)})
    yield Question("o4.completions", _COMPLETIONS, completions)
    yield Question("o4.commands", _COMMANDS, {"": _never("o4.command", _ENDED)})


def _never(name: str, formula: Formula) -> Property:
    return Property(name, PropertyKind.NEVER, formula)


def _closes_after_vote(cut: Cut, loop: ClosedLoop, name: str, gate: ExternalGate) -> Formula:
    """The part of the owner of a signal could vote, its completions there, and a move may close its gate."""
    owner = cut.owner[gate.signal]
    part = next(part.name for part in cut.parts[name] if part.controller == owner)
    own = next(subnet for subnet in cut.subnets if subnet.name == owner).transition(part)
    full = (*own.inputs, *own.permissive)
    empty = (*own.outputs, *own.inhibitive, *(loop.unsent[place] for place in full if place in loop.unsent))
    shown, means = loop.shown[gate.signal]
    open_ = [Holds(shown) if means == gate.wanted else Not(Holds(shown))]
    kinds = {signal.name: signal.kind for signal in cut.net.signals}
    if not (gate.wanted and kinds[gate.signal] is SignalKind.COMPLETION):  # of these is asked with nothing beside them
        awaited = [one.signal for one in own.external if one.wanted and kinds[one.signal] is SignalKind.COMPLETION]
        open_ += [Holds(place) if so else Not(Holds(place)) for place, so in map(loop.shown.__getitem__, awaited)]
    votes = And((*map(Holds, full), *(Not(Holds(place)) for place in empty), *open_, Not(_ENDED)))
    closing = tuple(
        Firable(move.name)
        for move in loop.net.transitions
        if shown in (move.inputs if means == gate.wanted else move.outputs)
    )
    one_of_them = closing[0] if len(closing) == 1 else Or(closing) if closing else Constant(value=False)
    return And((votes, one_of_them))
