"""The catalogue's cells are the reference nets, under the renaming written out here."""

from collections.abc import Mapping
from dataclasses import dataclass

import pytest
from support.reference import load_net

from firable.nets.catalogue import catalogue_names, catalogue_net, catalogue_path
from firable.nets.net import Command, Net
from firable.nets.text import read_net

SYSTEM = {
    "Carrying_in": "system.carrying_in",
    "Loading": "system.loading",
    "Processing": "system.processing",
    "Unloading": "system.unloading",
    "Carrying_out": "system.carrying_out",
    "Capacity": "system.capacity",
}
LOADING = {
    "R_to_CV1": "to_cv1",
    "R_grasp_CV1": "grasp_cv1",
    "R_to_MC_full": "to_mc",
    "R_put_MC": "put_mc",
    "R_back": "back",
}
UNLOADING = {
    "R_to_MC_empty": "to_mc_empty",
    "R_grasp_MC": "grasp_mc",
    "R_to_CV2": "to_cv2",
    "R_put_CV2": "put_cv2",
}
MACHINES = {
    "MC": "mc.free",
    "MC_wait_put": "mc.wait_put",
    "MC_loaded": "mc.loaded",
    "MC_fix": "mc.fix",
    "MC_machining": "mc.machining",
    "MC_release": "mc.release",
    "MC_wait_grasp": "mc.wait_grasp",
    "CV1": "conveyor.cv1",
    "CV1_run": "conveyor.cv1_run",
    "CV1_wait_grasp": "conveyor.cv1_wait",
    "CV2": "conveyor.cv2",
    "CV2_wait_put": "conveyor.cv2_wait",
    "CV2_run": "conveyor.cv2_run",
    "mc.part_present": "mc.part_present",
    "mc.clamped": "mc.clamped",
    "mc.program_end": "mc.program_end",
    "mc.released": "mc.released",
    "cv1.part_at_entry": "conveyor.part_at_entry",
    "cv1.part_at_end": "conveyor.part_at_end",
    "cv2.part_at_exit": "conveyor.part_at_exit",
}
SIGNALS_LOADING = ("at_cv1", "touch", "at_mc", "put_done", "at_home")
SIGNALS_UNLOADING = ("at_mc", "touch", "at_cv2", "put_done")


def of(controller: str, names: Mapping[str, str]) -> dict[str, str]:
    return {reference: f"{controller}.{ours}" for reference, ours in names.items()}


ONE_ROBOT = {
    **SYSTEM,
    **MACHINES,
    **of("robot", {"Robot": "free", **LOADING, **UNLOADING}),
    **{f"r.{signal}": f"robot.{signal}" for signal in {*SIGNALS_LOADING, *SIGNALS_UNLOADING}},
}
TWO_SHARED = {
    **SYSTEM,
    **MACHINES,
    **of("robots", {"R1": "r1_free", "R2": "r2_free", **LOADING, **UNLOADING}),
    **{f"r1.{signal}": f"robots.r1_{signal}" for signal in SIGNALS_LOADING},
    **{f"r2.{signal}": f"robots.r2_{signal}" for signal in SIGNALS_UNLOADING},
}
TWO_SEPARATE = {
    **SYSTEM,
    **MACHINES,
    **of("r1", {"R1": "free", **LOADING}),
    **of("r2", {"R2": "free", **UNLOADING}),
    **{f"r1.{signal}": f"r1.{signal}" for signal in SIGNALS_LOADING},
    **{f"r2.{signal}": f"r2.{signal}" for signal in SIGNALS_UNLOADING},
}
CONCEPTUAL = {
    **SYSTEM,
    "CV1": "system.cv1",
    "Robot": "system.robot",
    "R1": "system.r1",
    "R2": "system.r2",
    "MC": "system.mc",
    "CV2": "system.cv2",
}


@dataclass(frozen=True)
class Twin:
    """A net of the catalogue, its reference, and how to rename the reference; controllers by number."""

    ours: str
    reference: str
    names: Mapping[str, str]
    controllers: tuple[str, ...]


CELL = ("system", "robot", "mc", "conveyor")
TWINS = (
    Twin("one_robot", "cell1", ONE_ROBOT, CELL),
    Twin("one_robot_mc_late", "cell1_mc_late", ONE_ROBOT, CELL),
    Twin("one_robot_mc_late_capacity", "cell1_mc_late_cap", ONE_ROBOT, CELL),
    Twin("two_robots_shared", "cell2_shared", TWO_SHARED, ("system", "robots", "mc", "conveyor")),
    Twin("two_robots_separate", "cell2_separate", TWO_SEPARATE, ("system", "r1", "mc", "conveyor", "r2")),
    Twin("conceptual_one_robot", "conceptual1", CONCEPTUAL, ("system",)),
    Twin("conceptual_one_robot_mc_late", "conceptual1_mc_late", CONCEPTUAL, ("system",)),
    Twin("conceptual_two_robots", "conceptual2", CONCEPTUAL, ("system",)),
    Twin("conceptual_two_robots_shared", "conceptual2", CONCEPTUAL, ("system",)),
)


WITHOUT_REFERENCE = {"index_table", "one_robot_timed", "two_cells"}
"""Their figures stand in the tests of what they are there to show."""


def parts(net: Net, names: Mapping[str, str], owners: Mapping[str, str]) -> dict[str, object]:
    """All of a net that the reference speaks of, renamed, as sets."""

    def name(full: str) -> str:
        return names[full] if names else full

    def owner(of: str | None) -> str | None:
        return owners[of] if of is not None and owners else of

    def command(of: Command | None) -> tuple[object, ...] | None:
        return None if of is None else (of.machine, of.command, frozenset(of.parameters))

    return {
        "places": {(name(p.name), owner(p.owner), p.marked, command(p.command)) for p in net.places},
        "signals": {(name(s.name), owner(s.owner)) for s in net.signals},
        # A conceptual cell also names the controllers that its resources open to, which own nothing yet.
        "controllers": [
            (owner(c.name), c.coordinator) for c in net.controllers if any(p.owner == c.name for p in net.places)
        ],
        "transitions": {
            (
                t.name,
                t.number,
                frozenset(map(name, t.inputs)),
                frozenset(map(name, t.outputs)),
                frozenset(map(name, t.permissive)),
                frozenset(map(name, t.inhibitive)),
                frozenset((name(gate.signal), gate.wanted) for gate in t.external),
            )
            for t in net.transitions
        },
    }


@pytest.mark.parametrize("twin", TWINS, ids=lambda twin: twin.ours)
def test_a_cell_of_the_catalogue_equals_its_reference(twin: Twin) -> None:
    reference = load_net(twin.reference)
    owners = {f"c{number}": controller for number, controller in enumerate(twin.controllers)}
    own = {place.name: place.owner for place in reference.places}
    own |= {signal.name: signal.owner for signal in reference.signals}
    names = {full: twin.names[full.removeprefix(f"{owner}.")] for full, owner in own.items()}
    assert parts(catalogue_net(twin.ours), {}, {}) == parts(reference, names, owners)


def test_every_net_of_the_catalogue_has_a_reference() -> None:
    assert set(catalogue_names()) == {twin.ours for twin in TWINS} | WITHOUT_REFERENCE


@pytest.mark.parametrize("name", catalogue_names())
def test_a_net_of_the_catalogue_is_named_after_its_file_and_described(name: str) -> None:
    net = catalogue_net(name)
    assert net.name == name.replace("_", "-")
    assert net.description
    assert all(controller.description for controller in net.controllers)
    assert all(place.description for place in net.places)
    assert all(transition.description for transition in net.transitions)
    assert net.properties
    assert read_net(catalogue_path(name)) == net


def test_a_net_that_is_not_in_the_catalogue_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        catalogue_path("no_such_cell")


def test_every_completion_of_the_cell_gates_what_takes_the_token_out() -> None:
    net = catalogue_net("one_robot")
    waiting = [place.name for place in net.places if place.completion]
    assert [place.name for place in net.places if place.command and not place.completion] == ["conveyor.cv1_wait"]
    assert len(waiting) == 14
