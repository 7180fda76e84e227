"""The link: all that a host needs to know of how messages reach other hosts.

A link carries messages between machines (controllers and coordinators) by their names. It may lose them, deliver them
twice and in any order: repeats, epochs and deadlines are the protocol's and the host's, and would be done twice if a
link did them, too. What a link does promise: a message arrives as it was sent or not at all, from the peer that it
names, and only between hosts that hold the same bundle.

At each connection both sides say who they are (`Greeting`): the version of the protocol, the digest of the bundle and
the names of the machines. Whoever holds another bundle is refused, with a diagnostic that says so, and nothing of it
is delivered: two controllers of different nets could promise each other parts that do not exist.

They also say what stable storage they have (`Memory`), which a host remembers of each machine that it has met. One that
comes back with another storage, a journal mistyped or left out, does not know where its tokens stand: it would begin at
the places of the start, beside machines and controllers that are somewhere else. It is refused (F5025), and is told so.

Rejected: a link with acknowledged delivery. Its queue would hold old votes back behind a dead line and deliver them
late, which the protocol must withstand anyway; and an end-to-end acknowledgement is needed all the same (O5).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

from firable.executor.protocol.messages import Message
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

PROTOCOL_VERSION: Final = 5
"""Which messages there are and what they mean; hosts of different versions do not talk."""

COORDINATOR: Final = ""
"""The name of a coordinator that has no other; no controller has the empty name."""


@dataclass(frozen=True, slots=True)
class Greeting:
    """Who a host is: the digest of its bundle, and the machines that it runs."""

    digest: str
    names: tuple[str, ...]
    version: int = PROTOCOL_VERSION


@dataclass(frozen=True, slots=True)
class Memory:
    """What hosts know each other by: what this host's stable storage is called, and those of the machines it has met.

    A storage gets its name, at random, when it is made. That of a host without a journal is gone with its process.
    """

    storage: str = ""
    known: Mapping[str, str] = field(default_factory=dict)
    """For each machine that was met, the storage of its host."""

    def met_otherwise(self, machines: Iterable[str], by: Memory) -> list[str]:
        """Of these machines of this host, those that another one has met with another storage."""
        return [machine for machine in machines if by.known.get(machine, self.storage) != self.storage]


Arrival = tuple[str, str, Message]
"""A message and who says it to whom."""


class LinkListener(Protocol):
    """Whom a link tells, always on the event loop that it runs on."""

    @property
    def memory(self) -> Memory:
        """What this host is known by, and knows others by, now."""
        ...

    def arrived_together(self, messages: Sequence[Arrival]) -> None:
        """Messages have come, as by `arrived`; the link is in the midst of nothing, and they are acted upon at once."""
        ...

    def arrived(self, sender: str, receiver: str, message: Message) -> None:
        """A message has come; `sender` is a connected peer, `receiver` one of the own machines."""
        ...

    def connected(self, peer: str, storage: str) -> None:
        """The machine `peer` can be reached, has the same bundle, and hears this host; its host has this storage."""
        ...

    def lost(self, peer: str) -> None:
        """The machine `peer` can no longer be reached, or has been started anew, which `connected` says then."""
        ...

    def refused(self, peer: str, problem: Diagnostic) -> None:
        """A host that calls itself `peer` was refused, or refuses this one; nothing of it is delivered."""
        ...

    def disowned(self, peer: str, problem: Diagnostic) -> None:
        """The host of `peer` refuses this one, because it has met a machine here with another storage."""
        ...


class Link(Protocol):
    """The way to the other hosts."""

    async def run(self, listener: LinkListener) -> None:
        """Serve until cancelled; raises `InputError` F5021 where the link cannot be opened."""
        ...

    def send(self, sender: str, receiver: str, message: Message) -> None:
        """Hand over a message of one of the own machines, without waiting; it may be lost."""
        ...


def called(name: str) -> str:
    """A machine in a sentence.

    >>> called("robot"), called(COORDINATOR)
    ("'robot'", 'the coordinator')
    """
    return f"'{printable(name)}'" if name != COORDINATOR else "the coordinator"


def objection(ours: Greeting, theirs: Greeting) -> Diagnostic | None:
    """Why a peer is refused (F5020), or None where it is not."""
    who = ", ".join(map(called, theirs.names)) or "a host without machines"
    if theirs.version != ours.version:
        message = f"{who} speaks version {theirs.version} of the protocol, and this host version {ours.version}"
        return Diagnostic("F5020", message, "install the same version of firable on all hosts of the cell")
    if theirs.digest != ours.digest:
        message = f"{who} holds another bundle: {printable(theirs.digest[:16])}…, and this host {ours.digest[:16]}…"
        return Diagnostic("F5020", message, "give all hosts of the cell the same bundle file, and start them again")
    if both := sorted(set(ours.names) & set(theirs.names)):
        return run_by_two(both)
    return None


def run_by_two(machines: Iterable[str]) -> Diagnostic:
    """Why the second host of these machines is refused (F5020)."""
    message = f"{', '.join(map(called, machines))} is run by two hosts"
    return Diagnostic("F5020", message, "each machine has one host: end one of the two")


def come_back_without(machines: Iterable[str]) -> Diagnostic:
    """Why the host of these machines is refused, which were met with another storage (F5025)."""
    who = ", ".join(map(called, machines))
    message = f"{who} came back without what was kept there: the journal is another one, or there is none"
    return Diagnostic("F5025", message, _with_its_journal("it"))


def known_otherwise(machines: Iterable[str], peer: str) -> Diagnostic:
    """Why the host of `peer` refuses this one, with these machines (F5025)."""
    message = f"{called(peer)} has worked with another journal of {', '.join(map(called, machines))} than this host has"
    return Diagnostic("F5025", message, _with_its_journal("this host"))


def _with_its_journal(host: str) -> str:
    return (
        f"start {host} with the journal that it had (--journal); where that is lost, bring the cell to its initial "
        "marking, and start all hosts anew, each with a new journal"
    )


def cannot_open(what: str, reason: str) -> InputError:
    """The refusal of a link that does not come up (F5021)."""
    message = f"the link {printable(what)} cannot be opened: {printable(reason)}"
    hint = "name an address that this host has, and end the program that uses it, if one does"
    return InputError([Diagnostic("F5021", message, hint)])
