"""The verdicts on O4 with the machines of a plant: the loop is closed anew, and a document must show what is asked.

A bundle that has them holds the plant file itself, and each verdict names the SHA-256 of it. The questions are stated
anew: of each gate that a vote relies on, whether a marking of the loop can be reached in which the part could vote, its
places as Eq. (1) wants them and the gate open, and a move may close the gate. That the document shows this of the loop
is checked as of any net.

The net of the loop is made by the same text as in the prover, `firable.nets.machines`, and then held against a second
reading of the plant file that shares nothing with it (`same_loop`), in every state. That the plant is like the real
machines nobody can show; it is assumed instead of O4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from typing import Final

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.documents import checked_document
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.same_loop import DiffersError, compare
from firable.decompose.verification.solvers import Answers
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Firable, Formula, Holds, Not, Or
from firable.nets.machines.closing import close
from firable.nets.machines.laws import ACCIDENT, OVERRUN
from firable.nets.machines.loop import ClosedLoop, Sending
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import ExternalGate, Property, PropertyKind, SignalKind
from firable.nets.verdict import Status, Verdict

PREFIX: Final = "o4."
PLANT: Final = "plant.yaml"
DOCUMENT: Final = "o4.evidence.json"
TITLE: Final = "the machines of the plant keep each gate that a vote relies on (O4)"

_ENDED: Final = Or((Holds(ACCIDENT), Holds(OVERRUN)))
_COMPLETIONS: Final = "a completion that a coordinated transition waits for stays from the vote until it fires"
_COMMANDS: Final = "no machine is given what it cannot do, however late its controller sends the command"


def check_machines(examination: Examination, cut: Cut, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on O4, if there are any; raises `NotShownError` where one is not shown."""
    if not any(verdict.name.startswith(PREFIX) for verdict in examination.bundle.verdicts):
        return
    plant = examination.text(PLANT)
    try:
        model = parse_plant(plant, PLANT)
        loop = close(cut.net, model, sending=Sending.LATE)
        compare(cut.net, model, loop)
    except DiffersError as error:
        raise NotShownError(f"the loop with '{PLANT}' is not what that says: {error}", "evidence", PLANT) from None
    except InputError as error:
        message = f"'{PLANT}' closes no loop with the net: {error.diagnostics[0].message}"
        raise NotShownError(message, "evidence", PLANT) from None
    asked = list(_asked(cut, loop))
    net = replace(loop.net, properties=tuple(prop for _, _, properties in asked for prop in properties))
    records = {}
    for one in checked_document(examination, DOCUMENT, net, answers, timeout_ms):
        if one.record.name in records or one.record.query or not one.record.proved:
            raise NotShownError(f"'{DOCUMENT}' speaks of '{one.record.name}' as no bundle does", "evidence", DOCUMENT)
        records[one.record.name] = one
    if missing := {f"property.{prop.name}" for prop in net.properties} ^ set(records):
        raise NotShownError(f"'{DOCUMENT}' lacks '{min(missing)}', or nobody asks it", "evidence", DOCUMENT)
    method = f"closed loop with the machines of the plant {sha256(plant.encode()).hexdigest()}"
    for name, sentence, properties in asked:
        verdict, evidence = examination.verdict(name), (DOCUMENT, PLANT)
        wanted = Verdict(name, Status.PROVED, sentence, method, evidence=evidence, discipline="interleaving")
        if verdict != wanted:
            raise NotShownError(f"the verdict on '{name}' is not what its proof shows", "verdicts", name)
        some = [records[f"property.{prop.name}"] for prop in properties]
        methods = list(dict.fromkeys(method for one in some for method in one.methods))
        late = next((one.only_claimed for one in some if not one.shown), "")
        how = f"the loop closed anew with {PLANT}: {'; '.join(methods) or 'there is nothing of the kind'}"
        examination.judge(verdict, shown=not late, method=how, only_claimed=late)


def _asked(cut: Cut, loop: ClosedLoop) -> Iterator[tuple[str, str, tuple[Property, ...]]]:
    """Each verdict with its sentence, and the properties of the loop that it comes down to."""
    completions = list[Property]()
    for row in cut.coordinated:
        for gate in cut.net.transition(row.name).external:
            question = _closes_after_vote(cut, loop, row.name, gate)
            completion = cut.net.signal(gate.signal).kind is SignalKind.COMPLETION
            if gate.wanted and completion:
                completions.append(_never(f"o4.completion.{len(completions)}", question))
                continue
            name = f"o4.{row.name}.{gate.signal}"
            sentence = f"'{gate.signal}' stays {int(gate.wanted)} from the vote for '{row.name}' until it fires"
            yield name, sentence, (_never(name, question),)
    yield "o4.completions", _COMPLETIONS, tuple(completions)
    yield "o4.commands", _COMMANDS, (_never("o4.command", _ENDED),)


def _never(name: str, formula: Formula) -> Property:
    return Property(name, PropertyKind.NEVER, formula)


def _closes_after_vote(cut: Cut, loop: ClosedLoop, name: str, gate: ExternalGate) -> Formula:
    """The part of the owner of a signal could vote, and a move may close its gate."""
    owner = cut.owner[gate.signal]
    part = next(part.name for part in cut.parts[name] if part.controller == owner)
    own = next(subnet for subnet in cut.subnets if subnet.name == owner).transition(part)
    full = (*own.inputs, *own.permissive)
    empty = (*own.outputs, *own.inhibitive, *(loop.unsent[place] for place in full if place in loop.unsent))
    shown, means = loop.shown[gate.signal]
    open_ = Holds(shown) if means == gate.wanted else Not(Holds(shown))
    votes = And((*map(Holds, full), *(Not(Holds(place)) for place in empty), open_, Not(_ENDED)))
    closing = tuple(
        Firable(move.name)
        for move in loop.net.transitions
        if shown in (move.inputs if means == gate.wanted else move.outputs)
    )
    one_of_them = closing[0] if len(closing) == 1 else Or(closing) if closing else Constant(value=False)
    return And((votes, one_of_them))
