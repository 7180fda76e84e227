"""A link over Zenoh: peers over TCP or TLS, without routers, scouting or multicast.

A greeting is a *liveliness token*, which Zenoh shows to every peer and takes back when the session ends, its TCP
connection breaks or its lease is over. Its key says all that the greeting has to:

    firable/VERSION/DIGEST/alive/NAMES/SESSION-STORAGE             a host is there, with these machines
    firable/VERSION/DIGEST/heard/SESSION/by/SESSION/ANSWER/NAMES   it is heard by that one, or is not, and why
    firable/VERSION/DIGEST/to/NAME/SESSION/from/NAME/SESSION       a message, with the age of the sender's storage

Keys of messages bear version, digest and both sessions, so that nothing of another bundle, or meant for the process
that ran the machine before, is even routed. A SESSION is Zenoh's identity of it; STORAGE is the storage of its host
(`storages.py`). Two hosts are connected when each has answered the other that it hears it (`claims.py`): what one
refuses, the other must know, before anything moves there. Of two hosts that claim one machine the first is heard and
the other refused; where the first is dead and nobody has noticed yet, the second takes its place when the lease is
over.

The *lease* is set, and not left at Zenoh's ten seconds: a frozen host is noticed after it. A killed one is noticed at
once. While the line is down nothing is kept: what is sent then is lost, and the link is up again by itself.

A key with a wildcard in it is none of ours, and is dropped before it is read: Zenoh lets anybody publish to all keys of
a pattern at once, and such a key has other parts than the one that it was subscribed by.

Nothing listens unless an address is given, and multicast is off. Beyond one machine, `tls/` addresses with certificates
on both sides (`Certificates`) keep strangers out; plain `tcp/` beyond loopback lets anybody on the network speak.
Whoever has a certificate of the site may be any of its machines, unless it is said which certificate is whose
(`Certificates.of`): then Zenoh itself lets nobody claim machines, or say something in their names, over a connection
with another certificate than that of their host.

Zenoh calls back on threads of its own. Where the event loop sleeps, and is one that lends itself (`lending.py`),
messages are acted upon there and then; a loop that is at work is woken once for all that comes before it looks, for to
wake it costs more than to act upon a message. What is no message, a host that comes or goes, is left to the loop, and
so is what asks something of Zenoh and waits for it. `put` does not wait: a message that finds the queue of a dead line
full is dropped. A sync of the journal is on a thread of its own in any case, so no disk holds up the connection by it.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, Final
from urllib.parse import quote, unquote

import zenoh

from firable.executor.links.claims import Answer, Claims, Said
from firable.executor.links.encoding import MESSAGE_BYTES_MAX, EncodingError, pack, unpack
from firable.executor.links.lending import LendingLoop
from firable.executor.links.link import COORDINATOR, QUESTION, Arrival, Greeting, LinkListener, cannot_open, objection
from firable.executor.links.standing import Standing
from firable.executor.links.storages import Storage
from firable.executor.loopback import is_loopback
from firable.executor.protocol.messages import Message
from firable.nets.diagnostics import Diagnostic, Severity
from firable.nets.source import printable

LEASE_SECONDS: Final = 1.0
"""After how long a host that says nothing is lost."""

_OPENING_SECONDS: Final = 2.0
_NAMELESS: Final = "%"  # which no name is quoted to
_WITH: Final = "-"  # which is in no identity
_AND: Final = ","  # which is in no quoted name
_REST: Final = "**"
_SAYING: Final = ("put", "delete", "liveliness_token")
_WILD: Final = "*"  # which is in no key of ours, and in each that stands for several
_VERSION: Final = re.compile("[0-9]{1,9}", re.ASCII)
_OVERHEAD_BYTES_MAX: Final = 1 << 16
"""What Zenoh sends beside a message: its key, above all."""


@dataclass(frozen=True, slots=True)
class Certificates:
    """The files of a host for TLS, as PEM: who it is, and by whose signature others are known."""

    authority: str
    certificate: str
    key: str
    of: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """For each common name in a certificate the machines of the host that has it; without any, each may be all."""


class ZenohLink:
    """The link of one host; `listen` and `join` are addresses such as `tcp/127.0.0.1:7447` or `tls/10.0.0.2:7447`."""

    def __init__(
        self,
        greeting: Greeting,
        *,
        listen: Sequence[str] = (),
        join: Sequence[str] = (),
        certificates: Certificates | None = None,
        lease_seconds: float = LEASE_SECONDS,
    ) -> None:
        self.greeting = greeting
        self.listen = tuple(listen)
        self.join = tuple(join)
        self.certificates = certificates
        self.lease_seconds = lease_seconds
        self.session: zenoh.Session | None = None
        self.listener: LinkListener | None = None
        self.identity = ""
        self.broken: asyncio.Future[None] | None = None
        self.claims: Claims | None = None
        self.objected: dict[str, tuple[str, ...]] = {}
        """The machines of each session that was refused for what its greeting says."""
        self.answers: dict[str, Any] = {}  # tokens, the end of which Zenoh gives no type
        """What each session is answered."""
        self.standing = Standing.GOING
        self.stood: Any = None
        """The token of that."""
        self.publishers: dict[tuple[str, str, str], zenoh.Publisher] = {}
        """For each sender here, receiver and session of the receiver."""
        self.damaged = 0
        """How much that came was no message."""
        self.samples: deque[tuple[bool, str, bytes, bool]] = deque()
        """What has come and was not looked at yet: messages, and tokens of hosts."""
        self.is_woken = False
        self.lending: LendingLoop | None = None
        """The event loop, if it lends itself."""

    @property
    def question(self) -> str:
        """What there is to ask, of a host that was never reached: why, Zenoh keeps to itself."""
        does = [("listens at", self.listen), ("joins", self.join)]
        here = " and ".join(f"{what} {' '.join(map(printable, at))}" for what, at in does if at)
        asked = f"{QUESTION} (this one {here})"
        if self.certificates is None:
            return asked
        asked = f"{asked} is the certificate of each of the authority that the other names with --tls, and not expired?"
        return f"{asked} is it made out to the name that --certified says?" if self.certificates.of else asked

    async def run(self, listener: LinkListener) -> None:
        """Serve until cancelled; raises `InputError` F5021 where an address cannot be listened at."""
        loop = asyncio.get_running_loop()
        try:
            session = await asyncio.to_thread(zenoh.open, self._configuration())
        except zenoh.ZError as error:
            raise cannot_open(", ".join((*self.listen, *self.join)), str(error).partition(" at /")[0]) from None
        self.session, self.listener = session, listener
        self.identity = str(session.info.zid())
        self.claims = Claims(listener, self._answer)
        self.lending = loop if isinstance(loop, LendingLoop) else None
        try:
            ours, tokens = self._ours(), session.liveliness()
            kept: list[object] = []
            for name in self.greeting.names:
                at = f"{ours}/to/{_spelled(name)}/{self.identity}/{_REST}"
                kept.append(session.declare_subscriber(at, lambda s: self._on(loop, s, is_message=True)))
            claim = f"{_all_spelled(self.greeting.names)}/{self.identity}{_WITH}{listener.memory.storage}"
            kept.append(tokens.declare_token(f"{ours}/alive/{claim}"))
            self.stand(self.standing)
            for heard in (f"{ours}/heard/{self.identity}/by/*/*/*", f"{ours}/stands/*/*", "firable/*/*/alive/*/*"):
                take = partial(self._on, loop, is_message=False)
                kept.append(tokens.declare_subscriber(heard, take, history=True))
            self.broken = loop.create_future()
            await self.broken
        finally:
            self.session = self.listener = self.claims = None
            self.publishers.clear()
            self.answers.clear()
            self.objected.clear()
            self.stood = None
            await asyncio.to_thread(session.close)
            self.samples.clear()  # what an earlier session has told is not so in a later one

    def send(self, sender: str, receiver: str, message: Message) -> None:
        """Publish a message; where its receiver is not connected it is lost."""
        peer = None if self.claims is None else self.claims.reached.get(receiver)
        if self.session is None or self.listener is None or peer is None:
            return
        to = (sender, receiver, peer)
        publisher = self.publishers.get(to)
        if publisher is None:
            key = f"{self._ours()}/to/{_spelled(receiver)}/{peer}/from/{_spelled(sender)}/{self.identity}"
            drop = zenoh.CongestionControl.DROP
            if self.lending is not None and self.lending.is_lent:  # on Zenoh's own thread nothing waits for Zenoh
                self.lending.call_soon(self.send, sender, receiver, message)
                return
            publisher = self.session.declare_publisher(key, congestion_control=drop, express=True)
            self.publishers[to] = publisher
        publisher.put(pack(self.listener.age, message))

    def stand(self, standing: Standing) -> None:
        """Declare how this host stands, and only then take back what was declared before."""
        self.standing = standing
        if self.session is None:
            return
        if self.lending is not None and self.lending.is_lent:
            self.lending.call_soon(self.stand, standing)
            return
        before, key = self.stood, f"{self._ours()}/stands/{self.identity}/{standing}"
        self.stood = self.session.liveliness().declare_token(key)
        if before is not None:
            before.undeclare()

    def _configuration(self) -> zenoh.Config:
        settings: dict[str, Any] = {
            "mode": "peer",
            "listen/endpoints": list(self.listen),
            "listen/exit_on_failure": True,
            "connect/endpoints": list(self.join),
            "connect/exit_on_failure": False,
            "connect/timeout_ms": -1,
            "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            "transport/link/tx/lease": round(self.lease_seconds * 1000),
            "transport/link/tx/keep_alive": 4,
            "transport/link/rx/max_message_size": MESSAGE_BYTES_MAX + _OVERHEAD_BYTES_MAX,
            "transport/shared_memory/enabled": False,  # in which a process of the same system sends any size
            # A connection that was begun while the line was down must not hold up the next for ten seconds.
            "transport/unicast/open_timeout": round(_OPENING_SECONDS * 1000),
            "transport/unicast/accept_timeout": round(_OPENING_SECONDS * 1000),
        }
        if self.certificates is not None:
            settings["transport/link/tls"] = {
                "root_ca_certificate": self.certificates.authority,
                "listen_certificate": self.certificates.certificate,
                "listen_private_key": self.certificates.key,
                "connect_certificate": self.certificates.certificate,
                "connect_private_key": self.certificates.key,
                "enable_mtls": True,
                "verify_name_on_connect": True,
                "close_link_on_expiration": True,
            }
            if self.certificates.of:
                settings["access_control"] = _access(self.certificates.of)
        configuration = zenoh.Config()
        for key, value in settings.items():
            configuration.insert_json5(key, json.dumps(value))
        return configuration

    def _ours(self) -> str:
        """What keys between hosts with this bundle begin with."""
        return f"firable/{self.greeting.version}/{_spelled(self.greeting.digest)}"

    def _on(self, loop: asyncio.AbstractEventLoop, sample: zenoh.Sample, *, is_message: bool) -> None:
        """A sample has come, on a thread of Zenoh; after the loop's end nobody hears it."""
        gone, key = sample.kind == zenoh.SampleKind.DELETE, str(sample.key_expr)
        if _WILD in key:
            return
        payload = sample.payload.to_bytes()
        self.samples.append((is_message, key, payload, gone))
        if is_message and self.lending is not None and self._is_taken_here(self.lending):
            return
        if not self.is_woken:
            self.is_woken = True
            with suppress(RuntimeError):  # the loop has been closed
                loop.call_soon_threadsafe(self._look)

    def _is_taken_here(self, loop: LendingLoop) -> bool:
        """Take messages on this thread while the loop sleeps; whether nothing is left that it must be woken for."""
        while self._is_message_next():
            if not loop.lend(self._look_at_messages):
                return loop.is_lent  # to another thread of Zenoh, which looks again when it has given it back
        return not self.samples

    def _is_message_next(self) -> bool:
        try:
            return self.samples[0][0]
        except IndexError:  # another thread has taken all
            return False

    def _look(self) -> None:
        """Take all that has come."""
        self.is_woken = False  # first: what comes from now on wakes the loop again
        self._take(or_until_a_token=False)

    def _look_at_messages(self) -> None:
        self._take(or_until_a_token=True)

    def _take(self, *, or_until_a_token: bool) -> None:
        """Take what has come; this has no caller, so what fails in it ends `run`."""
        try:
            came: list[Arrival] = []
            for _ in range(len(self.samples)):
                if or_until_a_token and not self.samples[0][0]:
                    break
                is_message, key, payload, gone = self.samples.popleft()
                if is_message:
                    came += self._message(key, payload, gone)
                else:
                    self._told(came)
                    came = []
                    if self.listener is not None and self.claims is not None:
                        self._host(self.listener, self.claims, key, gone)
            self._told(came)
        except Exception as error:
            if self.broken is not None and not self.broken.done():
                self.broken.set_exception(error)

    def _told(self, came: Sequence[Arrival]) -> None:
        if came and self.listener is not None:
            self.listener.arrived_together(came)

    def _host(self, listener: LinkListener, claims: Claims, key: str, gone: bool) -> None:
        _, version, digest, what, *rest = key.split("/")
        if what == "heard":
            _, _, by, answer, machines = rest
            with suppress(ValueError):  # no answer that there is
                claims.answered(by, Said(Answer(answer), _all_read(machines)), taken_back=gone)
        elif what == "stands":
            session, standing = rest
            with suppress(ValueError):  # nothing that there is
                if not gone:  # there is a newer word, or its session is gone
                    claims.stands(session, Standing(standing))
        else:
            machines, claim = rest
            session, _, storage = claim.partition(_WITH)
            if session == self.identity:
                return
            greeting = Greeting(_read(digest), _all_read(machines), int(version) if _VERSION.fullmatch(version) else -1)
            if (why := objection(self.greeting, greeting)) is not None:
                if not gone:
                    self.objected[session] = greeting.names
                    listener.refused(greeting.names, why)
                elif self.objected.pop(session, None) not in (None, *self.objected.values()):
                    listener.gone(greeting.names)
            elif gone:
                claims.given_up(session)
            else:
                claims.claimed(session, greeting.names, Storage.read(storage))
        self.publishers = {to: kept for to, kept in self.publishers.items() if claims.reached.get(to[1]) == to[2]}

    def _answer(self, session: str, said: Said | None) -> None:
        """Say to a session whether it is heard, in place of what was said before."""
        if (before := self.answers.pop(session, None)) is not None:
            before.undeclare()
        if said is not None and self.session is not None:
            answer = f"{said.answer}/{_all_spelled(said.machines)}"
            key = f"{self._ours()}/heard/{session}/by/{self.identity}/{answer}"
            self.answers[session] = self.session.liveliness().declare_token(key)

    def _message(self, key: str, payload: bytes, gone: bool) -> Sequence[Arrival]:
        receiver, peer, session = _parsed(key)
        # Only from the process that is known to run the machine: another one, or one not yet met, is not heard.
        if gone or self.claims is None or self.claims.reached.get(peer) != session:
            return ()
        if receiver not in self.greeting.names:
            return ()
        try:
            age, message = unpack(payload)
        except EncodingError:
            self.damaged += 1
            return ()
        return ((peer, receiver, message, age),)


def _access(of: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
    """The rules by which Zenoh takes from each certificate what is its own: claims of its machines, and their words."""
    anybody = ["firable/*/*/heard/*/by/*/*/*", "firable/*/*/stands/*/*"]
    asking = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]
    rules = [
        _rule("out", "egress", ["**"], [*_SAYING, *asking, "reply"]),
        _rule("asking", "ingress", ["firable/**"], [*asking, "reply"]),
        _rule("anybody", "ingress", anybody, _SAYING),
    ]
    subjects: list[dict[str, Any]] = [{"id": "all"}]
    policies = [{"rules": ["out", "asking", "anybody"], "subjects": ["all"]}]
    for number, (name, machines) in enumerate(of.items()):
        own = [f"firable/*/*/alive/{_all_spelled(machines)}/*"]
        own += [f"firable/*/*/to/*/*/from/{_spelled(machine)}/*" for machine in machines]
        rules.append(_rule(f"host{number}", "ingress", own, _SAYING))
        subjects.append({"id": f"host{number}", "cert_common_names": [name]})
        policies.append({"rules": [f"host{number}"], "subjects": [f"host{number}"]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rule(name: str, flow: str, keys: Sequence[str], messages: Sequence[str]) -> dict[str, Any]:
    allowed = {"flows": [flow], "key_exprs": list(keys), "messages": list(messages)}
    return {"id": name, "permission": "allow", **allowed}


def open_to_the_network(addresses: Sequence[str]) -> tuple[Diagnostic, ...]:
    """A warning (F5022) for each address that anybody on the network could speak to: plain TCP beyond loopback."""
    found = []
    for address in addresses:
        protocol, _, rest = address.partition("/")
        host = rest.rpartition(":")[0].strip("[]")
        if protocol != "tls" and not is_loopback(host):
            message = f"{printable(address)} is open to the network: whoever reaches it can take part in the cell"
            hint = "use tls/ with the certificates of the site, or a network that nobody else is on"
            found.append(Diagnostic("F5022", message, hint, severity=Severity.WARNING))
    return tuple(found)


@lru_cache(maxsize=1000)
def _parsed(key: str) -> tuple[str, str, str]:
    """Receiver, sender and the sender's session of the key of a message."""
    *_, receiver, _, _, sender, session = key.split("/")
    return _read(receiver), _read(sender), session


def _spelled(name: str) -> str:
    return _NAMELESS if name == COORDINATOR else quote(name, safe="")


def _read(spelled: str) -> str:
    return COORDINATOR if spelled == _NAMELESS else unquote(spelled)


def _all_spelled(names: Sequence[str]) -> str:
    return _AND.join(map(_spelled, names))


def _all_read(spelled: str) -> tuple[str, ...]:
    return tuple(map(_read, spelled.split(_AND)))
