"""Records refuse at the first thing that is wrong: a file of noise may have millions, and an error is kept of each."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import ValidationError

from firable.analysis.evidence import document_records
from firable.nets import bundle_records, interchange
from firable.nets.records import Many, Named, Record, Row


class _Inner(Record):
    name: str


class _Outer(Record):
    items: Many[int]
    names: Named[int]
    inner: Many[_Inner]


class _OfText(Record):
    row: Row[Row[int]]


GOOD: dict[str, Any] = {"items": [1], "names": {"a": 1}, "inner": [{"name": "a"}]}
MANY = 1_000


def refused(model: type[Record], data: Any) -> list[str]:
    """The errors of data, as text and as it is, which are the same."""
    with pytest.raises(ValidationError) as error:
        model.model_validate_json(json.dumps(data))
    found = [f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.value.errors()]
    if model is not _OfText:  # a tuple of Python is no list
        with pytest.raises(ValidationError) as other:
            model.model_validate(data)
        assert [one["loc"] for one in other.value.errors()] == [one["loc"] for one in error.value.errors()]
    return found


def test_what_is_right_is_read() -> None:
    assert _Outer.model_validate(GOOD).inner[0].name == "a"
    assert _OfText.model_validate_json('{"row": [[1], []]}').row == ((1,), ())


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (GOOD | {f"k{i}": 0 for i in range(MANY)}, ": 'k0' is no key here"),
        (GOOD | {"items": ["x"] * MANY}, "items.0: Input should be a valid integer"),
        (GOOD | {"names": dict.fromkeys(map(str, range(MANY)), "x")}, "names.0: Input should be a valid integer"),
        (GOOD | {"inner": [{"name": "a", "more": 0}] * MANY}, "inner.0: 'more' is no key here"),
        (GOOD | {"inner": [{}] * MANY}, "inner.0.name: Field required"),
    ],
)
def test_the_first_wrong_thing_is_told_alone(data: Any, error: str) -> None:
    assert refused(_Outer, data) == [error]


def test_the_first_wrong_item_of_a_tuple_is_told_alone() -> None:
    assert refused(_OfText, {"row": [[1], *[["x"] * MANY] * MANY]}) == ["row.1.0: Input should be a valid integer"]


def test_a_long_key_is_not_told_whole() -> None:
    (told,) = refused(_Outer, GOOD | {"k" * 10_000: 0})
    assert len(told) < 100


def collections(schema: Any) -> Iterator[dict[str, Any]]:
    """The schemas of collections of any length in a schema of pydantic, but for those in which anything may stand."""
    if isinstance(schema, list | tuple):
        for one in schema:
            yield from collections(one)
    if not isinstance(schema, dict):
        return
    kind = schema.get("type")
    of_any_length = kind in {"list", "dict"} or (kind == "tuple" and "variadic_item_index" in schema)
    if of_any_length and schema.get("values_schema", {}).get("type") != "any":
        yield schema
    for key, value in schema.items():
        if key != "metadata":
            yield from collections(value)


@pytest.mark.parametrize(
    "model",
    [
        bundle_records.ManifestRecord,
        bundle_records.TableRecord,
        bundle_records.JudgedRecord,
        interchange._NetRecord,
        document_records.EvidenceRecord,
    ],
)
def test_every_collection_of_a_record_ends_at_its_first_wrong_item(model: type[Record]) -> None:
    model.model_rebuild()
    found = list(collections(model.__pydantic_core_schema__))
    assert found
    assert [schema for schema in found if not schema.get("fail_fast")] == []
