"""What IEEE Std 1849 asks of an event log in XML: the rules of its schema, in our words, and what no schema can say.

The schema itself is published at xes-standard.org; it is not part of this repository. It says which elements stand in
which, in which order, with which attributes of which types. The standard says besides that the prefixes of keys are
those of declared extensions, that every event and every trace has the attributes declared global for it, and that a
classifier uses global attributes alone.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Final

NAMESPACE: Final = "{http://www.xes-standard.org/}"

_NC_NAME: Final = re.compile(r"[^\W\d][\w.-]*")
_NAME: Final = re.compile(r"[^\W\d:][\w.:-]*")
_TOKEN: Final = re.compile(r"(\S+( \S+)*)?")
_DECIMAL: Final = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)")
_ANY: Final = re.compile(r"[\s\S]*")
_VALUES: Final = {
    "string": _ANY,
    "id": _ANY,
    "date": re.compile(r"-?\d{4,}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?"),
    "int": re.compile(r"[+-]?\d{1,18}"),
    "float": re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|INF|-INF|NaN"),
    "boolean": re.compile(r"true|false|1|0"),
}
_ATTRIBUTES: Final = {
    "log": {"xes.version": (_DECIMAL, True), "xes.features": (_TOKEN, False)},
    "extension": {"name": (_NC_NAME, True), "prefix": (_NC_NAME, True), "uri": (_ANY, True)},
    "global": {"scope": (re.compile("trace|event"), False)},
    "classifier": {"name": (_NC_NAME, True), "scope": (_NC_NAME, False), "keys": (_TOKEN, True)},
    "trace": {},
    "event": {},
    **{kind: {"key": (_NAME, True), "value": (value, True)} for kind, value in _VALUES.items()},
}
_CHILDREN: Final = {
    "log": ("extension", "global", "classifier", "attribute", "trace", "event"),
    "trace": ("attribute", "event"),
    "extension": (),
    "classifier": (),
}
"""What may stand in an element, in this order; in any other, attributes."""
_KINDS: Final = {
    "concept:name": "string",
    "lifecycle:model": "string",
    "lifecycle:transition": "string",
    "time:timestamp": "date",
    "org:resource": "string",
}
"""The types that the standard extensions give their attributes."""
_LIFECYCLE: Final = re.compile(
    "schedule|assign|withdraw|reassign|start|suspend|resume|pi_abort|ate_abort|complete|autoskip|manualskip|unknown"
)
"""The transitions of the standard lifecycle."""


def problems(log: ET.Element) -> Iterator[str]:
    """Each rule that a log breaks, in a sentence."""
    if log.tag != f"{NAMESPACE}log":
        yield f"the root is {log.tag}"
        return
    yield from _of_schema(log, "log")
    prefixes = {one.get("prefix", "") for one in log.iter(f"{NAMESPACE}extension")}
    for attribute in (one for kind in _VALUES for one in log.iter(NAMESPACE + kind)):
        key = attribute.get("key", "")
        prefix, colon, _ = key.partition(":")
        if colon and prefix not in prefixes:
            yield f"{key} is of no extension that is declared"
        if key in _KINDS and _local(attribute) != _KINDS[key]:
            yield f"{key} is no {_KINDS[key]}"
        if key == "lifecycle:transition" and not _LIFECYCLE.fullmatch(attribute.get("value", "")):
            yield f"{attribute.get('value')} is no transition of the standard lifecycle"
    for scope in ("trace", "event"):
        declared = [one for one in log.iter(f"{NAMESPACE}global") if one.get("scope", "event") == scope]
        kinds = {one.get("key", ""): _local(one) for every in declared for one in every}
        for element in log.iter(NAMESPACE + scope):
            own = {one.get("key", ""): _local(one) for one in element}
            for key in (key for key, kind in kinds.items() if own.get(key) != kind):
                yield f"a {scope} lacks the global attribute {key}"
        for classifier in log.iter(f"{NAMESPACE}classifier"):
            used = set(classifier.get("keys", "").split())
            if classifier.get("scope", "event") == scope and not kinds.keys() >= used:
                yield f"the classifier {classifier.get('name')} uses what is not global"


def _of_schema(element: ET.Element, name: str) -> Iterator[str]:
    """What the schema says of an element and all that stands in it."""
    wanted = _ATTRIBUTES[name]
    for key, (form, is_required) in wanted.items():
        value = element.get(key)
        if value is None and is_required:
            yield f"{name} lacks {key}"
        elif value is not None and not form.fullmatch(value):
            yield f"{name} has {key}={value!r}"
    for key in element.keys() - wanted.keys():
        yield f"{name} has an attribute {key}"
    if (element.text or "").strip():
        yield f"{name} has text"
    order, last, keys = _CHILDREN.get(name, ("attribute",)), 0, set[str]()
    for child in element:
        local = _local(child)
        rank = "attribute" if local in _VALUES else local
        if rank not in order:
            yield f"{local} stands in {name}"
            continue
        if order.index(rank) < last:
            yield f"{local} stands too late in {name}"
        last = max(last, order.index(rank))
        if rank == "attribute" and child.get("key") in keys:
            yield f"{name} has {child.get('key')} twice"
        keys.add(child.get("key", ""))
        yield from _of_schema(child, local)


def _local(element: ET.Element) -> str:
    return element.tag.removeprefix(NAMESPACE)
