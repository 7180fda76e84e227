"""Hypothesis strategy: nets with all that the net file can say, for round trips."""

from hypothesis import strategies as st
from support.temporal_formulas import ctl_formulas, ltl_formulas
from support.timed_nets import waiting, with_limits

from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, Not, Or, Start
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    TemporalProperty,
    Transition,
)
from firable.nets.temporal import Logic

_WORDS = st.sampled_from(
    ["free", "run", "on", "no", "1", "007", "1e3", "y", "x-1", "a.b", "Förderer", "null", "true", "-", "="]
)
_TEXTS = st.one_of(st.just(""), st.text(max_size=12), st.sampled_from(["yes", "a: b", "# c", " x ", "multi\nline"]))


def _some(names: list[str], most: int = 3) -> st.SearchStrategy[tuple[str, ...]]:
    if not names:
        return st.just(())
    return st.lists(st.sampled_from(names), unique=True, max_size=most).map(tuple)


def formulas(places: list[str], transitions: list[str]) -> st.SearchStrategy[Formula]:
    """State formulas in the normal form that the parser gives: no conjunction of one, none nested in its like."""
    atoms: list[st.SearchStrategy[Formula]] = [
        st.sampled_from([Constant(True), Constant(False), Start(), Deadlock()]),
    ]
    if places:
        atoms.append(st.sampled_from(places).map(Holds))
    if transitions:
        atoms.append(st.sampled_from(transitions).map(Firable))
    return st.recursive(
        st.one_of(atoms),
        lambda inner: st.one_of(
            inner.map(Not),
            st.lists(inner, min_size=2, max_size=3).map(lambda operands: And(tuple(operands))),
            st.lists(inner, min_size=2, max_size=3).map(lambda operands: Or(tuple(operands))),
        ),
        max_leaves=6,
    )


@st.composite
def whole_nets(draw: st.DrawFn) -> Net:
    """Nets with controllers, unowned places, commands, completions, time limits, gates, arbiters and properties.

    No self-loops: the format refuses them.
    """
    controllers = [
        Controller(name, draw(st.booleans()) and i == 0, draw(_TEXTS))
        for i, name in enumerate(draw(st.lists(st.sampled_from(["robot", "mc", "off", "12"]), unique=True)))
    ]
    owners: list[str | None] = [None, *(controller.name for controller in controllers)]
    places: dict[str, Place] = {}
    signals: dict[str, Signal] = {}

    def full(owner: str | None, local: str) -> str:
        return local if owner is None else f"{owner}.{local}"

    for local in draw(st.lists(_WORDS, unique=True, max_size=3)):
        owner = draw(st.sampled_from(owners))
        signals[full(owner, f"s{local}")] = Signal(full(owner, f"s{local}"), owner)
    for local in draw(st.lists(_WORDS, unique=True, max_size=5)):
        owner = draw(st.sampled_from(owners))
        command = completion = None
        if draw(st.booleans()):
            parameters = draw(st.dictionaries(st.sampled_from(["to", "at", "on"]), _TEXTS, max_size=2))
            command = Command(draw(_WORDS), draw(_WORDS), tuple(parameters.items()))
            if draw(st.booleans()):
                completion = full(owner, f"done{draw(st.integers(1, 2))}")
                signals[completion] = Signal(completion, owner, SignalKind.COMPLETION)
        name = full(owner, local)
        places[name] = Place(name, owner, draw(st.booleans()), command, completion, draw(_TEXTS))

    transitions = []
    for i in range(draw(st.integers(0, 3))):
        inputs = draw(_some(list(places)))
        outputs = tuple(name for name in draw(_some(list(places))) if name not in inputs)
        gates = draw(
            st.lists(st.builds(ExternalGate, st.sampled_from(list(signals)), st.booleans()), unique=True, max_size=3)
            if signals
            else st.just([])
        )
        implied = (ExternalGate(done) for name in inputs if (done := places[name].completion))
        transitions.append(
            Transition(
                f"t{i}",
                inputs,
                outputs,
                draw(_some(list(places))),
                draw(_some(list(places))),
                tuple(dict.fromkeys((*gates, *implied))),
                i if draw(st.booleans()) else None,
                draw(_TEXTS),
            )
        )
    names = [transition.name for transition in transitions]
    arbiters = []
    if len(names) > 1 and draw(st.booleans()):
        arbiters.append(Arbiter("next", tuple(names[:2]), draw(st.sampled_from(ArbitrationRule))))
    properties: list[Property | TemporalProperty] = []
    if "true" not in places:  # a place of this name cannot be named in a formula
        for i, kind in enumerate(draw(st.lists(st.sampled_from(PropertyKind), max_size=3))):
            some = formulas(list(places), names)
            then = draw(some) if kind is PropertyKind.LEADS_TO else None
            fairness = draw(st.sampled_from(Fairness)) if then is not None else Fairness.WEAK
            properties.append(Property(f"p{i}", kind, draw(some), then, fairness))
        for i, logic in enumerate(draw(st.lists(st.sampled_from(Logic), max_size=1))):
            some_of = {Logic.CTL: ctl_formulas, Logic.LTL: ltl_formulas}[logic]
            properties.append(TemporalProperty(f"l{i}", logic, draw(some_of(list(places), names))))
    net = Net(
        draw(_TEXTS.filter(str.isprintable)),
        tuple(places.values()),
        tuple(transitions),
        tuple(signals.values()),
        tuple(controllers),
        tuple(arbiters),
        tuple(properties),
        draw(_TEXTS),
    )
    return with_limits(net, draw(_some(waiting(net))), draw(st.integers(1, 24 * 60 * 60 * 1000)))
