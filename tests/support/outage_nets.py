"""Nets in which who is dead keeps back more than what waits for it: by a promise, or by an order that never comes."""

from firable.nets.net import Controller, Net, Place, Transition


def gated(a: str = "a", together: str = "G") -> Net:
    """`a` goes round by itself, and what it does together with `b` reads the loop: a promise of that keeps it still."""
    marked = {f"{a}.up": True, f"{a}.down": False, f"{a}.p": True, f"{a}.q": False, "b.r": True, "b.s": False}
    places = tuple(Place(name, name.partition(".")[0], marked=token) for name, token in marked.items())
    transitions = (
        Transition("turn", (f"{a}.up",), (f"{a}.down",)),
        Transition("back", (f"{a}.down",), (f"{a}.up",)),
        Transition(together, (f"{a}.p", "b.r"), (f"{a}.q", "b.s"), permissive=(f"{a}.up",)),
        Transition("H", (f"{a}.q", "b.s"), (f"{a}.p", "b.r")),
    )
    return Net("gated", places, transitions, controllers=(Controller(a), Controller("b")))


def overtaken() -> Net:
    """`u` is decided by the line, and `p` goes on from it by `l`; `r` may be behind, and then `y` never comes.

    Before `l` has fired, `x` goes on without `y`, and where `r` is not behind, by it.
    """
    marked = dict.fromkeys(("p.a", "p.q", "p.r", "p.z", "p.k", "p.j", "r.b", "r.d", "r.e", "s.g", "s.h"), False)
    marked |= dict.fromkeys(("p.a", "p.r", "r.b", "s.g"), True)
    transitions = (
        Transition("u", ("p.a", "r.b", "s.g"), ("p.q", "r.d", "s.h")),
        Transition("back", ("r.e", "s.h"), ("p.a", "r.b", "s.g")),
        Transition("l", ("p.q", "p.r"), ("p.z",)),
        Transition("alone", ("p.r",), ("p.k",)),
        Transition("y", ("p.z", "r.d"), ("p.k", "r.e")),
        Transition("x", ("p.k",), ("p.j",)),
        Transition("again", ("p.j",), ("p.r",)),
    )
    places = tuple(Place(name, name[0], marked=token) for name, token in marked.items())
    layers = (Controller("line", coordinator=True), Controller("cell"), Controller("s"))
    below = (Controller("p", under="cell"), Controller("r", under="cell"))
    return Net("overtaken", places, transitions, controllers=(*layers, *below))
