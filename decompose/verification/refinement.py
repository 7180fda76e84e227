"""Where the net of a bundle comes from: a conceptual net and registered tasks, opened anew, and what that carries over.

A bundle may say it or not; where it does, it holds the conceptual net and the tasks themselves. Then

1. the tasks are opened anew (`opening`, `naming_anew`), and the net of the bundle must be the one that they make, name
   for name, but for its own name, its properties and its arbiters, which are matters of that net alone;
2. the conditions of each task must be what a document on the task alone, closed anew, shows (`closed_tasks`), and the
   verdicts on the conceptual net what one on that net shows;
3. the file of obligations must be the one that is stated anew, byte for byte, and a second solver answer `unsat` each
   time (`relating`): that is the bisimulation of both nets, asked of each transition;
4. what was carried over must be what follows from these.

How that follows is argued in docs/refinement.md.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Final

from pydantic_core import from_json

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.closed_tasks import CONDITIONS, INFORMING, ClosedTask
from firable.decompose.verification.documents import checked_document
from firable.decompose.verification.formulas import spelled
from firable.decompose.verification.naming_anew import Named
from firable.decompose.verification.opening import Opening
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.relating import Relation
from firable.decompose.verification.solvers import Answers, answers_to, gave_up
from firable.decompose.verification.words import SENTENCES
from firable.nets.bundle import file_stem
from firable.nets.diagnostics import InputError
from firable.nets.interchange import canonical_json, net_from_json, net_to_json
from firable.nets.net import Net
from firable.nets.tasks.model import Catalogue
from firable.nets.tasks.printing import as_written
from firable.nets.tasks.text import parse_tasks
from firable.nets.verdict import NOTHING, Status, Verdict, Weight

PREFIX: Final = "refinement."
CONCEPTUAL: Final = "conceptual.json"
TASKS: Final = "tasks.yaml"
DOCUMENT: Final = "conceptual.evidence.json"
OBLIGATIONS: Final = "refinement.smt2"
TITLE: Final = "the net is what registered tasks make of a conceptual one, and does what that does"

CARRIED: Final = (
    "contact-free",
    "deadlock-free",
    "quasi-live",
    "doomed-markings",
    "live",
    "reversible",
    "home-markings",
    "effective-conflicts",
)
"""The verdicts on a conceptual net that its detailed net has too."""

_OPENED: Final = "the tasks of the conceptual net, opened"
_BY_DOCUMENT: Final = "what the document shows"
_RELATED: Final = "z3, of a relation between the markings of both nets"
_FOLLOWS: Final = "whatever the net fires, the conceptual net can fire, moves inside tasks aside"
_BISIMILAR: Final = "conceptual and detailed net are branching bisimilar, moves inside tasks hidden, "
_DIVERGENCE: Final = {True: "with explicit divergence", False: "but for endless runs inside a task"}


def of_task(task: str) -> str:
    """The document on a task."""
    return f"{file_stem(task)}.task.evidence.json"


class Stated:
    """What a bundle must say of its refinement, by what its documents show."""

    def __init__(self, conceptual: Net, tasks: Catalogue, detailed: Net) -> None:
        self.conceptual, self.tasks, self.detailed = conceptual, tasks, detailed
        self.named = Named(Opening(conceptual, tasks))
        used = {block.task.name for block in self.named.opening.blocks}
        if unused := [name for name in tasks if name not in used]:
            raise NotShownError(f"nobody names the task '{unused[0]}'", "evidence", TASKS)
        if not used:
            raise NotShownError("no place of the conceptual net names a task", "evidence", CONCEPTUAL)
        if conceptual.properties or conceptual.arbiters:
            raise NotShownError(f"'{CONCEPTUAL}' holds what is no matter of the refinement", "evidence", CONCEPTUAL)

    @cached_property
    def relation(self) -> Relation:
        """What is asked of each transition."""
        return Relation(self.named, self.detailed)

    def refuse_another_net(self) -> None:
        """Raise `NotShownError` where the detailed net is not the one that the tasks make."""
        for difference in self.named.differences(self.detailed):
            raise NotShownError(f"the net is not what its tasks make of '{self.conceptual.name}': {difference}", "net")

    def verdicts(self, shown: dict[tuple[str, str], Status]) -> Iterator[Verdict]:
        """The verdicts; `shown` gives what the document on a task (or on no task, the conceptual net) shows."""
        names = ", ".join(self.tasks)
        words = f"the net is what the tasks {names} make of '{self.conceptual.name}', opened"
        yield _verdict("opened", Status.PROVED, words, _OPENED, (CONCEPTUAL, TASKS))
        for task in self.tasks:
            for condition, (words, name) in CONDITIONS.items():
                status = shown.get((task, name), Status.UNKNOWN)
                weight = Weight.INFORMATION if condition in INFORMING else Weight.REQUIRED
                yield _verdict(f"task.{task}.{condition}", status, words, _BY_DOCUMENT, (of_task(task),), weight)
        for name in CARRIED:
            status = shown.get(("", name), Status.UNKNOWN)
            weight = Weight.REQUIRED if name == "contact-free" else Weight.INFORMATION
            words = f"in the conceptual net {SENTENCES[name][0]}"
            yield _verdict(f"conceptual.{name}", status, words, _BY_DOCUMENT, (DOCUMENT,), weight)
        related = (CONCEPTUAL, TASKS, DOCUMENT, OBLIGATIONS)
        yield _verdict("follows", Status.PROVED, _FOLLOWS, _RELATED, related)
        every = (*related, *map(of_task, self.tasks))
        settles, orderly = (
            all(shown.get((task, f"property.{what}")) is Status.PROVED for task in self.tasks)
            for what in ("settles", "orderly")
        )
        yield _verdict("bisimilar", Status.PROVED, f"{_BISIMILAR}{_DIVERGENCE[settles]}", _RELATED, every)
        for name in CARRIED:
            if shown.get(("", name)) is Status.PROVED and (
                name != "effective-conflicts" or (orderly and not self.named.opening.lent)
            ):
                words = f"carried over: {SENTENCES[name][0]}"
                yield _verdict(f"carried.{name}", Status.PROVED, words, _RELATED, every)


def _verdict(
    name: str,
    status: Status,
    words: str,
    method: str,
    evidence: tuple[str, ...],
    weight: Weight = Weight.REQUIRED,
) -> Verdict:
    evidence = () if status is Status.UNKNOWN else evidence
    return Verdict(f"{PREFIX}{name}", status, words, method, weight, evidence=evidence, discipline="interleaving")


def read(conceptual: str, tasks: str) -> tuple[Net, Catalogue]:
    """The conceptual net and the tasks of two files; raises `NotShownError` where one is not as it was written."""
    try:
        net = net_from_json(from_json(conceptual))
        if canonical_json(net_to_json(net)).decode() != conceptual:
            raise NotShownError(f"'{CONCEPTUAL}' is not as it was written", "evidence", CONCEPTUAL)
    except (InputError, ValueError):
        raise NotShownError(f"'{CONCEPTUAL}' is no net", "evidence", CONCEPTUAL) from None
    try:
        found = parse_tasks(tasks, TASKS)
    except InputError as error:
        raise NotShownError(f"'{TASKS}': {error.diagnostics[0].message}", "evidence", TASKS) from None
    if not as_written(found, tasks):
        raise NotShownError(f"'{TASKS}' is not as it was written", "evidence", TASKS)
    return net, found


def check_refinement(examination: Examination, solver: str, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on the refinement, if there are any; raises `NotShownError` where one is not shown."""
    names = {verdict.name for verdict in examination.bundle.verdicts if verdict.name.startswith(PREFIX)}
    if not names:
        return
    conceptual, tasks = read(examination.text(CONCEPTUAL), examination.text(TASKS))
    stated = Stated(conceptual, tasks, examination.bundle.net)
    stated.refuse_another_net()
    if examination.text(OBLIGATIONS) != stated.relation.text:
        raise NotShownError(f"'{OBLIGATIONS}' is not what must be proved of the net", "evidence", OBLIGATIONS)
    records = _Records(examination, answers, timeout_ms)
    for task in tasks.values():
        records.read(task.name, of_task(task.name), ClosedTask(task).net, [name for _, name in CONDITIONS.values()])
    records.read("", DOCUMENT, conceptual, CARRIED)
    demanded = {verdict.name: verdict for verdict in stated.verdicts(records.status)}
    for name in (*demanded, *sorted(names - set(demanded))):
        if name not in demanded:
            raise NotShownError(f"nobody knows what '{name}' is on", "verdicts", name)
        if examination.verdict(name) != demanded[name]:
            raise NotShownError(f"the verdict on '{name}' is not what its proof shows", "verdicts", name)
    records.demand(tasks)
    # What needs no solver comes first, so that a bundle that says something else is refused at once.
    open_ = _answered(stated.relation, answers, timeout_ms)
    _judge(examination, demanded, records, open_, solver)


class _Records:
    """What the documents on the tasks and on the conceptual net show."""

    def __init__(self, examination: Examination, answers: Answers, timeout_ms: int) -> None:
        self.examination, self.answers, self.timeout_ms = examination, answers, timeout_ms
        self.status: dict[tuple[str, str], Status] = {}
        self.late: dict[tuple[str, str], str] = {}
        self.methods: dict[tuple[str, str], str] = {}

    def read(self, task: str, file: str, net: Net, known: Collection[str]) -> None:
        """Read the document on a task or on the conceptual net, which may speak of nothing but what is known."""
        for one in checked_document(self.examination, file, net, self.answers, self.timeout_ms):
            key = (task, one.record.name)
            if one.record.name not in known:
                raise NotShownError(f"'{file}' speaks of '{one.record.name}', as no bundle does", "evidence", file)
            self.status[key] = Status.PROVED if one.record.proved else Status.VIOLATED
            self.methods[key] = "; ".join(one.methods) or "the net itself"
            if not one.shown:
                self.late[key] = one.only_claimed

    def demand(self, tasks: Catalogue) -> None:
        """Raise `NotShownError` where a condition on which the refinement rests is not proved."""
        wanted = {(task, name): c for task in tasks for c, (_, name) in CONDITIONS.items() if c not in INFORMING}
        for key, condition in {**wanted, ("", "contact-free"): "contact-free"}.items():
            if self.status.get(key) is not Status.PROVED:
                where = f"the task '{key[0]}'" if key[0] else "the conceptual net"
                raise NotShownError(f"it is not shown of {where} that it is {condition}", "verdicts", key[1])


def _answered(relation: Relation, answers: Answers, timeout_ms: int) -> set[str]:
    """The kinds of obligations of which the solver gave up one; an answer that refutes one is refused."""
    open_, names = set(), [name for name, _ in relation.obligations]
    said = answers_to(OBLIGATIONS, relation.text, map(spelled, names), answers, timeout_ms)
    for name, answer in zip(names, said, strict=True):
        if answer != "unsat" and not gave_up(answer):
            message = f"'{name}' of '{OBLIGATIONS}' is refuted: the solver says {answer}"
            raise NotShownError(message, "evidence", OBLIGATIONS)
        if answer != "unsat":
            open_.add(name.partition(".")[0])
    return open_


def _judge(
    examination: Examination, demanded: dict[str, Verdict], records: _Records, open_: set[str], solver: str
) -> None:
    every = next(iter(records.late.values()), "")
    for name, verdict in demanded.items():
        kind, _, rest = name.removeprefix(PREFIX).partition(".")
        key = ("", rest) if kind == "conceptual" else ("", "")
        if kind == "task":
            task, _, condition = rest.rpartition(".")
            key = (task, CONDITIONS[condition][1])
        method, late = _OPENED + " anew", ""
        if kind in {"task", "conceptual"}:
            method, late = records.methods.get(key, NOTHING), records.late.get(key, "")
            if verdict.status is Status.UNKNOWN:
                late = "undecided: the bundle itself does not say"
        elif kind != "opened":
            method = f"{solver}, of a relation between the markings of both nets, stated anew"
            late = f"{solver} gave up" if open_ else every
        examination.judge(verdict, shown=not late, method=NOTHING if late else method, only_claimed=late)


def without_the_rest(net: Net) -> Net:
    """A conceptual net without what is no matter of the refinement: its properties and arbiters."""
    return replace(net, properties=(), arbiters=())
