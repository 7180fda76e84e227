"""Who is heard on a link without a middle: processes claim machines, and each host answers every one of them.

A process claims its machines for as long as it is there. Every other host answers for each: *heard*; the *second*
that claims the machine, and not heard before the first is gone; or *estranged*, because its storage is not the one with
which the machine was met (`link.Memory`). Two hosts are connected when each hears all machines of the other: what one
of them refuses the other has to know before it moves anything, and so does the person who has started it.

What carries claims and answers is the link's; this only knows what follows from them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Final

from firable.executor.links.link import (
    LinkListener,
    Memory,
    come_back_without,
    known_otherwise,
    run_by_two,
)


class Answer(StrEnum):
    """What a host says to a process that claims a machine."""

    HEARD = "heard"
    SECOND = "second"
    ESTRANGED = "estranged"


_JOINED: Final = "-"


def session_of(process: str, storage: str) -> str:
    """The name of a process of a host with this storage: what it claims machines by."""
    return f"{process}{_JOINED}{storage}"


def storage_of(session: str) -> str:
    """The storage of the host that a session is of."""
    return session.partition(_JOINED)[2]


class Claims:
    """What the host of the machines `names` hears of others; `say` has an answer told, or taken back where it is None.

    Who says it, and to whom: a machine and the session that claims it.
    """

    def __init__(
        self, names: Sequence[str], listener: LinkListener, say: Callable[[str, str, Answer | None], None]
    ) -> None:
        self.names = names
        self.listener = listener
        self.say = say
        self.sessions: dict[str, list[str]] = {}
        """For each machine the sessions that claim it, in the order in which they came."""
        self.given: dict[tuple[str, str], Answer] = {}
        """What was answered, to a machine of a session."""
        self.taken: dict[str, dict[str, Answer]] = {}
        """What each session has answered, to the machines here."""
        self.reached: dict[str, str] = {}
        """For each machine that is connected its session."""
        self.told: set[tuple[str, str]] = set()
        """The machines and sessions of which it was told that they refuse this host."""

    def claimed(self, machine: str, session: str) -> None:
        """A session claims a machine."""
        sessions = self.sessions.setdefault(machine, [])
        if session not in sessions:
            sessions.append(session)
        for claimed in self._claimed_by(session):
            self._settle(claimed)

    def given_up(self, machine: str, session: str) -> None:
        """A session is gone, or claims a machine no more."""
        if session in self.sessions.get(machine, ()):
            self.sessions[machine].remove(session)
        if self.given.pop((machine, session), None) is not None:
            self.say(machine, session, None)
        self.told.discard((machine, session))
        self._settle(machine)

    def answered(self, own: str, session: str, answer: Answer, *, taken_back: bool = False) -> None:
        """A session has answered a machine here, or takes that answer back."""
        answers = self.taken.setdefault(session, {})
        if not taken_back:
            answers[own] = answer
        elif answers.get(own) is answer:  # and no newer one
            del answers[own]
        if not answers:
            del self.taken[session]
        for machine in self._claimed_by(session):
            self._settle(machine)

    def _settle(self, machine: str) -> None:
        heard = ""
        for session in self.sessions.get(machine, ()):
            answer = Answer.SECOND if heard else self._answer(session)
            heard = session if answer is Answer.HEARD else heard
            self._give(machine, session, answer)
            self._told_against(machine, session)
        answers = self.taken.get(heard, {})
        reached = heard if all(answers.get(own) is Answer.HEARD for own in self.names) else ""
        if (was := self.reached.get(machine, "")) != reached:
            if was:
                del self.reached[machine]
                self.listener.lost(machine)
            if reached:
                self.reached[machine] = reached
                self.listener.connected(machine, storage_of(reached))

    def _claimed_by(self, session: str) -> list[str]:
        return [machine for machine, sessions in self.sessions.items() if session in sessions]

    def _answer(self, session: str) -> Answer:
        theirs = Memory(storage_of(session))
        is_another = theirs.met_otherwise(self._claimed_by(session), by=self.listener.memory)
        return Answer.ESTRANGED if is_another else Answer.HEARD

    def _give(self, machine: str, session: str, answer: Answer) -> None:
        if self.given.get((machine, session)) is answer:
            return
        self.given[machine, session] = answer
        self.say(machine, session, answer)
        if answer is not Answer.HEARD:
            why = run_by_two if answer is Answer.SECOND else come_back_without
            self.listener.refused(machine, why([machine]))

    def _told_against(self, machine: str, session: str) -> None:
        """Tell that a session refuses this host, once, unless it is refused itself."""
        answers = self.taken.get(session, {})
        against = [own for own, answer in answers.items() if answer is not Answer.HEARD]
        if not against:
            self.told.discard((machine, session))
        elif self.given[machine, session] is Answer.HEARD and (machine, session) not in self.told:
            self.told.add((machine, session))
            if estranged := [own for own in against if answers[own] is Answer.ESTRANGED]:
                self.listener.disowned(machine, known_otherwise(estranged, machine))
            else:
                self.listener.refused(machine, run_by_two(against))
