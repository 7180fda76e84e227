"""What a net may say and hardly means: places that nothing fills, commands that the next one overtakes."""

import pytest

from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.oversights import oversights
from firable.nets.text import parse_net

CELL = """\
firable: 1
cell: c
controllers:
  r:
    start: home
    inputs: [seen]
    places:
      home:
      out:  {send: {machine: R, command: MOVE}}
      grip: {send: {machine: R, command: GRASP}, until: grasped}
      lamp: {send: {machine: L, command: LIGHT}}
      zone:
transitions:
  go:   {from: r.home, to: r.out, unless: r.zone}
  take: {from: r.out, to: [r.grip, r.lamp]}
  end:  {from: [r.grip, r.lamp], to: r.home}
"""


def told(text: str) -> list[tuple[str, tuple[str, ...]]]:
    return [(one.code, one.subject) for one in oversights(parse_net(text))]


def test_a_place_that_nothing_fills_and_a_command_that_is_overtaken_are_told() -> None:
    assert told(CELL) == [("F2032", ("places", "r.out")), ("F2031", ("places", "r.zone"))]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("command: MOVE}}", "command: MOVE}, until: there}"),
        ("from: r.out, to", "from: r.out, if: r.seen, to"),
        ("from: r.out, to", "from: r.out, unless: r.seen, to"),
        ("from: r.out, to", "from: r.out, unless: r.home, to"),
        ("from: r.out, to", "from: [r.out, r.zone], to"),
        ("machine: R, command: GRASP", "machine: G, command: GRASP"),
    ],
)
def test_a_command_that_is_waited_for_or_goes_to_another_machine_is_not_overtaken(old: str, new: str) -> None:
    assert old in CELL
    assert "F2032" not in dict(told(CELL.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("start: home", "start: [home, zone]"),
        ("to: r.home}", "to: [r.home, r.zone]}"),
        ("unless: r.zone", "if: r.zone"),  # it is dead, which `quasi-live` tells
        ("from: r.home, to: r.out, unless: r.zone", "from: [r.home, r.zone], to: r.out"),  # so here
    ],
)
def test_a_place_that_is_filled_or_whose_transitions_are_dead_is_not_told(old: str, new: str) -> None:
    assert old in CELL
    assert "F2031" not in dict(told(CELL.replace(old, new)))


@pytest.mark.parametrize("name", catalogue_names())
def test_no_cell_of_the_catalogue_has_such_oversights(name: str) -> None:
    assert not list(oversights(catalogue_net(name)))
