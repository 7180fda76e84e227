"""YAML as a tree of strings with positions, refusing what two readers of the file could read differently.

YAML decides by guessing: `on` and `no` are Booleans for some parsers and text for others, of two equal keys the last
one wins in silence, an anchor makes one line change another, a tag may call a constructor. In a file that moves
machines nothing may depend on such a guess. So the tree is built here from the parser's *events*, in one loop, and:

- a scalar is the string as written; nothing is resolved but an empty value, `true` and `false`;
- a plain word that some YAML reads as a Boolean or as null is refused (`on`, `off`, `yes`, `no`, `null`, `~`, ...);
- equal keys, anchors, aliases, merge keys, tags and second documents are refused.

The events, not `yaml.compose`: composing follows aliases (the "billion laughs") and calls itself for each level, so
10,000 brackets end in its recursion limit or its C stack. Here depth and number of nodes are bounded and counted before
anything is built. Every node knows its line and column, so whatever is found wrong later can be shown in the text. The
alternative ruamel.yaml keeps comments, and took 25 times as long.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import yaml

from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.source import Source, quoted

DEPTH_MAX: Final = 32
NODES_MAX: Final = 2_000_000

Data = str | bool | None | list["Data"] | dict[str, "Data"]
"""What a tree says, without positions."""

Path = tuple[str | int, ...]
"""Keys and indexes from the root to a node."""

_WORDS_REFUSED: Final = frozenset(
    spelling
    for word in ("yes", "no", "on", "off", "null", "true", "false")
    for spelling in (word, word.capitalize(), word.upper())
    if spelling not in {"true", "false"}
) | {"~"}

_WORDS_DOUBTFUL: Final = _WORDS_REFUSED | {"true", "false", "<<", ""}
"""The plain words that `_Builder.word` has something to say about, at least as keys."""

_FORBIDDEN: Final = re.compile("[^\t\n\r -~\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]|\ufeff")
"""What YAML does not print, and the line ends on which its versions disagree (U+0085, U+2028, U+2029)."""

_PLAIN_VALUE: Final = re.compile(r""":\s+[^\s"'{\[][^{}\[\],]*$""")
"""A value without quotes, up to the end."""

_NO_TAGS: Final = "'!' begins a tag, and a net needs none: where a gate was to be negated, write `unless` for `if`"

_TOO_DEEP: Final = "exceeded maximum nesting depth"
"""What libyaml says from 1,000 levels on, in versions that have such a bound."""

_LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(slots=True)
class Scalar:
    """A string as written; `plain` without quotes."""

    text: str
    plain: bool
    line: int
    column: int
    length: int


@dataclass(slots=True)
class Sequence:
    """A list of nodes."""

    line: int
    column: int
    items: list[Node] = field(default_factory=list)


@dataclass(slots=True)
class Mapping:
    """Keys with their values, in the order of the file."""

    line: int
    column: int
    entries: dict[str, tuple[Scalar, Node]] = field(default_factory=dict)


Node = Scalar | Sequence | Mapping


def is_ambiguous(word: str) -> bool:
    """Whether some YAML parsers read this plain word as something other than text.

    >>> [word for word in ("on", "No", "~", "true", "node") if is_ambiguous(word)]
    ['on', 'No', '~', 'true']
    """
    return word in _WORDS_REFUSED or word in {"true", "false", "y", "n", "Y", "N"}


def parse_tree(source: Source, file: str = "net file", begins: str = "`firable: 1` and `cell: NAME`") -> Node:
    """Read one YAML document, of a `file` of this kind, which begins so.

    Raises `InputError`: F1002 empty, F1003 too many nodes, F1005 not YAML or nested too deeply, F1006 duplicate keys,
    F1007 ambiguous. The syntax stops at the first error; duplicate keys and ambiguous words are all reported.
    """
    if found := _FORBIDDEN.search(source.text):
        character = found.group()
        before = source.text[: found.start()]
        raise source.refuse(
            "F1007" if character in "\x85\u2028\u2029" else "F1005",
            f"the character U+{ord(character):04X} may not stand in a {file}",
            "delete it, or write it as an escape in double quotes",
            before.count("\n") + 1,
            found.start() - (before.rfind("\n") + 1) + 1,
        )
    builder = _Builder(source)
    try:
        _read(source.text, builder)
    except yaml.MarkedYAMLError as error:
        if error.problem == _TOO_DEEP and error.problem_mark is not None:
            with suppress(yaml.MarkedYAMLError):  # it looks ahead, and has handed over nothing yet of what is too deep
                _read(source.text[: error.problem_mark.index], _Builder(source))
        raise _syntax_error(source, error) from None
    if builder.problems:
        raise InputError(builder.problems)
    root = builder.root
    if root is None or (isinstance(root, Scalar) and root.plain and not root.text):
        what = "holds comments alone" if source.text.strip() else "is empty"
        raise source.refuse("F1002", f"this is not a {file}: it {what}", f"a {file} begins with {begins}")
    return root


def _read(text: str, builder: _Builder) -> None:
    parser = _LOADER(text)
    try:
        while (event := parser.get_event()) is not None:
            builder.take(event)
    finally:
        parser.dispose()


def _syntax_error(source: Source, error: yaml.MarkedYAMLError) -> InputError:
    # A key without a colon is noticed on a later line; what began there says where the mistake is.
    began = error.context_mark if error.context == "while scanning a simple key" else None
    mark = began or error.problem_mark or error.context_mark
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    if line > len(source.lines):
        line, column = len(source.lines), len(source.lines[-1]) + 1
    problem = error.problem or "not YAML"
    if error.context:
        problem = f"{problem}, {error.context}"
    text = source.lines[line - 1]
    if "\t" in text[: column + 1]:
        hint = "indent with spaces: YAML forbids tabs there"
    elif error.context == "while scanning a tag":
        hint = _NO_TAGS
    elif text[column - 1 : column] == ":" and _PLAIN_VALUE.search(text[: column - 1]):
        hint = "write a text with a colon and a blank in it in double quotes"
    elif ":" in text or not text.strip():
        hint = "check the indentation and the colons of this line and of the one before it"
    else:
        hint = "check the brackets, the quotes and the indentation of this line and of the one before it"
    return source.refuse("F1005", f"not valid YAML: {problem}", hint, line, column)


class _Builder:
    """Builds the tree from events, in one loop and without recursion."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Diagnostic] = []
        self.root: Node | None = None
        self.stack: list[Sequence | Mapping] = []
        self.keys: list[Scalar | None] = []
        """The key that waits for its value, for each open collection."""
        self.nodes = 0
        self.documents = 0

    def problem(self, code: str, message: str, hint: str, line: int, column: int, length: int = 1) -> None:
        if len(self.problems) < 20:
            self.problems.append(Diagnostic(code, message, hint, span=self.source.span(line, column, length)))

    def take(self, event: yaml.Event) -> None:
        start, end = event.start_mark, event.end_mark
        if start is None or end is None:
            raise AssertionError("the parser gives every event its marks")
        line, column = start.line + 1, start.column + 1
        match event:
            case yaml.ScalarEvent():
                if event.anchor is not None or event.tag is not None:
                    self.refuse_properties(event, line, column)
                length = end.column - start.column if end.line == start.line else 1
                self.add(Scalar(event.value, not event.style, line, column, length))
            case yaml.MappingStartEvent():
                self.refuse_properties(event, line, column)
                self.open(Mapping(line, column))
            case yaml.SequenceStartEvent():
                self.refuse_properties(event, line, column)
                self.open(Sequence(line, column))
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                self.stack.pop()
                self.keys.pop()
            case yaml.AliasEvent():
                raise self.source.refuse(
                    "F1007",
                    f"{quoted(f'*{event.anchor}')} repeats another part of the file",
                    "write the part out: an anchor hides that one line changes another",
                    line,
                    column,
                )
            case yaml.DocumentStartEvent():
                self.documents += 1
                if self.documents > 1:
                    raise self.source.refuse(
                        "F1007",
                        "a second document begins here",
                        "one file holds one net: delete the `---`",
                        line,
                        column,
                        3,
                    )
                if event.tags:
                    raise self.source.refuse(
                        "F1007", "a %TAG directive", "delete it: a net needs no tags", line, column
                    )

    def refuse_properties(self, event: yaml.NodeEvent, line: int, column: int) -> None:
        if event.anchor is not None:
            raise self.source.refuse(
                "F1007",
                f"{quoted(f'&{event.anchor}')} is an anchor",
                "delete it and write the part out where it is used",
                line,
                column,
            )
        if (tag := getattr(event, "tag", None)) is not None:
            hint = _NO_TAGS if tag.startswith("!") else "delete it: a net needs no tags"
            raise self.source.refuse("F1007", f"{quoted(tag)} is a tag", hint, line, column)

    def add(self, node: Node) -> None:
        self.nodes += 1
        if self.nodes > NODES_MAX:
            raise self.source.refuse(
                "F1003", f"more than {NODES_MAX:,} values", "use PNML for a net of this size", node.line, node.column
            )
        doubtful = isinstance(node, Scalar) and node.plain and node.text in _WORDS_DOUBTFUL
        if not self.stack:
            self.root = node
            if doubtful:
                self.word(node, is_key=False)
            return
        parent = self.stack[-1]
        if isinstance(parent, Sequence):
            if doubtful:
                self.word(node, is_key=False)
            parent.items.append(node)
            return
        key = self.keys[-1]
        if key is None:
            if not isinstance(node, Scalar):
                raise self.source.refuse("F1010", "a key must be a name", "write `name: value`", node.line, node.column)
            if doubtful:
                self.word(node, is_key=True)
            self.keys[-1] = node
            return
        if doubtful:
            self.word(node, is_key=False)
        self.keys[-1] = None
        if (earlier := parent.entries.get(key.text)) is not None:
            self.problem(
                "F1006",
                f"the key {quoted(key.text)} stands twice, first on line {earlier[0].line}",
                "rename one of them or join the two",
                key.line,
                key.column,
                key.length,
            )
            return
        parent.entries[key.text] = (key, node)

    def open(self, node: Sequence | Mapping) -> None:
        if len(self.stack) >= DEPTH_MAX:
            raise self.source.refuse(
                "F1005", f"nested more than {DEPTH_MAX} deep", "a net needs no such nesting", node.line, node.column
            )
        self.add(node)
        self.stack.append(node)
        self.keys.append(None)

    def word(self, node: Node, *, is_key: bool) -> None:
        """Refuse a plain word that parsers read differently."""
        if not isinstance(node, Scalar) or not node.plain:
            return
        if is_key and node.text == "<<":
            self.problem("F1007", "'<<' is a merge key", "write the keys out", node.line, node.column, node.length)
        elif node.text in _WORDS_REFUSED or (is_key and (not node.text or node.text in {"true", "false"})):
            shown = quoted(node.text) if node.text else "an empty key"
            hint = f'write "{node.text}" in double quotes if it is a name'
            if node.text.lower() in {"yes", "on", "true"} and not is_key:
                hint += ", or true"
            elif node.text.lower() in {"no", "off", "false"} and not is_key:
                hint += ", or false"
            elif node.text in {"null", "Null", "NULL", "~"} and not is_key:
                hint += ", or leave the value empty, or the key out"
            self.problem(
                "F1007",
                f"{shown} is text for some YAML parsers and not for others",
                hint if node.text else "write a name before the colon",
                node.line,
                node.column,
                node.length,
            )


def data(node: Node) -> Data:
    """What the tree says: empty plain values as None, plain `true` and `false` as Booleans, the rest as strings."""
    match node:
        case Scalar(text, plain):
            if plain and not text:
                return None
            if plain and text in {"true", "false"}:
                return text == "true"
            return text
        case Sequence():
            return [data(item) for item in node.items]
        case Mapping():
            return {key: data(value) for key, (_, value) in node.entries.items()}


def nodes_along(node: Node, path: Path) -> Iterator[tuple[Scalar | None, Node]]:
    """The node itself and the nodes along the path, as (key, value), as far as the path exists in the tree."""
    yield None, node
    for step in path:
        match node:
            case Mapping() if step in node.entries:
                key, node = node.entries[str(step)]
                yield key, node
            case Sequence() if isinstance(step, int) and step < len(node.items):
                node = node.items[step]
                yield None, node
            case _:
                return


def as_written(tree: Node, path: Path) -> Path:
    """The path in the tree, without a 0 where one mapping stands for a list of it alone."""
    written: Path = ()
    for step in path:
        *_, (_, node) = nodes_along(tree, written)
        if not (step == 0 and isinstance(node, Mapping)):
            written = (*written, step)
    return written


def node_span(source: Source, node: Node) -> Span:
    """The span at which a node begins, as long as it is where it is a scalar on one line."""
    return source.span(node.line, node.column, node.length if isinstance(node, Scalar) else 1)


def value_of(node: Node, key: str) -> Node | None:
    """The value of a key of a mapping; None where there is no such key, or no mapping."""
    found = node.entries.get(key) if isinstance(node, Mapping) else None
    return found[1] if found else None


def entries_of(node: Node, key: str) -> Iterator[tuple[str, Scalar, Node]]:
    """The entries of the table at a key: name, where the name stands, value."""
    table = value_of(node, key)
    if isinstance(table, Mapping):
        for name, (at, value) in table.entries.items():
            yield name, at, value


def items_of(node: Node | None) -> Iterator[Scalar]:
    """The strings of a list, or the one that stands in its place."""
    for item in node.items if isinstance(node, Sequence) else [node]:
        if isinstance(item, Scalar):
            yield item


def scalars_of(node: Node) -> Iterator[Scalar]:
    """All strings below a node that are values."""
    match node:
        case Scalar():
            yield node
        case Sequence():
            for item in node.items:
                yield from scalars_of(item)
        case Mapping():
            for _, value in node.entries.values():
                yield from scalars_of(value)
