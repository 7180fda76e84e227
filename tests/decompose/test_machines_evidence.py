"""The machines of a cell in a bundle: what shows of the three loops what is said of them, and nothing else does."""

from dataclasses import replace
from functools import cache
from hashlib import sha256
from typing import Any

import pytest
from support import inspected_cell, together_cell
from support.bench_cell import PLANT as BENCH
from support.bench_cell import STARTS
from support.bundle_mutants import evidence_mutants, verdict_mutants
from support.examples import some
from support.remembered import answered, read

from firable.analysis.check import check
from firable.analysis.evidence.document import Document, Record, document_from_text
from firable.analysis.goal import Limits
from firable.analysis.loop.families import Answered
from firable.decompose.bundling import make_bundle
from firable.decompose.proofs import closed_loops
from firable.decompose.proofs.closed_loops import sealed_loops
from firable.decompose.proofs.held_gates import held_gates
from firable.decompose.splitting.cut import split
from firable.decompose.verification import documents, machines, same_loop
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.documents import ShownRecord, checked_document
from firable.decompose.verification.machines import (
    FAILING,
    LOOP,
    O4,
    PLANT,
    PREFIXES,
    check_machines,
)
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.interchange import net_digest
from firable.nets.machines.closing import close
from firable.nets.machines.laws import Laws
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net
from firable.nets.verdict import Status

TIMEOUT_MS = 10_000
FILES = {PLANT, O4, LOOP, FAILING}


def plant() -> str:
    return catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")


@cache
def bundled() -> Bundle:
    return make_bundle(check(catalogue_net("one_robot")), plant=plant())


_KNOWN: dict[tuple[str, str], list[ShownRecord] | NotShownError] = {}
_CLOSED: dict[tuple[str, Faults, Sending], ClosedLoop] = {}


@pytest.fixture
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is read as a document, found of one, and of one loop, is found once."""

    def document(examination: Examination, file: str, net: Net, answers: Answers, timeout_ms: int) -> list[ShownRecord]:
        key = examination.text(file), net_digest(net)
        if key not in _KNOWN:
            try:
                _KNOWN[key] = checked_document(examination, file, net, answers, timeout_ms)
            except NotShownError as error:
                _KNOWN[key] = error
        if isinstance(found := _KNOWN[key], NotShownError):
            raise found
        return found

    def loop(net: Net, model: PlantModel, faults: Faults, sending: Sending) -> ClosedLoop:
        key = model.model_dump_json(), faults, sending
        if key not in _CLOSED:
            _CLOSED[key] = close(net, model, faults, sending)
        return _CLOSED[key]

    monkeypatch.setattr(documents, "document_from_text", read)
    monkeypatch.setattr(machines, "checked_document", document)
    monkeypatch.setattr(machines, "close", loop)


@pytest.fixture
def unchanged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop itself is not changed, and need not be compared with the plant file again."""
    monkeypatch.setattr(machines, "compare", lambda *_: 0)


def refused(bundle: Bundle) -> bool:
    """Whether what is said of the machines is refused, or something about them is left to nobody."""
    try:
        examination = Examination(bundle)
        check_machines(examination, Cut(bundle.net), answered, TIMEOUT_MS)
    except NotShownError:
        return True
    theirs = {verdict.name for verdict in bundle.verdicts if verdict.name.startswith(PREFIXES)}
    others = theirs - set(examination.checked)
    unused = FILES & set(bundle.evidence) - examination.used
    return bool(others or unused) or not all(one.shown for one in examination.checked.values())


def resealed(bundle: Bundle, text: str) -> Bundle:
    """The bundle with another plant, which its verdicts name."""
    method = f"closed loop with the machines of the plant {sha256(text.encode()).hexdigest()}"
    verdicts = tuple(replace(v, method=method) if v.name.startswith(PREFIXES) else v for v in bundle.verdicts)
    return replace(bundle, verdicts=verdicts, evidence={**bundle.evidence, PLANT: text})


@pytest.mark.usefixtures("remembering")
def test_a_bundle_with_its_machines_is_shown() -> None:
    bundle = bundled()
    checked = {one.verdict.name: one for one in check_bundle(bundle)}
    names = [name for name in checked if name.startswith(PREFIXES)]
    assert [name for name in names if name.startswith("o4.")][-2:] == ["o4.completions", "o4.commands"]
    assert [name for name in names if name.startswith("loop.")][:3] == [
        *("loop.busy-machines", "loop.accidents", "loop.completions")
    ]
    for machine in ("R", "MC", "CV1", "CV2"):
        still, places = checked[f"fault.{machine}"].verdict, checked[f"fault.{machine}.places"].verdict
        assert still.status is places.status is Status.VIOLATED
        assert set(still.subjects) == {transition.name for transition in bundle.net.transitions}
        assert set(places.subjects) < {place.name for place in bundle.net.places}
        assert checked[f"fault.{machine}.repaired"].verdict.holds
    assert all(checked[name].shown for name in names)
    assert all("closed anew with plant.yaml" in checked[name].method for name in names)


HELD_BY_A_COMPLETION = """\
firable: 1
cell: held
controllers:
  sys: {coordinator: true, start: s, places: {s: , u: }}
  robot:
    start: free
    inputs: [entry, holds]
    places:
      free:
      grasp:   {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped}
      to_exit: {send: {machine: R, command: MOVE,  to: EXIT},  until: there}
      put:     {send: {machine: R, command: PUT,   at: EXIT},   until: placed}
      back:    {send: {machine: R, command: MOVE,  to: ENTRY}, until: there}
transitions:
  come: {from: [robot.free, sys.s], to: [robot.grasp, sys.u], if: robot.entry}
  t1:   {from: robot.grasp, to: robot.to_exit}
  t2:   {from: robot.to_exit, to: robot.put}
  stay: {from: [robot.put, sys.u], to: [robot.back, sys.s], if: robot.holds}
  t3:   {from: [robot.put, sys.u], to: [robot.back, sys.s], unless: robot.holds}
  t4:   {from: robot.back, to: robot.free}
arbiters:
  which: {among: [t3, stay], by: priority}
"""


@pytest.mark.usefixtures("remembering")
def test_a_gate_that_closes_while_the_completion_of_its_part_is_still_to_come_closes_for_no_vote() -> None:
    """The hand is empty when the robot is done with laying down, and nobody votes before it is."""
    net = parse_net(HELD_BY_A_COMPLETION)
    verdicts = {one.name: one for one in held_gates(split(net), parse_plant(together_cell.PLANT)).verdicts}
    assert verdicts["o4.stay/robot.holds"].holds
    bundle = make_bundle(check(net), plant=together_cell.PLANT)
    assert not refused(bundle)
    assert {"o4.stay/robot.holds", "o4.t3/robot.holds"} < {one.name for one in bundle.verdicts}
    at_any_time = parse_net(HELD_BY_A_COMPLETION.replace(",   until: placed", ""))
    verdicts = {one.name: one for one in held_gates(split(at_any_time), parse_plant(together_cell.PLANT)).verdicts}
    assert verdicts["o4.stay/robot.holds"].status is Status.VIOLATED, "without it they do"


@pytest.mark.usefixtures("remembering")
def test_a_bundle_of_a_cell_with_a_camera_is_shown_and_one_with_another_camera_is_not() -> None:
    text = inspected_cell.PLANT
    bundle = make_bundle(check(inspected_cell.net()), plant=text)
    assert not refused(bundle)
    holds = {one.name: one.holds for one in bundle.verdicts if one.name.startswith(PREFIXES)}
    assert [name for name, held in holds.items() if not held] == ["fault.R", "fault.R.places"]
    assert {"o4.accept/camera.ok", "o4.reject/camera.nok", "loop.property.rests"} < holds.keys()
    for old, new in (
        ("{fails: table}", "{occupied: table}"),
        ("{fails: table}", "{passes: table}"),
        ("{fails: table}", "{fails: bench}"),
    ):
        assert refused(resealed(bundle, text.replace(old, new))), new
    # How likely what is found is a matter of simulation alone.
    assert not refused(resealed(bundle, text.replace("likely: 0.6", "likely: 0.7")))


JOINING = """\
firable: 1
cell: joining
controllers:
  sys: {coordinator: true, start: u, places: {s: , u: , v: }}
  r:
    start: free
    inputs: [entry, here, there]
    places:
      free:
      brings: {send: {machine: A, command: BRING}, until: brought}
      opens:  {send: {machine: B, command: OPEN},  until: opened}
      takes:  {send: {machine: A, command: TAKE},  until: taken}
transitions:
  begin: {from: [r.free, sys.u], to: [r.brings, r.opens, sys.s], if: r.entry}
  join: {from: [r.brings, r.opens, sys.s], to: [r.takes, sys.v], if: r.here, unless: r.there}
  end: {from: [r.takes, sys.v], to: [r.free, sys.u]}
"""
ITS_MACHINES = """\
firable_plant: 1
plant: joining
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 8}
departures: {station: exit, after_s: 1}
machines:
  A:
    commands:
      BRING: {does: carry, from: entry, to: table, takes_s: 1}
      TAKE:  {does: carry, from: table, to: exit, takes_s: 1}
  B: {commands: {OPEN: {does: work, takes_s: 1}}}
sensors:
  r.entry: {occupied: entry}
  r.here:  {occupied: table}
  r.there: {occupied: exit}
"""


@pytest.mark.usefixtures("remembering")
def test_gates_of_a_part_that_awaits_two_completions_are_asked_as_the_prover_asks_them() -> None:
    """Of a gate is asked where both completions are there, of a completion whatever the other one is."""
    bundle = make_bundle(check(parse_net(JOINING)), plant=ITS_MACHINES)
    asked = [verdict.name for verdict in bundle.verdicts if verdict.name.startswith("o4.")]
    assert asked == ["o4.begin/r.entry", "o4.join/r.here", "o4.join/r.there", "o4.completions", "o4.commands"]
    assert not refused(bundle)


GATED = """\
firable: 1
cell: joining
controllers:
  sys: {coordinator: true, start: u, places: {s: , u: , v: , w: }}
  r:
    start: [free, ready]
    inputs: [entry, here, there]
    places:
      free:
      ready:
      busy:
      brings: {send: {machine: A, command: BRING}, until: brought, within: 5s}
      brings_fault: {send: {machine: A, command: STOP}}
      opens:  {send: {machine: B, command: OPEN},  until: opened}
      takes:  {send: {machine: A, command: TAKE},  until: taken}
transitions:
  begin: {from: [r.free, sys.u], to: [r.brings, r.opens, sys.s], if: [r.entry, r.ready], unless: r.busy}
  join: {from: [r.brings, r.opens, sys.s], to: [r.takes, sys.v], if: r.here, unless: r.there}
  again: {from: [r.brings_fault, r.opens, sys.s], to: [r.free, sys.u]}
  look:
    {from: [r.ready, sys.v], to: [r.busy, sys.w], if: [r.here, r.takes, r.taken], unless: [r.opened, r.brings_overdue]}
  turn: {from: [r.busy, sys.w], to: [r.ready, sys.v]}
  end: {from: [r.takes, sys.v], to: [r.free, sys.u]}
"""


def test_gates_that_want_no_completion_and_no_timer_are_asked_as_the_prover_asks_them() -> None:
    """The documents are on the very questions; that one of them is violated is told only after that."""
    net, plant = parse_net(GATED), ITS_MACHINES.replace("  B: {", "      STOP:  {does: stop}\n  B: {")
    verdicts, files, _ = sealed_loops(split(net), plant, Limits)
    asked = [(one.name, one.status) for one in verdicts if one.name.startswith("o4.")]
    assert [name for name, _ in asked] == [
        *("o4.begin/r.entry", "o4.join/r.here", "o4.join/r.there", "o4.look/r.here"),
        *("o4.look/r.opened", "o4.look/r.brings_overdue", "o4.completions", "o4.commands"),
    ]
    assert asked[0][1] is Status.VIOLATED, "of the bundle this would be the second thing that is wrong"
    with pytest.raises(NotShownError, match=r"the verdict on 'o4\.begin/r\.entry' is not what its proof shows"):
        check_machines(Examination(Bundle(split(net), verdicts, files)), Cut(net), answered, TIMEOUT_MS)


@pytest.mark.usefixtures("remembering", "unchanged")
def test_a_document_that_says_something_of_the_loop_that_is_not_asked_is_refused() -> None:
    bundle = make_bundle(check(parse_net(JOINING)), plant=ITS_MACHINES)
    document = document_from_text(bundle.evidence[LOOP])
    for name in ("deadlock-free", "property.loop.more", ""):
        more = replace(document, records=(*document.records, Record(name, True, (), "no time")))
        examination = Examination(replace(bundle, evidence={**bundle.evidence, LOOP: more.to_text()}))
        with pytest.raises(NotShownError, match=f"'loop.evidence.json' speaks of '{name}' as no bundle does"):
            check_machines(examination, Cut(bundle.net), answered, TIMEOUT_MS)


@pytest.mark.usefixtures("remembering", "unchanged")
@pytest.mark.parametrize(
    ("file", "record", "verdict"),
    [
        (O4, "o4.completion.1", "o4.completions"),
        (O4, "o4.join/r.there", "o4.join/r.there"),
        (LOOP, "loop.gate.0", "loop.gates-open"),
        (LOOP, "loop.live.2", "loop.live"),
    ],
)
def test_a_verdict_is_not_proved_by_a_document_that_leaves_one_of_its_questions_out(
    file: str, record: str, verdict: str
) -> None:
    bundle = make_bundle(check(parse_net(JOINING)), plant=ITS_MACHINES)
    document = document_from_text(bundle.evidence[file])
    records = tuple(one for one in document.records if one.name != f"property.{record}")
    assert len(records) == len(document.records) - 1
    fewer = replace(bundle, evidence={**bundle.evidence, file: replace(document, records=records).to_text()})
    with pytest.raises(NotShownError, match=f"the verdict on '{verdict}' is not what its proof shows"):
        check_machines(Examination(fewer), Cut(bundle.net), answered, TIMEOUT_MS)


@pytest.mark.usefixtures("remembering", "unchanged")
@pytest.mark.parametrize(
    ("left", "status", "said"),
    [
        ([], Status.UNKNOWN, "undecided: the bundle itself does not say"),
        ([Record("property.loop.live.2", True, (), "no time")], Status.PROVED, "only claimed: no time"),
    ],
)
def test_a_verdict_of_which_a_question_is_open_or_without_evidence_names_none_and_is_only_claimed(
    left: list[Record], status: Status, said: str
) -> None:
    bundle = make_bundle(check(parse_net(JOINING)), plant=ITS_MACHINES)
    document = document_from_text(bundle.evidence[LOOP])
    records = [r for one in document.records for r in (left if one.name == "property.loop.live.2" else [one])]
    evidence = {**bundle.evidence, LOOP: replace(document, records=tuple(records)).to_text()}

    def judged(**told: Any) -> Examination:
        verdicts = tuple(replace(v, **told) if v.name == "loop.live" else v for v in bundle.verdicts)
        examination = Examination(replace(bundle, verdicts=verdicts, evidence=evidence))
        check_machines(examination, Cut(bundle.net), answered, TIMEOUT_MS)
        return examination

    bound = machines.UNDECIDED if status is Status.UNKNOWN else ""
    checked = judged(status=status, bound=bound, evidence=()).checked
    assert [(name, one.only_claimed) for name, one in checked.items() if not one.shown] == [("loop.live", said)]
    for wrong in (
        {"status": status, "bound": bound},
        {"status": status, "bound": "all is well", "evidence": ()},
        {"status": Status.VIOLATED, "evidence": ()},
    ):
        with pytest.raises(NotShownError, match=r"the verdict on 'loop\.live' is not what its proof shows"):
            judged(**wrong)


WARNED = """\
firable: 1
cell: warned
controllers:
  a:
    start: free
    places:
      free:
      go:       {send: {machine: A, command: GO}, until: there, within: 1s}
      go_fault: {send: {machine: A, command: STOP}}
  b: {start: calm, places: {calm: , alarm: }}
transitions:
  start: {from: a.free, to: a.go}
  end: {from: a.go, to: a.free}
  again: {from: a.go_fault, to: a.free}
  warn: {from: b.calm, to: b.alarm, if: a.go_overdue}
  quit: {from: b.alarm, to: b.calm}
"""
ITS_MACHINE = """\
firable_plant: 1
plant: warned
stations: [entry]
arrivals:   {station: entry, every_s: 1}
departures: {station: entry}
machines:
  A: {commands: {GO: {does: work, takes_s: 1}, STOP: {does: stop}}}
"""


def test_nothing_is_asked_of_a_timer_that_a_promise_keeps() -> None:
    bundle = make_bundle(check(parse_net(WARNED)), plant=ITS_MACHINE)
    assert [v.name for v in bundle.verdicts if v.name.startswith("o4.")] == ["o4.completions", "o4.commands"]
    assert all(one.shown for one in check_bundle(bundle))


@pytest.mark.seeds
@pytest.mark.usefixtures("remembering", "unchanged")
def test_every_single_change_of_a_verdict_on_the_machines_is_refused() -> None:
    bundle = bundled()
    assert not refused(bundle)
    mutants = [
        (how, make) for how, make in verdict_mutants(bundle) if how.removeprefix("verdict ").startswith(PREFIXES)
    ]
    assert len(mutants) > 300
    for how, make in some(mutants, 6):
        try:
            mutant = make()
        except (InputError, ValueError):
            continue
        assert refused(mutant), how


@pytest.mark.seeds
@pytest.mark.usefixtures("remembering", "unchanged")
def test_evidence_on_the_machines_that_is_missing_or_exchanged_is_refused() -> None:
    others = {f"{one} is {other}" for one in FILES for other in set(bundled().evidence) - FILES}
    mutants = [
        (how, make) for how, make in evidence_mutants(bundled()) if how.startswith(tuple(FILES)) and how not in others
    ]
    assert len(mutants) > 18
    for how, make in some(mutants, 1):
        assert refused(make()), how


@pytest.mark.usefixtures("remembering", "unchanged")
def test_every_other_line_of_the_plant_is_refused() -> None:
    bundle, lines = bundled(), plant().splitlines(keepends=True)
    for i in range(len(lines)):
        text = "".join((*lines[:i], *lines[i + 1 :]))
        assert refused(replace(bundle, evidence={**bundle.evidence, PLANT: text})), lines[i]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}"),
        ("{occupied: cv1_entry}", "{occupied: cv1_entry, may_linger: true}"),
    ],
)
def test_the_document_on_other_machines_shows_nothing(old: str, new: str) -> None:
    text = plant().replace(old, new)
    assert text != plant()
    with pytest.raises(InputError, match=r"'o4\.evidence\.json' is about another net"):
        check_bundle(resealed(bundled(), text))
    with pytest.raises(InputError, match=r"(?s)F4003.*'o4\..*' is violated, not proved.*--machines PLANT` shows"):
        make_bundle(check(catalogue_net("one_robot")), plant=text)


def test_a_loop_that_is_not_what_the_plant_file_says_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mistake that prover and checker share, since one text closes the loop for both."""
    monkeypatch.setattr(Laws, "spoiled", lambda *_: iter(()))
    with pytest.raises(
        InputError, match=r"the loop with 'plant\.yaml' is not what that says: .* as the plant file says"
    ):
        check_bundle(bundled())


def test_a_loop_too_large_to_be_compared_is_no_mistake_of_the_bundle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(same_loop, "STATES_MAX", 10)
    with pytest.raises(
        InputError, match=r"it cannot be seen here whether the loop with 'plant\.yaml' is what that says"
    ):
        check_bundle(bundled())


def test_no_bundle_is_made_of_a_loop_too_large_to_be_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(same_loop, "STATES_MAX", 10)
    monkeypatch.setattr(closed_loops, "held_gates", None)  # nothing is explored before
    with pytest.raises(InputError, match="'G2' looks at more things than are compared") as refusal:
        make_bundle(check(catalogue_net("one_robot")), plant=plant())
    (problem,) = refusal.value.diagnostics
    assert (problem.code, problem.subject) == ("F4003", ("transitions", "G2"))
    assert problem.hint.startswith("do less in one firing")


def test_the_machines_of_another_cell_are_refused() -> None:
    other = catalogue_path("two_robots_shared").with_name("two_robots_shared.plant.yaml").read_text("utf-8")
    with pytest.raises(InputError, match=r"'plant\.yaml' closes no loop with the net"):
        check_bundle(resealed(bundled(), other))


@pytest.mark.usefixtures("remembering", "unchanged")
def test_faults_are_asked_of_every_transition_that_is_not_shown_to_be_lost_without_them() -> None:
    """A loss that is claimed, and shown by nothing, would take the questions on faults away, which it is asked for."""
    bundle = bundled()
    loop = document_from_text(bundle.evidence[LOOP])
    records = [
        Record(record.name, False, (), "the time was over") if ".loop.live." in record.name else record
        for record in loop.records
    ]
    verdicts = [v for v in bundle.verdicts if not v.name.startswith("fault.") or v.name == "fault.safe"]
    every = tuple(t.name for t in bundle.net.transitions)
    verdicts = [
        replace(v, status=Status.VIOLATED, evidence=(), subjects=every) if v.name == "loop.live" else v
        for v in verdicts
    ]
    evidence = {file: text for file, text in bundle.evidence.items() if file != FAILING}
    evidence |= {LOOP: replace(loop, records=tuple(records)).to_text()}
    with pytest.raises(InputError, match=r"there is no verdict on 'fault\.R\.repaired'"):
        check_bundle(replace(bundle, verdicts=tuple(verdicts), evidence=evidence))


@pytest.mark.usefixtures("remembering", "unchanged")
def test_what_rests_on_a_loss_that_could_not_be_checked_in_time_is_only_claimed() -> None:
    net = parse_net(STARTS)
    decomposition = split(net)
    verdicts, files, _ = sealed_loops(decomposition, BENCH, Limits)
    assert [v.subjects for v in verdicts if v.name == "loop.live"] == [("warm",)]
    cut, examination = Cut(net), Examination(Bundle(decomposition, verdicts, files))
    check_machines(examination, cut, answered, TIMEOUT_MS)
    assert all(one.shown for one in examination.checked.values())
    key = files[LOOP], net_digest(document_from_text(files[LOOP]).net)
    found = _KNOWN[key]
    assert not isinstance(found, NotShownError)
    _KNOWN[key] = [
        one if one.record.proved else replace(one, shown=False, only_claimed="the time was over") for one in found
    ]
    examination = Examination(examination.bundle)
    check_machines(examination, cut, answered, TIMEOUT_MS)
    assert examination.checked["fault.safe"].shown, "no accident happens, whatever is live"
    of_faults = [one for name, one in examination.checked.items() if name.startswith("fault.R")]
    assert {one.only_claimed for one in of_faults} == {"it rests on 'loop.live', which is not shown"}
    assert examination.checked["loop.live"].only_claimed == "the time was over"
    _KNOWN[key] = found


@pytest.mark.usefixtures("unchanged")
def test_what_a_fault_takes_of_what_is_not_shown_to_be_live_is_only_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What fires once does not fire again with a machine that has failed, and the fault is not to blame."""
    found = Answered.document

    def document(asked: Answered, limits: Limits | None = None) -> Document:
        whole = found(asked, limits)
        return replace(whole, records=tuple(one for one in whole.records if one.name != "property.loop.live.0"))

    monkeypatch.setattr(Answered, "document", document)
    net, plant = parse_net(STARTS), BENCH.replace("may_fail: repairable", "may_fail: for_good")
    decomposition = split(net)
    verdicts, files, _ = sealed_loops(decomposition, plant, Limits)
    examination = Examination(Bundle(decomposition, verdicts, files))
    check_machines(examination, Cut(net), answered, TIMEOUT_MS)
    checked = examination.checked
    assert checked["loop.live"].only_claimed == "undecided: the bundle itself does not say"
    assert checked["fault.R"].verdict.subjects == ("warm", "go", "stay")
    assert checked["fault.R"].only_claimed == "it rests on 'loop.live', which is not shown"
    assert checked["fault.safe"].shown


def test_a_plant_that_no_verdict_names_is_refused() -> None:
    bundle = bundled()
    verdicts = tuple(verdict for verdict in bundle.verdicts if not verdict.name.startswith(PREFIXES))
    for file in (PLANT, O4, LOOP):
        evidence = {name: text for name, text in bundle.evidence.items() if name not in FILES - {file}}
        with pytest.raises(InputError, match="F6002"):
            check_bundle(replace(bundle, verdicts=verdicts, evidence=evidence))
