"""Questions to a closed loop, each a family of properties of its net.

The loop is a `Net`, so what is asked of it is written as properties of that net, and every technique of `check` may
answer: nothing here explores. One question (is each transition live?) is many properties (one for each transition); the
verdict joins their answers and names what it is violated for. So a question costs no more than its formulas.

A transition of the cell is several variants in the loop: `fires` says that one of them may. Formulas of the net file
are put in these terms, where `start` is the cell's own M0, whatever the machines are at, and `deadlock` is that nothing
moves any more, neither cell nor machines.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from threading import Event
from typing import TYPE_CHECKING, Any, Final, TypeVar

from firable.analysis.check import check
from firable.analysis.goal import Limits
from firable.analysis.question import LARGER, listed
from firable.analysis.report import CheckReport
from firable.analysis.spaces.reachability import Budget
from firable.nets.formula import And, Constant, Firable, Formula, Holds, Not, Or, Start
from firable.nets.machines.loop import ACCIDENT, OVERRUN, ClosedLoop
from firable.nets.net import Net, Property, PropertyKind, TemporalProperty
from firable.nets.temporal import Fires, TemporalOr
from firable.nets.verdict import Status, Verdict, Weight, Witness
from firable.semantics.player import Player

if TYPE_CHECKING:
    from firable.analysis.evidence.document import Document

T = TypeVar("T")

ENDED: Final = Or((Holds(ACCIDENT), Holds(OVERRUN)))
"""The run has ended in an accident."""


@dataclass(frozen=True)
class Family:
    """One question: properties of the loop's net, by what each is about; all of them must hold.

    `note` says of the marking where a violation ends what holds there; `{}` stands for what it is about.
    """

    name: str
    statement: str
    of: Mapping[str, Property | TemporalProperty]
    weight: Weight = Weight.REQUIRED
    hint: str = ""
    note: str = ""


def any_of(formulas: Iterable[Formula]) -> Formula:
    """One of them holds, as a net file would say it: without a disjunction of one, or of none."""
    some = tuple(formulas)
    return some[0] if len(some) == 1 else Or(some) if some else Constant(value=False)


def all_of(formulas: Iterable[Formula]) -> Formula:
    """All of them hold, said in the same way."""
    some = tuple(formulas)
    return some[0] if len(some) == 1 else And(some) if some else Constant(value=True)


def fires(loop: ClosedLoop, transition: str) -> Formula:
    """A transition of the cell may fire: one of its variants may."""
    return any_of(map(Firable, loop.variants[transition]))


def firable_in_cell(net: Net, transition: str) -> Formula:
    """A transition is firable by Eq. (1), whatever its external gates."""
    one = net.transition(transition)
    full = (*one.inputs, *one.permissive)
    bare = (*one.outputs, *one.inhibitive)
    return all_of((*map(Holds, full), *(Not(Holds(name)) for name in bare)))


def possible(name: str, formula: Formula) -> Property:
    """From everywhere the formula can come to hold, unless the run ends in an accident."""
    return Property(name, PropertyKind.ALWAYS_POSSIBLE, any_of((formula, ENDED)))


def never(name: str, formula: Formula) -> Property:
    """The formula never holds."""
    return Property(name, PropertyKind.NEVER, formula)


def in_loop(loop: ClosedLoop, formula: T) -> T:
    """A formula, state or temporal, of the cell as one of the loop."""

    def put(part: Any) -> Any:
        match part:
            case Firable(transition):
                return fires(loop, transition)
            case Fires(transition):
                some = tuple(map(Fires, loop.variants[transition]))
                return some[0] if len(some) == 1 else TemporalOr(some) if some else Constant(value=False)
            case Start():
                places = loop.cell.places
                return all_of(Holds(p.name) if p.marked else Not(Holds(p.name)) for p in places)
            case tuple():
                return tuple(map(put, part))
        if is_dataclass(part) and not isinstance(part, type):
            return replace(part, **{one.name: put(getattr(part, one.name)) for one in fields(part)})
        return part

    result: T = put(formula)
    return result


@dataclass(frozen=True)
class Answered:
    """What was asked of a loop and answered: a verdict for each family, and what was found of its net.

    `report` is that of `check` on the loop's net with the properties of all families; the runs of the verdicts are of
    this net.
    """

    loop: ClosedLoop
    families: tuple[Family, ...]
    verdicts: tuple[Verdict, ...]
    report: CheckReport

    def document(self, limits: Limits | None = None) -> Document:
        """The evidence on the properties, as far as it was found within the limits."""
        from firable.analysis.evidence.producing.producer import evidence_of_report

        names = {f"property.{prop.name}" for family in self.families for prop in family.of.values()}
        verdicts = tuple(verdict for verdict in self.report.verdicts if verdict.name in names)
        return evidence_of_report(replace(self.report, verdicts=verdicts), (), limits)

    def family(self, name: str) -> Family:
        """The family of this name, which was asked."""
        return next(family for family in self.families if family.name == name)

    def of(self, family: Family) -> dict[str, Verdict]:
        """The verdicts on the properties of a family, by what each is about."""
        found = {verdict.name.removeprefix("property."): verdict for verdict in self.report.verdicts}
        return {of: found[prop.name] for of, prop in family.of.items()}

    def doubting(self, some: Collection[str], why: str = "") -> Answered:
        """The same, where a violation for some of what is asked about leaves a question unknown, and `why`."""

        def joined(family: Family) -> Verdict:
            found = self.of(family)
            for of, verdict in found.items():
                if of in some and verdict.status is Status.VIOLATED:
                    found[of] = replace(verdict, status=Status.UNKNOWN, bound=why, witness=None, code="", hint=LARGER)
            return _joined(self.loop, family, found)

        return replace(self, verdicts=tuple(map(joined, self.families)))


def answers(
    loop: ClosedLoop,
    families: Iterable[Family],
    budget: Budget | None = None,
    *,
    progress: Callable[[int, int], object] | None = None,
    tell: Callable[[str], object] | None = None,
    interrupted: Event | None = None,
) -> Answered:
    """Ask each family of a loop, with `progress`, `tell` and `interrupted` of `check`; raises `InputError` as it does.

    Nothing else is asked of its net: whether a machine can be stopped, or every variant is live, is no question there.
    """
    families = tuple(families)
    net = replace(loop.net, properties=tuple(prop for family in families for prop in family.of.values()))
    report = check(net, budget=budget, of_the_net=False, progress=progress, tell=tell, interrupted=interrupted)
    return Answered(loop, families, (), report).doubting(())


def _joined(loop: ClosedLoop, family: Family, found: Mapping[str, Verdict]) -> Verdict:
    """All properties of a family as one verdict, with the evidence of the first that is violated or unknown."""
    for status in (Status.VIOLATED, Status.UNKNOWN):
        about = tuple(of for of, verdict in found.items() if verdict.status is status)
        if about:
            first = found[about[0]]
            return replace(
                first,
                name=family.name,
                statement=family.statement,
                weight=family.weight,
                subjects=tuple(one for one in about if one),
                hint=(family.hint or first.hint) if status is Status.VIOLATED else first.hint,
                witness=first.witness and replace(first.witness, note=_note(loop, family, about[0], first.witness)),
            )
    some = next(iter(found.values()), None)
    if some is None:
        nothing = "there is nothing of the kind"
        return Verdict(family.name, Status.PROVED, family.statement, nothing, family.weight, discipline="interleaving")
    witness = some.witness and replace(some.witness, note="")
    return replace(
        some,
        name=family.name,
        statement=family.statement,
        weight=family.weight,
        subjects=(),
        hint="",
        witness=witness,
    )


def _note(loop: ClosedLoop, family: Family, about: str, witness: Witness) -> str:
    """What has happened where a violation ends, in the words of the cell."""
    last = witness.firings[-1][0] if witness.firings else ""
    ends = loop.accidents.get(last) or ": ".join(
        filter(None, (family.note.format(about), waiting(loop, witness.marking)))
    )
    return "; ".join(filter(None, (ends, *_stale(loop, witness))))


def _stale(loop: ClosedLoop, witness: Witness) -> Iterator[str]:
    """What fires in a run of the loop on a signal that has changed before the controller was told, as sentences."""
    player, marking = Player(loop.net), loop.net.initial_marking
    own = {variant: loop.cell.transition(name) for name, variants in loop.variants.items() for variant in variants}
    bits = {signal: 1 << loop.net.place_index[place] for signal, place in loop.news.items()}
    found = dict[str, None]()
    for fired in witness.firings if bits else ():
        for transition in (own[name] for name in fired if name in own):
            untold = listed([g.signal for g in transition.external if marking & bits.get(g.signal, 0)])
            if untold:
                found[f"{transition.name} fires before its controller is told that {untold} has changed"] = None
        marking = player.fire(marking, [loop.net.transition_index[name] for name in fired])
    yield from found


def waiting(loop: ClosedLoop, marking: Sequence[str]) -> str:
    """What the cell waits for in a marking of the loop, and what its machines are at, as a sentence."""
    held = set(marking)
    gates = []
    for transition in loop.cell.transitions:
        ready = set(transition.inputs) | set(transition.permissive) <= held
        if not ready or held & ({*transition.outputs} | {*transition.inhibitive}):
            continue
        closed = [
            gate.signal + ("" if gate.wanted else " to drop")
            for gate in transition.external
            if gate.signal in loop.shown  # a time can be over at any moment
            and ((loop.shown[gate.signal][0] in held) == loop.shown[gate.signal][1]) != gate.wanted
        ]
        if closed:
            gates.append(f"{transition.name} waits for {listed(closed)}")
    at_work = [loop.net.place(at).description for at in loop.at.values() if at in held]
    failed = [loop.net.place(name).description for name in loop.failed.values() if name in held]
    return "; ".join(dict.fromkeys((*gates, *failed, *at_work)))
