"""Which protocol, and exposed to which faults: the true one, and those known to be wrong.

The true protocol (`PROTOCOL`) is that of the executor. Every other variant leaves one thing out that an obligation of
SEMANTICS demands, and is here because a check that refutes nothing has shown nothing. Two skeletons carry them:

- *acknowledged*: rounds that are asked for, decided, ordered, acknowledged and closed, as `docs/protocol.md` has them.
  An order is repeated until it is obeyed, so a round ends only when everybody has ended it.
- *bare*: votes are given unasked, and orders are sent once and not acknowledged. This is the distributed system as the
  paper sketches it, with four ways to take a yes (`Votes`); the reference cases speak of it.

Names such as `locked_dup_noepoch` are those of the reference cases: a bare protocol, then its faults.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final


class Votes(StrEnum):
    """What the coordinator takes for a yes."""

    CACHED = "cached"  # a yes of any part, kept until it is used
    STALE = "stale"  # a yes of a non-persistent part is kept, the others are read when it decides
    FRESH = "fresh"  # all are read when it decides
    PROMISED = "promised"  # a yes is a promise (O1), kept until commit or abort


class Lock(StrEnum):
    """What a promise keeps others from doing (O1)."""

    ALL = "all"  # to change what the part reads, or to read what it will write
    WRITES = "writes"  # the same, without the gate sources of the part
    NOTHING = "nothing"


class Often(StrEnum):
    """How often a fault may happen in one run."""

    NEVER = "never"
    ONCE = "once"
    ALWAYS = "always"

    def __bool__(self) -> bool:
        """Whether it may happen at all."""
        return self is not Often.NEVER


@dataclass(frozen=True, slots=True)
class Faults:
    """What may go wrong in one run; delay and overtaking always may.

    `crash` is that of a controller, `coordinator` that of a coordinator: any of them, or the one that is `doomed` to it
    (a coordinator as `Parts.decider` names it). With `restart`, whoever is down may come up again, with what is in
    stable storage.
    """

    loss: Often = Often.NEVER
    duplication: Often = Often.NEVER
    crash: Often = Often.NEVER
    coordinator: Often = Often.NEVER
    restart: bool = True
    doomed: str = ""

    def __bool__(self) -> bool:
        """Whether anything may go wrong."""
        return bool(self.loss or self.duplication or self.crash or self.coordinator)


NO_FAULTS: Final = Faults()
ONE_OF_EACH: Final = Faults(Often.ONCE, Often.ONCE, Often.ONCE, Often.ONCE)
"""A run loses one message, doubles one, and each of a controller and a coordinator crashes once and restarts."""
ANY_FAULTS: Final = Faults(Often.ALWAYS, Often.ALWAYS, Often.ALWAYS, Often.ALWAYS)


@dataclass(frozen=True, slots=True)
class Variant:
    """A protocol.

    `acknowledged`: the skeleton with rounds; else the bare one. `lock`: what a promise excludes (O1). `arbitrated`:
    conflicting transitions are decided together (O2); else local ones fire by themselves, and global ones have rounds
    of their own, neither minding what is promised to those that they conflict with. `gate_copies`: the owner of a gate
    takes no part, its gate is read from a copy that is brought up to date at some time (against O3). `vote_rounds` and
    `order_rounds`: votes, and orders to fire, carry the number of their round, so that old ones are known (O5).
    `unanimous`: a commit needs all votes. `stable`: promises survive a crash (O6). Of the bare skeleton: `recheck`, a
    part is applied only if it is still firable, else blindly; `serial`, one order at a time.
    `one_round` asks for one transition at a time: fewer runs, so that what goes wrong in one of them is found sooner.
    `common`: a conflict across coordinators is decided by their common ancestor (O8); else each decides what only those
    below it take part in, as if nobody else decided any of the conflict.
    `all_free`: every part is taken for one that is free of promise, whether its yes stands or not; else those that the
    decomposition names, in the skeleton with rounds. `of_free`: the numbers that are left out are those of parts that
    are free of promise, and the messages of the others have theirs.

    Raises `ValueError` for votes other than promised in the skeleton with rounds.

    >>> Variant.named("locked_noepoch").order_rounds
    False
    """

    votes: Votes = Votes.PROMISED
    acknowledged: bool = True
    lock: Lock = Lock.ALL
    arbitrated: bool = True
    gate_copies: bool = False
    vote_rounds: bool = True
    order_rounds: bool = True
    unanimous: bool = True
    stable: bool = True
    recheck: bool = False
    serial: bool = False
    one_round: bool = False
    common: bool = True
    all_free: bool = False
    of_free: bool = False

    def __post_init__(self) -> None:
        if self.acknowledged and (self.votes is not Votes.PROMISED or self.recheck or self.serial):
            raise ValueError("only the bare skeleton takes votes that are no promises, rechecks, or is serial")

    @property
    def is_true(self) -> bool:
        """Whether it is the protocol that the executor runs."""
        return self == PROTOCOL

    @classmethod
    def named(cls, name: str) -> Variant:
        """The bare variant of a name such as `locked_crash`; `ValueError` for another."""
        return named(name)[0]


PROTOCOL: Final = Variant()

BARE: Final = {
    "naive": Variant(Votes.CACHED, acknowledged=False, lock=Lock.NOTHING, order_rounds=False),
    "recheck": Variant(Votes.CACHED, acknowledged=False, lock=Lock.NOTHING, order_rounds=False, recheck=True),
    "gates": Variant(Votes.PROMISED, acknowledged=False, gate_copies=True),
    "fresh": Variant(Votes.FRESH, acknowledged=False, lock=Lock.NOTHING, order_rounds=False),
    "stale": Variant(Votes.STALE, acknowledged=False, lock=Lock.NOTHING, order_rounds=False),
    "stale_serial": Variant(Votes.STALE, acknowledged=False, lock=Lock.NOTHING, order_rounds=False, serial=True),
    "locked": Variant(Votes.PROMISED, acknowledged=False),
}
"""The bare protocols by name; only `locked` keeps O1-O3, and it needs that no message is lost."""


def named(name: str) -> tuple[Variant, Faults]:
    """The bare variant and the faults of a name of the reference cases; `ValueError` for another name.

    >>> variant, faults = named("locked_dup_noepoch")
    >>> variant.order_rounds, str(faults.duplication), str(faults.loss)
    (False, 'always', 'never')
    """
    protocol, suffixes = name, set[str]()
    while protocol not in BARE:
        protocol, _, suffix = protocol.rpartition("_")
        if suffix not in {"loss", "dup", "noepoch", "crash"} or suffix in suffixes:
            raise ValueError(f"no protocol variant is named '{name}'")
        suffixes.add(suffix)
    variant = BARE[protocol]
    if "noepoch" in suffixes:
        variant = replace(variant, order_rounds=False)

    def often(suffix: str) -> Often:
        return Often.ALWAYS if suffix in suffixes else Often.NEVER

    return variant, Faults(often("loss"), often("dup"), often("crash"), restart=False)
