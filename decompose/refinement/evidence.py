"""What shows the conditions of refinement, for whoever carries verdicts over by the theorem without having proved them.

What `refine` says of the detailed net rests on three things: the conditions of each task, closed; what is proved of the
conceptual net, that it is contact-free above all; and the theorem (`carrying`). The first two are verdicts on small
nets, so they leave what any verdict leaves: a document for each task on its closed net, with the conditions as
properties of it, and one on the conceptual net. `firable verify` checks them by the firing rule alone.

The conditions are stated here a second time, as formulas instead of searches, and must be answered alike:

- *ends*: AG EF (the task can end, or is not under way);
- *ends-clean*: never can it end with more left than its last steps, or a released role that is not idle;
- *contact-free* and *complete*: the verdicts `contact-free` and `quasi-live` of every net;
- *settles*: whenever it is under way it is left again, on every run, without any fairness;
- *orderly*: never are two transitions firable that share an input or an output.

That the detailed net is the one that the tasks make of the conceptual one is no matter of these documents. Where that
net is small, another one shows what was carried over of the detailed net itself, without theorem and tasks; it confirms
the refinement as comparing both nets by bisimulation does (`confirming`), to whoever reads it later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

from firable.analysis.check import check
from firable.analysis.evidence.document import Document
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.analysis.report import CheckReport
from firable.analysis.spaces.reachability import Budget
from firable.decompose.refinement.carrying import METHOD
from firable.decompose.refinement.closed import BlockProof
from firable.decompose.refinement.confirming import MARKINGS_MAX, TheoremError
from firable.nets.bundle import file_stem
from firable.nets.formula import And, Constant, Firable, Formula, Holds, Not, Or
from firable.nets.net import Fairness, Net, Property, PropertyKind
from firable.nets.tasks.model import Task
from firable.nets.verdict import Status, Verdict

_OF_EVERY_NET: Final = {"contact-free": "contact-free", "complete": "quasi-live"}
"""The conditions that are verdicts on every net, and their names there."""


def refinement_evidence(
    blocks: Sequence[BlockProof],
    report: CheckReport,
    verdicts: Sequence[Verdict],
    limits: Limits | None = None,
    *,
    detailed: Net | None = None,
) -> tuple[tuple[Verdict, ...], dict[str, bytes]]:
    """The verdicts of a refinement with the names of what shows them, and the documents by the names of their files.

    `report` is on the conceptual net. A verdict that is carried over rests on all documents. One that is large is
    packed, and its name ends in `.gz`. What is carried over to a `detailed` net is shown of that itself, too, where it
    has no more than `MARKINGS_MAX` markings.

    Raises `RuntimeError` where a condition is answered otherwise by its formula than by the search, and `TheoremError`
    where the detailed net has another verdict than is carried over to it.
    """
    documents, of_task = dict[str, bytes](), dict[str, str]()

    def add(name: str, document: Document) -> str:
        data = document.to_bytes()
        file = f"{file_stem(name)}.evidence.json" + ("" if data.startswith(b"{") else ".gz")
        documents[file] = data
        return file

    for block in blocks:
        file = add(f"{block.task.name}.task", condition_document(block, limits))
        of_task |= {verdict.name: file for verdict in block.verdicts}
    conceptual = add(report.net.name, evidence_of_report(report, (), limits))
    over = [verdict for verdict in verdicts if verdict.method == METHOD and verdict.status is not Status.UNKNOWN]
    if detailed is not None and (direct := _direct(detailed, over, limits)) is not None:
        add(f"{detailed.name}.detailed", direct)

    def files(verdict: Verdict) -> tuple[str, ...]:
        if verdict.name in of_task:
            return (of_task[verdict.name],)
        if verdict.name == "conceptual.contact-free":
            return (conceptual,)
        return tuple(documents) if verdict in over else ()

    return tuple(replace(verdict, evidence=files(verdict)) for verdict in verdicts), documents


def condition_document(block: BlockProof, limits: Limits | None) -> Document:
    """The conditions of a task, as verdicts on its closed net."""
    report = check(replace(block.net, properties=tuple(conditions(block.task, block.net))))
    conditions_of = {verdict.name.partition(".")[2]: verdict for verdict in block.verdicts}
    asked = []
    for name, searched in conditions_of.items():
        answered = report.verdict(_OF_EVERY_NET.get(name, f"property.{name}"))
        if {answered.status, searched.status} == {Status.PROVED, Status.VIOLATED}:
            raise RuntimeError(f"'{searched.name}' is {searched.status} by searching, {answered.status} by its formula")
        asked.append(answered)
    return evidence_of_report(replace(report, verdicts=tuple(asked)), (), limits)


def _direct(detailed: Net, over: Sequence[Verdict], limits: Limits | None) -> Document | None:
    """What is carried over, of the detailed net itself; None where that is too large to be explored for it."""
    report = check(detailed, budget=Budget(MARKINGS_MAX))
    if not report.space.complete:
        return None
    found = tuple(report.verdict(verdict.name) for verdict in over)
    for carried, explored in zip(over, found, strict=True):
        if {carried.status, explored.status} == {Status.PROVED, Status.VIOLATED}:
            raise TheoremError(f"'{carried.name}' is {carried.status}, says the theorem, and {explored.status}")
    return evidence_of_report(replace(report, verdicts=found), (), limits)


def conditions(task: Task, net: Net) -> Iterator[Property]:
    """The conditions that are not asked of every net anyway, as properties of the task's closed net."""
    inside: Formula = Holds(task.name)
    ready = And((inside, *map(Holds, task.end.sources)))
    left = [name for name in (*task.steps, *(one.name for one in task.subtasks)) if name not in task.end.sources]
    not_idle = [Not(Holds(f"{role}.idle")) for role in sorted(task.released)]
    yield Property("ends", PropertyKind.ALWAYS_POSSIBLE, Or((ready, Not(inside))))
    yield Property("ends-clean", PropertyKind.NEVER, And((ready, Or((*map(Holds, left), *not_idle)))))
    yield Property("settles", PropertyKind.LEADS_TO, inside, Not(inside), Fairness.NONE)
    competing = tuple(
        And((Firable(t.name), Firable(u.name)))
        for t, u in combinations(net.transitions, 2)
        if {*t.inputs} & {*u.inputs} or {*t.outputs} & {*u.outputs}
    )
    yield Property("orderly", PropertyKind.NEVER, Or(competing) if competing else Constant(value=False))
