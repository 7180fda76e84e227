"""Whether the machines keep what a proof assumes of them (O4): gates that stay open from the vote to the firing.

A part votes yes when it is firable and its gates are open. Its promise holds the places; whether a gate stays open is
the machines' matter. In the closed loop this is a question about single firings: is there a reachable marking in which
the part could have voted, its places as it found them, the gate and its completions open, and a move of a machine, a
workpiece or a sensor that closes the gate? If there is none, then a gate that was open at the vote is open when the
transition fires, by induction over the firings between; so the assumption is proved, for these machines. If there is
one, the run to it is shown, with the move that closes the gate at its end.

Gates of completions are asked as well, all in one verdict: that a completion is cleared only by sending its command,
which the promise excludes, is what the list of assumptions leaves out by reasoning, and here it is confirmed.

The loop is that of the distributed cell: each controller sends its commands when it comes to apply a firing, which may
be long after the coordinator decided it, and votes again only then. So a transition of the cell closes no gate itself:
sending its commands is a move of its own, and counts like any other. What was decided at one instant reaches the
machines at several, so it is also asked, of this loop, that no machine is given what it cannot do. Votes can be given
in the loop as early as the coordinator has decided, earlier than in the cell: that errs on the safe side.

Rejected: to ask whether the gate can close before the whole transition fires. Votes are taken one by one, so the gate
is needed from the moment its own part is firable, and the others may take long.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from threading import Event

from firable.analysis.goal import Limits
from firable.analysis.loop.families import ENDED, Answered, Family, all_of, answers, any_of, never
from firable.analysis.spaces.reachability import Budget
from firable.decompose.proofs.assumptions import Assumption, assumptions
from firable.nets.decomposition import Coordinated, Decomposition
from firable.nets.formula import And, Firable, Formula, Holds, Not
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Sending
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import ExternalGate, Net, SignalKind, Transition
from firable.nets.verdict import Verdict, Witness
from firable.semantics.player import Player

COMPLETIONS = "o4.completions"
COMMANDS = "o4.commands"
EVIDENCE = "o4.evidence.json"
_HINT = "put the interlock into the machine's own controller, or make the signal one that a command clears"
_COMPLETION_HINT = "let each command that clears it have a completion of its own"
_BARE_HINT = "let the controller that reads '{}' give a token to '{}': without one it may have voted long before"
_OUTSIDE_HINT = (
    "read '{}' in a transition of its own controller, and let '{}' take the token that this leaves: it remembers it"
)


def name_of(assumption: Assumption) -> str:
    """The name of the verdict on an assumption."""
    return f"o4.{assumption.transition}/{assumption.signal}"


@dataclass(frozen=True)
class HeldGates:
    """The verdicts on the gates, and what was asked of the loop of commands that are sent late.

    The runs of the verdicts are of the loop's net, led on by the firing that closes the gate.
    """

    verdicts: tuple[Verdict, ...]
    asked: Answered

    @property
    def loop(self) -> ClosedLoop:
        """The loop that was asked."""
        return self.asked.loop

    def evidence(self, limits: Limits | None = None) -> dict[str, bytes]:
        """The document, for `firable verify`, by the name of its file."""
        data = self.asked.document(limits).to_bytes()
        return {EVIDENCE if data.startswith(b"{") else f"{EVIDENCE}.gz": data}


def held_gates(
    decomposition: Decomposition,
    model: PlantModel,
    budget: Budget | None = None,
    *,
    interrupted: Event | None = None,
) -> HeldGates:
    """The verdict on each assumption O4 with the machines of a plant, on gates of completions, and on late commands.

    `interrupted` is that of `check`. Raises `InputError` as `close` does.
    """
    loop = close(decomposition.net, model, sending=Sending.LATE)
    rows = {row.name: row for row in decomposition.coordinated}
    families = []
    for one in assumptions(decomposition):
        asked = never(name_of(one), _closed_after_vote(loop, decomposition, rows[one.transition], one))
        part = _part(decomposition, rows[one.transition], decomposition.net.signal(one.signal).owner)
        outside = (seen := model.sensors.get(one.signal)) is not None and seen.set_by is not None
        said = _HINT if part.inputs else _BARE_HINT
        hint = (_OUTSIDE_HINT if outside else said).format(one.signal, one.transition)
        families.append(Family(name_of(one), str(one), {one.signal: asked}, hint=hint))
    completions = {
        f"{gate.signal} for {row.name}": Assumption(row.name, gate.signal, gate.wanted)
        for row in decomposition.coordinated
        if decomposition.net.transition(row.name).openable
        for gate in decomposition.net.transition(row.name).external
        if _is_completion(decomposition.net, gate)
    }
    families.append(
        Family(
            COMPLETIONS,
            "a completion that a coordinated transition waits for stays from the vote until it fires",
            {
                about: never(f"o4.completion.{i}", _closed_after_vote(loop, decomposition, rows[one.transition], one))
                for i, (about, one) in enumerate(completions.items())
            },
            hint=_COMPLETION_HINT,
        )
    )
    families.append(
        Family(
            COMMANDS,
            "no machine is given what it cannot do, however late its controller sends the command",
            {"": never("o4.command", ENDED)},
            hint="let a completion of the one machine gate the command to the other",
        )
    )
    answered = answers(loop, families, budget, interrupted=interrupted)
    gates = [*({one.signal: one} for one in assumptions(decomposition)), completions, {}]
    shown = (_shown(loop, decomposition, verdict, its) for verdict, its in zip(answered.verdicts, gates, strict=True))
    return HeldGates(tuple(shown), answered)


def _part(decomposition: Decomposition, row: Coordinated, controller: str | None) -> Transition:
    for part in row.parts:
        if part.controller == controller:
            return decomposition.subnet(part.controller).transition(part.name)
    raise ValueError(f"'{row.name}' has no part at '{controller}', which owns one of its signals")


def _vote(loop: ClosedLoop, net: Net, part: Transition, one: Assumption) -> Formula:
    """The part is firable and the gate is open, as its owner found them; so are those of its completions, which stay
    open where the verdict on them holds, and of which nothing but themselves is assumed there."""
    gates = [(one.signal, one.wanted)]
    if not _is_completion(net, one):
        gates += [(gate.signal, True) for gate in part.external if _is_completion(net, gate)]
    shown = ((*loop.shown[signal], wanted) for signal, wanted in gates)
    open_ = (Holds(place) if means == wanted else Not(Holds(place)) for place, means, wanted in shown)
    read = (*part.inputs, *part.permissive)
    bare = (*part.outputs, *part.inhibitive, *(loop.unsent[name] for name in read if name in loop.unsent))
    return all_of((*map(Holds, read), *(Not(Holds(name)) for name in bare), *open_, Not(ENDED)))


def _is_completion(net: Net, gate: Assumption | ExternalGate) -> bool:
    return gate.wanted and net.signal(gate.signal).kind is SignalKind.COMPLETION


def _closing(loop: ClosedLoop, one: Assumption) -> Iterator[str]:
    """The moves that close the gate."""
    place, means = loop.shown[one.signal]
    for transition in loop.net.transitions:
        if place in (transition.inputs if means == one.wanted else transition.outputs):
            yield transition.name


def _closed_after_vote(loop: ClosedLoop, decomposition: Decomposition, row: Coordinated, one: Assumption) -> Formula:
    part = _part(decomposition, row, decomposition.net.signal(one.signal).owner)
    return And((_vote(loop, decomposition.net, part, one), any_of(map(Firable, _closing(loop, one)))))


def _shown(
    loop: ClosedLoop, decomposition: Decomposition, verdict: Verdict, gates: Mapping[str, Assumption]
) -> Verdict:
    """The verdict, and where it is that one of the gates closes, with the run led on by the firing that closes it."""
    if verdict.witness is None or not gates:
        return verdict
    rows = {row.name: row for row in decomposition.coordinated}
    one = gates[verdict.subjects[0]]
    part = _part(decomposition, rows[one.transition], decomposition.net.signal(one.signal).owner)
    player, marking = Player(loop.net), loop.net.marking(verdict.witness.marking)
    may_fire = {loop.net.transitions[t].name: t for t in player.firable(marking)}
    closing = next(name for name in _closing(loop, one) if name in may_fire)
    after = player.fire(marking, [may_fire[closing]])
    note = f"'{part.name}' had voted yes, and the last firing makes '{one.signal}' {int(not one.wanted)}"
    firings = (*verdict.witness.firings, (closing,))
    return replace(verdict, witness=Witness(firings, marking=loop.net.names(after), note=note))
