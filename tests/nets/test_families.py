"""The parametric families of the catalogue have as many markings as their docstrings say, and are nets of quality."""

import pytest

from firable.analysis.spaces.reachability import explore
from firable.decompose import split
from firable.nets.catalogue import FAMILIES, catalogue_net, family_net
from firable.nets.catalogue.families import Family
from firable.nets.net import Property
from firable.nets.printing import format_net
from firable.nets.text import parse_net

WITH_DEADLOCKS = {"philosophers": 1, "philosophers_either": 2, "interlocked": 1}
SLOTTED_RING_PUBLISHED = {2: 52, 5: 53_856}
PHILOSOPHERS_PUBLISHED = 1_331_714  # for 16


def small(family: Family) -> list[tuple[int, ...]]:
    if family.name == "vehicles":
        return [(1, 8), (2, 8), (3, 8), (4, 8), (3, 12)]
    return [(n,) for n in range(family.smallest, family.smallest + 4)]


SMALL = [(name, parameters) for name, family in FAMILIES.items() for parameters in small(family)]


@pytest.mark.parametrize(("name", "parameters"), SMALL)
def test_the_markings_of_a_family_are_counted_by_its_formula(name: str, parameters: tuple[int, ...]) -> None:
    formula = FAMILIES[name].markings
    graph = explore(FAMILIES[name].net(*parameters))
    assert graph.complete
    if formula is not None:
        assert graph.n_markings == formula(*parameters)
    # One cell of the grid is full of its one pallet, which nothing can move.
    deadlocks = 1 if (name, parameters) == ("grid", (1,)) else WITH_DEADLOCKS.get(name, 0)
    assert graph.deadlocks.sum() == deadlocks


def test_the_slotted_ring_has_the_published_number_of_markings() -> None:
    for n, markings in SLOTTED_RING_PUBLISHED.items():
        assert explore(family_net(f"slotted_ring-{n}")).n_markings == markings


def test_sixteen_philosophers_have_the_published_number_of_markings() -> None:
    formula = FAMILIES["philosophers"].markings
    assert formula is not None
    assert formula(16) == PHILOSOPHERS_PUBLISHED


def test_the_pipeline_has_as_many_edges_as_its_formula_says() -> None:
    for n in range(2, 8):
        assert explore(family_net(f"pipeline-{n}")).n_edges == (n + 3) * 2 ** (n - 2)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_net_of_a_family_is_contact_free_and_its_property_holds(name: str) -> None:
    net = FAMILIES[name].net(*small(FAMILIES[name])[1])
    graph = explore(net)
    for t in range(len(net.transitions)):
        assert not graph.in_contact(t).any()
    for prop in net.properties:
        assert isinstance(prop, Property)
        assert not graph.satisfying(prop.formula).any()


@pytest.mark.parametrize("name", FAMILIES)
def test_a_net_of_a_family_is_split_and_printed_as_a_net_file(name: str) -> None:
    net = FAMILIES[name].net(*small(FAMILIES[name])[1])
    assert len(split(net).subnets) == len(net.controllers)
    assert parse_net(format_net(net)) == net


def test_the_two_spellings_name_one_net_of_this_name() -> None:
    for spelling in ("philosophers-4", "philosophers(4)"):
        assert catalogue_net(spelling).name == "philosophers-4"
    assert family_net("vehicles-2-8") == family_net("vehicles(2, 8)") == family_net("vehicles(2,8)")
    assert len(family_net("vehicles-2").places) == 3 * 32


@pytest.mark.parametrize("name", ["philosophers", "philosophers-", "philosophers-x", "nobody-5", "philosophers(5", ""])
def test_what_names_no_net_of_a_family_is_a_key_error(name: str) -> None:
    with pytest.raises(KeyError):
        family_net(name)


@pytest.mark.parametrize(
    "name", ["philosophers-1", "philosophers-999999999", "philosophers-2-3", "vehicles-2-9", "vehicles-7-8"]
)
def test_a_size_that_is_not_built_is_a_value_error(name: str) -> None:
    with pytest.raises(ValueError, match=name.partition("-")[0]):
        family_net(name)


def test_every_family_says_how_many_markings_it_has() -> None:
    for family in FAMILIES.values():
        assert "marking" in (family.make.__doc__ or "")


def test_a_large_net_of_a_family_is_built() -> None:
    net = family_net("philosophers-20000")
    assert (len(net.places), len(net.transitions)) == (80_000, 60_000)
