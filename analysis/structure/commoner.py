"""The deadlock-trap property: does every siphon contain a trap that is marked in M0? (Commoner 1972; Hack 1972)

In a deadlock of an ordinary net the empty places are a siphon. If every siphon contains a trap that is marked in M0,
and so for ever, no deadlock is reachable: this proves deadlock-freeness without exploring anything. On free-choice nets
the property is liveness itself (`firable.analysis.structure.theorems`).

It is decided without a list of siphons, which may be exponential, in two ways, one after the other. *By exclusion*:
z3 gives a siphon, which is shrunk; the largest trap within it is marked, or it is the answer; else all siphons that
contain a small marked part of that trap are excluded, and z3 is asked again. On most nets a few traps are enough. *By
ranks*, where many are not: one formula says that S is a non-empty siphon, and that what takes the largest trap out of S
leaves no marked place. The largest trap within S comes about by taking away, one after the other, places with a
consumer that puts nothing back into what is left; so each marked place of S has a rank, and a consumer whose outputs
are out of S or have lower ranks. The formula has the size of the net. The rejected alternative, to go through all
minimal siphons, needs exponentially many steps where sections of a process run in parallel.

What is found can be checked without z3's word: a siphon without a marked trap is multiplied out here, by taking the
largest trap out of it. That there is none rests on z3.

For the net of this toolkit the argument on deadlock has premises, since the firing rule forbids more than the ordinary
one: no inhibitive gates, and contact-free. Permissive gates are reads, of which the argument holds, and transitions
that contradict themselves are no part of the net. External gates are free, as everywhere. Under synchronous steps a
token that is read may be taken at the same time, so that a trap that rests on the read runs empty: there the argument
wants no permissive gates either, and then each step is some order of its firings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import z3

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.structure.asking import answer, solver_of
from firable.analysis.structure.ordinary import Ordinary, markable, ordinary
from firable.analysis.structure.siphons import (
    SIPHONS_MAX,
    PlaceSets,
    Question,
    Rules,
    minimal_siphons,
    siphon_rules,
    trap_rules,
)
from firable.nets.net import Net
from firable.semantics.trace import Discipline

EXCLUDED_MAX: Final = 500


@dataclass(frozen=True, slots=True)
class Commoner:
    """Whether every siphon contains a marked trap (None: not decided); if not, a small siphon that does not.

    Where it was decided by exclusion, every siphon contains one of the `traps`.
    """

    holds: bool | None
    bare: tuple[int, ...] = ()
    traps: tuple[tuple[int, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class DeadlockTrap:
    """The deadlock-trap property of a net, with the minimal siphons for who wants to see them.

    `siphons` are the minimal siphons, not `complete` where not all were found or looked into; `without_marked_trap` are
    those that refute the property. `holds` is the property itself, None where it was not decided. `premises` says
    what is missing for a conclusion on deadlock; the property alone concludes nothing about it.
    """

    holds: bool | None
    siphons: PlaceSets
    without_marked_trap: tuple[tuple[str, ...], ...]
    premises: tuple[str, ...]

    @property
    def excludes_deadlock(self) -> bool:
        """Whether the net is thereby proved free of deadlock."""
        return self.holds is True and not self.premises


def commoner(of: Ordinary, *, deadline: Deadline = NEVER) -> Commoner:
    """Decide whether every non-empty siphon contains a trap that is marked in M0.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    >>> commoner(ordinary(net))
    Commoner(holds=False, bare=(0,), traps=())
    """
    siphons, traps = siphon_rules(of), trap_rules(of)
    bare = set(range(of.n_places)) - markable(of)
    if not bare:
        held, bare, known = _by_exclusion(of, siphons, traps, deadline)
        if held is None and len(known) == EXCLUDED_MAX:
            held, bare = _by_ranks(of, siphons, deadline)
            known = []
        if held is not False:
            return Commoner(held, (), tuple(known) if held else ())
    if siphons.largest(bare) != bare or traps.largest(bare) & of.marked:
        raise AssertionError("a set that is no siphon without a marked trap came out of the solver")
    # A siphon within it has no marked trap either.
    smallest = siphons.smallest(bare, None, deadline)
    return Commoner(holds=False, bare=tuple(sorted(bare if smallest is None else smallest)))


def _by_exclusion(
    of: Ordinary, siphons: Rules, traps: Rules, deadline: Deadline
) -> tuple[bool | None, set[int], list[tuple[int, ...]]]:
    """Whether the property holds, a siphon without a marked trap, and the marked traps that were excluded."""
    question, excluded = Question(siphons), list[tuple[int, ...]]()
    while len(excluded) < EXCLUDED_MAX:
        said, siphon = question.next(deadline)
        if said != z3.sat:
            return (True if said == z3.unsat else None), set(), excluded
        siphon = siphons.smallest(siphon, None, deadline) or siphon
        trap = traps.largest(siphon)
        if not trap & of.marked:
            return False, siphon, excluded
        trap = traps.smallest(trap, of.marked, deadline) or trap
        excluded.append(tuple(sorted(trap)))
        question.exclude(trap)
    return None, set(), excluded


def deadlock_trap(
    net: Net,
    *,
    contact_free: bool | None = None,
    discipline: Discipline = Discipline.INTERLEAVING,
    most: int = SIPHONS_MAX,
    deadline: Deadline = NEVER,
) -> DeadlockTrap:
    """Decide the deadlock-trap property; `contact_free` is what is known of that verdict (None: nothing).

    The premises are those of a conclusion on deadlock under the discipline.
    """
    of = ordinary(net)
    premises = tuple(_missing_premises(of, contact_free))
    if discipline is Discipline.STEP and any(net.transitions[t].permissive for t in of.transitions):
        premises += ("a step may take a token away from a place while a permissive gate reads it there",)
    property_ = commoner(of, deadline=deadline)
    siphons = minimal_siphons(net, most=most, deadline=deadline)
    traps, bare = trap_rules(of), []
    for siphon in siphons.minimal:
        if deadline.over:
            siphons = PlaceSets(siphons.minimal, complete=False)
            break
        if not traps.largest(net.place_index[name] for name in siphon) & of.marked:
            bare.append(siphon)
    if property_.holds is False and not bare:
        bare.append(tuple(net.places[i].name for i in property_.bare))
    return DeadlockTrap(property_.holds, siphons, tuple(bare), premises)


def _missing_premises(of: Ordinary, contact_free: bool | None) -> Iterator[str]:
    if not of.transitions:
        yield "it has no transition that could ever fire, so that every marking is a deadlock"
    if of.inhibited:
        yield "inhibitive gates may hold transitions back while their inputs are marked"
    if not contact_free:
        yield "full output places may hold transitions back: the net is not known to be contact-free"


def _by_ranks(of: Ordinary, siphons: Rules, deadline: Deadline) -> tuple[bool | None, set[int]]:
    """The formula of the essay: s of a place is "in the siphon", d "taken out of it", r the rank at which it is."""
    context = z3.Context()
    solver = solver_of(context)
    lines = []
    for p in range(of.n_places):
        lines += [f"(declare-const s{p} Bool)", f"(declare-const d{p} Bool)", f"(declare-const r{p} Int)"]
    for condition, needed in zip(siphons.conditions, siphons.needed, strict=True):
        alternatives = " ".join(f"s{i}" for i in needed)
        lines += [f"(assert (or (not s{i}) {alternatives}))" for i in condition]
    for p in range(of.n_places):
        if p in of.marked:
            lines.append(f"(assert (or (not s{p}) d{p}))")
        ways = []
        for k in of.consumers[p]:
            if p not in of.outputs[k]:
                out = " ".join(f"(or (not s{q}) (and d{q} (< r{q} r{p})))" for q in of.outputs[k])
                ways.append(f"(and true {out})")
        lines.append(f"(assert (or (not d{p}) false {' '.join(ways)}))")
    lines.append(f"(assert (or false {' '.join(f's{p}' for p in range(of.n_places))}))")
    solver.from_string("\n".join(lines))
    said = answer(solver, deadline)
    if said != z3.sat:
        return (True if said == z3.unsat else None), set()
    model = solver.model()
    return False, {p for p in range(of.n_places) if z3.is_true(model[z3.Bool(f"s{p}", context)])}
