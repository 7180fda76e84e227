"""The complement of a place (Fig. 2 a/b of the paper): "robot free" becomes "robot busy".

The token and the arcs of the place are reversed, and the internal gates sourced there change kind, which the paper
does not say; then the firing rule, which is symmetric in inputs and outputs, gives an isomorphic reachability graph:
each marking with the bit of the place inverted. Not preserved: contact-freeness, P-invariants, and output signals,
since a command is sent on entry. So a place with an output signal is refused.
"""

from __future__ import annotations

from dataclasses import replace

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import And, Compare, Count, Formula, Holds, Not, Or
from firable.nets.net import Net, TemporalProperty, Transition
from firable.nets.temporal_parts import with_states


def complement(net: Net, place: str, *, new_name: str | None = None, flip_gates: bool = True) -> Net:
    """The net with `place` replaced by its complement, at the same index.

    The complement of `robot.free` is called `robot.not_free` unless `new_name` is given. With `flip_gates=False` the
    gates sourced in the place keep their kind, as in the letter of the paper: the graph then is another one.

    Raises `InputError` F2002 where there is no such place, F2020 where it has an output signal.
    """
    if place not in net.place_index:
        raise InputError(
            [Diagnostic("F2002", f"there is no place '{place}'", "name a place of the net", ("places", place))]
        )
    old = net.place(place)
    if old.command is not None:
        raise InputError(
            [
                Diagnostic(
                    "F2020",
                    f"'{place}' has an output signal, sent when a token enters; its complement would do so on leaving",
                    "complement a place that sends no command",
                    ("places", place),
                )
            ]
        )
    prefix = f"{old.owner}." if old.owner else ""
    name = new_name or f"{prefix}not_{place.removeprefix(prefix)}"

    def moved(source: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
        """`source` without the place, and with its complement where `other` had the place."""
        kept = tuple(p for p in source if p != place)
        return (*kept, name) if place in other else kept

    def renamed(source: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name if p == place else p for p in source)

    def changed(transition: Transition) -> Transition:
        permissive, inhibitive = transition.permissive, transition.inhibitive
        return replace(
            transition,
            inputs=moved(transition.inputs, transition.outputs),
            outputs=moved(transition.outputs, transition.inputs),
            permissive=moved(permissive, inhibitive) if flip_gates else renamed(permissive),
            inhibitive=moved(inhibitive, permissive) if flip_gates else renamed(inhibitive),
        )

    def sides(this: Count, other: Count) -> Count:
        # A token on the place is one less on its complement: what it adds here, the complement adds on the other side.
        kept = tuple(p for p in this.places if p != place)
        added = tuple(name for p in other.places if p == place)
        return Count((*kept, *added), this.added + len(this.places) - len(kept))

    def reversed_in(formula: Formula) -> Formula:
        match formula:
            case Holds(p) if p == place:
                return Not(Holds(name))
            case Compare(left, sign, right):
                return Compare(sides(left, right), sign, sides(right, left))
            case Not(operand):
                return Not(reversed_in(operand))
            case And(operands):
                return And(tuple(map(reversed_in, operands)))
            case Or(operands):
                return Or(tuple(map(reversed_in, operands)))
            case _:
                return formula

    return replace(
        net,
        places=tuple(replace(p, name=name, marked=not p.marked) if p is old else p for p in net.places),
        transitions=tuple(map(changed, net.transitions)),
        properties=tuple(
            replace(prop, formula=with_states(prop.formula, reversed_in))
            if isinstance(prop, TemporalProperty)
            else replace(prop, formula=reversed_in(prop.formula), then=reversed_in(prop.then) if prop.then else None)
            for prop in net.properties
        ),
    )
