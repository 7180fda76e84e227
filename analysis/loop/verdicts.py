"""The verdicts on a closed loop, and what a verdict with gates free was too hopeful about.

Asked of the loop, besides the properties of the net file:

- no *accident* happens: no machine collides, machines what is not there, or is given a command while it is at one;
- no *completion is lost*: a place that waits for the completion of its command has either the machine at work for it,
  or the bit set (or acknowledged, and the sensor to come). A bit that two commands share is lost so, and a place that
  is marked in M0 waits for the end of a command that was never sent;
- the cell never *hangs*: from everywhere some transition of the cell can fire, if need be after moves of the machines;
- each *gate can open*: where a transition waits for nothing but its gates, it can come to fire or to lose a token;
- each transition is *live*.

The first two are safety: with gates free they cannot even be asked. The others are what gates free is optimistic
about: a deadlock of the open net is one of the loop if it can be reached, and the loop can have more. Workpieces are
assumed to be able to come and to be taken away at any time, in any order with everything else; nothing is assumed to be
quick. An accident ends a run, so the others are asked of runs without one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import combinations
from threading import Event
from typing import Final

from firable.analysis.check import check
from firable.analysis.loop.families import (
    ENDED,
    Answered,
    Family,
    answers,
    any_of,
    firable_in_cell,
    fires,
    in_loop,
    never,
    possible,
)
from firable.analysis.report import CheckReport
from firable.analysis.spaces.reachability import Budget
from firable.analysis.temporal.queries import temporal_question
from firable.analysis.verdicts.properties import statement
from firable.nets.formula import And, Deadlock, Formula, Holds, Not, format_formula
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ACCIDENT, OVERRUN, ClosedLoop
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net, Property, PropertyKind, TemporalProperty
from firable.nets.verdict import Status, Verdict, Weight, overall

BUSY: Final = "loop.busy-machines"
ACCIDENTS: Final = "loop.accidents"
LIVE: Final = "loop.live"
_PROPERTY: Final = "cell."
_HANGS: Final = "from here no transition of the cell ever fires again"
_NOTES: Final = {
    PropertyKind.NEVER: "here ({}) holds",
    PropertyKind.ALWAYS: "here ({}) does not hold",
    PropertyKind.ALWAYS_POSSIBLE: "from here ({}) can never be reached again",
}


@dataclass(frozen=True, slots=True)
class Difference:
    """One question, answered with gates free and with the machines."""

    question: str
    gates_free: Status
    with_machines: Status
    remark: str

    @property
    def differs(self) -> bool:
        """Whether the machines change the answer."""
        return self.gates_free is not self.with_machines


@dataclass(frozen=True)
class LoopReport:
    """What was found of a cell with its machines, beside what was found with gates free."""

    asked: Answered
    verdicts: tuple[Verdict, ...]
    differences: tuple[Difference, ...]
    opened: CheckReport

    @property
    def loop(self) -> ClosedLoop:
        """The loop that was asked."""
        return self.asked.loop

    @property
    def closed(self) -> CheckReport:
        """What `check` found of its net."""
        return self.asked.report

    @property
    def status(self) -> Status:
        """The status of all required verdicts together."""
        return overall(self.verdicts)

    def verdict(self, name: str) -> Verdict:
        """The verdict of this name; `KeyError` where there is none."""
        for verdict in self.verdicts:
            if verdict.name == name:
                return verdict
        raise KeyError(name)


def check_loop(
    net: Net,
    model: PlantModel,
    budget: Budget | None = None,
    *,
    begins: Callable[[str], object] = lambda _: None,
    progress: Callable[[int, int], object] | None = None,
    tell: Callable[[str], object] | None = None,
    interrupted: Event | None = None,
) -> LoopReport:
    """Decide every verdict on a net with the machines of a plant, and compare it with gates free.

    `begins` is told what is asked from then on; `progress`, `tell` and `interrupted` are those of `check`. Raises
    `InputError` as `close` does, and as `check` does.

    >>> from firable.nets.catalogue import catalogue_net, catalogue_plant
    >>> report = check_loop(catalogue_net("one_robot"), catalogue_plant("one_robot"))
    >>> report.closed.figures.markings, str(report.status), any(one.differs for one in report.differences)
    (746, 'proved', False)
    """
    begins("the cell with its machines")
    asked = ask_loop(net, model, budget, progress=progress, tell=tell, interrupted=interrupted)
    unclear = (_not_asked(of) for of in net.properties if _unclear(model, of))
    verdicts = (*asked.verdicts, *unclear)
    begins("the cell with gates free")
    opened = check(net, budget=budget, progress=progress, tell=tell, interrupted=interrupted)
    return LoopReport(asked, verdicts, tuple(_differences(verdicts, opened)), opened)


def ask_loop(
    net: Net,
    model: PlantModel,
    budget: Budget | None = None,
    *,
    progress: Callable[[int, int], object] | None = None,
    tell: Callable[[str], object] | None = None,
    interrupted: Event | None = None,
) -> Answered:
    """Ask everything of a net with the machines of a plant, but for properties of which the answer would be empty.

    `progress`, `tell` and `interrupted` are those of `check`. Raises `InputError` as `close` does, and as `check` does.
    """
    loop = close(net, model)
    of_the_file = (_family_of(loop, of) for of in net.properties if not _unclear(model, of))
    families = (*_families(loop), *of_the_file)
    return answers(loop, families, budget, progress=progress, tell=tell, interrupted=interrupted)


def live_in(asked: Answered) -> tuple[str, ...]:
    """The transitions of the cell that are live, or may be: those that `loop.live` is not violated for."""
    verdict = next(verdict for verdict in asked.verdicts if verdict.name == LIVE)
    return without(asked, verdict.subjects if verdict.status is Status.VIOLATED else ())


def known_live(asked: Answered) -> tuple[str, ...]:
    """The transitions of the cell that are known to be live."""
    return tuple(name for name, verdict in asked.of(asked.family(LIVE)).items() if verdict.holds)


def without(asked: Answered, lost: Iterable[str]) -> tuple[str, ...]:
    """The transitions of the cell but for some."""
    some = set(lost)
    return tuple(name for name in asked.loop.variants if name not in some)


def _families(loop: ClosedLoop) -> Iterator[Family]:
    names = [transition.name for transition in loop.cell.transitions]
    gated = [transition.name for transition in loop.cell.transitions if transition.external]
    yield Family(
        BUSY,
        "no machine is given a command while it is at another",
        {"": never("loop.busy", Holds(OVERRUN))},
        hint="wait for the completion of the first command before the second is sent",
    )
    yield Family(
        ACCIDENTS,
        "no machine collides, grasps nothing, or machines what is not there",
        {"": never("loop.accident", Holds(ACCIDENT))},
        hint="the last firing is the accident: what it needs must be a place, a gate or a lock of the machine itself",
    )
    yield Family(
        "loop.completions",
        "a place that waits for a completion has its machine at work, or the completion is there",
        {subject: never(f"loop.completion.{i}", lost) for i, (subject, lost) in enumerate(_losses(loop))},
        hint="the completion was cleared, or its command never sent: begin at a place without a command, and give "
        "each command a completion of its own",
    )
    yield Family(
        "loop.deadlock-free",
        "from every reachable marking some transition of the cell can fire, as its machines allow",
        {"": possible("loop.hang", any_of(fires(loop, name) for name in names))},
        hint="the machines wait for the cell, and the cell waits for what no machine will do",
        note=_HANGS,
    )
    yield Family(
        "loop.gates-open",
        "every gate that a transition waits for can still open",
        {
            name: possible(f"loop.gate.{i}", any_of((fires(loop, name), Not(firable_in_cell(loop.cell, name)))))
            for i, name in enumerate(gated)
        },
        hint="no machine will ever make the signal what the gate wants: check which command or sensor is to drive it",
        note="from here the gates of {} never open again",
    )
    yield Family(
        LIVE,
        "from every reachable marking every transition can fire again, as its machines allow",
        {name: possible(f"loop.live.{i}", fires(loop, name)) for i, name in enumerate(names)},
        Weight.WARNING,
        hint="right for what happens only at start-up; otherwise this part of the cell is lost for good",
        note="from here {} can never fire again",
    )


def _family_of(loop: ClosedLoop, of: Property | TemporalProperty) -> Family:
    """A property of the net file; never a deadlock of the cell is never one that its machines do not end."""
    said = temporal_question(of).statement if isinstance(of, TemporalProperty) else statement(of)
    name = f"{_PROPERTY}{of.name}"
    words = said.removesuffix(", external gates free").replace("; its external gates do open", "")
    note = ""
    put: Property | TemporalProperty
    if isinstance(of, TemporalProperty):
        put = replace(of, name=name, formula=in_loop(loop, of.formula))
    elif of.kind is PropertyKind.NEVER and of.formula == Deadlock():
        put = possible(name, any_of(fires(loop, t.name) for t in loop.cell.transitions))
        note = _HANGS
    else:
        then = None if of.then is None else in_loop(loop, of.then)
        put = replace(of, name=name, formula=in_loop(loop, of.formula), then=then)
        note = _NOTES.get(of.kind, "").format(format_formula(of.formula))
    return Family(f"loop.property.{of.name}", words, {"": put}, note=note)


def _unclear(model: PlantModel, of: Property | TemporalProperty) -> bool:
    """Whether a property speaks of a deadlock in a way that what never rests would make empty.

    That is a sensor, or a station at which workpieces arrive and leave, whatever the cell does.
    """
    if isinstance(of, Property) and of.kind is PropertyKind.NEVER and of.formula == Deadlock():
        return False
    restless = any(sensor.may_flicker or sensor.may_linger or sensor.by_hand for sensor in model.sensors.values())
    passing = model.departure(model.arrivals.station) is not None
    return (restless or passing) and _speaks_of_deadlock(of)


def _speaks_of_deadlock(part: object) -> bool:
    if isinstance(part, Deadlock):
        return True
    if isinstance(part, tuple):
        return any(map(_speaks_of_deadlock, part))
    if is_dataclass(part) and not isinstance(part, type):
        return any(_speaks_of_deadlock(getattr(part, one.name)) for one in fields(part))
    return False


def _not_asked(of: Property | TemporalProperty) -> Verdict:
    said = temporal_question(of).statement if isinstance(of, TemporalProperty) else statement(of)
    return Verdict(
        f"loop.property.{of.name}",
        Status.UNKNOWN,
        said,
        "not asked",
        bound="with a sensor that may flicker or linger, or a station at which workpieces arrive and leave, something "
        "always moves, so no marking is a `deadlock`",
        hint="say what must not hang by `always_possible`",
        discipline="interleaving",
    )


def _losses(loop: ClosedLoop) -> Iterator[tuple[str, Formula]]:
    """For each place that waits for a completion: it waits in vain."""
    waiting_for = [place for place in loop.cell.places if place.completion is not None]
    for place in waiting_for:
        signal = str(place.completion)
        there = [loop.at[place.name], signal]
        there += [among[of] for among, of in ((loop.acknowledged, signal), (loop.unsent, place.name)) if of in among]
        yield place.name, And((Holds(place.name), *(Not(Holds(name)) for name in there), Not(ENDED)))
    for one, other in combinations(waiting_for, 2):
        if one.completion == other.completion:
            yield f"{one.name} and {other.name}", And((Holds(one.name), Holds(other.name)))


def _differences(verdicts: tuple[Verdict, ...], opened: CheckReport) -> Iterator[Difference]:
    """What both were asked, side by side."""
    free = {verdict.name: verdict for verdict in opened.verdicts}
    for verdict in verdicts:
        if (open_ := free.get(verdict.name.removeprefix("loop."))) is None:
            continue
        remark = ""
        if open_.status is Status.PROVED and verdict.status is Status.VIOLATED:
            remark = "gates free was too hopeful: here a gate that it opened stays closed"
            if verdict.witness is not None and not {ACCIDENT, OVERRUN}.isdisjoint(verdict.witness.marking):
                remark = "gates free knows of no accidents: here one ends the run"
        elif open_.status is Status.VIOLATED and verdict.status is Status.PROVED:
            remark = "the machines keep the cell from the marking that violates it"
        elif open_.status is not verdict.status:
            remark = "decided on one side only"
        yield Difference(open_.name, open_.status, verdict.status, remark)
