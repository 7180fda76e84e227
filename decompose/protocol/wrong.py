"""The protocols that are known to be wrong, each with the smallest net on which it fails.

Each leaves out one thing that an obligation of SEMANTICS demands. Who changes the protocol will find his idea here, or
should add it: a check that refutes none of these would have shown nothing by proving the true one. How each goes wrong
is for `refuting` to find.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.variant import BARE, NO_FAULTS, Faults, Lock, Often, Variant
from firable.nets.catalogue import catalogue_net
from firable.nets.layers import Layers
from firable.nets.net import Controller, Net, Place, Transition


@dataclass(frozen=True, slots=True)
class WrongProtocol:
    """A protocol known to be wrong: what it leaves out, against which obligation, and a net on which it fails."""

    name: str
    obligation: str
    says: str
    variant: Variant
    example: str
    faults: Faults = NO_FAULTS


WRONG: Final = (
    WrongProtocol(
        "cached-votes", "O1", "a yes is kept until it is used, and promises nothing", BARE["stale_serial"], "one_robot"
    ),
    WrongProtocol(
        "old-votes",
        "O5",
        "a yes from before the decision counts in the next round",
        Variant(vote_rounds=False),
        "scrap",
    ),
    WrongProtocol(
        "unlocked-conflicts",
        "O2",
        "conflicting transitions have deciders of their own",
        Variant(arbitrated=False),
        "scrap",
    ),
    WrongProtocol(
        "conflicts-decided-below",
        "O8",
        "of a conflict across coordinators each decides its own share",
        Variant(common=False),
        "lent",
    ),
    WrongProtocol(
        "cached-gates",
        "O3",
        "a gate elsewhere is read from a copy, its owner takes no part",
        Variant(gate_copies=True),
        "doors",
    ),
    WrongProtocol(
        "orders-twice", "O5", "an order that is repeated is applied again", Variant(order_rounds=False), "shuttle"
    ),
    WrongProtocol(
        "missing-vote",
        "Eq. (7)",
        "a transition is decided though one vote is missing",
        Variant(unanimous=False),
        "shuttle",
    ),
    WrongProtocol(
        "unlocked-reads",
        "O1",
        "a promise does not cover the places that a part only reads",
        Variant(lock=Lock.WRITES),
        "hood",
    ),
    WrongProtocol(
        "forgotten-promises",
        "O6",
        "a promise is not in stable storage",
        Variant(stable=False),
        "shuttle",
        Faults(crash=Often.ONCE),
    ),
    WrongProtocol(
        "unfounded-freedom",
        "O1",
        "every part is taken for one that is free of promise, whether its yes stands or not",
        Variant(all_free=True),
        "hood",
    ),
    WrongProtocol(
        "used-votes",
        "O5",
        "a yes of a part free of promise counts again after the firing",
        Variant(of_free=True, vote_rounds=False),
        "shuttle",
    ),
    WrongProtocol(
        "free-twice",
        "O5",
        "an order to a part free of promise that comes again is applied again",
        Variant(of_free=True, order_rounds=False),
        "shuttle",
    ),
    WrongProtocol(
        "sent-once",
        "O5",
        "an order is sent once, and nobody acknowledges it",
        BARE["locked"],
        "shuttle",
        Faults(loss=Often.ONCE),
    ),
)
"""Every protocol that must be refuted."""


def wrong_protocols(net: Net) -> tuple[WrongProtocol, ...]:
    """Those that are other protocols than the true one on this net: without layers nobody decides below another one."""
    return tuple(wrong for wrong in WRONG if wrong.variant.common or Layers(net).several)


def example(name: str) -> Net:
    """The net of an example: one of those here, or of the catalogue."""
    return _EXAMPLES[name] if name in _EXAMPLES else catalogue_net(name)


_CELL = Controller("cell")
_ROBOT, _LATHE, _PRESS, _GUARD = Controller("robot"), Controller("lathe"), Controller("press"), Controller("guard")
_HANDED = ("robot.free", "lathe.full")


def _places(marked: tuple[str, ...], empty: tuple[str, ...]) -> tuple[Place, ...]:
    return tuple(Place(name, name.partition(".")[0], name in marked) for name in (*marked, *empty))


_EXAMPLES: Final = {
    "shuttle": Net(
        "shuttle",
        _places(("robot.part", "lathe.empty"), _HANDED),
        (
            Transition("hand_over", ("robot.part", "lathe.empty"), _HANDED),
            Transition("fetch", ("robot.free",), ("robot.part",)),
            Transition("unload", ("lathe.full",), ("lathe.empty",)),
        ),
        controllers=(_ROBOT, _LATHE),
        description="the robot hands a part to the lathe, and either goes on by itself",
    ),
    "scrap": Net(
        "scrap",
        _places(("robot.part", "lathe.empty"), (*_HANDED, "robot.scrapped")),
        (
            Transition("hand_over", ("robot.part", "lathe.empty"), _HANDED),
            Transition("scrap", ("robot.part",), ("robot.scrapped",)),
        ),
        controllers=(_ROBOT, _LATHE),
        description="the robot hands its part to the lathe, or scraps it",
    ),
    "lent": Net(
        "lent",
        _places(("robot.part", "lathe.empty", "press.empty"), (*_HANDED, "press.full")),
        (
            Transition("hand_over", ("robot.part", "lathe.empty"), _HANDED),
            Transition("lend", ("robot.part", "press.empty"), ("robot.free", "press.full")),
        ),
        controllers=(_CELL, Controller("robot", under="cell"), Controller("lathe", under="cell"), _PRESS),
        description="the robot of a cell hands its part to the lathe there, or to a press outside of the cell",
    ),
    "hood": Net(
        "hood",
        _places(("robot.part", "lathe.empty", "lathe.shut"), (*_HANDED, "lathe.open")),
        (
            Transition("hand_over", ("robot.part", "lathe.empty"), _HANDED, inhibitive=("lathe.open",)),
            Transition("open", ("lathe.shut",), ("lathe.open",)),
        ),
        controllers=(_ROBOT, _LATHE),
        description="the robot hands its part to the lathe unless the hood is open",
    ),
    "doors": Net(
        "doors",
        _places(("press.ready", "guard.shut"), ("press.closed", "guard.opened")),
        (
            Transition("close", ("press.ready",), ("press.closed",), inhibitive=("guard.opened",)),
            Transition("open", ("guard.shut",), ("guard.opened",), inhibitive=("press.closed",)),
        ),
        controllers=(_PRESS, _GUARD),
        description="the press closes unless the door is open, the door opens unless the press is closed",
    ),
}
