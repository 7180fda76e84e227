"""Contact, deadlock, liveness, reversibility, home and doomed markings: what the reachability graph says by its shape.

All are the definitions of SEMANTICS, decided on the explicit graph:

- a transition is *live* iff from every reachable marking one can be reached in which it may fire;
- the net is *reversible* iff M0 can be reached from every reachable marking;
- a *home marking* can be reached from every reachable marking: the markings of the bottom component, if there is only
  one;
- a marking is *doomed* iff every run from it ends in a deadlock, whatever is chosen: no cycle can be reached from it. A
  deadlock is doomed itself. The alternative reading, "M0 cannot be reached again", condemns every start-up phase.

Each violation comes with a shortest firing sequence: into the deadlock, to the first marking in contact, to the first
marking from which the transition can never fire again. For a doomed marking that is the point of no return: the last
firing of the sequence is the mistake.

Weights. Contact, deadlock and a dead transition are defects of a controller and fail it. A transition that can fire
only during start-up is legal but rare, so liveness warns; so do doomed markings, which repeat the deadlock's
violation at the place where it can still be mended. Reversibility and home markings inform.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from firable.analysis.question import Answer, Question, listed, no, yes
from firable.analysis.spaces.reachability import Column, ReachabilityGraph, WitnessError, first
from firable.nets.verdict import Verdict, Weight


@dataclass(frozen=True)
class Behaviour:
    """The sets of markings and transitions that the verdicts speak of; each is computed once, when asked for.

    Raises `IncompleteGraph` or `BudgetExceeded` where a set needs more than is there.
    """

    graph: ReachabilityGraph

    @cached_property
    def contacts(self) -> dict[str, int]:
        """For each transition that is in contact somewhere, the number of markings found where it is."""
        counts = self.graph.engine.contacts()
        return {self._name(t): count for t, count in enumerate(counts) if count}

    @cached_property
    def fired(self) -> tuple[int, ...]:
        """The transitions that fire on some edge found, by index."""
        return tuple(t for t, count in enumerate(self.graph.engine.fired()) if count)

    @cached_property
    def never_fire(self) -> tuple[str, ...]:
        """The transitions that can never fire for a reason one can see without exploring.

        A place that is both input and output must hold a token and hold none; a signal wanted both 1 and 0 closes a
        gate for ever.
        """
        return tuple(
            transition.name
            for transition in self.graph.net.transitions
            if transition.self_loops or not transition.openable
        )

    @cached_property
    def dead(self) -> tuple[str, ...]:
        """The transitions that never fire."""
        self.graph.require_complete()
        return tuple(t.name for i, t in enumerate(self.graph.net.transitions) if i not in self.fired)

    @cached_property
    def live(self) -> tuple[str, ...]:
        """The live transitions."""
        return tuple(self._name(t) for t, live in enumerate(self.graph.engine.live()) if live)

    @cached_property
    def nonlive(self) -> tuple[str, ...]:
        """The transitions that are not live, dead ones included."""
        return tuple(self._name(t) for t, live in enumerate(self.graph.engine.live()) if not live)

    @cached_property
    def reversible(self) -> bool:
        """Whether M0 can be reached from every reachable marking."""
        return self.graph.engine.reversible()

    @cached_property
    def home(self) -> int:
        """The number of home markings."""
        return sum(self.graph.engine.home_markings())

    @cached_property
    def doomed(self) -> Column:
        """The markings from which every run ends in a deadlock."""
        doomed: Column = ~self.graph.backward(self.graph.components().nontrivial)
        return doomed

    def _name(self, t: int) -> str:
        return self.graph.net.transitions[t].name


def contact_free(behaviour: Behaviour) -> Verdict:
    """No reachable marking is in contact: the guard of the firing rule hides no collision."""
    question = Question(
        "contact-free",
        "no transition is held back only by a full output place",
        hint="take a place that is free when the output place is empty as an input, or check the arcs",
    )

    def find() -> Answer:
        graph, counts = behaviour.graph, behaviour.contacts
        if counts:
            lowest = {t: graph.engine.contact_witness(graph.net.transition_index[t]) for t in counts}
            index, name = min((i, t) for t, i in lowest.items() if i is not None)
            masks = graph.net.masks[graph.net.transition_index[name]]
            full = graph.net.names(masks.outputs & ~masks.inputs & graph.marking(index))
            note = f"the inputs of {name} are there and {listed(full)} is full"
            return no(tuple(counts), graph.witness(index, note))
        graph.require_complete()
        return yes()

    return question.ask(behaviour.graph, find)


def deadlock_free(behaviour: Behaviour) -> Verdict:
    """No reachable marking is a deadlock."""
    question = Question(
        "deadlock-free",
        "in every reachable marking some transition is firable, external gates free",
        hint="the sequence leads into the deadlock; `doomed-markings` shows where it can no longer be avoided",
    )

    def find() -> Answer:
        graph = behaviour.graph
        deadlock = first(graph.deadlocks)
        if deadlock is not None:
            count = int(graph.deadlocks.sum())
            found = (
                "1 marking of the net is a deadlock" if count == 1 else f"{count:,} markings of the net are deadlocks"
            )
            note = found if graph.complete else f"at least {found}"
            return no((), graph.witness(deadlock, note))
        graph.require_complete()
        return yes()

    return question.ask(behaviour.graph, find)


def quasi_live(behaviour: Behaviour) -> Verdict:
    """Every transition can fire at least once; the ones that cannot are dead."""
    question = Question(
        "quasi-live",
        "no transition is dead: each can fire at least once",
        hint="check its inputs and gates; a place that is only read is a permissive gate, not an input and an output",
    )

    def find() -> Answer:
        if behaviour.graph.complete:
            return Answer(not behaviour.dead, behaviour.dead)
        if behaviour.never_fire:
            return no(behaviour.never_fire)
        if len(behaviour.fired) < len(behaviour.graph.net.transitions):
            behaviour.graph.require_complete()
        return yes()

    return question.ask(behaviour.graph, find)


def all_live(behaviour: Behaviour) -> Verdict:
    """Every transition is live."""
    question = Question(
        "live",
        "from every reachable marking every transition can fire again, external gates free",
        Weight.WARNING,
        hint="right for what happens only at start-up; otherwise this part of the cell is lost for good",
    )

    def find() -> Answer:
        graph, nonlive = behaviour.graph, behaviour.nonlive
        if not nonlive:
            return yes()
        # One is shown, as each costs a closure; a dead one only where there is no other, since it has its own verdict.
        name = next((name for name in nonlive if name not in behaviour.dead), nonlive[0])
        index = first(~graph.backward(graph.may_fire(graph.net.transition_index[name])))
        if index is None:
            raise WitnessError(f"{name} is not live and can fire again from everywhere")
        return no(nonlive, graph.witness(index, f"{name} can never fire after this"))

    return question.ask(behaviour.graph, find)


def reversible(behaviour: Behaviour) -> Verdict:
    """M0 can be reached from every reachable marking."""
    question = Question(
        "reversible", "the initial marking can be reached from every reachable marking", Weight.INFORMATION
    )

    def find() -> Answer:
        if behaviour.reversible:
            return yes()
        graph = behaviour.graph
        targets = graph.deadlocks & False
        targets[0] = True
        index = first(~graph.backward(targets))
        witness = None if index is None else graph.witness(index, "the initial marking can never be reached again")
        return no((), witness)

    return question.ask(behaviour.graph, find)


def home_markings(behaviour: Behaviour) -> Verdict:
    """Some marking can be reached from every reachable marking."""
    question = Question("home-markings", "some marking can be reached from every reachable marking", Weight.INFORMATION)

    def find() -> Answer:
        graph = behaviour.graph
        if behaviour.home:
            return yes()
        components = graph.components()
        index = first(components.bottom[components.of])
        if index is None:
            raise WitnessError("a finite graph has a bottom component")
        note = (
            f"nothing leads back from here, and {int(components.bottom.sum()) - 1:,} other parts of the graph are such"
        )
        return no((), graph.witness(index, note))

    return question.ask(behaviour.graph, find)


def no_doomed(behaviour: Behaviour) -> Verdict:
    """No reachable marking is doomed: while the cell runs, every deadlock can still be avoided."""
    question = Question(
        "doomed-markings",
        "no reachable marking is doomed: a deadlock can still be avoided from each",
        Weight.WARNING,
        hint="the last firing of the sequence is the point of no return: give it an input or gate that forbids it",
    )

    def find() -> Answer:
        graph = behaviour.graph
        index = first(behaviour.doomed)
        if index is None:
            return yes()
        note = f"{int(behaviour.doomed.sum()):,} doomed markings; from here every run ends in a deadlock"
        return no((), graph.witness(index, note))

    return question.ask(behaviour.graph, find)
