"""Records: values that nobody changes, made quickly.

What the protocol says and does is made of small frozen values, and a reaction to one signal makes ten of them. Python
guards a frozen dataclass at run time by a `__setattr__` that refuses, so that its own `__init__` has to go around it,
field by field: to make one takes three times as long. Here the type checker is the guard: an assignment to a field of
a record is an error there (PEP 681). Compared, hashed and shared they are as any other value.

Rejected: named tuples. They are made as quickly, but are equal to every tuple of the same parts, and a `Taken` would
be equal to a `Keep`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def record(kind: type[T]) -> type[T]:
    """Make a class of annotated fields a record.

    >>> @record
    ... class Point:
    ...     x: int
    ...     y: int = 0
    >>> Point(1), Point(1) == Point(1, 0), len({Point(1), Point(1, 0)})
    (Point(x=1, y=0), True, 1)
    """
    return dataclass(slots=True, unsafe_hash=True)(kind)
