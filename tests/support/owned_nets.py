"""Random nets in which everything has an owner, for the split and the protocol: those of the simulation.

`owned_nets` is for properties, whose failures are shrunk; `owned_net` is for a search over seeds.
"""

from hypothesis import strategies as st

from firable.executor.simulation.drawn import drawn_net, owned_net
from firable.nets.net import Net

__all__ = ["owned_net", "owned_nets"]


def owned_nets() -> st.SearchStrategy[Net]:
    """The nets of `drawn_net`, with every choice left to hypothesis."""
    return st.randoms(use_true_random=False).map(lambda draw: drawn_net(draw, "random"))
