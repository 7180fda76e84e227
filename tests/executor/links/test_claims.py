"""Hosts that claim machines and answer each other, with everything that is said delivered in any order of senders."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.executor.links.claims import Claims, Said
from firable.executor.links.link import Arrival, Refusal, known_otherwise
from firable.executor.links.standing import Standing
from firable.executor.links.storages import Estranged, Memory, Met, Storage
from firable.executor.protocol.messages import Message
from firable.nets.diagnostics import Diagnostic


class Party:
    """A host, and what it was told."""

    def __init__(self, wires: Wires, number: int, names: tuple[str, ...], memory: Memory) -> None:
        self.wires = wires
        self.names = names
        self.session = f"p{number}"
        self.memory = memory
        self.before = memory
        """What it remembered when it was started."""
        self.connected_to: dict[str, Storage] = {}
        self.standing = Standing.GOING
        self.stand_still: dict[str, Standing] = {}
        """How the others stand, as it was told."""
        self.was_connected: list[str] = []
        self.disowned_by: set[str] = set()
        self.refusals: list[Diagnostic] = []
        self.claims = Claims(self, self.say)

    def say(self, session: str, said: Said | None) -> None:
        self.wires.tell(self, session, said)

    def arrived_together(self, messages: Sequence[Arrival]) -> None: ...

    def arrived(self, sender: str, receiver: str, message: Message, age: int) -> None: ...

    age = 0

    def connected(self, peer: str, storage: Storage) -> None:
        assert peer not in self.connected_to
        self.connected_to[peer] = storage
        self.was_connected.append(peer)
        self.memory = Memory(self.memory.storage, {peer: Met(storage.name), **self.memory.known})
        if self.wires.dice.random() < 0.5:  # something is heard of it
            began = storage.lives[-1].began if storage.lives else 0
            heard = Met(storage.name, storage.life, began + self.wires.dice.randrange(2))
            self.memory = Memory(self.memory.storage, {**self.memory.known, peer: heard})

    def lost(self, peer: str) -> None:
        del self.connected_to[peer]
        self.stand_still.pop(peer, None)

    def stands(self, peer: str, standing: Standing) -> None:
        assert peer in self.connected_to
        self.stand_still[peer] = standing

    def refused(self, peers: Sequence[str], why: Refusal) -> None:
        assert peers
        self.refusals.append(why.problem)

    def gone(self, peers: Sequence[str]) -> None:
        raise AssertionError(f"claims refuse {peers} by an answer, which is taken back")

    def disowned(self, peers: Sequence[str], why: Estranged) -> None:
        self.refusals.append(known_otherwise(why, peers))
        self.disowned_by.update(peers)


class Wires:
    """One from each host to each other one: what is said on it comes in its order, and to that of others in none."""

    def __init__(self, dice: random.Random) -> None:
        self.dice = dice
        self.started = 0
        self.parties: list[Party] = []
        self.wires: dict[tuple[str, str], deque[Callable[[], None]]] = {}
        self.standing: dict[tuple[str, str], Said] = {}
        """What each session was told last by another one, on its wire or heard."""

    def start(self, names: tuple[str, ...], memory: Memory) -> Party:
        self.started += 1
        party = Party(self, self.started, names, memory)
        for other in self.parties:
            if other.standing is not Standing.GOING:  # in any order with its claim
                self.wire(other, party).append(partial(party.claims.stands, other.session, other.standing))
        for other in self.parties:
            if not set(other.names) & set(names):  # or each is refused by the other, and not claimed
                for one, its in ((party, other), (other, party)):
                    self.wire(one, its).append(partial(its.claims.claimed, one.session, one.names, one.memory.storage))
        self.parties.append(party)
        return party

    def tell(self, by: Party, session: str, said: Said | None) -> None:
        to = next((party for party in self.parties if party.session == session), None)
        if to is None:
            return
        before = self.standing.pop((by.session, session), None)
        if before is not None:
            self.wire(by, to).append(partial(to.claims.answered, by.session, before, taken_back=True))
        if said is not None:
            self.standing[by.session, session] = said
            self.wire(by, to).append(partial(to.claims.answered, by.session, said))

    def stand(self, party: Party, standing: Standing) -> None:
        before, party.standing = party.standing, standing
        for other in self.parties:
            if other is not party and standing is not before:
                self.wire(party, other).append(partial(other.claims.stands, party.session, standing))

    def end(self, party: Party) -> None:
        self.parties.remove(party)
        for other in self.parties:
            self.wires.pop((other.session, party.session), None)
            last = [partial(other.claims.given_up, party.session)]
            if (said := self.standing.pop((party.session, other.session), None)) is not None:
                last.append(partial(other.claims.answered, party.session, said, taken_back=True))
            self.dice.shuffle(last)  # who tells of the end of a session tells in any order what ends with it
            self.wire(party, other).extend(last)

    def wire(self, by: Party, to: Party) -> deque[Callable[[], None]]:
        return self.wires.setdefault((by.session, to.session), deque())

    def deliver(self, most: int) -> None:
        for _ in range(most):
            busy = [wire for wire in self.wires.values() if wire]
            if not busy:
                return
            self.dice.choice(busy).popleft()()

    def all_delivered(self) -> None:
        self.deliver(10_000)
        assert not any(self.wires.values())


def fit(one: Party, other: Party) -> bool:
    """Whether neither knows the other by another or a later storage, and they do not run the same machine."""
    return not knows_otherwise(one, other) and not knows_otherwise(other, one) and not set(one.names) & set(other.names)


def knows_otherwise(one: Party, other: Party, *, when_started: bool = False) -> bool:
    """Whether what one remembers is against another one."""
    memory = one.before if when_started else one.memory
    return memory.estranged(other.names, other.before.storage) is not None


DICE = st.integers(0, 10**6).map(random.Random)
NAMES = st.sampled_from(["s0", "s1", "s2"])
MET = st.builds(Met, NAMES, st.sampled_from(["", "first", "another"]), st.integers(0, 2))
MEMORIES = st.lists(st.dictionaries(st.sampled_from(["a", "b", "c", "d"]), MET), min_size=3, max_size=3)


@examples(200)
@given(DICE, MEMORIES, st.lists(st.integers(0, 8), min_size=1, max_size=6))
def test_hosts_of_different_machines_end_connected_exactly_if_none_knows_another_otherwise(
    dice: random.Random, memories: list[dict[str, Met]], pauses: list[int]
) -> None:
    """Whatever is delivered first, and however often they were ended and started again meanwhile."""
    wires, all_names = Wires(dice), (("a", "b"), ("c",), ("d",))
    storages = [Storage(f"s{i}").in_new_life("first", 0).in_new_life("second", 1) for i in range(3)]
    now = [wires.start(names, Memory(storages[i], memories[i])) for i, names in enumerate(all_names)]
    for pause in pauses:
        wires.deliver(pause)
        number = dice.randrange(3)
        wires.stand(dice.choice(now), dice.choice(list(Standing)))
        wires.end(now[number])
        wires.deliver(dice.randrange(4))
        storages[number] = storages[number].in_new_life(f"life {wires.started}", dice.randrange(3))
        now[number] = wires.start(now[number].names, replace(now[number].memory, storage=storages[number]))
    wires.all_delivered()
    for one in now:
        for other in now:
            if one is not other:
                is_connected = {name in one.connected_to for name in other.names}
                assert is_connected == {fit(one, other)}
                if fit(one, other):
                    assert {one.stand_still.get(name, Standing.GOING) for name in other.names} == {other.standing}
                estranged = knows_otherwise(other, one, when_started=True)
                if estranged and not knows_otherwise(one, other, when_started=True):
                    assert one.disowned_by >= set(other.names)
                    assert other.refusals


@examples(100)
@given(DICE, st.integers(0, 12))
def test_of_two_hosts_with_a_machine_in_common_one_is_connected_and_the_other_when_that_is_gone(
    dice: random.Random, most: int
) -> None:
    """And nothing of the other one is connected, nor remembered, before."""
    wires = Wires(dice)
    centre = wires.start(("c",), Memory(Storage("s0")))
    one, both = wires.start(("a",), Memory(Storage("s1"))), wires.start(("a", "b"), Memory(Storage("s1")))
    wires.deliver(most)
    wires.all_delivered()
    (heard,) = [party for party in (one, both) if party.connected_to]
    (other,) = [party for party in (one, both) if party is not heard]
    assert centre.connected_to.keys() == set(heard.names)
    assert centre.memory.known.keys() == set(heard.names)
    assert centre.was_connected == list(heard.names)
    assert not other.was_connected
    assert {problem.message for problem in other.refusals} == {"'a' is run by two hosts"}
    wires.end(heard)
    wires.all_delivered()
    assert centre.connected_to.keys() == set(other.names)
    assert other.connected_to.keys() == {"c"}


@examples(50)
@given(DICE)
def test_a_host_that_is_refused_for_one_machine_is_never_known_by_another(dice: random.Random) -> None:
    wires = Wires(dice)
    centre = wires.start(("c",), Memory(Storage("s0"), {"b": Met("s1")}))
    stranger = wires.start(("a", "b"), Memory(Storage("s2")))
    wires.all_delivered()
    assert not centre.was_connected
    assert not stranger.was_connected
    assert centre.memory.known == {"b": Met("s1")}
    assert stranger.disowned_by == {"c"}
