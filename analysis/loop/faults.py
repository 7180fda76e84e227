"""What a fault of each machine leads to: which transitions stand still, which places hang, and whether repair helps.

A machine that fails takes a command and never finishes it. What may fail is said in the plant file (`may_fail`). One
machine fails at a time; two at once are not asked about. Two loops are.

*For good*: the fault is never repaired. No accident may follow from it, whatever the rest of the cell goes on to do:
this must hold, and makes the fault *safe*. An accident before any fault follows from none, and is told of the loop
without them. Which transitions can then come to stand still, and which places can hold their token for ever, is
information: a cell does not go on without its robot, but its conveyors may.

*Repaired*: a repairable fault ends at some time and the machine goes on with its command. From everywhere every
transition that is live without faults must be able to fire again: the cell *recovers*. Nothing is said of how long it
takes, nor of a machine that forgets its command: that is another plant, in which the command fails for good.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from threading import Event
from typing import Final

from firable.analysis.loop.families import ENDED, Answered, Family, answers, any_of, fires, never, possible
from firable.analysis.loop.verdicts import LoopReport, known_live, live_in
from firable.analysis.question import listed
from firable.analysis.spaces.reachability import Budget
from firable.nets.formula import And, Formula, Holds, Not, Or
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Faults
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net, Property
from firable.nets.verdict import Status, Verdict, Weight
from firable.nets.well_formed import as_name

_IN_DOUBT: Final = "it cannot fire again then, and is not known to be live without faults"


@dataclass(frozen=True)
class FaultsAsked:
    """What was asked of the loops in which a machine fails: for good, and until it is repaired; None where none may."""

    live: tuple[str, ...]
    for_good: Answered | None
    repaired: Answered | None

    @property
    def answered(self) -> tuple[Answered, ...]:
        """The loops that were asked."""
        return tuple(one for one in (self.for_good, self.repaired) if one is not None)

    @property
    def unasked(self) -> str:
        """Why of machines that may fail it is only asked whether that is safe; empty where more is asked."""
        if self.live or self.for_good is None:
            return ""
        machines = listed(self.for_good.loop.failed)
        return (
            f"{machines}: without faults no transition is live here, so a fault takes nothing, and repair gives nothing"
        )

    @property
    def nets(self) -> dict[str, Net]:
        """The nets that the runs of the verdicts are of, by the names of these."""
        return {family.name: one.loop.net for one in self.answered for family in one.families}

    def verdicts(self) -> Iterator[Verdict]:
        """The verdicts as they are told: what stands still after a fault, and what hangs, in one."""
        if self.for_good is not None:
            (_, safe), *pairs = zip(self.for_good.families, self.for_good.verdicts, strict=True)
            yield safe
            for (family, still), (_, hang) in zip(pairs[::2], pairs[1::2], strict=True):
                yield _consequence(still, hang, self.for_good.of(family))
        if self.repaired is not None:
            yield from self.repaired.verdicts


def check_faults(report: LoopReport, model: PlantModel, budget: Budget | None = None) -> tuple[Verdict, ...]:
    """The verdicts on the faults that the plant file declares, none where it declares none.

    `report` is that of the loop without faults. Cost: two more explorations, of loops with a place more for each
    machine that can fail, and a backward closure for each such machine with each transition and each place.
    """
    return tuple(ask_faults(report.asked, model, budget).verdicts())


def ask_faults(
    asked: Answered,
    model: PlantModel,
    budget: Budget | None = None,
    live: tuple[str, ...] | None = None,
    *,
    begins: Callable[[str], object] = lambda _: None,
    progress: Callable[[int, int], object] | None = None,
    tell: Callable[[str], object] | None = None,
    interrupted: Event | None = None,
) -> FaultsAsked:
    """Ask what the faults that the plant file declares do to a cell; `asked` are the answers without faults.

    `live` are the transitions that a fault can take something of, unless somebody knows better those that may be live.
    `begins` is told what is asked from then on; `progress`, `tell` and `interrupted` are those of `check`.
    """
    net, live = asked.loop.cell, live_in(asked) if live is None else live
    for_good, repaired = close(net, model, Faults.FOR_GOOD), close(net, model, Faults.REPAIRED)
    # Of a cell in which nothing is live, a fault takes nothing, and repair cannot give it back.
    recoveries = [_recovery(repaired, machine, live) for machine in repaired.failed] if live else []
    ask = partial(answers, budget=budget, progress=progress, tell=tell, interrupted=interrupted)
    begins("the cell of which a machine fails for good")
    lasting = ask(for_good, _for_good(for_good, live)) if for_good.failed else None
    begins("the cell of which a machine is repaired")
    mended = ask(repaired, recoveries) if recoveries else None
    # Of what only may be live, nobody knows whether it is the fault that it cannot fire again.
    doubted = set(live).difference(known_live(asked))
    return FaultsAsked(
        live, lasting and lasting.doubting(doubted, _IN_DOUBT), mended and mended.doubting(doubted, _IN_DOUBT)
    )


def _for_good(loop: ClosedLoop, live: tuple[str, ...]) -> Iterator[Family]:
    yield Family(
        "fault.safe",
        "no accident follows when a machine fails and is not repaired",
        # After an accident nothing fires: a machine that has failed then had failed before.
        {"": never("fault.accident", And((ENDED, any_of(map(Holds, loop.failed.values())))))},
        hint="a machine that takes longer leads there, too, so begin with loop.busy-machines and loop.accidents: gate "
        "what depends on a machine by its completion, not by a time",
    )
    for machine, failed in loop.failed.items() if live else ():
        its = f"fault.{as_name(machine)}"
        told = machine.replace("{", "{{").replace("}", "}}")  # braces of a note are what it is about
        yield Family(
            its,
            f"when {machine} has failed for good, all that is live without faults can still fire again",
            {name: _goes_on(f"{its}.t{i}", failed, fires(loop, name)) for i, name in enumerate(live)},
            Weight.INFORMATION,
            note=f"{told} has failed, and {{}} can never fire again",
        )
        places = [place.name for place in loop.cell.places]
        yield Family(
            f"{its}.places",
            f"when {machine} has failed for good, every place can still lose its token",
            {name: _goes_on(f"{its}.p{i}", failed, Not(Holds(name))) for i, name in enumerate(places)},
            Weight.INFORMATION,
        )


def _goes_on(name: str, failed: str, formula: Formula) -> Property:
    return possible(name, Or((Not(Holds(failed)), formula)))


def _consequence(still: Verdict, hang: Verdict, found: Mapping[str, Verdict]) -> Verdict:
    """What stands still and what hangs after one fault, as one verdict; `found` is that of each transition."""
    if still.status is not Status.VIOLATED:
        return still
    rest = [name for name, verdict in found.items() if verdict.holds]
    open_ = [name for name, verdict in found.items() if not verdict.holds and name not in still.subjects]
    told = [f"these go on whatever fails at it: {listed(rest, 40)}"] if rest else []
    told += [f"it is not known of these: {listed(open_, 40)}"] if open_ else []
    told = told or ["in the end all stand still"]
    if hang.status is Status.VIOLATED:
        told.append(f"these can hold their token for ever: {listed(hang.subjects, 40)}")
    return replace(still, hint="; ".join(told))


def _recovery(loop: ClosedLoop, machine: str, live: tuple[str, ...]) -> Family:
    failed = loop.failed[machine]
    mended = {name: possible(f"repair.{as_name(machine)}.{i}", fires(loop, name)) for i, name in enumerate(live)}
    return Family(
        f"fault.{as_name(machine)}.repaired",
        f"after {machine} was repaired and goes on, all that is live without faults can fire again",
        {**mended, "": possible(f"repair.{as_name(machine)}", Not(Holds(failed)))},
        hint="something was lost while the machine stood still: see what the cell waits for at the end",
        note="from here {} can never fire again",
    )
