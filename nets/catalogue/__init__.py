"""The catalogue: example cells in the net format, and parametric families, installed with the package.

A cell of the catalogue is a file beside this module, `NAME.firable.yaml`, and nothing else: to add one, add the file.
`*.tasks.yaml` holds the tasks that the conceptual ones name. They are read by the same readers as a user's files, so
that the examples cannot drift from the format; the alternative, nets built by Python code, shows nobody how to write
one. The families are built by code all the same
(`families.py`), because their nets have any size: they are there to measure and to test with.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from firable.nets.catalogue.families import FAMILIES, family_net
from firable.nets.net import Net

if TYPE_CHECKING:  # what reads files is loaded for who reads one: a net of a family is in none
    from firable.nets.machines.plant_file import PlantModel
    from firable.nets.tasks.model import Task

__all__ = [
    "FAMILIES",
    "catalogue_names",
    "catalogue_net",
    "catalogue_path",
    "catalogue_plant",
    "catalogue_tasks",
    "family_net",
]

_SUFFIX = ".firable.yaml"


def catalogue_names() -> tuple[str, ...]:
    """The names of the cells of the catalogue, sorted; those of the families are in `FAMILIES`.

    >>> "one_robot" in catalogue_names()
    True
    """
    return tuple(sorted(path.name.removesuffix(_SUFFIX) for path in Path(__file__).parent.glob(f"*{_SUFFIX}")))


def catalogue_path(name: str) -> Path:
    """The file of a cell of the catalogue; `KeyError` where there is no such cell."""
    if name not in catalogue_names():
        raise KeyError(name)
    return Path(__file__).parent / f"{name}{_SUFFIX}"


def catalogue_net(name: str) -> Net:
    """The net of this name, a cell's or such as `philosophers-5` a family's; `KeyError` where there is none.

    Raises `ValueError` for a size of a family that is not built.

    >>> len(catalogue_net("one_robot").places), len(catalogue_net("philosophers-5").places)
    (28, 20)
    """
    return _cell(name) if name in catalogue_names() else family_net(name)


def catalogue_plant(name: str) -> PlantModel:
    """The machines of a cell of the catalogue; `KeyError` where there is no such cell or it has none."""
    from firable.nets.machines.plant_file import read_plant

    path = catalogue_path(name).with_name(f"{name}.plant.yaml")
    if not path.exists():
        raise KeyError(name)
    return read_plant(path)


@cache
def catalogue_tasks() -> Mapping[str, Task]:
    """The registered tasks of the catalogue's cells, by name: those of every `*.tasks.yaml` beside this module.

    >>> sorted(catalogue_tasks())
    ['carry_in', 'carry_out', 'load', 'process', 'unload']
    """
    from firable.nets.tasks.text import read_tasks

    files = sorted(Path(__file__).parent.glob("*.tasks.yaml"))
    return {name: task for file in files for name, task in read_tasks(file).items()}


@cache
def _cell(name: str) -> Net:
    from firable.nets.text import read_net

    return read_net(catalogue_path(name))
