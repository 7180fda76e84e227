"""What waits for whom between the machines of a cell, in sentences: asked of the machines of one host, told to people.

A promise waits for a decision, an undecided round for votes, a decided one for its parts, a controller that leaves for
the word that no order is open. That is all that can wait for another host; what waits for a token or a gate is in
`situation.py`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from firable.executor.links.link import called
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator


def waits(
    coordinators: Mapping[str, Coordinator], controllers: Mapping[str, LocalController], away: Collection[str]
) -> Iterator[str]:
    """What waits for another machine, in a sentence each; `away` are the machines that are not connected."""
    for coordinator in coordinators.values():
        for opened in coordinator.rounds.values():
            if opened.decided and opened.committed is None:
                continue  # nothing has fired, and nothing needs to
            what = opened.committed or " or ".join(opened.transitions)
            for name in coordinator.ordered(opened) if opened.decided else opened.participants:
                if opened.decided and name not in opened.acknowledged:
                    yield f"{what} has fired, and waits for {reached(name, away)} to apply it"
                elif not opened.decided and name not in opened.votes:
                    yield f"{what} waits for the vote of {reached(name, away)}"
    for name, controller in controllers.items():
        for number, promise in controller.promises.items():
            if promise.promised:
                what, decider = " or ".join(sorted(promise.promised)), controller.coordinator_of(number)
                yield f"{called(name)} has promised {what}, and waits for {reached(decider, away)} to decide"
        for above in controller.awaited:
            if above not in coordinators and above not in away:
                yield f"{called(name)} has taken its votes back, and waits for {called(above)} to say that none is used"
        if controller.held:
            yield f"{called(name)} is held, until it is resumed"


def reached(name: str, away: Collection[str]) -> str:
    """A machine in a sentence, and whether it can be reached.

    >>> reached("robot", {"robot"}), reached("mc", {"robot"})
    ("'robot' (not connected)", "'mc'")
    """
    return f"{called(name)} (not connected)" if name in away else called(name)
