"""Runs of a protocol from its start, with a net on which they happen, both found by z3.

That an action does not keep the invariant shows only that the proof breaks; the configuration in which it breaks may
be one that nobody reaches. So each wrong protocol is refuted by a run: the actions are given, one after the other,
and z3 finds places, arcs, gates, owners and a marking that make all of them possible and the end wrong. The net is
then made small, fact by fact, and built as a `Net`; and the reference player says that its firings go wrong, or the
run is not shown. The right protocol has such runs too, of which nothing is wrong: they show that every action can
happen, and that what is proved is not proved of nothing.

A run stands as text, `promise r1 G a; fire l`: an action and the names for its parameters. Names of rounds are r1, r2;
of coordinated transitions capital letters, of local ones small; of controllers a, b, c; of coordinators k1, k2. There
are no other things but places, which are p1, p2 and so on, as many as asked for; a place that a step names is a signal.
The parts that are free of promise are those of which a step says that they stand, or are applied as such.
Rejected: a search for the actions, too; it takes minutes where this takes a tenth of a second, and the runs worth
showing are known.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import z3

from firable.analysis.induction.smt import SEED
from firable.decompose.protocol.parametric.logic import (
    Formula,
    Relation,
    Sort,
    Variable,
    any_of,
    both,
    forall,
    free_variables,
    same,
)
from firable.decompose.protocol.parametric.script import Script
from firable.decompose.protocol.parametric.system import (
    INITIAL,
    TAKES_NONE_BACK,
    Controller,
    Coordinator,
    Place,
    Protocol,
    Round,
    Transition,
    central_enabled,
    clears,
    coordinated,
    free,
    inhibitive_of,
    initially,
    input_of,
    marked,
    output_of,
    owner,
    p,
    permissive_of,
    reads,
    shadow,
    signal,
    t,
    takes_part,
)
from firable.nets import net as nets
from firable.semantics.player import Player

_ARCS: Final = (permissive_of, inhibitive_of, input_of, output_of)


@dataclass(frozen=True)
class Run:
    """A net, what happened on it, and where it ended."""

    net: nets.Net
    events: tuple[str, ...]
    signals: tuple[tuple[str, bool], ...]
    """The value of each signal at the beginning."""
    course: tuple[str, ...]
    """What fired, local transitions when they fire, others when they are decided, and the signals that changed."""
    local: tuple[str, ...]
    """The places that the controllers have a token on at the end."""
    central: tuple[str, ...]
    """The places of the shadow, for what it is worth where the central net could not follow."""


@dataclass(frozen=True)
class _Stage:
    """The things of a run, by their names."""

    places: tuple[Variable, ...]
    signals: tuple[Variable, ...]
    transitions: tuple[Variable, ...]
    controllers: tuple[Variable, ...]
    rounds: tuple[Variable, ...]
    coordinators: tuple[Variable, ...]
    free: frozenset[tuple[str, str]]
    """The parts that are free of promise."""
    cleared: frozenset[tuple[str, str]]
    """Which transitions clear which signals, as far as steps say so; no others do."""

    @property
    def sorts(self) -> tuple[tuple[Sort, tuple[Variable, ...]], ...]:
        return (
            (Place, (*self.places, *self.signals)),
            (Transition, self.transitions),
            (Controller, self.controllers),
            (Round, self.rounds),
            (Coordinator, self.coordinators),
        )


Step = tuple[str, tuple[str, ...]]


def steps_of(text: str) -> tuple[Step, ...]:
    """The actions of a run and the names for their parameters.

    >>> steps_of("ask r1 G; fire l")
    (('ask', ('r1', 'G')), ('fire', ('l',)))
    """
    words = (step.split() for step in text.split(";"))
    return tuple((name, tuple(names)) for name, *names in words)


def find_run(
    protocol: Protocol, steps: Sequence[Step], places: int, goal: Formula, given: Sequence[Formula] = ()
) -> Run | None:
    """A run of these steps after which `goal` holds, on a net of so many places; None where there is none.

    `given` holds at the start, and `goal` at the end; the goal `NOT_FOLLOWED` speaks of the moment before the last
    step. The names in both are those of the steps, as `Variable`s. Errors: `KeyError` for an action that the protocol
    does not have. Some tenths of a second.
    """
    stage = _stage(protocol, steps, places, given)
    facts = tuple(_facts(stage))
    script = _script(protocol, stage, steps, goal, given)
    for number, fact in enumerate(facts):
        script.observe(fact, f"fact-{number}")
    for place in stage.places:
        script.observe(marked(place), f"local-{place.name}")
        script.observe(shadow(place), f"central-{place.name}")
    model = _smallest(script.text(), len(facts))
    if model is None:
        return None
    holding = [fact for n, fact in enumerate(facts) if f"fact-{n}" in model]
    names = {
        place: f"{next(c.name for c in stage.controllers if same(owner(place), c) in holding)}.{place.name}"
        for place in (*stage.places, *stage.signals)
    }
    return Run(
        _net(stage, names, holding),
        tuple(_events(protocol, steps)),
        tuple((names[each], initially(each) in holding) for each in stage.signals),
        tuple(_course(protocol, steps, names)),
        tuple(names[p] for p in stage.places if f"local-{p.name}" in model),
        tuple(names[p] for p in stage.places if f"central-{p.name}" in model),
    )


def before_last(run: Run) -> tuple[tuple[str, ...], dict[str, bool]] | None:
    """The marking of the central net before the last firing of a run, and the signals; None where it comes to none."""
    *before, _ = run.course
    return _played(run, before)


def central_marking(run: Run) -> tuple[str, ...] | None:
    """The marking of the central net at the end of a run; None where it cannot fire what fired."""
    played = _played(run, run.course)
    return None if played is None else played[0]


def _played(run: Run, course: Sequence[str]) -> tuple[tuple[str, ...], dict[str, bool]] | None:
    """By the reference player: each firing where it is enabled."""
    player, marking, signals = Player(run.net), run.net.initial_marking, dict(run.signals)
    for name in course:
        if name in signals:
            signals[name] = not signals[name]
        elif (fired := run.net.transition_index[name]) in player.enabled(marking, signals):
            marking = player.fire(marking, [fired])
        else:
            return None
    return run.net.names(marking), signals


def _stage(protocol: Protocol, steps: Sequence[Step], places: int, given: Sequence[Formula]) -> _Stage:
    found = {variable: None for step in steps for _, variable in _named(protocol, step)}
    found.update(dict.fromkeys(variable for formula in given for variable in free_variables(formula)))

    def of(sort: Sort) -> tuple[Variable, ...]:
        return tuple(sorted((v for v in found if v.sort == sort), key=lambda v: v.name))

    ordinary = tuple(Variable(f"p{i + 1}", Place) for i in range(places))
    parts = frozenset((names[-2], names[-1]) for name, names in steps if name in {"stand", "apply-free"})
    cleared = frozenset((names[-2], names[-1]) for name, names in steps if name == "sense-late")
    return _Stage(ordinary, of(Place), of(Transition), of(Controller), of(Round), of(Coordinator), parts, cleared)


def _named(protocol: Protocol, step: Step) -> Iterator[tuple[Variable, Variable]]:
    """Each parameter of the action with the thing that takes its place."""
    name, names = step
    for parameter, text in zip(protocol.action(name).parameters, names, strict=True):
        yield parameter, Variable(text, parameter.sort)


def _events(protocol: Protocol, steps: Sequence[Step]) -> Iterator[str]:
    for step in steps:
        spoken = {
            parameter.name: f"round {value.name[1:]}" if value.sort == Round else f"'{value.name}'"
            for parameter, value in _named(protocol, step)
        }
        yield protocol.action(step[0]).words.format(**spoken)


def _course(protocol: Protocol, steps: Sequence[Step], names: dict[Variable, str]) -> Iterator[str]:
    for step in steps:
        action, values = protocol.action(step[0]), dict(_named(protocol, step))
        if action.fires:
            yield values[t].name
        elif p in values and shadow in {update.relation for update in action.updates}:
            yield names[values[p]]


def _script(
    protocol: Protocol, stage: _Stage, steps: Sequence[Step], goal: Formula, given: Sequence[Formula]
) -> Script:
    script = Script()
    for words, formula in protocol.static:
        script.add(formula, f"net: {words}")
    for sort, things in stage.sorts:
        if things:
            any_thing = Variable("x", sort)
            script.add(forall(any_thing)(any_of([same(any_thing, thing) for thing in things])), f"all of {sort.name}")
            script.add(both([~same(left, right) for left, right in combinations(things, 2)]), "they are different")
    script.add(both(list(_tidy(stage))), "the net is one that an engineer would draw")
    for words, formula in INITIAL:
        script.add(formula, f"start: {words}")
    for formula in given:
        script.add(formula, "given")
    *before, last = steps
    for step in before:
        action, names = protocol.action(step[0]), {p: v.name for p, v in _named(protocol, step)}
        if action.fires and protocol.persistent:
            script.add(TAKES_NONE_BACK, "net: votes of free parts are persistent", names)
        script.step(action, names)
    names = {p: v.name for p, v in _named(protocol, last)}
    for demand in protocol.action(last[0]).demands:
        script.add(demand.formula, demand.words, names)
    if goal is NOT_FOLLOWED:
        script.add(~central_enabled(t), "the central net cannot follow", names)
    script.change(protocol.action(last[0]), names)
    if goal is not NOT_FOLLOWED:
        script.add(goal, "the end")
    return script


NOT_FOLLOWED: Final = ~central_enabled(t)
"""As a goal: the last step fires what the central net cannot fire then."""


def _tidy(stage: _Stage) -> Iterator[Formula]:
    """Capital letters are coordinated; who takes part owns something of it; signals are only read.

    A transition takes a token and puts one, and has one arc or gate to a place.
    """
    both_kinds = (*stage.places, *stage.signals)
    yield both([~signal(place) for place in stage.places])
    yield both([signal(each) for each in stage.signals])
    for transition in stage.transitions:
        is_coordinated = coordinated(transition)
        yield is_coordinated if transition.name.isupper() else ~is_coordinated
        for place in both_kinds:
            cleared = (transition.name, place.name) in stage.cleared
            yield clears(transition, place) if cleared else ~clears(transition, place)
        for moves in (input_of, output_of):
            yield any_of([moves(transition, place) for place in stage.places])
            yield both([~moves(transition, each) for each in stage.signals])
        for one, other in combinations(_ARCS, 2):
            yield both([~(one(transition, place) & other(transition, place)) for place in both_kinds])
        for controller in stage.controllers:
            is_free = (transition.name, controller.name) in stage.free
            yield free(transition, controller) if is_free else ~free(transition, controller)
            its = [reads(transition, place) & same(owner(place), controller) for place in both_kinds]
            yield takes_part(transition, controller).implies(any_of(its))


def _facts(stage: _Stage) -> Iterator[Formula]:
    """What there is to know of the net, in the order in which it is tried to do without."""
    both_kinds = (*stage.places, *stage.signals)
    for relation in _ARCS:
        for transition in stage.transitions:
            for place in both_kinds:
                yield relation(transition, place)
    for place in both_kinds:
        yield initially(place)
        for controller in stage.controllers:
            yield same(owner(place), controller)


def _smallest(text: str, facts: int) -> frozenset[str] | None:
    """The observations that hold in a model of which no fact can be left out."""
    solver = z3.Solver(ctx=z3.Context())
    solver.set("random_seed", SEED)
    solver.from_string(text)
    model = _holding(solver)
    if model is None:
        return None
    for number in range(facts):
        if f"fact-{number}" not in model:
            continue
        solver.push()
        gone = (n for n in range(facts) if n == number or f"fact-{n}" not in model)  # none of them comes back
        solver.add([z3.Not(z3.Bool(f"fact-{n}", solver.ctx)) for n in gone])
        smaller = _holding(solver)
        if smaller is None:
            solver.pop()
            solver.add(z3.Bool(f"fact-{number}", solver.ctx))
        else:
            model = smaller
    return model


def _holding(solver: z3.Solver) -> frozenset[str] | None:
    if solver.check() != z3.sat:
        return None
    model = solver.model()
    return frozenset(d.name() for d in model.decls() if d.arity() == 0 and z3.is_true(model[d]))


def _net(stage: _Stage, names: dict[Variable, str], facts: Sequence[Formula]) -> nets.Net:
    def arcs(relation: Relation, transition: Variable, of: tuple[Variable, ...]) -> tuple[str, ...]:
        return tuple(names[place] for place in of if relation(transition, place) in facts)

    def gates(transition: Variable) -> tuple[nets.ExternalGate, ...]:
        return tuple(
            nets.ExternalGate(name, wanted=wanted)
            for relation, wanted in ((permissive_of, True), (inhibitive_of, False))
            for name in arcs(relation, transition, stage.signals)
        )

    return nets.Net(
        "found",
        tuple(nets.Place(names[p], names[p].partition(".")[0], marked=initially(p) in facts) for p in stage.places),
        tuple(
            nets.Transition(
                transition.name,
                arcs(input_of, transition, stage.places),
                arcs(output_of, transition, stage.places),
                arcs(permissive_of, transition, stage.places),
                arcs(inhibitive_of, transition, stage.places),
                gates(transition),
            )
            for transition in stage.transitions
        ),
        tuple(nets.Signal(names[each], names[each].partition(".")[0]) for each in stage.signals),
        tuple(nets.Controller(controller.name) for controller in stage.controllers),
    )
