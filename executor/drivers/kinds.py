"""The kinds of devices, by the names that a binding gives them: those of firable, and those that others have installed.

A kind is loaded when a binding names it, so that no host needs the library of a device that it does not have. Others
bring theirs as an entry point of the group `firable.drivers`, whose name is what the binding writes and whose object is
a `DeviceKind`. A name of firable's own cannot be taken: what moves a machine must not depend on what else is installed.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import Final

from firable.executor.drivers.device import DeviceKind
from firable.nets.diagnostics import Diagnostic, InputError, did_you_mean
from firable.nets.source import quoted

GROUP: Final = "firable.drivers"

OWN: Final[Mapping[str, tuple[str, str]]] = {
    "modbus-tcp": ("firable.executor.drivers.modbus", "TCP"),
    "modbus-rtu": ("firable.executor.drivers.modbus", "RTU"),
    "opcua": ("firable.executor.drivers.opcua", "KIND"),
    "mqtt": ("firable.executor.drivers.mqtt", "KIND"),
    "simulated": ("firable.executor.drivers.simulated_device", "KIND"),
    "serial": ("firable.executor.drivers.serial_line", "KIND"),
}
"""The module and the name of the kind in it."""


def kind_names() -> tuple[str, ...]:
    """The names that a binding may give: firable's own, then those of others."""
    others = sorted({entry.name for entry in entry_points(group=GROUP)} - set(OWN))
    return (*OWN, *others)


def kind_named(name: str) -> DeviceKind:
    """The kind of a name; raises `InputError` F5103 where there is none, or where it cannot be loaded."""
    if name in OWN:
        module, attribute = OWN[name]
        kind: DeviceKind = getattr(import_module(module), attribute)
        return kind
    found = [entry for entry in entry_points(group=GROUP) if entry.name == name]
    if not found:
        names = kind_names()
        hint = did_you_mean(name, names) + f"there are {', '.join(names)}; others are installed as packages"
        raise InputError([Diagnostic("F5103", f"there is no driver {quoted(name)}", hint)])
    if len({entry.value for entry in found}) > 1:
        several = ", ".join(sorted(entry.value for entry in found))
        hint = "uninstall all packages but one that bring a driver of this name"
        raise InputError([Diagnostic("F5103", f"{quoted(name)} is several drivers: {several}", hint)])
    try:
        loaded: DeviceKind = found[0].load()
    except (ImportError, AttributeError) as error:
        message = f"the driver {quoted(name)} cannot be loaded from '{found[0].value}': {error}"
        raise InputError([Diagnostic("F5103", message, "install what it needs, or ask who made it")]) from None
    return loaded
