"""What pydantic finds wrong with a document, said to the engineer who wrote the file.

Pydantic reports every error with its path; here each becomes a diagnostic with a code, the place in the text and a
hint. Wrong indentation is the mistake that makes the most noise: `places:` one level too far left is a controller named
"places" with unknown keys. So errors below a name that is really a key are joined into one that says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Final

from pydantic import ValidationError

from firable.nets import document as doc
from firable.nets.diagnostics import Diagnostic, Subject, did_you_mean
from firable.nets.source import Source, quoted
from firable.nets.text_positions import bounded
from firable.nets.yaml_tree import Mapping, Node, Path, Scalar, Sequence, node_span, nodes_along

ERRORS_MAX: Final = 200  # enough to join and to read; a file of noise has millions

_KEYS: Final[dict[tuple[str, ...], tuple[str, ...]]] = {
    path: tuple(field.alias or name for name, field in model.model_fields.items())
    for path, model in (
        ((), doc.NetDocument),
        (("controllers", "*"), doc.ControllerDocument),
        (("controllers", "*", "places", "*"), doc.PlaceDocument),
        (("places", "*"), doc.PlaceDocument),
        (("transitions", "*"), doc.TransitionDocument),
        (("arbiters", "*"), doc.ArbiterDocument),
        (("properties", "*"), doc.PropertyDocument),
        (("properties", "*", "leads_to"), doc.LeadsToDocument),
    )
}
"""The keys of each mapping of the format whose keys are not names."""

_NOUNS: Final = {"controllers": "controller", "places": "place", "transitions": "transition", "properties": "property"}


def version_problem(source: Source, tree: Node) -> Diagnostic | None:
    """What is wrong with the line `firable: 1`, which tells that this is a net file and of which version."""
    hint = "a net file begins with `firable: 1`, the version of the format"
    if not isinstance(tree, Mapping):
        return Diagnostic("F1010", "this is not a net file: it has no keys", hint, span=node_span(source, tree))
    entry = tree.entries.get("firable")
    if entry is None:
        close = next((key for key in tree.entries if did_you_mean(key, ["firable"])), None)
        span = node_span(source, tree.entries[close][0]) if close else source.span(tree.line, tree.column)
        found = f": {quoted(close)} is not it" if close else ""
        return Diagnostic("F1009", f"the key 'firable' is missing{found}", hint, span=span)
    value = entry[1]
    if not isinstance(value, Scalar) or value.text != "1":
        found = quoted(value.text) if isinstance(value, Scalar) else "this"
        return Diagnostic(
            "F1011", f"{found} is not a version of the format that this release reads", "write `firable: 1`",
            span=node_span(source, value),
        )  # fmt: skip
    return None


def document_problems(source: Source, tree: Node, error: ValidationError) -> list[Diagnostic]:
    """The errors of a validation as diagnostics in the order of the text."""
    problems: dict[tuple[int, int, str], Diagnostic] = {}
    for one in error.errors(include_url=False, include_input=False)[:ERRORS_MAX]:
        problem = _problem(source, tree, tuple(one["loc"]), one["type"], one["msg"], one.get("ctx", {}))
        span = problem.span
        if span is not None:
            problems.setdefault((span.line, span.column, problem.code), problem)
    return bounded(list(_first_misplaced([problems[key] for key in sorted(problems)])))


def _first_misplaced(problems: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """Of the misplaced keys of one mapping only the first: the others were moved with it."""
    seen: set[Subject] = set()
    for problem in problems:
        if not problem.subject or problem.subject not in seen:
            yield problem
        seen.add(problem.subject)


def _problem(source: Source, tree: Node, path: Path, kind: str, message: str, context: dict[str, Any]) -> Diagnostic:
    if misplaced := _misplaced(source, tree, path, kind):
        return misplaced
    found = list(nodes_along(tree, path))
    key, node = found[-1]
    if kind == "extra_forbidden":
        known = _keys_at(path[:-1])
        hint = f"The keys here are {', '.join(known)}; check the indentation too"
        if isinstance(node, Scalar) and node.plain and not node.text and len(found) > 1:
            hint += ", and write a text with a comma in double quotes"
        return Diagnostic(
            "F1008",
            f"unknown key {quoted(str(path[-1]))}{_inside(path[:-1])}",
            did_you_mean(str(path[-1]), known) + hint,
            span=node_span(source, key or node),
        )
    if kind == "missing":
        owner = found[len(path) - 1] if len(found) >= len(path) else found[-1]
        return Diagnostic(
            "F1009",
            f"the key '{path[-1]}' is missing{_inside(path[:-1])}",
            f"add `{path[-1]}:`",
            span=node_span(source, owner[0] or owner[1]),
        )
    if kind == "value_error":  # the pattern of a property
        return Diagnostic(
            "F1010", str(context.get("error", message)) + _inside(path), "write one pattern for each property",
            span=node_span(source, key or node),
        )  # fmt: skip
    if path[-1:] == ("[key]",):
        return Diagnostic(
            "F2012", "an empty name", "write a name before the colon", span=node_span(source, key or node)
        )
    empty = isinstance(node, Scalar) and node.plain and not node.text
    at = key if empty and key is not None else node
    return Diagnostic(
        "F1010", f"{_found(node)} stands{_where(path)}", _wanted(kind, context, node, path), span=node_span(source, at)
    )


def _misplaced(source: Source, tree: Node, path: Path, kind: str) -> Diagnostic | None:
    """The one diagnostic for a key that indentation has made a name, such as a controller named "places"."""
    deepest = len(path) + 1 if kind in {"model_type", "model_attributes_type"} else len(path)
    for length in range(2, deepest):
        name = str(path[length - 1])
        outer, inner = _keys_at(path[: length - 2]), _keys_at(path[:length])
        if path[length - 2] not in _NOUNS or not inner or name not in {*outer, *inner}:
            continue
        key = list(nodes_along(tree, path[:length]))[-1][0]
        if key is not None:
            noun = _NOUNS[str(path[length - 2])]
            return Diagnostic(
                "F1008",
                f"'{name}' stands where the name of a {noun} is expected",
                f"'{name}' is a key of the format: check the indentation of this line and of those below it",
                subject=tuple(map(str, path[: length - 1])),
                span=node_span(source, key),
            )
    return None


def _keys_at(path: Path) -> tuple[str, ...]:
    for pattern, keys in _KEYS.items():
        if len(pattern) == len(path) and all(p in {"*", step} for p, step in zip(pattern, path, strict=True)):
            return keys
    return ()


def _inside(path: Path) -> str:
    return f" in '{'.'.join(str(step) for step in path)}'" if path else ""


def _where(path: Path) -> str:
    names = [str(step) for step in path if isinstance(step, str) and step != "[key]"]
    return f" as '{names[-1]}' of '{'.'.join(names[:-1])}'" if len(names) > 1 else f" as '{names[-1]}'" if names else ""


def _found(node: Node) -> str:
    match node:
        case Mapping():
            return "a mapping"
        case Sequence():
            return "a list"
        case Scalar(text, plain):
            return "nothing" if plain and not text else quoted(text)


def _wanted(kind: str, context: dict[str, Any], node: Node, path: Path) -> str:
    word = isinstance(node, Scalar) and node.plain and node.text in {"true", "false"}
    match kind:
        case "model_type" if path[-1:] == ("leads_to",):
            return "two formulas are expected: `[p, q]`, or `from:` and `to:`"
        case "string_type" if word and isinstance(node, Scalar):
            return f'a name or text is expected: write "{node.text}" in double quotes if it is one'
        case "string_type" | "string_too_short":
            return "a name or text is expected"
        case "list_type":
            return "a name or a list of names is expected: `name` or `[name, name]`"
        case "int_type" | "greater_than_equal":
            return "a whole number from 0 is expected"
        case "bool_type":
            return "true or false is expected"
        case "literal_error":
            return f"{context.get('expected', 'another word')} is expected"
        case "too_short" | "too_long":
            return "a list of another length is expected"
        case _:
            return "a mapping, lines of `name: value`, is expected"
