"""Ports of this host for ends of their own."""

from __future__ import annotations

import random
import socket
from contextlib import suppress

_DEALT = 32_768
"""From here on Linux deals ports to outgoing connections; macOS and Windows begin later."""


def free_port() -> int:
    """A port of this host that nobody listens at, and that no connection is given as its own.

    Whoever tries again and again to reach a port of the other kind where nobody listens yet is connected to himself at
    some time (TCP knows a simultaneous open), hears what he has said, and keeps the port from whom it was meant for.
    """
    for port in random.SystemRandom().sample(range(_DEALT // 2, _DEALT), 1000):
        with suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))  # nor is it still kept by a connection that is over
            return port
    raise OSError(f"no port of this host between {_DEALT // 2} and {_DEALT} is free")
