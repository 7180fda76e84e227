"""Carrying over: what holds of the conceptual net holds of the detailed one, and need not be explored there.

**Theorem.** Let N be a conceptual net without contact, and N' the net in which its tasks are open, gates free, one
transition firing at a time. Let every task keep the conditions of `closed`, the ledger be right (`ledger`), and N be
such that no task's place holds a token in M0, no place is input and output of one transition, no inhibitive gate asks a
resource that some task releases before its end, and every transition that can open still can. Then N and N' are
branching bisimilar, the moves inside tasks being hidden; and if every task settles, with explicit divergence.

**Proof.** Relate M of N and M' of N' if every place that is no resource holds the same in both; the steps of a task are
empty where its place is, and else are a marking of the task, closed; and a resource is idle in M iff in M' it is idle
or *pending* (held by a task that is going to release it), not both, and pending in one task at most. Whether a task has
still to release a resource can be read off its steps: were both possible, the way to the end from there would either
not release it or release it twice, against *ends clean* and *contact-free*. M0 and M0' are related.

1. A move inside a task changes M' alone. What it releases was pending and so not idle: the move is firable as in the
   closed task, and what was pending is idle now. M and the new M' are related.
2. Let t fire in M'. What it asks to hold, holds in M too. What it asks to be empty: an inhibitive gate asks a place
   that is the same in both; an output of t in N, full in M and empty in M', would be a contact of N. So t is firable in
   M. A task that it ends is left without a rest (*ends clean*: t takes all the last steps), one that it starts was
   empty and is entered, and the resources that this one will release are pending from now on: t makes them idle in N,
   and they were not idle before, for N has no contact; or t borrows them: then they were idle in M', so pending
   nowhere, and stay idle in N. The markings after t are related.
3. Let t fire in M. In M', each task that is running can be brought to where it can end by moves inside (*ends*); tasks
   share no steps, and by 1 all these markings are related to M. There nothing is pending, so every resource, and
   every place, is as in M; the last steps are there, and the first steps of what t starts are empty: t is firable.

Hidden firings, in 3, change nothing of the relation on their way: that is branching bisimilarity. If all tasks settle,
hidden firings end: N' diverges nowhere, and neither does N, which hides nothing.

**It follows**: N' is deadlock-free if N is, and if all tasks settle only if N is (a task that can go on inside for ever
is no deadlock); the transitions of N are live and quasi-live in N' iff in N, and so for reversibility, home markings,
and AG, EF and AG EF of formulas over the places that hold the same in both. A move inside is live if N is: its task is
started again and again, and the move can fire then (*complete*). N' has no contact: at a transition of N it would be
one of N, inside a task one of the task. Two transitions of N compete in N' only if in N, but for what they borrow, and
a move only inside its task (*orderly*). If all tasks settle, a run of N' that leaves no firable transition out for ever
brings each task to its end, and what stays firable in N is firable from some moment on in N': so the run of N that it
shows is weakly fair, and `leads_to` carries over; not where resources are borrowed, which may be lent out again and
again, and not under strong fairness, where "again and again" may fall between the moves.

Sources: Valette (1979) replaces a transition by a well-formed block and carries over boundedness and liveness; Suzuki
and Murata (1983) add refinement of places. Their blocks have one entry and one exit, with one token, in nets without
gates. Here a block takes several resources at once from several hands, gives some of them back early, and stands in a
net with gates and the contact rule. That the refined net can be brought to rest from everywhere is the idea of the
stable markings of Chehaibar's open interface nets (1993).

Not carried over, because N knows nothing of it: conflicting commands, shared completions, gate races, starvation under
arbiters, and all of synchronous steps, where one step may hold a move and a transition that it makes firable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, Final, TypeVar

from firable.analysis.report import CheckReport
from firable.analysis.spaces.space import Witnesses
from firable.analysis.verdicts.properties import statement
from firable.decompose.refinement.closed import BlockProof
from firable.nets.formula import Deadlock, Firable, Formula, Holds, names_in
from firable.nets.net import Fairness, Marking, Net, Property, PropertyKind, TemporalProperty
from firable.nets.temporal import Fires
from firable.nets.verdict import Cost, Status, Verdict, Witness
from firable.semantics.player import FiringSet, Player
from firable.semantics.trace import Discipline

T = TypeVar("T")

METHOD: Final = "the theorem of refinement, from the conceptual net"

_CARRIED: Final = (
    "contact-free",
    "deadlock-free",
    "quasi-live",
    "doomed-markings",
    "live",
    "reversible",
    "home-markings",
    "effective-conflicts",
)
_AVOIDED: Final = "a run may stay inside a task for ever, and so avoid the deadlock"
_OWN: Final = ("conflicting-commands", "shared-completions", "gate-races", "starvation")
"""What a detailed net must be asked itself."""


@dataclass(frozen=True)
class Correspondence:
    """How a conceptual net and its detailed one correspond, in their names.

    `places` and `transitions` give the detailed name of each conceptual one; `moves` and `lasts`, for each place that
    names a task, the transitions inside it and its last steps, in the detailed net. `released` are the resources that a
    task makes idle inside, `borrowed` those of them that some transition takes from their idle places.
    """

    conceptual: Net
    detailed: Net
    places: Mapping[str, str]
    transitions: Mapping[str, str]
    moves: Mapping[str, Sequence[str]]
    lasts: Mapping[str, Sequence[str]]
    released: frozenset[str]
    borrowed: frozenset[str] = frozenset()

    def renamed(self, of: T) -> T:
        """A property or formula of the conceptual net in the names of the detailed one."""
        renamed: T = self._renamed(of)
        return renamed

    def _renamed(self, node: Any) -> Any:
        match node:
            case Holds(place):
                return Holds(self.places[place])
            case Firable(transition):
                return Firable(self.transitions[transition])
            case Fires(transition):
                return Fires(self.transitions[transition])
            case tuple():
                return tuple(self._renamed(one) for one in node)
            case _ if is_dataclass(node) and not isinstance(node, type):
                changed = {one.name: self._renamed(getattr(node, one.name)) for one in fields(node)}
                if "places" in changed:  # a count names its places by themselves
                    changed["places"] = tuple(self.places[place] for place in changed["places"])
                return replace(node, **changed)
        return node


def untold(correspondence: Correspondence, of: Property | TemporalProperty) -> str:
    """Why the verdict on a property does not carry over, in words; empty where it does."""
    if isinstance(of, TemporalProperty):
        return "a formula of CTL or LTL may count the firings that are between two of its own"
    if of.fairness is Fairness.STRONG and of.kind is PropertyKind.LEADS_TO:
        return "strong fairness looks at single markings, of which the detailed net has others between"
    if of.formula == Deadlock() and of.kind in {PropertyKind.NEVER, PropertyKind.REACHABLE}:
        return ""
    for formula in (of.formula, of.then):
        for atom in _atoms(formula) if formula else ():
            match atom:
                case Deadlock() | Firable():
                    return "in the detailed net a transition may wait for moves inside a task"
                case Holds(place) if place in correspondence.released:
                    return f"'{place}' is idle in the detailed net only when a task has released it"
    return ""


def carried(correspondence: Correspondence, blocks: Sequence[BlockProof], report: CheckReport) -> Iterator[Verdict]:
    """The verdicts on the detailed net that follow from those on the conceptual one, each PROVED, VIOLATED or UNKNOWN.

    The blocks are sound. Violations come with a firing sequence of the detailed net, replayed by the reference player.
    """
    settles, orderly = all(block.settles for block in blocks), all(block.orderly for block in blocks)
    if not report.verdict("contact-free").holds:
        why = "the conceptual net is not known to be contact-free, which the theorem asks"
        for name in _CARRIED:
            yield _unknown(report.verdict(name), why)
        return
    lift = Lift(correspondence)
    for name in _CARRIED:
        verdict = report.verdict(name)
        if name in {"doomed-markings", "deadlock-free"} and verdict.status is Status.VIOLATED and not settles:
            yield _unknown(verdict, _AVOIDED)
        elif name == "effective-conflicts" and (correspondence.borrowed or not (orderly and verdict.holds)):
            yield _unknown(verdict, "moves inside a task compete, or transitions do, as for what they borrow")
        else:
            yield lift.verdict(verdict)
    for prop in report.net.properties:
        verdict, renamed = report.verdict(f"property.{prop.name}"), correspondence.renamed(prop)
        if isinstance(renamed, Property):
            verdict = replace(verdict, statement=statement(renamed))
        why = untold(correspondence, prop)
        if not why and not settles and isinstance(prop, Property):
            if prop.kind is PropertyKind.LEADS_TO:
                why = "a run may stay inside a task for ever"
            elif prop.formula == Deadlock() and verdict.holds is (prop.kind is PropertyKind.REACHABLE):
                why = _AVOIDED
        if not why and correspondence.borrowed and verdict.holds and _is_weakly_fair(prop):
            why = "who borrows a resource may find it lent out again and again, which weak fairness allows"
        yield _unknown(verdict, why) if why else lift.verdict(verdict)


def not_carried() -> str:
    """What `firable check` decides of the detailed net alone, in words."""
    return ", ".join(_OWN)


@dataclass(frozen=True)
class Lift:
    """Firing sequences of the conceptual net, played in the detailed one, with tasks brought to their ends between."""

    correspondence: Correspondence

    @cached_property
    def player(self) -> Player:
        """The reference player of the detailed net."""
        return Player(self.correspondence.detailed)

    def verdict(self, of: Verdict) -> Verdict:
        """The verdict on the detailed net, with its witness and its subjects in the names there."""
        names = self.correspondence.transitions
        return replace(
            of,
            method=METHOD,
            subjects=tuple(names.get(subject, subject) for subject in of.subjects),
            witness=None if of.witness is None else self.witness(of.witness),
            cost=Cost(),
            evidence=(),
        )

    def witness(self, of: Witness) -> Witness | None:
        """The firing sequence in the detailed net, its tasks at their ends after it; replayed."""
        net = self.correspondence.detailed
        marking, prefix = self.played(net.initial_marking, of.firings)
        end, cycle = self.played(marking, of.cycle)
        if of.cycle and end != marking:
            raise AssertionError("a cycle of the conceptual net does not close in the detailed one")
        witnesses = Witnesses(net, Discipline.INTERLEAVING)
        witnesses.replayed(prefix, marking)
        witnesses.play(marking, cycle)
        return witnesses.named(prefix, marking, cycle, of.note)

    def played(self, marking: Marking, firings: Sequence[Sequence[str]]) -> tuple[Marking, list[FiringSet]]:
        """The marking after conceptual firings, each task brought to its end, and all that was fired."""
        index, names = self.correspondence.detailed.transition_index, self.correspondence.transitions
        fired: list[FiringSet] = []
        marking = self.settled(marking, fired)
        for (name,) in firings:
            step = (index[names[name]],)
            marking = self.player.fire(marking, step)
            fired.append(step)
            marking = self.settled(marking, fired)
        return marking, fired

    def settled(self, marking: Marking, fired: list[FiringSet]) -> Marking:
        """The marking with every running task where it can end; what is fired for it is appended."""
        net = self.correspondence.detailed
        for place, lasts in self.correspondence.lasts.items():
            goal = net.marking(lasts)
            if not marking >> net.place_index[self.correspondence.places[place]] & 1:
                continue
            moves = {net.transition_index[name] for name in self.correspondence.moves[place]}
            way: dict[Marking, list[FiringSet]] = {marking: []}
            for now in (todo := [marking]):
                if now & goal == goal:
                    marking = now
                    fired += way[now]
                    break
                for t in self.player.may_fire(now):
                    if t in moves and (after := self.player.fire(now, (t,))) not in way:
                        way[after] = [*way[now], (t,)]
                        todo.append(after)
            else:
                raise AssertionError(f"the task of '{place}' was proved to end, and does not")
        return marking


def _is_weakly_fair(of: Property | TemporalProperty) -> bool:
    return isinstance(of, Property) and of.kind is PropertyKind.LEADS_TO and of.fairness is Fairness.WEAK


def _unknown(of: Verdict, why: str) -> Verdict:
    return replace(
        of, status=Status.UNKNOWN, method=METHOD, bound=f"not carried over: {why}", code="", witness=None, subjects=(),
        hint="ask `firable check` of the detailed net", cost=Cost(),
    )  # fmt: skip


def _atoms(formula: Formula) -> Iterator[object]:
    yield from names_in(formula)
    todo: list[object] = [formula]
    while todo:
        node = todo.pop()
        if isinstance(node, Deadlock):
            yield node
        if isinstance(node, tuple):
            todo += node
        elif is_dataclass(node):
            todo += [getattr(node, one.name) for one in fields(node)]
