"""Splitting a net over its controllers, proving the parts equal to the whole, and sealing what is proved.

What a program imports from here: `split` gives the `Decomposition` of a net over its controllers; `table_text` is its
coordinator table as the paper prints it. `prove` discharges the obligations, Eq. (7)-(10) and what belongs to them, in
a `ProofReport`. `make_bundle` does all this for a net that `firable.analysis` has checked, and refuses what is not
proved. `explore_protocol` follows every run of a protocol `Variant`, with its kind of `Votes`, under `Faults`, and says
in an `Exploration` whether it does what the central net does.

    from firable.analysis.check import check
    from firable.decompose import make_bundle
    from firable.nets import read_net, write_bundle

    write_bundle("cell.bundle", make_bundle(check(read_net("cell.firable.yaml"))))

The rooms within: `splitting`, `proofs`, `protocol`; what is not named here is imported from their modules.

The names are loaded when they are asked for, so that what checks a bundle (`verification`) runs in a process that holds
nothing of what made it.
"""

from typing import TYPE_CHECKING, Final

from firable.nets.lazy import loaded_when_asked

if TYPE_CHECKING:
    from firable.decompose.bundling import make_bundle
    from firable.decompose.proofs.proving import ProofReport, prove
    from firable.decompose.protocol.exploring import Exploration, explore_protocol
    from firable.decompose.protocol.variant import Faults, Variant, Votes
    from firable.decompose.splitting.cut import split
    from firable.decompose.splitting.table import table_text

__all__ = [
    "Exploration",
    "Faults",
    "ProofReport",
    "Variant",
    "Votes",
    "explore_protocol",
    "make_bundle",
    "prove",
    "split",
    "table_text",
]

_MODULES: Final = {
    "bundling": ("make_bundle",),
    "proofs.proving": ("ProofReport", "prove"),
    "protocol.exploring": ("Exploration", "explore_protocol"),
    "protocol.variant": ("Faults", "Variant", "Votes"),
    "splitting.cut": ("split",),
    "splitting.table": ("table_text",),
}

if not TYPE_CHECKING:  # type checkers read the imports above, and so see a name that is misspelt
    __getattr__ = loaded_when_asked(__name__, _MODULES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
