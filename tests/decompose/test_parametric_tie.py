"""The protocol as a net, which is explored, and the protocol that is proved for any size are one protocol.

Every marking that the protocol net of a small net reaches is told in the relations of the proof: the invariant must
hold of it. And every firing of the protocol net must be some actions of the proof, or leave everything as it is that
the proof speaks of: a message sent, lost, doubled, ignored, a crash, a restart.

The net has one round for each group and forgets it at its close; so a round stands here for the present one of its
group, and what a decided round leaves of votes, which nobody looks at any more, is not compared. Of a transition whose
parts are all free of promise the net asks nobody: it is asked for when it is decided.
"""

from __future__ import annotations

from collections import Counter
from functools import cache

import pytest
from support.abstraction import broken, differences, explain, net_structure, of_coordinators, with_relations
from support.examples import FACTOR
from support.finite_structures import Structure, Thing
from support.free_parts import GATE_CLOSED, OUTPUT_READ, freed, parts_of
from support.reference import load_net

from firable.decompose.protocol.building import ProtocolNet, protocol_net
from firable.decompose.protocol.draft import ASTRAY, CHANNELS, Step, at, central
from firable.decompose.protocol.parametric.system import PROTOCOL as PROVED
from firable.decompose.protocol.parts import Part
from firable.decompose.protocol.rounds import committed, decided, is_open
from firable.decompose.protocol.variant import NO_FAULTS, ONE_OF_EACH, PROTOCOL, Faults, Lock, Variant
from firable.decompose.splitting.cut import split
from firable.executor.protocol.deciders import coordinator_at
from firable.nets.decomposition import Decomposition
from firable.semantics.player import Player

Key = tuple[Thing, ...]

SILENT = frozenset({"request", "repeat", "order", "ignore", "lose", "double", "late", "crash", "restart"})
"""The kinds of steps by which nothing changes that the proof speaks of."""


class Told:
    """A protocol net, told in the relations of the proof."""

    def __init__(self, built: ProtocolNet) -> None:
        self.built, self.parts = built, built.parts
        decomposition, groups = self.parts.decomposition, range(len(self.parts.groups))
        deciders = {row.name: coordinator_at(row.at) for row in decomposition.coordinated}
        whose: dict[Thing, str] = {g: deciders[self.parts.groups[g][0]] for g in groups}
        self.structure = of_coordinators(net_structure(decomposition, (), signals=False), whose)
        self.actions: Counter[str] = Counter()
        self.configuration = cache(self._configuration)
        self.broken = cache(self._broken)
        self.step = cache(self._step)

    def _configuration(self, relevant: frozenset[str]) -> Structure:
        """The configuration in which just these places hold a token."""
        rounds = self.parts.group_of
        all_parts = [(t, part) for t, its in self.parts.coordinated.items() for part in its]

        def of_parts(kind: str) -> set[Key]:
            return {(rounds[t], t, part.controller) for t, part in all_parts if at(kind, part) in relevant}

        asked_for = {(rounds[t], t) for t in rounds if is_open(self.parts, t) in relevant}
        over = {(rounds[t],) for t in rounds if decided(self.parts, t) in relevant}
        commits = {(rounds[t], t) for t in rounds if committed(t) in relevant}
        promising = [(t, part) for t, part in all_parts if not part.free]
        request = {(rounds[t], t, part.controller) for t, part in promising if (rounds[t], t) in asked_for}
        commit_order = {(rounds[t], t, part.controller) for t, part in all_parts if (rounds[t], t) in commits}
        promised, obeyed = of_parts("promised"), of_parts("obeyed")
        places = [place.name for place in self.parts.net.places]
        return with_relations(
            self.structure,
            marked=[(p,) for p in places if p in relevant],
            shadow=[(p,) for p in places if central(p) in relevant],
            begun={(g,) for g, _ in asked_for} | over,
            asked=asked_for,
            decided=over,
            committed=commits,
            request=request,
            promised=promised,
            vote=promised,
            heard={key for key in of_parts("heard") & request if (key[0],) not in over},
            stands={(t, part.controller) for t, part in all_parts if part.free and at("stands", part) in relevant},
            obeyed=obeyed,
            noted=of_parts("noted"),
            commit_order=commit_order,
            abort_order={key for key in request if (key[0],) in over and key[:2] not in commits},
            acknowledgement=(request | commit_order) & obeyed,
        )

    def _broken(self, relevant: frozenset[str]) -> list[str]:
        return broken(self.configuration(relevant))

    def relevant(self, names: frozenset[str]) -> frozenset[str]:
        """The places among these that a configuration depends on."""
        return frozenset(
            name for name in names if name.partition("/")[0] not in {*CHANNELS, "late", "down", "may-happen"}
        )

    def on_their_way(self, names: frozenset[str]) -> None:
        """What is on its way was sent."""
        configuration = self.configuration(self.relevant(names))
        for t, its in self.parts.coordinated.items():
            for part in its:
                key = (self.parts.group_of[t], t, part.controller)
                over = (key[0],) in configuration.relations["decided"]
                if part.free:
                    self._vote_is_standing(names, part, configuration)
                    continue
                for channel in CHANNELS:
                    if at(channel, part) in names and not (channel == "vote" and over):
                        assert key in configuration.relations[channel], f"{channel} of {key}"

    def _vote_is_standing(self, names: frozenset[str], part: Part, configuration: Structure) -> None:
        """A yes on its way, or heard, stands; on its way it may be one that an order has used up in this round."""
        key = (self.parts.group_of[part.whole], part.whole, part.controller)
        stands = key[1:] in configuration.relations["stands"]
        assert stands or at("vote", part) not in names or key in configuration.relations["obeyed"], f"vote of {key}"
        if at("heard", part) in names:
            assert stands, f"a vote that does not stand is heard of {key}"
            assert key[:2] not in configuration.relations["committed"], f"a vote that is used up is heard of {key}"
        for channel in ("commit-order", "acknowledgement"):
            assert at(channel, part) not in names or key in configuration.relations[channel], f"{channel} of {key}"

    def _step(self, name: str, before: frozenset[str], after: frozenset[str]) -> None:
        step: Step = self.built.steps[name]
        old, new = self.configuration(before), self.configuration(after)
        if step.kind in SILENT or before == after:
            assert differences(old, new) == [], name
        elif step.kind == "close":
            self._close(name, old, new)
        else:
            fired = [step.fires] if step.kind == "fire" else []
            self.actions.update(action for action, _ in explain(old, new, fired, compared=_forgetful))

    def _close(self, name: str, old: Structure, new: Structure) -> None:
        """The parts of one transition are taken, all of them noted; or the round, of which none are left."""
        for g, t in old.relations["asked"] - new.relations["asked"]:
            ordered = self.parts.coordinated[str(t)] if (g, t) in old.relations["committed"] else ()
            its = {(g, t, part.controller) for part in ordered or self.parts.promising(str(t))}
            assert its <= old.relations["noted"], name
            assert (g,) in old.relations["decided"], name
        for (g,) in old.relations["begun"] - new.relations["begun"]:
            rest = {key for key in old.relations["asked"] if key[0] == g}
            assert len(rest) <= 1, name
            self.actions["close"] += 1
        kept = with_relations(
            old,
            **{
                relation: {key for key in old.relations[relation.replace("_", "-")] if _kept(key, new)}
                for relation in (
                    *("asked", "committed", "begun", "decided", "noted", "obeyed", "request", "promised"),
                    *("commit_order", "abort_order", "acknowledgement", "vote", "heard"),
                )
            },
        )
        assert differences(kept, new) == [], name


def _kept(key: Key, new: Structure) -> bool:
    return (key[0],) in new.relations["begun"] and (len(key) == 1 or key[:2] in new.relations["asked"])


def _forgetful(structure: Structure) -> Structure:
    """Without what was heard in decided rounds; votes are the promises that stand."""
    over = structure.relations["decided"]
    heard = {key for key in structure.relations["heard"] if (key[0],) not in over}
    return with_relations(structure, heard=heard, vote=structure.relations["promised"])


def tell(variant: Variant, faults: Faults, of: str | Decomposition, markings_max: int) -> tuple[Told, bool]:
    """Explore a protocol net, breadth first, and hold every marking and every firing to the proof.

    Says, too, whether that was all of them.
    """
    told = Told(protocol_net(split(load_net(of)) if isinstance(of, str) else of, variant, faults))
    net = told.built.net
    player = Player(net)
    found = {net.initial_marking}
    todo = [net.initial_marking]
    for marking in todo:  # grows while it is walked
        names = frozenset(net.names(marking))
        assert ASTRAY not in names
        told.on_their_way(names)
        before = told.relevant(names)
        assert told.broken(before) == [], sorted(names)
        for fired, after in player.successors(marking):
            told.step(net.transitions[fired[0]].name, before, told.relevant(frozenset(net.names(after))))
            if after not in found and len(found) < markings_max:
                found.add(after)
                todo.append(after)
    return told, len(found) < markings_max


# Nets whose protocol net is explored whole, and others, of which the first markings are.
WHOLE = ["ring", "local_gate"]
BEGUN = ["remote_gate", "local_conflict", "read_before_order"]
BEGUN_MAX = 350 if FACTOR == 1 else 700


@pytest.mark.parametrize("name", WHOLE)
def test_each_firing_of_the_protocol_net_is_some_actions_of_the_proof(name: str) -> None:
    told, whole = tell(PROTOCOL, NO_FAULTS, name, 100_000)
    assert whole
    # To forget is to ignore messages of older rounds, which the net does; gates are free, and nobody crashes here.
    without = {"forget", "restart", "sense", "stand", "apply-free", "sense-late"}
    assert set(told.actions) == {action.name for action in PROVED.actions} - without


@pytest.mark.seeds
@pytest.mark.parametrize("name", BEGUN)
def test_first_firings_of_larger_protocol_nets_are_some_actions_of_the_proof(name: str) -> None:
    told, _ = tell(PROTOCOL, NO_FAULTS, name, BEGUN_MAX)
    assert told.actions["promise"] > 0


@pytest.mark.seeds
@pytest.mark.parametrize("name", [*WHOLE, *BEGUN])
def test_firings_with_faults_are_some_actions_of_the_proof(name: str) -> None:
    told, _ = tell(PROTOCOL, ONE_OF_EACH, name, BEGUN_MAX)
    assert told.actions["promise"] > 0


@pytest.mark.parametrize(
    ("variant", "name"),
    [
        (Variant(lock=Lock.NOTHING), "local_gate"),
        (Variant(lock=Lock.WRITES), "local_gate"),
        (Variant(gate_copies=True), "remote_gate"),
        (Variant(unanimous=False), "ring"),
        (Variant(vote_rounds=False), "ring"),
        (Variant(order_rounds=False), "ring"),
    ],
    ids=["promises nothing", "promises what is written", "copies gates", "not unanimous", "old votes", "old orders"],
)
def test_wrong_variants_do_what_is_no_action_of_the_proof(variant: Variant, name: str) -> None:
    with pytest.raises(AssertionError):
        tell(variant, NO_FAULTS, name, 10_000)


# --- Parts free of promise


WITH_FREE = ["ring", "local_gate"]
WITH_FREE_BEGUN = ["no_trouble", "local_conflict", "read_before_order"]


@pytest.mark.parametrize("name", WITH_FREE)
def test_each_firing_of_the_protocol_net_with_free_parts_is_some_actions_of_the_proof(name: str) -> None:
    told, whole = tell(PROTOCOL, NO_FAULTS, freed(split(load_net(name))), 100_000)
    assert whole
    assert {"stand", "apply-free", "decide", "note", "close"} <= set(told.actions)


@pytest.mark.seeds
@pytest.mark.parametrize("faults", [NO_FAULTS, ONE_OF_EACH], ids=["no fault", "one of each"])
@pytest.mark.parametrize("name", [*WITH_FREE, *WITH_FREE_BEGUN])
def test_first_firings_with_free_parts_and_faults_are_some_actions_of_the_proof(name: str, faults: Faults) -> None:
    told, _ = tell(PROTOCOL, faults, freed(split(load_net(name))), BEGUN_MAX)
    assert told.actions["stand"] > 0


@pytest.mark.parametrize(
    ("variant", "of"),
    [
        (PROTOCOL, parts_of(split(GATE_CLOSED), "t1-11")),
        (PROTOCOL, parts_of(split(OUTPUT_READ), "t1-11")),
        (Variant(vote_rounds=False), freed(split(load_net("ring")))),
        (Variant(order_rounds=False), freed(split(load_net("ring")))),
        (Variant(unanimous=False), freed(split(load_net("ring")))),
        (Variant(lock=Lock.NOTHING), freed(split(load_net("local_gate")))),
    ],
    ids=["taken back", "read before the order", "used votes", "old orders", "not unanimous", "promises nothing"],
)
def test_what_is_wrong_with_free_parts_is_no_action_of_the_proof(variant: Variant, of: Decomposition) -> None:
    with pytest.raises(AssertionError):
        tell(variant, NO_FAULTS, of, 10_000)
