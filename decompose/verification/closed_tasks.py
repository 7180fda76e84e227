"""A task alone, closed: the net that its conditions are about, and the markings inside it, both made anew.

docs/refinement.md has the conditions. The net is one that a document of evidence must be about, so it is made to the
letter. The markings are found by the token game on sets of names, the firing rule of docs/semantics.md in three lines:
they say what a running task may look like, and which of the resources that it releases it still has to release. That
nothing else is ever so is no trust in this search, but what a solver is asked of every transition (`relating`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Final

from firable.decompose.verification.refusal import NotShownError
from firable.nets.formula import And, Constant, Firable, Formula, Holds, Not, Or
from firable.nets.net import (
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    TimeLimit,
    Transition,
)
from firable.nets.tasks.model import Move, Task
from firable.nets.time_limits import fault_transition, timer_name

MARKINGS_MAX: Final = 5_000

CONDITIONS: Final = {
    "ends": ("from every marking inside the task one can be reached in which it can end", "property.ends"),
    "ends-clean": (
        "where the task can end, only its last steps are left, and every released role is idle",
        "property.ends-clean",
    ),
    "contact-free": (
        "no move of the task is held back only by a full place, and none releases a role twice",
        "contact-free",
    ),
    "complete": ("every move of the task can fire", "quasi-live"),
    "settles": ("every run inside the task is finite", "property.settles"),
    "orderly": ("no two transitions of the task compete for a place", "property.orderly"),
}
"""Each condition: what it says, and the verdict on the closed net that it is."""

INFORMING: Final = frozenset({"settles", "orderly"})
"""The conditions that need not hold."""


@dataclass(frozen=True)
class ClosedTask:
    """A task with a cell around it that does nothing else."""

    task: Task

    @cached_property
    def net(self) -> Net:
        """The net, with the conditions as its properties."""
        task, roles = self.task, [role.name for role in self.task.roles]
        steps = [
            Place(
                name,
                command=step.command,
                completion=f"{name}.done" if step.completion else None,
                description=step.description,
                within=TimeLimit(step.within, timer_name(name)) if step.within else None,
            )
            for name, (_, step) in task.steps.items()
        ]
        of = {step.name: step for step in steps}

        def made(move: Move, more: tuple[str, ...] = (), besides: tuple[str, ...] = ()) -> Transition:
            if move.late:
                return fault_transition(of[move.sources[0]], move.targets[0], move.name)
            done = dict.fromkeys(s for source in move.sources if source in of and (s := of[source].completion))
            sensors = (ExternalGate(f"{gate}.signal", gate.wanted) for gate in move.external)
            return Transition(
                move.name,
                (*more, *move.sources),
                (*besides, *move.targets, *(f"{role}.idle" for role in move.releases)),
                move.permissive,
                move.inhibitive,
                (*map(ExternalGate, done), *sensors),
                description=move.description,
            )

        given, idle = (tuple(f"{role}.{word}" for role in roles) for word in ("given", "idle"))
        net = Net(
            task.name,
            (
                Place(task.name, description=task.description),
                *(Place(place, marked=True) for place in given),
                *steps,
                *(Place(subtask.name, description=subtask.description) for subtask in task.subtasks),
                *map(Place, idle),
            ),
            (
                made(task.start, given, (task.name,)),
                *map(made, task.moves),
                made(task.end, (task.name,), tuple(f"{role}.idle" for role in task.kept)),
                Transition("again", idle, given),
            ),
            (
                *(Signal(f"{role.name}.{name}.signal") for role in task.roles for name, _ in role.inputs),
                *(Signal(step.completion, kind=SignalKind.COMPLETION) for step in steps if step.completion),
                *(Signal(step.within.timer, kind=SignalKind.TIMER) for step in steps if step.within),
            ),
        )
        return Net(net.name, net.places, net.transitions, net.signals, properties=tuple(self._conditions(net)))

    def _conditions(self, net: Net) -> Iterator[Property]:
        task = self.task
        inside: Formula = Holds(task.name)
        ready = And((inside, *map(Holds, task.end.sources)))
        rest = [*(Holds(name) for name in self.inner if name not in task.end.sources)]
        kept = [Not(Holds(f"{role}.idle")) for role in sorted(task.released)]
        yield Property("ends", PropertyKind.ALWAYS_POSSIBLE, Or((ready, Not(inside))))
        yield Property("ends-clean", PropertyKind.NEVER, And((ready, Or((*rest, *kept)))))
        yield Property("settles", PropertyKind.LEADS_TO, inside, Not(inside), Fairness.NONE)
        pairs = tuple(
            And((Firable(t.name), Firable(u.name)))
            for t, u in combinations(net.transitions, 2)
            if {*t.inputs} & {*u.inputs} or {*t.outputs} & {*u.outputs}
        )
        yield Property("orderly", PropertyKind.NEVER, Or(pairs) if pairs else Constant(value=False))

    @cached_property
    def inner(self) -> tuple[str, ...]:
        """The steps and subtasks."""
        return (*self.task.steps, *(subtask.name for subtask in self.task.subtasks))

    @cached_property
    def inside(self) -> dict[frozenset[str], frozenset[str]]:
        """The markings of the steps and subtasks while the task runs, each with the roles that it still will release.

        Raises `NotShownError` where they are too many, or where the roles cannot be read off the steps.
        """
        first = frozenset(place.name for place in self.net.places if place.marked)
        inner, seen, todo = {*self.inner}, {first}, [first]
        found: dict[frozenset[str], frozenset[str]] = {}
        for marking in todo:
            if self.task.name in marking:
                steps = marking & inner
                pending = frozenset(role for role in self.task.released if f"{role}.idle" not in marking)
                if found.setdefault(steps, pending) != pending:
                    raise NotShownError(f"what the task '{self.task.name}' has released cannot be read off its steps")
            for t in self.net.transitions:
                outputs = {*t.outputs}
                if (
                    t.openable
                    and {*t.inputs, *t.permissive} <= marking
                    and marking.isdisjoint({*t.inhibitive} | outputs)
                ):
                    after = frozenset((marking - {*t.inputs}) | outputs)
                    if after not in seen:
                        seen.add(after)
                        todo.append(after)
            if len(seen) > MARKINGS_MAX:
                raise NotShownError(f"the task '{self.task.name}' has more than {MARKINGS_MAX:,} markings")
        return found
