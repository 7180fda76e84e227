"""Small nets in layers: cells under coordinators of their own, under a line."""

from __future__ import annotations

from dataclasses import replace

from firable.nets.decomposition import Decomposition
from firable.nets.net import Command, Controller, Net, Place, Transition


def cells_in_a_line() -> Net:
    """Cells `a` and `b`, each with a robot and a machine that go on by themselves; the line hands over between them.

    In a cell the robot fills the machine, which runs and is emptied: decided by the coordinator of the cell. The line
    decides `hand_over`, for which the belts of both robots are needed, and these bring their belts back by themselves.
    """
    places, transitions, controllers = [], [], [Controller("line", coordinator=True)]
    for x in ("a", "b"):
        robot, machine = f"robot_{x}", f"machine_{x}"
        controllers += [Controller(f"cell_{x}"), *(Controller(name, under=f"cell_{x}") for name in (robot, machine))]
        places += [
            Place(f"{robot}.ready", robot, marked=True),
            Place(f"{robot}.away", robot, command=Command(f"R{x}", "GO")),
            Place(f"{robot}.belt", robot, marked=True),
            Place(f"{robot}.used", robot, command=Command(f"B{x}", "RUN")),
            Place(f"{machine}.empty", machine, marked=True),
            Place(f"{machine}.full", machine, command=Command(f"M{x}", "RUN")),
        ]
        transitions += [
            Transition(f"fill_{x}", (f"{robot}.ready", f"{machine}.empty"), (f"{robot}.away", f"{machine}.full")),
            Transition(f"clear_{x}", (f"{robot}.away", f"{machine}.full"), (f"{robot}.ready", f"{machine}.empty")),
            Transition(f"back_{x}", (f"{robot}.used",), (f"{robot}.belt",)),
        ]
    belts = Transition("hand_over", ("robot_a.belt", "robot_b.belt"), ("robot_a.used", "robot_b.used"))
    return Net("cells-in-a-line", tuple(places), (*transitions, belts), controllers=tuple(controllers))


def shared_robot() -> Net:
    """A robot that a cell and the line above it ask for in turn: `fill` is decided by the cell, `fetch` by the line."""
    controllers = (
        Controller("line", coordinator=True),
        Controller("cell"),
        *(Controller(name, under="cell") for name in ("r", "m")),
        Controller("x"),
    )
    names = ("r.a", "r.b", "m.a", "m.b", "r.c", "r.d", "x.c", "x.d")
    places = tuple(Place(name, name[0], marked=name[2] in "ac") for name in names)
    fill = Transition("fill", ("r.a", "m.a"), ("r.b", "m.b"))
    fetch = Transition("fetch", ("r.c", "x.c"), ("r.d", "x.d"), ("r.b",))
    back = Transition("back", ("x.d",), ("x.c",))
    return Net("shared-robot", places, (fill, fetch, back), controllers=controllers)


def contending() -> Net:
    """The cell's `within` and the line's `over` each close a gate of the other, at two controllers."""
    below = [Controller(name, under="cell") for name in ("r", "m")]
    controllers = (Controller("line", coordinator=True), Controller("cell"), *below, Controller("x"))
    names = ("r.a", "r.b", "m.a", "m.b", "r.c", "r.d", "m.c", "m.d", "x.c", "x.d")
    places = tuple(Place(name, name[0], marked=name[2] in "ac") for name in names)
    within = Transition("within", ("r.a", "m.a"), ("r.b", "m.b"), ("m.c",))
    over = Transition("over", ("r.c", "m.c", "x.c"), ("r.d", "m.d", "x.d"), ("r.a",))
    return Net("contending", places, (within, over), controllers=controllers)


def left_below(decomposition: Decomposition) -> Decomposition:
    """The table with `within` in the hands of the cell."""
    rows = tuple(replace(row, at="cell") if row.name == "within" else row for row in decomposition.coordinated)
    return replace(decomposition, coordinated=rows)
