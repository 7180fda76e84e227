"""The keys of a file that firable reads, as tables, read off its JSON Schema: `net-keys` with the kind of file.

The schema is what the reader of the file is made of, so the reference cannot name a key that is not read, nor miss one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from firable.cli.schema import schema_of


class NetKeys(SphinxDirective):
    """A section for each kind of mapping in the file: its keys, what they hold, which are required, what they mean."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The sections, parsed as Markdown of the page that asks for them."""
        self.env.note_reread()  # the page stays as it is when the schema changes
        lines = list(_sections(schema_of(self.arguments[0])))
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def _sections(schema: dict[str, Any]) -> Iterator[str]:
    yield from _table("the file", schema)
    for name, one in schema.get("$defs", {}).items():
        if "properties" in one:
            yield from _table(_title(name, one), one)


def _table(title: str, schema: dict[str, Any]) -> Iterator[str]:
    yield f"## {title.capitalize()}"
    yield ""
    if schema.get("description"):
        yield from (*schema["description"].splitlines(), "")
    required = set(schema.get("required", ()))
    yield "| key | holds | |"
    yield "|---|---|---|"
    for key, value in schema.get("properties", {}).items():
        told = " ".join(value.get("description", "").split()).replace("|", "\\|")
        must = " (required)" if key in required else ""
        yield f"| `{key}`{must} | {_kind(value)} | {told} |"
    yield ""


def _title(name: str, schema: dict[str, Any]) -> str:
    return _spelled(str(schema.get("title", name)))


def _spelled(name: str) -> str:
    """The name of a record in words.

    >>> _spelled("TimeLimitDocument"), _spelled("PlantModel")
    ('time limit', 'plant')
    """
    words = re.findall("[A-Z][a-z]*|[a-z]+", name)
    return " ".join(word.lower() for word in words if word not in ("Document", "Model", "Record"))


def _kind(value: dict[str, Any]) -> str:
    """What a value may be, in words."""
    if "$ref" in value:
        return f"a {_spelled(value['$ref'].rpartition('/')[2])}"
    for some in ("anyOf", "oneOf"):
        if some in value:
            kinds = dict.fromkeys(_kind(one) for one in value[some] if one.get("type") != "null")
            return " or ".join(kinds)
    if "enum" in value:
        return ", ".join(f"`{one}`" for one in value["enum"])
    if "const" in value:
        return f"`{value['const']}`"
    match value.get("type"):
        case "array":
            return f"list of {_kind(value.get('items', {}))}"
        case "object":
            inner = value.get("additionalProperties")
            return f"names, each with {_kind(inner)}" if isinstance(inner, dict) and inner else "mapping"
        case str() as kind:
            return {"string": "text", "integer": "number", "boolean": "`true` or `false`"}.get(kind, kind)
        case _:
            return "any"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("net-keys", NetKeys)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
