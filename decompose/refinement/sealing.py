"""A refinement in a bundle: the conceptual net, the tasks, and what shows that opening them keeps what it can do.

`refine` proves by a theorem, whose premises it checks itself: conditions of each task, a ledger of resources, gates at
the border. Whoever checks a bundle should have to trust neither. So the bundle holds a direct proof of what the theorem
concludes of these two nets: a relation between their markings that is a branching bisimulation, asked of one transition
after the other. Its text is that of the checker (`firable.decompose.verification.relating`), which knows nothing of the
theorem; here z3 is asked it, and should it refute what `refine` has proved, that is an error of ours, told as one.

The rejected alternative, to write the ledger and the border conditions a second time for the checker, would have shown
that two programs agree on what the theorem asks, and left the theorem a matter of faith.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from firable.analysis.check import check
from firable.analysis.evidence.producing.lacking import is_of_budget, what_to_allow
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget
from firable.decompose.refinement.binding import tasks_used
from firable.decompose.refinement.closed import BlockProof
from firable.decompose.refinement.evidence import condition_document
from firable.decompose.refinement.refining import refine
from firable.decompose.verification.refinement import (
    CARRIED,
    CONCEPTUAL,
    DOCUMENT,
    OBLIGATIONS,
    TASKS,
    Stated,
    of_task,
    without_the_rest,
)
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import by_z3, gave_up
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.interchange import canonical_json, net_to_json
from firable.nets.net import Net
from firable.nets.tasks.model import Catalogue
from firable.nets.tasks.printing import format_tasks
from firable.nets.verdict import Status, Verdict


@dataclass(frozen=True)
class Origin:
    """What a net is made of: a conceptual net, and the tasks that it names, with their proofs.

    `budget` is for exploring the conceptual net.
    """

    conceptual: Net
    tasks: Catalogue
    blocks: tuple[BlockProof, ...]
    budget: Budget | None = None

    @classmethod
    def of(cls, net: Net, catalogue: Catalogue, budget: Budget | None = None) -> Origin:
        """The origin that a conceptual net and registered tasks are; raises `InputError` as `refine` does."""
        blocks = refine(net, catalogue).blocks
        tasks = {task.name: task for task in tasks_used(net, catalogue)}
        return cls(without_the_rest(net), tasks, blocks, budget)


def sealed(
    detailed: Net, origin: Origin, limits: Limits | None, timeout_ms: int
) -> tuple[tuple[Verdict, ...], dict[str, str]]:
    """The verdicts on a refinement and the files of a bundle that show them; `timeout_ms` is for each obligation.

    Raises `InputError` F4003 where the detailed net is another one than the tasks make, where the
    conceptual net is not known to be contact-free, and where there is no evidence on something that the rest needs; for
    what a budget leaves open it is F3004.
    """
    conceptual = origin.conceptual
    try:
        stated = Stated(conceptual, origin.tasks, detailed)
        stated.refuse_another_net()
        text = stated.relation.text
    except NotShownError as problem:
        hint = (
            "make the net with `firable refine`, and change the conceptual net or the tasks rather than what they make"
        )
        raise InputError([Diagnostic("F4003", str(problem), hint)]) from None
    files = {
        CONCEPTUAL: canonical_json(net_to_json(conceptual)).decode(),
        TASKS: format_tasks(origin.tasks.values()),
        OBLIGATIONS: text,
    }
    shown: dict[tuple[str, str], Status] = {}
    report = check(conceptual, budget=origin.budget)
    found = [report.verdict(name) for name in CARRIED]
    decided = tuple(verdict for verdict in found if verdict.status is not Status.UNKNOWN)
    document = evidence_of_report(replace(report, verdicts=decided), (), limits)
    files[DOCUMENT] = document.to_text()
    lacking = {}
    for about, one in {"": document, **{b.task.name: condition_document(b, limits) for b in origin.blocks}}.items():
        if about:
            files[of_task(about)] = one.to_text()
        for record in one.records:
            shown[about, record.name] = Status.PROVED if record.proved else Status.VIOLATED
            if record.lacking:
                lacking[about, record.name] = record.lacking
    if shown.get(("", "contact-free")) is not Status.PROVED:
        hint = "`firable check` of the conceptual net shows where; a task that violates its conditions is told before"
        message = f"'{conceptual.name}' is not known to be contact-free, and nothing is carried over from it"
        code = "F4003" if ("", "contact-free") in shown else "F3004"  # undecided, it has no record
        raise InputError([Diagnostic(code, message, hint)])
    for (about, name), why in lacking.items():
        where = f"of the task '{about}'" if about else f"of '{conceptual.name}'"
        message = f"'{name}' {where} is decided, and there is no evidence that shows it again: {why}"
        code = "F3004" if is_of_budget(why) else "F4003"
        raise InputError([Diagnostic(code, message, f"allow {what_to_allow(why)}, to look for it")])
    said = by_z3(text, timeout_ms)
    for (name, _), answer in zip(stated.relation.obligations, said[1::2], strict=True):
        if gave_up(answer):
            message = f"'{name}' of the refinement is not decided in {timeout_ms / 1000:g} s"
            raise InputError([Diagnostic("F3004", message, "allow more time, or make the tasks smaller")])
        if answer != "unsat":
            raise RuntimeError(f"'{name}' follows from the theorem of refinement, and z3 says {answer}")
    return tuple(stated.verdicts(shown)), files
