"""The cells of the catalogue, split, with their plants: what tests of the executor run."""

from functools import cache

from firable.decompose.splitting.cut import split
from firable.executor.operating.host import Host
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.machines.plant_file import PlantModel, read_plant


@cache
def decomposition_of(cell: str) -> Decomposition:
    return split(catalogue_net(cell))


@cache
def plant_of(cell: str) -> PlantModel:
    return read_plant(catalogue_path(cell).with_name(f"{cell}.plant.yaml"))


def firings(host: Host) -> int:
    return sum(host.recorder.firings.values())
