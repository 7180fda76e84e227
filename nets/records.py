"""Strict records: the form of what programs write for programs, of which each value has exactly one.

Whoever reads a net, a bundle or a document of evidence acts on it, so an unknown key, a missing one or a value of
another type is refused. It is refused at the first that is wrong: what pydantic keeps of each error takes some hundred
times the memory of a wrong value, and a file may have millions of them. So a record keeps unknown keys until it has
looked whether there is one, in place of an error for each, and what holds many things is read as far as its first wrong
one.
"""

from __future__ import annotations

from typing import Annotated, Self, TypeVar

from pydantic import BaseModel, ConfigDict, FailFast, model_validator
from pydantic_core import PydanticCustomError

T = TypeVar("T")
Many = Annotated[list[T], FailFast()]
"""A list, read as far as its first wrong item."""
Row = Annotated[tuple[T, ...], FailFast()]
"""The same as a tuple; JSON text has one where data in Python would need it to be one already."""
Named = Annotated[dict[str, T], FailFast()]
"""Values by names, read as far as the first wrong one."""


class Record(BaseModel):
    """Data of one shape; whatever else stands there is refused."""

    model_config = ConfigDict(defer_build=True, extra="allow", strict=True, frozen=True)

    @model_validator(mode="after")
    def _has_no_other_key(self) -> Self:
        for key in self.__pydantic_extra__ or ():
            raise PydanticCustomError("unknown_key", "'{key}' is no key here", {"key": key[:60]})
        return self
