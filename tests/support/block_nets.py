"""Nets of nested blocks, one after the other, side by side, or one of two: what reductions take together most."""

from random import Random

from firable.nets.net import Net, Place, Transition


def block_net(draw: Random, depth: int = 3) -> Net:
    """A net with one token at its entry, and with luck a way back from its exit."""
    places, transitions = [Place("entry", marked=True), Place("exit")], list[Transition]()

    def place() -> str:
        places.append(Place(f"p{len(places)}"))
        return places[-1].name

    def transition(inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
        transitions.append(Transition(f"t{len(transitions)}", inputs, outputs))

    def block(begin: str, end: str, depth: int) -> None:
        kind = draw.choice(("step", "sequence", "fork", "fork", "choice")) if depth else "step"
        if kind == "step":
            transition((begin,), (end,))
        elif kind == "sequence":
            between = place()
            block(begin, between, depth - 1)
            block(between, end, depth - 1)
        elif kind == "fork":
            begins, ends = (place(), place()), (place(), place())
            transition((begin,), begins)
            for first, last in zip(begins, ends, strict=True):
                block(first, last, depth - 1)
            transition(ends, (end,))
        else:
            block(begin, end, depth - 1)
            block(begin, end, depth - 1)

    block("entry", "exit", depth)
    if draw.random() < 0.6:
        transition(("exit",), ("entry",))
    if draw.random() < 0.3:  # one that takes what a block waits for
        transition((draw.choice(places).name,), ())
    return Net("blocks", tuple(places), tuple(transitions))
