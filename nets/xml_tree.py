"""XML as a tree of elements that know where they stand, read with bounds.

For files whose every element matters and that are small, such as queries. The file is parsed by expat; nesting is
bounded, since who walks over the tree calls itself; a document type declaration is refused, and with it every entity,
as in `pnml_xml`, which reads nets as a stream because they are large.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

from firable.nets.diagnostics import InputError
from firable.nets.source import Source

DEPTH_MAX: Final = 200


@dataclass(slots=True)
class Element:
    """One element: its name without namespace, its text without the blanks around, and the elements in it."""

    tag: str
    line: int
    column: int
    text: str = ""
    children: list[Element] = field(default_factory=list)


def parse_elements(source: Source, data: bytes, code: str) -> Element:
    """The root of an XML file.

    Raises `InputError` with the code that is given where it is not XML, declares a document type or nests too deeply.
    """
    reader = _Reader(source, code)
    try:
        reader.parser.Parse(data, True)  # noqa: FBT003 - expat takes no keywords
    except expat.ExpatError as error:
        message = f"not valid XML: {expat.ErrorString(error.code)}"
        raise source.refuse(
            code, message, "export the file again, or repair the element", error.lineno, error.offset + 1
        ) from None
    except (ValueError, LookupError) as error:  # an encoding that Python does not know
        raise source.refuse(code, f"not valid XML: {error}", "save the file as UTF-8") from None
    return reader.top.children[0]


class _Reader:
    """The handlers of the parser, and the elements that are open."""

    def __init__(self, source: Source, code: str) -> None:
        self.source, self.code = source, code
        self.top = Element("", 1, 1)
        self.open = [self.top]
        self.text: list[str] = []
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.text.append
        self.parser.StartDoctypeDeclHandler = self.doctype

    def refuse(self, message: str, hint: str) -> InputError:
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1
        return self.source.refuse(self.code, message, hint, line, column)

    def doctype(self, *_: object) -> None:
        raise self.refuse("a document type declaration", "delete it: no entities are needed")

    def start(self, name: str, _: dict[str, str]) -> None:
        if len(self.open) > DEPTH_MAX:
            raise self.refuse(f"elements nest more than {DEPTH_MAX} levels deep", "is this the right file?")
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1
        element = Element(name.rpartition(" ")[2], line, column)
        self.open[-1].children.append(element)
        self.open.append(element)
        self.text.clear()

    def end(self, _: str) -> None:
        element = self.open.pop()
        if not element.children:
            element.text = "".join(self.text).strip()
        self.text.clear()
