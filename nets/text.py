"""Reading the net file, `*.firable.yaml`: text, tree with positions, document, `Net`.

Four stages, each of which reports all that it finds and stops the ones after it, so that one mistake is reported
once and not as its twenty consequences:

1. `source`: bytes to text, within bounds;
2. `yaml_tree`: text to a tree of strings that knows where each stands; ambiguous YAML is refused;
3. `document`: the tree's data against the pydantic models; the paths of the errors lead back into the tree;
4. here: names made full (`free` in `robot` is `robot.free`), gates told apart, formulas parsed, and the rules of
   `Net` itself, whose diagnostics name subjects that lead back into the tree as well.

Which gate is internal and which external follows from the name: a declared signal or a place. `until` declares the
completion signal of a place's command and puts its gate on each transition that takes the token out; `within` adds the
timer, the fault transition and, where the file declares none of its name, the fault place (`firable.nets.time_limits`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from firable.nets import document as doc
from firable.nets.diagnostics import Diagnostic, InputError, Problems, Subject
from firable.nets.document_errors import document_problems, version_problem
from firable.nets.formula import Formula, FormulaError, parse_formula
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Resource,
    Signal,
    SignalKind,
    TaskUse,
    TemporalProperty,
    TimeLimit,
    Transition,
)
from firable.nets.pausing import without_cycle_search
from firable.nets.source import Source, read_source
from firable.nets.temporal import Logic, Temporal, logics, parse_temporal
from firable.nets.text_positions import Positions
from firable.nets.time_limits import (
    fault_place,
    fault_transition,
    fault_transition_name,
    no_time,
    parse_time,
    timer_name,
)
from firable.nets.verdict import Expectation, Status
from firable.nets.written_as_one import meant_by, written_as_one
from firable.nets.yaml_tree import Node, data, parse_tree

SIZE_BYTES_MAX: Final = 16 * 1024 * 1024


def read_net(path: str | Path) -> Net:
    """Read a net file.

    Raises `InputError` with the position of every problem: F1001-F1012 for the text, F2001-F2029 for the net, but for
    F2010 and F2011: the text cannot say the one, and only a split asks for the other.
    """
    return read_positioned(path)[0]


def read_positioned(path: str | Path) -> tuple[Net, Positions]:
    """Read a net file, and remember where everything stands: for problems that are found later, such as a split's.

    Raises `InputError` as `read_net` does.
    """
    return _parse(read_source(path, SIZE_BYTES_MAX))


def parse_net(text: str, file: str = "<text>") -> Net:
    """Read a net from text; `file` is the name in diagnostics.

    Raises `InputError` as `read_net` does.

    >>> parse_net("firable: 1\\ncell: demo\\nplaces: {p: , q: }\\nstart: p\\ntransitions: {t: {from: p, to: q}}").name
    'demo'
    """
    source = Source(file, text)
    if len(text) > SIZE_BYTES_MAX:
        raise source.refuse("F1003", f"more than {SIZE_BYTES_MAX:,} characters", "is this the right text?")
    return _parse(source)[0]


def parse_positioned(text: str, file: str) -> tuple[Net, Positions]:
    """Read a net from text, and remember where everything stands; raises `InputError` as `parse_net` does."""
    return _parse(Source(file, text))


def _parse(source: Source) -> tuple[Net, Positions]:
    with without_cycle_search():
        return _parsed(source)


def _parsed(source: Source) -> tuple[Net, Positions]:
    tree = parse_tree(source)
    if problem := version_problem(source, tree):
        raise InputError([problem])
    try:
        document = doc.NetDocument.model_validate(data(tree))
    except ValidationError as error:
        raise InputError(document_problems(source, tree, error)) from None
    reading = _Reading(source, tree, document)
    return reading.net(), reading.positions


@dataclass(frozen=True)
class _Scope:
    """A controller, or the top level where nothing has an owner."""

    owner: str | None
    path: tuple[str, ...]
    start: list[str]
    inputs: list[str]
    places: dict[str, doc.PlaceDocument | None]

    def full(self, local: str) -> str:
        return local if self.owner is None else f"{self.owner}.{local}"

    def local(self, full: str) -> str:
        return full if self.owner is None else full.removeprefix(f"{self.owner}.")

    def is_full(self, name: str) -> bool:
        """Whether a name that stands here is the full one of a place of this scope, where the local one is expected."""
        return name not in self.places and self.local(name) in self.places

    def said_local(self, name: str) -> str:
        """The hint on a full name."""
        return f"inside '{self.owner}' names are local: write '{self.local(name)}'"


class _Reading:
    """One document on its way to a `Net`."""

    def __init__(self, source: Source, tree: Node, document: doc.NetDocument) -> None:
        self.document = document
        self.positions = Positions(source, tree)
        self.problems = Problems()
        self.faults: list[Transition] = []
        """The fault transitions that time limits give; they come after those of the file."""
        controllers = ((name, body or doc.ControllerDocument()) for name, body in (document.controllers or {}).items())
        self.scopes = [
            *(_Scope(name, ("controllers", name), c.start, c.inputs, c.places or {}) for name, c in controllers),
            _Scope(None, (), document.start, document.inputs, document.places or {}),
        ]

    def net(self) -> Net:
        document = self.document
        places = tuple(place for scope in self.scopes for place in self.places(scope))
        signals = tuple(signal for scope in self.scopes for signal in self.signals(scope))
        transitions = tuple(self.transitions(places, signals))
        properties = tuple(self.properties())
        controllers = tuple(
            Controller(name, body.coordinator, body.description, body.under) if body else Controller(name)
            for name, body in (document.controllers or {}).items()
        )
        arbiters = tuple(
            Arbiter(name, tuple(body.among), ArbitrationRule(body.by))
            for name, body in (document.arbiters or {}).items()
        )
        try:
            net = Net(
                document.cell,
                places,
                transitions,
                signals,
                controllers,
                arbiters,
                properties,
                document.description,
                tuple(Expectation(name, Status(end)) for name, end in (document.expect or {}).items()),
            )
        except InputError as error:
            raise InputError(self.positions.place(self.problems + list(error.diagnostics))) from None
        if self.problems:
            raise InputError(self.positions.place(self.problems))
        return net

    def places(self, scope: _Scope) -> Iterator[Place]:
        marked: set[str] = set()
        for local in scope.start:
            subject: Subject = (*scope.path, "start", local)
            if local not in scope.places:
                self.problems.report(_unknown_start(scope, local, subject))
            elif local in marked:
                self.problems.report(
                    Diagnostic(
                        "F2006", f"'{local}' stands twice in `start`", "a place holds one token at most", subject
                    )
                )
            marked.add(local)
        for local, body in scope.places.items():
            place = body or doc.PlaceDocument()
            send, task, opens, within = place.send, place.task, place.opens, place.within
            full = scope.full(local)
            made = Place(
                full,
                scope.owner,
                local in marked,
                Command(send.machine, send.command, tuple((send.model_extra or {}).items())) if send else None,
                scope.full(place.until) if place.until else None,
                place.description,
                TaskUse(task.name, tuple((task.model_extra or {}).items())) if task else None,
                Resource(opens.to, opens.machine, opens.prefix, tuple((opens.model_extra or {}).items()))
                if opens
                else None,
                TimeLimit(
                    self.milliseconds(full, within),
                    scope.full(within.timer) if within.timer else timer_name(full),
                )
                if within
                else None,
            )
            yield made
            if within is None:
                continue
            if within.to and scope.is_full(within.to):
                subject = ("places", full, "within", "to")
                message = f"there is no place '{scope.full(within.to)}' to go to"
                self.problems.report(Diagnostic("F2002", message, scope.said_local(within.to), subject))
                continue
            fault = fault_place(made)
            to = scope.full(within.to) if within.to else fault.name
            if to == fault.name and scope.local(to) not in scope.places:
                yield fault
            if to == full:
                self.problems.report(_fault_at_itself(full))
            elif made.completion is not None:  # otherwise `Net` says that there is none (F2028)
                self.faults.append(fault_transition(made, to, within.transition or fault_transition_name(full)))

    def milliseconds(self, place: str, within: doc.WithinDocument) -> int:
        found = parse_time(within.time)
        if found is None:
            self.problems.report(no_time(place, within.time))
            return 1  # that it is none is said once
        return found

    def signals(self, scope: _Scope) -> Iterator[Signal]:
        for local in scope.inputs:
            yield Signal(scope.full(local), scope.owner)
        completions = dict.fromkeys(place.until for place in scope.places.values() if place and place.until)
        for local in completions:
            # A name that is a sensor too is left to `Net`, which says so (F2018).
            if local not in scope.inputs:
                yield Signal(scope.full(local), scope.owner, SignalKind.COMPLETION)
        for local, place in scope.places.items():
            if place and place.within:
                timer = scope.full(place.within.timer) if place.within.timer else timer_name(scope.full(local))
                yield Signal(timer, scope.owner, SignalKind.TIMER)

    def transitions(self, places: tuple[Place, ...], signals: tuple[Signal, ...]) -> Iterator[Transition]:
        external = {signal.name for signal in signals}
        completion = {place.name: place.completion for place in places if place.completion is not None}
        for name, transition in (self.document.transitions or {}).items():
            inputs, outputs = transition.inputs, transition.outputs
            for both in () if (twice := set(inputs)).isdisjoint(outputs) else sorted(twice.intersection(outputs)):
                self.problems.report(
                    Diagnostic(
                        "F2009",
                        f"'{both}' is both in `from` and in `to` of '{name}', which can then never fire",
                        f"write `if: {both}` to read the place without taking the token",
                        ("transitions", name, "to", both),
                    )
                )
            implied = dict.fromkeys([completion[source] for source in inputs if source in completion])
            opening = [*implied, *[gate for gate in transition.permissive if gate in external and gate not in implied]]
            yield Transition(
                name,
                tuple(inputs),
                tuple(outputs),
                tuple([gate for gate in transition.permissive if gate not in external]),
                tuple([gate for gate in transition.inhibitive if gate not in external]),
                (
                    *[ExternalGate(gate) for gate in opening],
                    *[ExternalGate(gate, wanted=False) for gate in transition.inhibitive if gate in external],
                ),
                transition.number,
                transition.description,
            )
        yield from self.faults

    def properties(self) -> Iterator[Property | TemporalProperty]:
        for name, body in (self.document.properties or {}).items():
            if body.leads_to is not None:
                source = self.formula(body.leads_to.source, ("properties", name, "leads_to", "from"))
                target = self.formula(body.leads_to.target, ("properties", name, "leads_to", "to"))
                if source and target:
                    yield Property(name, PropertyKind.LEADS_TO, source, target, Fairness(body.leads_to.fairness))
                continue
            for pattern in doc.PATTERNS:
                text = getattr(body, pattern)
                if text is not None and (formula := self.formula(text, ("properties", name, pattern))):
                    yield Property(name, PropertyKind(pattern), formula)
            for logic in Logic:
                text = getattr(body, logic)
                if text is not None and (temporal := self.temporal(text, logic, ("properties", name, logic))):
                    yield TemporalProperty(name, logic, temporal)

    def formula(self, text: str, subject: Subject) -> Formula | None:
        try:
            return parse_formula(text)
        except FormulaError as error:
            self.no_formula(error, "write places joined by and, or, not, -> and brackets", subject)
            return None

    def temporal(self, text: str, logic: Logic, subject: Subject) -> Temporal | None:
        try:
            formula = parse_temporal(text)
            if logic not in logics(formula):
                raise FormulaError(f"this is a formula of {'LTL' if logic is Logic.CTL else 'CTL'}", 0)
        except FormulaError as error:
            hint = "CTL has EX, EF, EG, E[p U q] and the same with A; LTL has X, F, G, p U q"
            self.no_formula(error, hint, subject)
            return None
        return formula

    def no_formula(self, error: FormulaError, hint: str, subject: Subject) -> None:
        problem = Diagnostic("F1012", f"not a formula: {error.message}", hint, subject)
        self.problems.report(replace(problem, span=self.positions.in_formula(subject, error.column)))


def _unknown_start(scope: _Scope, local: str, subject: Subject) -> Diagnostic:
    if scope.is_full(local):
        hint = scope.said_local(local)
    elif not (hint := written_as_one(local, scope.places, "start")):
        hint = meant_by(local, list(scope.places)) + "`start` names places of the same `places`"
    return Diagnostic("F2002", f"there is no place '{scope.full(local)}' to start in", hint, subject)


def _fault_at_itself(place: str) -> Diagnostic:
    hint = "name another place of its controller, or leave out `to`"
    return Diagnostic(
        "F2009", f"the fault place of '{place}' is '{place}' itself", hint, ("places", place, "within", "to")
    )
