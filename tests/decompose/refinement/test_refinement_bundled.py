"""A refinement in a bundle: it is shown from the bundle alone, and nothing else is taken for it."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.bundle_mutants import evidence_mutants, line_mutants, net_mutants, verdict_mutants
from support.examples import examples, some
from support.random_tasks import nested, random_conceptual, random_task
from support.remembered import UNORDERED, Answers, examined, read

from firable.analysis import branching_bisimilar, explore, report_on
from firable.analysis.check import check
from firable.decompose.bundling import make_bundle
from firable.decompose.refinement import sealing
from firable.decompose.refinement.binding import bindings
from firable.decompose.refinement.closed import BlockProof, closed, prove_block
from firable.decompose.refinement.evidence import conditions
from firable.decompose.refinement.ledger import task_problems
from firable.decompose.refinement.naming import named
from firable.decompose.refinement.opening import open_tasks
from firable.decompose.refinement.refining import refine
from firable.decompose.refinement.sealing import Origin, sealed
from firable.decompose.verification import documents, refinement
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.closed_tasks import ClosedTask
from firable.decompose.verification.documents import ShownRecord
from firable.decompose.verification.naming_anew import Named
from firable.decompose.verification.opening import Opening
from firable.decompose.verification.refinement import (
    CONCEPTUAL,
    DOCUMENT,
    OBLIGATIONS,
    PREFIX,
    TASKS,
    check_refinement,
    of_task,
)
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.relating import Relation
from firable.decompose.verification.solvers import by_cvc5, by_z3
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, catalogue_tasks
from firable.nets.diagnostics import InputError
from firable.nets.interchange import canonical_json, net_to_json
from firable.nets.net import Net
from firable.nets.tasks.model import Catalogue, Task
from firable.nets.tasks.printing import format_tasks
from firable.nets.tasks.text import parse_tasks
from firable.nets.text import parse_net
from firable.nets.verdict import Status

TIMEOUT_MS = 10_000
CELLS = ("conceptual_one_robot", "conceptual_two_robots", "conceptual_two_robots_shared")

NET = """\
firable: 1
cell: lending
controllers:
  system:
    coordinator: true
    start: [a, b]
    places:
      one:  {task: {name: work, robot: a, store: b}}
      wait: {description: work is done}
      a:    {opens: {to: x.a, machine: A}}
      b:    {opens: {to: y.b, machine: B}}
  x:
  y:
transitions:
  t1: {from: system.a, if: system.b, unless: system.wait, to: system.one}
  t2: {from: system.one, to: [system.wait, system.a]}
  t3: {from: system.wait, unless: system.one}
"""
WORK = """\
firable_tasks: 1
tasks:
  fetch:
    roles:
      arm:   {steps: {reach: {send: {machine: "{arm.machine}", command: REACH}, until: "{arm}_there"}, lift: }}
      shelf: {steps: {open: }}
    moves: {m: {from: [arm.reach, shelf.open], to: arm.lift, release: shelf}}
  work:
    roles: {robot: {steps: {home: }}, store: }
    subtasks: {fetching: {task: {name: fetch, arm: robot, shelf: store}}}
    start: {to: fetching, release: store}
    moves: {n: {from: fetching, to: robot.home}}
"""
"""A task that lends a resource, and has another one give it back."""


def lending() -> tuple[Net, Catalogue]:
    return parse_net(NET), parse_tasks(WORK)


@cache
def bundled() -> Bundle:
    net, tasks = lending()
    return make_bundle(check(refine(net, tasks, "made").net), origin=Origin.of(net, tasks))


@cache
def of_the_cell() -> Bundle:
    net, tasks = catalogue_net("conceptual_one_robot"), catalogue_tasks()
    return make_bundle(check(catalogue_net("one_robot")), origin=Origin.of(net, tasks))


@pytest.fixture
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """A document is read once, what the checker says of it is found once, and the solver is not asked again."""
    monkeypatch.setattr(documents, "document_from_text", read)
    monkeypatch.setattr(documents, "check_document", examined)
    monkeypatch.setattr(documents, "obligations", lambda *_, **__: ())


def refused(bundle: Bundle) -> bool:
    """Whether what is said of the refinement is refused, or something about it is left to nobody."""
    try:
        examination = Examination(bundle)
        check_refinement(examination, "cvc5", by_cvc5, TIMEOUT_MS)
    except NotShownError:
        return True
    others = {verdict.name for verdict in bundle.verdicts if verdict.name.startswith(PREFIX)} - set(examination.checked)
    files = {CONCEPTUAL, TASKS, DOCUMENT, OBLIGATIONS, *(name for name in bundle.evidence if ".task." in name)}
    unused = files & set(bundle.evidence) - examination.used
    return bool(others or unused) or not all(one.shown for one in examination.checked.values())


def with_file(bundle: Bundle, name: str, text: str) -> Bundle:
    return replace(bundle, evidence={**bundle.evidence, name: text})


def refuted(named_anew: Named, detailed: Net) -> list[str]:
    """The obligations on two nets that do not hold."""
    relation = Relation(named_anew, detailed)
    said = by_z3(relation.text, TIMEOUT_MS)
    return [name for (name, _), answer in zip(relation.obligations, said[1::2], strict=True) if answer != "unsat"]


# --------------------------------------------------------------------------------------------------------------------
# What is shown


@pytest.mark.parametrize("name", CELLS)
def test_the_cells_are_opened_anew_to_the_very_nets_that_refine_makes(name: str) -> None:
    net, tasks = catalogue_net(name), catalogue_tasks()
    anew = Named(Opening(net, tasks))
    detailed = refine(net, tasks).net
    assert list(anew.differences(detailed)) == []
    assert refuted(anew, detailed) == []


def test_the_published_cell_is_shown_to_be_made_of_the_conceptual_one() -> None:
    checked = [one for one in check_bundle(of_the_cell()) if one.verdict.name.startswith(PREFIX)]
    assert all(one.shown for one in checked)
    names = {one.verdict.name.removeprefix(PREFIX) for one in checked}
    assert names >= {"opened", "follows", "bisimilar", "task.load.ends-clean", "conceptual.contact-free"}
    assert names >= {f"carried.{name}" for name in ("contact-free", "deadlock-free", "live", "effective-conflicts")}


def test_tasks_within_tasks_and_lent_resources_are_shown() -> None:
    checked = {one.verdict.name: one for one in check_bundle(bundled())}
    mine = [one for name, one in checked.items() if name.startswith(PREFIX)]
    assert all(one.shown for one in mine)
    assert "with explicit divergence" in checked["refinement.bisimilar"].verdict.statement
    assert "refinement.task.fetch.ends" in checked
    assert "refinement.carried.effective-conflicts" not in checked  # what is lent is competed for
    assert checked["refinement.conceptual.effective-conflicts"].verdict.holds


@examples(10)
@given(st.randoms(use_true_random=False))
def test_what_refine_makes_of_random_tasks_is_made_anew_and_related(draw: random.Random) -> None:
    tasks: dict[str, Task] = {}
    for i in range(4):
        task = nested(draw, random_task(draw, f"task{i}"), tasks)
        if not list(task_problems(task, tasks)) and prove_block(task).sound:
            tasks[task.name] = task
    assume(tasks)
    net = random_conceptual(draw, tasks)
    assume(any(place.task for place in net.places))
    anew, made = Named(Opening(net, tasks)), refine(net, tasks)
    assert list(anew.differences(made.net)) == []
    assert parse_tasks(format_tasks(tasks.values())) == tasks
    for block in made.blocks:
        assert ClosedTask(block.task).net == replace(block.net, properties=tuple(conditions(block.task, block.net)))
    if report_on(explore(net)).verdict("contact-free").holds:
        assert refuted(anew, made.net) == []


# --------------------------------------------------------------------------------------------------------------------
# What is not


def test_every_single_change_of_the_net_is_seen() -> None:
    net, tasks = lending()
    anew, detailed = Named(Opening(net, tasks)), refine(net, tasks).net
    assert not list(anew.differences(detailed))
    told = ("moved", "order", "another name", "properties", "doubled")
    count = 0
    for how, make in net_mutants(detailed):
        try:
            mutant = make()
        except (InputError, ValueError):
            continue
        if not any(word in how for word in told):
            count += 1
            assert list(anew.differences(mutant)), how
    assert count > 300


def arc_mutants(net: Net) -> Iterator[tuple[str, Net]]:
    for how, make in net_mutants(net):
        if how.startswith("transitions ") and " with or without " in how:
            try:
                yield how, make()
            except (InputError, ValueError):
                continue


def alike(net: Net, detailed: Net, anew: Named) -> bool:
    """Whether exploring says that both nets are bisimilar, and that the detailed one has no contact."""
    names = {t.name: anew.transitions[t.name] for t in net.transitions}
    graphs = explore(net), explore(detailed)
    visible = {name: name for name in names.values()}
    return branching_bisimilar(*graphs, names, visible, divergence=True) and not any(graphs[1].contacts())


def test_no_wrong_arc_is_related_but_where_exploring_finds_no_difference() -> None:
    net, tasks = lending()
    anew, detailed = Named(Opening(net, tasks)), refine(net, tasks).net
    assert alike(net, detailed, anew)
    held, wrong, kinds = 0, 0, set[str]()
    for how, mutant in arc_mutants(detailed):
        if found := refuted(anew, mutant):
            wrong += 1
            kinds |= {name.partition(".")[0] for name in found}
        else:
            held += 1
            assert alike(net, mutant, anew), how
    assert wrong > 2 * held
    assert kinds == {"follows", "fires", "hidden", "contact"}
    marked = replace(detailed, places=(replace(detailed.places[0], marked=True), *detailed.places[1:]))
    assert "starts" in refuted(anew, marked)


def spoilt(draw: random.Random, net: Net) -> Net:
    """A conceptual net with an arc or gate more or less, so that resources no longer add up."""
    t = draw.choice(net.transitions)
    kind = draw.choice(["inputs", "outputs", "permissive", "inhibitive"])
    place = draw.choice(net.places).name
    there = getattr(t, kind)
    now = tuple(one for one in there if one != place) if place in there else (*there, place)
    changes: dict[str, Any] = {kind: now}
    changed = replace(t, **changes)
    return replace(net, transitions=tuple(changed if one is t else one for one in net.transitions))


def opened_without_asking(draw: random.Random) -> tuple[Net, Net, Named, list[BlockProof]] | None:
    """A spoilt net with its tasks opened, whatever `refine` would say of it; None where there is nothing to open."""
    tasks = {name: random_task(draw, name) for name in ("task0", "task1")}
    proofs = {name: prove_block(task) for name, task in tasks.items() if not list(task_problems(task, tasks))}
    tasks = {name: proofs[name].task for name in proofs}
    try:
        net = spoilt(draw, random_conceptual(draw, tasks))
        detailed = named(net, open_tasks(net, bindings(net, tasks), tasks)).net
        anew = Named(Opening(net, tasks))
    except (InputError, NotShownError, IndexError):
        return None
    used = {block.task.name for block in anew.opening.blocks}
    return net, detailed, anew, [proof for name, proof in proofs.items() if name in used]


def test_whatever_is_related_is_bisimilar_though_refine_would_refuse_it() -> None:
    related, wrong = 0, 0
    for seed in range(120):
        made = opened_without_asking(random.Random(seed))
        if made is None:
            continue
        net, detailed, anew, proofs = made
        assert list(anew.differences(detailed)) == []
        ends = all(v.holds for proof in proofs for v in proof.verdicts if v.name.endswith(".ends"))
        if not ends or not report_on(explore(net)).verdict("contact-free").holds:
            continue
        try:
            found = refuted(anew, detailed)
        except NotShownError:
            continue
        related, wrong = related + (not found), wrong + bool(found)
        if not found:
            names = {t.name: anew.transitions[t.name] for t in net.transitions}
            visible, settles = {name: name for name in names.values()}, all(proof.settles for proof in proofs)
            graphs = explore(net), explore(detailed)
            assert branching_bisimilar(*graphs, names, visible, divergence=settles), seed
    assert related > 8
    assert wrong > 5


LOOPING = """\
firable: 1
cell: looping
controllers:
  system:
    coordinator: true
    start: [a, b, p]
    places:
      one: {task: {name: fetch, arm: a, shelf: b}}
      a:   {opens: {to: x.a, machine: A}}
      b:   {opens: {to: y.b, machine: B}}
      p:
      q:
      r:
      s:
  x:
  y:
transitions:
  t1: {from: [system.a, system.b, system.p], to: [system.one, system.r]}
  t2: {from: system.one, to: system.a}
  t3: {from: system.p, to: system.q}
  t4: {from: system.q, to: system.p}
  t5: {from: system.r, to: system.s}
  t6: {from: system.s, to: system.r}
"""


def test_a_transition_that_frees_what_it_takes_is_not_opened_to_one_that_can_fire(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It never fires, while opened it takes the shelf and a move of the task frees it; that is no contact of either."""
    net, tasks = parse_net(LOOPING), {"fetch": parse_tasks(WORK)["fetch"]}
    t1 = net.transition("t1")
    net = replace(net, transitions=(replace(t1, outputs=(*t1.outputs, "system.b")), *net.transitions[1:]))
    detailed = named(net, open_tasks(net, bindings(net, tasks), tasks)).net
    assert refuted(Named(Opening(net, tasks)), detailed) == ["follows.G1"]
    monkeypatch.setattr(sealing, "by_z3", lambda text, _: ("", "unsat") * text.count("(check-sat)"))
    bundle = make_bundle(check(detailed), origin=Origin(net, tasks, (prove_block(tasks["fetch"]),)))
    by_name = {verdict.name: verdict for verdict in bundle.verdicts}
    assert by_name["refinement.carried.reversible"].holds
    assert not by_name["reversible"].holds
    with pytest.raises(InputError, match=r"F6002.*'follows\.G1' of 'refinement\.smt2' is refuted"):
        check_bundle(bundle)


def judged(change: Callable[[Answers], Answers]) -> Examination:
    """The bundle checked with other answers to its obligations."""

    def answers(text: str, timeout_ms: int) -> tuple[str, ...]:
        said = by_cvc5(text, timeout_ms)
        return change(said) if text == bundled().evidence[OBLIGATIONS] else said

    examination = Examination(bundled())
    check_refinement(examination, "cvc5", answers, TIMEOUT_MS)
    return examination


@pytest.mark.usefixtures("remembering")
def test_an_obligation_that_the_solver_refutes_is_refused_and_one_that_it_gives_up_leaves_what_rests_on_it_open() -> (
    None
):
    assert all(one.shown for one in judged(lambda said: said).checked.values())
    with pytest.raises(NotShownError, match=r"'contact\..*' of 'refinement\.smt2' is refuted: the solver says sat"):
        judged(
            lambda said: tuple("sat" if before.startswith("contact.") else one for before, one in pairwise(("", *said)))
        )
    open_ = {name: one for name, one in judged(lambda said: (*said[:-1], "unknown")).checked.items() if not one.shown}
    resting = ("follows", "bisimilar", "carried.")
    every = (verdict.name for verdict in bundled().verdicts if verdict.name.startswith(PREFIX))
    assert set(open_) == {name for name in every if name.removeprefix(PREFIX).startswith(resting)}
    assert {one.only_claimed for one in open_.values()} == {"cvc5 gave up"}


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize(
    ("file", "verdict"), [(of_task("fetch"), "task.fetch.ends-clean"), (DOCUMENT, "conceptual.reversible")]
)
def test_what_rests_on_a_document_that_was_not_checked_in_time_is_only_claimed(
    file: str, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def late(examination: Examination, of: str, *others: Any) -> list[ShownRecord]:
        named = verdict.rpartition(".")[2] if of == file else "nothing"
        return [
            replace(one, shown=False, only_claimed="the time was over") if one.record.name.endswith(named) else one
            for one in documents.checked_document(examination, of, *others)
        ]

    monkeypatch.setattr(refinement, "checked_document", late)
    open_ = {name: one for name, one in judged(lambda said: said).checked.items() if not one.shown}
    resting = ("follows", "bisimilar", "carried.")
    every = [v.name for v in bundled().verdicts if v.name.removeprefix(PREFIX).startswith(resting)]
    assert set(open_) == {f"{PREFIX}{verdict}", *every}
    assert {one.only_claimed for one in open_.values()} == {"the time was over"}


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("change", UNORDERED)
def test_answers_that_are_not_to_one_obligation_after_the_other_show_no_refinement(
    change: Callable[[Answers], Answers],
) -> None:
    with pytest.raises(NotShownError, match=r"does not answer one obligation of 'refinement\.smt2' after the other"):
        judged(change)


@pytest.mark.seeds
@pytest.mark.usefixtures("remembering")
def test_every_single_change_of_a_verdict_on_the_refinement_is_refused() -> None:
    bundle = bundled()
    assert not refused(bundle)
    alike = ("task.fetch.", "task.work.c", "conceptual.live", "conceptual.home", "carried.live", "carried.home")
    others = [f"verdict {PREFIX}{name}" for name in alike]  # which are judged as their likes
    mutants = [
        (how, make)
        for how, make in verdict_mutants(bundle)
        if how.startswith(f"verdict {PREFIX}") and (": deleted" in how or not how.startswith((*others,)))
    ]
    assert len(mutants) > 200
    for how, make in some(mutants, 3):
        try:
            mutant = make()
        except (InputError, ValueError):
            continue
        assert refused(mutant), how


@pytest.mark.usefixtures("remembering")
def test_evidence_on_the_refinement_that_is_missing_or_exchanged_is_refused() -> None:
    files = (CONCEPTUAL, TASKS, DOCUMENT, OBLIGATIONS, of_task("fetch"), of_task("work"))
    mutants = [(how, make) for how, make in evidence_mutants(bundled()) if how.startswith(files)]
    assert len(mutants) > 60
    for how, make in mutants:
        assert refused(make()), how


@pytest.mark.usefixtures("remembering")
def test_every_change_of_a_line_of_the_tasks_or_of_the_obligations_is_refused() -> None:
    bundle = bundled()
    for file, step in ((TASKS, 1), (OBLIGATIONS, 25)):
        for how, text in [*line_mutants(bundle.evidence[file])][::step]:
            if text != bundle.evidence[file]:
                assert refused(with_file(bundle, file, text)), f"{file}: {how}"
    for line in bundle.evidence[TASKS].splitlines():
        other = line.replace("arm", "arn") if "arm" in line else f"{line}x"
        assert refused(with_file(bundle, TASKS, bundle.evidence[TASKS].replace(line, other)))


@pytest.mark.usefixtures("remembering")
def test_every_single_change_of_the_conceptual_net_is_refused() -> None:
    bundle, (net, _) = bundled(), lending()
    count = 0
    for how, make in net_mutants(net):
        try:
            text = canonical_json(net_to_json(make())).decode()
        except (InputError, ValueError):
            continue
        count += 1
        assert refused(with_file(bundle, CONCEPTUAL, text)), how
    assert count > 100


def task_mutants(tasks: Catalogue) -> Iterator[Catalogue]:
    """A word, an arc, a gate, a command or a release of a task changed, and the file still one of tasks."""
    text = format_tasks(tasks.values())
    for old, new in (
        ("reach", "stretch"), ("arm_there", "there"), ('release: ["shelf"]', 'release: []'),
        ('from: ["arm.reach", "shelf.open"]', 'from: ["arm.reach"]'), ('from: ["robot.home"]', 'from: ["fetching"]'),
        ('to: ["arm.reach", "shelf.open"]', 'to: ["arm.reach"]'), ('shelf: "store"', 'shelf: "robot"'),
        ('to: ["arm.lift"]', 'to: ["arm.lift"]\n        if: ["shelf.open"]'), ('"{arm}_there"', '"there"'),
        ('release: ["store"]', 'description: "keep it"'), ('place: "lift"', 'place: "lifted"'),
    ):  # fmt: skip
        if old in text:
            yield parse_tasks(text.replace(old, new))


def test_other_tasks_are_refused_though_everything_that_rests_on_them_is_stated_anew() -> None:
    bundle, (net, tasks) = bundled(), lending()
    found = list(task_mutants(tasks))
    assert len(found) > 6
    for other in found:
        try:
            text = Relation(Named(Opening(net, other)), bundle.net).text
        except (NotShownError, KeyError):
            text = ""
        changed = with_file(with_file(bundle, TASKS, format_tasks(other.values())), OBLIGATIONS, text)
        assert refused(changed), format_tasks(other.values())


def test_a_net_that_the_tasks_do_not_make_is_not_bundled_as_one() -> None:
    net, tasks = lending()
    detailed = refine(net, tasks).net
    place = next(p for p in detailed.places if p.name == "x.lift")
    other = replace(detailed, places=tuple(replace(p, description="!") if p is place else p for p in detailed.places))
    with pytest.raises(InputError, match=r"F4003.*the place 'x\.lift' is not as the tasks make it"):
        make_bundle(check(other), origin=Origin.of(net, tasks))


def test_nothing_is_carried_over_from_a_net_with_contact() -> None:
    net, tasks = catalogue_net("conceptual_one_robot"), catalogue_tasks()
    t6 = replace(net.transition("t6"), outputs=("system.cv2", "system.extra"))
    extra = replace(net.place("system.cv2"), name="system.extra", resource=None, marked=False)
    other = replace(net, places=(*net.places, extra), transitions=(*net.transitions[:-1], t6), properties=())
    made = refine(other, tasks).net
    with pytest.raises(InputError, match=r"(?s)F4003.*not known to be contact-free"):
        sealed(made, Origin.of(other, tasks), None, TIMEOUT_MS)


def test_the_bundle_of_a_net_may_say_nothing_of_where_it_comes_from() -> None:
    bundle = bundled()
    verdicts = tuple(verdict for verdict in bundle.verdicts if not verdict.name.startswith(PREFIX))
    files = {CONCEPTUAL, TASKS, DOCUMENT, OBLIGATIONS, of_task("fetch"), of_task("work")}
    evidence = {name: text for name, text in bundle.evidence.items() if name not in files}
    assert all(one.shown for one in check_bundle(replace(bundle, verdicts=verdicts, evidence=evidence)))
    with pytest.raises(InputError, match="F6002"):
        check_bundle(replace(bundle, verdicts=verdicts))


def test_properties_and_arbiters_of_the_conceptual_net_are_not_taken_along() -> None:
    bundle, net = of_the_cell(), catalogue_net("conceptual_one_robot")
    assert net.properties
    text = canonical_json(net_to_json(net)).decode()
    assert refused(with_file(bundle, CONCEPTUAL, text))
    assert {closed(task) == replace(ClosedTask(task).net, properties=()) for task in catalogue_tasks().values()} == {
        True
    }
    assert Status.PROVED in {verdict.status for verdict in bundle.verdicts}


def test_names_with_slashes_hide_nothing_of_a_task_from_the_checker() -> None:
    """The move `fetch/m` of a task and the move `m` of its subtask `fetch` are two."""
    net, tasks = lending()
    fetch, work = tasks["fetch"], tasks["work"]
    (first, *others) = work.moves
    (subtask,) = {one.name for one in work.subtasks if one.use.name == "fetch"}
    like = {**tasks, "work": replace(work, moves=(replace(first, name=f"{subtask}/m"), *others))}
    opened = Opening(net, like)
    outer, inner = opened.blocks
    assert {outer.inner(f"{subtask}/m"), inner.inner("m")} <= {*opened.moves}
    assert len(opened.moves) == len(net.transitions) + len(work.moves) + len(fetch.moves)
    assert outer.holds(outer.inner(f"{subtask}/m"))
    assert not inner.holds(outer.inner(f"{subtask}/m"))


@pytest.mark.parametrize("name", ["twice", "a\nb"])
def test_a_task_with_two_things_of_one_name_or_with_no_name_is_refused(name: str) -> None:
    net, tasks = lending()
    work = tasks["work"]
    again = (replace(work.moves[0], name=name),) * 2
    with pytest.raises(NotShownError, match="the task 'work' has two of"):
        Opening(net, {**tasks, "work": replace(work, moves=(*work.moves, *again))})
