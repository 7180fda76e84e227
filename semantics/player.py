"""The reference player: plays tokens by the text of Eq. (1)-(4), under both disciplines.

Slow and obvious on purpose. Everything fast is held to it: the Rust engine by differential tests over all nets of a
small scope, the token players of the executor by the traces that it replays.

Interleaving: one transition fires at a time, external gates free. Synchronous step: all enabled transitions of one
valuation fire together, as far as they do not conflict; which maximal set is the arbiter's choice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from firable.nets.net import Marking, Net
from firable.semantics.algebra import BOOL
from firable.semantics.conflict import Conflicts, conflicts, gate_races, jointly_openable
from firable.semantics.firing import enabled, external_gates, firable, in_contact, next_token

FiringSet = tuple[int, ...]
"""Transitions fired together, as increasing indexes; a singleton under interleaving."""


def holds_in(marking: Marking) -> Callable[[int], bool]:
    """The marking as a function from the index of a place to whether it holds a token."""
    return lambda place: bool(marking >> place & 1)


class NotFirableError(ValueError):
    """A transition was told to fire where the firing rule forbids it."""


def _no_hurry() -> None:
    """Nobody waits."""


@dataclass(frozen=True)
class Player:
    """Plays the tokens of one net; markings are arguments and results, nothing is remembered.

    `tick` is called again and again by what may take exponentially long, the steps of a marking: whoever cannot wait
    raises there.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    >>> player = Player(net)
    >>> net.names(player.fire(net.initial_marking, player.firable(net.initial_marking)))
    ('q',)
    """

    net: Net
    tick: Callable[[], object] = field(default=_no_hurry, repr=False, compare=False)

    @cached_property
    def conflicts(self) -> Conflicts:
        """The conflict relation of the net."""
        return conflicts(self.net)

    def firable(self, marking: Marking) -> FiringSet:
        """The transitions that are firable by Eq. (1), whatever their external gates."""
        holds = holds_in(marking)
        return tuple(t for t in range(len(self.net.transitions)) if firable(BOOL, self.net, t, holds))

    def may_fire(self, marking: Marking) -> FiringSet:
        """The transitions that are firable and that some valuation opens: the firings of analysis, gates free."""
        return tuple(t for t in self.firable(marking) if self.net.transitions[t].openable)

    def enabled(self, marking: Marking, signals: Mapping[str, bool]) -> FiringSet:
        """The transitions that are firable and whose gates are open; a signal that is not given is 0."""
        holds = holds_in(marking)
        valuation = [bool(signals.get(signal.name, False)) for signal in self.net.signals]
        return tuple(
            t for t in range(len(self.net.transitions)) if enabled(BOOL, self.net, t, holds, valuation.__getitem__)
        )

    def in_contact(self, marking: Marking) -> FiringSet:
        """The transitions in contact: only a full output place keeps them from being firable."""
        holds = holds_in(marking)
        return tuple(t for t in range(len(self.net.transitions)) if in_contact(BOOL, self.net, t, holds))

    def fire(self, marking: Marking, transitions: Iterable[int]) -> Marking:
        """The marking after the transitions fire together (Eq. 3-4); external gates are the caller's matter.

        Raises `NotFirableError` where one of them is not firable or two of them conflict.
        """
        fired = frozenset(transitions)
        holds = holds_in(marking)
        for t in sorted(fired):
            if not firable(BOOL, self.net, t, holds):
                raise NotFirableError(f"'{self.net.transitions[t].name}' is not firable in {self._shown(marking)}")
            if len(fired) > 1 and (rivals := self.conflicts.rivals[t] & fired):
                names = sorted(self.net.transitions[u].name for u in (t, *rivals))
                raise NotFirableError(f"{', '.join(names)} conflict and cannot fire together")
        touched = {
            self.net.place_index[place]
            for t in fired
            for place in (*self.net.transitions[t].inputs, *self.net.transitions[t].outputs)
        }
        for place in touched:
            if next_token(BOOL, self.net, place, holds, fired.__contains__):
                marking |= 1 << place
            else:
                marking &= ~(1 << place)
        return marking

    def deadlocked(self, marking: Marking) -> bool:
        """Deadlock: no transition is firable and openable. A firable one whose gate is closed is only waiting."""
        return not self.may_fire(marking)

    def enabled_sets(self, marking: Marking) -> set[FiringSet]:
        """E(v) for every valuation v of the signals that matter at the marking, each set once."""
        candidates = self.may_fire(marking)
        names = sorted({gate.signal for t in candidates for gate in self.net.transitions[t].external})
        found = set()
        for bits in range(1 << len(names)):
            self.tick()
            valuation = {self.net.signal_index[name]: bool(bits >> i & 1) for i, name in enumerate(names)}
            found.add(tuple(t for t in candidates if external_gates(BOOL, self.net, t, valuation.__getitem__)))
        return found

    def maximal_steps(self, enabled_transitions: Iterable[int]) -> set[FiringSet]:
        """The maximal sets without conflict of the enabled transitions: what the arbiter may choose among."""
        found: set[FiringSet] = set()
        todo = [(frozenset[int](), frozenset(enabled_transitions), frozenset[int]())]
        while todo:  # Bron and Kerbosch's enumeration of maximal independent sets
            self.tick()
            chosen, candidates, excluded = todo.pop()
            if not candidates:
                if not excluded:
                    found.add(tuple(sorted(chosen)))
                continue
            t = min(candidates)
            rivals = self.conflicts.rivals[t]
            todo.append((chosen | {t}, candidates - rivals - {t}, excluded - rivals))
            todo.append((chosen, candidates - {t}, excluded | {t}))
        return found

    def steps(self, marking: Marking) -> set[FiringSet]:
        """The labels of the step graph at the marking: maximal sets over all valuations, the empty one left out."""
        return {
            step
            for enabled_transitions in self.enabled_sets(marking)
            for step in self.maximal_steps(enabled_transitions)
            if step
        }

    def is_step(self, marking: Marking, fired: Iterable[int]) -> bool:
        """Whether the transitions are one of `steps`, without trying all valuations of the signals.

        One valuation is searched for, by branching, that opens the gates of the set and closes a gate of every other
        transition that could fire with it.
        """
        candidates, chosen = self.may_fire(marking), frozenset(fired)
        if not chosen or not chosen <= set(candidates) or not jointly_openable(self.net, chosen):
            return False
        if not self.conflicts.free(chosen):
            return False
        valuation = {gate.signal: gate.wanted for t in chosen for gate in self.net.transitions[t].external}
        to_close = [
            tuple((gate.signal, not gate.wanted) for gate in self.net.transitions[t].external)
            for t in candidates
            if t not in chosen and not self.conflicts.rivals[t] & chosen
        ]
        return self._satisfiable(to_close, valuation)

    def successors(self, marking: Marking, *, step: bool = False) -> Iterator[tuple[FiringSet, Marking]]:
        """What may fire, and the marking after it, under either discipline."""
        labels: Iterable[FiringSet] = sorted(self.steps(marking)) if step else ((t,) for t in self.may_fire(marking))
        for label in labels:
            yield label, self.fire(marking, label)

    def reachable(self, *, step: bool = False) -> dict[Marking, list[tuple[FiringSet, Marking]]]:
        """The reachability graph from M0, breadth first: each marking with its outgoing edges.

        For small nets; `firable.analysis` explores large ones.
        """
        graph: dict[Marking, list[tuple[FiringSet, Marking]]] = {}
        todo = [self.net.initial_marking]
        seen = set(todo)
        for marking in todo:
            graph[marking] = list(self.successors(marking, step=step))
            for _, successor in graph[marking]:
                if successor not in seen:
                    seen.add(successor)
                    todo.append(successor)
        return graph

    def serialisable(self, step: Iterable[int]) -> bool:
        """Whether some order replays the step one by one: iff the gate races within it are acyclic."""
        return self.order_of(step) is not None

    def order_of(self, step: Iterable[int]) -> tuple[int, ...] | None:
        """An order that replays the step one by one, None where the gate races within it are cyclic."""
        remaining, order = set(step), list[int]()
        closed: dict[int, set[int]] = {}
        for t, u in gate_races(self.net, remaining):
            closed.setdefault(t, set()).add(u)
        while remaining:
            # The next to replay closes no gate of one that still has to fire.
            free = sorted(t for t in remaining if t not in closed or closed[t].isdisjoint(remaining))
            if not free:
                return None
            order += free
            remaining -= set(free)
        return tuple(order)

    def _shown(self, marking: Marking) -> str:
        return "{" + ", ".join(self.net.names(marking)) + "}"

    def _satisfiable(self, clauses: list[tuple[tuple[str, bool], ...]], valuation: dict[str, bool]) -> bool:
        """Whether a valuation that extends the given one makes a literal of every clause true."""
        self.tick()
        unmet = [c for c in clauses if not any(valuation.get(signal) is value for signal, value in c)]
        if not unmet:
            return True
        clause = min(unmet, key=len)
        more = ({**valuation, signal: value} for signal, value in clause if signal not in valuation)
        return any(self._satisfiable(unmet, one) for one in more)
