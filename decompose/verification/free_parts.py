"""Parts that are free of promise, judged anew: what the theorem assumes of each, from the central net alone.

Two things are asked. By the arcs: at the controller of the part nobody else takes what it takes or reads that full, nor
fills what it fills or reads that empty; who reads a signal that it clears needs a place full that it fills; nobody who
is kept from closing a gate of it is so by a signal alone; and of signals it reads completions of its own input places,
at 1. Of the markings: that its vote is persistent must be shown, by an obligation (`restating_votes`) or by a document,
and not only be claimed. What is said of the protocol of this very net (`explored`) rests on both.
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.votes import PREFIX
from firable.nets.net import Net, SignalKind, Transition


def check_free_parts(examination: Examination, cut: Cut) -> None:
    """Refuse a bundle that says of a part that it is free of promise and does not show it; verdicts are judged before.

    All are that may be: the table is one, as everything else in a bundle is.

    Raises `NotShownError`. Takes time linear in the arcs of the controllers' transitions, for each of their parts.
    """
    free = examination.bundle.decomposition.free
    every = [(row.name, part.controller) for row in cut.coordinated for part in row.parts]
    if list(free) != [pair for pair in every if pair in set(free)]:
        raise NotShownError("the parts that are free of promise are not parts of the table, in its order", "table")
    subnets = {subnet.name: subnet for subnet in cut.subnets}
    for transition, controller in every:
        name = next(part.name for part in cut.parts[transition] if part.controller == controller)
        subnet = subnets[controller]
        against = next(_against(subnet, next(t for t in subnet.transitions if t.name == name)), "")
        judged = examination.checked.get(f"{PREFIX}{name}")
        persistent = judged is not None and judged.verdict.holds and judged.shown
        if (transition, controller) not in free:
            if persistent and not against:
                raise NotShownError(f"'{name}' is free of promise, and the table does not say so", "table", transition)
        elif against:
            raise NotShownError(f"'{name}' is not free of promise: {against}", "table", transition)
        elif not persistent:
            message = f"'{name}' is not free of promise: it is not shown that its vote is persistent"
            raise NotShownError(message, "verdicts", f"{PREFIX}{name}")


def _against(subnet: Net, part: Transition) -> Iterator[str]:
    """What keeps a part from being free, by the arcs of its subnet."""
    places = {place.name: place for place in subnet.places}
    taken, filled = set(part.inputs), set(part.outputs)
    cleared = {signal for name in filled for signal in places[name].cleared}
    awaited = {gate.signal for gate in part.external if gate.wanted}
    for other in subnet.transitions:
        if other is part:
            continue
        needs_full = {*other.inputs, *other.permissive}
        for at in sorted(taken & needs_full):
            yield f"'{other.name}' needs '{at}' full, too"
        for at in sorted(filled & {*other.outputs, *other.inhibitive}):
            yield f"'{other.name}' needs '{at}' empty, too"
        for gate in other.external:
            if gate.signal in cleared and not filled & needs_full:
                yield f"'{other.name}' reads '{gate.signal}', which it clears"
            if gate.signal in awaited and not gate.wanted:
                for at in sorted({*part.permissive} & {*other.inputs} | {*part.inhibitive} & {*other.outputs}):
                    yield f"'{gate.signal}' alone keeps '{other.name}' from closing its gate '{at}'"
    for gate in part.external:
        commanded = [name for name, place in places.items() if gate.signal in place.cleared]
        of_its_own = commanded and set(commanded) <= taken
        kind = next(signal.kind for signal in subnet.signals if signal.name == gate.signal)
        if not gate.wanted or not of_its_own or kind is not SignalKind.COMPLETION:
            yield f"it reads '{gate.signal}', which may fall by itself"
