"""Hypothesis strategy: nets of rings that share transitions, which run long enough to have something to find.

A net whose every arc is drawn with an even chance is mostly dead. Here tokens go round in rings of places, as in a
cell: a transition moves one of them, or several at once. A few gates and stray transitions then make for components,
deadlocks, conflicts and races.
"""

from hypothesis import strategies as st

from firable.nets.net import Command, ExternalGate, Net, Place, Signal, Transition

_COMMANDS = [Command("M", "RUN"), Command("M", "STOP"), Command("N", "RUN"), Command("N", "RUN", (("speed", "2"),))]
_SIZES = [(2,), (3,), (2, 2), (3, 2), (2, 2, 2), (3, 3), (3, 2, 2), (4, 3)]
_NONE: tuple[str, ...] = ()


@st.composite
def ring_nets(draw: st.DrawFn, *, signals: bool = False, commands: bool = False) -> Net:
    """Nets, some with a self-loop; with external gates and output signals if asked for."""
    sizes = draw(st.sampled_from(_SIZES))
    names = "abcdefgh"[: sum(sizes)]
    rings = [names[sum(sizes[:r]) : sum(sizes[: r + 1])] for r in range(len(sizes))]
    marked = {ring[0] for ring in rings} ^ draw(st.sampled_from([set(), set(), set(), set(names[1]), set(names[-1])]))
    moves = [(ring[i], ring[(i + 1) % len(ring)]) for ring in rings for i in range(len(ring))]
    shared = draw(st.lists(st.sampled_from(range(len(moves))), min_size=len(moves), max_size=len(moves)))
    arcs = [(set[str](), set[str]()) for _ in moves]
    for (source, target), own, other in zip(moves, range(len(moves)), shared, strict=True):
        # Half of the moves join the transition of another one, if that does not make a self-loop.
        together = other if other % 2 and not {source, target} & set().union(*arcs[other]) else own
        arcs[together][0].add(source)
        arcs[together][1].add(target)
    arcs = [pair for pair in arcs if pair[0]]
    for _ in range(draw(st.sampled_from([0, 0, 1, 1, 2]))):
        order = draw(st.permutations(names))
        n_inputs, n_outputs = draw(st.sampled_from([(1, 1), (1, 1), (2, 1), (1, 2), (0, 1), (1, 0)]))
        arcs.append((set(order[:n_inputs]), set(order[n_inputs : n_inputs + n_outputs])))
    transitions = []
    for i, (inputs, outputs) in enumerate(arcs):
        gate = draw(st.sampled_from(names))
        kind = draw(st.sampled_from(["", "", "", "", "", "if", "unless"]))
        external = draw(st.sampled_from(["", "", "", "r", "s", "-r", "-s", "r-s", "r-r"])) if signals else ""
        transitions.append(
            Transition(
                f"t{i}",
                tuple(sorted(inputs)),
                tuple(sorted(outputs)),
                (gate,) if kind == "if" else _NONE,
                (gate,) if kind == "unless" else _NONE,
                tuple(
                    ExternalGate(letter, external[k - 1 : k] != "-")
                    for k, letter in enumerate(external)
                    if letter != "-"
                ),
            )
        )
    places = tuple(
        Place(
            name,
            marked=name in marked,
            command=draw(st.one_of(st.none(), st.sampled_from(_COMMANDS))) if commands else None,
        )
        for name in names
    )
    return Net("n", places, tuple(transitions), (Signal("r"), Signal("s")) if signals else ())
