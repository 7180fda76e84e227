"""Families of processes that share or pass something: philosophers, machines, rings, counters.

These are the nets by which the literature compares analysers, because the number of their markings is known for every
size: a wrong count is seen at once, and a size can be chosen to fill a cache, a memory or a minute. Each maker states
the number and where it comes from; `tests/nets/test_families.py` compares it with what the engine finds.

A place is owned by the process that it belongs to, so that every net can be split. Neighbours are counted round:
after the last comes the first.
"""

from __future__ import annotations

from collections.abc import Sequence

from firable.nets.formula import And, Holds
from firable.nets.net import (
    Command,
    Controller,
    ExternalGate,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    Transition,
)


def controllers(names: Sequence[str], description: str) -> tuple[Controller, ...]:
    """One controller for each name."""
    return tuple(Controller(name, description=description) for name in names)


def never_both(name: str, first: str, second: str) -> Property:
    """The property that two places are never marked together."""
    return Property(name, PropertyKind.NEVER, And((Holds(first), Holds(second))))


def philosophers(n: int) -> Net:
    """Dining philosophers of four places who take the left fork first, and give both back together.

    (1 + sqrt 2)^n + (1 - sqrt 2)^n markings, the n-th Pell-Lucas number: a round of n letters thinking, left, eating,
    in which whoever follows one who eats is thinking. One deadlock, where all hold the left fork.
    """
    who = [f"p{i}" for i in range(1, n + 1)]
    places, transitions = [], []
    for i, p in enumerate(who):
        right = f"{who[(i + 1) % n]}.fork"
        thinking, fork, left, eating = f"{p}.thinking", f"{p}.fork", f"{p}.left", f"{p}.eating"
        places += [Place(thinking, p, marked=True), Place(fork, p, marked=True), Place(left, p), Place(eating, p)]
        transitions += [
            Transition(f"{p}_takes_left", (thinking, fork), (left,)),
            Transition(f"{p}_takes_right", (left, right), (eating,)),
            Transition(f"{p}_gives", (eating,), (thinking, fork, right)),
        ]
    return Net(
        f"philosophers-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(who, "a philosopher and the fork at the left"),
        properties=(never_both("neighbours_eat_in_turn", "p1.eating", "p2.eating"),),
        description="Dining philosophers: the left fork, then the right one",
    )


def philosophers_either(n: int) -> Net:
    """Dining philosophers of five places who take either fork first, and give both back together.

    3^n markings, each fork being free or at one of its two neighbours, and two deadlocks (F. Kordon et al., the model
    "Philosophers" of the Model Checking Contest).
    """
    who = [f"p{i}" for i in range(1, n + 1)]
    places, transitions = [], []
    for i, p in enumerate(who):
        right_fork = f"{who[(i + 1) % n]}.fork"
        thinking, fork, left, right, eating = (f"{p}.{x}" for x in ("thinking", "fork", "left", "right", "eating"))
        places += [Place(thinking, p, marked=True), Place(fork, p, marked=True)]
        places += [Place(left, p), Place(right, p), Place(eating, p)]
        transitions += [
            Transition(f"{p}_takes_left", (thinking, fork), (left,)),
            Transition(f"{p}_takes_right", (thinking, right_fork), (right,)),
            Transition(f"{p}_takes_right_too", (left, right_fork), (eating,)),
            Transition(f"{p}_takes_left_too", (right, fork), (eating,)),
            Transition(f"{p}_gives", (eating,), (thinking, fork, right_fork)),
        ]
    return Net(
        f"philosophers_either-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(who, "a philosopher and the fork at the left"),
        properties=(never_both("neighbours_eat_in_turn", "p1.eating", "p2.eating"),),
        description="Dining philosophers: either fork first",
    )


def machines(n: int) -> Net:
    """Independent machines, each idle or busy with a command: 2^n markings."""
    who = [f"m{i}" for i in range(1, n + 1)]
    places, transitions, signals = [], [], []
    for m in who:
        idle, busy, done = f"{m}.idle", f"{m}.busy", f"{m}.done"
        places += [Place(idle, m, marked=True), Place(busy, m, command=Command(m.upper(), "RUN"), completion=done)]
        signals.append(Signal(done, m, SignalKind.COMPLETION))
        transitions += [
            Transition(f"{m}_starts", (idle,), (busy,)),
            Transition(f"{m}_ends", (busy,), (idle,), external=(ExternalGate(done),)),
        ]
    return Net(
        f"machines-{n}",
        tuple(places),
        tuple(transitions),
        tuple(signals),
        controllers(who, "a machine"),
        description="Machines that have nothing to do with one another",
    )


def interlocked(n: int) -> Net:
    """Machines in a ring that watch the next one by gates: none starts while it is busy, none unloads while it is done.

    3^n - 1 markings: idle, busy or done in any combination, except that all are busy, which no start can complete.
    One deadlock, where all are done.
    """
    who = [f"m{i}" for i in range(1, n + 1)]
    places, transitions = [], []
    for i, m in enumerate(who):
        after = who[(i + 1) % n]
        idle, busy, done = f"{m}.idle", f"{m}.busy", f"{m}.done"
        places += [Place(idle, m, marked=True), Place(busy, m), Place(done, m)]
        transitions += [
            Transition(f"{m}_starts", (idle,), (busy,), inhibitive=(f"{after}.busy",)),
            Transition(f"{m}_ends", (busy,), (done,)),
            Transition(f"{m}_unloads", (done,), (idle,), inhibitive=(f"{after}.done",)),
        ]
    return Net(
        f"interlocked-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(who, "a machine"),
        description="Machines in a ring, interlocked by inhibitive gates",
    )


def token_ring(n: int) -> Net:
    """Stations in a ring of which only the one with the token may work; who waits for it does not pass it on.

    3 n 2^(n-1) markings: n places of the free token times 2^n (idle or waiting), and n stations at work times 2^(n-1).
    """
    who = [f"s{i}" for i in range(1, n + 1)]
    places, transitions = [], []
    for i, s in enumerate(who):
        after = f"{who[(i + 1) % n]}.token"
        idle, waiting, working, token = f"{s}.idle", f"{s}.waiting", f"{s}.working", f"{s}.token"
        places += [Place(idle, s, marked=True), Place(waiting, s), Place(working, s), Place(token, s, marked=i == 0)]
        transitions += [
            Transition(f"{s}_asks", (idle,), (waiting,)),
            Transition(f"{s}_takes", (waiting, token), (working,)),
            Transition(f"{s}_gives", (working,), (idle, after)),
            Transition(f"{s}_passes", (token,), (after,), inhibitive=(waiting,)),
        ]
    return Net(
        f"token_ring-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(who, "a station of the ring"),
        properties=(never_both("one_works", "s1.working", "s2.working"),),
        description="Stations that work when they hold the one token",
    )


def slotted_ring(n: int) -> Net:
    """The slotted ring protocol: at each node one slot comes in, is read, perhaps filled or emptied, and goes on.

    E. Pastor, O. Roig, J. Cortadella, R. M. Badia, "Petri Net Analysis Using Boolean Manipulation", 1994, in the form
    of G. Ciardo's saturation papers with eight places a node. A node without a slot (`ready`) takes a free or a used
    one from the next; a used slot is its own, then it may free it or fill it again, or another's. 52 markings for two
    nodes, 53,856 for five, 8.3e9 for ten, 2.6e105 for a hundred, as published.
    """
    who = [f"n{i}" for i in range(1, n + 1)]
    places, transitions = [], []
    for i, node in enumerate(who):
        before = who[i - 1]
        names = ("used", "owned", "ready", "put", "idle", "sent", "full", "get")
        used, owned, ready, put, idle, sent, full, get = (f"{node}.{name}" for name in names)
        places += [Place(name, node, marked=name in {ready, idle}) for name in (used, owned, ready, put)]
        places += [Place(name, node, marked=name in {ready, idle}) for name in (idle, sent, full, get)]
        transitions += [
            Transition(f"{node}_sees_other", (used,), (put,)),
            Transition(f"{node}_sees_own", (used,), (owned,)),
            Transition(f"{node}_writes", (owned,), (put,)),
            Transition(f"{node}_lets_go", (owned,), (get,)),
            Transition(f"{node}_gets", (sent, get), (ready, idle)),
            Transition(f"{node}_puts", (put, sent), (ready, full)),
            Transition(f"{node}_hands_on_used", (full, f"{before}.ready"), (sent, f"{before}.used")),
            Transition(f"{node}_hands_on_free", (idle, f"{before}.ready"), (sent, f"{before}.owned")),
        ]
    return Net(
        f"slotted_ring-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(who, "a node of the ring"),
        description="The slotted ring protocol",
    )


def counter(n: int) -> Net:
    """A binary counter of n bits, one transition for each carry: 2^n markings in a single cycle of 2^n firings.

    The deepest graph that a net of 2n places can have: no marking has more than one successor.
    """
    places, transitions = [], []
    zeros, ones = [f"counter.zero{i}" for i in range(n)], [f"counter.one{i}" for i in range(n)]
    for zero, one in zip(zeros, ones, strict=True):
        places += [Place(zero, "counter", marked=True), Place(one, "counter")]
    for i in range(n):
        transitions.append(
            Transition(f"carries_to_{i}", (*ones[:i], zeros[i]), (*zeros[:i], ones[i])),
        )
    transitions.append(Transition("starts_again", tuple(ones), tuple(zeros)))
    return Net(
        f"counter-{n}",
        tuple(places),
        tuple(transitions),
        controllers=controllers(["counter"], "the counter"),
        description="A binary counter",
    )
