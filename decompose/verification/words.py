"""What a verdict on the net says in words, and how much weight it has: a person acts on the sentence.

Whether the sentence is true is what evidence shows, of the verdict's name (`firable.analysis.evidence.meaning`). The
words are written here a second time, so that a bundle cannot show one thing and print another.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from firable.nets.formula import format_formula
from firable.nets.net import Fairness, Net, PropertyKind, TemporalProperty
from firable.nets.temporal import format_temporal
from firable.nets.verdict import Weight

_REQUIRED, _WARNING, _INFORMATION = Weight.REQUIRED, Weight.WARNING, Weight.INFORMATION

SENTENCES: Final[Mapping[str, tuple[str, frozenset[Weight]]]] = {
    name: (sentence, frozenset(weights))
    for name, sentence, *weights in (
        ("contact-free", "no transition is held back only by a full output place", _REQUIRED),
        ("deadlock-free", "in every reachable marking some transition is firable, external gates free", _REQUIRED),
        ("doomed-markings", "no reachable marking is doomed: a deadlock can still be avoided from each", _WARNING),
        ("quasi-live", "no transition is dead: each can fire at least once", _REQUIRED),
        ("live", "from every reachable marking every transition can fire again, external gates free", _WARNING),
        ("reversible", "the initial marking can be reached from every reachable marking", _INFORMATION),
        ("home-markings", "some marking can be reached from every reachable marking", _INFORMATION),
        ("self-loops", "no place is both input and output of one transition", _WARNING),
        ("structural-conflicts", "no two transitions share an input or an output place", _INFORMATION),
        (
            "effective-conflicts",
            "no two transitions compete for a place at a reachable marking",
            *(_WARNING, _INFORMATION),  # by `weight_of_conflicts`
        ),
        ("gate-races", "no transition closes an internal gate of another one", _INFORMATION),
        ("conflicting-commands", "no machine is under two different commands at once", _REQUIRED),
        ("shared-completions", "no completion signal is awaited by two commands at once", _REQUIRED),
        ("machine-never-stopped", "every machine that is started can be stopped by another command", _WARNING),
        (
            "output-signals-in-M0",
            "no place that sends a command holds a token in the initial marking",
            _WARNING,
        ),
        (
            "starvation",
            "every live transition fires again and again in the arbitrated run with all external gates open",
            _WARNING,
        ),
    )
}
"""The sentence of each verdict on a net, and the weights that it may have."""

_FAIRNESS: Final = {
    Fairness.NONE: "without any assumption of fairness",
    Fairness.WEAK: "under weak fairness (a transition that stays firable fires; its external gates do open)",
    Fairness.STRONG: (
        "under strong fairness (a transition that is firable again and again fires; its external gates do open)"
    ),
}


def weight_of_conflicts(net: Net, *, proved: bool) -> Weight:
    """A warning that there are effective conflicts, unless those at each place are decided by one arbiter."""
    names, decided = [t.name for t in net.transitions], [set(arbiter.among) for arbiter in net.arbiters]
    at_places = ({names[t] for t in some} for some in (*net.competitors, *net.producers) if len(some) > 1)
    arbitrated = all(any(together <= among for among in decided) for together in at_places)
    return Weight.INFORMATION if proved or arbitrated else Weight.WARNING


def sentence_of(net: Net, name: str) -> tuple[str, frozenset[Weight]] | None:
    """The sentence of a verdict and the weights that it may have; None for a verdict that nobody knows."""
    kind, _, rest = name.partition(".")
    if kind != "property":
        return SENTENCES.get(name)
    for prop in net.properties:
        if prop.name != rest:
            continue
        required = frozenset({Weight.REQUIRED})
        if isinstance(prop, TemporalProperty):
            return f"{prop.logic.upper()}: {format_temporal(prop.formula)}", required
        formula = format_formula(prop.formula)
        match prop.kind:
            case PropertyKind.NEVER:
                return f"never ({formula})", required
            case PropertyKind.ALWAYS:
                return f"always ({formula})", required
            case PropertyKind.REACHABLE:
                return f"({formula}) is reachable, external gates free", required
            case PropertyKind.ALWAYS_POSSIBLE:
                return f"from every reachable marking ({formula}) can be reached, external gates free", required
            case PropertyKind.LEADS_TO:
                then = format_formula(prop.then) if prop.then is not None else ""
                return f"({formula}) is always followed by ({then}), {_FAIRNESS[prop.fairness]}", required
    return None
