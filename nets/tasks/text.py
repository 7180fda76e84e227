"""Reading files of registered tasks, `*.tasks.yaml`: text, tree with positions, document, `Task`.

The stages are those of the net file (`firable.nets.text`), and so is what is promised: all that is wrong is reported
together, each with its line and column. What is checked here can be seen in one task alone: that every name is
declared, that no name stands twice, that templates name roles and parameters. Whether the steps make a sound task, and
whether a subtask fits the task that it names, is for `firable.decompose.refinement` to say.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from firable.nets.diagnostics import Diagnostic, InputError, Span, bounded, did_you_mean
from firable.nets.document_errors import document_problems, version_problem
from firable.nets.net import Command, TaskUse
from firable.nets.source import Source, read_source
from firable.nets.tasks import document as doc
from firable.nets.tasks.model import Catalogue, Gate, Move, Role, Step, Subtask, Task
from firable.nets.time_limits import no_time, parse_time
from firable.nets.well_formed import is_name
from firable.nets.written_as_one import meant_by, written_as_one
from firable.nets.yaml_tree import Node, Scalar, Sequence, data, node_span, nodes_along, parse_tree

SIZE_BYTES_MAX: Final = 1024 * 1024
RESERVED_MOVES: Final = frozenset({"start", "end", "again"})
"""What the transitions around a task are called where it is checked alone."""
RESERVED_STEPS: Final = frozenset({"given", "idle"})
"""What the places around it are called, after their role."""
_WORDS: Final = ("roles", "parameters", "subtasks")

_TEMPLATE: Final = re.compile(r"\{([^{}]*)\}|([{}])")

_Path = tuple[str | int, ...]


def read_tasks(path: str | Path) -> Catalogue:
    """Read a file of tasks.

    Raises `InputError`: F1001-F1011 for the text; for the tasks F2001, F2007, F2009, F2012 and F2022 as in a net, F2025
    for a step, sensor or role that is not there and F2026 for a template.
    """
    return _parse(read_source(path, SIZE_BYTES_MAX))


def parse_tasks(text: str, file: str = "<text>") -> Catalogue:
    """Read tasks from text; `file` is the name in diagnostics.

    Raises `InputError` as `read_tasks` does.

    >>> tasks = parse_tasks("firable_tasks: 1\\ntasks: {rest: {roles: {robot: {steps: {home: }}}}}")
    >>> tasks["rest"].start.targets, tasks["rest"].kept
    (('robot.home',), ('robot',))
    """
    return _parse(Source(file, text))


def names_in_template(template: str) -> Iterator[str]:
    """What a template asks for between braces: `source`, `robot.prefix`; a brace by itself where it has no partner."""
    for match in _TEMPLATE.finditer(template):
        yield match[2] or match[1]


def filled(template: str, values: dict[str, str]) -> str:
    """The template with its values in their places; `KeyError` for a name that has none.

    >>> filled("to_{source}", {"source": "cv1"})
    'to_cv1'
    """
    return _TEMPLATE.sub(lambda match: values[match[1]], template)


def _parse(source: Source) -> Catalogue:
    tree = parse_tree(source, doc.SHAPE.file, f"`{doc.SHAPE.version}: 1` and `tasks:`")
    if problem := version_problem(source, tree, doc.SHAPE):
        raise InputError([problem])
    try:
        document = doc.CatalogueDocument.model_validate(data(tree))
    except ValidationError as error:
        raise InputError(document_problems(source, tree, error, doc.SHAPE)) from None
    problems: list[Diagnostic] = []
    tasks = {name: _Reading(source, tree, name, body, problems).task() for name, body in document.tasks.items()}
    if problems:
        problems.sort(key=lambda problem: (problem.span.line, problem.span.column) if problem.span else (0, 0))
        raise InputError(bounded(problems))
    return tasks


class _Reading:
    """One task on its way from its document."""

    def __init__(
        self, source: Source, tree: Node, name: str, body: doc.TaskDocument, problems: list[Diagnostic]
    ) -> None:
        self.source, self.tree, self.name, self.body, self.problems = source, tree, name, body, problems
        self.path: _Path = ("tasks", name)
        self.roles = {role: of or doc.RoleDocument() for role, of in body.roles.items()}
        self.parameters = tuple((body.parameters or {}).items())
        self.subtasks = body.subtasks or {}
        self.places = [f"{role}.{step}" for role, of in self.roles.items() for step in of.steps or {}]
        self.given = [fault for fault in self.faults().values() if fault not in self.places]
        """The fault steps that nobody declares."""
        self.places += self.given
        self.sensors = {f"{role}.{name}": (role, name) for role, of in self.roles.items() for name in of.inputs or {}}

    def task(self) -> Task:
        self.check_names()
        start = self.body.start or doc.StartDocument()
        end = self.body.end or doc.EndDocument()
        moves = tuple(self.move(name, of or doc.MoveDocument()) for name, of in (self.body.moves or {}).items())
        released = {role for move in moves for role in move.releases} | set(start.release)
        firsts, lasts = [], []
        for role, of in self.roles.items():
            steps = [f"{role}.{step}" for step in of.steps or {}]
            firsts += steps[:1]
            lasts += steps[-1:] if role not in released else []
        start_gates, end_gates = (start.permissive, start.inhibitive), (end.permissive, end.inhibitive)
        return Task(
            self.name,
            tuple(self.role(role, of) for role, of in self.roles.items()),
            self.border(
                "start", (), firsts if start.targets is None else start.targets, start_gates, start.release, start
            ),
            self.border("end", lasts if end.sources is None else end.sources, (), end_gates, (), end),
            (*moves, *self.late()),
            tuple(self.subtask(name, of) for name, of in self.subtasks.items()),
            self.parameters,
            self.body.description,
            self.span(self.path, ""),
        )

    def faults(self) -> dict[str, str]:
        """For each step with a time limit that names no fault step, the one it gives."""
        steps = ((f"{role}.{name}", step) for role, of in self.roles.items() for name, step in (of.steps or {}).items())
        return {name: f"{name}_fault" for name, step in steps if step and step.within and not step.within.to}

    def late(self) -> Iterator[Move]:
        """The moves out of steps whose time is over."""
        for role, of in self.roles.items():
            for name, step in (of.steps or {}).items():
                if step is None or step.within is None:
                    continue
                path = (*self.path, "roles", role, "steps", name, "within")
                target = f"{role}.{step.within.to or f'{name}_fault'}"
                if not step.until:
                    message = f"'{role}.{name}' has a time limit, and waits for no completion that could come in time"
                    self.problem("F2028", message, "add `until`, or leave out `within`", path)
                if target not in self.places or target == f"{role}.{name}":
                    message = f"'{role}' has no other step '{step.within.to}'"
                    self.problem("F2025", message, "name a step of the same role", (*path, "to"))
                yield Move(
                    f"{role}_{name}_timeout", (f"{role}.{name}",), (target,), span=self.span(path, ""), late=True
                )

    def check_names(self) -> None:
        tables: tuple[tuple[str, Iterable[str], Collection[str]], ...] = (
            ("roles", self.roles, {"name"}),
            ("parameters", dict(self.parameters), {"name"}),
            ("subtasks", self.subtasks, {self.name}),
            ("moves", self.body.moves or {}, RESERVED_MOVES),
            *((f"roles/{role}/steps", of.steps or {}, RESERVED_STEPS) for role, of in self.roles.items()),
            *((f"roles/{role}/inputs", of.inputs or {}, ()) for role, of in self.roles.items()),
        )
        if not is_name(self.name):
            self.problem("F2012", f"{self.name!r} is not a name for a task", _NAME_HINT, self.path)
        words: dict[str, str] = {}
        for table, names, taken in tables:
            for name in names:
                path = (*self.path, *table.split("/"), name)
                if not is_name(name) or "." in name:
                    self.problem("F2012", f"{name!r} is not a name here", _NAME_HINT, path)
                elif name in taken:
                    hint = f"take another name than {' or '.join(sorted(taken))}"
                    self.problem("F2012", f"'{name}' has a meaning of its own here", hint, path)
                if table in _WORDS and (other := words.setdefault(name, table)) != table:
                    message = f"'{name}' is one of the {other} and one of the {table}"
                    self.problem("F2001", message, "templates and moves tell them apart by name alone", path)
        for role, of in self.roles.items():
            declared = {*(of.steps or {})}
            for name in of.inputs or {}:
                if name in declared:
                    message = f"'{name}' is a step and a sensor of '{role}'"
                    self.problem("F2001", message, "rename one of them", (*self.path, "roles", role, "inputs", name))

    def role(self, role: str, of: doc.RoleDocument) -> Role:
        path = (*self.path, "roles", role)
        return Role(
            role,
            tuple(
                made
                for name, step in (of.steps or {}).items()
                for made in self.with_fault(role, self.step(name, step or doc.StepDocument(), (*path, "steps", name)))
            ),
            tuple(
                (name, self.template(template or name, (*path, "inputs", name)))
                for name, template in (of.inputs or {}).items()
            ),
        )

    def with_fault(self, role: str, step: Step) -> Iterator[Step]:
        """The step, and the fault step that its time limit gives where the file declares none."""
        yield step
        if self.faults().get(f"{role}.{step.name}") in self.given:
            told = f"{step.command} was not done in time" if step.command else ""
            yield Step(f"{step.name}_fault", f"{step.place}_fault", description=told)

    def step(self, name: str, step: doc.StepDocument, path: _Path) -> Step:
        send = step.send
        command = None
        if step.until and not send:
            message = f"the step '{name}' waits until '{step.until}' but sends no command that could complete"
            hint = "add `send`, or declare the signal under `inputs` and write it as `if` of the move"
            self.problem("F2014", message, hint, (*path, "until"))
        if send:
            at = (*path, "send")
            command = Command(
                self.template(send.machine, (*at, "machine")),
                self.template(send.command, (*at, "command")),
                tuple((key, self.template(value, (*at, key))) for key, value in (send.model_extra or {}).items()),
            )
        return Step(
            name,
            self.template(step.place or name, (*path, "place")),
            command,
            self.template(step.until, (*path, "until")) if step.until else None,
            self.template(step.description, (*path, "description")),
            self.milliseconds(step.within, name, (*path, "within")),
        )

    def milliseconds(self, within: doc.StepWithinDocument | None, step: str, path: _Path) -> int | None:
        if within is None:
            return None
        if (found := parse_time(within.time)) is None:
            problem = no_time(step, within.time)
            self.problem(problem.code, problem.message, problem.hint, path)
        return found or 1

    def subtask(self, name: str, of: doc.SubtaskDocument) -> Subtask:
        path = (*self.path, "subtasks", name)
        arguments = tuple((of.task.model_extra or {}).items())
        for key, value in arguments:
            self.template(value, (*path, "task", key))
        return Subtask(name, TaskUse(of.task.name, arguments), self.template(of.description, (*path, "description")))

    def border(
        self,
        name: str,
        sources: Iterable[str],
        targets: Iterable[str],
        gates: tuple[list[str], list[str]],
        release: Iterable[str],
        of: doc.StartDocument | doc.EndDocument,
    ) -> Move:
        """Start or end: a move with one side outside, whose gates are sensors alone."""
        path = (*self.path, name)
        for key, names in zip(("if", "unless"), gates, strict=True):
            for gate in names:
                if gate in {*self.places, *self.subtasks}:
                    message = f"'{gate}' is a step of the task that is to {name}"
                    self.problem("F2025", message, "only sensors gate the start and the end", (*path, key), gate)
        return self.built(name, path, tuple(sources), tuple(targets), gates, tuple(release), of.description)

    def move(self, name: str, of: doc.MoveDocument) -> Move:
        path = (*self.path, "moves", name)
        if not of.sources:
            self.problem("F1009", f"'{name}' comes from no step", "add `from:`", path)
        for both in sorted({*of.sources} & {*of.targets}):
            message = f"'{both}' is both in `from` and in `to` of '{name}', which can then never fire"
            self.problem("F2009", message, f"write `if: {both}` to stay in the step", (*path, "to"), both)
        gates = (of.permissive, of.inhibitive)
        return self.built(name, path, tuple(of.sources), tuple(of.targets), gates, tuple(of.release), of.description)

    def built(
        self,
        name: str,
        path: _Path,
        sources: tuple[str, ...],
        targets: tuple[str, ...],
        gates: tuple[list[str], list[str]],
        release: tuple[str, ...],
        description: str,
    ) -> Move:
        places = [*self.places, *self.subtasks]
        permissive, inhibitive = gates
        for key, names, known, double in (
            ("from", sources, places, "F2007"),
            ("to", targets, places, "F2007"),
            ("if", permissive, [*places, *self.sensors], "F2022"),
            ("unless", inhibitive, [*places, *self.sensors], "F2022"),
            ("release", release, [*self.roles], "F2007"),
        ):
            seen = set[str]()
            for one in names:
                at = (*path, key)
                if one in seen:
                    self.problem(double, f"'{one}' stands twice in `{key}` of '{name}'", "write it once", at, one)
                elif one not in known:
                    what = "role" if key == "release" else "step" if known is places else "step or sensor"
                    hint = written_as_one(one, known, key) or meant_by(one, known) + _KNOWN_HINT[what]
                    self.problem("F2025", f"there is no {what} '{one}' in the task '{self.name}'", hint, at, one)
                seen.add(one)
        return Move(
            name,
            sources,
            targets,
            tuple(one for one in permissive if one not in self.sensors),
            tuple(one for one in inhibitive if one not in self.sensors),
            (
                *(Gate(*self.sensors[one]) for one in permissive if one in self.sensors),
                *(Gate(*self.sensors[one], wanted=False) for one in inhibitive if one in self.sensors),
            ),
            release,
            self.template(description, (*path, "description")),
            self.span(path, ""),
        )

    def template(self, text: str, path: _Path) -> str:
        words = {*self.roles, *dict(self.parameters)}
        for name in names_in_template(text):
            role, dot, key = name.partition(".")
            if role not in words or (dot and (role not in self.roles or not key)):
                what = "a brace without its partner" if name in {"{", "}"} else f"'{{{name}}}' is not known"
                hint = "write {role}, {role.machine}, {role.prefix} or {parameter}, with the names of this task"
                self.problem(
                    "F2026", f"{what} in a template of '{self.name}'", did_you_mean(role, sorted(words)) + hint, path
                )
        return text

    def problem(self, code: str, message: str, hint: str, path: _Path, word: str = "") -> None:
        if len(self.problems) < 100:
            self.problems.append(Diagnostic(code, message, hint, span=self.span(path, word)))

    def span(self, path: _Path, word: str) -> Span:
        """Where a path stands: at its key, or at its value where it has one word, or at that word of its list."""
        found = list(nodes_along(self.tree, path))
        key, node = found[-1]
        if isinstance(node, Sequence):
            # Of two equal words the second is the one too many.
            items = [item for item in node.items if isinstance(item, Scalar) and item.text == word]
            node = items[-1] if items else node
        at = node if len(found) > len(path) and (word or isinstance(node, Scalar)) and _shown(node) else key or node
        return node_span(self.source, at)


_NAME_HINT: Final = "use letters, digits, '_' and '-'"
_KNOWN_HINT: Final = {
    "role": "name a role of the task",
    "step": "write `role.step`, or the name of a subtask",
    "step or sensor": "write `role.step`, the name of a subtask, or `role.sensor` of the role's `inputs`",
}


def _shown(node: Node) -> bool:
    return not isinstance(node, Scalar) or bool(node.text)
