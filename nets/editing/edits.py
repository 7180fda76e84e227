"""What can be edited in a net file from outside it: each edit a function from a text to the text with it.

The names are the full ones of the net (`robot.free`); where they stand in the file, and in which of its forms, is found
from them. An edit changes what the name stands for and nothing else: a place that is deleted goes from the arcs of all
transitions as well, and a property that speaks of it stays, so that the reader says where something is still to do.

Moving a place to another controller changes what is named after its controller: the place, its completion, and
what its time limit gives. A completion that another place of the old controller waits for too stays there under its
name, for there it is still declared. What fills the role of a task by a short name is written in full. A place that a
time limit leads to stays where the limit is: what the limit would lead to then is another place.

Rejected: a `Net` that is edited and printed. The file would be another one, without its comments and in another order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from firable.nets.changes import Arbitration, CapacityPlace, Change, Gate
from firable.nets.diagnostics import Diagnostic, InputError, did_you_mean
from firable.nets.editing.yaml_text import SCOPE_KEYS, Path, Value, YamlText
from firable.nets.net import Arbiter
from firable.nets.occurrences import Kind, Names, Occurrence
from firable.nets.source import Source
from firable.nets.time_limits import fault_place_name, fault_transition_name, timer_name

PARTS: Final = ("from", "to", "if", "unless")
"""The lists of a transition: arcs in and out, permissive and inhibitive gates."""

_TRANSITION_KEYS: Final = ("number", "description", *PARTS)
_PLACE_KEYS: Final = ("send", "until", "within", "task", "opens")


def add_controller(source: Source, name: str) -> Source:
    """One more controller, which owns nothing yet."""
    return YamlText(source).with_entry(("controllers",), _named(name), None).source


def add_place(source: Source, name: str, owner: str | None = None) -> Source:
    """One more place, of a controller or of nobody; it holds no token at first."""
    return YamlText(source).with_entry((*_scope(source, owner), "places"), _named(name), None).source


def add_sensor(source: Source, name: str, owner: str | None = None) -> Source:
    """One more sensor, for external gates."""
    scope = _scope(source, owner)
    return YamlText(source).with_item(scope, "inputs", _named(name), _before("inputs", SCOPE_KEYS)).source


def add_transition(source: Source, name: str) -> Source:
    """One more transition, without arcs."""
    return YamlText(source).with_entry(("transitions",), _named(name), {}).source


def add_arbiter(source: Source, arbiter: Arbiter) -> Source:
    """One more arbiter."""
    body: Value = {"among": list(arbiter.among), "by": str(arbiter.by)}
    return YamlText(source).with_entry(("arbiters",), _named(arbiter.name), body).source


def connect(source: Source, transition: str, part: str, name: str) -> Source:
    """One more arc or gate: `from` and `to` name a place, `if` and `unless` a place or a signal."""
    path = _of_transition(source, transition)
    return YamlText(source).with_item(path, _part(part), name, _before(part, _TRANSITION_KEYS)).source


def disconnect(source: Source, transition: str, part: str, name: str) -> Source:
    """One arc or gate less; raises `InputError` F1020 for a gate that no list of the transition names."""
    text, path = YamlText(source), _of_transition(source, transition)
    if name not in names_in(text.at((*path, _part(part)))):
        hint = "what `until` of a place names is a gate of all that take its token: edit `until` there"
        raise _stands_nowhere(f"`{part}: {name}` of '{transition}'", hint)
    return text.without_item(path, part, name).source


def mark(source: Source, place: str, *, marked: bool) -> Source:
    """A token on a place at first, or none."""
    scope, local = _declared(source, place, "places")
    text = YamlText(source)
    if (local in names_in(text.at((*scope, "start")))) == marked:
        return source
    if marked:
        return text.with_item(scope, "start", local, _before("start", SCOPE_KEYS)).source
    return text.without_item(scope, "start", local).source


def describe(source: Source, kind: Kind, name: str, words: str) -> Source:
    """Another description, or none where `words` is empty."""
    match kind:
        case Kind.PLACE:
            scope, local = _declared(source, name, "places")
            path: Path = (*scope, "places", local)
            after: tuple[str, ...] = _PLACE_KEYS
        case Kind.TRANSITION:
            path, after = _of_transition(source, name), ("number",)
        case Kind.CONTROLLER:
            path, after = _scope(source, name), ("coordinator", "under")
        case _:
            raise _stands_nowhere(
                f"a description of the {kind.value} '{name}'", "only the net file's own keys are text"
            )
    text = YamlText(source)
    if text.at((*path, "description")) is None:
        return source if not words else text.with_entry(path, "description", words, after).source
    if not words:
        return text.without_entry((*path, "description")).source
    return text.with_text((*path, "description"), words).source


def change(source: Source, changes: Iterable[Change]) -> Source:
    """With what cures a verdict: gates, capacity places and arbiters, as they are made to a net."""
    for one in changes:
        match one:
            case Gate(transition, place, permissive):
                source = connect(source, transition, "if" if permissive else "unless", place)
            case CapacityPlace():
                source = _with_capacity(source, one)
            case Arbitration(arbiter):
                source = add_arbiter(source, arbiter)
    return source


def rename(source: Source, kind: Kind, name: str, new: str) -> Source:
    """Another name, wherever the name stands in this file; raises `InputError` F2012 and F2001 as `Names.renamed`."""
    names = Names(source)
    return Source(source.file, names.renamed(_definition(names, kind, name), new))


def renames(source: Source, kind: Kind, name: str, new: str) -> Mapping[str, str]:
    """All full names that `rename` changes, with the new ones, for other files that speak of them."""
    names = Names(source)
    return names.renames(_definition(names, kind, name), new)


def own(source: Source, kind: Kind, name: str, owner: str | None) -> Source:
    """A place or a sensor given to another controller, or to nobody, with its new name wherever it stands."""
    if kind is Kind.SIGNAL:
        return _own_sensor(source, name, owner)
    scope, local = _declared(source, name, "places")
    to = _scope(source, owner)
    if scope == to:
        return source
    for of, fault in _limits(source, scope):
        if local in {of, fault}:
            raise _leads_there(of, fault, "both are of one controller: move both in the text of the file")
    renamed, names = _moved_names(YamlText(source), scope, local, owner), Names(source)
    places = {one.name for one in names.occurrences if one.kind is Kind.PLACE} | names.given.keys()
    if twice := sorted((places - renamed.keys()).intersection(renamed.values())):
        hint = "give one of them another name first; a time limit may give it"
        raise InputError([Diagnostic("F2001", f"there is a '{twice[0]}' already", hint)])
    source = Source(source.file, names.with_full_roles(name))
    text = YamlText(Source(source.file, Names(source).replaced(renamed)))
    marked = local in names_in(text.at((*scope, "start")))
    raw = text.raw((*scope, "places", local))
    if marked:
        text = text.without_item(scope, "start", local)
    text = text.with_entry((*to, "places"), local, raw).without_entry((*scope, "places", local))
    if marked:
        text = text.with_item(to, "start", local, _before("start", SCOPE_KEYS))
    names.demand_roles(text.source.text, renamed)
    return text.source


def owned(source: Source, kind: Kind, name: str, owner: str | None) -> Mapping[str, str]:
    """All full names that `own` changes, with the new ones, for other files that speak of them."""
    if kind is Kind.SIGNAL:
        return {name: _full(owner, name.rpartition(".")[2])}
    return _moved_names(YamlText(source), *_declared(source, name, "places"), owner)


def delete(source: Source, kind: Kind, name: str) -> Source:
    """Without a place, a sensor, a transition or a controller, and without the arcs and gates that lead to it."""
    match kind:
        case Kind.PLACE:
            scope, local = _declared(source, name, "places")
            for of, fault in _limits(source, scope):
                if local == fault:
                    raise _leads_there(of, fault, "declared or not: delete its `within` in the text of the file first")
            text = _cut_off(mark(source, name, marked=False), name)
            return text.without_entry((*scope, "places", local)).source
        case Kind.SIGNAL:
            scope, local = _declared(source, name, "inputs")
            return _cut_off(source, name).without_item(scope, "inputs", local).source
        case Kind.TRANSITION:
            text = YamlText(source)
            for arbiter in text.at(("arbiters",)) or {}:
                if name in names_in(text.at(("arbiters", arbiter, "among"))):
                    text = text.without_item(("arbiters", arbiter), "among", name)
            return text.without_entry(_of_transition(source, name)).source
        case Kind.CONTROLLER:
            return YamlText(source).without_entry(_scope(source, name)).source
    raise _stands_nowhere(f"the {kind.value} '{name}'", "delete it in the text of the file")


def _with_capacity(source: Source, one: CapacityPlace) -> Source:
    local = one.place.removeprefix(f"{one.owner}.")
    source = describe(add_place(source, local, one.owner), Kind.PLACE, one.place, one.description)
    source = mark(source, one.place, marked=True)
    for part, transitions in (("from", one.takers), ("to", one.givers)):
        for transition in transitions:
            source = connect(source, transition, part, one.place)
    return source


def _own_sensor(source: Source, name: str, owner: str | None) -> Source:
    scope, local = _declared(source, name, "inputs")
    to = _scope(source, owner)
    if scope == to:
        return source
    text = YamlText(source).without_item(scope, "inputs", local)
    text = text.with_item(to, "inputs", local, _before("inputs", SCOPE_KEYS))
    return Source(source.file, Names(text.source).replaced({name: _full(owner, local)}))


def _limits(source: Source, scope: Path) -> Iterator[tuple[str, str]]:
    """The places of a controller with a time limit that leads to a declared place, and that one."""
    places = YamlText(source).at((*scope, "places"))
    for name, body in places.items():
        if isinstance(body, dict) and (within := body.get("within")):
            fault = (within.get("to") if isinstance(within, dict) else None) or fault_place_name(name)
            if fault in places:
                yield name, fault


def _leads_there(name: str, fault: str, hint: str) -> InputError:
    return InputError([Diagnostic("F1020", f"the time limit of '{name}' leads to '{fault}'", hint)])


def _moved_names(text: YamlText, scope: Path, local: str, owner: str | None) -> Mapping[str, str]:
    """The full names that a place takes along to another controller, with the new ones."""
    old = scope[1] if scope else None
    places = text.at((*scope, "places"))
    body = places[local] or {}
    signals, own_places = [], [local]
    if (until := body.get("until")) and not any(
        one.get("until") == until for name, one in places.items() if one and name != local
    ):
        signals.append(until)
    renamed = {}
    if within := body.get("within"):
        limit = within if isinstance(within, dict) else {}
        signals.append(limit.get("timer") or timer_name(local))
        if (fault := limit.get("to") or fault_place_name(local)) not in places:
            own_places.append(fault)
        if "transition" not in limit:
            before, after = _full(old, local), _full(owner, local)
            renamed[fault_transition_name(before)] = fault_transition_name(after)
    return renamed | {_full(old, name): _full(owner, name) for name in (*own_places, *signals)}


def _cut_off(source: Source, name: str) -> YamlText:
    """Without the arcs and gates between transitions and a place or signal."""
    text = YamlText(source)
    for transition in text.at(("transitions",)) or {}:
        for part in PARTS:
            if name in names_in(text.at(("transitions", transition, part))):
                text = text.without_item(("transitions", transition), part, name)
    return text


def _scope(source: Source, owner: str | None) -> Path:
    """Where what belongs to a controller is declared; at the top where it belongs to nobody."""
    if owner is None:
        return ()
    known = YamlText(source).at(("controllers",)) or {}
    if owner not in known:
        hint = did_you_mean(owner, list(known)) + "declare it under `controllers`"
        raise InputError([Diagnostic("F2005", f"there is no controller '{owner}'", hint)])
    return ("controllers", owner)


def _declared(source: Source, name: str, table: str) -> tuple[Path, str]:
    """Where a place or a sensor is declared, and its name there."""
    owner, _, local = name.rpartition(".")
    scope = _scope(source, owner or None)
    found = YamlText(source).at((*scope, table))
    if local not in (found if isinstance(found, dict) else names_in(found)):
        hint = "what follows from `until` or `within` is edited at its place"
        raise _stands_nowhere(f"'{name}'", hint)
    return scope, local


def _definition(names: Names, kind: Kind, name: str) -> Occurrence:
    found = next((one for one in names.occurrences if one.defines and (one.kind, one.name) == (kind, name)), None)
    if found is None:
        raise _stands_nowhere(f"the name '{name}'", "it follows from a time limit: name it there, beside `within`")
    return found


def _of_transition(source: Source, name: str) -> Path:
    if not YamlText(source).has(("transitions", name)):
        raise _stands_nowhere(f"'{name}'", "a fault transition follows from the time limit of its place: see `within`")
    return ("transitions", name)


def _stands_nowhere(what: str, hint: str) -> InputError:
    return InputError([Diagnostic("F1020", f"{what} stands nowhere in the file by itself", hint)])


def _part(part: str) -> str:
    if part not in PARTS:
        raise _stands_nowhere(f"`{part}`", "a transition has `from`, `to`, `if` and `unless`")
    return part


def _named(name: str) -> str:
    if not name:
        raise InputError([Diagnostic("F2012", "a name is wanted", "use letters, digits, '_' and '-'")])
    return name


def _full(owner: str | None, local: str) -> str:
    return f"{owner}.{local}" if owner else local


def _before(key: str, keys: tuple[str, ...]) -> tuple[str, ...]:
    """The keys that one follows, by convention."""
    return keys[: keys.index(key)] or ("",)


def names_in(value: Any) -> list[str]:
    """The names of a list, or the one that stands in its place."""
    return value if isinstance(value, list) else [value] if isinstance(value, str) else []
