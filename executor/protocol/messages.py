"""What controllers and their coordinator say to each other, and what the protocol machines do besides talking.

The protocol is the voting of the paper with the obligations of SEMANTICS, "Decomposition":

1. Each controller tells which of its parts are enabled (`Report`, also attached to votes and acknowledgements). This is
   a *hint*: it only says when asking is worth while, and nothing is ever fired on it.
2. Where the hints of all participants say yes, the coordinator opens a *round* over the transitions of one arbitration
   group and asks their participants for promises (`VoteRequest`). A vote answers for each part; each yes is a promise
   (O1).
3. Of the transitions with all votes yes, the arbiter of the group chooses one (O2). The decision, commit or abort, goes
   to all who were asked, is applied once, and is repeated until acknowledged (O5). It releases the promises.

Parts that are *free of promise* (`Decomposition.free`) are not asked: their readiness is a vote that stands until an
order for them is applied, and no hint. So a transition of which all parts are free is decided at once. What makes such
a vote count is said in `executor/protocol/coordinator.py`, and why it may, in docs/protocol-invariant.md.

Rejected: promises given unasked, as soon as a part is enabled. Two parts of one controller in conflict could then
hold each other's transitions up for ever, each promised where the other is needed.

A controller whose host is about to end takes its votes back: its *last* report names nothing, and asks for the word
that no order is open, which `Hello` gives. Until then an order that was decided before may come, and is obeyed.

`closed_below` lets a controller forget: every round with a smaller number is decided and acknowledged by all, so
that whatever still arrives of it is an old copy. `seen` tells which report has arrived, so that only lost ones are
repeated. Messages may be lost, delayed, doubled and overtaken; none is trusted for more than its round.

Every message is between a controller and one `coordinator`; where the net has layers there are several, and each of
them is told of its own transitions only (`firable.executor.protocol.deciders`).

Whoever restarts begins a new *epoch*, and every number that it gives has the epoch in its high bits, so that none is
ever given twice although not one of them is stored. A coordinator that has restarted knows which rounds it committed
and nothing else: rounds of earlier epochs that it does not know are aborted (*presumed abort*), and it says `Hello`
until the controllers have told it anew what is enabled. `executor/protocol/controller.py` and `coordinator.py` say what
each keeps in stable storage, and why that is enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from firable.executor.protocol.deciders import TOP
from firable.executor.protocol.record import record

EPOCH_BITS: Final = 32
"""A number is `epoch << EPOCH_BITS` and a count: 4 thousand million rounds before an epoch would run into the next."""

Stored = bool | int | float | str | Sequence["Stored"] | Mapping[str, "Stored"]
"""What stable storage holds under a key: JSON, without null, which deletes."""


@record
class Readiness:
    """The coordinated transitions whose parts are enabled in a controller now; a larger sequence number is newer.

    `epoch` is that of the coordinator, as the controller knew it.
    """

    sequence: int
    transitions: frozenset[str]
    epoch: int = 0


@record
class Report:
    """A controller's readiness has changed.

    `last`: it is leaving, nothing of it counts any more, and it waits for the word that no round needs it.
    """

    controller: str
    readiness: Readiness
    coordinator: str = TOP
    last: bool = False


@record
class VoteRequest:
    """The coordinator asks a controller to promise its parts of these transitions, as far as they are enabled."""

    controller: str
    round: int
    transitions: tuple[str, ...]
    closed_below: int
    seen: int
    epoch: int = 0
    coordinator: str = TOP


@record
class Vote:
    """The answer: yes (a promise) for the parts of `promised`, no for the others asked for."""

    controller: str
    round: int
    promised: frozenset[str]
    readiness: Readiness
    coordinator: str = TOP


@record
class Decision:
    """The round is decided: `committed` fires, or nothing does where it is None; all promises of the round end."""

    controller: str
    round: int
    committed: str | None
    closed_below: int
    seen: int
    epoch: int = 0
    coordinator: str = TOP


@record
class Hello:
    """The coordinator has restarted, and knows nothing of this controller: which of its parts are enabled?

    With the number of a last report in `seen` it says that it has heard it, and that no round needs its controller.
    """

    controller: str
    closed_below: int
    seen: int
    epoch: int
    coordinator: str = TOP


@record
class Acknowledgement:
    """The controller has applied the decision of the round."""

    controller: str
    round: int
    readiness: Readiness
    coordinator: str = TOP


ToController = VoteRequest | Decision | Hello
"""Messages from a coordinator; `controller` is the receiver."""

ToCoordinator = Report | Vote | Acknowledgement
"""Messages to a coordinator; `controller` is the sender."""

Message = ToController | ToCoordinator


@record
class Firing:
    """A transition of the central net fires now: a local one in its controller, another at the coordinator's commit."""

    transition: str


@record
class Taken:
    """A controller takes a new value of a signal into its process image; from now on gates read it."""

    signal: str
    value: bool


@record
class Sending:
    """The command of `place` goes to its machine; `entry` counts the commands that share its completion signal.

    With `again`, it was issued before the restart, and the machine has said that it did not receive it.
    """

    place: str
    entry: int
    again: bool = False


@record
class Keep:
    """A write to stable storage; None deletes.

    The writes of one act, the effects of one call, are one batch: all of them are stored or none. Nothing of the act
    leaves before its batch is durable, neither messages nor commands nor lines of the trace.
    """

    key: str
    value: Stored | None


Effect = Message | Firing | Taken | Sending | Keep
"""What a protocol machine wants done, in this order."""


class ProtocolError(RuntimeError):
    """A machine was told something that the protocol excludes: a fault of the program, never of its user."""
