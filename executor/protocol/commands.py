"""The commands of one controller: which were issued, which are completed, and what a restart has to find out.

A command is issued once for each entry of a token, and numbered: `entry` counts the commands that share a completion
signal, or those of a place whose command has none. Of each such count only the newest command matters, since a
completion of an earlier one is stale. So one record a count is kept, under `command/...`: the place, the entry, and how
far it has come. Where two places share a completion and are entered together, the earlier command has a record of its
own, until the completion comes that is that of both. They are sent, and asked after, in their order, so that a device
which takes one after the other has done the earlier before the later. A net in which both wait at once may not run
(`shared-completions` must be proved): there the earlier is one whose time was over, whose token has left, and which its
machine may still be at. The nets that the simulation draws have all of it. A command is

- *issued*: it was handed on to be sent. It may have been sent, or not, or half: who crashed cannot know;
- *owed*: its token entered while the controller was held after a restart, and it was not handed on yet;
- *over*: its completion has been taken into the process image or, where it has none, the driver has taken it.

Why it is kept, and before the command leaves: a machine that gets a command twice may put a second workpiece on the
first, and one that never gets it waits for ever. So after a restart each issued command is asked after (`questions`),
at its driver, and where that does not know, at the operator; nothing is guessed and nothing is sent until every answer
is there. An issued command that was not received is sent again under the same number, so that a driver which has
received it after all can tell.

A command without a completion that its driver has not taken holds its token back: `unsent`. Otherwise the token could
enter and leave between two syncs, and a crash before the command is sent would lose it, because after the restart a
command whose token has gone on is void.

Rejected: to keep each command until it is over and delete it then. Its number would have to be kept beside it, for the
next one; the record that stays is both, and there are never more of them than signals and places.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from types import MappingProxyType
from typing import Final

from firable.executor.protocol.messages import Effect, Keep, ProtocolError, Sending, Stored
from firable.nets.net import Net, Place

PREFIX: Final = "command/"


class Answer(StrEnum):
    """What a driver, or an operator, says of a command that was issued before a restart."""

    DONE = "done"
    WORKING = "working"
    NOT_RECEIVED = "not received"
    UNKNOWN = "unknown"


SAID: Final = {answer.value.replace(" ", "-"): answer for answer in Answer if answer is not Answer.UNKNOWN}
"""What an operator may say, by the word that is typed for it."""


class Stage(StrEnum):
    """How far a command has come."""

    ISSUED = "issued"
    OWED = "owed"
    OVER = "over"


@dataclass(slots=True)
class Command:
    """The newest command of its count; `answer` says what became of one that was issued before a restart."""

    place: str
    entry: int
    stage: Stage
    answer: Answer | None = None


_STORED: Final = {stage: stage.value for stage in Stage}
"""As stable storage holds them."""


class Commands:
    """The commands of a subnet, none issued yet, or as they were kept."""

    def __init__(self, subnet: Net, kept: Mapping[str, Stored]) -> None:
        self.subnet = subnet
        shared: dict[str, list[str]] = {}
        for sender in subnet.places:
            if sender.command is not None and sender.completion is not None:
                shared.setdefault(sender.completion, []).append(_place_key(sender.name))
        self.beside = MappingProxyType(
            {completion: tuple(keys) for completion, keys in shared.items() if len(keys) > 1}
        )
        """Under which keys earlier commands stand that a signal completes as well."""
        self.newest: dict[str, Command] = {}
        """By the key under which each is kept."""
        for key, value in kept.items():
            match value:
                case [str(place), int(entry), str(stage)] if key.startswith(PREFIX):
                    answer = Answer.UNKNOWN if stage == Stage.ISSUED else None
                    self.newest[key] = Command(place, entry, Stage(stage), answer)

    @property
    def questions(self) -> tuple[tuple[str, int], ...]:
        """The place and entry of each command that nobody could tell yet to be received or not, in their order."""
        return tuple((c.place, c.entry) for _, c in self._in_order() if c.answer is Answer.UNKNOWN)

    @property
    def owed(self) -> tuple[tuple[str, int], ...]:
        """The place and entry of each command that will be sent when the controller is resumed, in their order."""
        return tuple((c.place, c.entry) for _, c in self._in_order() if _is_owed(c))

    @property
    def unsent(self) -> tuple[str, ...]:
        """The places whose command has no completion, and which no driver is known to have taken yet."""
        open_ = (command.place for command in self.newest.values() if command.stage is not Stage.OVER)
        return tuple(place for place in open_ if self.subnet.place(place).completion is None)

    def entry(self, completion: str) -> int:
        """The entry of the newest command that this signal completes; 0 before the first."""
        newest = self.newest.get(_signal_key(completion))
        return newest.entry if newest is not None else 0

    def enter(self, place: Place, *, held: bool) -> list[Effect]:
        """A token enters a place with a command: issue it or, in a controller that is held, owe it."""
        effects: list[Effect] = []
        name = place.name
        key = _place_key(name) if place.completion is None else _signal_key(place.completion)
        earlier = self.newest.get(key)
        if place.completion is not None:
            if earlier is not None and earlier.place != name and earlier.stage is not Stage.OVER:
                beside = _place_key(earlier.place)
                self.newest[beside] = earlier
                effects.append(self._kept(beside))
            effects += self._over(_place_key(name))
        entry = earlier.entry + 1 if earlier is not None else 1
        stage = Stage.OWED if held else Stage.ISSUED
        self.newest[key] = Command(name, entry, stage)
        effects.append(Keep(key, (name, entry, _STORED[stage])))
        if not held:
            effects.append(Sending(name, entry))
        return effects

    def completed(self, completion: str) -> list[Effect]:
        """The completion signal of the newest command has been taken into the process image."""
        effects = self._over(_signal_key(completion))
        for key in self.beside.get(completion, ()):
            effects += self._over(key)
        return effects

    def sent(self, place: str, entry: int) -> list[Effect]:
        """The driver has taken a command: one without a completion signal is over with that."""
        newest = self.newest.get(_place_key(place))
        if newest is None or newest.entry != entry or self.subnet.place(place).completion is not None:
            return []
        return self._over(_place_key(place))

    def answer(self, place: str, entry: int, answer: Answer) -> bool:
        """Take what is said of a command issued before the restart; False where it is not asked after (any more)."""
        for command in self.newest.values():
            if (command.place, command.entry, command.answer) == (place, entry, Answer.UNKNOWN):
                command.answer = answer
                return True
        return False

    def resume(self, marked: frozenset[str]) -> Iterator[Effect]:
        """Send what is owed; a command whose token has left its place meanwhile is void.

        After a crash between two that share a completion, and out of order, the completion of the newest would be taken
        for that of one which was never sent.
        """
        if self.questions:
            raise ProtocolError(f"resumed without knowing what became of {self.questions}")
        for key, command in self._in_order():
            if _is_owed(command) and command.place not in marked:
                yield from self._over(key)
            elif command.stage is Stage.OWED:
                command.stage = Stage.ISSUED
                yield self._kept(key)
                yield Sending(command.place, command.entry)
            elif _is_owed(command):
                command.answer = None
                yield Sending(command.place, command.entry, again=True)

    def _in_order(self) -> list[tuple[str, Command]]:
        """All that are not over, by their keys; those that share a completion by their entries, where the first stands.

        The place of one that is over may be none any more: after a takeover, by which its number goes on.
        """
        open_ = [(key, command) for key, command in self.newest.items() if command.stage is not Stage.OVER]
        first: dict[str, int] = {}
        for _, command in open_:
            first.setdefault(self._count_of(command), len(first))
        return sorted(open_, key=lambda kept: (first[self._count_of(kept[1])], kept[1].entry))

    def _count_of(self, command: Command) -> str:
        return self.subnet.place(command.place).completion or command.place

    def _over(self, key: str) -> list[Effect]:
        command = self.newest.get(key)
        if command is None or command.stage is Stage.OVER:
            return []
        command.stage, command.answer = Stage.OVER, None
        return [self._kept(key)]

    def _kept(self, key: str) -> Keep:
        command = self.newest[key]
        return Keep(key, (command.place, command.entry, _STORED[command.stage]))


@cache
def _signal_key(completion: str) -> str:
    return f"{PREFIX}signal/{completion}"


@cache
def _place_key(place: str) -> str:
    return f"{PREFIX}place/{place}"


def _is_owed(command: Command) -> bool:
    return command.stage is Stage.OWED or command.answer is Answer.NOT_RECEIVED
