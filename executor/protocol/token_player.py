"""The token player: Eq. (1)-(2) of one net compiled to two masks a transition, for the machine that fires.

Places and signals of a net share one integer, the *word*: bit i is place i, bit n + j is signal j of a net of n places.
A transition is enabled iff all bits of `needs` are set and none of `forbids`; it fires by clearing and setting bits.
The completion signal of a command, and its timer, are cleared in the same act in which the token enters the place
(SEMANTICS, "Completion gates"), so for the protocol they are more things that a transition writes, and a gate one more
that it reads. Who clears a signal does not read it: two commands that one signal completes do not disturb each other by
it, for cleared twice is cleared.

This is a compiled copy of the rule, not the rule: `firable.semantics.firing` is, and the tests hold the copy to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Final, Self

from firable.executor.protocol.enabled import Literal, bits_behind, first_behind, literal
from firable.executor.protocol.stored_word import Piece, pieces_of
from firable.nets.bits import bits
from firable.nets.decomposition import ArbitrationGroup
from firable.nets.net import Marking, Net, Place, SignalKind
from firable.semantics.arbitration import Arbitration, Group, Turns
from firable.semantics.conflict import conflicts

Word = int
"""A marking and a valuation of the signals, as bits."""


@dataclass(frozen=True, slots=True)
class Entered:
    """A place with a command, the signals that a token clears when it enters, with their bits, and its own bit."""

    place: Place
    cleared: tuple[tuple[str, Word], ...]
    bit: Word


@dataclass(frozen=True, slots=True)
class SignalAt:
    """The bit of a signal, the steps that clear it and set it, and the piece in which stable storage holds it."""

    bit: Word
    steps: tuple[tuple[Literal, ...], tuple[Literal, ...]]
    pieces: tuple[Piece, ...]

    @classmethod
    def of(cls, position: int) -> Self:
        """That of the bit at a position."""
        falls, rises = (literal(position, value=value) for value in (False, True))
        return cls(1 << position, ((falls,), (rises,)), pieces_of([position]))


@dataclass(frozen=True, slots=True)
class Compiled:
    """One transition over words."""

    name: str
    needs: Word
    forbids: Word
    takes: Word
    puts: Word
    clears: Word
    openable: bool
    """Whether some valuation of the signals opens its external gates."""
    lowest: int
    """The position of the lowest place that changes."""
    moved: Word
    """The places that change, from that one on."""
    step: tuple[Literal, ...]
    """Bit by bit, what `fire` does."""
    pieces: tuple[Piece, ...]
    """The pieces in which stable storage holds what it writes."""
    entered: tuple[Entered, ...]
    """The places with a command that it puts a token on, in the order of the net."""

    @property
    def writes(self) -> Word:
        """The places that change and the completions and timers that are cleared."""
        return self.takes | self.puts | self.clears

    @property
    def reads(self) -> Word:
        """The places that it moves tokens of, and the sources of gates, internal and external."""
        return self.needs | self.forbids

    def enabled(self, word: Word) -> bool:
        """Eq. (1) and (2): firable, and every external gate open."""
        return word & self.needs == self.needs and not word & self.forbids

    def firable(self, word: Word, places: Word) -> bool:
        """Eq. (1) alone; `places` masks the bits of the places."""
        return word & self.needs & places == self.needs & places and not word & self.forbids & places

    def fire(self, word: Word) -> Word:
        """Eq. (3)-(4) where it is firable, and the completions and timers of the places entered cleared."""
        fired = word ^ self.moved << self.lowest  # few operations, and few bits to be fetched: a word may be wide
        return fired ^ fired & self.clears if self.clears else fired

    def disturbs(self, writes: Word, reads: Word) -> bool:
        """Whether firing could change what another reads, or reads what another will write (O1)."""
        return bool(self.writes & reads or self.reads & writes)


@lru_cache(256)
def _compiled(net: Net) -> dict[str, Compiled]:
    """The transitions of a net, compiled once: each start of a machine asks for them again."""
    signal_bit = {signal.name: 1 << len(net.places) + j for j, signal in enumerate(net.signals)}
    order = net.place_index.__getitem__
    commanding = {
        place.name: Entered(place, tuple((s, signal_bit[s]) for s in place.cleared), 1 << order(place.name))
        for place in net.places
        if place.command
    }
    compiled = {}
    for t, transition in enumerate(net.transitions):
        masks = net.masks[t]
        opening = sum({signal_bit[gate.signal] for gate in transition.external if gate.wanted})
        closing = sum({signal_bit[gate.signal] for gate in transition.external if not gate.wanted})
        moves = masks.inputs | masks.outputs
        lowest = next(bits(moves), 0)
        cleared = {signal for place in transition.outputs for signal in net.place(place).cleared}
        clears = sum(signal_bit[name] for name in cleared)
        compiled[transition.name] = Compiled(
            transition.name,
            needs=masks.inputs | masks.permissive | opening,
            forbids=masks.outputs | masks.inhibitive | closing,
            takes=masks.inputs,
            puts=masks.outputs,
            clears=clears,
            openable=transition.openable,
            lowest=lowest,
            moved=moves >> lowest,
            step=(
                *(literal(bit, value=False) for bit in bits(masks.inputs | clears)),
                *(literal(bit, value=True) for bit in bits(masks.outputs)),
            ),
            pieces=pieces_of(bits(moves | clears)),
            entered=tuple(commanding[p] for p in sorted(transition.outputs, key=order) if p in commanding),
        )
    return compiled


@dataclass(frozen=True)
class TokenPlayer:
    """The compiled transitions of a net, by name in the order of the net."""

    net: Net
    transitions: Mapping[str, Compiled]
    places: Word
    """The bits of the places."""

    @classmethod
    def of(cls, net: Net) -> Self:
        """Compile a net."""
        return cls(net, _compiled(net), (1 << len(net.places)) - 1)

    def marking(self, word: Word) -> Marking:
        """The marking in the word."""
        return word & self.places

    def signal_bit(self, signal: str) -> Word:
        """The bit of a signal; `KeyError` where there is none."""
        return self.signal_bits[signal]

    @cached_property
    def signal_bits(self) -> dict[str, Word]:
        """The bit of each signal."""
        return {signal.name: 1 << len(self.net.places) + j for j, signal in enumerate(self.net.signals)}

    @cached_property
    def signals(self) -> dict[str, SignalAt]:
        """Where each signal is in a word."""
        first = len(self.net.places)
        return {signal.name: SignalAt.of(first + j) for j, signal in enumerate(self.net.signals)}

    @cached_property
    def completing(self) -> Word:
        """The bits of the completion signals."""
        return sum(self.signal_bits[s.name] for s in self.net.signals if s.kind is SignalKind.COMPLETION)


class Arbiter:
    """Chooses one of the enabled transitions at a time, by the arbitration groups it has to decide.

    Interleaving fires one transition at a time, so a maximal set without conflict is chosen as a sequence of single
    choices, each made on the transitions enabled then. Where no conflict decides, the first behind the last winner is
    taken, so that a transition that is always enabled does not keep others from their turn.
    """

    def __init__(self, net: Net, groups: Iterable[ArbitrationGroup]) -> None:
        index = net.transition_index
        self.net = net
        self.arbitration = Arbitration(
            conflicts(net),
            tuple(
                Group(g.name, tuple(index[t] for t in g.sequence), tuple(index[t] for t in g.rest), g.by)
                for g in groups
            ),
        )
        self.turns: Turns = self.arbitration.first_turns
        self.last = -1
        self.rivals = tuple(sum(1 << t for t in component) for component in self.arbitration.conflicts.components)
        self.group_of = MappingProxyType(
            {t: g for g, group in enumerate(self.arbitration.groups) for t in group.sequence}
        )
        """The group in whose turns a transition has a place."""

    def choose(self, enabled: Iterable[str]) -> str:
        """The one transition to fire now; `enabled` must not be empty."""
        chosen = self.following(sum(1 << self.net.transition_index[name] for name in enabled))
        if chosen is None:
            raise ValueError("nothing is enabled that is arbitrated here")
        return self.net.transitions[chosen].name

    def following(self, enabled: int, is_free: Callable[[int], bool] | None = None) -> int | None:
        """The transition to fire now, by its index, of the mask of those enabled as far as they are free to fire.

        It is the first behind the last winner that its arbiter grants; only its own rivals are looked at.
        """
        if is_free is None:
            if enabled < _WIDE and not enabled & (enabled - 1):  # one alone has no rivals
                if enabled:
                    self.last = enabled.bit_length() - 1
                    return self.last
                return None
            t = first_behind(enabled, self.last)
            if self.arbitration.conflicts.component_of[t] < 0 or self._is_granted(t, enabled, _anybody):
                self.last = t  # mostly it is that one
                return t
            is_free = _anybody
        for t in bits_behind(enabled, self.last):
            if is_free(t) and self._is_granted(t, enabled, is_free):
                self.last = t
                return t
        return None

    def _is_granted(self, t: int, enabled: int, is_free: Callable[[int], bool]) -> bool:
        component = self.arbitration.conflicts.component_of[t]
        if component < 0:
            return True
        rivals = enabled & self.rivals[component]
        if rivals == 1 << t:
            return True
        candidates = frozenset(u for u in bits(rivals) if u == t or is_free(u))
        if len(candidates) == 1:
            return True
        if t not in self.arbitration.decide(candidates, self.turns)[0]:
            return False
        if (g := self.group_of.get(t)) is not None:
            turn = self.arbitration.turn_after(g, {t}, candidates, self.turns[g])
            self.turns = (*self.turns[:g], turn, *self.turns[g + 1 :])
        return True


_WIDE: Final = 1 << 1024
"""A mask from here on takes longer to be looked at whole than the first of it to be found."""


def _anybody(_: int) -> bool:
    return True
