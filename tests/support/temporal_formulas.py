"""Hypothesis strategies: formulas of CTL and LTL over given places and transitions, as the parser makes them."""

from hypothesis import strategies as st

from firable.nets.formula import Compare, Count, Deadlock, Firable, Holds, Sign, Start
from firable.nets.temporal import (
    Eventually,
    Exists,
    Fires,
    ForAll,
    Globally,
    Next,
    Release,
    Temporal,
    Until,
    WeakUntil,
    all_of,
    any_of,
    negated,
)


def _atoms(places: list[str], transitions: list[str]) -> list[st.SearchStrategy[Temporal]]:
    atoms: list[st.SearchStrategy[Temporal]] = [st.sampled_from([Start(), Deadlock()])]
    if places:
        some = st.lists(st.sampled_from(places), min_size=1, max_size=3).map(tuple)
        atoms.append(st.sampled_from(places).map(Holds))
        atoms.append(st.builds(Compare, st.builds(Count, some), st.sampled_from(Sign), st.builds(Count, some)))
    if transitions:
        atoms.append(st.sampled_from(transitions).map(Firable))
    return atoms


def _boolean(inner: st.SearchStrategy[Temporal]) -> list[st.SearchStrategy[Temporal]]:
    pairs = st.tuples(inner, inner)
    return [inner.map(negated), pairs.map(all_of), pairs.map(any_of)]


def ctl_formulas(places: list[str], transitions: list[str], leaves: int = 5) -> st.SearchStrategy[Temporal]:
    """Formulas of CTL."""

    def more(inner: st.SearchStrategy[Temporal]) -> st.SearchStrategy[Temporal]:
        paths = st.one_of(inner.map(Next), inner.map(Eventually), inner.map(Globally), st.builds(Until, inner, inner))
        return st.one_of(*_boolean(inner), paths.map(Exists), paths.map(ForAll))

    return st.recursive(st.one_of(_atoms(places, transitions)), more, max_leaves=leaves)


def ltl_formulas(
    places: list[str], transitions: list[str], leaves: int = 5, *, events: bool = True
) -> st.SearchStrategy[Temporal]:
    """Formulas of LTL, with events if asked for."""

    def more(inner: st.SearchStrategy[Temporal]) -> st.SearchStrategy[Temporal]:
        unary = (inner.map(Next), inner.map(Eventually), inner.map(Globally))
        binary = (st.builds(Until, inner, inner), st.builds(Release, inner, inner), st.builds(WeakUntil, inner, inner))
        return st.one_of(*_boolean(inner), *unary, *binary)

    atoms = _atoms(places, transitions)
    if events and transitions:
        atoms.append(st.sampled_from(transitions).map(Fires))
    return st.recursive(st.one_of(atoms), more, max_leaves=leaves)
