"""Snapshots of the machines: copies, values to compare them by, and the numbers in them counted from the beginning.

A machine is a Python object that changes. To explore what it can do it is copied before each act, and two machines are
the same iff all that can change in them is the same. Neither asks what a field means: every field is copied and
compared, whatever is added to the machines later, and a kind of thing that is not known here is refused. How a kind of
thing is copied and compared is looked up once for each type, as explorations do little else.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from copy import copy
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import Any, Final, TypeVar

from firable.executor.protocol.commands import Commands
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.enabled import EnabledSet
from firable.executor.protocol.timers import Timers
from firable.executor.protocol.token_player import Arbiter, Compiled, TokenPlayer
from firable.nets.net import Net
from firable.semantics.arbitration import Arbitration

T = TypeVar("T")
_FIXED: Final = (Net, TokenPlayer, Compiled, Arbitration, MappingProxyType)
_SIMPLE: Final = (bool, int, float, str, type(None), Enum, frozenset)
_CHANGING: Final = (LocalController, Coordinator, Commands, Arbiter, Timers)
_DERIVED: Final = EnabledSet
"""What only remembers what follows from the rest."""


def clone(value: T) -> T:
    """A copy that shares nothing that can change."""
    made: T = _cloned(value)
    return made


def frozen(value: Any) -> Hashable:
    """A value that is equal for two machines iff all that can change in them is."""
    freezer = _freezer(value.__class__)
    found: Hashable = value if freezer is None else freezer(value)
    return found


def _cloned(value: Any) -> Any:
    copier = _copier(value.__class__)
    return value if copier is None else copier(value)


@cache
def _copier(of: type) -> Callable[[Any], Any] | None:
    """How values of a type are copied; None where they never change."""
    if issubclass(of, (*_SIMPLE, *_FIXED)) or _is_frozen(of):
        return None
    if issubclass(of, _DERIVED):
        return copy  # it changes its numbers, and shares its tables
    for known, copier in ((tuple, _copy_of_tuple), (dict, _copy_of_dict), (set, set), (list, _copy_of_list)):
        if issubclass(of, known):
            return copier
    if is_dataclass(of):
        names = _names(of)
        return lambda value: of(*_copy_of_list([getattr(value, name) for name in names]))
    if issubclass(of, _CHANGING):
        return _copy_of_machine
    raise TypeError(f"a machine holds a {of.__name__}, which is not known here")


def _copy_of_tuple(value: tuple[Any, ...]) -> tuple[Any, ...]:
    for each in value:
        if _copier(each.__class__) is not None:
            return tuple(_copy_of_list(value))
    return value


def _copy_of_dict(value: dict[Any, Any]) -> dict[Any, Any]:
    made = value.copy()
    for key, each in value.items():
        if (copier := _copier(each.__class__)) is not None:
            made[key] = copier(each)
    return made


def _copy_of_list(value: Iterable[Any]) -> list[Any]:
    return [each if (copier := _copier(each.__class__)) is None else copier(each) for each in value]


def _copy_of_machine(value: Any) -> Any:
    made = object.__new__(type(value))
    vars(made).update(_copy_of_dict(vars(value)))
    return made


@cache
def _freezer(of: type) -> Callable[[Any], Hashable] | None:
    """What values of a type are compared by; None where by themselves."""
    if issubclass(of, (*_FIXED, _DERIVED)):
        return lambda _: None
    if issubclass(of, _SIMPLE) or _is_frozen(of):
        return None
    if issubclass(of, tuple | list):
        return _frozen_each
    if issubclass(of, dict):
        return lambda value: tuple(zip(value, _frozen_each(value.values()), strict=True))
    if issubclass(of, set):
        return frozenset
    if is_dataclass(of):
        names = _names(of)
        return lambda value: _frozen_each([getattr(value, name) for name in names])
    if issubclass(of, _CHANGING):
        return lambda value: _frozen_each(vars(value).values())
    raise TypeError(f"a machine holds a {of.__name__}, which is not known here")


def _frozen_each(values: Iterable[Any]) -> tuple[Hashable, ...]:
    # What `frozen` says of each, without a call for each: most are compared by themselves.
    return tuple([each if (freezer := _freezer(each.__class__)) is None else freezer(each) for each in values])


def _is_frozen(of: type) -> bool:
    return is_dataclass(of) and of.__hash__ is not None


def _names(of: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(of))
