"""Snapshots of the machines: copies, values to compare them by, and the numbers in them counted from the beginning.

A machine is a Python object that changes. To explore what it can do it is copied before each act, and two machines are
the same iff all that can change in them is the same. Neither asks what a field means: every field is copied and
compared, whatever is added to the machines later, and a kind of thing that is not known here is refused.
"""

from __future__ import annotations

from collections.abc import Hashable
from copy import copy
from dataclasses import fields, is_dataclass, replace
from enum import Enum
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
_FIXED: Final = (Net, TokenPlayer, Compiled, Arbitration)
_SIMPLE: Final = (bool, int, float, str, type(None), Enum, frozenset)
_CHANGING: Final = (LocalController, Coordinator, Commands, Arbiter, Timers)
_DERIVED: Final = EnabledSet
"""What only remembers what follows from the rest."""


def clone(value: T) -> T:
    """A copy that shares nothing that can change."""
    made: T = _cloned(value)
    return made


def _cloned(value: Any) -> Any:
    if isinstance(value, (*_SIMPLE, *_FIXED)):
        return value
    if isinstance(value, _DERIVED):
        return copy(value)  # it changes its numbers, and shares its tables
    if isinstance(value, tuple):
        return value if not any(_changes(each) for each in value) else tuple(map(_cloned, value))
    if isinstance(value, dict):
        return {key: _cloned(each) for key, each in value.items()}
    if isinstance(value, set):
        return set(value)
    if isinstance(value, list):
        return [_cloned(each) for each in value]
    if is_dataclass(value) and not isinstance(value, type):
        if isinstance(value, Hashable):  # it is frozen
            return value
        return replace(value, **{f.name: _cloned(getattr(value, f.name)) for f in fields(value)})
    if isinstance(value, _CHANGING):
        made = object.__new__(type(value))
        vars(made).update({name: _cloned(each) for name, each in vars(value).items()})
        return made
    raise TypeError(f"a machine holds a {type(value).__name__}, which is not known here")


def _changes(value: Any) -> bool:
    return isinstance(value, (dict, set, list, _DERIVED, *_CHANGING))


def frozen(value: Any) -> Hashable:
    """A value that is equal for two machines iff all that can change in them is."""
    if isinstance(value, (*_FIXED, _DERIVED)):
        return None
    if isinstance(value, _SIMPLE):
        return value
    if isinstance(value, tuple | list):
        return tuple(map(frozen, value))
    if isinstance(value, dict):
        return tuple((key, frozen(each)) for key, each in value.items())
    if isinstance(value, set):
        return frozenset(value)
    if is_dataclass(value) and not isinstance(value, type):
        return tuple(frozen(getattr(value, f.name)) for f in fields(value))
    if isinstance(value, _CHANGING):
        return tuple(frozen(each) for each in vars(value).values())
    raise TypeError(f"a machine holds a {type(value).__name__}, which is not known here")
