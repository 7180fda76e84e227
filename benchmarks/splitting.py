"""Splitting and proving generated cells, and checking the proofs again: time for each transition, as the cell grows.

The curve is the point, and drawn under the table of generated cells (`curves`): a ratio to the smallest cell that
stays near 1 says that everything is linear in the number of transitions. Measured is all that `firable prove` does
after reading: the split, every static obligation, its text and z3's answer; and, apart, all that `firable verify` does
with these files: the net cut anew, what must be proved stated anew and compared, and cvc5's answers.

Groups of many competitors are measured apart: a robot whose jobs take turns, pigeons that compete for holes as well,
and a chain in which each competes with its neighbours alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from curves import curves
from measuring import MET, MISSED, Table, timed

from firable.decompose.proofs.proving import ProofReport, prove
from firable.decompose.protocol.parametric.proving import theorem
from firable.decompose.splitting.cut import split
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.obligations import check_obligations
from firable.decompose.verification.protocol import blocks
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.solvers import by_cvc5
from firable.nets.bundle import Bundle
from firable.nets.catalogue import family_net
from firable.nets.decomposition import Decomposition
from firable.nets.net import Arbiter, ArbitrationRule, Controller, Net, Place, Transition

CELLS: Final = "Static obligations of generated cells"
MACHINES: Final = (10, 100, 1_000)
SECONDS_MAX: Final = 60.0
RATIO_MAX: Final = 1.5


COMPETITORS: Final = (10, 100, 1_000, 2_000)


def jobs(n: int) -> Net:
    """A robot whose n jobs take turns, at the machines of two controllers."""
    return _competing("jobs", [(("a.robot",), (f"{'ab'[i % 2]}.job{i}",)) for i in range(n)])


def pigeons(n: int) -> Net:
    """About n transitions, one from each of some pigeons to each of as many holes."""
    k = round(n**0.5)
    return _competing("pigeons", [((f"a.pigeon{i}",), (f"b.hole{j}",)) for i in range(k) for j in range(k)])


def chain(n: int) -> Net:
    """n transitions, each of which shares a place with either neighbour."""
    return _competing("chain", [((f"{'ab'[i % 2]}.p{i}", f"{'ba'[i % 2]}.p{i + 1}"), ()) for i in range(n)])


def _competing(name: str, arcs: list[tuple[tuple[str, ...], tuple[str, ...]]]) -> Net:
    """The net of these inputs and outputs, whose transitions are one group that takes turns."""
    inputs = dict.fromkeys(place for taken, _ in arcs for place in taken)
    outputs = dict.fromkeys(place for _, filled in arcs for place in filled)
    places = [Place(place, place[0], marked=place in inputs) for place in (*inputs, *outputs)]
    transitions = []
    for i, (taken, filled) in enumerate(arcs):
        owners = {place[0] for place in (*taken, *filled)}
        transitions.append(Transition(f"t{i}" if len(owners) > 1 else f"{min(owners)}.t{i}", taken, filled))
    return Net(
        f"{name}-{len(arcs)}",
        tuple(places),
        tuple(transitions),
        controllers=(Controller("a"), Controller("b")),
        arbiters=(Arbiter("turns", tuple(t.name for t in transitions), ArbitrationRule.ROTATION),),
    )


def proved(net: Net) -> tuple[Decomposition, ProofReport]:
    """The split of a net and its proofs."""
    decomposition = split(net)
    return decomposition, prove(decomposition)


def checked_again(decomposition: Decomposition, proof: ProofReport) -> int:
    """How many verdicts of a proof are shown by cvc5."""
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    check_obligations(examination, check_cut(decomposition), "cvc5", by_cvc5, 60_000)
    return sum(one.shown for one in examination.checked.values())


def with_curves(of_cells: Table) -> Table:
    """The table of generated cells, its curve drawn under it."""
    return replace(of_cells, drawn=curves(of_cells, "Split and prove", "prove, s", "ms/transition"))


def tables(repeat: int) -> list[Table]:
    """One row for each size."""
    cells = [family_net(f"workshop-{machines}") for machines in MACHINES]
    columns = (
        "net", "transitions", "obligations", "prove, s", "ms/transition", "x smallest", "check again, s", "x smallest",
        "all shown",
    )  # fmt: skip
    says = (
        "Seconds to split and prove, milliseconds a transition, and these as a multiple of the smallest net's; "
        "seconds to state it anew, compare and have cvc5 answer, and the same multiple; whether all is shown. The "
        "theorem on the protocol, which is the same for every net, is left out of all times."
    )
    of_cells = Table(
        CELLS,
        "The family `workshop`: machines in cells of four, ten transitions each, which share robots and conveyors. "
        + says,
        columns,
        tuple(_rows(cells, repeat, 0)),
    )
    return [
        with_curves(of_cells),
        Table(
            "Static obligations where many compete",
            "All transitions of a net are one group that takes turns: jobs of one robot, pigeons and holes, a chain. "
            f"{says} The multiples are of the net "
            "with about a hundred.",
            columns,
            tuple(row for make in (jobs, pigeons, chain) for row in _rows(map(make, COMPETITORS), repeat, 1)),
        ),
    ]


@dataclass(frozen=True)
class _Measured:
    """A net, what its proof and checking it again took, and whether all is shown."""

    net: Net
    obligations: int
    seconds: float
    seconds_again: float
    shown: bool


def _measured(net: Net, repeat: int) -> _Measured:
    theorem(60_000)  # the same for every net, and found once in a process: no part of what grows
    runs = [timed(partial(proved, net)) for _ in range(repeat)]
    decomposition, proof = runs[0][0]
    again = [timed(partial(checked_again, decomposition, proof)) for _ in range(repeat)]
    shown = proof.holds and again[0][0] == len(proof.verdicts) - len(blocks())
    return _Measured(net, len(proof.verdicts), min(s for _, s in runs), min(s for _, s in again), shown)


def _rows(nets: Iterable[Net], repeat: int, first: int) -> Iterator[tuple[str, ...]]:
    """A row for each net, with its times as multiples of those of the one with this index."""
    measured = [_measured(net, repeat) for net in nets]
    base = measured[first]
    for one in measured:
        n = len(one.net.transitions)
        smaller = n < len(base.net.transitions)
        per = one.seconds / n, one.seconds_again / n
        of_base = (base.seconds / len(base.net.transitions), base.seconds_again / len(base.net.transitions))
        times = [mine / its for mine, its in zip(per, of_base, strict=True)]
        yield (
            one.net.name, f"{n:,}", f"{one.obligations:,}",
            f"{one.seconds:.2f} (<= {SECONDS_MAX:g}: {MET if one.seconds <= SECONDS_MAX else MISSED})",
            f"{per[0] * 1e3:.2f}", _of_base(times[0], smaller=smaller),
            f"{one.seconds_again:.2f}", _of_base(times[1], smaller=smaller),
            "yes" if one.shown else "no",
        )  # fmt: skip


def _of_base(ratio: float, *, smaller: bool) -> str:
    """A multiple of the base's time; the goal is for nets that are larger."""
    return f"{ratio:.2f}" if smaller else f"{ratio:.2f} (<= {RATIO_MAX:g}: {MET if ratio <= RATIO_MAX else MISSED})"
