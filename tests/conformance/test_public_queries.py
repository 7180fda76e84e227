"""The formulas of the model-checking contest come out with its published verdicts.

The nets and formulas are not part of the repository: see `test_public_nets`. Of nets with more than `MARKINGS_MAX`
markings LTL is asked on the fly, in so many vertices at most, and CTL marking by marking, in so many of these at most,
and on the diagrams that are quick. Of a net that is
not 1-safe as an ordinary net only that is compared: the rest speaks of tokens that the contact rule keeps back. The
verdicts are numbered in the order of the formulas' names.
"""

import csv
import os
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Final

import pytest

from firable.analysis._engine import IncompleteGraph
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import ReachabilityGraph, explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.temporal.ctl import Ctl
from firable.analysis.temporal.local import decide_ctl_on_the_fly
from firable.analysis.temporal.on_the_fly import Turn, decide_ltl_on_the_fly
from firable.analysis.temporal.queries import answer
from firable.analysis.temporal.sets import Sets
from firable.analysis.temporal.simplifying import simplified
from firable.nets.loading import Loaded, load
from firable.nets.net import Net
from firable.nets.queries import Query, QueryKind, parse_query, read_queries
from firable.nets.temporal import Temporal
from firable.nets.verdict import Status, Verdict

FOLDER = os.environ.get("FIRABLE_NETS", "")
MARKINGS_MAX: Final = 10_000
VERTICES_MAX: Final = 2**18
LOCAL_MARKINGS_MAX: Final = 2**14
DECIDED_MIN: Final = 5
"""Of some thirty formulas of a net, how many are decided at least with so few markings; most of nearly all nets."""
QUICK_DIAGRAMS: Final = ("AirplaneLD-PT-0010", "FlexibleBarrier-PT-14a")
EXAMINATIONS: Final = (
    "CTLCardinality",
    "CTLFireability",
    "LTLCardinality",
    "LTLFireability",
    "ReachabilityCardinality",
    "ReachabilityFireability",
    "UpperBounds",
)
GLOBAL: Final = {
    "contest_deadlock": "EF deadlock",
    "contest_live": "live",
    "contest_quasi_live": "quasi_live",
    "contest_stable_marking": "stable_marking",
}
STATUS: Final = {Status.PROVED: "TRUE", Status.VIOLATED: "FALSE", Status.UNKNOWN: "unknown"}


@cache
def table(name: str) -> list[dict[str, str]]:
    if not (Path(FOLDER) / name).is_file():
        return []
    with (Path(FOLDER) / name).open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream, delimiter="\t"))


def nets() -> list[str]:
    asked = {row["net"] for row in table("queries/expected.tsv")} if FOLDER else set()
    return [
        row["file"]
        for row in (table("expected.tsv") if FOLDER else [])
        if Path(row["file"]).stem in asked
        and row["one_safe"] == "yes"
        and row["markings"]
        and int(row["markings"]) <= MARKINGS_MAX
    ]


@cache
def published() -> dict[tuple[str, str, int], str]:
    rows = table("queries/expected.tsv")
    return {(row["net"], row["examination"], int(row["index"])): row["value"] for row in rows}


def value(verdict: Verdict, kind: QueryKind) -> str:
    if kind is QueryKind.BOUND and verdict.status is Status.PROVED:
        return verdict.statement.rpartition(" is ")[2]
    return STATUS[verdict.status]


@cache
def loaded_net(file: str) -> Loaded:
    return load(Path(FOLDER) / file)


@lru_cache(64)
def space_of(file: str) -> tuple[ReachabilityGraph, dict[str, str]]:
    loaded = loaded_net(file)
    return explore(loaded.net), dict(loaded.renamed)


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("file", nets())
def test_the_formulas_of_the_contest_have_their_published_values(file: str) -> None:
    (graph, renamed), net, expected = space_of(file), Path(file).stem, published()
    compared = 0
    for examination in EXAMINATIONS:
        queries = read_queries(Path(FOLDER) / "queries" / net / f"{examination}.xml", graph.net, renamed)
        for index, query in enumerate(sorted(queries, key=lambda query: query.name)):
            if (wanted := expected.get((net, examination, index))) is not None:
                assert value(answer(graph, query), query.kind) == wanted, query.name
                compared += 1
    assert compared > 80


def large_nets() -> list[str]:
    """The nets with more markings than are explored here, that are 1-safe as ordinary nets."""
    asked = {row["net"] for row in table("queries/expected.tsv")} if FOLDER else set()
    return [
        row["file"]
        for row in (table("expected.tsv") if FOLDER else [])
        if Path(row["file"]).stem in asked
        and row["one_safe"] == "yes"
        and row["markings"]
        and int(row["markings"]) > MARKINGS_MAX
    ]


def asked_of(file: str, net: Net, renamed: dict[str, str], examinations: Iterable[str]) -> Iterator[tuple[Query, str]]:
    """The queries of some examinations with a published value, and that value."""
    expected, name = published(), Path(file).stem
    for examination in examinations:
        queries = read_queries(Path(FOLDER) / "queries" / name / f"{examination}.xml", net, renamed)
        for index, query in enumerate(sorted(queries, key=lambda query: query.name)):
            if (wanted := expected.get((name, examination, index))) is not None:
                yield query, wanted


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("file", large_nets())
def test_what_is_decided_of_large_nets_on_the_fly_is_what_was_published(file: str) -> None:
    loaded = loaded_net(file)
    compared = 0
    for query, wanted in asked_of(file, loaded.net, dict(loaded.renamed), ("LTLCardinality", "LTLFireability")):
        if query.kind is not QueryKind.LTL or query.formula is None:
            continue
        try:
            found = decide_ltl_on_the_fly(loaded.net, query.formula, Limits(), turns=[Turn(None, VERTICES_MAX)])
        except IncompleteGraph:
            continue
        assert found.answer.holds is (wanted == "TRUE"), query.name
        compared += 1
    assert compared > 20


def nets_beyond_sets() -> list[str]:
    """The nets with more markings than are explored here, or nobody knows how many, that are 1-safe by the contest."""
    asked = {row["net"] for row in table("queries/expected.tsv")} if FOLDER else set()
    return [
        row["file"]
        for row in (table("expected.tsv") if FOLDER else [])
        if Path(row["file"]).stem in asked
        and row["contest_one_safe"] == "TRUE"
        and not (row["markings"] and int(row["markings"]) <= MARKINGS_MAX)
    ]


@cache
def decided_locally(file: str, formula: Temporal) -> bool | None:
    """Whether a formula holds at the start, None where that takes too many markings; many are as simple as they get."""
    try:
        return decide_ctl_on_the_fly(loaded_net(file).net, formula, Limits(), markings=LOCAL_MARKINGS_MAX).answer.holds
    except IncompleteGraph:
        return None


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("file", nets_beyond_sets())
def test_what_is_decided_of_large_nets_marking_by_marking_is_what_was_published(file: str) -> None:
    loaded = loaded_net(file)
    compared = 0
    for query, wanted in asked_of(file, loaded.net, dict(loaded.renamed), ("CTLCardinality", "CTLFireability")):
        assert query.formula is not None
        if (holds := decided_locally(file, query.formula)) is not None:
            assert holds is (wanted == "TRUE"), query.name
            compared += 1
    assert compared >= DECIDED_MIN


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("file", nets_beyond_sets())
def test_simpler_formulas_of_large_nets_say_nothing_else(file: str) -> None:
    loaded = loaded_net(file)
    for query, wanted in asked_of(file, loaded.net, dict(loaded.renamed), ("CTLCardinality", "CTLFireability")):
        assert query.formula is not None
        if (holds := decided_locally(file, simplified(query.formula))) is not None:
            assert holds is (wanted == "TRUE"), query.name


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
@pytest.mark.parametrize("name", QUICK_DIAGRAMS)
def test_ctl_on_diagrams_of_large_nets_has_the_published_values(name: str) -> None:
    file = next(row["file"] for row in table("expected.tsv") if Path(row["file"]).stem == name)
    loaded = loaded_net(file)
    space = explore_symbolically(loaded.net)
    asked = list(asked_of(file, loaded.net, dict(loaded.renamed), ("CTLCardinality", "CTLFireability")))
    for query, wanted in asked:
        formula = query.formula
        assert formula is not None
        holds = space.contains(Ctl(Sets(space)).of(formula), loaded.net.initial_marking)
        assert holds is (wanted == "TRUE"), query.name
    assert len(asked) > 25


@pytest.mark.skipif(not FOLDER, reason="FIRABLE_NETS does not name the folder of the public nets")
def test_the_global_questions_of_the_contest_have_their_published_values() -> None:
    compared = 0
    for row in table("expected.tsv"):
        if not row["markings"] or int(row["markings"]) > MARKINGS_MAX or not row["contest_one_safe"]:
            continue
        graph, _ = space_of(row["file"])
        asked = {"contest_one_safe": "one_safe"}
        if row["one_safe"] == "yes":
            asked |= GLOBAL
        for column, text in asked.items():
            if row[column]:
                query = parse_query(text, column)
                assert value(answer(graph, query), query.kind) == row[column], (row["file"], column)
                compared += 1
    assert compared > 40
