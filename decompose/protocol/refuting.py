"""How a protocol that is known to be wrong goes wrong: a run, told in the net's own names.

Asked of the net of a cell, the answer says which obligations this cell lives on. That one "cannot go wrong here" is no
licence: the next edit of the net may need what this one does not. Where the run of a cell is too long to be read, or
there is none, the run on the small net of the same wrong protocol (`wrong.py`) stands for it.

A run is looked for where it is cheapest and told best: breadth first, as far as the first markings go, then with most
of the cell in rounds that nothing disturbs (`directed`), which are one line each to read; else on random walks, which
meet what is many steps away, first among the runs where one transition is asked for at a time; else in a diagram of all
markings, which also shows that there is none. Where the net has nothing of what the protocol leaves out, no gate, no
conflict, the protocol is the true one on it, and the invariant of that shows that it goes right. Every run is replayed
by the reference player on the protocol's net.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.deadline import NEVER
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, BudgetExceeded, explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.verdicts.properties import decide_property
from firable.analysis.walk import decide_by_walk
from firable.decompose.protocol.building import AGREES, FIT, FOLLOWS, ProtocolNet, protocol_net
from firable.decompose.protocol.directed import Line, directed, told
from firable.decompose.protocol.draft import ASTRAY, central
from firable.decompose.protocol.exploring import FIRST_MARKINGS
from firable.decompose.protocol.inductive_script import prove_inductively
from firable.decompose.protocol.parts import Parts
from firable.decompose.protocol.variant import PROTOCOL, Variant
from firable.decompose.protocol.wrong import WrongProtocol, example
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Formula, Holds, Or
from firable.nets.net import Net, Property, PropertyKind
from firable.nets.verdict import NOTHING, Status, Verdict, Weight, Witness

WALK_SECONDS_MAX: Final = 3.0
LINES_READ: Final = 40
"""How many lines of a run a person reads; of a longer one the end is told."""
LINES_READ_AT_ONCE: Final = 20
"""How many, where nothing shorter is looked for."""


@dataclass(frozen=True)
class Refutation:
    """What came of trying to refute a wrong protocol on one net.

    `status` is VIOLATED with a `witness` where it goes wrong, PROVED where it cannot on this net. `lines` tell the
    run, in which a round that nothing disturbs may be one; `sentence` says what does not hold at its end. `small` is
    the same on the small net of the wrong protocol, where this one has no run that a person reads.
    """

    wrong: WrongProtocol
    protocol: ProtocolNet
    status: Status
    method: str
    witness: Witness | None = None
    bound: str = ""
    small: Refutation | None = None
    folded: tuple[Line, ...] = ()

    @property
    def lines(self) -> tuple[Line, ...]:
        """The run as it is told; without rounds that are told as one, a line for each event."""
        return self.folded if self.folded or self.witness is None else told(self.witness, self.protocol)

    @property
    def events(self) -> tuple[str, ...]:
        """The run as what happens, in the words of who watches."""
        return () if self.witness is None else tuple(str(self.protocol.steps[t]) for (t,) in self.witness.firings)

    @property
    def outcome(self) -> str:
        """What came of it, in words; that a protocol cannot go wrong here does not make it right."""
        if self.status is Status.VIOLATED:
            return f"goes wrong here, after {_counted(self)}"
        needed = self.wrong.obligation
        cannot = f"cannot go wrong here: wrong all the same, but this net does not need {needed} yet, and an edit may"
        return cannot if self.status is Status.PROVED else "not decided here"

    @property
    def of_example(self) -> str:
        """What the run is of, where it is that of an example."""
        net = self.protocol.parts.net
        of = f" ({net.description})" if net.description else ""
        return f"on a small example, {net.name}, in its own names{of}, after {_counted(self)}"

    @property
    def sentence(self) -> str:
        """What does not hold at the end of the run; empty without one."""
        if self.witness is None:
            return ""
        marked = set(self.witness.marking)
        if ASTRAY in marked:
            return "something has fired that the central net cannot fire"
        names = [place.name for place in self.protocol.parts.net.places]
        wrong = [name for name in names if (name in marked) != (central(name) in marked)]
        told = ", ".join(f"{name} is {'full' if name in marked else 'empty'}" for name in wrong)
        return f"no order is on its way, and unlike in the central net {told}"

    @property
    def verdict(self) -> Verdict:
        """As a verdict, for information: it is on another protocol than the one that runs."""
        holds = {Status.PROVED: "cannot go wrong on this net", Status.VIOLATED: self.sentence}.get(self.status, "")
        return Verdict(
            f"wrong.{self.wrong.name}",
            self.status,
            f"the central net can follow a protocol in which {self.wrong.says} ({self.wrong.obligation})",
            self.method,
            Weight.INFORMATION,
            hint=holds,
            bound=self.bound,
            witness=None if self.witness is None else replace(self.witness, note=self.sentence),
        )


def refute(wrong: WrongProtocol, net: Net | Decomposition | None = None, limits: Limits | None = None) -> Refutation:
    """Try to refute a wrong protocol on a net, or on its own example.

    Raises the errors of `split`. Cost: that of 200,000 markings, of 60,000 for some dozens of foci, a walk of some
    seconds, and a diagram.

    >>> from firable.decompose.protocol.wrong import WRONG
    >>> found = refute(next(wrong for wrong in WRONG if wrong.name == "cached-gates"))
    >>> print(*found.events, sep="; ")
    guard fires open; press fires close, though in the central net guard.opened is full
    """
    of = example(wrong.example) if net is None else net
    decomposition = split(of) if isinstance(of, Net) else of
    if wrong.variant.of_free and not decomposition.free:
        decomposition = freed(decomposition)
    limits = limits or Limits()
    protocol = protocol_net(decomposition, wrong.variant, wrong.faults)
    try:
        graph = explore(protocol.net, budget=Budget(FIRST_MARKINGS, limits.memory_bytes), deadline=limits.deadline)
    except InputError as error:  # there is no room for the net itself
        return Refutation(wrong, protocol, Status.UNKNOWN, NOTHING, bound=error.diagnostics[0].message)
    graph = graph.until(NEVER)  # the markings that were found are looked at even if the time was over meanwhile
    witness = graph.witness(graph.satisfying(_goal(protocol)))
    if witness is not None and len(witness.firings) <= LINES_READ_AT_ONCE:
        return Refutation(wrong, protocol, Status.VIOLATED, graph.method, witness)
    if witness is None and graph.complete:
        return Refutation(wrong, protocol, Status.PROVED, graph.method)
    if witness is None and not wrong.faults and is_true_here(decomposition, wrong.variant):
        proof = prove_inductively(protocol_net(decomposition), limits.deadline.left_milliseconds)
        if all(map(proof.shows, (FOLLOWS, AGREES, FIT))):
            method = "z3, of an inductive invariant; what the protocol leaves out, this net has not"
            return Refutation(wrong, protocol, Status.PROVED, method)
    if (found := directed(protocol, _goal(protocol), limits)) is not None:
        return Refutation(
            wrong, protocol, Status.VIOLATED, "search among undisturbed rounds", found.witness, folded=found.lines
        )
    if witness is not None:
        return Refutation(wrong, protocol, Status.VIOLATED, graph.method, witness)
    walk = replace(limits, deadline=limits.deadline.within(WALK_SECONDS_MAX))
    if wrong.variant.acknowledged:
        apart = protocol_net(decomposition, replace(wrong.variant, one_round=True), wrong.faults)
        if (witness := decide_by_walk(apart.net, _goal(apart), walk).witness) is not None:
            return Refutation(wrong, apart, Status.VIOLATED, "random walk", witness)
    if (witness := decide_by_walk(protocol.net, _goal(protocol), walk).witness) is not None:
        return Refutation(wrong, protocol, Status.VIOLATED, "random walk", witness)
    return _in_diagram(wrong, protocol, _goal(protocol), limits, graph.bound)


def is_true_here(decomposition: Decomposition, variant: Variant) -> bool:
    """Whether a variant is the true protocol on this net, but for obeying blindly.

    Blindly or not is one, where orders fit. What else these variants leave out, they leave out of the parts, of their
    groups, or of what a promise excludes.
    """
    by_parts = replace(PROTOCOL, gate_copies=variant.gate_copies, lock=variant.lock, arbitrated=variant.arbitrated)
    if variant.of_free and not decomposition.free:
        variant = replace(variant, vote_rounds=True, order_rounds=True, of_free=False)
    if variant != replace(by_parts, common=variant.common, all_free=variant.all_free):
        return False
    its, true = Parts(decomposition, variant), Parts(decomposition, PROTOCOL)
    same = (its.coordinated, its.local, its.copies) == (true.coordinated, true.local, true.copies)
    if not same or {*map(frozenset, its.groups)} != {*map(frozenset, true.groups)}:
        return False
    every = [*(part for parts in its.coordinated.values() for part in parts), *its.local]
    return its.deciders == true.deciders and all(its.excluding(part) == true.excluding(part) for part in every)


def _goal(protocol: ProtocolNet) -> Formula:
    """The central net was left, or the controllers display another marking."""
    return Or((Holds(ASTRAY), And((protocol.at_rest, protocol.differs))))


def _counted(refutation: Refutation) -> str:
    lines, events = len(refutation.lines), len(refutation.events)
    return f"{events} events" if lines == events else f"{events} events, told in {lines} lines"


def _in_diagram(wrong: WrongProtocol, protocol: ProtocolNet, goal: Formula, limits: Limits, bound: str) -> Refutation:
    try:
        space = explore_symbolically(protocol.net, limits, orders=protocol.orders)
        verdict = decide_property(space, Property("refines", PropertyKind.NEVER, goal))
    except BudgetExceeded as error:
        return Refutation(wrong, protocol, Status.UNKNOWN, "decision diagram", bound=f"{bound}; {error}")
    return Refutation(wrong, protocol, verdict.status, verdict.method, verdict.witness, verdict.bound)


def readable(refutation: Refutation) -> Refutation:
    """The refutation, with that on the small net of the wrong protocol beside it where its own run cannot be read."""
    if refutation.witness is not None and len(refutation.lines) <= LINES_READ:
        return refutation
    return replace(refutation, small=refute(refutation.wrong))
