"""Loops of the cells of the catalogue, closed once, and plants whose sensors are others."""

from __future__ import annotations

import random
from functools import cache

from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net

KINDS = (
    (Sending.LATE, Faults.NONE),
    (Sending.AT_ONCE, Faults.NONE),
    (Sending.AT_ONCE, Faults.FOR_GOOD),
    (Sending.AT_ONCE, Faults.REPAIRED),
)
"""The loops of which a bundle speaks."""


_OTHERS = ({"does": "stop"}, {"does": "stop", "takes_s": 1.0}, {"does": "work", "takes_s": 1.0})


@cache
def closed(
    name: str, sending: Sending = Sending.LATE, faults: Faults = Faults.NONE
) -> tuple[Net, PlantModel, ClosedLoop]:
    """A cell of the catalogue with its plant and its loop."""
    net, model = catalogue_net(name), catalogue_plant(name)
    return net, model, close(net, model, faults, sending)


def other_plants(model: PlantModel, seed: int) -> PlantModel:
    """The plant with some sensors that flicker or linger, other ways to meet a full station, other commands."""
    draw, data = random.Random(seed), model.model_dump(by_alias=True, exclude_defaults=True)
    for sensor in data["sensors"].values():
        if "acknowledges" not in sensor:
            for key in ("may_flicker", "may_linger"):
                if draw.random() < 0.25:
                    sensor[key] = True
            if "occupied" in sensor and draw.random() < 0.5 and sensor.keys() == {"occupied"}:
                sensor[draw.choice(["passes", "fails"])] = sensor.pop("occupied")
    for machine in data["machines"].values():
        for name, action in machine["commands"].items():
            if action["does"] in {"put", "carry"}:
                action["when_full"] = draw.choice(["collide", "wait"])
            if draw.random() < 0.1:
                machine["commands"][name] = draw.choice(_OTHERS)
            elif action["does"] == "stop":
                action["takes_s"] = draw.choice([0.0, 1.0])
            elif action["does"] != "switch":
                action.update(draw.choice([{"may_fail": "repairable"}, {"may_fail": "for_good"}, {}]))
    return PlantModel.model_validate(data)
