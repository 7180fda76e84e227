"""What a fault of each machine leads to: which transitions stand still, which places hang, and whether repair helps.

A machine that fails takes a command and never finishes it. What may fail is said in the plant file (`may_fail`). One
machine fails at a time; two at once are not asked about.

*For good*: the fault is never repaired. No accident may follow from it, whatever the rest of the cell goes on to do:
this must hold, and makes the fault *safe*. An accident before any fault follows from none, and is told of the loop
without them. Which transitions can then come to stand still, and which places can hold their token for ever, is
information: a cell does not go on without its robot, but its conveyors may.

*Repaired*: a repairable fault ends at some time and the machine goes on with its command. From everywhere every
transition that is live without faults must be able to fire again: the cell *recovers*. Nothing is said of how long it
takes, nor of a machine that forgets its command: that is another plant, in which the command fails for good.

A machine that fails is one that takes longer (`firable.nets.machines.slower`). So where no accident can happen without
faults, none follows from one; and what can always fire again without them can do so after a repair. Both come down to
questions that the loop without faults has answered. The one in which a machine fails for good is explored for what
comes to stand still, and for accidents where some can happen anyway.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from threading import Event
from typing import Final

from firable.analysis.loop.families import ENDED, Answered, Family, answers, any_of, fires, never, possible
from firable.analysis.loop.verdicts import ACCIDENTS, BUSY, LIVE, LoopReport, known_live, live_in
from firable.analysis.question import listed
from firable.analysis.spaces.reachability import Budget
from firable.nets.formula import And, Formula, Holds, Not, Or
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Faults
from firable.nets.machines.plant_file import PlantModel
from firable.nets.machines.slower import difference
from firable.nets.net import Net, Property, TemporalProperty
from firable.nets.verdict import Status, Verdict, Weight
from firable.nets.well_formed import as_name

_SAFE: Final = "fault.safe"
_IS_SAFE: Final = "no accident follows when a machine fails and is not repaired"
_IN_DOUBT: Final = "it cannot fire again then, and is not known to be live without faults"


@dataclass(frozen=True)
class FaultsAsked:
    """What was asked of the machines that may fail.

    `for_good` was asked of the loop in which one fails for good, and `following` are the questions that come down to
    those that the loop without faults has answered; None where there are none.
    """

    live: tuple[str, ...]
    failing: tuple[str, ...]
    """The machines that may fail."""
    for_good: Answered | None
    following: Answered | None

    @property
    def unasked(self) -> str:
        """Why of machines that may fail it is only asked whether that is safe; empty where more is asked."""
        if self.live or not self.failing:
            return ""
        return (
            f"{listed(self.failing)}: without faults no transition is live here, so a fault takes nothing, and repair "
            "gives nothing"
        )

    @property
    def nets(self) -> dict[str, Net]:
        """The nets that the runs of the verdicts are of, by the names of these."""
        asked = (one for one in (self.for_good, self.following) if one is not None)
        return {family.name: one.loop.net for one in asked for family in one.families}

    def verdicts(self) -> Iterator[Verdict]:
        """The verdicts as they are told: what stands still after a fault, and what hangs, in one."""
        lasting, following = _answers_of(self.for_good), _answers_of(self.following)
        yield from (verdict for family, verdict in (*following, *lasting) if family.name == _SAFE)
        if self.for_good is not None:
            pairs = [one for one in lasting if one[0].name != _SAFE]
            for (family, still), (_, hang) in zip(pairs[::2], pairs[1::2], strict=True):
                yield _consequence(still, hang, self.for_good.of(family))
        yield from (verdict for family, verdict in following if family.name != _SAFE)


def _answers_of(asked: Answered | None) -> list[tuple[Family, Verdict]]:
    return [] if asked is None else list(zip(asked.families, asked.verdicts, strict=True))


def check_faults(report: LoopReport, model: PlantModel, budget: Budget | None = None) -> tuple[Verdict, ...]:
    """The verdicts on the faults that the plant file declares, none where it declares none.

    `report` is that of the loop without faults. Cost: one more exploration, of a loop with a place more for each
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
    for loop in (for_good, repaired):
        if told := difference(asked.loop.net, loop, repaired=loop is repaired):
            raise RuntimeError(f"a machine that fails is no longer one that takes longer: {told}")
    # Of a cell in which nothing is live, a fault takes nothing, and repair cannot give it back.
    following = [_recovery(asked, machine, live) for machine in repaired.failed] if live else []
    lasting = [*_standing_still(for_good, live)] if live else []
    if for_good.failed and (safe := _safe_without(asked)) is not None:
        following.insert(0, safe)
    elif for_good.failed:
        lasting.insert(0, _safe(for_good))
    stays = follows = None
    if lasting:
        begins("the cell of which a machine fails for good")
        stays = answers(for_good, lasting, budget, progress=progress, tell=tell, interrupted=interrupted)
    if following:
        follows = replace(asked, families=tuple(following))
    # Of what only may be live, nobody knows whether it is the fault that it cannot fire again.
    doubted = set(live).difference(known_live(asked))
    return FaultsAsked(
        live,
        tuple(for_good.failed),
        stays and stays.doubting(doubted, _IN_DOUBT),
        follows and follows.doubting(doubted, _IN_DOUBT),
    )


def _safe_without(asked: Answered) -> Family | None:
    """That no accident follows from a fault, where none can happen without; None where that is not known."""
    of: dict[str, Property | TemporalProperty] = {}
    for family in map(asked.family, (BUSY, ACCIDENTS)):
        if not all(verdict.holds for verdict in asked.of(family).values()):
            return None
        of[family.name] = family.of[""]
    return Family(_SAFE, _IS_SAFE, of)


def _safe(loop: ClosedLoop) -> Family:
    return Family(
        _SAFE,
        _IS_SAFE,
        # After an accident nothing fires: a machine that has failed then had failed before.
        {"": never("fault.accident", And((ENDED, any_of(map(Holds, loop.failed.values())))))},
        hint="a machine that takes longer leads there, too, so begin with loop.busy-machines and loop.accidents: gate "
        "what depends on a machine by its completion, not by a time",
    )


def _standing_still(loop: ClosedLoop, live: tuple[str, ...]) -> Iterator[Family]:
    for machine, failed in loop.failed.items():
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


def _recovery(asked: Answered, machine: str, live: tuple[str, ...]) -> Family:
    can_fire = asked.family(LIVE).of
    return Family(
        f"fault.{as_name(machine)}.repaired",
        f"after {machine} was repaired and goes on, all that is live without faults can fire again",
        {name: can_fire[name] for name in live},
    )
