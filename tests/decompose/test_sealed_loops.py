"""What a bundle says of loops is what its documents show: nothing that they leave open, or tell without evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from hashlib import sha256
from typing import Any

import pytest
from support.bench_cell import PLANT as BENCH
from support.bench_cell import STARTS

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.document import Document, Record, document_from_text
from firable.analysis.goal import Limits
from firable.analysis.loop.families import Answered, Family, answers
from firable.analysis.loop.verdicts import ask_loop
from firable.analysis.spaces.reachability import Budget
from firable.decompose.proofs import closed_loops
from firable.decompose.proofs.closed_loops import FAILING, LOOP, PLANT, UNDECIDED, sealed_loops
from firable.decompose.proofs.held_gates import held_gates
from firable.decompose.splitting.cut import split
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import parse_plant
from firable.nets.text import parse_net
from firable.nets.verdict import Status, Verdict

WITHOUT_FAULTS = BENCH.replace(", may_fail: repairable", "").replace(", may_fail: for_good", "")
LOST, LAST = "property.loop.live.0", "property.loop.live.2"
"""The records on the transition that fires once, and on one that always can again."""


def left_out(records: Iterable[Record]) -> Iterator[Record]:
    return (record for record in records if record.name != LOST)


def without_evidence(records: Iterable[Record]) -> Iterator[Record]:
    for record in records:
        yield Record(LOST, False, (), "the time was over") if record.name == LOST else record


def last_without_evidence(records: Iterable[Record]) -> Iterator[Record]:
    for record in records:
        yield Record(LAST, True, (), "the time was over") if record.name == LAST else record


def test_what_stands_still_after_a_fault_is_looked_for_in_the_time_of_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Budget | None] = []

    def ask(loop: ClosedLoop, families: Iterable[Family], budget: Budget | None = None, **by: Any) -> Answered:
        given.append(budget)
        return answers(loop, families, budget, **by)

    for module in ("faults", "verdicts"):
        monkeypatch.setattr(f"firable.analysis.loop.{module}.answers", ask)
    sealed_loops(split(parse_net(STARTS)), BENCH, lambda: Limits(Deadline.after(0)))
    assert given == [None, Budget(seconds=0.0)], "of the loop without faults, and of that with them"


class ExploringError(Exception):
    """The first loop would be explored now."""


@pytest.mark.parametrize(
    ("plant", "failing"),
    [(BENCH, [(Sending.AT_ONCE, Faults.REPAIRED), (Sending.AT_ONCE, Faults.FOR_GOOD)]), (WITHOUT_FAULTS, [])],
    ids=["machines that may fail", "machines that never fail"],
)
def test_each_loop_is_seen_to_be_comparable_before_any_is_explored(
    plant: str, failing: list[tuple[Sending, Faults]], monkeypatch: pytest.MonkeyPatch
) -> None:
    compared: list[tuple[Sending, Faults]] = []

    def explored(*_: Any, **__: Any) -> None:
        raise ExploringError

    monkeypatch.setattr(closed_loops, "compare", lambda one, _: compared.append((one.sending, one.faults)))
    monkeypatch.setattr(closed_loops, "held_gates", explored)
    with pytest.raises(ExploringError):
        sealed_loops(split(parse_net(STARTS)), plant, Limits)
    assert compared == [(Sending.LATE, Faults.NONE), (Sending.AT_ONCE, Faults.NONE), *failing]


def test_a_verdict_that_its_document_shows_is_sealed_as_it_was_found_without_its_run() -> None:
    net, model = parse_net(STARTS), parse_plant(BENCH)
    found = (*held_gates(split(net), model).verdicts, *ask_loop(net, model).verdicts)
    verdicts, _, _ = sealed_loops(split(net), BENCH, Limits)
    assert {one.status for one in found} == {Status.PROVED, Status.VIOLATED}
    assert said(found).items() <= said(verdicts).items()
    assert not any(one.hint or one.witness for one in verdicts)
    assert all(one.method.startswith("closed loop with the machines of the plant") for one in verdicts)


def said(verdicts: Iterable[Verdict]) -> dict[str, tuple[object, ...]]:
    return {v.name: (v.status, v.statement, v.weight, v.subjects, v.discipline) for v in verdicts}


WITH_LIVE = ("loop.live", "fault.R.repaired")
"""What is decided by whether transitions can always fire again."""


@pytest.mark.parametrize(
    ("change", "status", "subjects", "bound", "lacking"),
    [
        (iter, Status.VIOLATED, ("warm",), "", {}),
        (left_out, Status.UNKNOWN, (), UNDECIDED, {}),
        (without_evidence, Status.VIOLATED, ("warm",), "", dict.fromkeys(WITH_LIVE, "the time was over")),
        (last_without_evidence, Status.VIOLATED, ("warm",), "", dict.fromkeys(WITH_LIVE, "the time was over")),
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
    evidence = (LOOP, PLANT) if change is iter else ()
    assert (live.status, live.subjects, live.bound, live.evidence) == (status, subjects, bound, evidence)
    assert live.hint == "", "nobody has ended it with Ctrl-C"
    assert live.method == f"closed loop with the machines of the plant {sha256(BENCH.encode()).hexdigest()}"
    assert lacks == lacking
    asked = {prop.name for prop in document_from_text(files[FAILING]).net.properties}
    about = ("go", "stay") if change in {iter, last_without_evidence} else ("warm", "go", "stay")
    assert {name for name in asked if name.startswith("fault.R.t")} == {f"fault.R.t{i}" for i in range(len(about))}
