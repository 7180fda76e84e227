"""A bundle with one of its files changed at random, every hash and seal made anew: what is left is only its content.

Of JSON a value, a key or an element is changed, taken out, doubled or put elsewhere; of any text a character, a word or
a line. Each mutant is as well made as a bundle can be: that its numbers and names are wrong is all there is to notice.
"""

import copy
import hashlib
import json
import random
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from firable.analysis.evidence.document import seal
from firable.nets.archive import pack
from firable.nets.bundle import VERSION, Bundle
from firable.nets.interchange import canonical_json

Path = tuple[Any, ...]


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def raw_mutant(bundle: Bundle, seed: int) -> tuple[str, bytes | None]:
    """What the seed changes, and the bytes of a bundle with that; None where it changes nothing."""
    draw = random.Random(seed)
    name = draw.choice(sorted(bundle.members))
    old = bundle.members[name].decode()
    how, new = _json_changed(old, draw) if name.endswith(".json") and draw.random() < 0.8 else _text_changed(old, draw)
    return f"{name}: {how}", None if new == old else _made_anew(bundle, name, new.encode())


def _made_anew(bundle: Bundle, name: str, data: bytes) -> bytes:
    members = {**bundle.members, name: data}
    judged = json.loads(members["verdicts.json"]) if name != "verdicts.json" else {}
    if name in judged.get("of", ()):
        judged["of"][name] = _sha256(data)
        members["verdicts.json"] = canonical_json(judged)
    hashes = {member: _sha256(content) for member, content in sorted(members.items())}
    manifest: dict[str, Any] = {"firable_bundle": VERSION, "cell": bundle.net.name, "members": hashes}
    manifest["digest"] = _sha256(canonical_json(manifest))
    return pack({**members, "manifest.json": canonical_json(manifest)})


def _json_changed(text: str, draw: random.Random) -> tuple[str, str]:
    data = json.loads(text)
    values = list(_values(data))
    path, value = draw.choice([one for one in values if one[0] and not isinstance(one[1], dict | list)] or values[1:])
    if draw.random() < 0.3:
        path, value = draw.choice([one for one in values if one[0] and isinstance(one[1], dict | list) and one[1]])
    changed = _changed(value, [other for _, other in values if isinstance(other, str)], draw)
    inside = data
    for key in path[:-1]:
        inside = inside[key]
    inside[path[-1]] = changed
    how = f"{'.'.join(map(str, path))} {str(value)[:60]} -> {str(changed)[:60]}"
    if "seal" not in data:
        return how, canonical_json(data).decode()
    data["seal"] = seal(data)
    return how, _laid_out_as(text, data)


def _laid_out_as(text: str, data: Mapping[str, Any]) -> str:
    """The document as it is written: a line for each verdict, and one for each other key."""

    def line(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False, separators=(",", ":"))

    def of(key: str, value: Any) -> str:
        many = key == "verdicts" and value
        return f"{line(key)}: " + ("[\n  " + ",\n  ".join(map(line, value)) + "\n ]" if many else line(value))

    assert text.startswith("{\n ")
    return "{\n " + ",\n ".join(of(key, value) for key, value in data.items()) + "\n}\n"


def _values(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    yield path, value
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield from _values(one, (*path, key))


def _changed(value: Any, words: list[str], draw: random.Random) -> Any:
    match value:
        case bool():
            return not value
        case int() | float():
            return value + draw.choice([-1, 1, 2, 10])
        case str():
            return draw.choice([f"{value}x", value[:-1], f"{value} ", value.upper(), draw.choice(words), ""])
        case dict():
            left = copy.copy(value)
            del left[draw.choice(list(left))]
            return left
        case list():
            i, k = draw.randrange(len(value)), draw.randrange(len(value))
            ways: list[Callable[[list[Any]], object]] = [
                lambda some: some.pop(i),
                lambda some: some.insert(i, some[i]),
                lambda some: some.insert(k, some.pop(i)),
            ]
            some = list(value)
            draw.choice(ways)(some)
            return some
    return draw.choice([0, "x"])


def _text_changed(text: str, draw: random.Random) -> tuple[str, str]:
    lines, words = text.split("\n"), list(re.finditer(r"\S+", text))
    i, k = draw.randrange(len(lines)), draw.randrange(len(lines))
    match draw.choice(["character", "word", "no word", "no line", "line twice", "lines"]):
        case "character":
            at, one = draw.randrange(len(text)), draw.choice('01 ax)("|;\n')
            return f"{one!r} at {at}", text[:at] + one + text[at + 1 :]
        case "word":
            word, other = draw.choice(words), draw.choice(words)[0]
            return f"{word[0]!r} is {other!r}", text[: word.start()] + other + text[word.end() :]
        case "no word":
            word = draw.choice(words)
            return f"no {word[0]!r} at {word.start()}", text[: word.start()] + text[word.end() :]
        case "no line":
            return f"no line {i}", "\n".join(lines[:i] + lines[i + 1 :])
        case "line twice":
            return f"line {i} twice", "\n".join(lines[: i + 1] + lines[i:])
    lines[i], lines[k] = lines[k], lines[i]
    return f"line {i} is {k}", "\n".join(lines)
