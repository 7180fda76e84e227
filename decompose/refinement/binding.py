"""Who fills the roles and parameters of a task, where a place of a net or a step of another task names it.

At a place of a net a role is filled by a place that opens to a resource; in a task, by a role of that task. Either way
each role is filled, each by somebody else, and nothing is filled that the task does not know; parameters that have no
default are given. What is wrong is said of the argument that is wrong (F4011), or of the name of the task (F4010).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Subject, did_you_mean
from firable.nets.net import Net, Place, TaskUse
from firable.nets.owning import resource_of
from firable.nets.tasks.model import Catalogue, Subtask, Task
from firable.nets.tasks.text import filled, names_in_template

DEPTH_MAX: Final = 16
"""How deep tasks may be nested: a task within itself is found by it."""


@dataclass(frozen=True)
class Binding:
    """A task with its roles filled by resources (names of places of the conceptual net) and its words by texts."""

    task: Task
    resources: Mapping[str, str]
    words: Mapping[str, str]

    def text(self, template: str) -> str:
        """A template of the task, filled."""
        return filled(template, dict(self.words))

    def within(self, subtask: Subtask, catalogue: Catalogue) -> Binding:
        """The binding of a subtask, whose roles are filled by roles of this task."""
        inner = catalogue[subtask.use.name]
        given = dict(subtask.use.arguments)
        resources = {role.name: self.resources[given[role.name]] for role in inner.roles}
        words = {name: self.text(given[name]) if name in given else default or "" for name, default in inner.parameters}
        for role in inner.roles:
            outer = given[role.name]
            words |= {
                role.name + word.removeprefix(outer): text
                for word, text in self.words.items()
                if word == outer or word.startswith(f"{outer}.")
            }
        return Binding(inner, resources, words)


def bindings(net: Net, catalogue: Catalogue) -> dict[str, Binding]:
    """The binding of each place that names a task.

    Raises `InputError`: F4010 for a task that is not registered, or that holds itself, F4011 for its arguments, F2005
    where a resource opens to a controller that is not there.
    """
    problems: list[Diagnostic] = []
    found = {}
    for place in net.places:
        if place.task is None:
            continue
        some = list(_problems_at_place(net, place, place.task, catalogue))
        problems += some
        if not some:
            found[place.name] = _bound(net, place, place.task, catalogue[place.task.name])
    controllers = [controller.name for controller in net.controllers]
    for place in net.places:
        if place.resource and (owner := place.resource.idle.partition(".")[0]) not in controllers:
            hint = did_you_mean(owner, controllers) + f"declare it: `{owner}:` under `controllers`"
            message = f"'{place.name}' opens to '{place.resource.idle}', and there is no controller '{owner}'"
            problems.append(Diagnostic("F2005", message, hint, ("places", place.name, "opens", "to")))
    if not any(place.task for place in net.places):
        hint = "write `task: {name: TASK, ROLE: RESOURCE}` at a place, and `opens` at the resources"
        problems.append(Diagnostic("F4010", "no place of the net names a task, so there is nothing to open", hint))
    if problems:
        raise InputError(problems)
    return found


def opened_by(net: Net, catalogue: Catalogue) -> dict[str, Binding]:
    """What names a task and how it fills it: the places of a net, and after them the subtasks with the path to them.

    Raises `InputError` as `bindings` does; that the subtasks fit was checked before.
    """
    found = bindings(net, catalogue)
    todo = list(found.items())
    for path, binding in todo:
        inner = [(f"{path}/{one.name}", binding.within(one, catalogue)) for one in binding.task.subtasks]
        found.update(inner)
        todo += inner
    return found


def tasks_used(net: Net, catalogue: Catalogue) -> tuple[Task, ...]:
    """The tasks that a net's places name, and those within them, each once, inner ones after the outer."""
    order: dict[str, Task] = {}
    todo = [place.task.name for place in net.places if place.task]
    for name in todo:
        if name not in order:
            order[name] = catalogue[name]
            todo += [subtask.use.name for subtask in catalogue[name].subtasks]
    return tuple(order.values())


def _bound(net: Net, place: Place, use: TaskUse, task: Task) -> Binding:
    given = dict(use.arguments)
    resources: dict[str, str] = {}
    words: dict[str, str] = {}
    for role in task.roles:
        full = resource_of(net, place, given[role.name])
        resource = net.place(full).resource if full else None
        if full is None or resource is None:
            raise AssertionError("the arguments were checked before")
        owner = net.place(full).owner
        resources[role.name] = full
        words[role.name] = full if owner is None else full.removeprefix(f"{owner}.")
        more = {"machine": resource.machine, "prefix": resource.prefix, **dict(resource.parameters)}
        words |= {f"{role.name}.{key}": value for key, value in more.items()}
    words |= {name: given.get(name, default) or "" for name, default in task.parameters}
    return Binding(task, resources, words)


def _problems_at_place(net: Net, place: Place, use: TaskUse, catalogue: Catalogue) -> Iterator[Diagnostic]:
    subject: Subject = ("places", place.name, "task")
    where = f"of '{place.name}'"
    task = catalogue.get(use.name)
    if task is None:
        yield _unknown(use.name, catalogue, where, (*subject, "name"))
        return
    if chain := _cycle(task, catalogue):
        yield Diagnostic(
            "F4010", f"the task '{chain[0]}' holds itself: {' > '.join(chain)}",
            "a subtask must be a task that does not come back", (*subject, "name"),
        )  # fmt: skip
        return
    yield from _arguments(use, task, where, subject)
    taken: dict[str, str] = {}
    for role in task.roles:
        name = dict(use.arguments).get(role.name)
        if name is None:
            continue
        full = resource_of(net, place, name)
        at: Subject = (*subject, role.name)
        if full is None:
            close = did_you_mean(name, [one.name.rpartition(".")[2] for one in net.places if one.resource])
            yield Diagnostic(
                "F4011", f"'{name}', in the role '{role.name}' {where}, opens to no resource",
                f"{close}name a place that says `opens: {{to: CONTROLLER.PLACE, machine: NAME}}`", at,
            )  # fmt: skip
            continue
        if (other := taken.setdefault(full, role.name)) != role.name:
            yield Diagnostic(
                "F4011", f"'{name}' is in two roles {where}, '{other}' and '{role.name}'",
                "one resource does one thing at a time: name another one", at,
            )  # fmt: skip
    yield from _words(net, place, use, task, catalogue, subject)


def subtask_problems(task: Task, catalogue: Catalogue) -> Iterator[Diagnostic]:
    """What is wrong with the arguments of a task's subtasks."""
    for subtask in task.subtasks:
        where = f"of the subtask '{subtask.name}' of '{task.name}'"
        subject: Subject = ("tasks", task.name, "subtasks", subtask.name)
        inner = catalogue.get(subtask.use.name)
        if inner is None:
            yield _unknown(subtask.use.name, catalogue, where, subject)
            continue
        yield from _arguments(subtask.use, inner, where, subject)
        given = dict(subtask.use.arguments)
        outer = [role.name for role in task.roles]
        taken: dict[str, str] = {}
        for role in inner.roles:
            name = given.get(role.name)
            if name is not None and name not in outer:
                hint = did_you_mean(name, outer) + f"name a role of '{task.name}'"
                yield Diagnostic("F4011", f"there is no role '{name}' for '{role.name}' {where}", hint, subject)
            elif name is not None and (other := taken.setdefault(name, role.name)) != role.name:
                message = f"'{name}' is in two roles {where}, '{other}' and '{role.name}'"
                yield Diagnostic("F4011", message, "one resource does one thing at a time", subject)


def _arguments(use: TaskUse, task: Task, where: str, subject: Subject) -> Iterator[Diagnostic]:
    given = dict(use.arguments)
    roles = [role.name for role in task.roles]
    parameters = dict(task.parameters)
    known = [*roles, *parameters]
    for name in given:
        if name not in known:
            hint = did_you_mean(name, known) + f"'{task.name}' has {', '.join(known)}"
            message = f"'{name}' {where} is neither a role nor a parameter of the task '{task.name}'"
            yield Diagnostic("F4011", message, hint, (*subject, name))
    needed = [*roles, *(name for name, default in task.parameters if default is None)]
    for name in needed:
        if name not in given:
            what = "role" if name in roles else "parameter"
            message = f"the {what} '{name}' of the task '{task.name}' {where} is not filled"
            yield Diagnostic("F4011", message, f"add `{name}: ...` to `task`", (*subject, "name"))


def _words(
    net: Net, place: Place, use: TaskUse, task: Task, catalogue: Catalogue, subject: Subject
) -> Iterator[Diagnostic]:
    """Parameters of resources that a template asks for, here or in a subtask, and that are not there."""
    given = dict(use.arguments)
    if any(resource_of(net, place, given.get(role.name, "")) is None for role in task.roles):
        return
    binding = _bound(net, place, use, task)
    seen = set[str]()
    todo = [(binding, {role.name: role.name for role in task.roles})]
    for one, outer in todo:
        for template in _templates(one.task):
            for word in names_in_template(template):
                if word in one.words or word in seen:
                    continue
                seen.add(word)
                role, _, key = word.partition(".")
                name = given.get(outer.get(role, ""), role)
                yield Diagnostic(
                    "F4011", f"the task '{one.task.name}' asks for '{key}' of '{name}', which says none",
                    f"add `{key}: ...` to `opens` of '{name}'", (*subject, outer.get(role, role)),
                )  # fmt: skip
        for subtask in one.task.subtasks:
            if not list(subtask_problems(one.task, catalogue)):
                inside = {role: outer[by] for role, by in subtask.use.arguments if by in outer}
                todo.append((one.within(subtask, catalogue), inside))


def _templates(task: Task) -> Iterator[str]:
    for role in task.roles:
        yield from (template for _, template in role.inputs)
        for step in role.steps:
            yield from (step.place, step.completion or "", step.description)
            if step.command:
                yield from (step.command.machine, step.command.command)
                yield from (value for _, value in step.command.parameters)
    yield from (move.description for move in task.transitions())
    yield from (value for subtask in task.subtasks for _, value in subtask.use.arguments)


def _cycle(task: Task, catalogue: Catalogue) -> list[str]:
    """A chain of subtasks that comes back to where it was, or is too deep; empty where there is none."""
    todo = [[task.name]]
    while todo:
        chain = todo.pop()
        if chain[-1] in chain[:-1] or len(chain) > DEPTH_MAX:
            return chain
        inner = catalogue.get(chain[-1])
        todo += [[*chain, subtask.use.name] for subtask in (inner.subtasks if inner else ())]
    return []


def _unknown(name: str, catalogue: Catalogue, where: str, subject: Subject) -> Diagnostic:
    known = sorted(catalogue)
    hint = did_you_mean(name, known) + f"registered are {', '.join(known)}; --tasks names a file with more"
    return Diagnostic("F4010", f"the task '{name}' {where} is not registered", hint, subject)
