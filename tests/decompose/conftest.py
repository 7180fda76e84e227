"""The reference nets, for the tests of the decomposition."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, Transition

REFERENCE = Path(__file__).parents[1] / "reference"


def _net(data: dict[str, Any], name: str) -> Net:
    places, transitions = data["places"], data["transitions"]
    gates = [gate for t in transitions.values() for gate in t["gates"]]
    numbers = {int(n) for n in data.get("subsystems", {})} | {p["owner"] for p in places.values() if "owner" in p}
    numbers |= {gate["owner"] for gate in gates if "owner" in gate}
    controllers = tuple(Controller(f"c{n}") for n in range(max(numbers, default=-1) + 1))
    full = {place: f"c{p['owner']}.{place}" if "owner" in p else place for place, p in places.items()}
    signals = {gate["ext"]: f"c{gate['owner']}" for gate in gates if "ext" in gate}

    def command(p: dict[str, Any]) -> Command | None:
        out = p.get("out")
        return Command(out["machine"], out["command"], tuple(out["params"].items())) if out else None

    return Net(
        name,
        tuple(
            Place(full[place], f"c{p['owner']}" if "owner" in p else None, bool(p["m0"]), command(p))
            for place, p in places.items()
        ),
        tuple(
            Transition(
                t,
                tuple(full[p] for p in body["in"]),
                tuple(full[p] for p in body["out"]),
                tuple(full[g["src"]] for g in body["gates"] if "src" in g and g["kind"] == "perm"),
                tuple(full[g["src"]] for g in body["gates"] if "src" in g and g["kind"] == "inh"),
                tuple(
                    ExternalGate(f"{signals[g['ext']]}.{g['ext']}", g["kind"] == "perm")
                    for g in body["gates"]
                    if "ext" in g
                ),
                body.get("num"),
                body.get("desc", ""),
            )
            for t, body in transitions.items()
        ),
        tuple(Signal(f"{owner}.{signal}", owner) for signal, owner in signals.items()),
        controllers,
    )


@pytest.fixture(scope="session")
def reference_net() -> Callable[[str], Net]:
    """A net of tests/reference/nets by its name."""
    return lambda name: _net(json.loads((REFERENCE / "nets" / f"{name}.json").read_text()), name)
