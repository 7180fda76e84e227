"""Messages as canonical JSON, for links that carry bytes: `{"Vote":{"controller":...,"promised":[...],...}}`.

The encoding is derived from the dataclasses of `protocol.messages`, so a message that is added there can be sent
without a line here. One message has one spelling, keys and sets in order, no blanks, UTF-8, and nothing else is read:
what is decoded is encoded again and compared, so an unknown key, a doubled entry or a number written otherwise is
refused. What arrives from a line is not trusted to be a message only because a checksum agrees.

Rejected: pickle, which runs what it reads; a binary schema, which would be a second description of each message, and
save time that a line of any kind spends many times over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import lru_cache
from operator import attrgetter
from types import UnionType
from typing import Any, Final, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter
from pydantic_core import to_json

from firable.executor.protocol.messages import Message

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
    b'{"Acknowledgement":{"controller":"robot","coordinator":"","r'
    """
    template, write = _WRITERS[type(message)]
    return (template % write(message)).encode()


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


def _writer(kind: Any) -> Callable[[Any], str]:
    """What turns a value of a dataclass into JSON; raises `TypeError` where it has a type that no message may have.

    Made once for each kind, as a template and what fills it, and not asked of each value: a message is on its way of
    every command. The names in it are those of one net, and their texts are remembered.
    """
    template, paths, writers = _flat(kind, "")
    get = attrgetter(*paths)

    def write(value: Any) -> str:
        parts = list(get(value))
        for at, one in writers:
            parts[at] = one(parts[at])
        return template % tuple(parts)

    return write


def _flat(kind: Any, before: str) -> tuple[str, list[str], list[tuple[int, Callable[[Any], str]]]]:
    """The template of a dataclass, its parts as paths of attributes, and what writes those that are no number."""
    hints, texts, paths, writers = get_type_hints(kind), list[str](), list[str](), list[tuple[int, Any]]()
    for name in sorted(field.name for field in fields(kind)):
        if is_dataclass(hint := hints[name]):
            text, inner, of_inner = _flat(hint, f"{before}{name}.")
            writers += [(len(paths) + at, write) for at, write in of_inner]
            paths += inner
        else:
            text = "%s"
            if (write := _part(hint)) is not None:
                writers.append((len(paths), write))
            paths.append(before + name)
        texts.append(f'"{name}":{text}')
    return f"{{{','.join(texts)}}}", paths, writers


def _part(hint: Any) -> Callable[[Any], str] | None:
    if hint is int:
        return None
    if get_origin(hint) is frozenset and get_args(hint) == (str,):
        return _set
    if get_origin(hint) is tuple and get_args(hint) == (str, ...):
        return _list
    parts = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    if all(part in (str, int, bool, float, type(None)) for part in parts):
        return _scalar
    raise TypeError(f"{hint} cannot be part of a message")


def _scalar(value: str | float | None) -> str:
    return _name(value) if isinstance(value, str) else to_json(value).decode()


def _name(name: str) -> str:
    return _remembered(name) if len(name) <= _NAME_MAX else to_json(name).decode()  # whatever a stranger may send


@lru_cache(maxsize=4096)
def _remembered(name: str) -> str:
    return to_json(name).decode()


def _set(names: frozenset[str]) -> str:
    return _list(tuple(sorted(names)))


def _list(names: tuple[str, ...]) -> str:
    return f"[{','.join(map(_name, names))}]"


_NAME_MAX: Final = 200

_WRITERS: Final = {kind: (f'{{"{name}":%s}}', _writer(kind)) for name, kind in KINDS.items()}
