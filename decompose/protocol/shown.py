"""The verdicts that the invariant of a protocol net shows, alone or beside an exploration that found them too.

Exploring and the invariant answer the same sentences in ways that have nothing in common. Where both answer, the
verdict is that of the exploration, and the file of the invariant is its evidence; where the net is too large to be
explored, the invariant decides it. That one proves what the other refutes would be a fault of ours, and is told as one.
A bundle needs the evidence alone, so nothing is explored for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Final

from firable.decompose.protocol.building import AGREES, FIT, FOLLOWS, ProtocolNet, protocol_net
from firable.decompose.protocol.exploring import COMPLETE, DIVERGENCE, ONE_TOKEN, STATEMENTS
from firable.decompose.protocol.inductive_script import Proof, prove_inductively
from firable.decompose.protocol.outages import RESUMES, WHILE_FAULTS
from firable.decompose.protocol.variant import ANY_FAULTS, NO_FAULTS, PROTOCOL
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Cost, Status, Verdict

METHOD: Final = "z3, of an inductive invariant of the protocol's net"
FAMILIES: Final = {"explored": NO_FAULTS, "faults": ANY_FAULTS}
"""The families of verdicts on the protocol, and the faults that each allows."""


def file_of(family: str) -> str:
    """The file of the obligations that show a family."""
    return f"{family}.smt2"


def statements(protocol: ProtocolNet) -> Mapping[str, str]:
    """What is asked of a protocol net, by the names of the verdicts without their family."""
    faults = f", {WHILE_FAULTS}" if protocol.faults else ""
    safe = {name: f"{STATEMENTS[name]}{faults}" for name in (FOLLOWS, AGREES, FIT)}
    if not protocol.parts.coordinated:
        del safe[FIT]
    if protocol.faults:
        return {**safe, "resumes": RESUMES}
    others = (COMPLETE, ONE_TOKEN, DIVERGENCE)
    return {**safe, **{one.name.partition(".")[2]: one.statement for one in others}}


def proved_without_exploring(
    decomposition: Decomposition, families: Iterable[str], timeout_ms: int
) -> tuple[tuple[Verdict, ...], dict[str, str]]:
    """The verdicts of these families by the invariant alone, and their files; `timeout_ms` is for each obligation."""
    verdicts, files = list[Verdict](), dict[str, str]()
    for family in families:
        protocol = protocol_net(decomposition, PROTOCOL, FAMILIES[family])
        proof = prove_inductively(protocol, timeout_ms)
        files[file_of(family)] = proof.text
        for name, statement in statements(protocol).items():
            unknown = Verdict(f"{family}.{name}", Status.UNKNOWN, statement, METHOD, bound="z3 gave up")
            verdicts += with_proof([replace(unknown, hint="allow more time")], proof)
    return tuple(verdicts), files


def with_proof(verdicts: Iterable[Verdict], proof: Proof) -> Iterator[Verdict]:
    """The verdicts on a protocol net with the evidence on it; what was unknown is proved where the invariant shows it.

    Raises `RuntimeError` where a verdict is violated that the invariant proves.
    """
    for verdict in verdicts:
        family, _, name = verdict.name.partition(".")
        if not proof.shows(name):
            yield verdict
        elif verdict.status is Status.VIOLATED:
            raise RuntimeError(f"'{verdict.name}' is proved by the invariant, and exploring finds it violated")
        elif verdict.holds:
            yield replace(verdict, evidence=(file_of(family),))
        else:
            yield replace(
                verdict,
                status=Status.PROVED,
                method=METHOD,
                bound="",
                hint="",
                cost=Cost(),
                evidence=(file_of(family),),
            )
