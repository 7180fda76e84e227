"""How a run is conducted: what is the same on a simulated cell, on real machines and on a host among others.

It is said once, where a run is asked for, and goes as one value to its `Host`. Each layer on the way adds what it alone
knows: whether there is a link, which driver the machines have, where the journal goes on.

Rejected: the driver and the link in here too. They are what a run is on, and differ between the ways to run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Final

from firable.executor.operating.log import Log
from firable.executor.operating.recorder import LineStream
from firable.executor.protocol.commands import Answer

if TYPE_CHECKING:
    from firable.executor.operating.running import Operator
    from firable.executor.operating.service import Service

Told = Callable[[str, str], None]
"""Who is told what happens: the kind (`connected`, `lost`, `refused`, `held`, `driver`, ...), and a sentence."""


class Watch(StrEnum):
    """What to do when the machines do what their model excludes: tell, or stop them too; or do not look."""

    TELL = "tell"
    STOP = "stop"
    IGNORE = "ignore"


@dataclass(frozen=True, slots=True, kw_only=True)
class Conduct:
    """How a run is conducted: its files, what is expected of the machines, who acts on it and who is told."""

    trace: LineStream | Path | str | None = None
    journal_path: Path | str | None = None
    resume: bool = False
    """Whether a run that is taken up goes on as soon as each command is accounted for."""
    said: Mapping[str, Answer] = field(default_factory=dict)
    """What the operator has said beforehand of commands that no machine can tell of, by place."""
    watch: Watch = Watch.TELL
    overdue_seconds: float = 120.0
    """A command that is not completed within so long, by the clock of the run, is a fault."""
    operator: Operator | None = None
    service: Service | None = None
    """Where an operator may act from elsewhere, in real time."""
    log: Log | None = None
    """Who is told what the trace notes."""
    tell: Told | None = None
    """Who is told what an operator has to know."""


UNATTENDED: Final = Conduct()
"""Nothing is kept, nobody acts and nobody is told."""
