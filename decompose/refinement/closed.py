"""The conditions under which a task may stand for a place, each decided on the task alone, closed.

*Closed*, a task has around it a cell that does nothing else: `start` gives it all its roles, `end` takes them back, and
`again` makes everything as it was. Its net is small, and has the task's own names, so a counterexample is told in them.
The conditions are those that the theorem of `firable.decompose.refinement.carrying` needs:

- *ends*: from every marking inside, one can be reached in which it can end;
- *ends clean*: where it can end, its last steps are all that is left, and every released role is idle. So it is left
  with nothing behind, and entered afresh;
- *contact-free*: no move is held back by a full place. With the two above, each role is released exactly once: a second
  release would find it idle already;
- *complete*: every move can fire. A dead move is no danger, but a mistake, and its transition would never be live.

Two more inform, and decide how much carries over: *settles*, whether every run inside is finite (else the detailed net
can be busy for ever where the conceptual one waits for its next transition), and *orderly*, whether no two moves
compete for a place.

Valette (1979) asks of his *well-formed block* that it fires its last transition once for each time it fires its first
one, and that nothing is left; this is his condition for a block with several entries and exits at once, one for each
role, some of which are left early, and gates that are free: a machine may take any time, but does answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

from firable.analysis.question import LARGER, Answer, Question, no, unknown, yes
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Formula, Holds, Not, Or
from firable.nets.net import ExternalGate, Net, Place, Signal, SignalKind, TimeLimit, Transition
from firable.nets.tasks.model import Gate, Move, Task
from firable.nets.time_limits import fault_transition, timer_name
from firable.nets.verdict import Cost, Verdict, Weight, Witness
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 1_000_000
AGAIN: Final = "again"

_METHOD: Final = "exploration of the task, closed"
_CODE: Final = "F4013"


@dataclass(frozen=True)
class BlockProof:
    """A task closed, and the verdicts on its conditions; witnesses are firing sequences of `net`."""

    task: Task
    net: Net
    verdicts: tuple[Verdict, ...]

    @property
    def sound(self) -> bool:
        """Whether every condition that refinement needs is proved."""
        return all(verdict.holds for verdict in self.verdicts if verdict.weight is Weight.REQUIRED)

    @property
    def settles(self) -> bool:
        """Whether every run inside the task is finite."""
        return self._holds("settles")

    @property
    def orderly(self) -> bool:
        """Whether no two transitions of the task compete for a place."""
        return self._holds("orderly")

    def _holds(self, condition: str) -> bool:
        return any(verdict.holds for verdict in self.verdicts if verdict.name == f"{self.task.name}.{condition}")


def closed(task: Task) -> Net:
    """The net of a task with nothing around it; steps and subtasks are places under their names in the task.

    `ROLE.given` and `ROLE.idle` are where a role is before and after, and the name of the task is a place that holds a
    token from start to end, as the place that it stands for does.
    """
    steps = [
        Place(
            name,
            command=step.command,
            completion=_done(name) if step.completion else None,
            description=step.description,
            within=TimeLimit(step.within, timer_name(name)) if step.within else None,
        )
        for name, (_, step) in task.steps.items()
    ]
    completions = {place.name: place.completion for place in steps if place.completion}
    subtasks = [Place(subtask.name, description=subtask.description) for subtask in task.subtasks]
    roles = [role.name for role in task.roles]

    of_step = {place.name: place for place in steps}

    def transition(move: Move, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> Transition:
        if move.late:
            return fault_transition(of_step[move.sources[0]], move.targets[0], move.name)
        done = dict.fromkeys(completions[source] for source in move.sources if source in completions)
        return Transition(
            move.name,
            (*inputs, *move.sources),
            (*outputs, *move.targets, *(f"{role}.idle" for role in move.releases)),
            move.permissive,
            move.inhibitive,
            (
                *(ExternalGate(signal) for signal in done),
                *(ExternalGate(sensor(gate), gate.wanted) for gate in move.external),
            ),
            description=move.description,
        )

    return Net(
        task.name,
        (
            Place(task.name, description=task.description),
            *(Place(f"{role}.given", marked=True) for role in roles),
            *steps,
            *subtasks,
            *(Place(f"{role}.idle") for role in roles),
        ),
        (
            transition(task.start, tuple(f"{role}.given" for role in roles), (task.name,)),
            *(transition(move) for move in task.moves),
            transition(task.end, (task.name,), tuple(f"{role}.idle" for role in task.kept)),
            Transition(AGAIN, tuple(f"{role}.idle" for role in roles), tuple(f"{role}.given" for role in roles)),
        ),
        (
            *(Signal(f"{role.name}.{name}.signal") for role in task.roles for name, _ in role.inputs),
            *(Signal(signal, kind=SignalKind.COMPLETION) for signal in completions.values()),
            *(Signal(place.within.timer, kind=SignalKind.TIMER) for place in steps if place.within),
        ),
    )


def prove_block(task: Task, budget: Budget | None = None) -> BlockProof:
    """Decide the conditions of a task; where the budget ends before all its markings are known, they are UNKNOWN."""
    return _Block(task, budget or Budget(MARKINGS_MAX)).proof()


def sensor(gate: Gate) -> str:
    """The signal of a gate in the closed net: a sensor may bear the name of a step of another role."""
    return f"{gate}.signal"


def _done(step: str) -> str:
    return f"{step}.done"


@dataclass(frozen=True)
class _Block:
    task: Task
    budget: Budget

    @cached_property
    def net(self) -> Net:
        return closed(self.task)

    @cached_property
    def graph(self) -> ReachabilityGraph:
        return explore(self.net, budget=self.budget)

    def proof(self) -> BlockProof:
        inside = Holds(self.task.name)
        ready = And((inside, *(Holds(step) for step in self.task.end.sources)))
        return BlockProof(
            self.task,
            self.net,
            (
                self.ask(
                    "ends",
                    "from every marking inside the task one can be reached in which it can end",
                    "look at the last move: after it the last steps can no longer all be reached",
                    lambda: self.ends(inside, ready),
                ),
                self.ask(
                    "ends-clean",
                    "where the task can end, only its last steps are left, and every released role is idle",
                    "let `end` come from a step that is reached after everything else is done",
                    lambda: self.never(And((ready, Not(self.clean()))), "here the task can end, and leaves something"),
                ),
                self.ask(
                    "contact-free",
                    "no move of the task is held back only by a full place, and none releases a role twice",
                    "a place is entered that is not empty: check the moves that lead into it",
                    self.contact_free,
                ),
                self.ask(
                    "complete",
                    "every move of the task can fire",
                    "check what the move comes from, and its gates",
                    self.complete,
                ),
                self.ask(
                    "settles",
                    "every run inside the task is finite",
                    "",
                    lambda: self.settles(inside),
                    Weight.INFORMATION,
                ),
                self.ask(
                    "orderly",
                    "no two transitions of the task compete for a place",
                    "",
                    self.orderly,
                    Weight.INFORMATION,
                ),
            ),
        )

    def ask(
        self,
        name: str,
        statement: str,
        hint: str,
        find: Callable[[], Answer],
        weight: Weight = Weight.REQUIRED,
    ) -> Verdict:
        code = _CODE if weight is Weight.REQUIRED else ""
        question = Question(f"{self.task.name}.{name}", statement, weight, code, hint, _METHOD)
        try:
            graph = self.graph
        except InputError as error:  # there is no room for the net itself
            answer = unknown(error.diagnostics[0].message, LARGER, error.diagnostics[0].code)
            return question.settle(answer, _METHOD, Discipline.INTERLEAVING, Cost())
        return question.ask(graph, find)

    def clean(self) -> Formula:
        """Nothing is left inside but the last steps, and what was released is idle."""
        inner = [*self.task.steps, *(subtask.name for subtask in self.task.subtasks)]
        left = [name for name in inner if name not in self.task.end.sources]
        idle = [Holds(f"{role}.idle") for role in sorted(self.task.released)]
        return And((Not(Or(tuple(Holds(name) for name in left))), *idle))

    def ends(self, inside: Formula, ready: Formula) -> Answer:
        algebra, graph = self.graph.algebra, self.graph
        caught = algebra.conjunction(
            [graph.satisfying(inside), algebra.negation(graph.backward(graph.satisfying(ready)))]
        )
        witness = graph.witness(caught, "from here the task can never end")
        return yes() if witness is None else no((), witness)

    def never(self, bad: Formula, note: str) -> Answer:
        witness = self.graph.witness(self.graph.satisfying(bad), note)
        if witness is None:
            self.graph.require_complete()
            return yes()
        return no((), witness)

    def contact_free(self) -> Answer:
        contacts = self.graph.meet_contact()
        if not contacts:
            self.graph.require_complete()
            return yes()
        names = tuple(self.net.transitions[t].name for t in contacts)
        witness = self.graph.witness_of_contact(contacts)
        return no(names, witness and replace(witness, note="from here only a full place holds back a move"))

    def complete(self) -> Answer:
        self.graph.require_complete()
        dead = [t for t, count in zip(self.net.transitions, self.graph.fired(), strict=True) if not count]
        if not dead:
            return yes()
        moves = [t for t in dead if t.name != AGAIN] or dead
        shown = (self.held_back(t) for t in moves)
        return no(tuple(t.name for t in moves), next((witness for witness in shown if witness), None))

    def held_back(self, dead: Transition) -> Witness | None:
        """A run to where a dead transition has all that it comes from, with what keeps it from firing there."""
        witness = self.graph.witness(self.graph.satisfying(And(tuple(map(Holds, dead.inputs)))))
        if witness is None:
            return None
        full = {*witness.marking}
        why = [
            *(f"'{place}' holds no token" for place in dead.permissive if place not in full),
            *(f"'{place}' holds a token" for place in (*dead.inhibitive, *dead.outputs) if place in full),
        ]
        if not dead.openable:
            why.append("its gates want one signal both 1 and 0")
        return replace(witness, note=f"here '{dead.name}' has all that it comes from, but {' and '.join(why)}")

    def settles(self, inside: Formula) -> Answer:
        self.graph.require_complete()
        endless = self.graph.endless(self.graph.satisfying(inside))
        witness = self.graph.witness(endless, "from here moves can follow each other for ever")
        return yes() if witness is None else no((), witness)

    def orderly(self) -> Answer:
        self.graph.require_complete()
        sides: list[Callable[[Transition], tuple[str, ...]]] = [lambda t: t.inputs, lambda t: t.outputs]
        n = range(len(self.net.transitions))
        pairs = [
            (t, u)
            for t in n
            for u in n[t + 1 :]
            if any(set(side(self.net.transitions[t])) & set(side(self.net.transitions[u])) for side in sides)
        ]
        both: list[Any] = [pair for pair, yes_ in zip(pairs, self.graph.firable_together(pairs), strict=True) if yes_]
        names = dict.fromkeys(self.net.transitions[t].name for pair in both for t in pair)
        return no(tuple(names)) if both else yes()
