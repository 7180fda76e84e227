"""Short runs of a wrong protocol: most of the cell goes on undisturbed while a few parts are looked at closely.

A run that goes wrong in a cell is long because the cell has to be brought where it can, and what brings it there is
beside the point: rounds in which nothing is lost, late or refused. So they are taken whole. Of each transition there is
one *leap*, the steps of such a round one after the other made one transition of a smaller net: what the steps want of
places that they have not touched yet, and what they leave. A few parts are in *focus*, with every step of theirs; the
other parts of the same transition leap over each of their exchanges, a vote that is asked for, given and heard, or an
order that is sent, obeyed and acknowledged. Each run of such a net is a run of the protocol, step for step; what it
leaves out is found by other means (`refuting`). A leap is also one line to read: "G1 is fired, undisturbed".

The foci are tried from the closest: one part, all parts of a transition, those of two transitions that meet at a
controller. Each net is small, so breadth-first search finds the run with the fewest lines; of each kind of focus the
shortest is taken.

Rejected: shrinking the runs that random walks find, by leaving out what is not needed. What is not needed goes, and 150
events are needed. Best-first search by the distance of places knows nothing of rounds, and wanders in their middle.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Final

from firable.analysis.deadline import NEVER
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.spaces.space import Witnesses
from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.draft import CHANNELS, at, down, late
from firable.decompose.protocol.parts import Part
from firable.decompose.protocol.rounds import asked, committed
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula
from firable.nets.net import Net, Transition
from firable.nets.verdict import Witness
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 60_000
"""How many markings are looked at for one focus."""
FOCI_MAX: Final = 200
"""How many foci of a kind are tried: of a large net the first ones."""
FOCI_MORE: Final = 12
"""How many after one that has a run, for a shorter one."""

_KINDS: Final = (*CHANNELS, "noted", "heard", "obeyed", "promised", "stands", "counted")
"""The places of a part."""


@dataclass(frozen=True)
class Line:
    """One line of a run as it is told: so many events, and what they are in words."""

    events: int
    text: str
    leaps: bool = False


@dataclass(frozen=True)
class Directed:
    """A run that was found: as one of the protocol's net, event for event, and in lines."""

    witness: Witness
    lines: tuple[Line, ...]


def directed(protocol: ProtocolNet, goal: Formula, limits: Limits) -> Directed | None:
    """A run of the protocol to the goal in few lines; None where no focus has one, which shows nothing.

    Cost: that of `MARKINGS_MAX` markings for each of some dozens of foci.
    """
    search = Search(protocol, goal, limits)
    for foci in (search.single_parts(), search.single_transitions(), search.pairs()):
        best: Directed | None = None
        last = FOCI_MAX
        for i, focus in enumerate(foci):
            if limits.deadline.over or i == last:
                break
            found = search.run(focus)
            if found and (best is None or (len(found.lines), _events(found)) < (len(best.lines), _events(best))):
                best, last = found, min(last, i + FOCI_MORE)
        if best is not None:
            return best
    return None


def _events(found: Directed) -> int:
    return len(found.witness.firings)


@dataclass(frozen=True)
class _Leap:
    """Steps that are taken one after the other, as one transition of a smaller net."""

    transition: Transition
    steps: tuple[str, ...]
    text: str


class Search:
    """The smaller nets of the runs of one protocol to a goal."""

    def __init__(self, protocol: ProtocolNet, goal: Formula, limits: Limits) -> None:
        self.protocol, self.goal, self.limits = protocol, goal, limits
        self.coordinated = protocol.parts.coordinated
        self.acknowledged = protocol.variant.acknowledged

    # --- What is looked at closely

    def single_parts(self) -> Iterator[tuple[Part, ...]]:
        """One part at a time."""
        if self.acknowledged:  # in the bare skeleton a part has too few steps to leap over
            yield from ((part,) for its in self.coordinated.values() for part in its)

    def single_transitions(self) -> Iterator[tuple[Part, ...]]:
        """All parts of a transition."""
        yield from self.coordinated.values()

    def pairs(self) -> Iterator[tuple[Part, ...]]:
        """The parts at one controller of two transitions, in the bare skeleton all of their parts."""
        for its, others in combinations(self.coordinated.values(), 2):
            shared = {part.controller for part in its} & {part.controller for part in others}
            if shared:
                some = (*its, *others)
                yield some if not self.acknowledged else tuple(part for part in some if part.controller in shared)

    # --- The smaller net of a focus

    def run(self, focus: Sequence[Part]) -> Directed | None:
        """The run with the fewest lines among those with this focus."""
        steps = self.steps(focus)
        leaps = {leap.transition.name: leap for leap in self.leaps(focus)}
        places = self.protocol.net.places
        net = Net("focus", places, (*steps, *(leap.transition for leap in leaps.values())))
        budget = Budget(MARKINGS_MAX, self.limits.memory_bytes)
        try:
            graph = explore(net, budget=budget, deadline=self.limits.deadline).until(NEVER)
        except InputError:  # there is no room for the net itself
            return None
        found = graph.witness(graph.satisfying(self.goal))
        if found is None:
            return None
        names, lines = list[str](), list[Line]()
        for (name,) in found.firings:
            if name in leaps:
                names += leaps[name].steps
                lines.append(Line(len(leaps[name].steps), leaps[name].text, leaps=True))
            else:
                names.append(name)
                lines.append(Line(1, str(self.protocol.steps[name])))
        whole = self.protocol.net
        firings = [(whole.transition_index[name],) for name in names]
        reached = whole.marking(found.marking)
        return Directed(Witnesses(whole, Discipline.INTERLEAVING).replayed(firings, reached), tuple(lines))

    def steps(self, focus: Sequence[Part]) -> list[Transition]:
        """The steps that are taken one by one: those of the parts in focus, and what is of no part alone."""
        close, near = {part.whole for part in focus}, {(part.whole, part.controller) for part in focus}
        here = {part.controller for part in focus}
        kept = []
        for t in self.protocol.net.transitions:
            changed = (*t.inputs, *t.outputs)
            parts = {self.part_of[place] for place in changed if place in self.part_of}
            wholes = {self.whole_of[place] for place in changed if place in self.whole_of}
            alone = len(parts) == 1 and not wholes
            crashed = {self.down_of[place] for place in changed if place in self.down_of}
            if {whole for whole, _ in parts} | wholes <= close and (not alone or parts <= near) and crashed <= here:
                kept.append(t)
        return kept

    @cached_property
    def part_of(self) -> dict[str, tuple[str, str]]:
        """The part that each place belongs to which is of one part alone."""
        return {
            name: (part.whole, part.controller)
            for its in self.coordinated.values()
            for part in its
            for kind in _KINDS
            for name in (at(kind, part), late(at(kind, part)))
        }

    @cached_property
    def whole_of(self) -> dict[str, str]:
        """The transition that each place belongs to which tells how far its round is."""
        return {place: t for t in self.coordinated for place in (asked(t), committed(t))}

    @cached_property
    def down_of(self) -> dict[str, str]:
        """The controller that each place says of that it is down."""
        return {down(subnet.name): subnet.name for subnet in self.protocol.parts.decomposition.subnets}

    # --- Leaps

    def leaps(self, focus: Sequence[Part]) -> Iterator[_Leap]:
        """Every transition in a round of its own, and each exchange with a part beside those in focus."""
        yield from self.rounds
        near = {(part.whole, part.controller) for part in focus}
        for t in dict.fromkeys(part.whole for part in focus) if self.acknowledged else ():
            for part in self.coordinated[t]:
                if (t, part.controller) not in near:
                    yield from self.exchanges(part)

    @cached_property
    def rounds(self) -> tuple[_Leap, ...]:
        """Each coordinated transition, asked for, decided, obeyed and closed with nothing between."""
        found = (self.leap(f"round/{t}", self.round(t), f"{t} is fired, undisturbed") for t in self.coordinated)
        return tuple(leap for leap in found if leap)

    def round(self, t: str) -> list[str]:
        """The steps of such a round."""
        at_each = [f"{t}/{part.controller}" for part in self.coordinated[t]]
        if not self.acknowledged:
            index = self.protocol.net.transition_index
            voting = [name for name in (f"promise/{one}" for one in at_each) if name in index]
            return [*voting, f"decide/{t}", *(f"apply/{one}" for one in at_each)]
        steps = [f"ask/{t}"] if self.protocol.parts.promising(t) else []
        steps += [f"{step}/{t}/{p.controller}" for p in self.coordinated[t] for step in _voting(p)]
        steps.append(f"decide/{t}")
        steps += [f"{step}/{one}" for one in at_each for step in ("order-commit", "apply", "note")]
        group = self.protocol.parts.group_of[t]
        close = [f"close-round/{group}"] if len(self.protocol.parts.groups[group]) > 1 else []
        return [*steps, f"close/{t}", *close]

    def exchanges(self, part: Part) -> Iterator[_Leap]:
        """What is asked of a part, and told to it."""
        t, c = part.whole, part.controller
        asked_for = "gives" if part.free else "is asked for"
        for name, kinds, text in (
            ("yes", _voting(part), f"{c} {asked_for} its vote on {t}, and its yes arrives"),
            ("obeys", ("order-commit", "apply", "note"), f"{c} is ordered to fire its part of {t}, and obeys"),
        ):
            if leap := self.leap(f"{name}/{t}/{c}", [f"{kind}/{t}/{c}" for kind in kinds], text):
                yield leap
        for voted, promised in (("", "/unpromised"), ("", ""), ("/voted", "")):
            steps = [f"order-abort/{t}/{c}{voted}", f"release/{t}/{c}{promised}", f"note/{t}/{c}"]
            text = f"{c} is ordered to give up its part of {t}, and obeys"
            if leap := self.leap(f"gives-up/{t}/{c}{voted}{promised}", steps, text):
                yield leap

    def leap(self, name: str, steps: Sequence[str], text: str) -> _Leap | None:
        """Steps one after the other as one transition; None where they cannot follow each other."""
        net = self.protocol.net
        if not all(step in net.transition_index for step in steps):
            return None
        needs, now = dict[str, bool](), dict[str, bool]()
        for step in steps:
            t = net.transition(step)
            for places, full in (((*t.inputs, *t.permissive), True), ((*t.outputs, *t.inhibitive), False)):
                for place in places:
                    needs.setdefault(place, now.setdefault(place, full))
                    if now[place] != full:
                        return None
            now |= dict.fromkeys(t.inputs, False) | dict.fromkeys(t.outputs, True)
        every = ((True, False), (False, True), (True, True), (False, False))
        inputs, outputs, permissive, inhibitive = (_where(needs, now, *values) for values in every)
        return _Leap(Transition(f"leap/{name}", inputs, outputs, permissive, inhibitive), tuple(steps), text)


def _voting(part: Part) -> tuple[str, ...]:
    """The steps by which a part votes, and is heard."""
    return ("stand", "hear") if part.free else ("send-request", "promise", "hear")


def _where(needs: dict[str, bool], now: dict[str, bool], before: bool, after: bool) -> tuple[str, ...]:
    return tuple(place for place, full in needs.items() if full == before and now[place] == after)


def told(witness: Witness, protocol: ProtocolNet) -> tuple[Line, ...]:
    """The lines of a run that leaps over nothing."""
    return tuple(Line(1, str(protocol.steps[name])) for (name,) in witness.firings)


def numbered(lines: Iterable[Line]) -> Iterator[tuple[str, str]]:
    """Each line with the numbers of its events, and in words."""
    last = 0
    for line in lines:
        first, last = last + 1, last + line.events
        yield (f"{first}" if line.events == 1 else f"{first}-{last}"), line.text
