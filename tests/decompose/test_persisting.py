"""Whether the machines keep the gates of global transitions open from the vote to the firing (O4)."""

from __future__ import annotations

import pytest

from firable.decompose.proofs.assumptions import assumptions
from firable.decompose.proofs.persisting import COMPLETIONS, name_of, persistence
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net, catalogue_path, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.text import parse_net
from firable.nets.verdict import Status
from firable.semantics.player import Player

CELLS = ["one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "two_robots_shared", "two_robots_separate"]


def plant_with(old: str, new: str) -> PlantModel:
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    assert old in text
    return parse_plant(text.replace(old, new))


@pytest.mark.parametrize("cell", CELLS)
def test_the_machines_of_the_catalogue_keep_every_assumption(cell: str) -> None:
    decomposition = split(catalogue_net(cell))
    verdicts = persistence(decomposition, close(decomposition.net, catalogue_plant(cell)))
    assert [verdict.name for verdict in verdicts] == [*map(name_of, assumptions(decomposition)), COMPLETIONS]
    assert all(verdict.holds for verdict in verdicts)


@pytest.mark.parametrize(
    ("old", "new", "name", "move"),
    [
        ("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}", "o4.G4.mc.part_present", "drops"),
        ("{occupied: cv1_entry}", "{occupied: cv1_entry, may_linger: true}", "o4.G1.conveyor.part_at_entry", "clears"),
    ],
)
def test_a_sensor_that_is_not_exact_breaks_its_assumption_alone(old: str, new: str, name: str, move: str) -> None:
    plant = plant_with(old, new)
    net = catalogue_net("one_robot")
    verdicts = {verdict.name: verdict for verdict in persistence(split(net), close(net, plant))}
    broken = verdicts.pop(name)
    assert broken.status is Status.VIOLATED
    assert "interlock" in broken.hint
    assert broken.witness is not None
    assert broken.witness.firings[-1] == (f"{name.split('.', 2)[2]}/{move}",)
    assert all(verdict.holds for verdict in verdicts.values())

    loop = close(net, plant)
    player, marking = Player(loop.net), loop.net.initial_marking
    place, means = loop.shown[name.split(".", 2)[2]]
    shown = []
    for (fired,) in broken.witness.firings:
        shown.append(bool(marking >> loop.net.place_index[place] & 1) == means)
        marking = player.fire(marking, [loop.net.transition_index[fired]])
    assert loop.net.names(marking) == broken.witness.marking
    assert shown[-1], "open at the vote"
    assert (place in broken.witness.marking) != means, "and closed after it"


def test_a_gate_that_another_machine_closes_is_found() -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    # The exit is free now: nothing keeps it so until the robot has put its workpiece.
    wrong = text.replace(
        "from: [system.processing, robot.free, mc.release, conveyor.cv2]\n",
        "from: [system.processing, robot.free, mc.release, conveyor.cv2]\n    unless: mc.entry_taken\n",
    ).replace("inputs: part_present", "inputs: [part_present, entry_taken]")
    plant = plant_with(
        "robot.touch:            {holding: R}", "robot.touch: {holding: R}\n  mc.entry_taken: {occupied: cv1_entry}"
    )
    net = parse_net(wrong)
    verdicts = {verdict.name: verdict for verdict in persistence(split(net), close(net, plant))}
    taken = verdicts["o4.G6.mc.entry_taken"]
    assert taken.status is Status.VIOLATED
    assert taken.witness is not None
    assert taken.witness.firings[-1] == ("arrives/cv1_entry",)
    assert taken.witness.note == "'t2-42' had voted yes, and the last firing makes 'mc.entry_taken' 1"
