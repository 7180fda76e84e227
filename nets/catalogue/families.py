"""The parametric families of the catalogue: one net for each size, by name.

`philosophers-16` and `philosophers(16)` name the same net. The table below holds each family with the sizes that are
built, and the number of its markings where a formula is known. They are made by Python code, which the files of the
catalogue are not, because no one writes a net of ten thousand places; `firable convert catalogue:philosophers-5 -o
FILE` shows how one looks in the net format.

To add one: its maker in `processes.py` or `plants.py`, whose docstring says how many markings there are and why; one
row here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import comb, perm
from types import MappingProxyType
from typing import Final

from firable.nets.catalogue import plants, processes
from firable.nets.net import Net

_NAMED: Final = re.compile(r"([a-z_]+)(?:-([0-9]{1,9}(?:-[0-9]{1,9})*)|\(([0-9]{1,9}(?:, ?[0-9]{1,9})*)\))")


@dataclass(frozen=True, slots=True)
class Family:
    """A family: what makes its nets, between which sizes, and how many markings they have, if a formula is known."""

    name: str
    make: Callable[..., Net]
    smallest: int
    largest: int
    markings: Callable[..., int] | None = None
    n_parameters: int = 1

    def net(self, *parameters: int) -> Net:
        """The net of this size; `ValueError`, with the sizes that there are, where there is none."""
        n = parameters[0] if parameters else 0
        if not 1 <= len(parameters) <= self.n_parameters:
            numbers = "one number" if self.n_parameters == 1 else f"1 to {self.n_parameters} numbers"
            raise ValueError(f"'{self.name}' takes {numbers}")
        if not self.smallest <= n <= self.largest:
            raise ValueError(f"the sizes of '{self.name}' are {self.smallest:,} to {self.largest:,}, not {n:,}")
        return self.make(*parameters)


def _pell_lucas(n: int) -> int:
    before, here = 2, 2
    for _ in range(n - 1):
        before, here = here, 2 * here + before
    return here


FAMILIES: Final[Mapping[str, Family]] = MappingProxyType(
    {
        family.name: family
        for family in (
            Family("philosophers", processes.philosophers, 2, 250_000, _pell_lucas),
            Family("philosophers_either", processes.philosophers_either, 2, 200_000, lambda n: 3**n),
            Family("machines", processes.machines, 1, 500_000, lambda n: 2**n),
            Family("interlocked", processes.interlocked, 2, 300_000, lambda n: 3**n - 1),
            Family("token_ring", processes.token_ring, 2, 250_000, lambda n: 3 * n * 2 ** (n - 1)),
            Family("slotted_ring", processes.slotted_ring, 2, 100_000),
            Family("counter", processes.counter, 1, 1_000, lambda n: 2**n),
            Family("pipeline", plants.pipeline, 1, 500_000, lambda n: 2**n),
            Family("grid", plants.grid, 1, 500, lambda n: comb(n * n, n)),
            Family(
                "manufacturing_cells", plants.manufacturing_cells, 1, 200_000, lambda n: 13 ** (n // 2) * 4 ** (n % 2)
            ),
            Family("workshop", plants.workshop, 1, 20_000, plants.workshop_markings),
            Family("vehicles", plants.vehicles, 1, 1_000, lambda n, zones=32: perm(zones, n), 2),
        )
    }
)
"""Each family by its name."""


def family_net(name: str) -> Net:
    """The net that a name such as `philosophers-5`, `philosophers(5)` or `vehicles-8-32` names.

    Raises `KeyError` for a name that is none of a family with a size, `ValueError` for a size that is not built.

    >>> net = family_net("philosophers-3")
    >>> net.name, len(net.places), family_net("philosophers(3)") == net
    ('philosophers-3', 12, True)
    """
    named = _NAMED.fullmatch(name)
    if named is None or named[1] not in FAMILIES:
        raise KeyError(name)
    return FAMILIES[named[1]].net(*map(int, re.findall("[0-9]+", named[2] or named[3])))
