"""Public benchmark nets come out with the figures that two independent explorers and the model-checking contest give.

The nets are not part of the repository. `FIRABLE_NETS` names the folder that holds them and their `expected.tsv`; make
sets it where the folder stands beside the checkout. Without it these tests are skipped, and say so. Nets with more than
`MARKINGS_MAX` markings are left to `benchmarks/public_nets.py`, but for some of which a decision diagram is found soon.
"""

import csv
import os
from pathlib import Path
from typing import Final

import pytest

from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.stubborn import find_deadlocks
from firable.analysis.verdicts.behaviour import Behaviour
from firable.nets.pnml import read_pnml

FOLDER = os.environ.get("FIRABLE_NETS", "")
MARKINGS_MAX: Final = 1_000_000

BEYOND_MEMORY: Final = (
    *("CloudDeployment-PT-2b", "HealthRecord-PT-17", "ShieldIIPt-PT-003B", "ShieldIIPt-PT-010B", "ShieldIIPt-PT-100A"),
    *("ShieldRVt-PT-005B", "SmartHome-PT-16"),
)
"""Nets of the contest with up to 1e280 markings."""

Row = dict[str, str]


def table() -> list[Row]:
    if not FOLDER:
        return []
    with (Path(FOLDER) / "expected.tsv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream, delimiter="\t"))


def rows() -> list[Row]:
    listed = [row for row in table() if row["markings_contact_rule"]]
    return [row for row in listed if int(row["markings_contact_rule"]) <= MARKINGS_MAX]


def by_family() -> dict[str, list[Row]]:
    families: dict[str, list[Row]] = {}
    for row in rows():
        families.setdefault(row["family"], []).append(row)
    return families


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("family", sorted(by_family()))
def test_the_figures_of_public_nets(family: str) -> None:
    for row in by_family()[family]:
        net = read_pnml(Path(FOLDER) / row["file"]).net
        graph = explore(net)
        behaviour = Behaviour(graph)
        found = {
            "markings_contact_rule": graph.n_markings,
            "deadlocks_contact_rule": int(graph.deadlocks.sum()),
        }
        reduced = find_deadlocks(net, Limits())
        assert (reduced.found, reduced.complete) == (found["deadlocks_contact_rule"], True), row["file"]
        if row["one_safe"] == "yes":
            assert not behaviour.contacts, row["file"]
            found |= {
                "markings": graph.n_markings,
                "edges": graph.n_edges,
                "deadlock_markings": int(graph.deadlocks.sum()),
                "dead_transitions": len(behaviour.dead),
                "live_transitions": len(behaviour.live),
            }
            if row["reversible"]:
                assert behaviour.reversible is (row["reversible"] == "yes"), row["file"]
            if row["live"]:
                assert (not behaviour.nonlive) is (row["live"] == "yes"), row["file"]
        else:
            assert row["one_safe"] != "no" or behaviour.contacts, row["file"]
        for key, figure in found.items():
            assert row[key] == "" or int(row[key]) == figure, (row["file"], key, row[key], figure)


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("name", BEYOND_MEMORY)
def test_nets_that_no_memory_holds_have_their_published_number_of_markings(name: str) -> None:
    (row,) = (row for row in table() if row["file"] == f"mcc/{name}.pnml")
    assert explore_symbolically(read_pnml(Path(FOLDER) / row["file"]).net).n_markings == int(row["contest_markings"])
