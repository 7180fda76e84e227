"""Timeouts that a promise keeps from firing: where a transition of several controllers reads what the timeout changes.

While a controller has promised its part of a coordinated transition, what that part reads stays as it is (O1). A part
that *takes* the token of a timed place wants the completion 1 and the timeout wants it 0, so these never meet. One that
only reads does: while a decision is open, and for as long as the coordinator or the link is dead, the timeout cannot
take the token that the part wants there, nor put one on the fault place that the part wants empty, and a timer that the
part wants 0 is not set. Where the fault place stops a machine, the stop comes late. That is no mistake of the split,
and what is proved holds; whoever draws the line between controllers has to know of it.

Cost: linear in the arcs and gates of the coordinated transitions.
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, Severity
from firable.nets.net import Transition


def blocked_timeouts(decomposition: Decomposition) -> Iterator[Diagnostic]:
    """Warnings of coordinated transitions that only read what a timeout changes (F4015), in the order of the table."""
    net = decomposition.net
    taken, put, timed = dict[str, Transition](), dict[str, Transition](), dict[str, Transition]()
    for p, t in net.fault_transitions.items():
        place, timeout = net.places[p], net.transitions[t]
        taken[place.name] = timed[place.cleared[-1]] = timeout
        put |= dict.fromkeys(timeout.outputs, timeout)
    for row in decomposition.coordinated if taken else ():
        transition = net.transition(row.name)
        for kind, changed, read in (
            ("if", taken, transition.permissive),
            ("unless", put, transition.inhibitive),
            ("unless", timed, tuple(gate.signal for gate in transition.external if not gate.wanted)),
        ):
            for name in read:
                if name in changed:
                    yield _blocked(transition, changed[name], f"{kind}: {name}")


def _blocked(transition: Transition, timeout: Transition, gate: str) -> Diagnostic:
    return Diagnostic(
        "F4015",
        f"'{timeout.name}' waits as long as '{transition.name}' is promised, which reads what it changes ({gate})",
        "read a place that no timeout moves, or leave a stop that must come in time to the machine's own controller",
        ("transitions", transition.name),
        severity=Severity.WARNING,
    )
