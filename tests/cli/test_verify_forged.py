"""`firable verify` on documents that somebody made by hand: one refusal each, and no line that is not its own."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from firable.analysis.evidence.certificate import Equation, InductiveInvariant
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record, seal
from firable.cli.main import main
from firable.nets.formula import Deadlock
from firable.nets.interchange import net_digest, net_from_json
from firable.nets.net import Net, Place, Transition
from firable.semantics.trace import Discipline

RING = Net(
    "ring",
    (Place("p", marked=True), Place("q")),
    (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))),
)
LINE = "\n  ✓ shown  deadlock-free  in every reachable marking some transition is firable"
Change = Callable[[dict[str, Any]], object]


def invariant(weight: int) -> Record:
    """That there is no deadlock, for one token is on both places together."""
    sums = Equation((("p", weight), ("q", weight)), 1)
    return Record("deadlock-free", True, ((Claim(ClaimKind.NEVER, Deadlock()), InductiveInvariant((sums,), (), 0)),))


def written(path: Path, change: Change, record: Record) -> str:
    """A document, changed and sealed anew."""
    data = json.loads(Document(RING, Discipline.INTERLEAVING, (record,)).to_text())
    change(data)
    file = path / "forged.json"
    file.write_text(json.dumps({**data, "seal": seal(data)}), encoding="utf-8")
    return str(file)


def verdict(**changed: str) -> Change:
    return lambda data: data["verdicts"][0].update(changed)


FORGED: dict[str, tuple[Change, str]] = {
    "the name of a query has a line of its own": (
        verdict(name=f"query.x{LINE}", query="ctl AG (p or q)"),
        "is not the name of a verdict",
    ),
    "a name moves the cursor": (verdict(name="x\x1b[2K"), "'x·[2K' is not the name of a verdict"),
    "a name pushes what follows into the next line": (
        verdict(name=f"query.x{' ' * 80}✓"),
        "is not the name of a verdict",
    ),
    "a name is no Unicode": (verdict(name="a\ud800b"), "'a·b' is not the name of a verdict"),
    "a reason has a line of its own": (
        verdict(lacking=f"because{LINE}"),
        "what is said of 'deadlock-free' is not one line",
    ),
    "a query has a line of its own": (
        verdict(name="query.x", query=f"ctl AG (p or{LINE[:3]}q)"),
        "what is said of 'query.x' is not one line",
    ),
    "a query names no place of the net": (verdict(name="query.x", query="ctl zz"), "there is no place 'zz'"),
    "a query names no transition": (
        verdict(name="query.x", query="ctl firable(zz)"),
        "there is no transition 'zz'",
    ),
    "a query counts what is not there": (
        verdict(name="query.x", query="ctl tokens(zz) <= 1 or EF zz"),
        "there is no place 'zz'",
    ),
}


@pytest.mark.parametrize("forged", FORGED)
def test_a_document_is_refused_of_which(forged: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change, message = FORGED[forged]
    file = written(tmp_path, change, invariant(1))
    assert main(["verify", file, "--smt-dir", str(tmp_path / "smt")]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("error[") == 1
    assert "error[F6001]: the evidence is damaged or malformed: " in told.err
    assert message in told.err
    assert "\x1b" not in told.err
    assert not (tmp_path / "smt").exists()


def test_a_net_whose_name_has_a_line_of_its_own_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def rename(data: dict[str, Any]) -> None:
        data["net"]["name"] = f"ring{LINE}"

    assert main(["verify", written(tmp_path, rename, invariant(1))]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert "is not a name for a net" in told.err
    assert told.err.count("\n") == 2  # the refusal and its hint


@pytest.mark.parametrize(
    ("digits", "message"),
    [
        (4_000, "error[F6002]: deadlock-free: the evidence does not show what it claims"),
        (4_001, "a number of an invariant has more than 4,000 digits"),
        (4_300, "a number of an invariant has more than 4,000 digits"),
    ],
)
def test_numbers_whose_sum_nobody_could_print_are_refused(
    digits: int, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def fill(data: dict[str, Any]) -> None:
        data["net"]["places"][1]["marked"] = True
        data["digest"] = net_digest(net_from_json(data["net"]))

    assert main(["verify", written(tmp_path, fill, invariant(10**digits - 1))]) == 2
    told = capsys.readouterr().err
    assert told.count("error[") == 1
    assert message in told
