"""`refine`: from a conceptual net and registered tasks to the detailed net, with what is proved of it.

In order, each stage refusing what it can and stopping those after it: who fills the roles (`binding`), whether the
resources add up (`ledger`), whether each task keeps its conditions (`closed`), whether the net keeps those that a net
must (`border_problems`, here); then the tasks are opened and named. What was proved of the conceptual net is carried
over (`carrying`) and, for small nets, confirmed (`confirming`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from firable.decompose.refinement.binding import Binding, bindings, subtask_problems, tasks_used
from firable.decompose.refinement.carrying import Correspondence, untold
from firable.decompose.refinement.closed import BlockProof, prove_block
from firable.decompose.refinement.ledger import borrowings, net_problems, task_problems
from firable.decompose.refinement.naming import Named, named, without_arbiters
from firable.decompose.refinement.opening import Opened, open_tasks
from firable.decompose.refinement.traces import told, with_run, with_run_of_task
from firable.nets.diagnostics import Diagnostic, InputError, Severity, Span
from firable.nets.net import Net
from firable.nets.tasks.model import Catalogue, Task
from firable.nets.verdict import Status, Verdict
from firable.semantics.arbitration import Arbitration

_BY_ARCS = "the arcs and gates of the conceptual net"


@dataclass(frozen=True)
class Refinement:
    """A conceptual net, its detailed net, and the proofs of the tasks that it uses.

    `notes` say what of the conceptual net the detailed one has not, or has with another meaning.
    """

    net: Net
    correspondence: Correspondence
    blocks: tuple[BlockProof, ...]
    bound: Mapping[str, Binding]
    notes: tuple[Diagnostic, ...] = ()

    @property
    def settles(self) -> bool:
        """Whether every run inside a task is finite."""
        return all(block.settles for block in self.blocks)

    @cached_property
    def conditions(self) -> tuple[Verdict, ...]:
        """The conditions of refinement, all PROVED: those of the tasks, then those of the places that name them."""
        of_places = (
            Verdict(
                f"opens.{place}",
                Status.PROVED,
                f"'{binding.task.name}' is started and ended there as the theorem asks, and each resource adds up",
                _BY_ARCS,
            )
            for place, binding in self.bound.items()
            if "/" not in place
        )
        return (*(verdict for block in self.blocks for verdict in block.verdicts), *of_places)


def proved_tasks(net: Net, catalogue: Catalogue) -> tuple[BlockProof, ...]:
    """The proof of each task that a net uses, whether it is sound or not.

    Raises `InputError`: F4010 for an unknown task, F4011 for its arguments, F4012 for its resources, with a
    run to where they do not add up.
    """
    bindings(net, catalogue)
    tasks = tasks_used(net, catalogue) if not (unknown := _unknown_subtasks(net, catalogue)) else ()
    problems = [
        *unknown,
        *(problem for task in tasks for problem in with_run_of_task(task_problems(task, catalogue), task)),
    ]
    if problems:
        raise InputError(_placed(problems, catalogue))
    return tuple(prove_block(task) for task in tasks)


def refine(net: Net, catalogue: Catalogue, cell: str = "") -> Refinement:
    """Open the tasks of a conceptual net; `cell` is the name of the detailed net, by default that of the net.

    Raises `InputError`: F4010 for an unknown task, F4011 for its arguments, F4012 for a resource that is taken twice or
    lost, F4013 for a task that violates a condition, with the trace in its own names, F4014 for a place that cannot be
    opened, and the codes of `Net`.

    >>> from firable.nets.catalogue import catalogue_net, catalogue_tasks
    >>> refinement = refine(catalogue_net("conceptual_one_robot"), catalogue_tasks(), "one-robot")
    >>> replace(refinement.net, properties=()) == replace(catalogue_net("one_robot"), properties=())
    True
    """
    bound = bindings(net, catalogue)
    blocks = proved_tasks(net, catalogue)
    problems = [*with_run(net_problems(net, bound), net), *border_problems(net, bound)]
    problems += [_unsound(block) for block in blocks if not block.sound]
    if problems:
        raise InputError(_placed(problems, catalogue))
    opened = open_tasks(net, bound, catalogue)
    found = named(net, opened, cell)
    if closed := list(_closed_gates(net, opened, found)):
        raise InputError(closed)
    detailed, lost = _without_misfits(found.net)
    correspondence = Correspondence(
        net,
        detailed,
        {place.name: found.places[place.name] for place in net.places},
        {t.name: found.transitions[t.name] for t in net.transitions},
        {place: tuple(found.transitions[key] for key in keys) for place, keys in _moves_under(opened).items()},
        {place: tuple(found.places[key] for key in opened.lasts[place]) for place in bound},
        opened.released,
        frozenset(resource for _, resource in borrowings(net, bound)),
    )
    detailed = replace(detailed, properties=tuple(map(correspondence.renamed, net.properties)))
    correspondence = replace(correspondence, detailed=detailed)
    return Refinement(detailed, correspondence, blocks, opened.bound, (*lost, *_untold(correspondence)))


def border_problems(net: Net, bound: Mapping[str, Binding]) -> Iterator[Diagnostic]:
    """Why places of a net cannot be opened to their tasks, whatever these do inside (F4014)."""
    released = {
        binding.resources[role]: (place, binding.task.name)
        for place, binding in bound.items()
        for role in binding.task.released
    }
    for name in bound:
        if net.place(name).marked:
            yield Diagnostic(
                "F4014", f"'{name}' holds a token in M0, so its task would have begun without being started",
                "let a transition start it", ("places", name),
            )  # fmt: skip
        p = net.place_index[name]
        if not net.producers[p]:
            yield Diagnostic("F4014", f"no transition starts the task of '{name}'", "add one", ("places", name))
        for t in set(net.consumers[p]) & set(net.producers[p]):
            t_name = net.transitions[t].name
            yield Diagnostic(
                "F4014", f"'{t_name}' both ends and starts the task of '{name}', so it can never fire",
                "leave out one of the arcs", ("transitions", t_name),
            )  # fmt: skip
    for t_ in net.transitions:
        for gate in t_.inhibitive:
            if gate in released:
                place, task = released[gate]
                yield Diagnostic(
                    "F4014",
                    f"'{t_.name}' fires unless '{gate}' is idle, and '{place}' releases it inside its task '{task}'",
                    f"there it is not idle yet where the conceptual net says so: ask for '{place}' instead",
                    ("transitions", t_.name, "unless", gate),
                )


def _closed_gates(net: Net, opened: Opened, found: Named) -> Iterator[Diagnostic]:
    """Transitions that could open, and can no longer: a task wants a signal otherwise than another or the net."""
    for key, name in found.transitions.items():
        could = net.transition(key).openable if key in net.transition_index else True
        t = found.net.transition(name)
        if could and not t.openable:
            both = next(g.signal for g in t.external if replace(g, wanted=not g.wanted) in t.external)
            path = opened.transitions[key].path
            place = path.partition("/")[0]
            yield Diagnostic(
                "F4014", f"'{name}' would want the signal '{both}' both 1 and 0, so it could never fire",
                "two tasks meet there, or two roles have one signal: give one of them a `prefix`",
                ("places", place) if path else ("transitions", key),
            )  # fmt: skip


def _moves_under(opened: Opened) -> Mapping[str, Sequence[str]]:
    """The keys of the moves of each task that the net names, with those of its subtasks."""
    found: dict[str, list[str]] = {}
    for path, keys in opened.moves.items():
        found.setdefault(path.partition("/")[0], []).extend(keys)
    return found


def _without_misfits(net: Net) -> tuple[Net, list[Diagnostic]]:
    try:
        Arbitration.of(net)
    except InputError as error:
        names = {problem.subject[1] for problem in error.diagnostics}
        return without_arbiters(net, names), [
            Diagnostic(
                "F1016", f"the arbiter '{name}' is left out: what it decides is no longer one conflict",
                "a resource that a task releases inside is no output of the transition that starts the task",
                severity=Severity.WARNING,
            )
            for name in sorted(names)
        ]  # fmt: skip
    return net, []


def _untold(correspondence: Correspondence) -> Iterator[Diagnostic]:
    for prop in correspondence.conceptual.properties:
        if why := untold(correspondence, prop):
            yield Diagnostic(
                "F1016", f"the property '{prop.name}' is stated of the detailed net, its verdict not carried over",
                f"{why}; `firable check` decides it there", severity=Severity.WARNING,
            )  # fmt: skip


def _unsound(block: BlockProof) -> Diagnostic:
    verdict = next(v for v in block.verdicts if not v.holds and v.code)
    trace = told(verdict.witness) if verdict.witness else ""
    about = f" (about {', '.join(verdict.subjects)})" if verdict.subjects else ""
    state = "is violated" if verdict.status is Status.VIOLATED else f"is not known: {verdict.bound}"
    return Diagnostic(
        "F4013",
        f"the task '{block.task.name}' cannot stand for a place: {verdict.statement} - {state}{about}{trace}",
        verdict.hint,
        ("tasks", block.task.name),
    )


def _unknown_subtasks(net: Net, catalogue: Catalogue) -> list[Diagnostic]:
    """What is wrong with the subtasks of the tasks that a net uses, the outer ones first."""
    todo = [place.task.name for place in net.places if place.task]
    problems: list[Diagnostic] = []
    for name in (seen := [*dict.fromkeys(todo)]):
        problems += subtask_problems(catalogue[name], catalogue)
        inner = [one.use.name for one in catalogue[name].subtasks]
        seen += [one for one in dict.fromkeys(inner) if one in catalogue and one not in seen]
    return problems


def _placed(problems: Sequence[Diagnostic], catalogue: Catalogue) -> list[Diagnostic]:
    """The diagnostics, those about a task with the place in the file of tasks."""
    return [
        replace(problem, span=span) if (span := _span(problem.subject, catalogue)) and not problem.span else problem
        for problem in problems
    ]


def _span(subject: tuple[str, ...], catalogue: Catalogue) -> Span | None:
    if subject[:1] != ("tasks",) or (task := catalogue.get(subject[1])) is None:
        return None
    return _span_in(task, subject[2:])


def _span_in(task: Task, rest: tuple[str, ...]) -> Span | None:
    for move in task.transitions():
        if rest[:1] == (move.name,) and move.span:
            return move.span
    for subtask in task.subtasks:
        if rest[:2] == ("subtasks", subtask.name):
            return subtask.span
    return task.span
