"""The link: all that a host needs to know of how messages reach other hosts.

A link carries messages between machines (controllers and coordinators) by their names. It may lose them, deliver them
twice and in any order: repeats, epochs and deadlines are the protocol's and the host's, and would be done twice if a
link did them, too. What a link does promise: a message arrives as it was sent or not at all, from the peer that it
names, and only between hosts that hold the same bundle.

At each connection both sides say who they are (`Greeting`): the version of the protocol, the digest of the bundle and
the names of the machines. Whoever holds another bundle is refused, with a diagnostic that says so, and nothing of it
is delivered: two controllers of different nets could promise each other parts that do not exist.

They also say what stable storage they have (`Storage`), which a host remembers of each machine that it has met. One
that comes back with another storage, a journal mistyped or left out, does not know where its tokens stand: it would
begin at the places of the start, beside machines and controllers that are somewhere else. One that comes back with an
*older copy* of its storage, from a backup, would go on from where its tokens stood then. Either is refused (F5025), and
is told so.

A copy is known by its *age*. A storage counts how often it was made durable, each message bears that count, and nothing
leaves a host before what it rests on is durable. So the count of a storage that has all that anybody has heard of is
not below the last one heard. What nobody has heard of, a transition that a controller fired alone behind its last
message, is missed by nobody: of that only the machines know, and they are asked. The count is no history: of two copies
that were both worked with, one after the other and the first unheard, it tells only which has more in it.

Rejected: an age that only the greeting bears. A copy may have been made since, in the very life that has lost the
original. Rejected, too: the last round that was acknowledged in place of a count. It would be the protocol's, and would
know nothing of what a controller does alone between two rounds.

Rejected: a link with acknowledged delivery. Its queue would hold old votes back behind a dead line and deliver them
late, which the protocol must withstand anyway; and an end-to-end acknowledgement is needed all the same (O5).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol, Self

from firable.executor.protocol.messages import Message
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

PROTOCOL_VERSION: Final = 6
"""Which messages there are, what they mean and what links put beside them; hosts of different versions do not talk."""

COORDINATOR: Final = ""
"""The name of a coordinator that has no other; no controller has the empty name."""


@dataclass(frozen=True, slots=True)
class Greeting:
    """Who a host is: the digest of its bundle, and the machines that it runs."""

    digest: str
    names: tuple[str, ...]
    version: int = PROTOCOL_VERSION


_JOINED: Final = "-"
_COUNT: Final = re.compile("[0-9]{1,19}", re.ASCII)


@dataclass(frozen=True, slots=True)
class Storage:
    """What the stable storage of a host is known by; where text is needed it is spelled NAME-LIFE-AGE.

    That of a host without a journal is gone with its process.

    >>> str(Storage("5eed", "1a", 7)), Storage.read("5eed-1a-7").age, Storage.read("5eed")
    ('5eed-1a-7', 7, Storage(name='5eed', life='', age=0))
    """

    name: str = ""
    """Given at random when it was made."""
    life: str = ""
    """Given at random in each life of the host. Within one life nobody can have put a copy in its place."""
    age: int = 0
    """How often it was made durable before that life, or when it was last heard of."""

    def __str__(self) -> str:
        return _JOINED.join((self.name, self.life, str(self.age)))

    @classmethod
    def read(cls, text: str) -> Self:
        """The storage of a text of ours; of any other text one that knows of nothing."""
        name, _, rest = text.partition(_JOINED)
        life, _, age = rest.partition(_JOINED)
        return cls(name, life, int(age) if _COUNT.fullmatch(age) else 0)


@dataclass(frozen=True, slots=True)
class Estranged:
    """Machines of a host that another one has met with another storage, or has heard later things of."""

    machines: tuple[str, ...]
    is_older: bool
    """Whether it is the same storage as it was before that: a copy."""


@dataclass(frozen=True, slots=True)
class Memory:
    """What hosts know each other by: this host's stable storage, and those of the machines it has met."""

    storage: Storage = Storage()
    known: Mapping[str, Storage] = field(default_factory=dict)
    """For each machine that was met, the storage of its host."""

    def estranged(self, machines: Iterable[str], storage: Storage) -> Estranged | None:
        """Why the host of these machines, with this storage, is not the one that was met; None where it may be."""
        met = {machine: self.known[machine] for machine in machines if machine in self.known}
        if others := tuple(machine for machine, known in met.items() if known.name != storage.name):
            return Estranged(others, is_older=False)
        if later := tuple(m for m, known in met.items() if known.life != storage.life and known.age > storage.age):
            return Estranged(later, is_older=True)
        return None


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

    def refused(self, peer: str, problem: Diagnostic) -> None:
        """A host that calls itself `peer` was refused, or refuses this one; nothing of it is delivered."""
        ...

    def disowned(self, peer: str, why: Estranged) -> None:
        """The host of `peer` refuses this one, because of what it knows of the storage of machines here."""
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


def come_back_without(why: Estranged) -> Diagnostic:
    """Why a host is refused that is not the one that was met (F5025)."""
    lacks = "what was kept there: the journal is another one, or there is none"
    if why.is_older:
        lacks = "the last that was kept there: the journal is an older copy"
    message = f"{', '.join(map(called, why.machines))} came back without {lacks}"
    return Diagnostic("F5025", message, _with_its_journal("it", why))


def known_otherwise(why: Estranged, peer: str) -> Diagnostic:
    """Why the host of `peer` refuses this one (F5025)."""
    who = ", ".join(map(called, why.machines))
    message = f"{called(peer)} has worked with another journal of {who} than this host has"
    if why.is_older:
        message = f"{called(peer)} has worked with a later state of the journal of {who}: this host has an older copy"
    return Diagnostic("F5025", message, _with_its_journal("this host", why))


def _with_its_journal(host: str, why: Estranged) -> str:
    journal = "the journal as it was last, not a copy of before" if why.is_older else "the journal that it had"
    return (
        f"start {host} with {journal} (--journal); where that is lost, bring the cell to its initial "
        "marking, and start all hosts anew, each with a new journal"
    )


def cannot_open(what: str, reason: str) -> InputError:
    """The refusal of a link that does not come up (F5021)."""
    message = f"the link {printable(what)} cannot be opened: {printable(reason)}"
    hint = "name an address that this host has, and end the program that uses it, if one does"
    return InputError([Diagnostic("F5021", message, hint)])
