"""What a host remembers of others, in its journal, and what its journal is called (`links/storages.py`).

A journal gets its name when it is made, at random, and keeps it; by what storages the others went is added as they are
met. A takeover makes the journals of all hosts at once, so that they know each other from the beginning.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
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


def remembered(kept: Mapping[str, Stored], age: int) -> Memory:
    """The memory that a journal of this age has kept, in a new life; of nobody and by a new name where it kept none.

    The new life begins where the last one ended: what processes have kept since that nobody let in is of none.
    """
    known = {key.removeprefix(_OF): Met.read(str(met)) for key, met in kept.items() if key.startswith(_OF)}
    since = kept.get(_SINCE)
    ended = since if isinstance(since, int) else age
    return Memory(Storage.read(str(kept.get(_STORAGE) or new_name())).in_new_life(new_name(), ended), known)


def keeping_no_life(memory: Memory) -> list[Keep]:
    """What keeps a memory whose present life has not begun: nobody has let it in."""
    storage = replace(memory.storage, lives=memory.storage.lives[:-1])
    return [Keep(_STORAGE, str(storage)), Keep(_SINCE, memory.storage.lives[-1].began)]


def keeping(memory: Memory) -> list[Keep]:
    """What keeps a memory."""
    known = (Keep(f"{_OF}{name}", str(met)) for name, met in memory.known.items())
    return [Keep(_STORAGE, str(memory.storage)), Keep(_SINCE, None), *known]
