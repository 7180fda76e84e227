"""Persistent parts: yes votes that no other transition can take back.

The vote of a part is *persistent* if, once true, it stays true until its own transition fires: in no reachable marking
of the central net, external gates free, does the yes stand while another transition that would falsify it is firable,
be it by a place or by clearing a completion that the part waits for. What machines and sensors do to gates is O4.
A stale yes of any other part is how the paper's own cell gives its robot a second task while it carries a part.

The arcs and the units of the net settle most parts (`firable.decompose.splitting.votes`), and obligations to a solver
show it (`firable.decompose.proofs.persistent`). What is left is a goal for each part, "the yes stands and one of these
is firable", and goes to the analysis: all markings where they are few, or where a decision diagram holds them; else the
techniques that decide one goal (`firable.analysis.methods`). PROVED is persistent, VIOLATED comes with a firing
sequence whose last firing takes the yes back, UNKNOWN says how far was looked.

What a persistent part may leave out
------------------------------------
Its yes may be as old as it likes *within its round*. To leave out the promise as well, that is to block nothing at its
controller between yes and order, asks for more than persistence, because the promise (O1) protects two sides: the yes
from the others, and the others from the order that comes late. `Persistence.free_of_promise` are the parts that may:

1. It is PROVED persistent, against every other transition of the central net: local or global, at whatever controller.
2. By the arcs alone, it can take no yes back at its own controller: no other transition there takes from its inputs or
   reads them by a permissive gate, none puts on its outputs or reads them by an inhibitive gate. While the order is on
   its way the controller still shows the marking before it; then what votes there votes no more often than it may.
   Reachability is not enough here: the marking that the controller shows meanwhile, behind in one order and ahead in
   another that overtook it, need not be the part of any reachable marking. Nor does anyone read a completion signal
   that it clears by sending a command, unless that one needs an output place of it full: until the order comes, the
   signal still shows the completion of a command before, and the output place is empty.
3. It asks no external gate but completions of commands on its own input places, which nothing at its controller can
   send anew while the yes stands: a promise would hold these back (O4). A timer is none: it falls when its controller
   restarts, and the yes would be older than that.
4. It belongs to a transition of its own: an order names its round, a round is asked anew only when the one before it
   has been acknowledged by all, and a vote of another round is not counted. The firing of the transition itself takes
   every yes of it back, and persistence says nothing of that.

Then: a yes is given on the marking that the controller shows; by 2, for all orders that are still on their way to it,
the yes holds of the central marking too, and by 1 it goes on to hold there until the transition is decided. By 2 no one
at the controller has touched inputs or outputs when the order arrives, so it can be applied, once (O5). Two transitions
of one arbitration group: if they meet in a place of this controller, 2 fails for both; if they meet elsewhere, the yes
of the loser is dropped and there is nothing to release. An order of abort, lost or not, releases nothing. Doubles are
told by the round. Where messages bear no round, or a controller answers one round with the yes of another, or another
controller reads a copy of the places instead of asking (O3), none of this holds. A part that is not free of the promise
may still be asked early where it is persistent, but must promise.

Rejected: the reference player over all markings, which is quick to write, has no bound, and gives no evidence.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Event
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.check import FIRST_MARKINGS
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Certificate, FiringSequence
from firable.analysis.evidence.claims import Claim, ClaimKind, tidy
from firable.analysis.evidence.document import Document, Record
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.goal import Finding, Limits
from firable.analysis.methods import GOAL_LANES
from firable.analysis.question import Answer, Question, listed, no, unknown, yes
from firable.analysis.settling import Settling
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.spaces.space import StateSpace, WitnessError, Witnesses
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.decompose.splitting.votes import Vote, clears, votes
from firable.decompose.splitting.walking import fallen
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula, Not
from firable.nets.knowledge import undisturbing
from firable.nets.net import Net
from firable.nets.queries import Query
from firable.nets.temporal import ForAll, Globally
from firable.nets.verdict import TOKENS_MAX, Cost, Status, Verdict, Weight, Witness
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import FiringSet, holds_in
from firable.semantics.trace import Discipline

PREFIX: Final = "persistent."
SECONDS: Final = 20.0
EVIDENCE: Final = "persistence.evidence.json"
"""The file of a bundle that shows of votes which arcs and units do not settle whether they are persistent."""
WALK_VOTES: Final = 64
"""With more votes open than this, a walk looks out for all of them before any is asked for by itself."""
_WALK_SHARE: Final = 0.6  # of the time
_DIAGRAM_SHARE: Final = 0.4  # of the time, for all markings in a diagram
_ARCS: Final = "arcs: no other transition can take it back"
_UNITS: Final = "arcs and sets of places with one token at most"


@dataclass(frozen=True)
class Persistence:
    """The votes of a decomposition, and the verdict `persistent.PART` on each; `findings` are what evidence is made of.

    A verdict's subjects are the transitions that falsify the yes, or may where it is UNKNOWN.
    """

    decomposition: Decomposition
    votes: tuple[Vote, ...]
    verdicts: tuple[Verdict, ...]
    space: StateSpace[Any] | None = None
    findings: Mapping[str, Sequence[tuple[Formula, Finding]]] = field(default_factory=dict)

    def of(self, part: str) -> Verdict:
        """The verdict on a part; `KeyError` where there is none."""
        for vote, verdict in zip(self.votes, self.verdicts, strict=True):
            if vote.part == part:
                return verdict
        raise KeyError(part)

    @property
    def free_of_promise(self) -> tuple[str, ...]:
        """The parts that may leave out the promise: persistent, and undisturbing, as this module's essay says."""
        persistent = (v.part for v, verdict in zip(self.votes, self.verdicts, strict=True) if verdict.holds)
        may = set(undisturbing(self.decomposition))
        return tuple(part for part in persistent if part in may)

    @property
    def free(self) -> tuple[tuple[str, str], ...]:
        """The same as a decomposition has them: each by its transition and its controller."""
        may = set(self.free_of_promise)
        return tuple((vote.transition, vote.controller) for vote in self.votes if vote.part in may)

    def free_as_shown(self, verdicts: Iterable[Verdict]) -> tuple[tuple[str, str], ...]:
        """The parts that may leave out the promise, as far as arcs and units settle it, or the evidence of verdicts."""
        may, shown = set(self.free_of_promise), {verdict.name for verdict in verdicts if verdict.evidence}
        return tuple(
            (vote.transition, vote.controller)
            for vote in self.votes
            if vote.part in may and (vote.settled or _name(vote) in shown)
        )

    def evidence(self) -> Document:
        """The document on every decided verdict that the arcs and units do not settle.

        A record for each, without a name, in the order of the votes: that the goal of the vote is never reached, or is.
        """
        limits = Limits(Deadline.after(SECONDS))
        flat = [finding for of in self.findings.values() for finding in of]
        certifier = Certifier(self.decomposition.net, Discipline.INTERLEAVING, limits, self.space, flat)
        shown = (
            _record(vote, verdict, certifier) for vote, verdict in self._open() if verdict.status is not Status.UNKNOWN
        )
        return Document(self.decomposition.net, Discipline.INTERLEAVING, tuple(shown))

    def with_evidence(self) -> tuple[tuple[Verdict, ...], Mapping[str, str]]:
        """The verdicts on the votes that arcs and units do not settle, with the document on them by its name.

        Those that the document shows name it. On the other votes there are obligations
        (`firable.decompose.proofs.persistent`).
        """
        document = self.evidence()
        records = iter(document.records)
        verdicts = []
        for _, verdict in self._open():
            stands = verdict.status is not Status.UNKNOWN and next(records).shown
            verdicts.append(replace(verdict, evidence=(EVIDENCE,)) if stands else verdict)
        return tuple(verdicts), {EVIDENCE: document.to_text()} if document.records else {}

    def _open(self) -> Iterator[tuple[Vote, Verdict]]:
        pairs = zip(self.votes, self.verdicts, strict=True)
        return ((vote, verdict) for vote, verdict in pairs if not vote.settled)


def persistence(
    decomposition: Decomposition,
    space: StateSpace[Any] | None = None,
    limits: Limits | None = None,
    cast: Sequence[Vote] | None = None,
) -> Persistence:
    """Decide of each part of a transition that the coordinator decides whether its yes is persistent.

    `space` are the reachable markings under interleaving, and `cast` the votes as arcs and units have them, where
    somebody has them already. Default limits: 20 seconds.

    >>> from firable.decompose.splitting.cut import split
    >>> from firable.nets.catalogue import catalogue_net
    >>> found = persistence(split(catalogue_net("one_robot")))
    >>> [(verdict.name, verdict.subjects) for verdict in found.verdicts if not verdict.holds]
    [('persistent.t1-21', ('G6',)), ('persistent.t1-41', ('G2',))]
    """
    limits = limits or Limits(Deadline.after(SECONDS))
    cast = cast if cast is not None else votes(decomposition, limits.deadline.within(_share(limits.deadline, 0.5)))
    one = _Deciding(decomposition.net, limits, space)
    open_ = [vote for vote in cast if vote.falsifiers]
    one.decide(open_)
    verdicts = tuple(one.found.get(vote.part) or _by_structure(vote) for vote in cast)
    return Persistence(decomposition, tuple(cast), verdicts, one.space, one.findings)


def freed(decomposition: Decomposition) -> Decomposition:
    """The decomposition as a bundle of its net would have it run: the parts free of promise of which that is shown.

    >>> from firable.decompose.splitting.cut import split
    >>> from firable.nets.catalogue import catalogue_net
    >>> len(freed(split(catalogue_net("one_robot"))).free)
    15
    """
    found = persistence(decomposition)
    return replace(decomposition, free=found.free_as_shown(found.with_evidence()[0]))


def nonpersistent(decomposition: Decomposition) -> dict[str, list[str]]:
    """The parts of global transitions whose yes is not proved persistent, each with what falsifies it, or may."""
    table = {row.name for row in decomposition.table}
    found = persistence(decomposition)
    return {
        vote.part: list(verdict.subjects)
        for vote, verdict in zip(found.votes, found.verdicts, strict=True)
        if not verdict.holds and vote.transition in table
    }


def _share(deadline: Deadline, share: float) -> float:
    left = deadline.left_seconds
    return SECONDS if left is None else left * share


def _name(vote: Vote) -> str:
    return f"{PREFIX}{vote.part}"


def _question(vote: Vote) -> Question:
    statement = f"once '{vote.part}' votes yes, no transition but '{vote.transition}' takes the yes back"
    return Question(_name(vote), statement, Weight.INFORMATION)


def _settled(vote: Vote, answer: Answer, method: str, cost: Cost | None = None) -> Verdict:
    return _question(vote).settle(answer, method, Discipline.INTERLEAVING, cost or Cost())


def _by_structure(vote: Vote) -> Verdict:
    """The verdict on a vote that needs no look at markings; UNKNOWN where none was taken."""
    if vote.others:
        bound = f"{vote.others:,} arcs of others at its places are more than are looked at"
        return _settled(vote, unknown(bound, "it promises, as every part may"), "arcs")
    if vote.falsifiers:
        answer = unknown("not looked at within the time", "give it more time", "F3004")
        return _settled(vote, Answer(None, vote.falsifiers, None, answer.hint, answer.bound, answer.code), "arcs")
    return _settled(vote, yes(), _UNITS if vote.units else _ARCS)


class _Deciding:
    """The votes of one net that markings decide."""

    def __init__(self, net: Net, limits: Limits, space: StateSpace[Any] | None) -> None:
        self.net, self.limits = net, limits
        self.space = space if space is not None and space.complete else None
        self.witnesses = Witnesses(net, Discipline.INTERLEAVING)
        self.found: dict[str, Verdict] = {}
        self.findings: dict[str, Sequence[tuple[Formula, Finding]]] = {}

    def decide(self, open_: Sequence[Vote]) -> None:
        """Find a verdict on each vote, as far as there is time."""
        if len(open_) > WALK_VOTES and self.space is None:
            self._walk(open_)
            open_ = [vote for vote in open_ if vote.part not in self.found]
        if open_ and self.space is None:
            self.space = self._held()
        for vote in open_:
            if self.limits.deadline.over:
                return
            if self.space is not None:
                self._ask(vote, self.space.until(self.limits.deadline))
        for left, vote in zip(range(len(open_), 0, -1), open_, strict=True):
            if vote.part not in self.found and not self.limits.deadline.over:
                self._race(vote, self.limits.deadline.within(_share(self.limits.deadline, 1 / left)))

    def _walk(self, open_: Sequence[Vote]) -> None:
        """Find those that a walk meets."""
        met = fallen(self.net, open_, self.limits.deadline.within(_share(self.limits.deadline, _WALK_SHARE)))
        for vote in open_:
            if self.limits.deadline.over:
                return
            if by := met.get(vote.part):
                names = [name for name in vote.falsifiers if name in by]
                answer = self._taken_back(vote, [(t,) for t in by[names[0]]], names)
                self.found[vote.part] = _settled(vote, answer, "walk at random, sliced")

    def _held(self) -> StateSpace[Any] | None:
        """All markings, where a moment finds them or a diagram holds them."""
        budget = Budget(FIRST_MARKINGS, self.limits.memory_bytes)
        try:
            graph = explore(self.net, Discipline.INTERLEAVING, budget, deadline=self.limits.deadline)
            if graph.complete:
                return graph
        except InputError:
            pass  # there is no room for the net itself, and a diagram may need less
        deadline = self.limits.deadline.within(_share(self.limits.deadline, _DIAGRAM_SHARE))
        try:
            return explore_symbolically(self.net, Limits(deadline, self.limits.memory_bytes)).until(
                self.limits.deadline
            )
        except BudgetExceeded:
            return None

    def _ask(self, vote: Vote, space: StateSpace[Any]) -> None:
        def find() -> Answer:
            standing = space.satisfying(vote.goal(vote.falsifiers))
            witness = space.witness(standing)
            if witness is None:
                return yes()
            may_fire = (space.may_fire(self.net.transition_index[name]) for name in vote.falsifiers)
            both = (space.count(space.algebra.conjunction([standing, where])) for where in may_fire)
            by = [name for name, n in zip(vote.falsifiers, both, strict=True) if n]
            return self._taken_back(vote, self._run(witness), by)

        verdict = _question(vote).ask(space, find)
        if verdict.status is not Status.UNKNOWN:
            self.found[vote.part] = verdict

    def _race(self, vote: Vote, deadline: Deadline) -> None:
        query = Query.of(vote.part, ForAll(Globally(Not(vote.goal()))))
        settling = Settling(self.net, (query,), self.limits.memory_bytes, Event())
        asked = _settled(vote, unknown("not asked yet", ""), "")
        name = f"query.{query.name}"
        settling.ask(replace(asked, name=name), (), GOAL_LANES, deadline)
        verdict = settling.found.get(name)
        if verdict is None:
            return
        self.findings[_name(vote)] = settling.findings[name]
        if verdict.holds:
            answer = yes()
        else:
            ((_, finding),) = settling.findings[name]
            if finding.witness is None:
                raise AssertionError(f"{finding.method} says that a goal is reachable and does not show how")
            marking = self.net.marking(finding.witness.marking)
            may = {self.net.transitions[t].name for t in self.witnesses.player.may_fire(marking)}
            answer = self._taken_back(
                vote, self._run(finding.witness), [name for name in vote.falsifiers if name in may]
            )
        self.found[vote.part] = _settled(vote, answer, verdict.method, verdict.cost)

    def _taken_back(self, vote: Vote, run: Sequence[FiringSet], by: Sequence[str]) -> Answer:
        """The yes is taken back: the run to where it stands, and the firing that does it, played by the reference."""
        before = self.witnesses.play(self.net.initial_marking, run)
        index = self.net.transition_index
        last = next(index[name] for name in by if firable(BOOL, self.net, index[name], holds_in(before)))
        after = self.witnesses.play(before, [(last,)])
        full, empty = self.net.marking(vote.full), self.net.marking(vote.empty)
        stands, falls = before & full == full and not before & empty, after & full != full or after & empty
        falls = falls or not vote.awaited.isdisjoint(clears(self.net, self.net.transitions[last]))
        if not stands or not falls:
            raise WitnessError(f"'{self.net.transitions[last].name}' does not take back the yes of '{vote.part}'")
        note = f"before the last firing '{vote.part}' votes yes, after it no"
        told = after if after.bit_count() <= TOKENS_MAX else 0
        witness = self.witnesses.named([*run, (last,)], told, note=note)
        hint = f"nothing has to be done: the part promises, and then {listed(by)} cannot take its yes back"
        return no(tuple(by), witness, hint)

    def _run(self, witness: Witness) -> list[FiringSet]:
        """A firing sequence by the indexes of its transitions."""
        return [tuple(self.net.transition_index[name] for name in fired) for fired in witness.firings]


def claim_of(vote: Vote, *, persistent: bool) -> Claim:
    """The claim that the verdict on a vote comes down to: its goal is never reached, or is."""
    return Claim(ClaimKind.NEVER if persistent else ClaimKind.REACHABLE, tidy(vote.goal()))


def _record(vote: Vote, verdict: Verdict, certifier: Certifier) -> Record:
    claim, lacking, shown = claim_of(vote, persistent=verdict.holds), "", list[tuple[Claim, Certificate]]()
    if verdict.witness is not None:  # without its last firing it ends where the yes stands
        shown.append((claim, FiringSequence(verdict.witness.firings[:-1])))
    else:
        try:
            shown.append((claim, certifier.certify(claim)))
        except LackingError as error:
            lacking = f"{vote.part}: {error}"
    return Record("", verdict.holds, tuple(shown), lacking)
