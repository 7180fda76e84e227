"""What cells do whose signals are messages on wires is in their loops; of small cells, no loop does anything else."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support import inspected_cell, rejecting_cell
from support.between_cells import beside, blind, both, bouncing, by_sensors, formed, in_between, leaving, twice
from support.drawn_cells import drawn_cell
from support.examples import seeds
from support.physical_cell import PhysicalCell, reached
from support.stale_cells import carried, stopped
from support.together_cell import belts, together

from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.excluding import Excluding
from firable.nets.machines.loop import Sending
from firable.nets.machines.moment import Case
from firable.nets.machines.plant_file import PlantModel
from firable.nets.machines.telling import Telling
from firable.nets.net import Net
from firable.nets.text import parse_net

CELLS: dict[str, Callable[[], tuple[Net, PlantModel]]] = {
    **{one.__name__: one for one in (beside, blind, both, bouncing, by_sensors, formed, leaving, twice)},
    **{one.__name__: one for one in (carried, stopped, together, belts)},
    "pressed": lambda: in_between("{acknowledges: B}"),
    "flickering": lambda: in_between("{occupied: entry, may_flicker: true}"),
    "lingering": lambda: belts(", may_linger: true"),
    "inspected": lambda: (inspected_cell.net(), inspected_cell.plant()),
    "one_robot": lambda: (catalogue_net("one_robot"), catalogue_plant("one_robot")),
    "rejecting": lambda: (rejecting_cell.net(), rejecting_cell.plant()),
}


def judged() -> tuple[Net, PlantModel]:
    """The completion of a command is formed with what a camera finds, and there is a time limit for it."""
    net = rejecting_cell.NET.replace("until: cut}", "until: cut, within: 9s}")
    sensor = "  cell.nok: {fails: entry}\n"
    return parse_net(net), rejecting_cell.plant(
        rejecting_cell.PLANT.replace(sensor, f"{sensor}  cell.cut: {{passes: table}}\n")
    )


@pytest.mark.parametrize("sending", Sending)
def test_a_completion_that_a_camera_forms_is_told(sending: Sending) -> None:
    assert not differ(*judged(), sending)
    assert any("cell.freeing" in one for one in reached(close(*judged(), sending=sending), 10_000) or ())


def differ(net: Net, model: PlantModel, sending: Sending) -> bool:
    """Whether a cell does something that its loop does not, or the other way."""
    found, complete = PhysicalCell(net, model, sending).runs(10_000)
    assert complete
    return found.keys() != reached(close(net, model, sending=sending), 10_000)


@pytest.mark.parametrize("sending", Sending)
@pytest.mark.parametrize("cell", CELLS.values(), ids=CELLS)
def test_a_cell_with_wires_does_what_its_loop_does(
    cell: Callable[[], tuple[Net, PlantModel]], sending: Sending
) -> None:
    assert not differ(*cell(), sending)


@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(2))
def test_what_drawn_cells_with_wires_do_is_in_their_loops(chunk: int) -> None:
    cells = [(drawn_cell(seed), sending) for seed in seeds(3, chunk) for sending in Sending]
    compared = 0
    for cell, sending in cells:
        if (markings := reached(close(cell.net, cell.plant, sending=sending), 20_000)) is not None:
            found, _ = PhysicalCell(cell.net, cell.plant, sending).runs(2_000)
            assert not {run for marking, run in found.items() if marking not in markings}, cell
            compared += 1
    assert compared > len(cells) / 2


@pytest.mark.parametrize(
    ("of", "what", "instead", "cell"),
    [
        (Telling, "told_late", lambda *_: frozenset(), "together"),
        (Excluding, "excludes", lambda *_, **__: True, "together"),
        (Telling, "moves", lambda _: iter(()), "carried"),
        (Telling, "behind", {}, "beside"),
        (Telling, "is_told", lambda *_: Case(), "pressed"),
        (Telling, "may_end", lambda *_: Case(), "by_sensors"),
        (Telling, "sent", lambda *args: [args[1]], "by_sensors"),
    ],
)
def test_a_loop_that_tells_otherwise_does_not(
    of: type, what: str, instead: object, cell: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(of, what, instead)
    assert differ(*CELLS[cell](), Sending.AT_ONCE)
