"""Mailboxes: all that the tasks of an execution share, and the messages in them that are not of the protocol.

Whoever posts does not wait, so every act ends before the next begins. `asyncio.Queue` was rejected: it also bounds and
joins, for many readers; a mailbox has one.
"""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SignalRead:
    """A driver's message to a controller: a new value of one of its signals."""

    signal: str
    value: bool
    entry: int | None


@dataclass(frozen=True, slots=True)
class CommandTaken:
    """A driver's message to a controller: the machine has the command of one of its places."""

    place: str
    entry: int


class Continue:
    """A controller's message to itself: it may have more to fire."""


class Mailbox:
    """Messages for one task, in the order in which they were posted."""

    def __init__(self) -> None:
        self.items: deque[object] = deque()
        self.waiter: asyncio.Future[None] | None = None

    def post(self, item: object) -> None:
        """Put a message behind the others, and wake the task that waits."""
        self.items.append(item)
        if self.waiter is not None and not self.waiter.done():
            self.waiter.set_result(None)

    async def wait(self) -> None:
        """Wait until there is a message."""
        if not self.items:
            self.waiter = asyncio.get_running_loop().create_future()
            await self.waiter
