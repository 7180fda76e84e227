"""Every single change of what a bundle holds, sealed anew: the hashes of each mutant are right, its content is not.

A mutant is a name and what makes it, so that enumerating them costs nothing. One that is not even a net, or no bundle,
is refused by reading, and counts as made.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from firable.nets.bundle import Bundle
from firable.nets.decomposition import ArbitrationGroup, Coordinated, Part
from firable.nets.net import ArbitrationRule, Command, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.nets.verdict import Cost, Status, Verdict, Weight, Witness

Mutant = tuple[str, Callable[[], Bundle]]
Item = TypeVar("Item")


def net_mutants(net: Net) -> Iterator[tuple[str, Callable[[], Net]]]:
    """Every single change of a net: of each transition, place, signal, controller, arbiter, and of the order."""
    for kind in ("places", "transitions", "signals", "controllers", "arbiters", "properties"):
        items = getattr(net, kind)
        for i, item in enumerate(items):
            for how, changed in _listed(items, i, _changes(net, item)):
                yield f"{kind} {getattr(item, 'name', i)}: {how}", _with(net, kind, changed)
    yield "another name", _with(net, "name", f"{net.name}x")
    owner = net.places[0].owner if net.places else net.controllers[0].name  # a coordinator may own nothing
    extra = Transition("extra", (net.places[0].name,) if net.places else ())
    yield "another transition", _with(net, "transitions", (*net.transitions, extra))
    yield "another place", _with(net, "places", (*net.places, Place(f"{owner}.extra", owner)))
    yield "another signal", _with(net, "signals", (*net.signals, Signal(f"{owner}.sextra", owner)))


def _with(net: Net, kind: str, value: object) -> Callable[[], Net]:
    changes: dict[str, Any] = {kind: value}
    return lambda: replace(net, **changes)


def _listed(
    items: Sequence[Item], i: int, changed: Iterable[tuple[str, Item]]
) -> Iterator[tuple[str, tuple[Item, ...]]]:
    before, after = tuple(items[:i]), tuple(items[i + 1 :])
    yield "deleted", (*before, *after)
    yield "doubled", (*before, items[i], items[i], *after)
    if after:
        yield "moved", (*before, after[0], items[i], *after[1:])
    yield from ((how, (*before, one, *after)) for how, one in changed)


def _changes(net: Net, item: Any) -> Iterator[tuple[str, Any]]:
    match item:
        case Transition():
            yield from _transition_changes(net, item)
        case Place():
            yield from _place_changes(net, item)
        case Signal():
            other = SignalKind.COMPLETION if item.kind is SignalKind.SENSOR else SignalKind.SENSOR
            yield "other kind", replace(item, kind=other)
            yield from (("other owner", replace(item, owner=c.name)) for c in net.controllers if c.name != item.owner)
            yield "no owner", replace(item, owner=None)
        case _:
            if hasattr(item, "coordinator"):
                yield "coordinator", replace(item, coordinator=not item.coordinator)
                yield "words", replace(item, description=f"{item.description}.")
                others = [c.name for c in net.controllers if c.name != item.name]
                yield from ((f"under {c}", replace(item, under=c)) for c in (None, *others) if c != item.under)
            if hasattr(item, "among"):
                yield "order", replace(item, among=item.among[::-1])
                yield "fewer", replace(item, among=item.among[1:])
                yield from (("rule", replace(item, by=by)) for by in ArbitrationRule if by is not item.by)
            yield "renamed", replace(item, name=f"{item.name}x")


def _transition_changes(net: Net, t: Transition) -> Iterator[tuple[str, Transition]]:
    for kind in ("inputs", "outputs", "permissive", "inhibitive"):
        there: tuple[str, ...] = getattr(t, kind)
        for place in net.places:
            now = tuple(p for p in there if p != place.name) if place.name in there else (*there, place.name)
            changes: dict[str, Any] = {kind: now}
            yield f"{kind} with or without {place.name}", replace(t, **changes)
        for i in range(len(there) - 1):
            changes = {kind: (*there[:i], there[i + 1], there[i], *there[i + 2 :])}
            yield f"{kind} in another order", replace(t, **changes)
        for i, place_there in enumerate(there):
            for place in net.places:
                if place.name not in there:
                    changes = {kind: (*there[:i], place.name, *there[i + 1 :])}
                    yield f"{kind} from {place_there} to {place.name}", replace(t, **changes)
    for signal in net.signals:
        for wanted in (True, False):
            gate = ExternalGate(signal.name, wanted)
            gates = tuple(g for g in t.external if g != gate) if gate in t.external else (*t.external, gate)
            yield f"gate {signal.name} {wanted}", replace(t, external=gates)
    for i, gate in enumerate(t.external):
        flipped = (*t.external[:i], replace(gate, wanted=not gate.wanted), *t.external[i + 1 :])
        yield f"gate {gate.signal} flipped", replace(t, external=flipped)
    yield "number", replace(t, number=77 if t.number is None else None)
    yield "words", replace(t, description=f"{t.description}.")
    yield "renamed", replace(t, name=f"{t.name}x")


def _place_changes(net: Net, p: Place) -> Iterator[tuple[str, Place]]:
    yield "token", replace(p, marked=not p.marked)
    yield from (("other owner", replace(p, owner=c.name)) for c in net.controllers if c.name != p.owner)
    yield "no owner", replace(p, owner=None)
    yield "words", replace(p, description=f"{p.description}.")
    yield "renamed", replace(p, name=f"{p.name}x")
    if p.command is None:
        yield "a command", replace(p, command=Command("M", "GO"))
    else:
        yield "no command", replace(p, command=None, completion=None)
        yield "machine", replace(p, command=replace(p.command, machine="M"))
        yield "command", replace(p, command=replace(p.command, command=f"{p.command.command}x"))
        yield "parameters", replace(p, command=replace(p.command, parameters=(*p.command.parameters, ("n", "1"))))
    yield from (
        ("completion", replace(p, completion=signal.name)) for signal in net.signals if signal.name != p.completion
    )
    if p.completion is not None:
        yield "no completion", replace(p, completion=None)


def decomposition_mutants(bundle: Bundle) -> Iterator[Mutant]:
    """Every single change of the net, of a subnet, of a row of the table, of a group."""
    whole = bundle.decomposition

    def made(**changes: Any) -> Callable[[], Bundle]:
        return lambda: replace(bundle, decomposition=replace(whole, **{k: make() for k, make in changes.items()}))

    for how, make in net_mutants(bundle.net):
        yield f"net: {how}", made(net=make)
    for i, subnet in enumerate(whole.subnets):
        for how, make in net_mutants(subnet):

            def subnets(i: int = i, make: Callable[[], Net] = make) -> tuple[Net, ...]:
                return (*whole.subnets[:i], make(), *whole.subnets[i + 1 :])

            yield f"subnet {subnet.name}: {how}", made(subnets=subnets)
    for i, row in enumerate(whole.coordinated):
        for how, rows in _listed(whole.coordinated, i, _row_changes(row, whole.coordinated)):
            yield f"row {row.name}: {how}", made(coordinated=lambda rows=rows: rows)
    for i, group in enumerate(whole.groups):
        for how, groups in _listed(whole.groups, i, _group_changes(group, bundle)):
            yield f"group {group.name}: {how}", made(groups=lambda groups=groups: groups)


def _row_changes(row: Coordinated, rows: Sequence[Coordinated]) -> Iterator[tuple[str, Coordinated]]:
    yield "renamed", replace(row, name=f"{row.name}x")
    yield "number", replace(row, number=None if row.number is not None else 77)
    yield "number", replace(row, number=99)
    yield "layer", replace(row, at="nobody" if row.at is None else None)
    layers = {other.at for other in rows} - {row.at, None}
    yield from ((f"layer {at}", replace(row, at=at)) for at in sorted(map(str, layers)))
    yield "words", replace(row, description=f"{row.description}.")
    others = [part for other in rows for part in other.parts if part not in row.parts]
    for i, part in enumerate(row.parts):
        elsewhere = [*others, Part(f"{part.controller}x", part.name), Part(part.controller, f"{part.name}x")]
        for how, parts in _listed(row.parts, i, [(f"part {p.controller}.{p.name}", p) for p in elsewhere]):
            yield f"{part.name}: {how}", replace(row, parts=parts)


def _group_changes(group: ArbitrationGroup, bundle: Bundle) -> Iterator[tuple[str, ArbitrationGroup]]:
    yield "renamed", replace(group, name=f"{group.name}x")
    yield "layer", replace(group, at="nobody" if group.at is None else None)
    yield from ((f"layer {c.name}", replace(group, at=c.name)) for c in bundle.net.controllers if c.name != group.at)
    yield from (("rule", replace(group, by=by)) for by in ArbitrationRule if by is not group.by)
    deciders = [None, *(c.name for c in bundle.net.controllers), "nobody"]
    yield from ((f"decided by {c}", replace(group, controller=c)) for c in deciders if c != group.controller)
    for kind in ("sequence", "rest"):
        there: tuple[str, ...] = getattr(group, kind)
        for i, name in enumerate(there):
            others = [t.name for t in bundle.net.transitions if t.name != name]
            for how, now in _listed(there, i, [(f"to {other}", other) for other in others]):
                changes: dict[str, Any] = {kind: now}
                yield f"{kind} {name} {how}", replace(group, **changes)
    if group.sequence:
        yield "all last", replace(group, sequence=(), rest=(*group.sequence, *group.rest))
    if group.rest:
        yield "all in turn", replace(group, sequence=(*group.sequence, *group.rest), rest=())


def verdict_mutants(bundle: Bundle) -> Iterator[Mutant]:
    """Every verdict deleted, doubled, and with another value in each field that is shown."""

    def made(verdicts: tuple[Verdict, ...]) -> Callable[[], Bundle]:
        return lambda: replace(bundle, verdicts=verdicts)

    for i, verdict in enumerate(bundle.verdicts):
        for how, verdicts in _listed(bundle.verdicts, i, _verdict_changes(bundle, verdict)):
            if how != "moved":
                yield f"verdict {verdict.name}: {how}", made(verdicts)
    yield "another verdict", made((*bundle.verdicts, Verdict("safe", Status.PROVED, "all is well", "by hand")))


def _verdict_changes(bundle: Bundle, verdict: Verdict) -> Iterator[tuple[str, Verdict]]:
    yield from ((f"{s}", replace(verdict, status=s)) for s in Status if s is not verdict.status)
    yield "renamed", replace(verdict, name=f"{verdict.name}x")
    yield "statement", replace(verdict, statement=f"{verdict.statement} now")
    yield "discipline", replace(verdict, discipline="step" if verdict.discipline else "interleaving")
    yield from ((f"{w}", replace(verdict, weight=w)) for w in Weight if w is not verdict.weight)
    yield "no evidence", replace(verdict, evidence=() if verdict.evidence else ("eq7.smt2",))
    other = next(file for file in bundle.evidence if verdict.evidence != (file,))
    yield f"evidence {other}", replace(verdict, evidence=(other,))
    if verdict.evidence:
        yield "evidence twice", replace(verdict, evidence=verdict.evidence * 2)
    for field, value in (("method", "by hand"), ("hint", "none"), ("bound", "none"), ("code", "F4002")):
        changes: dict[str, Any] = {field: value}
        yield field, replace(verdict, **changes)
    yield "subjects", replace(verdict, subjects=(*verdict.subjects, "x"))
    yield "cost", replace(verdict, cost=Cost(1, 1))
    yield "witness", replace(verdict, witness=Witness(note="seen"))


def evidence_mutants(bundle: Bundle) -> Iterator[Mutant]:
    """Every file of evidence removed, emptied, exchanged for another one, with a line deleted, doubled or moved."""

    def made(name: str, text: str | None) -> Callable[[], Bundle]:
        rest = {file: words for file, words in bundle.evidence.items() if file != name}
        return lambda: replace(bundle, evidence=rest if text is None else {**rest, name: text})

    for name in bundle.evidence:
        yield f"{name} removed", made(name, None)
        yield f"{name} empty", made(name, "")
        for other, words in bundle.evidence.items():
            if other != name:
                yield f"{name} is {other}", made(name, words)
    yield "another file", made("other.smt2", "(set-logic QF_UF)\n")
    yield "another document", made("other.evidence.json", bundle.evidence.get("check.evidence.json", "{}"))


def line_mutants(text: str) -> Iterator[tuple[str, str]]:
    """A text with each line deleted, doubled, or exchanged with the next one."""
    lines = text.splitlines(keepends=True)
    for i, line in enumerate(lines):
        if not line.strip():
            continue  # an empty line says nothing
        yield f"line {i} deleted", "".join((*lines[:i], *lines[i + 1 :]))
        yield f"line {i} doubled", "".join((*lines[:i], line, *lines[i:]))
        if i + 1 < len(lines) and lines[i + 1].strip():
            yield f"line {i} moved", "".join((*lines[:i], lines[i + 1], line, *lines[i + 2 :]))
