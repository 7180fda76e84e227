"""What is asked of a cell with its machines, stated anew: the verdicts `loop.*` and `fault.*`, by their properties.

The sentences and the formulas are those of docs/machines.md. Each verdict comes down to properties of the net of the
loop, one for each transition, place or completion that it is about, and all of them must hold. What the places of the
loop are called is asked of the second reading of the plant (`plant`), and which transitions of the loop are ways of a
transition of the cell is told by its names, so nothing here rests on what the prover says of its own loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import combinations
from typing import Any

from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import ACCIDENT, OVERRUN
from firable.decompose.verification.same_loop import by_happening
from firable.decompose.verification.words import sentence_of
from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, Not, Or, Start
from firable.nets.net import Net, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.temporal import Fires, TemporalOr
from firable.nets.verdict import Weight
from firable.nets.well_formed import as_name


@dataclass(frozen=True)
class Question:
    """A verdict with its sentence, and the properties of the loop that it comes down to, by what each is about."""

    name: str
    sentence: str
    of: Mapping[str, Property | TemporalProperty]
    weight: Weight = Weight.REQUIRED


class Asked:
    """The questions to one loop: `plant` is the second reading of it, `loop` its net."""

    def __init__(self, plant: Plant, loop: Net) -> None:
        self.plant, self.cell = plant, plant.net
        self.ways = {
            name: [t.name for t in some]
            for name, some in by_happening(plant, loop.transitions).items()
            if name in plant.net.transition_index
        }
        self.accident, self.overrun = (Holds(self.of(thing)) for thing in (ACCIDENT, OVERRUN))
        self.ended = Or((self.accident, self.overrun))

    def of(self, thing: str, value: str | None = None) -> str:
        """The place that says that a thing has a value, or without one that it is so."""
        return self.plant.things[thing][True if value is None else value]

    # --- The questions

    def of_the_loop(self) -> Iterator[Question]:
        """What is asked of the cell whose machines do not fail."""
        names = [t.name for t in self.cell.transitions]
        yield Question(
            "loop.busy-machines",
            "no machine is given a command while it is at another",
            {"": _never("loop.busy", self.overrun)},
        )
        yield Question(
            "loop.accidents",
            "no machine collides, grasps nothing, or machines what is not there",
            {"": _never("loop.accident", self.accident)},
        )
        yield Question(
            "loop.completions",
            "a place that waits for a completion has its machine at work, or the completion is there",
            {of: _never(f"loop.completion.{i}", lost) for i, (of, lost) in enumerate(self.lost())},
        )
        yield Question(
            "loop.deadlock-free",
            "from every reachable marking some transition of the cell can fire, as its machines allow",
            {"": self.possible("loop.hang", _any(map(self.fires, names)))},
        )
        yield Question(
            "loop.gates-open",
            "every gate that a transition waits for can still open",
            {
                t.name: self.possible(f"loop.gate.{i}", _any((self.fires(t.name), Not(self.waits(t)))))
                for i, t in enumerate(t for t in self.cell.transitions if t.external)
            },
        )
        yield Question(
            "loop.live",
            "from every reachable marking every transition can fire again, as its machines allow",
            {name: self.possible(f"loop.live.{i}", self.fires(name)) for i, name in enumerate(names)},
            Weight.WARNING,
        )
        yield from (self.of_the_file(prop) for prop in self.cell.properties if not self.unclear(prop))

    def of_any_fault(self) -> Question:
        """That a fault is safe, as no accident can happen anyway (`firable.nets.machines.slower`)."""
        asked = {question.name: question.of for question in self.of_the_loop()}
        return Question(
            "fault.safe",
            "no accident follows when a machine fails and is not repaired",
            {name: asked[name][""] for name in ("loop.busy-machines", "loop.accidents")},
        )

    def of_repairs(self, repaired: Iterable[str], live: Iterable[str]) -> Iterator[Question]:
        """What is asked of each machine that is repaired, which is one that takes longer; `live` fire again without."""
        asked = {question.name: question.of for question in self.of_the_loop()}
        of = {name: asked["loop.live"][name] for name in live}
        for machine in repaired:
            yield Question(
                f"fault.{as_name(machine)}.repaired",
                f"after {machine} was repaired and goes on, all that is live without faults can fire again",
                of,
            )

    def of_faults(self, live: Iterable[str]) -> Iterator[Question]:
        """What is asked of the cell of which one machine may fail for good; `live` fire again and again without."""
        live = tuple(live)
        for machine in self.plant.may_fail:
            its = f"fault.{as_name(machine)}"
            well = Not(Holds(self.of(f"failed {machine}")))
            fires = [Or((well, self.fires(name))) for name in live]
            leaves = [Or((well, Not(Holds(place.name)))) for place in self.cell.places]
            yield Question(
                its,
                f"when {machine} has failed for good, all that is live without faults can still fire again",
                {name: self.possible(f"{its}.t{i}", fires[i]) for i, name in enumerate(live)},
                Weight.INFORMATION,
            )
            yield Question(
                f"{its}.places",
                f"when {machine} has failed for good, every place can still lose its token",
                {p.name: self.possible(f"{its}.p{i}", leaves[i]) for i, p in enumerate(self.cell.places)},
                Weight.INFORMATION,
            )

    # --- What they are made of

    def fires(self, name: str) -> Formula:
        """One of the ways of a transition of the cell is firable."""
        return _any(map(Firable, self.ways[name]))

    def waits(self, t: Transition) -> Formula:
        """Eq. (1) of a transition, its external gates left out."""
        full, empty = (*t.inputs, *t.permissive), (*t.outputs, *t.inhibitive)
        return _all((*map(Holds, full), *(Not(Holds(place)) for place in empty)))

    def possible(self, name: str, formula: Formula) -> Property:
        """The formula can come to hold again, unless the run has ended in an accident."""
        return Property(name, PropertyKind.ALWAYS_POSSIBLE, Or((formula, self.ended)))

    def lost(self) -> Iterator[tuple[str, Formula]]:
        """Places that wait for a completion that will not come, and two that wait for the same."""
        waiting = [place for place in self.cell.places if place.completion is not None]
        for place in waiting:
            there = [self.of(f"at {self.plant.machine_of(place)}", place.name), f"{place.completion}"]
            if place.completion in self.plant.sensed:
                there.append(self.of(f"acknowledged {place.completion}"))
            yield place.name, And((Holds(place.name), *(Not(Holds(name)) for name in there), Not(self.ended)))
        for one, other in combinations(waiting, 2):
            if one.completion == other.completion:
                yield f"{one.name} and {other.name}", And((Holds(one.name), Holds(other.name)))

    def of_the_file(self, prop: Property | TemporalProperty) -> Question:
        """A property of the net file; that the cell is never in a deadlock says that it never hangs."""
        found = sentence_of(self.cell, f"property.{prop.name}")
        sentence = (found or ("",))[0]
        for free in (", external gates free", "; its external gates do open"):
            sentence = sentence.replace(free, "")
        name = f"cell.{prop.name}"
        put: Property | TemporalProperty
        if isinstance(prop, TemporalProperty):
            put = replace(prop, name=name, formula=self.in_loop(prop.formula))
        elif _never_a_deadlock(prop):
            put = self.possible(name, _any(self.fires(t.name) for t in self.cell.transitions))
        else:
            then = None if prop.then is None else self.in_loop(prop.then)
            put = replace(prop, name=name, formula=self.in_loop(prop.formula), then=then)
        return Question(f"loop.property.{prop.name}", sentence, {"": put})

    def in_loop(self, part: Any) -> Any:
        """A formula of the cell as one of the loop."""
        match part:
            case Firable():
                return self.fires(part.transition)
            case Fires():
                ways = tuple(map(Fires, self.ways[part.transition]))
                return ways[0] if len(ways) == 1 else TemporalOr(ways) if ways else Constant(value=False)
            case Start():
                return _all(Holds(p.name) if p.marked else Not(Holds(p.name)) for p in self.cell.places)
            case tuple():
                return tuple(self.in_loop(one) for one in part)
        if not is_dataclass(part) or isinstance(part, type):
            return part
        return type(part)(**{one.name: self.in_loop(getattr(part, one.name)) for one in fields(part)})

    def unclear(self, prop: Property | TemporalProperty) -> bool:
        """Whether a property speaks of deadlocks where sensors or workpieces never rest; then it is not asked."""
        model = self.plant.model
        sensors = model.sensors.values()
        moved = (one.acknowledges is not None or one.set_by is not None for one in sensors)
        restless = any(moved) or any(one.may_flicker or one.may_linger for one in sensors)
        passes = any(out.station == model.arrivals.station for out in model.departures)
        return (restless or passes) and not _never_a_deadlock(prop) and _speaks_of_deadlock(prop)


def _never_a_deadlock(prop: Property | TemporalProperty) -> bool:
    return isinstance(prop, Property) and (prop.kind, prop.formula) == (PropertyKind.NEVER, Deadlock())


def _speaks_of_deadlock(part: Any) -> bool:
    if isinstance(part, tuple):
        return any(map(_speaks_of_deadlock, part))
    below = fields(part) if is_dataclass(part) and not isinstance(part, type) else ()
    return isinstance(part, Deadlock) or any(_speaks_of_deadlock(getattr(part, one.name)) for one in below)


def _never(name: str, formula: Formula) -> Property:
    return Property(name, PropertyKind.NEVER, formula)


def _any(formulas: Iterable[Formula]) -> Formula:
    some = tuple(formulas)
    return some[0] if len(some) == 1 else Or(some) if some else Constant(value=False)


def _all(formulas: Iterable[Formula]) -> Formula:
    some = tuple(formulas)
    return some[0] if len(some) == 1 else And(some) if some else Constant(value=True)
