"""The link: all that a host needs to know of how messages reach other hosts.

A link carries messages between machines (controllers and coordinators) by their names. It may lose them, deliver them
twice and in any order: repeats, epochs and deadlines are the protocol's and the host's, and would be done twice if a
link did them, too. What a link does promise: a message arrives as it was sent or not at all, from the peer that it
names, and only between hosts that hold the same bundle.

At each connection both sides say who they are (`Greeting`): the version of the protocol, the digest of the bundle and
the names of the machines. Whoever holds another bundle is refused, with a diagnostic that says so, and nothing of it
is delivered: two controllers of different nets could promise each other parts that do not exist. A refusal is told
once, with all machines of the host.

They also say what stable storage they have (`storages.py`): one that comes back without its own is refused (F5025), and
is told so. And they say whether anything moves there (`standing.py`).

Rejected: a link with acknowledged delivery. Its queue would hold old votes back behind a dead line and deliver them
late, which the protocol must withstand anyway; and an end-to-end acknowledgement is needed all the same (O5).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from firable.executor.links.standing import Standing
from firable.executor.links.storages import Estranged, Memory, Storage
from firable.executor.protocol.messages import Message
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

PROTOCOL_VERSION: Final = 7
"""Which messages there are, what they mean and what links put beside them; hosts of different versions do not talk."""

COORDINATOR: Final = ""
"""The name of a coordinator that has no other; no controller has the empty name."""


@dataclass(frozen=True, slots=True)
class Greeting:
    """Who a host is: the digest of its bundle, and the machines that it runs."""

    digest: str
    names: tuple[str, ...]
    version: int = PROTOCOL_VERSION


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a host is refused."""

    problem: Diagnostic
    are_unlike: bool = False
    """Whether the two hosts have another bundle or version: neither will let the other in with what it has."""
    run_by_two: tuple[str, ...] = ()
    """The machines that two hosts run."""


Arrival = tuple[str, str, Message, int]
"""A message, who says it to whom, and the age of the sender's storage: all that it rests on was durable by then."""


class LinkListener(Protocol):
    """Whom a link tells, always on the event loop that it runs on."""

    @property
    def memory(self) -> Memory:
        """What this host is known by, and knows others by, now."""
        ...

    @property
    def age(self) -> int:
        """How often the storage of this host was made durable, now: what a message that is sent now bears."""
        ...

    def arrived_together(self, messages: Sequence[Arrival]) -> None:
        """Messages have come, as by `arrived`; the link is in the midst of nothing, and they are acted upon at once."""
        ...

    def arrived(self, sender: str, receiver: str, message: Message, age: int) -> None:
        """A message has come; `sender` is a connected peer, `receiver` one of the own machines."""
        ...

    def connected(self, peer: str, storage: Storage) -> None:
        """The machine `peer` can be reached, has the same bundle, and hears this host; its host has this storage."""
        ...

    def lost(self, peer: str) -> None:
        """The machine `peer` can no longer be reached, or has been started anew, which `connected` says then."""
        ...

    def stands(self, peer: str, standing: Standing) -> None:
        """The host of `peer`, which is connected, stands or goes on again; nothing is said of one that goes on."""
        ...

    def refused(self, peers: Sequence[str], why: Refusal) -> None:
        """A host that says it runs these machines was refused, or refuses this one; nothing of it is delivered."""
        ...

    def gone(self, peers: Sequence[str]) -> None:
        """No host is there any more that says it runs just these machines and was refused by this one for that."""
        ...

    def disowned(self, peers: Sequence[str], why: Estranged) -> None:
        """The host of these machines refuses this one, because of what it knows of the storage of machines here."""
        ...


QUESTION: Final = "is its host started, and the address right?"
"""What there is to ask of a host that never comes, over most links."""


class Link(Protocol):
    """The way to the other hosts."""

    @property
    def question(self) -> str:
        """What there is to ask, of a host that was never reached."""
        ...

    @property
    def damaged(self) -> int:
        """How much that came was dropped, as it was damaged or no message."""
        ...

    async def run(self, listener: LinkListener) -> None:
        """Serve until cancelled; raises `InputError` F5021 where the link cannot be opened."""
        ...

    def send(self, sender: str, receiver: str, message: Message) -> None:
        """Hand over a message of one of the own machines, without waiting; it may be lost."""
        ...

    def stand(self, standing: Standing) -> None:
        """Have all that are or will be connected told whether this host lets anything move."""
        ...


def called(name: str) -> str:
    """A machine in a sentence.

    >>> called("robot"), called(COORDINATOR)
    ("'robot'", 'the coordinator')
    """
    return f"'{printable(name)}'" if name != COORDINATOR else "the coordinator"


def all_called(names: Iterable[str]) -> str:
    """The machines of a host in a sentence.

    >>> all_called(["mc", COORDINATOR])
    "'mc', the coordinator"
    """
    return ", ".join(map(called, names))


def objection(ours: Greeting, theirs: Greeting) -> Refusal | None:
    """Why a peer is refused (F5020), or None where it is not."""
    who = all_called(theirs.names) or "a host without machines"
    if theirs.version != ours.version:
        message = f"{who} speaks version {theirs.version} of the protocol, and this host version {ours.version}"
        hint = "install the same version of firable on all hosts of the cell"
        return Refusal(Diagnostic("F5020", message, hint), are_unlike=True)
    if theirs.digest != ours.digest:
        message = f"{who} holds another bundle: {printable(theirs.digest[:16])}…, and this host {ours.digest[:16]}…"
        hint = "give all hosts of the cell the same bundle file, and start them again"
        return Refusal(Diagnostic("F5020", message, hint), are_unlike=True)
    if both := sorted(set(ours.names) & set(theirs.names)):
        return run_by_two(both)
    return None


def run_by_two(machines: Sequence[str]) -> Refusal:
    """Why the second host of these machines is refused (F5020)."""
    message = f"{all_called(machines)} {'is' if len(machines) == 1 else 'are'} run by two hosts"
    hint = "each machine has one host: end one of the two"
    return Refusal(Diagnostic("F5020", message, hint), run_by_two=tuple(machines))


def come_back_without(why: Estranged) -> Refusal:
    """Why a host is refused that is not the one that was met (F5025)."""
    lacks = "what was kept there: the journal is another one, or there is none"
    if why.is_older:
        lacks = "the last that was kept there: the journal is an older copy"
    message = f"{all_called(why.machines)} came back without {lacks}"
    return Refusal(Diagnostic("F5025", message, _with_its_journal("it", why)))


def known_otherwise(why: Estranged, peers: Iterable[str]) -> Diagnostic:
    """Why the host of these machines refuses this one (F5025)."""
    who, by = all_called(why.machines), f"the host of {all_called(peers)}"
    message = f"{by} has worked with another journal of {who} than this host has"
    if why.is_older:
        message = f"{by} has worked with a later state of the journal of {who}: this host has an older copy"
    return Diagnostic("F5025", message, _with_its_journal("this host", why))


def _with_its_journal(host: str, why: Estranged) -> str:
    journal = "the journal as it was last, not a copy of before" if why.is_older else "the journal that it had"
    return (
        f"start {host} with {journal} (--journal); where that is lost, bring the cell to its initial "
        "marking, and start all hosts anew, each with a new journal"
    )


def has_failed(what: str, reason: str) -> InputError:
    """The end of a link that was open (F5021)."""
    hint = "mend it, and start this host again: with its journal it goes on where it was"
    return InputError([Diagnostic("F5021", f"the link {printable(what)} has failed: {printable(reason)}", hint)])


def cannot_open(what: str, reason: str) -> InputError:
    """The refusal of a link that does not come up (F5021)."""
    message = f"the link {printable(what)} cannot be opened: {printable(reason)}"
    hint = "name an address that this host has, and end the program that uses it, if one does"
    return InputError([Diagnostic("F5021", message, hint)])
