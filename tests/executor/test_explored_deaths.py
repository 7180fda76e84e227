"""What the prover says of the dead is so of the machines that run, explored in every order with somebody killed."""

from collections.abc import Iterator

import pytest
from support.explored_deaths import Bereavement, bereavements
from support.free_parts import freed
from support.looping_nets import looping_net

from firable.decompose.protocol.bereft import Bereft
from firable.decompose.protocol.outages import Outage, commanding, outages
from firable.decompose.splitting.cut import split
from firable.nets.decomposition import Decomposition
from firable.nets.net import Net

MOST = 20_000


def contradictions(net: Net, said: Outage, found: Bereavement) -> Iterator[str]:
    """What is said of somebody dead, and is not so."""
    yield from (f"{t} fires" for t in said.at_once if t in found.fired)
    yield from (f"{t} is kept back" for t in said.goes_on if (t,) in found.kept_back)
    sending = commanding(net, (*said.at_once, *said.at_last, *said.goes_on))
    yield from (f"{machine} stands still" for machine in said.running if sending[machine] in found.kept_back)


def compared(decomposition: Decomposition) -> Iterator[tuple[Outage, Bereavement, list[str]]]:
    for said, found in zip(outages(decomposition), bereavements(decomposition, MOST), strict=True):
        yield said, found, list(contradictions(decomposition.net, said, found))


@pytest.mark.parametrize(
    "decomposition",
    [split(looping_net(21)), freed(split(looping_net(21))), split(looping_net(22))],
    ids=["promising", "free", "more of both"],
)
def test_what_is_said_of_the_dead_is_so_of_all_that_the_machines_can_do(decomposition: Decomposition) -> None:
    went_on = over = 0
    for said, found, wrong in compared(decomposition):
        assert found.complete
        assert wrong == []
        went_on += len(said.goes_on)
        over += len(said.at_once)
    assert over > 3
    assert went_on > 3


def test_a_prover_that_holds_nothing_up_is_contradicted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Bereft, "held_up", frozenset())
    monkeypatch.setattr(Bereft, "at_once", frozenset())
    assert any(wrong for _, _, wrong in compared(split(looping_net(21))))


def test_a_prover_that_takes_for_over_what_goes_on_is_contradicted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Bereft, "at_once", property(lambda self: frozenset(t.name for t in self.parts.transitions)))
    assert any(wrong for _, _, wrong in compared(split(looping_net(21))))
