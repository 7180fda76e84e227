"""The ledger of resources: at each transition of a task, who holds a resource before, and who after.

A resource is in one place at a time: idle, on a step, or held by a task that is not opened yet. So a transition that
puts it on a step or starts a task with it must take it from somewhere, from one place alone, and one that ends what
held it must lead it on or make it idle; else the detailed net would command one machine twice, or lose it. A task that
releases a resource before its end is the one exception: the transition that starts it already makes the resource idle
in the conceptual net, and in the detailed net a move inside the task does. This is what lets a robot's conveyor take
the next workpiece while the robot still carries the last one, and a conceptual net that does not say so is refused.

Where such a resource is idle before, the conceptual net only asks for it (`if`): it is *borrowed*, idle again at once
as far as that net can see, and the detailed net takes it from its idle place.

The rejected alternative, to find such faults as contacts and deadlocks of the detailed net, shows them firings away
from where they are made, and in names that the engineer did not write.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from firable.decompose.refinement.binding import Binding
from firable.nets.diagnostics import Diagnostic, Subject
from firable.nets.net import Net, Transition
from firable.nets.tasks.model import Catalogue, Task


@dataclass(frozen=True, slots=True)
class Holder:
    """What a step or a task holds: the resources it takes, and those of them that it keeps to its end."""

    takes: frozenset[str]
    keeps: frozenset[str]


def net_problems(net: Net, bound: Mapping[str, Binding]) -> Iterator[Diagnostic]:
    """What the transitions of a conceptual net do wrong with the resources of its tasks (F4012)."""
    holders = {name: _held_by(binding.task, binding.resources) for name, binding in bound.items()}
    resources = {place.name for place in net.places if place.resource}
    for t in net.transitions:
        for resource in _touched(t, holders):
            lent = resource in borrowed(t, holders)
            taken, freed = lent or resource in t.inputs, lent or resource in t.outputs
            yield from _problem(t, resource, holders, taken, freed, ("transitions", t.name))
        for resource in sorted(resources & {*t.inputs} & {*t.outputs}):
            yield Diagnostic(
                "F4012", f"'{t.name}' both takes and frees '{resource}', so it can never fire",
                f"write `if: {resource}` where a task borrows it", ("transitions", t.name, "to", resource),
            )  # fmt: skip


def borrowings(net: Net, bound: Mapping[str, Binding]) -> Iterator[tuple[str, str]]:
    """The transitions of a net, each with a resource that it borrows for a task."""
    holders = {name: _held_by(binding.task, binding.resources) for name, binding in bound.items()}
    yield from ((t.name, resource) for t in net.transitions for resource in borrowed(t, holders))


def borrowed(t: Transition, holders: Mapping[str, Holder]) -> list[str]:
    """What a transition asks for, and a task that it starts releases before its end."""
    takers = [holders[p] for p in t.outputs if p in holders]
    early = frozenset[str]().union(*(holder.takes - holder.keeps for holder in takers))
    return [one for one in t.permissive if one in early and one not in t.outputs and one not in t.inputs]


def task_problems(task: Task, catalogue: Catalogue) -> Iterator[Diagnostic]:
    """What the moves of a task do wrong with the resources in its roles (F4012); its subtasks fit it otherwise."""
    holders = {name: Holder(frozenset({role.name}), frozenset({role.name})) for name, (role, _) in task.steps.items()}
    for subtask in task.subtasks:
        holders[subtask.name] = _held_by(catalogue[subtask.use.name], dict(subtask.use.arguments))
    roles = [role.name for role in task.roles]
    for move in task.transitions():
        t = Transition(move.name, move.sources, move.targets)
        subject: Subject = ("tasks", task.name, move.name)
        everybody = roles if move is task.start else task.kept if move is task.end else ()
        for role in dict.fromkeys([*everybody, *_touched(t, holders), *move.releases]):
            comes = move is task.start
            frees = role in move.releases or (move is task.end and role in task.kept)
            yield from _problem(t, role, holders, comes, frees, subject, f" of the task '{task.name}'")


def _held_by(task: Task, filled: Mapping[str, str]) -> Holder:
    return Holder(frozenset(filled[role.name] for role in task.roles), frozenset(filled[role] for role in task.kept))


def _touched(t: Transition, holders: Mapping[str, Holder]) -> list[str]:
    found = [
        *(holders[p].keeps for p in t.inputs if p in holders),
        *(holders[p].takes for p in t.outputs if p in holders),
    ]
    return sorted(frozenset[str]().union(*found))


def _problem(
    t: Transition,
    resource: str,
    holders: Mapping[str, Holder],
    is_taken: bool,
    is_freed: bool,
    subject: Subject,
    of: str = "",
) -> Iterator[Diagnostic]:
    """What is wrong with one resource at one transition; `is_taken` from its idle place, `is_freed` into it."""
    givers = [p for p in t.inputs if p in holders and resource in holders[p].keeps]
    takers = [p for p in t.outputs if p in holders and resource in holders[p].takes]
    at = f"'{t.name}'{of}"
    if is_taken and givers:
        yield _wrong(
            f"{at} takes '{resource}' twice: idle, and from {_all(givers)}", "take it from one of them", subject
        )
    elif len(givers) > 1:
        yield _wrong(
            f"{at} takes '{resource}' twice, from {_all(givers)}", "one of them must let it go before", subject
        )
    elif not givers and not is_taken:
        if not takers:
            message = f"{at} frees '{resource}', which nobody holds there"
            yield _wrong(message, "release a role where a step of it ends", subject)
        else:
            early = resource not in holders[takers[0]].keeps
            way = f"borrow it: `if: {resource}`" if early else f"take it there: add '{resource}' to `from`"
            yield _wrong(
                f"{at} starts '{takers[0]}', which needs '{resource}' from its start, and nobody hands it over",
                f"{way}, or end a task or step that keeps it",
                subject,
            )
    if len(takers) > 1:
        yield _wrong(f"{at} gives '{resource}' to {_all(takers)} at once", "give it to one of them", subject)
    elif takers and resource not in holders[takers[0]].keeps:
        if not is_freed:
            yield _wrong(
                f"{at} starts '{takers[0]}', which releases '{resource}' before its end, and never makes it free",
                f"make it free where the task starts: add '{resource}' to `to`",
                subject,
            )
    elif takers and is_freed:
        yield _wrong(
            f"{at} makes '{resource}' free, which '{takers[0]}' keeps to its end",
            "make it free where that ends",
            subject,
        )
    elif not takers and not is_freed:
        yield _wrong(
            f"{at} ends {_all(givers)}, and '{resource}' is lost: it neither becomes free nor goes on",
            f"make it free: add '{resource}' to {'`release`' if of else '`to`'}, or hand it on",
            subject,
        )


def _wrong(message: str, hint: str, subject: Subject) -> Diagnostic:
    return Diagnostic("F4012", message, hint, subject)


def _all(names: Sequence[str]) -> str:
    return " and ".join(f"'{name}'" for name in names)
