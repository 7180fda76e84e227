"""What a host remembers of others, in its journal, and what its journal is called (`links/storages.py`).

A journal gets its name when it is made, at random, and keeps it; by what storages the others went is added as they are
met. A takeover makes the journals of all hosts at once, so that they know each other from the beginning.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Final

from firable.executor.links.storages import Memory, Met, Storage
from firable.executor.protocol.messages import Keep, Stored

HOSTS: Final = "\nhosts"
"""The name under which the journal keeps it; no machine has it."""

_STORAGE: Final = "storage"
_SINCE: Final = "since"
_OF: Final = "of/"


def new_name() -> str:
    """A name for a journal, or for a life of it, that nothing else has."""
    return os.urandom(4).hex()


def remembered(kept: Mapping[str, Stored]) -> Memory:
    """The memory that a journal has kept; of nobody, and with a new name, where it has kept none."""
    known = {key.removeprefix(_OF): Met.read(str(met)) for key, met in kept.items() if key.startswith(_OF)}
    return Memory(Storage.read(str(kept.get(_STORAGE) or new_name())), known)


def ended_at(kept: Mapping[str, Stored], age: int) -> int:
    """How old a journal of this age was when its last life ended; since then nobody has let its process in."""
    since = kept.get(_SINCE)
    return since if isinstance(since, int) else age


def keeping_end(age: int | None) -> list[Keep]:
    """What keeps that the last life ended at this age; None where the present one has begun."""
    return [Keep(_SINCE, age)]


def keeping(memory: Memory) -> list[Keep]:
    """What keeps a memory."""
    return [
        Keep(_STORAGE, str(memory.storage)),
        *(Keep(f"{_OF}{name}", str(met)) for name, met in memory.known.items()),
    ]
