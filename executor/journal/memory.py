"""What a host remembers of others, in its journal, and what its journal is called (`links.link.Memory`).

A journal gets its name when it is made, at random, and keeps it; by what storages the others went is added as they are
met, and how old those were as that is heard. A takeover makes the journals of all hosts at once, so that they know each
other from the beginning.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Final

from firable.executor.links.link import Memory, Storage
from firable.executor.protocol.messages import Keep, Stored

HOSTS: Final = "\nhosts"
"""The name under which the journal keeps it; no machine has it."""

_STORAGE: Final = "storage"
_OF: Final = "of/"


def new_name() -> str:
    """A name for a journal, or for a life of it, that nothing else has."""
    return os.urandom(4).hex()


def remembered(kept: Mapping[str, Stored], age: int) -> Memory:
    """The memory that a journal of this age has kept, in a new life; of nobody and by a new name where it kept none."""
    known = {key.removeprefix(_OF): Storage.read(str(of)) for key, of in kept.items() if key.startswith(_OF)}
    return Memory(Storage(str(kept.get(_STORAGE) or new_name()), new_name(), age), known)


def keeping(memory: Memory) -> list[Keep]:
    """What keeps a memory."""
    return [Keep(_STORAGE, memory.storage.name), *(Keep(f"{_OF}{name}", str(of)) for name, of in memory.known.items())]
