"""A goal: is a marking reachable in which a state formula holds? The question that most methods answer.

Contact, deadlock, a dead transition, a conflict, two commands at once and the properties `never`, `always` and
`reachable` are all of this kind. So every technique that decides it, by whatever means, is one function

    decide_by_...(net: Net, goal: Formula, limits: Limits) -> Finding

and the race (`firable.analysis.race`) may run any of them. A finding is an answer with what it rests on: a firing
sequence where the goal is reachable, and where it is not a certificate that can be checked without the technique that
found it (where the technique has one). Not decided is an answer too, with how far was looked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from firable.analysis.deadline import Deadline
from firable.nets.verdict import Cost, Witness

if TYPE_CHECKING:
    from firable.analysis.evidence.certificate import Certificate


DEPTH_MAX: Final = 1_000
"""How many steps a search that unrolls runs looks ahead at most."""


def _nobody(_words: str) -> None:
    """Hear what nobody wants to be told."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a technique may take: until when (or until it is cancelled), how many bytes, and how long runs it unrolls.

    Of two `threads` the second works while `second_free` says that a processor is free for it, if that is given. `tell`
    is told in words how far it is.
    """

    deadline: Deadline = field(default_factory=Deadline)
    memory_bytes: int = 2 * 2**30
    depth_max: int = DEPTH_MAX
    threads: int = 1
    second_free: Callable[[], bool] | None = field(default=None, compare=False)
    tell: Callable[[str], object] = field(default=_nobody, compare=False)


@dataclass(frozen=True, slots=True)
class Finding:
    """Whether the goal is reachable (None: not decided), by which method, with its evidence.

    `witness` is a firing sequence into the goal, replayed by the reference player; `certificate` shows that there is
    none, to `firable.analysis.evidence.checking.checker`; `bound` says how far an undecided search went.
    """

    reachable: bool | None
    method: str
    witness: Witness | None = None
    bound: str = ""
    cost: Cost = field(default_factory=Cost)
    certificate: Certificate | None = None
