"""Taking up a run after a restart: what became of each command is asked, and nothing moves before an operator says so.

The controllers come back from the journal *held* (`protocol.controller`). For every command that was issued and is not
known to be over, the driver is asked. *Done*: the completion is taken in. *Working*: it will come. *Not received*: it
is sent when the run is resumed, under the number it has; but where the machine had taken it, it was switched off since,
and that is *unknown*, too. *Unknown*: only a person who looks at the machine can tell, and until somebody has, the run
cannot be resumed. A guess would be a command given twice, or never.

What a person says counts only where the driver does not know: machines are believed before people. But where a machine
is not where the journal has it (`whereabouts.py`), it is asked nothing until a person has said that it is that one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.link import called
from firable.executor.operating.dispatch import was_taken
from firable.executor.protocol.commands import Answer

if TYPE_CHECKING:
    from firable.executor.operating.host import Host
    from firable.executor.operating.whereabouts import Elsewhere

UNASKED: Final = "unasked"
"""The kind of note of what was said of a command that nobody asked after."""

UNKEPT: Final = "it has no journal to be taken up by: bring the cell to its initial marking before it is run again"
"""What there is to do where a run has ended that is held, and nothing keeps where."""

_TELLS: Final = {
    Answer.DONE: "is done",
    Answer.WORKING: "is being done",
    Answer.NOT_RECEIVED: "has not reached its machine, and will be sent when the run is resumed",
    Answer.UNKNOWN: "was issued, and nobody knows what became of it",
}
_VOID: Final = "was given up, its token has gone on: it is not sent again"


@dataclass
class TakingUp:
    """Whether the operator has resumed it beforehand, and what the drivers have answered."""

    resume: bool
    """Whether to resume as soon as nothing is uncertain, unless the run is paused by then."""
    answers: dict[str, Answer] = field(default_factory=dict)
    """For each place whose command was asked after."""
    is_final: bool = False
    """Whether everything has been asked."""
    are_these: asyncio.Event = field(default_factory=asyncio.Event)
    """Set where machines are elsewhere, and somebody has said that these are the machines."""


async def take_up(run: Host, found: TakingUp) -> None:
    """Ask after each command; then resume, if that was said beforehand and nothing is uncertain.

    A host among others waits until it has met one of them, who knows whether its journal is the right one (`peers.py`);
    an operator who resumes it before sees where it stands. A pause or a stop meanwhile takes back what was said
    beforehand: then only the operator's resume ends the hold.
    """
    if run.elsewhere is not None:
        run.told("held", _are_elsewhere(run, run.elsewhere))
        if not (run.operated or run.served):
            await _end_by_telling(run, found)
            return
        await found.are_these.wait()
    for name, controller in run.controllers.items():
        for place, entry in controller.commands.questions:
            answer = Answer((await run.driver.ask(run.net.place(place), entry)).value)
            if answer is Answer.NOT_RECEIVED and not _is_void(run, place) and was_taken(run.journal, place, entry):
                answer = Answer.UNKNOWN
                run.told("held", f"the machine of '{place}' had taken its command, and knows nothing of it any more")
            if answer is Answer.UNKNOWN:
                answer = run.said.get(place, answer)
            found.answers[place] = answer
            run.note("asked after", place=place, answer=answer.value)
            run.answer(name, place, entry, answer)
            if answer is Answer.UNKNOWN:
                run.told("held", f"nobody knows what became of the command of '{place}': look, and say it")
    tell_unasked(run, found.answers)
    goes_on = found.resume and not uncertain(run)
    if not (goes_on or run.operated or run.served):  # then the run ends by telling how the cell stands
        await run.driver.met()
    await run.quiet()
    if run.is_over:  # by an error: nothing is resumed any more
        return
    found.is_final = True
    if found.resume and run.peers.nobody_met:
        run.told(
            "held", "it is resumed when another host of the cell has been met: until then it may have another journal"
        )
        await run.peers.somebody()
        if run.taking_up is not found:
            return
    if not found.resume or run.paused or not run.resume():  # paused: as it is after a stop or a fault, too
        for name, controller in run.controllers.items():
            if controller.held:
                run.told("held", f"{called(name)} is held, until it is resumed")
    run.moved()


async def _end_by_telling(run: Host, found: TakingUp) -> None:
    """End a hold of which nobody here can say whether these are the machines, as a run of a whole cell does."""
    await run.driver.met()
    await run.quiet()
    if not run.is_over:
        found.is_final = True
        run.moved()


def found_again(run: Host, found: TakingUp, elsewhere: Elsewhere) -> None:
    """Somebody has said that these are the machines: the journal has them here, and they are asked."""
    elsewhere.keep(run.journal)
    run.elsewhere = None
    run.told("found again", "the operator has said that these are the machines: the journal has them here now")
    found.resume = True
    found.are_these.set()


def _are_elsewhere(run: Host, elsewhere: Elsewhere) -> str:
    """Which machines are elsewhere, and what there is to do."""
    todo = "if they are the same machines, resume; if not, stop and name another journal"
    if not (run.operated or run.served):
        attended = "--serve or --step" if run.is_whole else "--serve"
        todo = f"--resume does not count: if they are the same machines, start with {attended} and resume there"
        todo += "; if not, name another journal"
    return "; ".join((*elsewhere.sentences(), todo))


def tell_unasked(run: Host, asked: Collection[str]) -> None:
    """Tell of what was said of commands that nobody asked after: whoever said it believes that it counts."""
    for place in run.said:
        if place not in asked:
            run.told(UNASKED, f"nobody asked after {place}: what is said of it changes nothing")


def say(run: Host, place: str, answer: Answer) -> tuple[str, ...]:
    """Take the operator's word on a command of which no machine can tell; why not, where nobody asks after it (yet)."""
    found, asked_after = run.taking_up, asked_of_the_operator(run)
    if found is None or place not in asked_after:
        others = f"; to be said is what became of {', '.join(asked_after)}" if asked_after else ""
        return (f"nobody asks after {place}{others}",)
    found.answers[place] = answer
    for name, controller in run.controllers.items():
        for asked, entry in controller.commands.questions:
            if asked == place:
                run.note("said", place=place, answer=answer.value)
                run.answer(name, place, entry, answer)
    return ()


def release(run: Host) -> None:
    """End the hold: what is owed is sent, and what is enabled fires."""
    run.taking_up = None
    run.recorder.may_write = True
    run.note("taken up")
    for name, controller in run.controllers.items():
        run.acts.act(name, controller.resume())
        run.acts.post(name, None)


def uncertain(run: Host) -> list[str]:
    """The places with a command of which nobody knows what became of it."""
    return [place for controller in run.controllers.values() for place, _ in controller.commands.questions]


def asked_of_the_operator(run: Host) -> list[str]:
    """The places of whose commands somebody must tell: their machines have been asked, and none could."""
    found = run.taking_up
    return [] if found is None or not found.is_final or run.stopping else uncertain(run)


def told(run: Host, found: TakingUp) -> str:
    """The hold in words: each command that is not over, and what there is to do."""
    lines = ["the run was interrupted, and is taken up where it was; nothing moves until it is resumed"]
    if run.elsewhere is not None:
        return "; ".join((*lines, _are_elsewhere(run, run.elsewhere)))
    for place, answer in found.answers.items():
        tells = _VOID if answer is Answer.NOT_RECEIVED and _is_void(run, place) else _TELLS[answer]
        lines.append(f"'{run.net.place(place).command}' of '{place}' {tells}")
    owed = [place for controller in run.controllers.values() for place, _ in controller.commands.owed]
    for place in owed:
        if place not in found.answers and not _is_void(run, place):
            lines.append(f"'{run.net.place(place).command}' of '{place}' was decided and not sent; it will be")
    if (run.stopping or not (run.served or run.operated)) and isinstance(run.journal, MemoryJournal):
        lines.append(UNKEPT)
    elif found.is_final and (open_ := uncertain(run)):
        how = "say" if run.served and not run.stopping else "--say"
        lines.append(f"look at the machine and say what it did: {how} {open_[0]}=done, =working or =not-received")
    return "; ".join(lines)


def _is_void(run: Host, place: str) -> bool:
    """Whether the token of a command has gone on, as by a time limit: what has not reached its machine is not sent."""
    controllers = (of for of in run.controllers.values() if place in of.subnet.place_index)
    return not any(of.word & 1 << of.subnet.place_index[place] for of in controllers)
