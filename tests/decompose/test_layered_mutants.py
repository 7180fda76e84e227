"""Mutants of a bundle in layers that holds its protocol and its faults: whatever is changed in one thing is refused."""

from collections.abc import Callable, Iterator
from functools import cache

import pytest
from support.bundle_mutants import decomposition_mutants, line_mutants, verdict_mutants
from support.examples import some
from support.layered_nets import cells_in_a_line
from support.remembered import answered, examined, read

from firable.analysis.check import check
from firable.decompose.bundling import make_bundle
from firable.decompose.splitting.cut import split
from firable.decompose.verification import documents, outages
from firable.decompose.verification.bereft import PREFIX
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.explored import TITLES, check_explored
from firable.decompose.verification.obligations import compared
from firable.decompose.verification.outage_obligations import OutageObligations
from firable.decompose.verification.outages import check_outages
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError

TIMEOUT_MS = 10_000
LAYERS = ("o8", "o8-apart")
EQUIVALENT = ("under line",)
"""Who names nobody stands under the root of the layers already."""


@cache
def bundled() -> Bundle:
    return make_bundle(check(cells_in_a_line()), protocol=True, faults=True)


@pytest.fixture(autouse=True)
def remembering(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], tuple[str, ...]]:
    """What a solver answers to one text, and a checker to one document, is found once: a mutant changes few of them.

    The same of what must be proved of one protocol, as stated anew, and of reading a document.
    """
    monkeypatch.setattr(documents, "document_from_text", read)
    monkeypatch.setattr(documents, "check_document", examined)
    monkeypatch.setattr(documents, "obligations", lambda *_, **__: ())
    monkeypatch.setattr(outages, "OutageObligations", cache(OutageObligations))
    return answered


def cut_survivors(bundle: Bundle, one_in: int) -> tuple[int, list[tuple[str, Callable[[], Bundle]]]]:
    """How many mutants of net, subnets, table and groups there are, and those that are the cut of their own net."""
    count, found = 0, []
    for how, make in some(decomposition_mutants(bundle), one_in):
        try:
            mutant = make()
        except (InputError, ValueError):
            continue  # not even a net: nothing that could be read
        count += 1
        try:
            check_cut(mutant.decomposition)
        except NotShownError:
            continue
        found.append((how, make))
    return count, found


@pytest.mark.seeds
def test_every_single_change_of_subnets_table_and_groups_in_layers_is_refused() -> None:
    count, found = cut_survivors(Bundle(split(catalogue_net("two_cells")), (), {}), 11)
    assert count > 400
    assert [how for how, _ in found if not how.startswith("net: ")] == []


def test_every_single_change_of_a_net_in_layers_is_refused() -> None:
    bundle = bundled()
    count, found = cut_survivors(bundle, 1)
    assert count > 500
    assert all(how.startswith("net: ") for how, _ in found)
    survivors = []
    for how, make in found:
        try:
            check_bundle(make())
        except InputError:
            continue
        survivors.append(how)
    assert all(how.endswith(EQUIVALENT) for how in survivors), survivors


def test_every_single_change_of_a_verdict_on_layers_is_refused() -> None:
    bundle = bundled()
    cut = check_cut(bundle.decomposition)
    mutants = [(family, make) for family, make in changed_verdicts(bundle) if family in LAYERS]
    assert len(mutants) > 60
    for family, make in mutants:
        with pytest.raises(NotShownError):
            compared(Examination(make()), cut, family)


def changed_verdicts(bundle: Bundle) -> Iterator[tuple[str, Callable[[], Bundle]]]:
    for how, make in verdict_mutants(bundle):
        yield how.removeprefix("verdict ").partition(":")[0].partition(".")[0], make


@pytest.mark.seeds
def test_every_single_change_of_a_verdict_on_the_protocol_in_layers_is_refused(
    remembering: Callable[[str, int], tuple[str, ...]],
) -> None:
    bundle = bundled()
    cut = check_cut(bundle.decomposition)
    mutants = [
        (how, make) for how, make in verdict_mutants(bundle) if how.startswith(tuple(f"verdict {t}." for t in TITLES))
    ]
    mutants = some([(how, make) for how, make in mutants if PREFIX not in how], 8)
    assert len(mutants) > 8
    for how, make in mutants:
        try:
            mutant = Examination(make())
            check_explored(mutant, cut, "cvc5", remembering, TIMEOUT_MS)
        except NotShownError:
            continue
        unknown = {
            v.name for v in mutant.bundle.verdicts if v.name.partition(".")[0] in TITLES and PREFIX not in v.name
        }
        assert unknown - set(mutant.checked), how


@pytest.mark.seeds
def test_every_single_change_of_a_verdict_on_who_is_dead_in_layers_is_refused(
    remembering: Callable[[str, int], tuple[str, ...]],
) -> None:
    bundle = bundled()
    cut = check_cut(bundle.decomposition)
    mutants = some([(how, make) for how, make in verdict_mutants(bundle) if how.startswith(f"verdict {PREFIX}")], 3)
    assert len(mutants) > 30
    for how, make in mutants:
        try:
            mutant = Examination(make())
            check_outages(mutant, cut, remembering, TIMEOUT_MS)
        except (NotShownError, ValueError):
            continue
        assert {v.name for v in mutant.bundle.verdicts if v.name.startswith(PREFIX)} - set(mutant.checked), how


@pytest.mark.parametrize("family", LAYERS)
def test_every_change_of_a_line_on_layers_is_refused(family: str) -> None:
    bundle, file = bundled(), f"{family}.smt2"
    cut = check_cut(bundle.decomposition)
    text = "\n\n".join(bundle.evidence[file].split("\n\n")[:9])  # its head, and eight of its obligations
    rest = bundle.evidence[file].removeprefix(text)
    survivors = []
    for how, changed in line_mutants(text):
        mutant = Bundle(bundle.decomposition, bundle.verdicts, {**bundle.evidence, file: changed + rest})
        try:
            compared(Examination(mutant), cut, family)
        except NotShownError:
            continue
        survivors.append((how, sorted(changed.splitlines()) == sorted(text.splitlines())))
    assert all(same_lines for _, same_lines in survivors), survivors  # declarations in another order say the same
