"""The names of a package, loaded when they are asked for (PEP 562): who needs one of them does not wait for all.

Type checkers see the imports under `TYPE_CHECKING` and not this, so that a name that is misspelt is found.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module


def loaded_when_asked(package: str, modules: Mapping[str, Iterable[str]]) -> Callable[[str], object]:
    """The `__getattr__` of a package, by the names that each of its modules gives it.

    >>> loaded_when_asked("firable.nets", {"verdict": ["Status"]})("Status").__module__
    'firable.nets.verdict'
    """
    module_of = {name: module for module, names in modules.items() for name in names}

    def load(name: str) -> object:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value: object = getattr(import_module(f"{package}.{module_of[name]}"), name)
        vars(sys.modules[package])[name] = value
        return value

    return load
