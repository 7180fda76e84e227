"""Hypothesis strategies: small nets of each class of net theory, by construction; most are safe, some are live.

A place that many share is what makes such nets interesting, so arcs are drawn to few places. Reads, external gates and
transitions that contradict themselves are strewn in where the class allows it.
"""

from hypothesis import strategies as st

from firable.nets.net import ExternalGate, Net, Place, Signal, Transition

Arcs = tuple[set[str], set[str]]


def _net(draw: st.DrawFn, arcs: list[Arcs], marked: set[str], places: list[str]) -> Net:
    signals, gates = (Signal("s"),), {"": (), "s": (ExternalGate("s"),)}
    transitions = []
    for i, (inputs, outputs) in enumerate(arcs):
        external = gates[draw(st.sampled_from(["", "", "", "s"]))]
        transitions.append(
            Transition(
                f"t{i}",
                tuple(sorted(inputs - outputs)),
                tuple(sorted(outputs - inputs)),
                tuple(sorted(inputs & outputs)),
                (),
                external,
            )
        )
    if draw(st.integers(0, 9)) == 0:
        both = (ExternalGate("s", True), ExternalGate("s", False))
        transitions.append(Transition("never", (places[0],), (), external=both))
    return Net("n", tuple(Place(p, marked=p in marked) for p in places), tuple(transitions), signals)


@st.composite
def state_machines(draw: st.DrawFn) -> Net:
    """Each transition takes one token and puts one, mostly within one of two parts; up to two tokens."""
    places = list("abcdef")[: draw(st.integers(1, 6))]
    one = st.sampled_from(places)
    arcs = [({draw(one)}, {draw(one)}) for _ in range(draw(st.integers(0, 8)))]
    return _net(draw, arcs, set(draw(st.lists(one, min_size=1, max_size=2))), places)


@st.composite
def marked_graphs(draw: st.DrawFn) -> Net:
    """Each place leads from one transition to one; rings of places and their complements make most of them safe."""
    n = draw(st.integers(1, 4))
    number = st.integers(0, n - 1)
    joins = draw(st.lists(st.tuples(number, number), min_size=1, max_size=4))
    arcs: list[Arcs] = [(set(), set()) for _ in range(n)]
    places, marked = [], set()
    for i, (source, target) in enumerate(joins):
        kind = draw(st.sampled_from(["alone", "pair", "pair", "pair"]))
        for name, start, end in ((f"p{i}", source, target), (f"q{i}", target, source)):
            if name[0] == "p" or kind == "pair":
                places.append(name)
                arcs[start][1].add(name)
                arcs[end][0].add(name)
        token = draw(st.sampled_from([f"p{i}", f"q{i}", f"q{i}", ""]))
        marked |= {token} & set(places)
    return _net(draw, arcs, marked, places)


@st.composite
def free_choice_nets(draw: st.DrawFn) -> Net:
    """Grown from one ring by steps that keep them live and safe, then spoilt by a stray transition or marking.

    The steps are those of well-formed free choice: put a place before a transition, give a place another way to its
    successor, let a transition's token go two ways at once, from where the next transition joins them.
    """
    arcs: list[Arcs] = [({"a"}, {"b"}), ({"b"}, {"a"})]
    places = ["a", "b"]
    for step in range(draw(st.integers(0, 4))):
        t = draw(st.integers(0, len(arcs) - 1))
        inputs, outputs = arcs[t]
        new = f"p{step}"
        match draw(st.sampled_from(["series", "choice", "parallel", "read"])):
            case "series":
                arcs[t] = (inputs, {new})
                arcs.append(({new}, outputs))
                places.append(new)
            case "choice":
                arcs.append((set(inputs), set(outputs)))
            case "parallel":
                other = f"q{step}"
                arcs[t] = (inputs, {new, other})
                arcs.append(({new, other}, outputs))
                places += [new, other]
            case "read":
                # A place beside a place that alone decides: taken and given back together with it.
                places.append(new)
                arcs[t] = (inputs | {new}, outputs | {new}) if len(inputs) == 1 else arcs[t]
    marked = {"a"} | {p for p in places if draw(st.integers(0, 7)) == 0}
    if draw(st.integers(0, 2)) == 0:
        source, target = draw(st.sampled_from(places)), draw(st.sampled_from(places))
        arcs.append(({source}, {target}))
    if draw(st.integers(0, 4)) == 0:
        marked = set(draw(st.lists(st.sampled_from(places), max_size=3)))
    return _net(draw, arcs, marked, places)
