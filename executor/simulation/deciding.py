"""A coordinator explored alone, group by group, in the widest surroundings that the proof of the protocol leaves it.

What a coordinator knows of one group of transitions, its rounds and the votes of its free parts, and what it does about
it, has nothing to do with the other groups, but for three things: a round may keep another one from being opened, no
message says that a round is closed which is not, and whose end is awaited is needed by any of them. So each group is
explored on its own, to the end, with `hearing` for what may arrive, any number of restarts with what stable storage
holds, and rounds given up at any time; and what else there is (`Setting`) is put before each act and taken away behind
it: whom everybody has hinted at, so that rounds are opened, and a round of each other group, in each of its stages,
older or newer. That what a coordinator does in any run of the cell it does here, to one group after the other, rests
on two things that are not proved: that groups have nothing else to do with each other, and that one other round at a
time is as good as several.

The first is checked at acts, on the code itself, each in one setting and not in all:

- an act about the group leaves a round beside it as it was, and does to the group what it does without that round, or
  what it does when nothing is opened;
- an act that opens rounds is the act that opens none, and then their opening (each act is compared with one setting
  in turn).

What is not told apart behind an act is what every act meets in every way: hints and who waits; whose turn it is (an
arbiter decides behind each last one); what was heard last, and of whom in this epoch (to repeat is tried with both);
how often it has restarted. Nor is it told apart which of several controllers is known for what, where they take part in
the same transitions in the same way, nor who voted first (symmetry: Emerson and Sistla, Formal Methods in System Design
9, 1996). Names are keys to a coordinator, and no more; tests hold what follows from each message to what follows with
two of them exchanged. Other groups tell such controllers apart, so that a comparison in a setting is made for one order
of them.

Rejected: all groups at once, which is all interleavings of independent rounds again; and to let a coordinator hear only
what controllers told in runs, which are some.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Decision,
    Effect,
    Firing,
    ToCoordinator,
    VoteRequest,
)
from firable.executor.simulation.alone import OneMachine
from firable.executor.simulation.hearing import Hearing, Setting, placed, with_hints
from firable.executor.simulation.numbering import Kept
from firable.executor.simulation.repertoire import Configuration, Step
from firable.executor.simulation.snapshots import clone, frozen
from firable.nets.decomposition import Decomposition


class FrameError(AssertionError):
    """Groups have more to do with each other than is taken for granted."""


class Deciding(OneMachine):
    """Explores one coordinator of a decomposition, about one of its groups."""

    def __init__(
        self, decomposition: Decomposition, name: str, group: int, *, coordinator: type[Coordinator] = Coordinator
    ) -> None:
        super().__init__(decomposition, name, coordinator=coordinator)
        self.hearing = Hearing(Coordinator(decomposition, name), group)
        self.group = self.hearing.group
        self.spread.has_room_before_all = True
        self.in_turn = cycle(self.hearing.settings)
        self.compared = 0
        """So many acts were compared with what they are in another setting."""

    def happenings(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen to the coordinator, and where it leads, with all that it knows then."""
        which, number = self.which, self.spread_out(at.machines[self.which])
        at = self.at(number, at, at.jobs)
        machine = self.coordinator(number)
        for message in self.hearing.messages(machine):
            yield from self._in_all_turns(at, message)
            if (waiting := self.hearing.kept_waiting) is not None:
                yield from self._in_all_turns(self.at(self._placed(number, waiting), at, at.jobs), message)
                self._compare(number, message, next(self.in_turn))
        for setting in self.hearing.settings:
            there = self.at(self._placed(number, setting), at, at.jobs)
            idle = with_hints(self.hearing.idle(machine), machine, setting, self.group)
            yield from self._in_all_turns(there, idle)
        yield from self._does(at, "give up", which, None, lambda m: [*m.permit(0), *m.permit(None)])
        for heard in (True, False):
            told = self.at(self._heard(number, is_heard=heard), at, at.jobs)
            yield from self._does(told, "repeat", which, heard, lambda m: m.resend())
        if at.budget.crashes:
            yield self._crashes(at, which, at, number, ())

    def _in_all_turns(self, at: Configuration, message: ToCoordinator) -> Iterator[tuple[Step, Configuration]]:
        """The message arrives, whatever its arbiter has chosen last, where it chooses."""
        has_chosen = False
        for step, after in self._arrives(at, message):
            has_chosen |= any(isinstance(effect, Firing) for effect in step.effects)
            yield step, after
        for last in self.lasts if has_chosen else ():
            number = self._changed(at.machines[self.which], ("last", last), partial(_turn, last))
            yield from self._arrives(self.at(number, at, at.jobs), message)

    @property
    def lasts(self) -> Iterable[int]:
        """The transitions of the group, by their indexes, where an arbiter has a choice."""
        return [self.net.transition_index[t] for t in self.group] if len(self.group) > 1 else []

    # --- What is not told apart

    def likened(self, number: int) -> Iterator[int]:
        """The coordinator with nothing of other groups, and its controllers that are alike in one order."""
        yield self._changed(number, "likened", self._likened)

    def _likened(self, machine: Coordinator, kept: Kept) -> None:
        self._group_alone(machine, kept)
        for alike in self.hearing.alike:
            in_order(machine, alike)

    def _group_alone(self, machine: Coordinator, kept: Kept) -> None:
        machine.arbiter.last = -1
        machine.waiting = {}
        for c, names in machine.ready.items():
            machine.ready[c] = frozenset(t for t in names if t in self.group and c in machine.free[t])
        machine.seen = dict.fromkeys(machine.seen, 0)
        machine.lately = dict.fromkeys(machine.lately, True)
        others = [n for n, opened in machine.rounds.items() if opened.transitions[0] not in self.group]
        for n in others:
            del machine.rounds[n]
            kept.pop(f"round/{n}", None)
        if machine.epoch > 1:
            _restart_once(machine, kept)

    # --- What else there is

    def _placed(self, number: int, setting: Setting) -> int:
        def change(machine: Coordinator, kept: Kept) -> None:
            placed(machine, setting, self.group)
            for n, opened in machine.rounds.items():
                if opened.committed is not None:
                    kept[f"round/{n}"] = (opened.committed, *opened.transitions)

        return self._changed(number, setting, change)

    def _heard(self, number: int, *, is_heard: bool) -> int:
        def change(machine: Coordinator, kept: Kept) -> None:
            del kept
            machine.seen = dict.fromkeys(machine.seen, 0 if is_heard else -1)
            machine.lately = dict.fromkeys(machine.lately, is_heard)

        return self._changed(number, ("heard", is_heard), change)

    def _compare(self, number: int, message: ToCoordinator, setting: Setting) -> None:
        """Compare an act with what it is in a setting: first itself, and then what that setting opens."""
        self.compared += 1
        machine = self.coordinator(number)
        alone, said = self._received(number, message)
        hinting = with_hints(message, machine, setting, self.group)
        together, said_together = self._received(self._placed(number, setting), hinting)
        outcomes = [(alone, said)]
        opens = any(isinstance(e, VoteRequest | Decision) and e.round >= machine.next_round for e in said)
        if opens and (waiting := self.hearing.kept_waiting) is not None:
            outcomes.append(self._received(self._placed(number, waiting), message))
        own = tuple(t for t in setting.hinted if t in self.group)
        for hinted in dict.fromkeys((setting.hinted, own)):  # others may not be enabled any more
            then = Setting(hinted)
            idle = with_hints(self.hearing.idle(machine), machine, then, self.group)
            opened, said_then = self._received(self._placed(alone, then), idle)
            outcomes.append((opened, (*said, *said_then)))
        beside = self._others(self._placed(number, setting))
        mine = self._mine(together, said_together, machine.next_round, beside)
        if not any(mine == self._mine(each, words, machine.next_round, beside) for each, words in outcomes):
            raise FrameError(f"{message} of {self.group} is not what it is alone, where there is {setting}")
        if setting.beside is not None and not self._is_untouched(number, together, setting):
            raise FrameError(f"{message} of {self.group} changes a round of another group: {setting}")

    def _received(self, number: int, message: ToCoordinator) -> tuple[int, tuple[Effect, ...]]:
        return self.act(number, ("arrive", message), lambda machine: machine.receive(message))

    def _mine(self, number: int, effects: Sequence[Effect], opened_from: int, beside: set[int]) -> object:
        """What is compared of an act: all but what other groups have to do with.

        Those are what is closed, and how many of their rounds are opened before one of the group.
        """
        others = beside | self._others(number)
        machine = self.coordinator(self._changed(number, "group alone", self._group_alone))
        numbers = {n for n in machine.rounds if n >= opened_from}
        numbers |= {e.round for e in effects if isinstance(e, VoteRequest | Decision) and e.round >= opened_from}
        new = {n: opened_from + i for i, n in enumerate(sorted(numbers - others))}
        rounds = [replace(opened, number=new.get(n, n)) for n, opened in sorted(machine.rounds.items())]
        votes = {c: names for c, names in machine.ready.items() if names}
        said: set[Effect] = set()
        for effect in effects:
            match effect:
                case VoteRequest() | Decision() if effect.round not in others:
                    said.add(replace(effect, round=new.get(effect.round, effect.round), closed_below=0, seen=0))
                case Firing(transition) if transition in self.group:
                    said.add(effect)
        return frozen(rounds), frozen(votes), machine.permits, machine.arbiter.turns, frozenset(said)

    def _others(self, number: int) -> set[int]:
        """The rounds of other groups."""
        rounds = self.coordinator(number).rounds
        return {n for n, opened in rounds.items() if opened.transitions[0] not in self.group}

    def _is_untouched(self, number: int, after: int, setting: Setting) -> bool:
        there = self._placed(number, setting)
        before, now = self.coordinator(there).rounds, self.coordinator(after).rounds
        return all(n in now and frozen(now[n]) == frozen(before[n]) for n in self._others(there))

    # --- Machines

    def _changed(self, number: int, key: object, change: Any) -> int:
        """The coordinator with something changed that is no act of it."""
        if (known := self.acts.get((number, key))) is None:
            machine, kept = clone(self.machines[number].machine), dict(self.machines[number].kept)
            change(machine, kept)
            known = self.acts[number, key] = (self._number(machine, kept), ())
        return known[0]

    def coordinator(self, number: int) -> Coordinator:
        """A coordinator, to look at."""
        machine = self.machine(number)
        if not isinstance(machine, Coordinator):
            raise TypeError(f"{machine.name!r} is no coordinator")
        return machine


def in_order(machine: Coordinator, alike: Sequence[str]) -> None:
    """Change controllers that are alike for each other, so that what is known of them comes in one order."""

    def known(c: str) -> tuple[object, ...]:
        of_rounds = ((c in each.acknowledged, c in each.votes, sorted(each.votes.get(c, ()))) for each in rounds)
        return sorted(machine.ready[c]), *of_rounds

    rounds = list(machine.rounds.values())
    called = dict(zip(sorted(alike, key=known), alike, strict=True))
    machine.ready |= {called[c]: machine.ready[c] for c in alike}
    for each in rounds:
        each.acknowledged = {called.get(c, c) for c in each.acknowledged}
        votes = {called.get(c, c): vote for c, vote in each.votes.items()}
        each.votes = {c: votes[c] for c in each.participants if c in votes}


def _turn(last: int, machine: Coordinator, kept: Kept) -> None:
    del kept
    machine.arbiter.last = last


def _restart_once(machine: Coordinator, kept: Kept) -> None:
    """Number the rounds of a coordinator that has restarted often as if it had done so once."""
    latest = machine.epoch << EPOCH_BITS
    before = {
        n: machine.first_round + i * machine.stride for i, n in enumerate(n for n in machine.rounds if n < latest)
    }

    def first(epoch: int) -> int:
        begin = epoch << EPOCH_BITS
        return begin + (machine.first_round - begin) % machine.stride

    def renumbered(n: int) -> int:
        return before[n] if n in before else n - first(machine.epoch) + first(1)

    for opened in machine.rounds.values():
        opened.number = renumbered(opened.number)
    machine.rounds = {opened.number: opened for opened in machine.rounds.values()}
    machine.next_round = renumbered(machine.next_round)
    for key in [key for key in kept if key.startswith("round/")]:
        value = kept.pop(key)
        kept[f"round/{renumbered(int(key.partition('/')[2]))}"] = value
    kept["epoch"] = machine.epoch = 1
