"""Ownership by rule: patterns for the names of places and signals, for nets whose files name no owner.

A net that comes from PNML has places and nobody who owns them; often their names tell. A rule gives a controller
whatever its patterns match (`*`, `?` and `[...]`, as in file names, of the whole name). What is joined needs no rule of
its own: a completion signal goes with the places that wait for it, as do their timers and fault places, and a sensor
with the only controller whose transitions it gates. Everything else must be matched by exactly one rule: a place that
two controllers own, or none, has no place in a split, and which of two rules was meant is not guessed by their order.

A file of rules is a mapping, one controller each:

    robot: [r_*, free]
    mc: m_*

Rejected: regular expressions, which say more than anyone needs here, and fail in ways that take a manual to read.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Mapping as Table
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Span, Subject
from firable.nets.net import Controller, Net
from firable.nets.owning import with_owners, with_those_named
from firable.nets.source import read_source
from firable.nets.yaml_tree import Mapping, Node, Scalar, data, node_span, parse_tree
from firable.nets.yaml_tree import Sequence as List

SIZE_BYTES_MAX: Final = 1024 * 1024
_HINT: Final = "write `CONTROLLER: PATTERN`, or `CONTROLLER: [PATTERN, PATTERN]`"


@dataclass(frozen=True, slots=True)
class Pattern:
    """What names look like, and where that stands in a file of rules."""

    text: str
    span: Span | None = field(default=None, compare=False)


Rules = Table[str, Sequence[Pattern]]
"""For each controller, in their order, the patterns of what it owns."""


def owned_by_rules(net: Net, rules: Rules) -> Net:
    """The net with the owners that the rules give, whatever owners it had before, and the controllers of the rules.

    Of those that own nothing then it keeps who stands above these, and whom a resource of a conceptual net opens to.

    A rule is asked of the name in the file. Raises `InputError`: F2002 for a pattern that matches nothing, F2023 for a
    place or signal to which two rules give an owner; F2011, with no F2002, for one to which no rule does.
    """
    names = [*(place.name for place in net.places), *(signal.name for signal in net.signals)]
    problems: list[Diagnostic] = []
    by_rule: dict[str, list[str]] = {name: [] for name in names}
    for controller, patterns in rules.items():
        for pattern in patterns:
            matched = [name for name in names if fnmatchcase(name, pattern.text)]
            if not matched:
                message = f"no place or signal is named like '{pattern.text}', which shall belong to '{controller}'"
                problems.append(Diagnostic("F2002", message, "correct the pattern, or take it out", span=pattern.span))
            for name in matched:
                if controller not in by_rule[name]:
                    by_rule[name].append(controller)
    places = {place.name for place in net.places}
    for name, owners in by_rule.items():
        if len(owners) > 1:
            message = f"'{name}' is given to each of {', '.join(owners)}"
            problems.append(Diagnostic("F2023", message, "narrow one of the rules", _subject(places, name)))
    if any(problem.code == "F2002" for problem in problems):  # what it leaves without an owner follows from it
        raise InputError(problems)
    _follow(net, by_rule)
    for name, owners in by_rule.items():
        if not owners:
            message = f"no rule gives '{name}' an owner, so no controller would keep it"
            hint = "add a rule that matches it, or widen one: `--own CONTROLLER='PATTERN'`"
            problems.append(Diagnostic("F2011", message, hint, _subject(places, name)))
    if problems:
        raise InputError(problems)
    known = {controller.name: controller for controller in net.controllers}
    controllers = with_those_named(net, [known.get(name, Controller(name)) for name in rules])
    return with_owners(net, {name: owners[0] for name, owners in by_rule.items()}, controllers)


def _subject(places: set[str], name: str) -> Subject:
    return ("places" if name in places else "signals", name)


def _follow(net: Net, by_rule: dict[str, list[str]]) -> None:
    """Give what no rule matches to whom it is joined to, where that is one controller."""
    waiting = {name for name, owners in by_rule.items() if not owners}
    follows: dict[str, set[str]] = {name: set() for name in waiting}
    cleared = {signal for place in net.places for signal in place.cleared}
    for p, place in enumerate(net.places):
        fault = net.fault_transitions.get(p)
        to = () if fault is None else net.transitions[fault].outputs
        for name in waiting.intersection((*place.cleared, *to)):
            follows[name].update(by_rule[place.name])
    sensors = {signal.name for signal in net.signals} & waiting - cleared
    for transition in net.transitions:
        gates = [gate.signal for gate in transition.external if gate.signal in sensors]
        for gate in gates:
            joined = (*transition.inputs, *transition.outputs, *transition.permissive, *transition.inhibitive)
            follows[gate].update(owner for name in joined for owner in by_rule[name])
    for name, owners in follows.items():
        if len(owners) == 1:
            by_rule[name] = list(owners)


def rules_of_options(options: Iterable[str]) -> dict[str, list[Pattern]]:
    """The rules of options `CONTROLLER=PATTERN[,PATTERN]`; raises `InputError` F1010 for any other text.

    >>> rules_of_options(["robot=r_*,free"])
    {'robot': [Pattern(text='r_*', span=None), Pattern(text='free', span=None)]}
    """
    rules: dict[str, list[Pattern]] = {}
    for option in options:
        controller, equals, patterns = option.partition("=")
        found = [Pattern(pattern.strip()) for pattern in patterns.split(",")]
        if not controller or not equals or not all(pattern.text for pattern in found):
            message = f"'{option}' is no rule of ownership"
            raise InputError([Diagnostic("F1010", message, "write CONTROLLER='PATTERN', such as robot='r_*,free'")])
        rules.setdefault(controller, []).extend(found)
    return rules


def read_rules(path: str | Path) -> dict[str, list[Pattern]]:
    """The rules of a file. Raises `InputError` as for a net file, F1010 for what is no rule."""
    source = read_source(path, SIZE_BYTES_MAX)
    tree = parse_tree(source, "file of rules", f"a controller: {_HINT}")
    problems: list[Diagnostic] = []
    rules: dict[str, list[Pattern]] = {}
    if not isinstance(tree, Mapping) or not tree.entries:
        message = "a file of rules is a mapping of controllers to patterns"
        raise InputError([Diagnostic("F1010", message, _HINT, span=node_span(source, tree))])
    for controller, (key, said) in tree.entries.items():
        several: Sequence[Node] = said.items if isinstance(said, List) else (said,)
        patterns = [one for one in several if isinstance(one, Scalar) and one.text and isinstance(data(one), str)]
        if patterns and len(patterns) == len(several):
            rules[controller] = [Pattern(one.text, node_span(source, one)) for one in patterns]
        else:
            message = f"'{controller}' is given no pattern"
            problems.append(Diagnostic("F1010", message, _HINT, (controller,), node_span(source, key)))
    if problems:
        raise InputError(problems)
    return rules
