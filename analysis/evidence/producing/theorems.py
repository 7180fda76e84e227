"""The theorem on a class of nets that is about a net, with what of its premises cannot be read off the arcs."""

from __future__ import annotations

from collections.abc import Callable

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import NeverCertificate, Theorem, TheoremName
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.structure.commoner import commoner
from firable.analysis.structure.net_class import asymmetric_choice, extended_free_choice
from firable.analysis.structure.ordinary import ordinary
from firable.nets.net import Net


def theorem_on(net: Net, exclude_contact: Callable[[], NeverCertificate | None], deadline: Deadline) -> Theorem:
    """The theorem, under interleaving; raises `LackingError` where none applies, or its premises are not known.

    `exclude_contact` is asked only of a net that one may be about.
    """
    of = ordinary(net)
    if any(t.inhibitive for t in net.transitions) or len(of.transitions) < len(net.transitions) or not net.transitions:
        raise LackingError("no theorem on a class of nets applies")
    joined = [p for p in range(of.n_places) if of.consumers[p] or of.producers[p]]
    marked_graph = all(len(of.consumers[p]) == 1 == len(of.producers[p]) for p in joined)
    free = extended_free_choice(of.inputs, of.consumers)
    if not marked_graph and not free and not asymmetric_choice(of.inputs, of.consumers):
        raise LackingError("no theorem on a class of nets applies")
    contact_excluded = exclude_contact()
    if contact_excluded is None:
        raise LackingError("the net was not proved contact-free")
    if marked_graph:
        return Theorem(TheoremName.MARKED_GRAPH, contact_excluded)
    found = commoner(of, deadline=deadline)
    if not found.holds:
        raise LackingError("it was not found that every siphon contains a marked trap")
    names = tuple(tuple(net.places[p].name for p in trap) for trap in found.traps)
    return Theorem(TheoremName.FREE_CHOICE if free else TheoremName.ASYMMETRIC_CHOICE, contact_excluded, names)
