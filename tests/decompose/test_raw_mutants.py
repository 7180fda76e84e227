"""Any file of a bundle changed at random, with all hashes and seals made anew, is refused."""

from functools import cache

import pytest
from support.examples import seeds
from support.raw_mutants import raw_mutant

from firable.analysis.check import check
from firable.decompose.bundling import make_bundle
from firable.decompose.verification.checking import check_bundle
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError


@cache
def bundled(name: str) -> Bundle:
    return make_bundle(check(catalogue_net(name)))


def is_shown(archive: bytes, n_verdicts: int) -> bool:
    try:
        checked = check_bundle(Bundle.from_bytes(archive))
    except (InputError, ValueError):
        return False
    return len(checked) == n_verdicts and all(one.shown for one in checked)


@pytest.mark.seeds
@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize(("name", "count"), [("conceptual_one_robot", 100), ("one_robot", 20)])
def test_a_file_of_a_bundle_that_is_changed_at_random_is_refused(name: str, count: int) -> None:
    bundle = bundled(name)
    assert is_shown(bundle.to_bytes(), len(bundle.verdicts))
    mutants = [(how, archive) for how, archive in (raw_mutant(bundle, seed) for seed in seeds(count)) if archive]
    assert len(mutants) > count / 2
    assert [how for how, archive in mutants if is_shown(archive, len(bundle.verdicts))] == []
