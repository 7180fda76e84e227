"""What a new kind of device brings: points that are read and written over one connection.

A device is a set of *points*, each with an address in the device's own language: a coil, a node, a topic, a word on a
line. Everything that makes a good driver out of that (process image, completions, loss policies, safe outputs,
heartbeat, new connections) is written once above it, in `keeping.py` and `bound.py`, so that a kind of device is one
short file that knows its protocol and nothing else. Third parties name theirs as an entry point `firable.drivers`, an
object of the protocol `DeviceKind`, and hold it to `firable.executor.drivers.conformance`.

Rejected: one interface of commands and answers for each kind of device. It would put the handshake, which is where the
mistakes are, into every one of them.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
from collections.abc import Collection, Coroutine, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, Protocol, runtime_checkable

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo
from pydantic_core import PydanticCustomError

Point = str
"""The address of something that a device shows or takes, as the binding writes it."""

Value = bool | int | float | str
"""What a point holds. A text that means a number or a truth value counts as that (`as_bit`, `as_number`)."""


class NoValue(str):
    """What is shown of a point that has no value: the words for why, such as a status. It is no sign of life."""

    __slots__ = ()


TOLD_MAX: Final = 40
"""So much of a text is told that is no value: anybody may publish a picture where a number should be."""

DIGITS_MAX: Final = 20
"""A text of more digits is no number of a device: 64 bits have no more."""

Writes = Sequence[tuple[Point, Value]]
"""Values for points; a device takes them in this order."""

DROPPING: Final = (socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
"""An option of a socket: what it has not delivered is dropped when it is closed, also by the death of its process.

Otherwise the kernel goes on sending for minutes. A command that was on a line that was cut would come to its machine
when the line is back, behind the safe outputs, which went over a new connection.
"""


class LinkError(Exception):
    """A connection cannot be made, has failed, has timed out, or brought what nobody can read."""


class InUseError(LinkError):
    """A connection cannot be made because another program has what can be had by one alone: a serial line."""


class WithheldError(LinkError):
    """What was to be written was withheld (`Withholding`); the connection is as good as before."""


class Beside(str):
    """The path of a file that a binding names, found from the folder of the binding."""

    __slots__ = ()


def _beside(path: str, info: ValidationInfo) -> Beside:
    """The path from here; `folder` in the context is that of the binding."""
    return Beside((info.context["folder"] if info.context else Path()) / path)


File = Annotated[str, AfterValidator(_beside)]
"""The type of an option that names a file: a certificate, a key. One that cannot be read is refused with its line."""


def _of_a_user(password: str | None, info: ValidationInfo) -> str | None:
    """A password, which is shown with its user or not at all."""
    if password is not None and "user" in info.data and info.data["user"] is None:
        raise PydanticCustomError("refused", "a password without a user", {"hint": "write `user: NAME` beside it"})
    return password


Password = Annotated[str | None, AfterValidator(_of_a_user)]
"""The type of an option `password`, behind an option `user`."""


class Options(BaseModel):
    """The keys of a device in a binding that its kind knows, beside those that all kinds have."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)

    @property
    def polled_s(self) -> float:
        """How long it may take until a change at the device is shown, because it is asked for it; 0 where it tells."""
        return 0.0

    @property
    def is_overheard(self) -> bool:
        """Whether a password goes over a network as it is."""
        return False

    def far_end(self) -> object:
        """What is equal of two devices that are one, however each is spoken with; by default all options.

        Where it is not sure whether two are one, it is equal: nothing is written by two that may be one.
        """
        return self

    def stands_at(self) -> str:
        """Where the device is, in words that differ of two that may be two; by default the far end, if that is a text.

        They are the same in each process, and hold no secret: journals keep them, and they are told (`whereabouts`).
        """
        far_end = self.far_end()
        return far_end if isinstance(far_end, str) else ""

    def point_problem(self, point: Point) -> str:
        """What is wrong with a point of a device with these options, which is right for its kind; empty for nothing."""
        del point
        return ""

    def unlike(self, other: Options) -> str:
        """What two devices that are one must have in common so that their points mean the same; empty where they do."""
        del other
        return ""


def files_of(options: BaseModel) -> Iterator[tuple[tuple[str, ...], Beside]]:
    """The files that options name, with the keys that name them.

    >>> class Tls(Options):
    ...     ca: File
    >>> tls = Tls.model_validate({"ca": "a.pem"}, context={"folder": Path("d")})
    >>> [(keys, str(file)) for keys, file in files_of(tls)]
    [(('ca',), 'd/a.pem')]
    """
    for name in type(options).model_fields:
        value = getattr(options, name)
        if isinstance(value, Beside):
            yield (name,), value
        elif isinstance(value, BaseModel):
            yield from (((name, *keys), file) for keys, file in files_of(value))


class Use(StrEnum):
    """What a point is to be used for."""

    READ = "read"
    WRITE = "write"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a connection is for: the points to be read, and how long an answer may take.

    Those that are `urgent`, the contacts of the emergency stop, are told as soon as they are known. The `forced` ones
    are written only when a signal is forced, in the place of the device, which writes them else. By those that `asks`
    names it is asked for commands.
    """

    read: Collection[Point]
    timeout_s: float
    urgent: Collection[Point] = ()
    forced: Collection[Point] = ()
    asks: Collection[Point] = ()


class Connection(Protocol):
    """One connection to a device. `read` is called by one task, `write` by another, at the same time.

    The first `read` comes before that, but where the device is to be stopped: there the safe outputs wait for nothing.

    Any of them raises `LinkError` or `OSError` when the connection has failed; then it is closed, and never used again.
    """

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """Wait until there is something, and return all that has come, in its order.

        The first answer is what the device shows now, as far as it tells that by itself. A device that is polled
        answers each time with all of its points; in between it may tell of those that are urgent.
        """
        ...

    async def write(self, writes: Writes) -> None:
        """Write values in their order, and return when the device, or who stands for it, has confirmed them."""
        ...

    async def close(self) -> None:
        """End the connection, also one that has failed; it does not fail itself.

        Nothing of what was written leaves any more, as far as that can be (`DROPPING`), and no goodbye is waited for
        behind what was not confirmed.
        """
        ...


@runtime_checkable
class Withholding(Connection, Protocol):
    """A connection that knows what of a write it has not sent; a stop breaks off a write of any other one."""

    def withhold(self) -> None:
        """Send nothing more of what is being written: who waits for it comes to know by `WithheldError`.

        What was sent is sent, and its end is waited for as ever; what is written from now on is sent.
        """
        ...


@runtime_checkable
class Prompt(Withholding, Protocol):
    """A connection that writes at once where it can, in the very turn of the event loop in which a command comes."""

    def begin(self, writes: Writes) -> Coroutine[Any, Any, None]:
        """Begin what `write` does, and return what waits for the end of it, and fails where it does."""
        ...


@runtime_checkable
class Owed(Protocol):
    """A connection that is the one way to its device, as a line is: a late answer comes to whoever asks next."""

    @property
    def owed_seconds(self) -> float:
        """How long after its end an answer may still come that would be taken for one to another question."""
        ...


class Stepwise:
    """What a connection has that writes in steps, and waits for the confirmation of each (`Withholding`)."""

    withheld = 0
    """How often what was being written was withheld."""
    is_in_doubt = False
    """Whether something was sent and not confirmed: whatever is said behind it may wait for ever."""

    def withhold(self) -> None:
        """Let no further step of what is being written begin."""
        self.withheld += 1

    @contextmanager
    def step(self, what: str, withheld: int) -> Iterator[None]:
        """Around one step of a write, which began when so often something had been withheld."""
        if withheld != self.withheld:
            raise WithheldError(f"{what} is not written any more")
        self.is_in_doubt = True
        yield
        self.is_in_doubt = False


def drop_at_close(transport: asyncio.BaseTransport | None) -> None:
    """Let nothing that a transport has not delivered leave when it is closed, where it is one of a network."""
    if transport is not None and (found := transport.get_extra_info("socket")) is not None:
        found.setsockopt(*DROPPING)


def is_to_itself(transport: asyncio.BaseTransport | None) -> bool:
    """Whether what is sent comes back, as the network gave a connection of this host the port that it was to reach.

    It can do so where nobody listens (a simultaneous open of TCP). A write over Modbus is confirmed by saying it again,
    so that such a connection would confirm whatever is written to it.
    """
    if transport is None or transport.get_extra_info("peername") is None:
        return False
    return bool(transport.get_extra_info("sockname") == transport.get_extra_info("peername"))


@runtime_checkable
class Bounded(Protocol):
    """A kind of device (`DeviceKind`) whose points do not take every value."""

    def value_problem(self, point: Point, value: Value) -> str:
        """What is wrong with a value for a point that is written, as a sentence without its end; else nothing."""
        ...


@runtime_checkable
class Shared(Protocol):
    """A kind of device (`DeviceKind`) that several programs may be connected to at a time, as is no line."""

    @property
    def shows_writes(self) -> bool:
        """Whether each of them can read what the others have written."""
        ...


@runtime_checkable
class Divided(Protocol):
    """A kind of device (`DeviceKind`) of which one point may be a part of another, as a bit is of a register."""

    def whole(self, point: Point) -> Point:
        """The point that is written with this one, which is a part of it; itself where it is none."""
        ...


class DeviceKind(Protocol):
    """A kind of device: how its options and addresses are written, and how one connects to it."""

    @property
    def options(self) -> type[Options]:
        """The model of its own keys in a binding."""
        ...

    @property
    def through_broker(self) -> bool:
        """Whether a connection leads to who stands for the device, and says nothing of the device itself."""
        ...

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with an address for a use, as a sentence without its end; empty where nothing is."""
        ...

    def load(self) -> None:
        """Import the library, before any connection waits for an answer; raises `ModuleNotFoundError`."""
        ...

    async def connect(self, options: Any, wanted: Wanted) -> Connection:
        """Make a new connection; raises `LinkError` or `OSError`."""
        ...


def not_let_in(where: str, user: str | None, password: str | None) -> LinkError:
    """That a device does not let in whoever shows this; the password itself is told to nobody.

    >>> print(not_let_in("10.0.0.1:1883", "cell", "secret"))
    10.0.0.1:1883 does not let the user 'cell' in: is the password right?
    """
    if user is None:
        return LinkError(f"{where} does not let this host in, which gives no user")
    shown = "is the password right?" if password is not None else "no password is given"
    return LinkError(f"{where} does not let the user '{user}' in: {shown}")


def quiet(library: str) -> None:
    """Let a library that logs not write on the terminal by itself: what matters is told by the driver.

    Who configures logging still gets all of it.
    """
    logger = logging.getLogger(library)
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())


def quoted(value: Value) -> str:
    """A value as it is told of: of a long text its beginning, and how long it is.

    >>> quoted(7), quoted("open"), quoted("x" * 5000)
    ('7', "'open'", "'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx'... (5000 characters)")
    """
    if isinstance(value, str) and len(value) > TOLD_MAX:
        return f"{value[:TOLD_MAX]!r}... ({len(value)} characters)"
    return repr(value)


def as_bit(value: Value) -> bool | None:
    """The truth value that a point shows, or None where it shows none.

    >>> [as_bit(value) for value in (True, 0, "1", "false", 2, "open")]
    [True, False, True, False, None, None]
    """
    if isinstance(value, str):
        return {"1": True, "true": True, "0": False, "false": False}.get(value.strip().lower())
    return bool(value) if value in {0, 1} else None


def as_number(value: Value) -> int | None:
    """The whole number that a point shows, or None where it shows none.

    A text of more digits than any counter has (`DIGITS_MAX`) shows none.

    >>> [as_number(value) for value in (7, "7", 7.0, True, "x", 7.5, "7" * 5000)]
    [7, 7, 7, None, None, None, None]
    """
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        digits = value.strip()
        return int(digits) if len(digits) <= DIGITS_MAX and digits.isascii() and digits.isdigit() else None
    if isinstance(value, float):
        return int(value) if value.is_integer() else None
    return value
