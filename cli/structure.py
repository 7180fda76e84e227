"""`firable check --structure`: what the arcs alone say of a net, for `check` to print beside its verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from firable.analysis.invariants import Invariants
    from firable.nets.net import Net

_SHOWN_MAX = 8


def structure_json(net: Net, *, contact_free: bool | None) -> dict[str, Any]:
    """Net class, invariants, siphons and traps as JSON data; `contact_free` is what is known of that verdict."""
    from firable.analysis.invariants import p_invariants, t_invariants
    from firable.analysis.net_class import net_class
    from firable.analysis.siphons import deadlock_trap, minimal_traps

    kind = net_class(net, contact_free=contact_free)
    siphons = deadlock_trap(net, contact_free=contact_free)
    traps = minimal_traps(net)
    return {
        "net_class": kind.name,
        "outside_of_its_theorems": list(kind.outside),
        "p_invariants": _invariants(p_invariants(net), [place.name for place in net.places]),
        "t_invariants": _invariants(t_invariants(net), [transition.name for transition in net.transitions]),
        "siphons": {"minimal": [list(s) for s in siphons.siphons.minimal], "complete": siphons.siphons.complete},
        "traps": {"minimal": [list(trap) for trap in traps.minimal], "complete": traps.complete},
        "siphons_without_marked_trap": [list(siphon) for siphon in siphons.without_marked_trap],
        "siphons_exclude_deadlock": siphons.excludes_deadlock,
    }


def _invariants(found: Invariants, names: Sequence[str]) -> dict[str, Any]:
    return {
        "minimal": [dict(invariant.weights) for invariant in found.minimal],
        "dimension": found.dimension,
        "complete": found.complete,
        "uncovered": list(found.uncovered(names)),
    }


def structure_lines(structure: Mapping[str, Any]) -> Iterator[str]:
    """The same for a person, from the JSON data."""
    yield f"class         {structure['net_class']}"
    for reason in structure["outside_of_its_theorems"]:
        yield f"              outside of its theorems: {reason}"
    for key, words in (("p_invariants", "P-invariants"), ("t_invariants", "T-invariants")):
        found = structure[key]
        of = "places" if key == "p_invariants" else "transitions"
        uncovered = found["uncovered"]
        cover = f"all {of} are in one" if not uncovered else f"in none: {_some(uncovered)}"
        yield f"{words}  {_count(found)}, dimension {found['dimension']}; {cover}"
    bare = structure["siphons_without_marked_trap"]
    held = "each contains a marked trap" if not bare else f"{len(bare)} without a marked trap, as {_some(bare[0])}"
    proof = ", which proves that there is no deadlock" if structure["siphons_exclude_deadlock"] else ""
    yield f"siphons       {_count(structure['siphons'])}; {held}{proof}"
    yield f"traps         {_count(structure['traps'])}"


def _count(found: Mapping[str, Any]) -> str:
    return f"{len(found['minimal'])} minimal{'' if found['complete'] else ' and more'}"


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN_MAX} more" if len(names) > _SHOWN_MAX else ""
    return f"{', '.join(names[:_SHOWN_MAX])}{more}"
