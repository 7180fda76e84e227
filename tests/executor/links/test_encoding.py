"""Messages as JSON: every message has one text, and nothing else is read."""

import hashlib
import json
from contextlib import suppress
from dataclasses import dataclass, fields
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.executor.links.encoding import KINDS, MESSAGE_BYTES_MAX, EncodingError, _Form, decode, encode, pack, unpack
from firable.executor.links.link import PROTOCOL_VERSION
from firable.executor.protocol import messages
from firable.executor.protocol.messages import Decision, Message, Readiness, ToController, ToCoordinator

MESSAGES: st.SearchStrategy[Message] = st.one_of([st.from_type(kind) for kind in KINDS.values()])


def test_every_message_of_the_protocol_can_be_sent() -> None:
    assert set(KINDS.values()) == {*get_args(ToController), *get_args(ToCoordinator)}
    assert all(getattr(messages, name) is kind for name, kind in KINDS.items())


@examples(100)
@given(MESSAGES)
def test_a_message_is_read_as_it_was_written(message: Message) -> None:
    assert decode(encode(message)) == message


NAMES = st.text(alphabet=':,}-01"%a', max_size=6)
"""Names that look like the text around a number."""
NUMBERS = st.integers(-3, 3) | st.integers(-(10**20), 10**20)


def with_other(message: Message, data: st.DataObject, *, names: bool = False) -> Message:
    """The message with other numbers, and other names where these are wanted."""

    def drawn(value: Any) -> Any:
        if isinstance(value, Readiness):
            return Readiness(*[drawn(getattr(value, field.name)) for field in fields(Readiness)])
        if isinstance(value, bool) or value is None:
            return value
        if isinstance(value, int):
            return data.draw(NUMBERS)
        if isinstance(value, frozenset | tuple) and names:
            return type(value)(data.draw(st.lists(NAMES, max_size=2)))
        return data.draw(NAMES) if isinstance(value, str) and names else value

    return type(message)(**{field.name: drawn(getattr(message, field.name)) for field in fields(message)})


@examples(300)
@given(MESSAGES, st.data())
def test_messages_of_one_shape_are_read_each_as_it_was_written(message: Message, data: st.DataObject) -> None:
    first = with_other(message, data, names=True)
    for one in (first, with_other(first, data), with_other(first, data)):
        text = encode(one)
        assert decode(text) == one
        assert json.loads(text)[type(one).__name__]["controller"] == one.controller


@pytest.mark.parametrize("number", [b"01", b"+1", b"-0", b"1.0", b"1e0", b" 1", b"", b"true", b"--1", b"0x1"])
def test_number_that_is_written_otherwise_is_refused_in_a_shape_that_is_known(number: bytes) -> None:
    text = encode(Decision("robot", 77, None, 0, -1))
    assert decode(text) == decode(text)
    assert decode(text.replace(b"77", b"-1")) == Decision("robot", -1, None, 0, -1)
    with pytest.raises(EncodingError):
        decode(text.replace(b"77", number))


@examples(100)
@given(MESSAGES, st.data())
def test_no_edited_byte_is_read_as_the_same_message(message: Message, data: st.DataObject) -> None:
    text = bytearray(encode(message))
    at = data.draw(st.integers(0, len(text) - 1))
    text[at] ^= data.draw(st.integers(1, 255))
    with suppress(EncodingError):
        assert decode(bytes(text)) != message


@examples(100)
@given(st.binary(max_size=60))
def test_noise_is_refused(noise: bytes) -> None:
    with pytest.raises(EncodingError):
        decode(noise)


def spelled(content: object, kind: str = "Decision") -> bytes:
    return json.dumps({kind: content}, sort_keys=True, separators=(",", ":")).encode()


def with_defaults(**changed: object) -> object:
    """The content of a Decision with something changed."""
    full = json.loads(encode(Decision("robot", 1, None, 0, -1)))["Decision"]
    return {**full, **changed}


def test_the_content_of_these_tests_is_that_of_a_message() -> None:
    assert isinstance(decode(spelled(with_defaults())), Decision)


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"null",
        b"[]",
        b"{}",
        spelled(with_defaults(), "Verdict"),
        spelled(with_defaults(more=1)),
        spelled({"controller": "robot"}),
        spelled(with_defaults(round="1")),
        spelled(with_defaults(round=1.0)),
        spelled(with_defaults(round=True)),
        spelled(with_defaults(committed=3)),
        spelled(with_defaults(round=float("nan"))),
        spelled(with_defaults()) + b"\n",
        spelled(with_defaults())[:-1],
        spelled(with_defaults()).replace(b'"robot"', b'"\\u0072obot"'),
        spelled(with_defaults()).replace(b'"robot"', b'"\\ud800"'),
        spelled(with_defaults()).replace(b'"robot"', b'"\xff"'),
        b'{"Decision":' + b"[" * 100_000,
        b'{"Decision":' + b'{"controller":' * 100_000,
        b" " * (MESSAGE_BYTES_MAX + 1),
    ],
)
def test_what_is_not_written_as_ours_is_refused(text: bytes) -> None:
    with pytest.raises(EncodingError):
        decode(text)


def test_a_set_in_another_order_or_with_a_doubled_entry_is_refused() -> None:
    message = messages.Vote("robot", 1, frozenset({"G1", "G2"}), messages.Readiness(0, frozenset()))
    text = encode(message)
    assert decode(text) == message
    for other in (b'"promised":["G2","G1"]', b'"promised":["G1","G1","G2"]'):
        with pytest.raises(EncodingError):
            decode(text.replace(b'"promised":["G1","G2"]', other))


def test_an_age_before_a_message_has_one_spelling_too() -> None:
    text = encode(Decision("robot", 77, None, 0, -1))
    for age in (0, 9, 10**18):
        assert unpack(pack(age, Decision("robot", 77, None, 0, -1))) == (age, Decision("robot", 77, None, 0, -1))
    for before in (b"", b" ", b"01 ", b"-1 ", b"+1 ", b"1_0 ", b"1", b"1  ", b"9" * 20 + b" ", "\u0661 ".encode()):
        with pytest.raises(EncodingError):
            unpack(before + text)


@dataclass(frozen=True)
class Odd:
    """A message as there must be none."""

    promised: set[str]


def test_a_message_with_a_field_that_has_no_one_spelling_is_refused_when_the_program_starts() -> None:
    with pytest.raises(TypeError, match="cannot be part of a message"):
        _Form(Odd)


SHAPES = {
    2: "f8449b1cb1bf4c25",
    3: "377b67d513818ce9",
    4: "b9084ed7cd0575f6",
    5: "b9084ed7cd0575f6",
    6: "b9084ed7cd0575f6",
    7: "b9084ed7cd0575f6",
}
"""What the messages of each version of the protocol look like; one that was in use keeps its line.

Version 5 differs in how hosts greet, version 6 in that, too, and in the age beside each message; in version 7 hosts say
whether anything moves there.
"""


def test_the_version_of_the_protocol_is_that_of_its_messages() -> None:
    # Whoever changes a message gives the protocol a new version, or hosts of both would talk past each other.
    told = {
        name: {f.name: str(f.type) for f in fields(kind)} for name, kind in {**KINDS, "Readiness": Readiness}.items()
    }
    shape = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()
    assert SHAPES[PROTOCOL_VERSION] == shape[:16]
