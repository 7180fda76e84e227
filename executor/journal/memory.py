"""What a host remembers of others, in its journal, and what its journal is called (`links.link.Memory`).

A journal gets its name when it is made, at random, and keeps it; by what names the others went is added as they are
met. A takeover makes the journals of all hosts at once, so that they know each other from the beginning.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Final

from firable.executor.links.link import Memory
from firable.executor.protocol.messages import Keep, Stored

HOSTS: Final = "\nhosts"
"""The name under which the journal keeps it; no machine has it."""

_STORAGE: Final = "storage"
_OF: Final = "of/"


def new_storage() -> str:
    """A name for a journal that nothing else has."""
    return os.urandom(4).hex()


def remembered(kept: Mapping[str, Stored]) -> Memory:
    """The memory that a journal has kept; one with a new name, and of nobody, where it has kept none."""
    known = {key.removeprefix(_OF): str(storage) for key, storage in kept.items() if key.startswith(_OF)}
    return Memory(str(kept.get(_STORAGE) or new_storage()), known)


def keeping(memory: Memory) -> list[Keep]:
    """What keeps a memory."""
    return [Keep(_STORAGE, memory.storage), *(Keep(f"{_OF}{name}", of) for name, of in memory.known.items())]
