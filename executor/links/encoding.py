"""Messages as canonical JSON, for links that carry bytes: `{"Vote":{"controller":...,"promised":[...],...}}`.

The encoding is derived from the dataclasses of `protocol.messages`, so a message that is added there can be sent
without a line here. One message has one spelling, keys and sets in order, and nothing else is read: what is decoded is
encoded again and compared, so an unknown key, a doubled entry or a number written otherwise is refused.
What arrives from a line is not trusted to be a message only because a checksum agrees.

Rejected: pickle, which runs what it reads; a binary schema, which would be a second description of each message, and
save time that a line of any kind spends many times over.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, Final, get_args

from pydantic import TypeAdapter

from firable.executor.protocol.messages import Message
from firable.nets.interchange import canonical_json

MESSAGE_BYTES_MAX: Final = 1 << 20
"""More than any message of a net that can be bundled needs."""


class EncodingError(ValueError):
    """The bytes are not a message of ours."""


def _kinds(message: object) -> list[type]:
    """The dataclasses of a union."""
    if isinstance(message, UnionType):
        return [kind for member in get_args(message) for kind in _kinds(member)]
    if not isinstance(message, type) or not is_dataclass(message):
        raise TypeError(f"{message} is no message")
    return [message]


KINDS: Final[dict[str, type]] = {kind.__name__: kind for kind in _kinds(Message)}
"""Each kind of message by its name."""

_READERS: Final[dict[str, TypeAdapter[Message]]] = {name: TypeAdapter(kind) for name, kind in KINDS.items()}


def encode(message: Message) -> bytes:
    """The one text of a message.

    >>> from firable.executor.protocol.messages import Acknowledgement, Readiness
    >>> encode(Acknowledgement("robot", 7, Readiness(3, frozenset({"G2", "G1"}))))[:60]
    b'{"Acknowledgement":{"controller":"robot","readiness":{"seque'
    """
    return canonical_json({type(message).__name__: _plain(message)})


def decode(data: bytes) -> Message:
    """The message of a text; raises `EncodingError` for any bytes that `encode` does not make.

    >>> from firable.executor.protocol.messages import Decision
    >>> decode(encode(Decision("robot", 7, None, 6, 3))) == Decision("robot", 7, None, 6, 3)
    True
    """
    if len(data) > MESSAGE_BYTES_MAX:
        raise EncodingError(f"{len(data):,} bytes are more than a message has")
    # In the one spelling, the kind stands first and the content fills the rest.
    head, _, rest = data.partition(b":")
    name = head.removeprefix(b'{"').removesuffix(b'"').decode("ascii", "replace")
    if name not in _READERS:
        raise EncodingError("no kind of message that is known")
    try:
        message = _READERS[name].validate_json(rest[:-1], strict=True)
        canonical = encode(message) == data
    except ValueError:  # a ValidationError, and for text or a number that JSON has and no message
        raise EncodingError(f"not the content of a {name}") from None
    if not canonical:
        raise EncodingError(f"a {name} that is not written as ours are")
    return message


def _plain(value: Any) -> Any:
    """A value of a message as JSON."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    match value:
        case frozenset():
            return sorted(map(_plain, value))
        case tuple():
            return list(map(_plain, value))
        case None | bool() | int() | float() | str():
            return value
        case _:
            raise TypeError(f"{value!r} cannot be part of a message")
