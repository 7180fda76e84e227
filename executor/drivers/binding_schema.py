"""The JSON Schema of a binding, by which editors complete and check it: the keys that all devices have, and its kind's.

It is made from what reads a binding, so that it cannot say anything else; what a file means beyond its keys (addresses,
what is bound twice) is told by `firable`. Printed is the copy that is committed: to make it takes the library of each
kind of device, which a host may not have. A kind that others bring may have any keys beside those of all devices.
"""

from __future__ import annotations

from typing import Any

from firable.executor.drivers.binding import BindingDocument
from firable.executor.drivers.kinds import OWN, kind_named


def json_schema() -> dict[str, Any]:
    """The schema, of the kinds that firable has itself."""
    schema = BindingDocument.model_json_schema()
    device = schema["$defs"]["DeviceDocument"]
    of_all = dict.fromkeys(device["properties"], True)
    device["allOf"] = []
    for name in OWN:
        own = kind_named(name).options.model_json_schema()
        schema["$defs"] |= own.pop("$defs", {})
        keys = {"properties": of_all | own["properties"], "required": own.get("required", [])}
        is_such = {"properties": {"driver": {"const": name}}, "required": ["driver"]}
        device["allOf"].append({"if": is_such, "then": keys | {"additionalProperties": False}})
    return schema
