"""Reader of the JSON carrier of `tests/reference`, and its cases.

A place "Robot" of owner 1 becomes `c1.Robot` of the controller `c1`; a place without an owner keeps its bare name. The
external signals become sensors, named in the same way. What the carrier can say and a `Net` cannot (two tokens, a gate
with two sources) is refused here, with the same codes that a text would get; the rest is refused by `Net`.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, Transition

REFERENCE = Path(__file__).parent.parent / "reference"


@dataclass(frozen=True)
class Case:
    """One variant of one case: `net` reads it, and raises `InputError` where it is malformed."""

    id: str
    title: str
    label: str
    net: Callable[[], Net]
    expect: Mapping[str, Any]

    def __str__(self) -> str:
        return f"{self.id} {self.label}".strip()


def cases() -> Iterator[Case]:
    """Every variant of every case, in order."""
    for path in sorted((REFERENCE / "cases").glob("*.json")):
        case = _read(path)
        for variant in case["variants"]:
            yield Case(case["id"], case["title"], variant["label"], _thunk(variant["net"]), variant["expect"])


def _thunk(net: str | Mapping[str, Any]) -> Callable[[], Net]:
    return lambda: load_net(net) if isinstance(net, str) else net_from_json(net)


def reference_names() -> tuple[str, ...]:
    """The names of the nets in the folder."""
    return tuple(sorted(path.stem for path in (REFERENCE / "nets").glob("*.json")))


def load_net(name: str) -> Net:
    """The net of `nets/NAME.json`."""
    return net_from_json({"name": name, **_read(REFERENCE / "nets" / f"{name}.json")})


def _read(path: Path) -> dict[str, Any]:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if repeated := [key for key, n in Counter(key for key, _ in pairs).items() if n > 1]:
            raise InputError([Diagnostic("F1006", f"{path.name}: the key '{repeated[0]}' stands twice", "rename one")])
        return dict(pairs)

    found: dict[str, Any] = json.loads(path.read_text("utf-8"), object_pairs_hook=once)
    return found


def local(name: str) -> str:
    """The name without the controller: `c1.Robot` is `Robot`."""
    return re.sub(r"^c\d+\.", "", name)


def net_from_json(data: Mapping[str, Any]) -> Net:
    """The net that the carrier describes; `InputError` where it is malformed."""
    problems: list[Diagnostic] = []
    places: dict[str, Mapping[str, Any]] = data["places"]
    transitions: dict[str, Mapping[str, Any]] = data["transitions"]
    full = {name: _full(name, place.get("owner")) for name, place in places.items()}

    signals: dict[str, Signal] = {}
    for name, described in transitions.items():
        for gate in described.get("gates", ()):
            if gate.get("kind") not in {"perm", "inh"}:
                problems.append(
                    Diagnostic(
                        "F1010", f"a gate of '{name}' is neither perm nor inh", "say which", ("transitions", name)
                    )
                )
            if "ext" not in gate and "src" not in gate:
                problems.append(
                    Diagnostic("F1009", f"a gate of '{name}' has no source", "write src or ext", ("transitions", name))
                )
            if "ext" not in gate:
                continue
            if "src" in gate:
                problems.append(
                    Diagnostic(
                        "F2010",
                        f"a gate of '{name}' has two sources, '{gate['src']}' and '{gate['ext']}'",
                        "write two gates",
                        ("transitions", name),
                    )
                )
            owner = gate.get("owner")
            signal = Signal(_full(gate["ext"], owner), None if owner is None else f"c{owner}")
            if signals.setdefault(gate["ext"], signal) != signal:
                problems.append(
                    Diagnostic(
                        "F2001", f"two owners of the signal '{gate['ext']}'", "name one", ("signals", signal.name)
                    )
                )

    owners = {int(number) for number in data.get("subsystems", ())}
    used = {place["owner"] for place in places.values() if place.get("owner") is not None}
    used |= {int(signal.owner[1:]) for signal in signals.values() if signal.owner}
    if "subsystems" in data and not used <= owners:
        problems.append(Diagnostic("F2005", f"{sorted(used - owners)} are no subsystems", "list them"))
    # A subsystem keeps its number in the names of parts, so those between that own nothing are there too.
    numbers = [*({0} & (owners | used)), *range(1, max(owners | used, default=0) + 1)]
    controllers = tuple(
        Controller(f"c{number}", number == 0, data.get("subsystems", {}).get(str(number), "")) for number in numbers
    )

    def place(name: str, of: Mapping[str, Any]) -> Place:
        if of.get("m0", 0) not in (0, 1):
            problems.append(
                Diagnostic(
                    "F2006", f"{of['m0']} tokens on '{name}'", "a place holds one token at most", ("places", full[name])
                )
            )
        out, owner = of.get("out"), of.get("owner")
        command = Command(out["machine"], out["command"], tuple(out.get("params", {}).items())) if out else None
        owner = None if owner is None else f"c{owner}"
        return Place(full[name], owner, of.get("m0", 0) != 0, command, description=of.get("desc", ""))

    def internal(of: Mapping[str, Any], kind: str) -> tuple[str, ...]:
        return tuple(full.get(g["src"], g["src"]) for g in of.get("gates", ()) if g.get("kind") == kind and "src" in g)

    def transition(name: str, of: Mapping[str, Any]) -> Transition:
        return Transition(
            name,
            tuple(full.get(source, source) for source in of["in"]),
            tuple(full.get(target, target) for target in of["out"]),
            internal(of, "perm"),
            internal(of, "inh"),
            tuple(
                ExternalGate(signals[g["ext"]].name, g.get("kind") == "perm") for g in of.get("gates", ()) if "ext" in g
            ),
            of.get("num"),
            of.get("desc", ""),
        )

    parts = (
        data.get("name", "net"),
        tuple(place(name, of) for name, of in places.items()),
        tuple(transition(name, of) for name, of in transitions.items()),
        tuple(signals.values()),
        controllers,
    )
    if problems:
        raise InputError(problems)
    return Net(*parts)


def _full(name: str, owner: int | None) -> str:
    return name if owner is None else f"c{owner}.{name}"
