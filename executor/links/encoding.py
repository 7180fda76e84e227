"""Messages as canonical JSON, for links that carry bytes: `{"Vote":{"controller":...,"promised":[...],...}}`.

The encoding is derived from the dataclasses of `protocol.messages`, so a message that is added there can be sent
without a line here. One message has one spelling, keys and sets in order, no blanks, UTF-8, and nothing else is read:
what is decoded is encoded again and compared, so an unknown key, a doubled entry or a number written otherwise is
refused. What arrives from a line is not trusted to be a message only because a checksum agrees.

Hosts say the same things again and again with other numbers. So what a text is but for its numbers, its *shape*, is
remembered, for a bounded number of them: a message of a shape that was read before, strictly, is made of its numbers,
and one that was written before is written by putting them in. A shape is learnt only where exactly the numbers of the
message stand between its pieces, so nothing is read by it that is not the one text of what it is read as.

Rejected: pickle, which runs what it reads; a binary schema, which would be a second description of each message, and
save time that a line of any kind spends many times over.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from operator import attrgetter
from types import UnionType
from typing import Any, Final, TypeVar, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter
from pydantic_core import to_json

from firable.executor.protocol.messages import Message

MESSAGE_BYTES_MAX: Final = 1 << 20
"""More than any message of a net that can be bundled needs."""
SHAPES_MAX: Final = 4096
SHAPE_BYTES_MAX: Final = 1000
"""What is longer is not remembered, whatever a stranger may send."""

_NUMBER: Final = re.compile(rb":(0|-?[1-9][0-9]{0,18})(?=[,}])")
"""A number as it is written here, behind a key; in a name it may look so, too."""
_AGE: Final = re.compile(rb"0|[1-9][0-9]{0,18}")


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
    form = _FORMS[type(message)]
    others = form.others(message)
    template = form.templates.get(others)
    if template is None:
        template = form.template(others)
        if len(template) <= SHAPE_BYTES_MAX:
            _remember(form.templates, others, template)
    return template % form.numbers(message)


def decode(data: bytes) -> Message:
    """The message of a text; raises `EncodingError` for any bytes that `encode` does not make.

    >>> from firable.executor.protocol.messages import Decision
    >>> decode(encode(Decision("robot", 7, None, 6, 3))) == Decision("robot", 7, None, 6, 3)
    True
    """
    if len(data) > MESSAGE_BYTES_MAX:
        raise EncodingError(f"{len(data):,} bytes are more than a message has")
    pieces = _NUMBER.split(data)
    shape = tuple(pieces[::2])
    if (known := _KNOWN.get(shape)) is not None:
        return known(pieces[1::2])
    message = _read(data)
    if len(data) <= SHAPE_BYTES_MAX and [b"%d" % n for n in _FORMS[type(message)].numbers(message)] == pieces[1::2]:
        _remember(_KNOWN, shape, _remaking(message, itertools.count()))
    return message


def pack(age: int, message: Message) -> bytes:
    """A message and the age of its sender's storage, as they go over a line: `AGE {"Decision":...}`.

    >>> from firable.executor.protocol.messages import Hello
    >>> pack(12, Hello("robot", 0, 3, 1))[:20]
    b'12 {"Hello":{"closed'
    """
    return b"%d %b" % (age, encode(message))


def unpack(data: bytes) -> tuple[int, Message]:
    """The age and the message of such a text; raises `EncodingError` for any bytes that `pack` does not make.

    >>> from firable.executor.protocol.messages import Hello
    >>> unpack(pack(12, Hello("robot", 0, 3, 1)))
    (12, Hello(controller='robot', closed_below=0, seen=3, epoch=1, coordinator=''))
    """
    age, _, text = data.partition(b" ")
    if not _AGE.fullmatch(age):
        raise EncodingError("it does not begin with an age")
    return int(age), decode(text)


def _read(data: bytes) -> Message:
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


class _Form:
    """How a kind of message is written; raises `TypeError` where it has a field that no message may have.

    Made once for each kind, and not asked of each value: a message is on its way of every command.
    """

    def __init__(self, kind: Any, name: str = "") -> None:
        text, paths, self.writers = _flat(kind, "")
        self.text = f'{{"{name}":{text}}}'
        self.numbers = _getter([path for path, write in zip(paths, self.writers, strict=True) if write is None])
        self.others = _getter([path for path, write in zip(paths, self.writers, strict=True) if write is not None])
        self.templates: dict[tuple[Any, ...], bytes] = {}
        """By all but the numbers; these are put in."""

    def template(self, others: tuple[Any, ...]) -> bytes:
        """The text, with a place for each number."""
        values = iter(others)
        parts = ["%d" if write is None else write(next(values)).replace("%", "%%") for write in self.writers]
        return (self.text % tuple(parts)).encode()


def _getter(paths: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    if len(paths) == 1:
        get = attrgetter(paths[0])
        return lambda value: (get(value),)
    return attrgetter(*paths) if paths else lambda _: ()


def _flat(kind: Any, before: str) -> tuple[str, list[str], list[Callable[[Any], str] | None]]:
    """The text of a dataclass without its parts, these as paths of attributes, and what writes each; None: a number."""
    hints, texts, paths, writers = get_type_hints(kind), list[str](), list[str](), list[Any]()
    for name in sorted(field.name for field in fields(kind)):
        if is_dataclass(hint := hints[name]):
            text, inner, of_inner = _flat(hint, f"{before}{name}.")
            writers += of_inner
            paths += inner
        else:
            text = "%s"
            writers.append(_part(hint))
            paths.append(before + name)
        texts.append(f'"{name}":{text}')
    return f"{{{','.join(texts)}}}", paths, writers


def _remaking(message: Any, places: Iterator[int]) -> Callable[[Sequence[bytes]], Any]:
    """What makes the same message with other numbers; `places` are those of the numbers in the order of the text."""
    kind, names = type(message), [field.name for field in fields(message)]
    known = [getattr(message, name) for name in names]
    made: list[tuple[int, Callable[[Sequence[bytes]], Any]]] = []
    numbered: list[tuple[int, int]] = []
    for name in sorted(names):
        at = names.index(name)
        if is_dataclass(known[at]):
            made.append((at, _remaking(known[at], places)))
        elif type(known[at]) is int:
            numbered.append((at, next(places)))

    def make(numbers: Sequence[bytes]) -> Any:
        parts = known.copy()
        for at, place in numbered:
            parts[at] = int(numbers[place])
        for at, one in made:
            parts[at] = one(numbers)
        return kind(*parts)

    return make


Key = TypeVar("Key")
Kept = TypeVar("Kept")


def _remember(kept: dict[Key, Kept], key: Key, value: Kept) -> None:
    if len(kept) >= SHAPES_MAX:
        kept.clear()
    kept[key] = value


def _part(hint: Any) -> Callable[[Any], str] | None:
    if hint is int:
        return None
    if get_origin(hint) is frozenset and get_args(hint) == (str,):
        return _set
    if get_origin(hint) is tuple and get_args(hint) == (str, ...):
        return _list
    parts = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    if all(part in (str, bool, type(None)) for part in parts):  # a number beside others would be equal to a truth value
        return _scalar
    raise TypeError(f"{hint} cannot be part of a message")


def _scalar(value: str | bool | None) -> str:
    return to_json(value).decode()


def _set(names: frozenset[str]) -> str:
    return _list(tuple(sorted(names)))


def _list(names: tuple[str, ...]) -> str:
    return f"[{','.join(map(_scalar, names))}]"


_FORMS: Final = {kind: _Form(kind, name) for name, kind in KINDS.items()}
_KNOWN: Final[dict[tuple[bytes, ...], Callable[[Sequence[bytes]], Message]]] = {}
"""What makes a message of each shape that was read."""
