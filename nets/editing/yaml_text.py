"""A YAML text of which single entries are changed, and every other character stays as it is.

A file that people write has comments, blank lines, an order and columns, and none of them are in what a parser gives.
So nothing is printed anew: the nodes say from which character to which they stand, and an edit replaces that part
alone. A new entry is written in the manner of its neighbours, a line of a block or a part of `{...}`, and it comes
after the entry that it follows in a list of keys, or last.

Text is easily edited wrongly (a comment with a brace in it, a key over two lines). So each edit is done twice,
to the text and to the data that it stands for, and the new text must be read as the new data; where it is not, the edit
is refused, and the text stays as it was.

Rejected: `ruamel.yaml`, which keeps comments and order, and writes columns, quotes and line breaks in its own way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import yaml

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import Source
from firable.nets.yaml_tree import data, parse_tree
from firable.nets.yaml_writing import flow_list, flow_mapping, scalar

_LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_STEP: Final = 2

Path = tuple[str, ...]


@dataclass(frozen=True)
class Raw:
    """A value as it is written somewhere, to be written elsewhere as it is: its text, and what it says."""

    text: str
    data: Any
    column: int
    """Where the key of its lines began, in columns; lines after the first move with it."""
    is_block: bool
    comment: str = ""


Value = str | list[str] | Raw | dict[str, "Value"] | None


@dataclass(frozen=True)
class YamlText:
    """A text, edited by making others of it; raises `InputError` as `parse_tree` does where it is not YAML.

    >>> text = YamlText(Source("c", "places:\\n  p:   # the first\\ntransitions: {t: {from: p}}\\n"))
    >>> print(text.with_entry(("places",), "q", None).with_item(("transitions", "t"), "to", "q").text, end="")
    places:
      p:   # the first
      q:
    transitions: {t: {from: p, to: q}}
    """

    source: Source

    @property
    def text(self) -> str:
        """The whole text."""
        return self.source.text

    @cached_property
    def data(self) -> Any:
        """What it says."""
        return data(parse_tree(self.source))

    @cached_property
    def _root(self) -> yaml.Node:
        assert self.data is not None  # what `compose` would follow, or guess, is refused first
        root = yaml.compose(self.text, Loader=_LOADER)
        assert root is not None
        return root

    @cached_property
    def _newline(self) -> str:
        return "\r\n" if "\r\n" in self.text else "\n"

    def at(self, path: Path) -> Any:
        """The data at a path; None where there is nothing."""
        found = self.data
        for key in path:
            found = found.get(key) if isinstance(found, dict) else None
        return found

    def has(self, path: Path) -> bool:
        """Whether an entry stands at a path, with a value or without."""
        above = self.at(path[:-1])
        return isinstance(above, dict) and path[-1] in above

    # Edits

    def with_entry(self, path: Path, key: str, value: Value, after: Sequence[str] = ()) -> YamlText:
        """The text with one more entry in the mapping at a path, which is made where it is missing.

        The entry follows the last of the entries that `after` names; with none of them there, it is the last one where
        `after` is empty, else the first. Raises `InputError` F1006 where the key is there already, F1020 where the
        text has another form.
        """
        if path and not self.has(path):
            return self.with_entry(path[:-1], path[-1], {key: value}, after=_TABLES_AFTER.get(path[-1], ()))
        if self.has((*path, key)):
            raise InputError([Diagnostic("F1006", f"there is a '{key}' already", "choose another name")])
        expected = _with(self.data, path, lambda old: {**(old or {}), key: _said(value)})
        node = self._node(path)
        if isinstance(node, yaml.MappingNode) and node.value:
            position = _place(node, after)
            return self._checked(self._inserted(node, position, key, value), expected)
        return self._checked(self._filled(path, node, key, value), expected)

    def without_entry(self, path: Path) -> YamlText:
        """The text without an entry, which must be there."""
        expected = _with(self.data, path[:-1], lambda old: {k: v for k, v in old.items() if k != path[-1]})
        node = self._node(path[:-1])
        assert isinstance(node, yaml.MappingNode)
        parts = [(key.start_mark.index, self._end(key, value)) for key, value in node.value]
        index = next(i for i, (key, _) in enumerate(node.value) if key.value == path[-1])
        text = self._cut(node, parts, index)
        if len(parts) == 1 and path[:-2] == ("transitions",) and not node.flow_style:
            above = self._node(path[:-2])
            assert isinstance(above, yaml.MappingNode)
            name = next(key for key, _ in above.value if key.value == path[-2])
            colon = self.text.index(":", name.end_mark.index) + 1
            text = f"{text[:colon]} {{}}{text[colon:]}"  # a transition of nothing is none
        return self._checked(text, expected)

    def with_item(self, path: Path, key: str, item: str, after: Sequence[str] = ()) -> YamlText:
        """The text with one more name in the list at `key` of the mapping at a path; one name alone is a list of it."""
        if not self.has((*path, key)):
            return self.with_entry(path, key, item, after)
        old, node = _names(self.at((*path, key))), self._node((*path, key))
        expected = _with(self.data, (*path, key), lambda _: [*old, item])
        if isinstance(node, yaml.SequenceNode):
            return self._checked(self._appended(node, item), expected)
        assert isinstance(node, yaml.ScalarNode)
        begin, end = node.start_mark.index, _end_of(self.text, node)
        if not old:
            return self._checked(self._put(begin, " " + scalar(item)), expected)
        return self._checked(f"{self.text[:begin]}[{self.text[begin:end]}, {scalar(item)}]{self.text[end:]}", expected)

    def without_item(self, path: Path, key: str, item: str) -> YamlText:
        """The text without a name in the list at `key`; the entry goes with its last name."""
        old, node = _names(self.at((*path, key))), self._node((*path, key))
        if old == [item]:
            return self.without_entry((*path, key))
        assert isinstance(node, yaml.SequenceNode)
        index = old.index(item)
        expected = _with(self.data, (*path, key), lambda _: [*old[:index], *old[index + 1 :]])
        parts = [(one.start_mark.index, _end_of(self.text, one)) for one in node.value]
        return self._checked(self._cut(node, parts, index), expected)

    def with_text(self, path: Path, text: str) -> YamlText:
        """The text with another text at a path where one stands."""
        node = self._node(path)
        begin, end = node.start_mark.index, _end_of(self.text, node)
        space = "" if begin and self.text[begin - 1].isspace() else " "
        expected = _with(self.data, path, lambda _: text)
        return self._checked(f"{self.text[:begin]}{space}{scalar(text)}{self.text[end:]}", expected)

    def raw(self, path: Path) -> Raw:
        """The value at a path as it is written, with the comment on its line."""
        above, node = self._node(path[:-1]), self._node(path)
        assert isinstance(above, yaml.MappingNode)
        key = next(key for key, _ in above.value if key.value == path[-1])
        end = self._end(key, node)
        text = self.text[node.start_mark.index : end] if end > node.start_mark.index else ""
        rest = "" if above.flow_style else self.text[end : self._line_end(end)].strip()
        is_block = isinstance(node, yaml.CollectionNode) and not node.flow_style
        return Raw(text, self.at(path), key.start_mark.column, is_block, rest)

    # Where things stand

    def _node(self, path: Path) -> yaml.Node:
        node = self._root
        for step in path:
            assert isinstance(node, yaml.MappingNode)
            node = next(value for key, value in node.value if key.value == step)
        return node

    def _end(self, key: yaml.Node, value: yaml.Node) -> int:
        """The end of an entry; one without a value ends with the colon after its key."""
        if isinstance(value, yaml.ScalarNode) and not value.style and not value.value:
            after = key.end_mark.index
            rest = self.text[after : value.start_mark.index]
            return after + len(rest) - len(rest.lstrip()) + 1 if rest.lstrip().startswith(":") else after
        return _end_of(self.text, value)

    def _line_end(self, at: int) -> int:
        end = self.text.find("\n", at)
        end = len(self.text) if end < 0 else end
        return end - 1 if self.text[end - 1 : end] == "\r" else end

    def _line_begin(self, at: int) -> int:
        return self.text.rfind("\n", 0, at) + 1

    # Pieces of text

    def _put(self, at: int, piece: str) -> str:
        return self.text[:at] + piece + self.text[at:]

    def _inserted(self, node: yaml.MappingNode, position: int, key: str, value: Value) -> str:
        """With an entry before the one at a position of a mapping that has entries."""
        first = node.value[0][0]
        if node.flow_style:
            piece = f"{scalar(key)}: {_flow(value)}"
            if position == 0:
                return self._put(first.start_mark.index, f"{piece}, ")
            end = self._end(*node.value[position - 1])
            before = " , " if self.text[end - 1] == ":" else ", "
            return self._put(end, before + (piece.rstrip() if self.text[end : end + 1] == " " else piece))
        indent = first.start_mark.column
        lines = _block(key, value, indent)
        if position == 0:
            piece = self._newline.join(lines) + self._newline + " " * indent
            return self._put(first.start_mark.index, piece.removeprefix(" " * indent))
        end = self._line_end(self._end(*node.value[position - 1]))
        blank = [""] if node is self._root and isinstance(value, dict) else []
        return self._put(end, self._newline + self._newline.join([*blank, *lines]))

    def _filled(self, path: Path, node: yaml.Node, key: str, value: Value) -> str:
        """With the first entry of a mapping that has none: `{}`, or nothing at all."""
        if isinstance(node, yaml.MappingNode):
            return self._put(node.start_mark.index + 1, f"{scalar(key)}: {_flow(value)}")
        above = self._node(path[:-1])
        assert isinstance(above, yaml.MappingNode)
        own = next(k for k, _ in above.value if k.value == path[-1])
        end = self._end(own, node)
        is_small = path[0] == "transitions" or path[-2:-1] == ("places",)
        if above.flow_style or is_small:
            colon = "" if self.text[end - 1] == ":" else ":"
            return self._put(end, f"{colon} {{{scalar(key)}: {_flow(value)}}}")
        lines = _block(key, value, own.start_mark.column + _STEP)
        return self._put(self._line_end(end), self._newline + self._newline.join(lines))

    def _appended(self, node: yaml.SequenceNode, item: str) -> str:
        if not node.value:
            return self._put(node.start_mark.index + 1, scalar(item))
        end = _end_of(self.text, node.value[-1])
        if node.flow_style:
            return self._put(end, f", {scalar(item)}")
        return self._put(self._line_end(end), f"{self._newline}{' ' * node.start_mark.column}- {scalar(item)}")

    def _cut(self, node: yaml.CollectionNode, parts: Sequence[tuple[int, int]], index: int) -> str:
        """Without one of the parts of a collection: its lines, or what stands between commas."""
        begin, end = parts[index]
        if not node.flow_style:
            begin, end = self._line_begin(begin), self._line_end(end)
            end += len(self._newline) if self.text.startswith(self._newline, end) else 0
            return self.text[:begin] + self.text[end:]
        if index + 1 < len(parts):
            return self.text[:begin] + self.text[parts[index + 1][0] :]
        comma = self.text.find(",", parts[index - 1][1], begin) if index else -1
        if comma < 0:
            return self.text[:begin] + self.text[end:]
        between = self.text[comma + 1 : begin]
        return self.text[:comma] + (between if between.strip() else "") + self.text[end:]

    def _checked(self, text: str, expected: Any) -> YamlText:
        """The new text, which must say what is expected of it."""
        made = YamlText(Source(self.source.file, text))
        try:
            is_right = _same(made.data) == _same(expected)
        except InputError:
            is_right = False
        if not is_right:
            hint = "write it in the text of the file"
            raise InputError([Diagnostic("F1020", "the text stands here in a form that is not edited by itself", hint)])
        return made


SCOPE_KEYS: Final = ("firable", "cell", "coordinator", "under", "description", "controllers", "start", "inputs")
"""The keys of a net and of a controller before its tables, in their order."""
_TABLES_AFTER: Final = {
    "controllers": SCOPE_KEYS[:5],
    "places": SCOPE_KEYS,
    "transitions": (*SCOPE_KEYS, "places"),
    "arbiters": (*SCOPE_KEYS, "places", "transitions"),
}
"""The keys that a table follows where it is made."""


def _place(node: yaml.MappingNode, after: Sequence[str]) -> int:
    """Before which entry of a mapping a new one goes."""
    if not after:
        return len(node.value)
    return max((i + 1 for i, (key, _) in enumerate(node.value) if key.value in after), default=0)


def _end_of(text: str, node: yaml.Node) -> int:
    """The end of what a node says: without the blank lines and comments after a block."""
    if isinstance(node, yaml.ScalarNode):
        end = node.end_mark.index
        return len(text[:end].rstrip()) if node.style in {"|", ">"} else end
    assert isinstance(node, yaml.CollectionNode)
    if node.flow_style:
        return node.end_mark.index
    last = node.value[-1]
    if not isinstance(last, tuple):
        return _end_of(text, last)
    key, value = last
    if isinstance(value, yaml.ScalarNode) and not value.style and not value.value:
        colon = text.find(":", key.end_mark.index)
        return colon + 1
    return _end_of(text, value)


def _block(key: str, value: Value, indent: int) -> list[str]:
    """An entry as lines of a block."""
    head = f"{' ' * indent}{scalar(key)}:"
    match value:
        case None:
            return [head]
        case Raw(text, _, column, is_block, comment):
            first, *rest = text.splitlines() or [""]
            moved = [_shifted(line, indent - column) for line in rest]
            if is_block:
                return [head, _shifted(" " * (column + _STEP) + first, indent - column), *moved]
            lines = [f"{head} {first}".rstrip(), *moved]
            lines[-1] += f"  {comment}" if comment else ""
            return lines
        case dict() if any(one is None or isinstance(one, dict | Raw) for one in value.values()):
            return [head, *(line for k, v in value.items() for line in _block(k, v, indent + _STEP))]
    return [f"{head} {_flow(value)}"]


def _shifted(line: str, by: int) -> str:
    bare = line.lstrip(" ")
    return " " * max(0, len(line) - len(bare) + by) + bare if bare else ""


def _flow(value: Value) -> str:
    """A value on one line."""
    match value:
        case None:
            return ""
        case Raw(text, _, _, is_block, comment):
            if is_block or "\n" in text or comment:
                hint = "move its lines in the text of the file"
                raise InputError([Diagnostic("F1020", "lines of their own do not go into `{...}`", hint)])
            return text
        case str():
            return scalar(value)
        case list():
            return flow_list(value)
    return flow_mapping((scalar(k), _flow(v)) for k, v in value.items())


def _said(value: Value) -> Any:
    """What a value says."""
    match value:
        case Raw():
            return value.data
        case dict():
            return {k: _said(v) for k, v in value.items()}
    return value


def _names(value: Any) -> list[str]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _with(tree: Any, path: Path, made: Any) -> Any:
    """The data with what stands at a path replaced by what is made of it."""
    if not path:
        return made(tree)
    return {key: _with(value, path[1:], made) if key == path[0] else value for key, value in tree.items()}


def _same(tree: Any) -> Any:
    """Data in which one name and a list of it are one, and so are nothing and an empty collection."""
    match tree:
        case dict():
            return {key: _same(value) for key, value in tree.items()} or None
        case list():
            return tree[0] if len(tree) == 1 else tree or None
    return tree
