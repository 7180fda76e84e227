"""What a coordinator and a controller have to say to each other: of the transitions, and the rounds, that are theirs.

Hosts that hold the same bundle say nothing else, and what arrives has been read strictly, so this looks at a host that
is not what it says, or is no longer itself. The machines of the protocol are right by a proof on those who keep to it,
and would stop at a transition that nobody knows; and the coordinator of a layer could end a round of another one, for
a controller knows whose round it is by the number alone. A host that speaks so is not heard, and the others go on.

Rejected: to look in the machines. They are what is proved, and every step of theirs is compared with the proof.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Final

from firable.executor.protocol.deciders import coordinator_at, coordinators
from firable.executor.protocol.messages import Decision, Hello, Message, Vote, VoteRequest
from firable.nets.decomposition import Decomposition

_NOTHING: Final = frozenset[str]()


class Between:
    """What is between each coordinator of a decomposition and each controller."""

    def __init__(self, decomposition: Decomposition) -> None:
        names = coordinators(decomposition)
        self.first_round: Mapping[str, int] = {name: number for number, name in enumerate(names)}
        self.stride = len(names)
        transitions: dict[tuple[str, str], set[str]] = defaultdict(set)
        self.decided: Mapping[str, set[str]] = {name: set() for name in names}
        """For each coordinator, the transitions that it decides."""
        for row in decomposition.coordinated:
            self.decided[coordinator_at(row.at)].add(row.name)
            for part in row.parts:
                transitions[coordinator_at(row.at), part.controller].add(row.name)
        self.transitions = {pair: frozenset(found) for pair, found in transitions.items()}
        """For each coordinator and controller, the transitions that the one decides and the other takes part in."""

    def has(self, message: Message) -> bool:
        """Whether a message speaks of nothing else than what is between its coordinator and its controller."""
        theirs = self.transitions.get((message.coordinator, message.controller))
        if theirs is None:
            return False
        match message:
            case Hello():
                return True
            case VoteRequest():
                return theirs.issuperset(message.transitions) and self._is_round(message.coordinator, message.round)
            case Decision():
                # Who was asked for what lost the arbitration is told the winner, in which it may take no part.
                is_its = message.committed is None or message.committed in self.decided[message.coordinator]
                return is_its and self._is_round(message.coordinator, message.round)
        promised = message.promised if isinstance(message, Vote) else _NOTHING
        return promised <= theirs and message.readiness.transitions <= theirs

    def _is_round(self, coordinator: str, number: int) -> bool:
        return number % self.stride == self.first_round[coordinator]
