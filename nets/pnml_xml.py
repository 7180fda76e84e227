"""PNML as records: the places, transitions and arcs of one net, and what else the file says.

PNML (ISO/IEC 15909-2) wraps every value in a label, and tools have never agreed on the labels beyond the standard: the
kind of an arc is `<type value="inhibitor"/>`, `<type><text>read</text></type>`, `<arctype>`, or an attribute; a marking
is in `<text>`, `<value>`, an attribute, or PIPE's "Default,1". This module knows these spellings and nothing of what
they mean; `pnml` does. Whatever it does not know is counted by its name, so that the import can say what it left.

The file is parsed by expat as a stream, so that nesting costs nothing and a net of 100,000 transitions takes no tree.
A document type declaration is refused, and with it every entity: "billion laughs" and files read from elsewhere.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final
from xml.parsers import expat

from firable.nets.source import Source, quoted

NODES: Final = frozenset({"place", "transition", "arc", "referencePlace", "referenceTransition"})
_FRAMES: Final = frozenset({"pnml", "net", "page"})
_LABELS: Final[dict[str, frozenset[str]]] = {
    "net": frozenset({"name"}),
    "place": frozenset({"name", "initialMarking", "capacity"}),
    "transition": frozenset({"name"}),
    "arc": frozenset({"inscription", "type", "arctype", "arcType", "kind"}),
    "referencePlace": frozenset(),
    "referenceTransition": frozenset(),
}
_VALUES: Final = frozenset({"text", "value"})
_FOREIGN: Final[dict[str, str]] = {
    **dict.fromkeys(
        ("declaration", "hlinitialMarking", "hlinscription", "condition", "structure", "type", "sort"), "coloured"
    ),
    **dict.fromkeys(("delay", "interval"), "time"),
}
"""Labels of other classes of nets, where a P/T net has none of that name: to leave them out would change the net."""


@dataclass(slots=True)
class Record:
    """One element that is part of the net, with its attributes and the text of its labels."""

    tag: str
    line: int
    column: int
    attributes: dict[str, str]
    labels: dict[str, str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """The identifier; empty where the file gives none."""
        return self.attributes.get("id", "")


@dataclass(slots=True)
class PnmlRecords:
    """What a PNML file says."""

    net: Record
    nodes: list[Record] = field(default_factory=list)
    pages: int = 0
    left: Counter[str] = field(default_factory=Counter)
    """How many elements of each name were not understood or are not part of a net."""
    foreign: tuple[str, Record] | None = None
    """The first element that only another class of nets has, and the name of that class."""


def parse_xml(source: Source, data: bytes, encoding: str | None) -> PnmlRecords:
    """Read the records of the one net of a PNML file; `encoding` overrides what the file says of itself.

    Raises `InputError`: F1002 empty, F1013 where it is not XML or not PNML, F1014 where it holds several nets.
    """
    if not data.strip():
        raise source.refuse("F1002", "the file is empty", "a PNML file begins with `<pnml>`")
    reader = _Reader(source, encoding)
    try:
        reader.parser.Parse(data, True)  # noqa: FBT003 - expat takes no keywords
    except expat.ExpatError as error:
        raise source.refuse(
            "F1013", f"not valid XML: {expat.ErrorString(error.code)}", "export the net again, or repair the element",
            error.lineno, error.offset + 1,
        ) from None  # fmt: skip
    except (ValueError, LookupError) as error:  # an encoding that Python does not know
        raise source.refuse("F1013", f"not valid XML: {error}", "save the file as UTF-8") from None
    if reader.records is None:
        raise source.refuse("F1013", "there is no <net> in <pnml>", "export the net again")
    return reader.records


class _Reader:
    """The handlers of the stream: a stack of element names and the record that is open."""

    def __init__(self, source: Source, encoding: str | None) -> None:
        self.source = source
        self.records: PnmlRecords | None = None
        self.frames: list[str] = []
        self.record: Record | None = None
        """The node that is open, or the net."""
        self.label: str | None = None
        self.text: list[str] | None = None
        self.skipped = 0
        """How deep the stream is inside an element that is left out."""
        self.inside: list[str] = []
        """The elements that are open inside the record."""
        parser = expat.ParserCreate(encoding, namespace_separator=" ")
        parser.buffer_text = True
        parser.StartElementHandler = self.start
        parser.EndElementHandler = self.end
        parser.CharacterDataHandler = self.characters
        parser.StartDoctypeDeclHandler = self.doctype
        self.parser = parser

    @property
    def position(self) -> tuple[int, int]:
        return self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1

    def doctype(self, *_: object) -> None:
        raise self.source.refuse(
            "F1013", "a document type declaration", "delete it: PNML needs no entities", *self.position
        )

    def start(self, name: str, attributes: dict[str, str]) -> None:
        if self.skipped:
            self.skipped += 1
            return
        tag = _tag(name)
        if self.record is not None and self.record.tag in NODES:
            self.start_inside(tag, attributes)
        elif not self.frames and tag != "pnml":
            raise self.source.refuse(
                "F1013", f"the root is <{tag}>, not <pnml>", "is this a PNML file?", *self.position
            )
        elif tag in _FRAMES and (tag != "pnml") == bool(self.frames) and not self.inside:
            self.start_frame(tag, attributes)
        elif tag in NODES and self.records is not None and not self.inside:
            self.record = Record(tag, *self.position, attributes)
            self.records.nodes.append(self.record)
        elif self.record is not None:
            self.start_inside(tag, attributes)
        else:
            self.leave(tag)

    def start_frame(self, tag: str, attributes: dict[str, str]) -> None:
        line, column = self.position
        if tag == "net":
            if self.records is not None:
                raise self.source.refuse(
                    "F1014", "a second net begins here", "one file holds one net: split the file", line, column
                )
            self.record = Record("net", line, column, attributes)
            self.records = PnmlRecords(self.record)
        elif tag == "page" and self.records is not None:
            self.records.pages += 1
        self.frames.append(tag)

    def start_inside(self, tag: str, attributes: dict[str, str]) -> None:
        if self.record is None:
            raise AssertionError("a label stands inside a record")
        known = _LABELS[self.record.tag]
        if not self.inside:
            if tag not in known:
                self.leave(tag)
                return
            self.label = tag
            if "value" in attributes:
                self.record.labels[tag] = attributes["value"]
            self.text = []
            self.inside.append(tag)
        elif tag in _VALUES and len(self.inside) == 1:
            self.text = []
            self.inside.append(tag)
        else:
            self.leave(tag)

    def leave(self, tag: str) -> None:
        """Leave an element out, with all that is in it."""
        self.skipped = 1
        if self.records is None:
            return
        self.records.left[tag] += 1
        if tag in _FOREIGN and self.records.foreign is None and not self.inside:
            self.records.foreign = _FOREIGN[tag], Record(tag, *self.position, {})

    def end(self, name: str) -> None:
        if self.skipped:
            self.skipped -= 1
            return
        if self.inside:
            text = "".join(self.text or ()).strip()
            if self.record is not None and self.label is not None and text:
                self.record.labels.setdefault(self.label, text)
            self.text = None
            self.inside.pop()
            return
        tag = _tag(name)
        if tag in NODES:
            self.record = self.records.net if self.records is not None else None
        elif self.frames:
            self.frames.pop()
            if tag == "net":
                self.record = None

    def characters(self, text: str) -> None:
        if self.text is not None and not self.skipped:
            self.text.append(text)


@lru_cache(maxsize=256)
def _tag(name: str) -> str:
    """The name of an element without its namespace."""
    return name.rpartition(" ")[2]


def described(record: Record) -> str:
    """The element for a message.

    >>> described(Record("place", 1, 1, {"id": "p0"}))
    "<place> 'p0'"
    """
    return f"<{record.tag}> {quoted(record.id)}"
