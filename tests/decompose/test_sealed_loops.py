"""What a bundle says of loops is what its documents show: nothing that they leave open, or tell without evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest
from support.bench_cell import PLANT as BENCH
from support.bench_cell import STARTS

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.document import Document, Record, document_from_text
from firable.analysis.goal import Limits
from firable.analysis.loop.families import Answered, Family, answers
from firable.analysis.spaces.reachability import Budget
from firable.decompose.proofs.closed_loops import FAILING, UNDECIDED, sealed_loops
from firable.decompose.splitting.cut import split
from firable.nets.machines.loop import ClosedLoop
from firable.nets.text import parse_net
from firable.nets.verdict import Status

LOST = "property.loop.live.0"
"""The record on the transition that fires once."""


def left_out(records: Iterable[Record]) -> Iterator[Record]:
    return (record for record in records if record.name != LOST)


def without_evidence(records: Iterable[Record]) -> Iterator[Record]:
    for record in records:
        yield Record(LOST, False, (), "the time was over") if record.name == LOST else record


def test_what_stands_still_after_a_fault_is_looked_for_in_the_time_of_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Budget | None] = []

    def ask(loop: ClosedLoop, families: Iterable[Family], budget: Budget | None = None, **by: Any) -> Answered:
        given.append(budget)
        return answers(loop, families, budget, **by)

    for module in ("faults", "verdicts"):
        monkeypatch.setattr(f"firable.analysis.loop.{module}.answers", ask)
    sealed_loops(split(parse_net(STARTS)), BENCH, lambda: Limits(Deadline.after(0)))
    assert given == [None, Budget(seconds=0.0)], "of the loop without faults, and of that with them"


WITH_LIVE = ("loop.live", "fault.R.repaired")
"""What is decided by whether transitions can always fire again."""


@pytest.mark.parametrize(
    ("change", "status", "subjects", "bound", "lacking"),
    [
        (iter, Status.VIOLATED, ("warm",), "", {}),
        (left_out, Status.UNKNOWN, (), UNDECIDED, {}),
        (without_evidence, Status.VIOLATED, ("warm",), "", dict.fromkeys(WITH_LIVE, "the time was over")),
    ],
)
def test_what_a_document_does_not_show_is_not_said_and_takes_no_question_away(
    change: Callable[[Iterable[Record]], Iterator[Record]],
    status: Status,
    subjects: tuple[str, ...],
    bound: str,
    lacking: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = Answered.document

    def document(asked: Answered, limits: Limits | None = None) -> Document:
        whole = found(asked, limits)
        return Document(whole.net, whole.discipline, tuple(change(whole.records)))

    monkeypatch.setattr(Answered, "document", document)
    verdicts, files, lacks = sealed_loops(split(parse_net(STARTS)), BENCH, Limits)
    (live,) = (verdict for verdict in verdicts if verdict.name == "loop.live")
    is_shown = change is iter
    assert (live.status, live.subjects, live.bound, bool(live.evidence)) == (status, subjects, bound, is_shown)
    assert lacks == lacking
    asked = {prop.name for prop in document_from_text(files[FAILING]).net.properties}
    about = ("warm", "go", "stay") if not is_shown else ("go", "stay")
    assert {name for name in asked if name.startswith("fault.R.t")} == {f"fault.R.t{i}" for i in range(len(about))}
