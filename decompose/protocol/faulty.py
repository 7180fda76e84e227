"""The faults as steps: a message is lost or doubled, a controller or a coordinator crashes and starts again.

A fault that may happen once takes its token from a place of its own, so that all runs with at most one such fault are
runs of the one net. Faults that may happen again and again do so as long as `faults-go-on` holds a token, and at some
time they cease: so what is possible *after* faults is not mistaken for what is possible by means of them, as the loss
of a message that is in the way. Delay and overtaking need no step: each message has a channel of its own, and waits
there for as long as it likes.

A message that is doubled arrives once as it would have, and a copy is *late*. Within its round a second copy is what
the sender does anyway, by repeating; so a late copy is one that comes when its round is over. With its number it is
ignored, whatever it says, and so one place holds a token while any such copy is on its way; without, it is taken for a
message of the present round, and each channel has a place for late copies of its own.

Who crashes does nothing until the restart. Everything that the protocol says of them is in stable storage (O6), so a
restart changes nothing; messages to them wait, or are lost. A coordinator that starts again may give up what it had not
decided, and go on with what it had: it may do both at any time anyway. Where promises are not stable, a controller that
is down may lose any of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from firable.decompose.protocol.draft import Draft, Step, at, coordinator_down, down, late
from firable.decompose.protocol.parts import Part, Parts
from firable.decompose.protocol.variant import Faults, Often
from firable.nets.layers import COORDINATOR

WORDS: Final = {
    "request": "the request for {t} to {c}",
    "vote": "the yes of {c} on {t}",
    "commit-order": "the order for {t} to {c}",
    "abort-order": "the order to give up {t} to {c}",
    "acknowledgement": "the acknowledgement of {c} on {t}",
}
"""What each message is called."""

KINDS: Final = ("loss", "duplication", "crash", "coordinator")

GO_ON: Final = "faults-go-on"
"""Faults that may happen again and again have not ceased."""

IGNORED: Final = "late-copy-of-old-round"
"""A copy of a message of an older round is on its way, and will be ignored."""


def declare_faults(draft: Draft, parts: Parts, faults: Faults, channels: Iterable[str]) -> None:
    """Add the places of the faults that belong to no part: what may still happen, and who is down."""
    for kind in KINDS:
        if getattr(faults, kind) is Often.ONCE:
            draft.place(budget(kind), marked=True)
    if any(getattr(faults, kind) is Often.ALWAYS for kind in KINDS):
        draft.place(GO_ON, marked=True)
    if faults.duplication and any(is_numbered(parts, channel) for channel in channels):
        draft.place(IGNORED)
    if faults.coordinator:
        for coordinator in crashing_coordinators(parts, faults):
            draft.place(coordinator_down(coordinator))
    if faults.crash:
        for controller in crashing(parts, faults):
            draft.place(down(controller))


def budget(kind: str) -> str:
    """The place that holds a token as long as the one fault of a kind may still happen."""
    return f"may-happen/{kind}"


def crashing(parts: Parts, faults: Faults) -> tuple[str, ...]:
    """The controllers that may crash."""
    names = tuple(subnet.name for subnet in parts.decomposition.subnets)
    return (faults.doomed,) if faults.doomed else names


def crashing_coordinators(parts: Parts, faults: Faults) -> tuple[str, ...]:
    """The coordinators that may crash, as `Parts.decider` names them."""
    return (faults.doomed,) if faults.doomed else parts.deciders


def add_faults(draft: Draft, parts: Parts, faults: Faults, channels: Callable[[Part], Iterable[str]]) -> None:
    """Add the steps of every fault that may happen; `channels` are those of each part."""

    def taken(kind: str) -> list[str]:
        return [budget(kind)] if getattr(faults, kind) is Often.ONCE else []

    def allowed(kind: str) -> list[str]:
        return [GO_ON] if getattr(faults, kind) is Often.ALWAYS else []

    if GO_ON in draft.places:
        draft.step("cease", Step("cease", "no fault happens from now on"), [GO_ON])

    for part in (part for its in parts.coordinated.values() for part in its):
        for channel in channels(part):
            message, words = at(channel, part), WORDS[channel].format(t=part.whole, c=part.controller)
            if faults.loss:
                draft.step(
                    f"lose/{message}", Step("lose", f"{words} is lost"), [message, *taken("loss")], (), allowed("loss")
                )
            if faults.duplication:
                copy = IGNORED if is_numbered(parts, channel) else late(message)
                twice = Step("double", f"{words} is doubled, and the copy is late")
                needed = [message, *allowed("duplication")]
                draft.step(f"double/{message}", twice, taken("duplication"), [copy], needed, [copy])
                if copy != IGNORED:
                    obeyed = Step("late", f"the late copy of {words} comes, as if it were of this round")
                    draft.step(f"late-copy/{message}", obeyed, [copy], [message], (), [message])
    if IGNORED in draft.places:
        ignored = Step("late", "the late copy arrives, and is ignored for the number of its round")
        draft.step("late-copy", ignored, [IGNORED])
    stops = "stops" if faults.restart else "stops for ever"
    if faults.crash:
        for controller in crashing(parts, faults):
            crash = Step("crash", f"{controller} {stops}", controller)
            here = [down(controller)]
            draft.step(f"crash/{controller}", crash, taken("crash"), here, allowed("crash"), here)
            if faults.restart:
                again = Step("restart", f"{controller} starts again", controller)
                draft.step(f"restart/{controller}", again, [down(controller)])
            if not parts.variant.stable:
                _forget(draft, [part for its in parts.coordinated.values() for part in its], controller)
    if faults.coordinator:
        for coordinator in crashing_coordinators(parts, faults):
            here = [coordinator_down(coordinator)]
            crash = Step("crash", f"{coordinator} {stops}", coordinator=coordinator)
            name = "" if coordinator == COORDINATOR else f"/{here[0]}"
            draft.step(f"crash{name}", crash, taken("coordinator"), here, allowed("coordinator"), here)
            if faults.restart:
                again = Step("restart", f"{coordinator} starts again", coordinator=coordinator)
                draft.step(f"restart{name}", again, here)


def is_numbered(parts: Parts, channel: str) -> bool:
    """Whether messages of a kind carry the number of their round."""
    if channel in {"request", "vote"}:
        return parts.variant.vote_rounds
    return parts.variant.order_rounds or channel != "commit-order"


def _forget(draft: Draft, parts: Iterable[Part], controller: str) -> None:
    for part in parts:
        if part.controller == controller and not part.free:  # a yes that promises nothing rests on the marking alone
            forget = Step("forget", f"{controller} forgets in the crash that it promised {part.whole}", controller)
            draft.step(f"forget/{part.whole}/{controller}", forget, [at("promised", part)], (), [down(controller)])
