"""Liveness, deadlock and reversibility by the theorems on net classes, without exploring a marking.

The theorems are about the ordinary net under the extended one (`firable.analysis.structure.ordinary`): permissive
gates are its reads. They hold of the extended net where that behaves exactly so: no inhibitive gates, and contact-free
at every transition that can fire, which is proved here first, by invariants (`firable.analysis.structure.contact`). It
is then 1-safe, which several theorems need. External gates open for some valuation each time, and verdicts leave the
valuation free, so they change nothing under interleaving; under synchronous steps nothing is claimed. A transition that
contradicts itself never fires: what is said of deadlock, reversibility and home markings is that of the others; the net
is not live.

| class | theorem | source |
|---|---|---|
| any | a transition with an input or read that can never be marked is dead | a siphon that is empty stays so |
| state machines, at most one token each | everything | Murata 1989 |
| marked graph | live iff every circuit holds a token; then reversible | Commoner, Holt, Even, Pnueli 1971 |
| free choice | live iff every siphon contains a marked trap; if live: home markings, reversible iff all traps are marked | Desel and Esparza 1995 |
| asymmetric choice | live if every siphon contains a marked trap | Murata 1989, theorem 12 |
| any with a transition | free of deadlock if every siphon contains a marked trap | Commoner 1972 |

A marked graph is live and reversible by one argument: every place has one producer and one consumer, so firing each
transition once leads back to the same marking, and in a live one any counts of firings that a marking's sums allow can
be fired (Genrich and Lautenbach 1973): so also those that complete what was fired to a multiple of that.

Live means live at each transition, so a live net is free of deadlock and of dead transitions, and where no deadlock is
reachable no marking is doomed. What no theorem decides is absent from the answer. A violation found by a theorem has no
firing sequence; its hint names the siphon or trap that shows it.
"""  # noqa: E501 - a table's row is a line

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from firable.analysis.goal import Limits
from firable.analysis.question import Known, listed, no, yes
from firable.analysis.structure.commoner import Commoner, commoner
from firable.analysis.structure.contact import METHOD as ONE_TOKEN
from firable.analysis.structure.contact import contact_proof
from firable.analysis.structure.free_choice import empty_trap, live_and_safe
from firable.analysis.structure.net_class import asymmetric_choice, extended_free_choice
from firable.analysis.structure.ordinary import Ordinary, markable, ordinary
from firable.analysis.structure.state_machines import METHOD as STATE_MACHINES
from firable.analysis.structure.state_machines import decide_state_machines
from firable.nets.net import Net

MARKABLE = "places that no token can come to"
MARKED_GRAPH = "theorem on marked graphs (every circuit holds a token)"
FREE_CHOICE = "theorem of Commoner and Hack on free-choice nets"
HOME = "theorem on home markings of live and safe free-choice nets"
ASYMMETRIC_CHOICE = "theorem of Commoner on asymmetric-choice nets"
SIPHONS = "every siphon contains a marked trap (Commoner)"


def decide_by_class(net: Net, limits: Limits) -> Mapping[str, Known]:
    """The verdicts, by name, that theorems on the class of the net decide; interleaving, external gates free.

    Cost: linear in the net for state machines and marked graphs, that of the contact proof and of one question on
    siphons to z3 for the others.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = decide_by_class(catalogue_net("one_robot"), Limits())
    >>> {name: known.answer.holds for name, known in found.items()}
    {'contact-free': True, 'live': True, 'quasi-live': True, 'deadlock-free': True, 'doomed-markings': True}
    """
    of = ordinary(net)
    found = _dead(net, of)
    if of.transitions:
        by_graph = decide_state_machines(net, of)
        found |= {name: Known(answer, STATE_MACHINES) for name, answer in by_graph.items()}
        if not by_graph:
            found |= _of_contact_free(net, of, limits)
    return found


def _dead(net: Net, of: Ordinary) -> dict[str, Known]:
    """Transitions that contradict themselves, or of which an input can never be marked."""
    may_be_marked = markable(of)
    fires = {t for k, t in enumerate(of.transitions) if may_be_marked.issuperset(of.inputs[k])}
    dead = tuple(t.name for i, t in enumerate(net.transitions) if i not in fires)
    if not dead:
        return {}
    return {name: Known(no(dead), MARKABLE) for name in ("quasi-live", "live")}


def _of_contact_free(net: Net, of: Ordinary, limits: Limits) -> dict[str, Known]:
    proof = contact_proof(net, limits.deadline)
    found = {"contact-free": Known(yes(), ONE_TOKEN)} if proof.whole else {}
    if not proof.behaves or of.inhibited:
        return found
    of = _without_bare_places(of)
    every = len(of.transitions) == len(net.transitions)
    if all(len(c) == 1 == len(p) for c, p in zip(of.consumers, of.producers, strict=True)):
        if len(markable(of)) == of.n_places:
            found |= _live(MARKED_GRAPH, every=every)
            found |= {name: Known(yes(), MARKED_GRAPH) for name in ("reversible", "home-markings")}
        return found
    if extended_free_choice(of.inputs, of.consumers):
        property_ = live_and_safe(of, limits.deadline)
        if property_.holds:
            found |= _live(FREE_CHOICE, every=every) | {"home-markings": Known(yes(), HOME)}
            trap = empty_trap(of)
            told = f"the trap of {_names(net, of, trap)} is empty, and once marked it stays so" if trap else ""
            found["reversible"] = Known(no(hint=told) if trap else yes(), HOME)
        elif property_.holds is False:
            found["live"] = Known(no(hint=_bare(net, of, property_)), FREE_CHOICE)
        return found
    if commoner(of, deadline=limits.deadline).holds:
        if asymmetric_choice(of.inputs, of.consumers):
            return found | _live(ASYMMETRIC_CHOICE, every=every)
        found |= {name: Known(yes(), SIPHONS) for name in ("deadlock-free", "doomed-markings")}
    return found


def _live(method: str, *, every: bool) -> dict[str, Known]:
    """What follows from liveness of all transitions that do not contradict themselves, if there are none that do."""
    names = ("live", "quasi-live") if every else ()
    return {name: Known(yes(), method) for name in (*names, "deadlock-free", "doomed-markings")}


def _without_bare_places(of: Ordinary) -> Ordinary:
    """The net without places that have no arc: such a place is a siphon and a trap, and concerns no transition."""
    kept = [p for p in range(of.n_places) if of.consumers[p] or of.producers[p]]
    number = {p: i for i, p in enumerate(kept)}
    return replace(
        of,
        n_places=len(kept),
        inputs=tuple(tuple(number[p] for p in places) for places in of.inputs),
        outputs=tuple(tuple(number[p] for p in places) for places in of.outputs),
        marked=frozenset(number[p] for p in of.marked if p in number),
        places=tuple(of.places[p] for p in kept),
    )


def _bare(net: Net, of: Ordinary, property_: Commoner) -> str:
    return f"the siphon of {_names(net, of, property_.bare)} contains no marked trap, so it can run empty for good"


def _names(net: Net, of: Ordinary, places: frozenset[int] | tuple[int, ...]) -> str:
    return listed(net.places[of.places[p]].name for p in sorted(places))
