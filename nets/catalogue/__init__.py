"""The catalogue: example cells in the net format, installed with the package.

A net of the catalogue is a file beside this module, `NAME.firable.yaml`, and nothing else: to add one, add the file.
They are read by the same reader as a user's file, so that the examples cannot drift from the format; the alternative,
nets built by Python code, shows nobody how to write one.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from firable.nets.net import Net
from firable.nets.text import read_net

_SUFFIX = ".firable.yaml"


def catalogue_names() -> tuple[str, ...]:
    """The names of the nets of the catalogue, sorted.

    >>> "one_robot" in catalogue_names()
    True
    """
    return tuple(sorted(path.name.removesuffix(_SUFFIX) for path in Path(__file__).parent.glob(f"*{_SUFFIX}")))


def catalogue_path(name: str) -> Path:
    """The file of a net of the catalogue; `KeyError` where there is no such net."""
    if name not in catalogue_names():
        raise KeyError(name)
    return Path(__file__).parent / f"{name}{_SUFFIX}"


@cache
def catalogue_net(name: str) -> Net:
    """The net of this name; `KeyError` where there is none.

    >>> len(catalogue_net("one_robot").places)
    28
    """
    return read_net(catalogue_path(name))
