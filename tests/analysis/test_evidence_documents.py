"""A document of evidence that is sealed anew is refused where it has another shape, or names what is none."""

import gzip
import json
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.evidence import document
from support.evidence_examples import EXAMPLES

from firable.analysis.evidence.document import Document, document_from_text, read_document, seal
from firable.nets.diagnostics import InputError
from firable.nets.net import Net, Place
from firable.semantics.trace import Discipline

Change = Callable[[dict[str, Any]], object]


def of_claim(**changed: Any) -> Change:
    return lambda data: data["verdicts"][0]["shown"][0]["claim"].update(changed)


def without_goal(data: dict[str, Any]) -> None:
    del data["verdicts"][0]["shown"][0]["claim"]["goal"]


def of_certificate(**changed: Any) -> Change:
    return lambda data: data["verdicts"][0]["shown"][0]["certificate"].update(changed)


def of_set(**changed: Any) -> Change:
    return lambda data: data["sets"][0].update(changed)


SUM = {"weights": {"nowhere": 1}, "tokens": 0}
LARGE = {"weights": {}, "tokens": 10**4_000}
LOW = {"weights": {"p1.eating": -(10**4_000)}, "tokens": 0}
STEP = {"rule": "copy", "moves": [], "places": ["nowhere", "nowhere"]}
DIAGRAM = {"kind": "diagram", "order": ["a", "b", "asked", "done"], "rows": [], "roots": [1]}
CHANGES: dict[str, tuple[str, Change, str]] = {
    "a place of a goal": ("weak", of_claim(goal="nowhere"), "no 'nowhere'"),
    "a place of an answer": ("weak", of_claim(then="nowhere"), "no 'nowhere'"),
    "a transition of a goal": ("unfolded", of_claim(goal="G not fires(nobody)"), "no 'nobody'"),
    "a transition that fires": ("fires", of_claim(fires=["nobody"]), "no 'nobody'"),
    "a formula of CTL for one of LTL": ("unfolded", of_claim(goal="AG EF done"), "is no formula of LTL"),
    "a formula of LTL for one of CTL": ("labels", of_claim(goal="G F deadlock"), "is no formula of CTL"),
    "the goal of a claim": ("markings", without_goal, "claim.goal: Field required"),
    "no goal": ("markings", of_claim(goal=""), "a formula cannot be read: the formula ends too early"),
    "a formula for a goal": ("markings", of_claim(goal="AG deadlock"), "a formula cannot be read"),
    "a place of a sum": ("invariant", of_certificate(equations=[SUM]), "no 'nowhere'"),
    "a number of a sum": ("invariant", of_certificate(equations=[LARGE]), "has more than 4,000 digits"),
    "a number of a weight": ("invariant", of_certificate(inequalities=[LOW]), "has more than 4,000 digits"),
    "a place of a lower bound": ("invariant", of_certificate(inequalities=[SUM]), "no 'nowhere'"),
    "a place of a clause": (
        "invariant",
        of_certificate(clauses=[{"marked": ["nowhere"], "empty": []}]),
        "no 'nowhere'",
    ),
    "a place of no clause": (
        "invariant",
        of_certificate(clauses=[{"marked": [], "empty": ["nowhere"]}]),
        "no 'nowhere'",
    ),
    "a place of a trap": ("free choice", of_certificate(traps=[["nowhere"]]), "no 'nowhere'"),
    "a place of a part": ("reduction", of_certificate(part=["nowhere"]), "no 'nowhere'"),
    "a place of a step": ("reduction", of_certificate(steps=[STEP]), "no 'nowhere'"),
    "a place of a diagram": ("diagram", of_set(order=["nowhere"]), "no 'nowhere'"),
    "a rule": ("reduction", of_certificate(steps=[{**STEP, "rule": "guess"}]), "guess"),
    "who fires": ("sequence", of_certificate(firings=[["nobody"]]), "no 'nobody'"),
    "who fires again and again": ("lasso", of_certificate(cycle=[["nobody"]]), "no 'nobody'"),
    "who helps": ("weak", of_certificate(helpful=[[[0], "nobody"]]), "no 'nobody'"),
    "who is gone back by": (
        "rounds",
        of_certificate(labels=[{"kind": "back", "transitions": ["nobody"]}]),
        "no 'nobody'",
    ),
    "who is stubborn": (
        "stubborn sets",
        of_certificate(stubborn=["1" + "0" * 40]),
        "a transition that the net does not",
    ),
    "who is stubborn beside others": (
        "stubborn sets",
        of_certificate(stubborn=["1", "1" + "0" * 40]),
        "a transition that the net does not",
    ),
    "an answer of what is never so": ("markings", of_claim(then="true"), "'never' does not speak of 'then'"),
    "an answer of what fires": ("fires", of_claim(then="b"), "'fires' does not speak of 'then'"),
    "a fairness of what is never so": ("markings", of_claim(fairness="weak"), "'never' does not speak of 'fairness'"),
    "a fairness of what comes later": ("later", of_claim(fairness="weak"), "'later' does not speak of 'fairness'"),
    "who fires of what is reached": ("sequence", of_claim(fires=["p1.eat"]), "'reachable' does not speak of 'fires'"),
    "who fires of what comes later": ("later", of_claim(fires=["go"]), "'later' does not speak of 'fires'"),
    "a goal of what is live": ("marked graph", of_claim(goal="a"), "'live' has no goal"),
    "a goal of a home marking": ("marked graph", of_claim(kind="home", goal="a"), "'home' has no goal"),
    "a goal of steps in order": ("ordered", of_claim(goal="a"), "'ordered' has no goal"),
    "a goal of steps without order": ("unordered", of_claim(goal="false"), "'unordered' has no goal"),
    "a set beside those that something rests on": (
        "markings",
        lambda data: data["sets"].append({"kind": "markings", "markings": []}),
        "nothing rests on set 1",
    ),
    "a diagram where nothing rests on sets": (
        "invariant",
        lambda data: data["sets"].append(DIAGRAM | {"order": []}),
        "nothing rests on set 0",
    ),
    "a set": ("markings", of_certificate(set=1), "no set 1"),
    "a set of stubborn sets": ("stubborn sets", of_certificate(set=1), "no set 1"),
    "a listed set of ranks": ("weak", lambda data: data["sets"].__setitem__(0, DIAGRAM), "set 0 is not listed"),
    "a marking of a larger net": ("weak", of_set(markings=["5", "f5"]), "a place that the net does not have"),
    "a marking twice": ("weak", of_set(markings=["5", "5"]), "not in order"),
    "a marking too early": ("weak", of_set(markings=["6", "5"]), "not in order"),
    "a capital digit": ("weak", of_set(markings=["5", "A"]), "match pattern"),
    "a zero before a number": ("weak", of_set(markings=["05"]), "match pattern"),
    "a row of four numbers": ("diagram", of_set(rows=[[1, 0, 1, 9]]), "at most 3 items"),
    "a row of two numbers": ("diagram", of_set(rows=[[1, 0]]), "at least 3 items"),
    "a row below the first": ("diagram", of_set(rows=[[1, -1, 1]]), "greater than or equal to 0"),
    "a level that is a truth value": ("diagram", of_set(rows=[[True, 0, 1]]), "should be a valid integer"),
    "a level that is a fraction": ("diagram", of_set(rows=[[1.0, 0, 1]]), "should be a valid integer"),
    "a level that is a text": ("diagram", of_set(rows=[["1", 0, 1]]), "should be a valid integer"),
    "no root": ("diagram", of_set(roots=[]), "at least 1 item"),
    "a root before the first": ("diagram", of_set(roots=[-1]), "greater than or equal to 0"),
    "a set before the first": ("diagram", of_certificate(set=-1), "greater than or equal to 0"),
    "a label of a root before the first": (
        "root",
        of_certificate(labels=[{"kind": "root", "root": -1}]),
        "greater than or equal to 0",
    ),
    "a depth below 0": ("invariant", of_certificate(depth=-1), "greater than or equal to 0"),
    "a depth beyond what is looked at": ("invariant", of_certificate(depth=1_001), "less than or equal to 1000"),
    "rounds below 0": (
        "rounds",
        of_certificate(labels=[{"kind": "rounds", "rounds": -1}]),
        "greater than or equal to 0",
    ),
    "more rounds than are gone": (
        "rounds",
        of_certificate(labels=[{"kind": "rounds", "rounds": 1_000_001}]),
        "less than or equal to 1000000",
    ),
    "a rank below that of none": (
        "distances",
        of_certificate(labels=[{"kind": "ranks", "ranks": [-2]}]),
        "greater than or equal to -1",
    ),
    "a label of no kind": (
        "distances",
        of_certificate(labels=[{"kind": "guess"}]),
        "does not match any of the expected",
    ),
    "a stubborn set before the first": ("stubborn sets", of_certificate(chosen=[-1]), "greater than or equal to 0"),
    "a move before the first": (
        "reduction",
        of_certificate(steps=[{"rule": "dead", "moves": [-1]}]),
        "greater than or equal to 0",
    ),
    "a theorem": ("free choice", of_certificate(name="free-will"), "Input should be 'marked-graph'"),
    "a discipline": ("weak", lambda data: data.update(discipline="eager"), "Input should be 'interleaving' or 'step'"),
    "an earlier version": ("weak", lambda data: data.update(firable_evidence=1), "greater than or equal to 2"),
    "a later version": ("weak", lambda data: data.update(firable_evidence=3), "less than or equal to 2"),
    "a version with a point": ("weak", lambda data: data.update(firable_evidence=2.0), "should be a valid integer"),
    "a status": (
        "weak",
        lambda data: data["verdicts"][0].update(status="unknown"),
        "Input should be 'proved' or 'violated'",
    ),
    "another net's digest": ("weak", lambda data: data.update(digest="0" * 64), "the digest is not that of the net"),
    "a key beside the others": ("weak", lambda data: data.update(note=""), "'note' is no key here"),
    "a negative rank": ("weak", of_certificate(ranks=[[-1], [0], [], []]), "greater than or equal to 0"),
    "a key that is none": ("weak", of_certificate(note=""), "'note' is no key here"),
    "a key of a claim that is none": ("weak", of_claim(note=""), "'note' is no key here"),
    "an enumeration's other name": ("weak", of_claim(fairness="WEAK"), "weak"),
}


def sealed(data: dict[str, Any]) -> str:
    return json.dumps({**data, "seal": seal(data)})


@pytest.mark.parametrize("what", CHANGES)
def test_a_document_is_refused_that_names_what_is_none(what: str) -> None:
    example, change, reason = CHANGES[what]
    found = EXAMPLES[example]()
    assert found is not None
    data = json.loads(document(found).to_text())
    change(data)
    with pytest.raises(InputError) as caught:
        document_from_text(sealed(data))
    (told,) = caught.value.diagnostics
    assert told.code == "F6001"
    assert reason in told.message


def test_a_key_that_stands_twice_is_refused() -> None:
    found = EXAMPLES["invariant"]()
    assert found is not None
    text = document(found).to_text()
    assert text.count('"depth":0') == 1
    with pytest.raises(InputError, match="a key stands twice"):
        document_from_text(text.replace('"depth":0', '"depth":1,"depth":0'))


def test_a_value_that_is_none_of_json_is_not_taken_for_nothing() -> None:
    found = EXAMPLES["reduced to nothing"]()
    assert found is not None
    text = document(found).to_text()
    assert '"then":null' in text
    with pytest.raises(InputError, match="NaN is no value of JSON"):
        document_from_text(text.replace('"then":null', '"then":NaN', 1))


def _without_its_check(packed: bytes) -> bytes:
    return packed[:-8] + bytes(8)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda packed: packed + b"beside", "not to its end"),
        (lambda packed: packed + gzip.compress(b"and more"), "not to its end"),
        (lambda packed: packed[:-9], "not to its end"),
        (_without_its_check, "it cannot be unpacked: "),
    ],
)
def test_what_is_compressed_is_one_document_whole(
    damage: Callable[[bytes], bytes], reason: str, tmp_path: Path
) -> None:
    found = EXAMPLES["invariant"]()
    assert found is not None
    file, packed = tmp_path / "packed.json.gz", gzip.compress(document(found).to_text().encode())
    file.write_bytes(packed)
    assert read_document(file).records == document(found).records
    file.write_bytes(damage(packed))
    with pytest.raises(InputError, match=reason):
        read_document(file)


@pytest.fixture
def text() -> bytes:
    found = EXAMPLES["invariant"]()
    assert found is not None
    return document(found).to_text().encode()


def test_a_document_that_unpacks_to_more_than_is_read_is_refused(
    text: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "packed.json.gz"
    file.write_bytes(gzip.compress(text))
    monkeypatch.setattr("firable.analysis.evidence.document.SIZE_BYTES_MAX", len(text))
    assert read_document(file).records == document_from_text(text.decode()).records
    monkeypatch.setattr("firable.analysis.evidence.document.SIZE_BYTES_MAX", len(text) - 1)
    with pytest.raises(InputError, match=f"F6001.*it unpacks to more than {len(text) - 1:,} bytes"):
        read_document(file)


def test_a_document_that_is_much_larger_than_its_file_is_refused(text: bytes, tmp_path: Path) -> None:
    file = tmp_path / "packed.json.gz"
    file.write_bytes(gzip.compress(text + b" " * 10 * len(text)))
    assert read_document(file).records == document_from_text(text.decode()).records
    packed = gzip.compress(text + b" " * 2**26)
    file.write_bytes(packed)
    with pytest.raises(InputError, match=f"F6001.*it unpacks to more than {100 * len(packed):,} bytes"):
        read_document(file)


def test_a_document_that_would_be_much_larger_than_its_file_is_not_compressed(tmp_path: Path) -> None:
    file, net = tmp_path / "evidence", Net("n", (Place("p"),), description="x" * 2**20)
    for description, is_packed in (("x" * 2**21, False), ("".join(map(str, range(2**18))), True)):
        whole = Document(replace(net, description=description), Discipline.INTERLEAVING, ())
        file.write_bytes(whole.to_bytes())
        assert read_document(file) == whole
        assert file.read_bytes().startswith(b"\x1f\x8b") == is_packed


@pytest.mark.parametrize("where", ["sets", "net"])
def test_of_very_many_things_that_are_none_the_first_is_told(where: str, text: bytes) -> None:
    data = json.loads(text)
    if where == "sets":
        data["sets"].append({"kind": "markings", "markings": [0] * 100_000})
    else:
        data["net"]["places"] = [0] * 100_000
    whole = sealed(data)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"F6001.*0: Input should be"):
            document_from_text(whole)
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()
