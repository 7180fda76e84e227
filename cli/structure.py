"""`firable check --structure`: what the arcs alone say of a net, for `check` to print beside its verdicts.

The lists can be exponentially long, so all of them share one deadline; Ctrl-C is that deadline too, so that it loses
none of the verdicts that are there already.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from firable.analysis.deadline import Deadline
    from firable.analysis.structure.invariants import Invariant, Invariants
    from firable.nets.net import Net

T = TypeVar("T")

SECONDS_DEFAULT = 30.0
_SHOWN_MAX = 8


def structure_json(
    net: Net, *, contact_free: bool | None, seconds: float | None, discipline: str = "interleaving"
) -> dict[str, Any]:
    """Net class, invariants, siphons and traps as JSON data; `contact_free` is what is known of that verdict.

    The `discipline` is the one under which deadlock is spoken of.
    Where it is not known, invariants may prove it. The minimal invariants may be too many to list; a basis of all, with
    integer weights of either sign, is looked for first and stands beside them. All together take `seconds`, by default
    30, each a fair part of what is left. Where that is too short, or at Ctrl-C, `ended_early` says so and the lists not
    finished are not `complete`.
    """
    from firable.analysis.deadline import Deadline
    from firable.analysis.structure.commoner import DeadlockTrap, deadlock_trap
    from firable.analysis.structure.contact import contact_proof
    from firable.analysis.structure.invariants import Invariants, p_basis, p_invariants, t_basis, t_invariants
    from firable.analysis.structure.net_class import net_class
    from firable.analysis.structure.siphons import PlaceSets, minimal_traps
    from firable.semantics.trace import Discipline

    deadline, ended_early, to_come = Deadline.after(SECONDS_DEFAULT if seconds is None else seconds), "", 5

    def found(technique: Callable[[Deadline], T], nothing: T) -> T:
        nonlocal ended_early, to_come
        if ended_early == "interrupted":
            return nothing
        until = Deadline.after((deadline.left_seconds or 0.0) / to_come)
        to_come -= 1
        try:
            result = technique(until)
        except KeyboardInterrupt:
            ended_early = "interrupted"
            return nothing
        ended_early = "time" if until.over else ended_early
        return result

    def proved_contact_free(until: Deadline) -> bool | None:
        return contact_free if contact_free is not None else (contact_proof(net, until).whole or None)

    contact_free = found(proved_contact_free, contact_free)
    kind = net_class(net, contact_free=contact_free)
    no_vectors, no_sets = Invariants((), None, complete=False), PlaceSets((), complete=False)
    none: tuple[tuple[Invariant, ...] | None, Invariants] = (None, no_vectors)
    of_places = found(lambda until: (p_basis(net, deadline=_half(until)), p_invariants(net, deadline=until)), none)
    of_transitions = found(lambda until: (t_basis(net, deadline=_half(until)), t_invariants(net, deadline=until)), none)
    siphons = found(
        lambda until: deadlock_trap(net, contact_free=contact_free, discipline=Discipline(discipline), deadline=until),
        DeadlockTrap(None, no_sets, (), ()),
    )
    traps = found(lambda until: minimal_traps(net, deadline=until), no_sets)
    return {
        "net_class": kind.name,
        "pure": kind.pure,
        "connected": kind.connected,
        "strongly_connected": kind.strongly_connected,
        "outside_of_its_theorems": list(kind.outside),
        "p_invariants": _invariants(*of_places, [place.name for place in net.places]),
        "t_invariants": _invariants(*of_transitions, [transition.name for transition in net.transitions]),
        "siphons": {"minimal": [list(s) for s in siphons.siphons.minimal], "complete": siphons.siphons.complete},
        "traps": {"minimal": [list(trap) for trap in traps.minimal], "complete": traps.complete},
        "siphons_without_marked_trap": [list(siphon) for siphon in siphons.without_marked_trap],
        "siphons_exclude_deadlock": siphons.excludes_deadlock,
        "ended_early": ended_early,
    }


def _half(deadline: Deadline) -> Deadline:
    return deadline.within((deadline.left_seconds or 0.0) / 2)


def _invariants(basis: Sequence[Invariant] | None, found: Invariants, names: Sequence[str]) -> dict[str, Any]:
    return {
        "basis": None if basis is None else [dict(invariant.weights) for invariant in basis],
        "minimal": [dict(invariant.weights) for invariant in found.minimal],
        "dimension": found.dimension,
        "complete": found.complete,
        "uncovered": list(found.uncovered(names)),
    }


_ENDED_EARLY = {"time": "the time for the structure is over", "interrupted": "interrupted"}


def structure_lines(structure: Mapping[str, Any]) -> Iterator[str]:
    """The same for a person, from the JSON data."""
    from firable.analysis.structure.invariants import Invariant

    yield f"class         {structure['net_class']}"
    for reason in structure["outside_of_its_theorems"]:
        yield f"              outside of its theorems: {reason}"
    joined = "strongly connected" if structure["strongly_connected"] else "connected, but not strongly"
    yield f"graph         {joined if structure['connected'] else 'of several parts without an arc between them'}"
    for key, words, of in (
        ("p_invariants", "P-invariants", "places"),
        ("t_invariants", "T-invariants", "transitions"),
    ):
        found = structure[key]
        dimension = "" if found["dimension"] is None else f", dimension {found['dimension']}"
        yield f"{words}  {_count(found)}{dimension}{_cover(found, of)}"
        if found["basis"] and not found["complete"]:
            shortest = Invariant(tuple(min(found["basis"], key=len).items()))
            yield f"              a basis of all is known: {len(found['basis'])} in integers, as {shortest}"
    siphons, bare = structure["siphons"], structure["siphons_without_marked_trap"]
    held = ""
    if bare:
        held = f"; {len(bare)} without a marked trap, as {_some(bare[0])}"
    elif siphons["complete"] or structure["siphons_exclude_deadlock"]:
        held = "; each contains a marked trap"
    proof = ", which proves that there is no deadlock" if structure["siphons_exclude_deadlock"] else ""
    yield f"siphons       {_count(siphons)}{held}{proof}"
    yield f"traps         {_count(structure['traps'])}"
    if reason := structure["ended_early"]:
        yield f"incomplete    {_ENDED_EARLY[reason]}: of the lists above, those 'so far' are not finished"


def _cover(found: Mapping[str, Any], of: str) -> str:
    if not found["uncovered"]:
        return f"; all {of} are in one"
    # Another invariant may still cover them, so nothing is said of a part.
    return f"; in none: {_some(found['uncovered'])}" if found["complete"] else ""


def _count(found: Mapping[str, Any]) -> str:
    return f"{len(found['minimal'])} minimal{'' if found['complete'] else ' so far'}"


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN_MAX} more" if len(names) > _SHOWN_MAX else ""
    return f"{', '.join(names[:_SHOWN_MAX])}{more}"
