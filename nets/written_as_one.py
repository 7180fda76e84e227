"""Several names, or a condition, written in one text where the net file expects a name.

`if: not a.s` and `from: a, b` are read as one name each, which nothing has. The nearest known name would be a bad
answer: of `not a.s` it is `a.s`, the opposite. So such a text is read as the formula that it looks like, and the hint
says how the format says the same. The gates of a transition are a conjunction: what holds in one of several ways is as
many transitions, so a condition is told as its disjunctive normal form. To take conditions as they are written instead
would give the format a second way to say what gates say, and one transition the meaning of several.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from itertools import product
from typing import Final

from firable.nets.diagnostics import did_you_mean
from firable.nets.formula import And, Formula, FormulaError, Holds, Not, Or, names_in, parse_formula

GATES: Final = ("if", "unless")
_TEXT_MAX: Final = 400
_NAMES_MAX: Final = 12
_WAYS_MAX: Final = 4
"""What is longer is told in general."""

_AND: Final = re.compile(r"&+|∧|(?<![^\s()])and(?![^\s()])", re.IGNORECASE)
_OR: Final = re.compile(r"\|+|∨|(?<![^\s()])or(?![^\s()])", re.IGNORECASE)
_NOT: Final = re.compile(r"(?<![^\s(\[,;&|¬∧∨])(?:[!~¬/-]|not(?![^\s(]))", re.IGNORECASE)
_MARKED: Final = re.compile(r"(?<![^\s(\[,;&|])[/-]")
"""A negation only before what is known: a name may begin so."""
_DENYING: Final = frozenset("-/–—−")
"""How a name begins that somebody may have meant to deny; a word processor makes the dashes."""
_VALUE: Final = re.compile(
    r"(?P<name>[^\s()\[\],;&|!~=<>]+)\s*(?P<sign>==?|!=|<>|\bis\s+not\b|\bis\b)\s*"
    r"(?P<value>[01]|true|false|on|off|high|low)(?=$|[\s()\[\],;&|])",
    re.IGNORECASE,
)
_Way = tuple[frozenset[str], frozenset[str]]
"""The names that hold, and those that do not."""


def written_as_one(text: str, known: Collection[str], key: str) -> str:
    """The hint on a text that stands for a name under this key, and is a list or a condition; empty where it is none.

    It never names the opposite of what is written. `known` are the names that may stand there.

    >>> written_as_one("not a.s", ["a.s"], "if")
    'a gate is one name, and no condition: write `unless: a.s`'
    >>> written_as_one("p, q", ["p", "q"], "from")
    'a list stands in brackets: write `from: [p, q]`'
    """
    if len(text) > _TEXT_MAX:
        return ""
    return _condition(text, known, key) if key in GATES else _list(text, known, key)


def is_one_name(text: str) -> bool:
    """Whether a text looks like one name."""
    return not any(character.isspace() or character in "=!~¬&∧|∨,;()[]:'’^\\" for character in text)


def meant_by(text: str, known: Sequence[str]) -> str:
    """The start of a hint that names the closest known name, for a text that looks like one name, and denies none."""
    return did_you_mean(text, known) if is_one_name(text) and text[:1] not in _DENYING else ""


def _list(text: str, known: Collection[str], key: str) -> str:
    """The hint on names where no condition can stand."""
    names = _AND.sub(" ", re.sub(r"[,;\[\]]", " ", text)).split()
    if key in {"from", "to"} and (_OR.search(text) or _NOT.search(text)):
        return "an arc has no condition, gates have: write `if` or `unless`, and a transition for each of several ways"
    is_list = re.search(r"[,;]", text) or _AND.search(text) or {*names} <= {*known}
    if len(names) < 2 or not is_list or not all(map(is_one_name, names)):
        return ""
    return f"a list stands in brackets: write `{_entry(key, names)}`"


def _condition(text: str, known: Collection[str], key: str) -> str:
    """The hint on a gate."""
    formula = _formula(text, known, key)
    if formula is None or formula == Holds(text):
        return ""
    names = [atom.place for atom in names_in(formula) if isinstance(atom, Holds)]
    if _MARKED.search(text) and not {_full(name, known) for name in names} <= {*known}:
        return ""
    ways = list(dict.fromkeys(_ways(formula, is_wanted=key == "if"))) if len(names) <= _NAMES_MAX else []
    written = [
        ", ".join(
            _entry(gate, [_full(name, known) for name in dict.fromkeys(names) if name in of_gate])
            for gate, of_gate in zip(GATES, way, strict=True)
            if of_gate
        )
        for way in ways
    ]
    if len(written) == 1:
        return f"a gate is one name, and no condition: write `{written[0]}`"
    if 0 < len(written) <= _WAYS_MAX:
        said = ", one with ".join(f"`{one}`" for one in written)
        return f"all gates of a transition must be open: write one transition with {said}"
    return "a gate is one name, and no condition: write a list of them, and a transition for each of several ways"


def _formula(text: str, known: Collection[str], key: str) -> Formula | None:
    """The condition that a text looks like, if it is one of names; a list is what the key means by one."""
    if {*(names := text.split())} <= {*known}:
        text = ",".join(names)
    said = _VALUE.sub(_without_value, text)
    said = re.sub(r"[,;]", " and " if key == "if" else " or ", said.replace("[", "(").replace("]", ")"))
    said = _AND.sub(" and ", _OR.sub(" or ", _NOT.sub(" not ", said)))
    try:
        formula = parse_formula(said)
    except FormulaError:
        return None
    return formula if _is_of_names(formula) else None


def _without_value(match: re.Match[str]) -> str:
    is_one = match["value"].lower() in {"1", "true", "on", "high"}
    is_same = match["sign"].lower() in {"=", "==", "is"}
    return match["name"] if is_one is is_same else f"not {match['name']}"


def _is_of_names(formula: Formula) -> bool:
    match formula:
        case Holds(name):
            return is_one_name(name)
        case Not(operand):
            return _is_of_names(operand)
        case And(operands) | Or(operands):
            return all(map(_is_of_names, operands))
        case _:
            return False


def _ways(formula: Formula, is_wanted: bool) -> list[_Way]:
    """The disjunctive normal form of a formula, or of its negation."""
    match formula:
        case Holds(name):
            one, none = frozenset({name}), frozenset[str]()
            return [(one, none) if is_wanted else (none, one)]
        case Not(operand):
            return _ways(operand, not is_wanted)
        case And(operands) | Or(operands):
            parts = [_ways(operand, is_wanted) for operand in operands]
            if isinstance(formula, And) is not is_wanted:
                return [way for part in parts for way in part]
            return [_together(ways) for ways in product(*parts)]
        case _:
            raise AssertionError(f"{formula} is not of names")


def _together(ways: Sequence[_Way]) -> _Way:
    return frozenset(name for way in ways for name in way[0]), frozenset(name for way in ways for name in way[1])


def _full(name: str, known: Collection[str]) -> str:
    """A name as it stands in a gate: the full one, where a local one is written that one owner has."""
    alike = [full for full in known if full.rpartition(".")[2] == name] if name not in known else []
    return alike[0] if len(alike) == 1 else name


def _entry(key: str, names: list[str]) -> str:
    return f"{key}: {names[0]}" if len(names) == 1 else f"{key}: [{', '.join(names)}]"
