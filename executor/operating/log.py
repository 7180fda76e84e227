"""The log of a host: what happens to it, with a level and the time of day, for whoever collects the logs of a site.

The trace tells everything, and is judged; who looks after forty hosts wants the few lines that mean something, in a
form that their collector reads. So the log is what the trace notes beside firings, votes, signals and commands (who was
lost, what failed, who commanded what), one JSON object a line, with how the run began and how it ended, and what waited
for what then. It is told at once and not behind the journal: nothing is judged by it.

Levels, times and files are those of Python's `logging`, with a logger that is in no registry: two hosts in one process
do not write into each other. Rejected: a logging library for structures. It brings a second way to configure levels and
handlers, for what is one formatter here.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

from firable.executor.operating.aside import UntoldError
from firable.executor.operating.disk_watch import HANGS
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.watching import UNWATCHED
from firable.semantics.joining import APPLIED, STANDS, VOTED
from firable.semantics.trace import Event, Noted

FROZEN: Final = "frozen"
"""The kind of note of a time in which this process did not run."""

TURNED_AWAY: Final = "not let in"
"""The kind of note of somebody who would act on the run, and has shown that they may not."""

NOT_OBEYED: Final = "not obeyed"
"""The kind of note of a command of an operator that was refused."""

UNHANDLED: Final = "unhandled"
"""The kind of note of an error that nobody has handled, in a callback of a library most of all."""

LEVELS: Final[Mapping[str, int]] = MappingProxyType(
    {
        **dict.fromkeys(("fault", "divergence", "emergency stop", "latched", HANGS), logging.ERROR),
        **dict.fromkeys(
            ("lost", "refused", "never-met", "dropped", "held", "unasked", "withdrawn", "untold"), logging.WARNING
        ),
        **dict.fromkeys((FROZEN, TURNED_AWAY, NOT_OBEYED, UNWATCHED, UNHANDLED), logging.WARNING),
    }
)
"""The level of each kind of note; of all others it is `info`."""


class JsonLines(logging.Formatter):
    """A record as one JSON object: `time` (UTC), `level`, `event`, and what is known of it."""

    def format(self, record: logging.LogRecord) -> str:
        """The line."""
        seconds = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        data = record.args if isinstance(record.args, Mapping) else {}
        head = {"time": f"{seconds}.{int(record.msecs):03}Z", "level": record.levelname.lower(), "event": record.msg}
        return json.dumps({**head, **data}, ensure_ascii=False)


def logger_to(handler: logging.Handler) -> logging.Logger:
    """A logger of a host, that writes JSON lines to this handler alone."""
    handler.setFormatter(JsonLines())
    logger = logging.Logger("firable", logging.INFO)
    logger.addHandler(handler)
    return logger


class Log:
    """What a host tells its log."""

    def __init__(self, logger: logging.Logger) -> None:
        self.logger = logger

    def began(self, net: str, machines: Iterable[str], **known: object) -> None:
        """The host has begun to run; `known` is what else there is to say of that."""
        named = [machine or "the coordinator" for machine in machines]
        self._tell(logging.INFO, "began", {"net": net, "machines": named, **known})

    def seen(self, event: Event) -> None:
        """An event of the trace; votes and applications stand there alone."""
        if isinstance(event, Noted) and event.note not in (VOTED, STANDS, APPLIED):
            self._tell(
                LEVELS.get(event.note, logging.INFO), event.note, {"at": round(event.at_seconds, 6), **event.data}
            )

    def ended(self, situation: Situation) -> None:
        """The host has ended; where nobody wanted that, what waited for what stands there."""
        wrong = situation.is_emergency or situation.state not in (State.DONE, State.STOPPED)
        data = {"state": situation.state.value, "message": situation.message, "marking": list(situation.marking)}
        blocked = {"blocked": list(map(str, situation.blocked))} if wrong else {}
        self._tell(logging.ERROR if wrong else logging.INFO, "ended", {**data, **blocked})

    def broke(self, error: BaseException) -> None:
        """The host ends by an error: a disk is full, a link cannot be opened, or the program is wrong."""
        self._tell(logging.ERROR, "broke", {"message": str(error)})

    def untold(self, error: UntoldError) -> None:
        """Lines for the operator that were told to nobody, of which the run did not know before its end."""
        for what, why in error.untold:
            self._tell(logging.WARNING, "untold", {"message": error.sentence((what, why)), "what": what})

    def _tell(self, level: int, event: str, data: Mapping[str, object]) -> None:
        # One mapping as the only argument: `logging` hands it to the formatter as it is.
        self.logger.handle(self.logger.makeRecord(self.logger.name, level, "", 0, event, (data,), None))
