"""O4 in a bundle: what shows that the machines keep what votes rely on, and that nothing else is taken for it."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from hashlib import sha256

import pytest
from support.bundle_mutants import evidence_mutants, verdict_mutants

from firable.analysis.check import check
from firable.analysis.evidence.checking.checker import CheckedRecord, check_document
from firable.analysis.evidence.document import Document
from firable.decompose.bundling import make_bundle
from firable.decompose.verification import documents, machines
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.machines import DOCUMENT, PLANT, PREFIX, check_machines
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import by_cvc5
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.machines.laws import Laws

TIMEOUT_MS = 10_000


def plant() -> str:
    return catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")


@cache
def bundled() -> Bundle:
    return make_bundle(check(catalogue_net("one_robot")), plant=plant())


@pytest.fixture
def remembering(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the checker says of one document is found once, and the solver is not asked again."""
    records: dict[str, tuple[CheckedRecord, ...]] = {}

    def checker(document: Document, timeout_ms: int) -> Iterator[CheckedRecord]:
        text = document.to_text()
        if text not in records:
            records[text] = tuple(check_document(document, timeout_ms=timeout_ms))
        return iter(records[text])

    monkeypatch.setattr(documents, "check_document", checker)
    monkeypatch.setattr(documents, "obligations", lambda *_: ())
    monkeypatch.setattr(machines, "compare", lambda *_: 0)  # of the loop itself, which is not changed here


def refused(bundle: Bundle) -> bool:
    """Whether what is said of the machines is refused, or something about them is left to nobody."""
    try:
        examination = Examination(bundle)
        check_machines(examination, Cut(bundle.net), by_cvc5, TIMEOUT_MS)
    except NotShownError:
        return True
    others = {verdict.name for verdict in bundle.verdicts if verdict.name.startswith(PREFIX)} - set(examination.checked)
    unused = {DOCUMENT, PLANT} & set(bundle.evidence) - examination.used
    return bool(others or unused) or not all(one.shown for one in examination.checked.values())


def resealed(bundle: Bundle, text: str) -> Bundle:
    """The bundle with another plant, which its verdicts name."""
    method = f"closed loop with the machines of the plant {sha256(text.encode()).hexdigest()}"
    verdicts = tuple(replace(v, method=method) if v.name.startswith(PREFIX) else v for v in bundle.verdicts)
    return replace(bundle, verdicts=verdicts, evidence={**bundle.evidence, PLANT: text})


def test_a_bundle_with_its_machines_is_shown() -> None:
    bundle = bundled()
    checked = {one.verdict.name: one for one in check_bundle(bundle)}
    names = [name for name in checked if name.startswith(PREFIX)]
    assert names[-2:] == ["o4.completions", "o4.commands"]
    assert len(names) > 3
    assert all(checked[name].shown for name in names)
    assert all("closed anew with plant.yaml" in checked[name].method for name in names)


@pytest.mark.usefixtures("remembering")
def test_every_single_change_of_a_verdict_on_the_machines_is_refused() -> None:
    bundle = bundled()
    assert not refused(bundle)
    mutants = [(how, make) for how, make in verdict_mutants(bundle) if how.startswith("verdict o4.")]
    assert len(mutants) > 40
    for how, make in mutants:
        try:
            mutant = make()
        except (InputError, ValueError):
            continue
        assert refused(mutant), how


@pytest.mark.usefixtures("remembering")
def test_evidence_on_the_machines_that_is_missing_or_exchanged_is_refused() -> None:
    mutants = [(how, make) for how, make in evidence_mutants(bundled()) if how.startswith((DOCUMENT, PLANT))]
    assert len(mutants) > 20
    for how, make in mutants:
        assert refused(make()), how


@pytest.mark.usefixtures("remembering")
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


def test_the_machines_of_another_cell_are_refused() -> None:
    other = catalogue_path("two_robots_shared").with_name("two_robots_shared.plant.yaml").read_text("utf-8")
    with pytest.raises(InputError, match=r"'plant\.yaml' closes no loop with the net"):
        check_bundle(resealed(bundled(), other))


def test_a_plant_that_no_verdict_names_is_refused() -> None:
    bundle = bundled()
    verdicts = tuple(verdict for verdict in bundle.verdicts if not verdict.name.startswith(PREFIX))
    for file in (PLANT, DOCUMENT):
        evidence = {name: text for name, text in bundle.evidence.items() if name not in {PLANT, DOCUMENT} - {file}}
        with pytest.raises(InputError, match="F6002"):
            check_bundle(replace(bundle, verdicts=verdicts, evidence=evidence))
