"""Hypothesis strategy: small nets whose every arc and gate is drawn with an even chance; mostly dead, of any shape."""

from hypothesis import strategies as st

from firable.nets.net import ExternalGate, Net, Place, Signal, Transition

PLACES = "abcde"

sets_of_places = st.frozensets(st.sampled_from(PLACES)).map(lambda names: tuple(sorted(names)))
external_gates = st.frozensets(st.builds(ExternalGate, st.sampled_from(["r", "s"]), st.booleans())).map(
    lambda gates: tuple(sorted(gates, key=lambda gate: (gate.signal, gate.wanted)))
)


@st.composite
def dense_nets(draw: st.DrawFn, *, most_transitions: int = 4, signals: bool = False) -> Net:
    """Five places, a few transitions with any sets of arcs and internal gates, and external gates if asked for."""
    marked = draw(sets_of_places)
    transitions = tuple(
        Transition(
            f"t{i}",
            inputs=draw(sets_of_places),
            outputs=draw(sets_of_places),
            permissive=draw(sets_of_places),
            inhibitive=draw(sets_of_places),
            external=draw(external_gates) if signals else (),
        )
        for i in range(draw(st.integers(0, most_transitions)))
    )
    return Net("n", tuple(Place(p, marked=p in marked) for p in PLACES), transitions, (Signal("r"), Signal("s")))
