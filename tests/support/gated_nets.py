"""Nets of two controllers with gates: between a coordinated and a local transition, and on sensors."""

from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.text import parse_net


def net_of(places: str, marked: str, *transitions: Transition) -> Net:
    """A net of the controllers `a` and `b`; a place of `a` is named by `a` and a letter."""
    names = places.split()
    return Net(
        "net",
        tuple(Place(name, name[0], marked=name in marked.split()) for name in names),
        transitions,
        controllers=(Controller("a"), Controller("b")),
    )


GATE_OF_A_LOCAL = net_of(
    "a.i a.p a.s a.x b.j b.y",
    "a.i a.s b.j",
    Transition("G", ("a.i", "b.j"), ("a.p", "b.y")),
    Transition("l", ("a.s",), ("a.x",), inhibitive=("a.p",)),
)
"""A local transition must not fire between a decision and its application: it reads what the part will write."""

GATE_MOVED_BY_A_LOCAL = net_of(
    "a.s a.x b.y b.z",
    "a.s b.z",
    Transition("G", ("a.s",), ("a.x",), inhibitive=("b.y",)),
    Transition("back", ("a.x",), ("a.s",)),
    Transition("k", ("b.z",), ("b.y",)),
    Transition("k-back", ("b.y",), ("b.z",)),
)
"""A gate elsewhere opens and closes by a local transition, of which the coordinator hears only later."""

GATE_READ_AGAIN = net_of(
    "a.i a.p a.s a.x b.j b.y",
    "a.i a.s b.j",
    Transition("G", ("a.i", "b.j"), ("a.p", "b.y")),
    Transition("G-back", ("a.p", "b.y"), ("a.i", "b.j")),
    Transition("l", ("a.s",), ("a.x",), inhibitive=("a.p",)),
    Transition("l-back", ("a.x",), ("a.s",)),
)
"""As `GATE_OF_A_LOCAL`, again and again."""

SHOWN = parse_net("""\
firable: 1
cell: shown
controllers:
  a: {start: free, places: {free: , lamp: {send: {machine: A, command: OPEN}}}}
  b: {start: idle, places: {idle: , has: }}
transitions:
  hand: {from: [a.free, b.idle], to: [a.lamp, b.has]}
  back: {from: [a.lamp, b.has], to: [a.free, b.idle]}
""")
"""A command without completion: its token waits until a machine has taken it."""

SENSOR = Net(
    "sensor",
    (Place("a.p", "a", marked=True), Place("a.x", "a"), Place("b.q", "b", marked=True), Place("b.y", "b")),
    (
        Transition("G", ("a.p", "b.q"), ("a.x", "b.y"), external=(ExternalGate("a.s"),)),
        Transition("G-back", ("a.x", "b.y"), ("a.p", "b.q"), external=(ExternalGate("b.s", wanted=False),)),
    ),
    (Signal("a.s", "a"), Signal("b.s", "b")),
    (Controller("a"), Controller("b")),
)
"""A coordinated transition that reads sensors of both."""
