"""What a binding leaves out that stops machines: safe outputs, heartbeats, contacts of an emergency stop.

Each may be left out, since a machine may be stopped by other means; but whoever forgets one finds out when a machine
goes on. So each that is missing is told of once, by a warning with the line where it belongs, and an empty mapping in
its place says that there is none. Devices that nothing commands, and simulated ones, need none of them. Rejected: to
refuse such a binding, which would keep an engineer from the first run of a lamp.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from firable.executor.drivers.binding import Binding
from firable.nets.diagnostics import Diagnostic, Severity

SIMULATED: Final = "simulated"

_OF_A_DEVICE: Final = {
    "safe": (
        "no `safe` outputs: machines go on with what they were told when the run ends, fails or is stopped",
        "write `safe: {ADDRESS: VALUE}`, which stops them, or `safe: {}` where nothing has to be stopped",
    ),
    "heartbeat": (
        "no `heartbeat`: machines go on with what they were told when this program hangs, or its cable is cut",
        "write `heartbeat: {write: ADDRESS, every_s: 0.2}` for a watchdog, or `heartbeat: {}` where there is none",
    ),
}


def unguarded(binding: Binding) -> Iterator[Diagnostic]:
    """Warnings (F5107) of what nothing stops, one for each means that is missing."""
    document = binding.document
    commanded = dict.fromkeys(
        one.device for one in document.commands.values() if document.devices[one.device].driver != SIMULATED
    )
    for key, (message, hint) in _OF_A_DEVICE.items():
        missing = [name for name in commanded if key not in document.devices[name].model_fields_set]
        if missing:
            have = "have" if len(missing) > 1 else "has"
            names = ", ".join(f"'{name}'" for name in missing)
            yield _warning(binding, ("devices", missing[0]), f"{names} {have} {message}", hint)
    if commanded and "emergency_stop" not in document.model_fields_set:
        message = "no contact of an emergency stop is read: the run goes on commanding when somebody presses one"
        hint = "write `emergency_stop: {NAME: {device: ..., read: ...}}`, or `emergency_stop: {}` where there is none"
        yield _warning(binding, ("devices",), message, hint)


def _warning(binding: Binding, path: tuple[str, ...], message: str, hint: str) -> Diagnostic:
    return replace(binding.problem("F5107", path, message, hint), severity=Severity.WARNING)
