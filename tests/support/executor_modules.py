"""The modules of the executor, and those of them that need a library which only their users install."""

from pathlib import Path

EXECUTOR = Path(__file__).parent.parent.parent / "executor"

WITH_A_LIBRARY: frozenset[str] = frozenset(
    {
        "firable.executor.drivers.far_side.modbus_server",
        "firable.executor.drivers.far_side.mqtt_device",
        "firable.executor.drivers.far_side.opcua_server",
        "firable.executor.drivers.far_side.serial_device",
        "firable.executor.links.serial_line",
        "firable.executor.links.zenoh_link",
        "firable.executor.operating.control",
        "firable.executor.operating.metrics",
    }
)
"""The modules that import what an extra brings: a device's protocol, or a transport between hosts."""


def executor_modules() -> list[str]:
    """The modules that the base dependencies suffice for, by their full names."""
    found = []
    for path in sorted(EXECUTOR.rglob("*.py")):
        parts = path.relative_to(EXECUTOR).with_suffix("").parts
        name = ".".join(("firable", "executor", *(part for part in parts if part != "__init__")))
        if name not in WITH_A_LIBRARY:
            found.append(name)
    return found
