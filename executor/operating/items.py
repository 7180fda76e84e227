"""What the machines of a host are given: messages, what drivers say, and a controller's turn to fire."""

from __future__ import annotations

from firable.executor.protocol.messages import Message
from firable.executor.protocol.record import record


@record
class SignalRead:
    """A driver's word to a controller: a new value of one of its signals."""

    signal: str
    value: bool
    entry: int | None


@record
class CommandTaken:
    """A driver's word to a controller: the machine has the command of one of its places."""

    place: str
    entry: int


Item = Message | SignalRead | CommandTaken | None
"""What a machine is given; None is a controller's turn to fire."""
