"""The obligations that compare facts: O2, O3, ownership, commands.

A fact is a sentence without quotes. What the decomposition states is given, and the claim is that exactly what the net
demands is stated; docs/bundle.md lists the sentences.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Final

from firable.decompose.verification.formulas import Formula
from firable.decompose.verification.recut import is_late
from firable.nets.net import Net, Transition

if TYPE_CHECKING:
    from firable.decompose.verification.restating import Restated, Stated


def agreeing(
    of: Restated, name: str, sentence: str, central: Iterable[str], made: Iterable[str], subjects: Iterable[str] = ()
) -> Stated:
    """The obligation that the facts made are those of the net."""
    demanded, counted = dict.fromkeys(central), Counter(made)
    stated = [*counted, *(f"twice: {fact}" for fact, n in counted.items() if n > 1)]
    every = dict.fromkeys((*demanded, *stated))
    made = set(stated)
    claim = of.of.all_of(of.of.literal(fact, fact in demanded) for fact in every)
    return of.claim(name, sentence, claim, subjects, [of.of.literal(fact, fact in made) for fact in every])


def reading(of: Restated) -> Iterator[Stated]:
    """O3."""
    for t in of.net.transitions:
        central = [f"{of.cut.owner[name]} {words}" for name, words in _touched(t)]
        central += [f"{owner} takes part" for owner in dict.fromkeys(of.cut.owner[name] for name, _ in _touched(t))]
        made = []
        for controller, part in of.keys(t):
            made.append(f"{controller} takes part")
            made += [f"{controller} {words}" for _, words in _touched(of.subnet[controller].transition(part))]
        sentence = f"what '{t.name}' takes, fills and reads, its owner's part takes, fills and reads, and no other"
        yield agreeing(of, f"o3.{t.name}", sentence, central, made, [t.name])


def _touched(t: Transition) -> Iterator[tuple[str, str]]:
    """What a transition touches, with the words that follow the controller at which it does."""
    yield from ((place, f"takes {place}") for place in t.inputs)
    yield from ((place, f"fills {place}") for place in t.outputs)
    yield from ((place, f"wants {place}") for place in t.permissive)
    yield from ((place, f"wants not {place}") for place in t.inhibitive)
    for gate in t.external:
        yield gate.signal, f"waits until {gate.signal} is {1 if gate.wanted else 0}"


def deciding(of: Restated) -> Iterator[Stated]:
    """O2: of each global transition, then of each place for which transitions compete."""
    for t in of.net.transitions:
        if of.cut.is_global(t.name):
            row = of.of.variable(f"{t.name} has a row")
            given = row if t.name in of.listed else of.of.negation(row)
            sentence = f"'{t.name}', in which several controllers take part, is decided by the coordinator"
            yield of.claim(f"o2.{t.name}", sentence, row, [t.name], [given])
    groups: dict[str, list[str]] = {}
    central = {group.name: group.controller is None for group in of.decomposition.groups}
    for group in of.decomposition.groups:
        for name in {*group.sequence, *group.rest}:
            groups.setdefault(name, []).append(group.name)
    for place in of.net.places:
        competing = [of.cut.sharing[key] for key in (("from", place.name), ("to", place.name)) if key in of.cut.sharing]
        late = [
            t for t in of.net.transitions if place.within and place.name in t.inputs and is_late(of.net, t, place.name)
        ]
        if competing or late:
            yield _one_decider(of, place.name, competing, groups, central, late)


def _one_decider(
    of: Restated,
    place: str,
    competing: list[list[str]],
    groups_of: Mapping[str, list[str]],
    central: Mapping[str, bool],
    late: list[Transition],
) -> Stated:
    members = list(dict.fromkeys(name for names in competing for name in names))
    groups = list(dict.fromkeys(group for name in members for group in groups_of.get(name, ())))

    def row(name: str) -> Formula:
        return of.of.variable(f"{name} has a row")

    def decides(group: str, name: str) -> Formula:
        return of.of.variable(f"{group} decides {name}")

    given = [of.of.literal(f"{name} has a row", name in of.listed) for name in members]
    given += [of.of.literal(f"{g} decides {name}", g in groups_of.get(name, ())) for name in members for g in groups]
    given += [of.of.literal(f"{g} is central", central[g]) for g in groups]
    claims = []
    for names in competing:
        first = names[0]
        claims += [of.of.any_of(decides(g, first) for g in groups), of.at_most_one(decides(g, first) for g in groups)]
        for g in groups:
            agrees = of.of.equal(of.of.variable(f"{g} is central"), row(first))
            claims.append(of.of.any_of([of.of.negation(decides(g, first)), agrees]))
        for i in range(1, len(names)):
            claims.append(of.of.equal(row(names[i - 1]), row(names[i])))
            claims += [of.of.equal(decides(g, names[i - 1]), decides(g, names[i])) for g in groups]
    sentence = f"the transitions that compete for '{place}' have one decider, the coordinator if one has a row"
    for fault in late:
        for t in of.net.transitions:
            if t is not fault and place in t.inputs:
                claims.append(of.of.negation(of.of.all_of([of.open(fault), of.open(t)])))
        sentence += f", and none of them is open beside '{fault.name}'"
    return of.claim(f"o2.{place}", sentence, of.of.all_of(claims), [place, *members], given)


def ownership(of: Restated) -> Iterator[Stated]:
    """Who owns what."""
    central = [_controller(c.name, c.coordinator) for c in of.net.controllers]
    central += [f"{c.name} has one subnet, without arbiters" for c in of.net.controllers]
    central += [f"{owner} owns {name}" for name, owner in of.cut.owner.items()]
    made = [_controller(c.name, c.coordinator) for subnet in of.decomposition.subnets for c in subnet.controllers]
    for subnet in of.decomposition.subnets:
        made.append(f"{subnet.name} has one subnet, without arbiters")
        owned = (*(place.name for place in subnet.places), *(signal.name for signal in subnet.signals))
        made += [f"{subnet.name} owns {name}" for name in owned]
    sentence = "each place and signal is owned once, in the subnet of its owner, and nothing else is in a subnet"
    yield agreeing(of, "ownership", sentence, central, made)


def _controller(name: str, coordinator: bool) -> str:
    return f"controller {json.dumps([name, coordinator])}"


def commands(of: Restated) -> Iterator[Stated]:
    """What is sent on which place, and which signal ends it."""
    sentence = "the subnets send the same commands on the same places, and wait for the same signals"
    made = [fact for subnet in of.decomposition.subnets for fact in _commands(subnet)]
    yield agreeing(of, "commands", sentence, _commands(of.net), made)


def _commands(net: Net) -> Iterator[str]:
    for p in net.places:
        if p.command is not None:
            words = [p.command.machine, p.command.command, *([key, value] for key, value in p.command.parameters)]
            yield f"{p.name} sends {json.dumps(words)}"
        if p.completion is not None:
            yield f"{p.name} waits until {p.completion}"
        if p.within is not None:
            yield f"{p.name} waits {p.within.milliseconds} ms, which {p.within.timer} tells"
    for signal in net.signals:
        yield f"{signal.name} is a {signal.kind.value}"


FAMILIES: Final[Mapping[str, Callable[[Restated], Iterator[Stated]]]] = {
    "o2": deciding,
    "o3": reading,
    "ownership": ownership,
    "commands": commands,
}
"""The families of facts."""
