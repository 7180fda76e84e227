"""What pydantic finds wrong with a document, said to the engineer who wrote the file.

Pydantic reports every error with its path; here each becomes a diagnostic with a code, the place in the text and a
hint. Wrong indentation is the mistake that makes the most noise: `places:` one level too far left is a controller named
"places" with unknown keys. So errors below a name that is really a key are joined into one that says so, and so are
those of all entries that stand in a wrong table, since the line that begins theirs is missing. A slip of the pen makes
two errors, an unknown key and a missing one: it is said once, at the key as it is written.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from pydantic import BaseModel, ValidationError

from firable.nets import document as doc
from firable.nets.diagnostics import Diagnostic, Subject, bounded, did_you_mean
from firable.nets.source import Source, quoted
from firable.nets.written_as_one import written_as_one
from firable.nets.yaml_tree import Mapping as MappingNode
from firable.nets.yaml_tree import Node, Path, Scalar, Sequence, as_written, node_span, nodes_along

_QUOTED: Final = re.compile(r"'([^']*)'")
ERRORS_MAX: Final = 200  # enough to join and to read; a file of noise has millions


@dataclass(frozen=True, slots=True)
class Shape:
    """A format of files: its version's key, what such a file is, the keys of each mapping, and what tables hold.

    `keys` has the path of every mapping whose keys are not names; `*` stands for a name. `nouns` says of what the names
    in a table are the names. `kinds` has the paths of mappings of several kinds, which a key of theirs tells; pydantic
    puts the kind into its paths, and `keys` has it there too.
    """

    version: str
    file: str
    keys: Mapping[tuple[str, ...], tuple[str, ...]]
    nouns: Mapping[str, str]
    kinds: Collection[tuple[str, ...]] = ()

    def keys_at(self, path: Path) -> tuple[str, ...]:
        """The keys of the mapping at a path; none where its keys are names."""
        return next((keys for pattern, keys in self.keys.items() if _fits(pattern, path)), ())

    def in_file(self, path: Path) -> Path:
        """A path of pydantic as the file has it: without the kind of a mapping."""
        for pattern in self.kinds:
            if len(path) > len(pattern) and _fits(pattern, path[: len(pattern)]):
                return (*path[: len(pattern)], *path[len(pattern) + 1 :])
        return path


def _fits(pattern: tuple[str, ...], path: Path) -> bool:
    return len(pattern) == len(path) and all(p in {"*", step} for p, step in zip(pattern, path, strict=True))


def keys_of(model: type[BaseModel]) -> tuple[str, ...]:
    """The keys of the mapping that a model describes."""
    return tuple(field.alias or name for name, field in model.model_fields.items())


_OF_PLACES: Final[tuple[tuple[tuple[str, ...], type[BaseModel]], ...]] = (
    ((), doc.PlaceDocument),
    (("send",), doc.CommandDocument),
    (("within",), doc.WithinDocument),
    (("task",), doc.TaskUseDocument),
    (("opens",), doc.ResourceDocument),
)
_OF_NET: Final[tuple[tuple[tuple[str, ...], type[BaseModel]], ...]] = (
    ((), doc.NetDocument),
    (("controllers", "*"), doc.ControllerDocument),
    *((("controllers", "*", "places", "*", *key), model) for key, model in _OF_PLACES),
    *((("places", "*", *key), model) for key, model in _OF_PLACES),
    (("transitions", "*"), doc.TransitionDocument),
    (("arbiters", "*"), doc.ArbiterDocument),
    (("properties", "*"), doc.PropertyDocument),
    (("properties", "*", "leads_to"), doc.LeadsToDocument),
)
NET: Final = Shape(
    "firable",
    "net file",
    {path: keys_of(model) for path, model in _OF_NET},
    {
        "controllers": "controller",
        "places": "place",
        "transitions": "transition",
        "arbiters": "arbiter",
        "properties": "property",
    },
)


_KINDS: Final = {
    "firable": ("a net file", "`firable check` and most commands"),
    "firable_plant": ("a plant file", "`--machines` of `check`, and `--plant` of `run` and `sim`"),
    "firable_bind": ("a binding", "`firable io`, and `--bind` of `run`"),
    "firable_tasks": ("a file of tasks", "`--tasks` of `refine`"),
    "firable_layout": ("a layout file", "`draw` and `view`, where it stands beside its net"),
    "firable_evidence": ("evidence", "`firable verify`"),
    "firable_report": ("a report", "other programs"),
    "firable_signatures": ("signatures", "`firable sign` and `firable run`, beside their bundle"),
}
"""By the key of its version, what each kind of file is, and what reads it."""


_VERSION_LINE: Final = re.compile(r"(firable\w*):\s*\d+\s*(?:#.*)?")


def of_another_kind(source: Source) -> Diagnostic | None:
    """What is wrong with a file of queries that is a file of another kind, by the line of its version (F1018)."""
    for number, line in enumerate(source.lines, 1):
        found = _VERSION_LINE.fullmatch(line)
        if found is not None and found[1] in _KINDS:
            what, readers = _KINDS[found[1]]
            hint = f"{what} is for {readers}; a file of queries has lines such as `name: AG not deadlock`"
            return Diagnostic("F1018", f"this is {what}, and no file of queries", hint, span=source.span(number, 1))
    return None


def version_problem(source: Source, tree: Node, shape: Shape = NET) -> Diagnostic | None:
    """What is wrong with the line such as `firable: 1`, which tells what file this is and of which version."""
    wanted = shape.version
    hint = f"a {shape.file} begins with `{wanted}: 1`, the version of the format"
    if not isinstance(tree, MappingNode):
        return Diagnostic("F1010", f"this is not a {shape.file}: it has no keys", hint, span=node_span(source, tree))
    entry = tree.entries.get(wanted)
    other = next((key for key in tree.entries if key in _KINDS), None)
    if entry is None and other is not None:
        what, readers = _KINDS[other]
        message = f"the key '{wanted}' is missing: this is {what}, and no {shape.file}"
        hint = f"{what} is for {readers}; a {shape.file} begins with `{wanted}: 1`"
        return Diagnostic("F1009", message, hint, span=node_span(source, tree.entries[other][0]))
    if entry is None:
        close = next((key for key in tree.entries if did_you_mean(key, [wanted])), None)
        span = node_span(source, tree.entries[close][0]) if close else source.span(tree.line, tree.column)
        found = f": {quoted(close)} is not it" if close else ""
        return Diagnostic("F1009", f"the key '{wanted}' is missing{found}", hint, span=span)
    value = entry[1]
    if not isinstance(value, Scalar) or value.text != "1":
        found = quoted(value.text) if isinstance(value, Scalar) else "this"
        return Diagnostic(
            "F1011", f"{found} is not a version of the format that this release reads", f"write `{wanted}: 1`",
            span=node_span(source, value),
        )  # fmt: skip
    return None


def document_problems(
    source: Source, tree: Node, error: ValidationError, shape: Shape = NET, below: Path = ()
) -> list[Diagnostic]:
    """The errors of a validation as diagnostics in the order of the text; what was validated stands `below` a path."""
    problems: dict[tuple[int, int, str], Diagnostic] = {}
    errors = error.errors(include_url=False, include_input=False)[:ERRORS_MAX]
    unknown = {(*below, *one["loc"]) for one in errors if one["type"] == "extra_forbidden"}
    for one in errors:
        found = _Error((*below, *one["loc"]), one["type"], one["msg"], one.get("ctx", {}))
        problem = _problem(source, tree, shape, _of_the_kind(found), unknown)
        if problem is not None and (span := problem.span) is not None:
            problems.setdefault((span.line, span.column, problem.code), problem)
    return bounded(list(_first_misplaced([problems[key] for key in sorted(problems)])))


def _first_misplaced(problems: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """Of the misplaced keys of one mapping only the first: the others were moved with it."""
    seen: set[Subject] = set()
    for problem in problems:
        if not problem.subject or problem.subject not in seen:
            yield problem
        seen.add(problem.subject)


@dataclass(frozen=True, slots=True)
class _Error:
    """An error of pydantic: where, of which type, what it says of it, and its figures and words."""

    path: Path
    kind: str
    message: str
    context: Mapping[str, Any]


def _of_the_kind(error: _Error) -> _Error:
    """An error about the kind of a mapping as one about the key that tells it."""
    path = (*error.path, "", str(error.context.get("discriminator", "")).strip("'"))
    match error.kind:
        case "union_tag_not_found":
            return _Error(path, "missing", error.message, error.context)
        case "union_tag_invalid":
            return _Error(path, "literal_error", error.message, {"expected": error.context["expected_tags"]})
        case _:
            return error


def _problem(source: Source, tree: Node, shape: Shape, error: _Error, unknown: Collection[Path]) -> Diagnostic | None:
    """What an error says; None where the error at one of the `unknown` keys says it."""
    kind, context = error.kind, error.context
    path = as_written(tree, shape.in_file(error.path))
    if misplaced := _misplaced(source, tree, shape, path, kind) or _of_another_table(source, tree, shape, path):
        return misplaced
    known = shape.keys_at(error.path[:-1])
    found = list(nodes_along(tree, path))
    key, node = found[-1]
    if kind == "extra_forbidden":
        unknown_key = f"unknown key {quoted(str(path[-1]))}{_inside(path[:-1])}"
        owner = found[-2][1] if len(found) > 1 else tree
        of, names = _list_with(owner, str(path[-1]), known)
        if names[2:] and path[-1] != names[1]:
            return None  # what was said of the first says it
        better = _of_an_inner_mapping(shape, error.path, known, owner) or written_as_one(", ".join(names), names, of)
        if better:
            return Diagnostic("F1008", unknown_key, better, span=node_span(source, key or node))
        hint = f"the keys here are {', '.join(known)}; check the indentation too"
        if isinstance(node, Scalar) and node.plain and not node.text and len(found) > 1:
            hint += ", and write a text with a comma in double quotes"
        return Diagnostic(
            "F1008",
            unknown_key,
            did_you_mean(str(path[-1]), known) + hint,
            span=node_span(source, key or node),
        )
    if kind == "missing":
        own_key, mapping = found[len(path) - 1] if len(found) >= len(path) else found[-1]
        written = _slip(mapping, str(path[-1]), known)
        if written is not None and (*error.path[:-1], written.text) in unknown:
            return None
        said = f": {quoted(written.text)} is not it" if written else ""
        return Diagnostic(
            "F1009",
            f"the key '{path[-1]}' is missing{_inside(path[:-1])}{said}",
            f"write `{path[-1]}:`" if written else f"add `{path[-1]}:`",
            span=node_span(source, written or own_key or mapping),
        )
    if kind == "no_arcs" and _has_slipped(list(nodes_along(tree, path[:-1]))[-1][1], shape.keys_at(path)):
        return None  # its keys stand beside it, where that is said
    if kind in {"refused", "value_error"}:  # what a model says itself; with a hint the first, and the second of others
        said = str(context.get("error", error.message)) + _inside(path)
        return Diagnostic("F1010", said, str(context.get("hint", "")), span=node_span(source, key or node))
    if path[-1:] == ("[key]",):
        return Diagnostic(
            "F2012", "an empty name", "write a name before the colon", span=node_span(source, key or node)
        )
    empty = isinstance(node, Scalar) and node.plain and not node.text
    at = key if empty and key is not None else node
    return Diagnostic(
        "F1010", f"{_found(node)} stands{_where(path)}", _wanted(kind, context, node, path), span=node_span(source, at)
    )


_OF_NAMES: Final = frozenset({"from", "to", "if", "unless", "start", "inputs", "among", "release"})
"""Keys of lists of names; `from` and `to` are so where there are gates, too."""


def _list_with(owner: Node, name: str, known: Collection[str]) -> tuple[str, list[str]]:
    """The key and the names of a list without brackets in which a name stands, which is taken for a key; or none.

    In braces `if: a, b` is the key `if` and a key `b`.
    """
    names, of = list[str](), ""
    for key, (_, node) in owner.entries.items() if isinstance(owner, MappingNode) else ():
        text = node.text if isinstance(node, Scalar) else None
        if key in known:
            if name in names:
                break
            names, of = [text] if text else [], key
        else:
            names = [*names, key] if names and text == "" else []
    if name not in names or of not in _OF_NAMES or (of in {"from", "to"} and "if" not in known):
        return "", []
    return of, names


_FORMS: Final = {
    "leads_to": "{from: a, to: b, fairness: strong}",
    "within": "{time: 5s, to: late, timer: overdue}",
    "send": "{machine: R, command: MOVE}",
    "opens": "{to: CONTROLLER.PLACE, machine: R}",
}


def _of_an_inner_mapping(shape: Shape, path: Path, known: Collection[str], owner: Node) -> str:
    """The hint on a key that stands one level too high: beside the mapping that it is a key of, or without that one."""
    given = owner.entries if isinstance(owner, MappingNode) else {}
    outer = [key for key in _FORMS if key in known and str(path[-1]) in shape.keys_at((*path[:-1], key))]
    if len(outer) > 1:  # `machine`, of a command or of a resource: whichever is there
        outer = [key for key in outer if key in given]
    return f"'{path[-1]}' is a key of `{outer[0]}`: write `{outer[0]}: {_FORMS[outer[0]]}`" if outer else ""


def _slip(node: Node, missing: str, known: Collection[str]) -> Scalar | None:
    """The key of a mapping that was probably meant to be the missing one."""
    keys = (
        [key for name, (key, _) in node.entries.items() if name not in known] if isinstance(node, MappingNode) else []
    )
    return next((key for key in keys if did_you_mean(key.text, [missing])), None)


def _misplaced(source: Source, tree: Node, shape: Shape, path: Path, kind: str) -> Diagnostic | None:
    """The one diagnostic for a key that indentation has made a name, such as a controller named "places"."""
    deepest = len(path) + 1 if kind in {"model_type", "model_attributes_type"} else len(path)
    for length in range(2, deepest):
        name = str(path[length - 1])
        outer, inner = shape.keys_at(path[: length - 2]), shape.keys_at(path[:length])
        if path[length - 2] not in shape.nouns or not inner or name not in {*outer, *inner}:
            continue
        key, entry = list(nodes_along(tree, path[:length]))[-1]
        if key is not None and not _means(entry, inner):
            noun = shape.nouns[str(path[length - 2])]
            return Diagnostic(
                "F1008",
                f"'{name}' stands where the name of a {noun} is expected",
                f"'{name}' is a key of the format: check the indentation of this line and of those below it",
                subject=tuple(map(str, path[: length - 1])),
                span=node_span(source, key),
            )
    return None


def _has_slipped(table: Node, inner: Collection[str]) -> bool:
    """Whether keys of an entry stand in the table itself, as names of entries."""
    entries = table.entries if isinstance(table, MappingNode) else {}
    return any(name in inner and not isinstance(value, MappingNode) for name, (_, value) in entries.items())


def _means(entry: Node, keys: tuple[str, ...]) -> bool:
    """Whether each key of an entry is one of these, or a slip of the pen: then its name is a name."""
    return isinstance(entry, MappingNode) and all(key in keys or did_you_mean(key, keys) for key in entry.entries)


def _of_another_table(source: Source, tree: Node, shape: Shape, path: Path) -> Diagnostic | None:
    """The one diagnostic for entries that stand in the wrong table: transitions among the controllers, say."""
    if len(path) < 3 or path[0] not in shape.nouns:
        return None
    key, entry = list(nodes_along(tree, path[:2]))[-1]
    if key is None or not isinstance(entry, MappingNode) or not entry.entries:
        return None
    given = set(entry.entries)
    if given <= set(shape.keys_at(path[:2])):
        return None
    for table, noun in shape.nouns.items():
        if table != path[0] and given <= set(shape.keys_at((table, "*"))):
            article = "an" if noun[0] in "aeiou" else "a"
            return Diagnostic(
                "F1008",
                f"{quoted(str(path[1]))} has the keys of {article} {noun} but stands among the {path[0]}",
                f"write `{table}:` in a line of its own above the first {noun}; check the indentation too",
                subject=(str(path[0]), table),
                span=node_span(source, key),
            )
    return None


def _inside(path: Path) -> str:
    return f" in '{'.'.join(str(step) for step in path)}'" if path else ""


def _where(path: Path) -> str:
    names = [str(step) for step in path if isinstance(step, str) and step != "[key]"]
    return f" as '{names[-1]}' of '{'.'.join(names[:-1])}'" if len(names) > 1 else f" as '{names[-1]}'" if names else ""


def _found(node: Node) -> str:
    match node:
        case MappingNode():
            return "a mapping"
        case Sequence():
            return "a list"
        case Scalar(text, plain):
            return "nothing" if plain and not text else quoted(text)


def _wanted(kind: str, context: Mapping[str, Any], node: Node, path: Path) -> str:
    text = node.text if isinstance(node, Scalar) else ""
    is_word = isinstance(node, Scalar) and node.plain and text in {"true", "false"}
    match kind:
        case "model_type" if path[-1:] == ("leads_to",):
            return f"two formulas are expected: `[a, b]`, or `{_FORMS['leads_to']}`"
        case "model_type" if path[-1:] == ("within",):
            return "a time is expected, such as `5s`, or a mapping with `time: 5s`"
        case "model_type" if path[:-1] == ("signals",):
            meant = did_you_mean(text, ["acknowledged"])
            return f"{meant}`{{device: ..., read: ...}}` is expected, or `acknowledged` of a completion"
        case "list_type" | "too_short" if path[-1:] == ("departures",):
            return "`{station: NAME}`, or a list of these, is expected"
        case "dict_type" | "too_short" if path[-1:] == ("next",):
            return "which station is next to which is expected: `{load: drill, drill: unload}`"
        case "dict_type" if path == ("full_at_first",):
            return "what lies on which station is expected: `{drill: raw}`, or `machined`"
        case "nothing_given":
            return f"write it, or leave `{path[-1]}` out for what holds without it"
        case "no_arcs":
            return "write what it takes and puts, `{from: p, to: q}`, or `{}` for a transition that waits for nothing"
        case "string_type" if is_word:
            return f'a name or text is expected: write "{text}" in double quotes if it is one'
        case "string_type" | "string_too_short":
            return "a name or text is expected"
        case "list_type" if text and not is_word:  # a name for a list of one name is not taken here
            return "a list is expected: `[name, name]`"
        case "list_type" | "tuple_type":
            leave = f"; leave `{path[-1]}` out where there is none" if text == "" else ""
            return f"a name or a list of names is expected: `name` or `[name, name]`{leave}"
        case "int_type" if text.isdigit():
            return f"a whole number of {doc.DIGITS_MAX} digits at most, without a 0 before it, is expected"
        case "int_type":
            return "a whole number from 0 is expected"
        case "int_parsing" | "float_parsing" | "float_type" | "finite_number":
            return _number_wanted(kind == "int_parsing", context, path)
        case "greater_than" | "greater_than_equal" | "less_than_equal":
            is_whole = any(isinstance(context.get(key), int) for key in ("gt", "ge", "le"))
            return _number_wanted(is_whole, context, path)
        case "bool_type" | "bool_parsing":
            return "true or false is expected"
        case "literal_error" | "enum":
            expected = str(context.get("expected", "another word"))
            words = _QUOTED.findall(expected)
            among = "one of " if len(words) > 2 else ""
            return f"{did_you_mean(text, words)}{among}{expected} is expected"
        case "too_short" | "too_long":
            return "a list of another length is expected"
        case _:
            return "a mapping, lines of `name: value`, is expected"


def _number_wanted(is_whole: bool, context: Mapping[str, Any], path: Path) -> str:
    bounds = {"gt": "over", "ge": "from", "le": "to"}
    said = "".join([f" {word} {context[key]:.15g}" for key, word in bounds.items() if key in context])
    if path[-1] == "likely":
        return "a number from 0 to 1 is expected"
    if str(path[-1]).endswith("_s"):
        return f"a number of seconds{said}, without a unit, is expected"
    return f"a {'whole ' if is_whole else ''}number{said} is expected"
