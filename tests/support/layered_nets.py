"""Small nets in layers: cells under coordinators of their own, under a line."""

from __future__ import annotations

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
