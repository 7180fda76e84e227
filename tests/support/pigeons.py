"""A claim that is true and that no solver shows in a moment: the pigeonhole principle."""

from firable.analysis.evidence.certificate import InductiveInvariant
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.nets.formula import And, Compare, Count, Holds, Or, Sign
from firable.nets.net import Net, Place
from firable.semantics.trace import Discipline


def pigeon_evidence(holes: int = 11) -> Evidence:
    """No marking has each of `holes + 1` pigeons in a hole and no two pigeons in one."""
    names = [[f"pigeon{p}.hole{h}" for h in range(holes)] for p in range(holes + 1)]
    net = Net("pigeons", tuple(Place(name) for row in names for name in row))
    housed = (Or(tuple(map(Holds, row))) for row in names)
    alone = (Compare(Count(tuple(row[h] for row in names)), Sign.AT_MOST, Count(added=1)) for h in range(holes))
    claim = Claim(ClaimKind.NEVER, And((*housed, *alone)))
    return Evidence(net, Discipline.INTERLEAVING, claim, InductiveInvariant())
