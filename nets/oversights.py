"""What a net may say and hardly means: no mistake of the file, and nothing that a verdict tells.

A place that is empty at the start and that no transition fills stays empty. A transition that takes a token from it, or
reads it by `if`, is dead, which `quasi-live` tells; of one that reads it by `unless` nothing is told: an interlock that
never locks. A place without any arc is the same mistake.

A command without completion is done when it is sent. Where a transition that waits for nothing else then sends the
machine another command, the machine is given two at once. Analysis knows no times and finds nothing wrong with that;
`check --machines` does, as `loop.busy-machines`, where there is a plant file.

Only the shapes that can hardly be meant are told: a transition that waits for anything besides may be right.
Cost: linear in the arcs and gates of the net.
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.nets.diagnostics import Diagnostic, Severity
from firable.nets.loading import Loaded
from firable.nets.net import Net


def oversights(net: Net) -> Iterator[Diagnostic]:
    """Warnings of places that nothing fills (F2031) and of commands that the next one overtakes (F2032).

    >>> from firable.nets.catalogue import catalogue_net
    >>> list(oversights(catalogue_net("one_robot")))
    []
    """
    read = {name for transition in net.transitions for name in transition.permissive}
    for p, place in enumerate(net.places):
        if not (place.marked or net.producers[p] or net.consumers[p] or place.name in read):
            message = f"'{place.name}' is empty at the start, and no transition brings a token to it"
            hint = "add the arc that is missing (`to`), or delete the place: a gate `unless` of it never closes"
            yield _warning("F2031", message, hint, place.name)
        if place.command is None:
            continue
        for t in net.consumers[p]:  # which wait for the completion of the command, where there is one
            transition = net.transitions[t]
            gates = (*transition.permissive, *transition.inhibitive, *transition.external)
            if gates or transition.inputs != (place.name,):
                continue
            for after in (net.place(name) for name in transition.outputs):
                if after.command is not None and after.command.machine == place.command.machine:
                    message = (
                        f"'{place.name}' sends '{place.command}' and waits for nothing: '{transition.name}' may send "
                        f"'{after.command}' at once"
                    )
                    hint = "add `until`, the signal that completes the command, or a gate to the transition"
                    yield _warning("F2032", message, hint, place.name)


def overseen(loaded: Loaded) -> tuple[Diagnostic, ...]:
    """The warnings of a net that was read from a net file, with their lines; other tools have other habits."""
    return () if loaded.positions is None else loaded.placed(oversights(loaded.net))


def _warning(code: str, message: str, hint: str, place: str) -> Diagnostic:
    return Diagnostic(code, message, hint, ("places", place), severity=Severity.WARNING)
