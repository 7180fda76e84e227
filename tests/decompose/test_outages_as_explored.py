"""What the dead keep back is what exploring the protocol finds, and for controllers more, as a round may stay open."""

from collections.abc import Callable

import pytest
from support.explored_outages import is_as_explored
from support.free_parts import with_free_parts
from support.layered_nets import cells_in_a_line
from support.looping_nets import looping_net
from support.outage_nets import gated, overtaken
from support.owned_nets import owned_net

from firable.decompose.protocol.outages import outages
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net


@pytest.mark.parametrize("seed", [1, 3, 5, 8])
def test_what_the_dead_keep_back_is_what_exploring_the_protocol_finds_where_loops_are_read(seed: int) -> None:
    assert is_as_explored(looping_net(seed))


@pytest.mark.parametrize("seed", range(6))
def test_what_the_dead_keep_back_is_what_exploring_the_protocol_finds(seed: int) -> None:
    assert is_as_explored(owned_net(seed))


@pytest.mark.parametrize(
    ("make", "seed"), [*((owned_net, seed) for seed in range(5)), *((looping_net, seed) for seed in (1, 3, 5))]
)
def test_what_goes_on_beside_free_parts_goes_on_where_their_protocol_is_explored(
    make: Callable[[int], Net], seed: int
) -> None:
    assert is_as_explored(make(seed), with_free_parts)


@pytest.mark.parametrize("make", [cells_in_a_line, gated])
def test_what_goes_on_beside_free_parts_in_layers_and_behind_gates_is_explored(make: Callable[[], Net]) -> None:
    assert is_as_explored(make(), with_free_parts)
    assert is_as_explored(overtaken(), with_free_parts)


def test_a_part_whose_order_never_comes_keeps_back_what_needs_its_tokens_after_others_have_gone_on() -> None:
    assert is_as_explored(overtaken())
    dead = {outage.name: outage for outage in outages(split(overtaken()))}
    assert dead["coordinator line"].at_last == ("l", "alone", "y", "x", "again")


def test_a_promise_that_nobody_takes_back_keeps_still_what_it_reads() -> None:
    dead = {outage.name: outage for outage in outages(split(gated()))}
    assert dead["the coordinator"].at_once == ("G", "H")
    assert dead["the coordinator"].at_last == ("turn", "back")
    assert dead["b"].goes_on == ()  # `b` may have been asked for `G` too, and `a` have promised its part


@pytest.mark.parametrize("name", ["conceptual_one_robot", "one_robot", "two_robots_separate", "two_cells"])
def test_of_everybody_in_the_cells_of_the_catalogue_it_is_known(name: str) -> None:
    assert [outage.name for outage in outages(split(catalogue_net(name))) if outage.bound] == []
