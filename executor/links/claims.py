"""Who is heard on a link without a middle: hosts claim their machines, and each answers every other one.

A host claims its machines, all at once, for as long as it is there. Every other one answers it: *heard*; the *second*
that claims one of them, and not heard before the first is gone; or not the one that was met, because its storage is
another one (*estranged*) or an older copy (*outdated*; `storages.py`). Two hosts are connected when each hears the
other: what one of them refuses the other has to know before it moves anything, and so does the person who has started
it. Whoever is heard stays heard while it is there.

Claims and answers of one host may come in any order, and so may those of several. What carries them is the link's; this
only knows what follows from them.

Rejected: a claim and an answer for each machine. A host could then be known by one machine before another one shows
that it is to be refused, and would be remembered by that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from firable.executor.links.link import LinkListener, come_back_without, run_by_two
from firable.executor.links.standing import Standing
from firable.executor.links.storages import Estranged, Storage


class Answer(StrEnum):
    """What a host says to another one that claims machines."""

    HEARD = "heard"
    SECOND = "second"
    ESTRANGED = "estranged"
    OUTDATED = "outdated"


@dataclass(frozen=True, slots=True)
class Said:
    """An answer, and the machines of the other host that it is because of."""

    answer: Answer
    machines: tuple[str, ...]

    @property
    def is_heard(self) -> bool:
        """Whether the other host is heard."""
        return self.answer is Answer.HEARD

    @property
    def estranged(self) -> Estranged:
        """Why it is not the host that was met, if the answer says so."""
        return Estranged(self.machines, is_older=self.answer is Answer.OUTDATED)


class Claims:
    """Whom a host hears, and who hears it; `say` has a session told the answer to it, or that taken back by None."""

    def __init__(self, listener: LinkListener, say: Callable[[str, Said | None], None]) -> None:
        self.listener = listener
        self.say = say
        self.machines: dict[str, tuple[str, ...]] = {}
        """What each session claims, in the order in which they came."""
        self.storages: dict[str, Storage] = {}
        """What each says of the storage of its host."""
        self.standings: dict[str, Standing] = {}
        """How the host of each stands, as far as it has said."""
        self.given: dict[str, Said] = {}
        """What each session is answered."""
        self.taken: dict[str, Said] = {}
        """What each session answers, if it does."""
        self.reached: dict[str, str] = {}
        """For each machine that is connected its session."""
        self.told: dict[str, Said] = {}
        """What sessions answer that refuse this host, as it was told."""

    def claimed(self, session: str, machines: Sequence[str], storage: Storage) -> None:
        """A session of a host with this storage claims its machines."""
        self.machines[session], self.storages[session] = tuple(machines), storage
        self._settle()

    def given_up(self, session: str) -> None:
        """A session is gone."""
        self.standings.pop(session, None)
        if session not in self.machines:
            return
        self._connect(session, is_connected=False)
        del self.machines[session], self.storages[session], self.given[session]
        self.told.pop(session, None)
        self.say(session, None)
        self._settle()

    def answered(self, session: str, said: Said, *, taken_back: bool = False) -> None:
        """A session has answered this host, or takes that answer back."""
        if not taken_back:
            self.taken[session] = said
        elif self.taken.get(session) == said:  # and no newer one
            del self.taken[session]
        self._settle()

    def stands(self, session: str, standing: Standing) -> None:
        """The host of a session stands so from now on."""
        was, self.standings[session] = self.standings.get(session, Standing.GOING), standing
        for name in self.machines.get(session, ()):
            if standing is not was and self.reached.get(name) == session:
                self.listener.stands(name, standing)

    def _settle(self) -> None:
        for session in self.machines:
            self._give(session, self._answer(session))
            taken = self.taken.get(session)
            both = self.given[session].is_heard and taken is not None and taken.is_heard
            self._connect(session, is_connected=both)
            self._tell_against(session, taken)

    def _answer(self, session: str) -> Said:
        given = self.given.get(session)
        if given is not None and given.is_heard:
            return given
        machines = self.machines[session]
        heard = {name for other, said in self.given.items() if said.is_heard for name in self.machines[other]}
        if second := [name for name in machines if name in heard]:
            return Said(Answer.SECOND, tuple(second))
        if why := self.listener.memory.estranged(machines, self.storages[session]):
            return Said(Answer.OUTDATED if why.is_older else Answer.ESTRANGED, why.machines)
        return Said(Answer.HEARD, machines)

    def _give(self, session: str, said: Said) -> None:
        if self.given.get(session) == said:
            return
        self.given[session] = said
        self.say(session, said)
        if not said.is_heard:
            is_second = said.answer is Answer.SECOND
            why = run_by_two(said.machines) if is_second else come_back_without(said.estranged)
            self.listener.refused(self.machines[session], why)

    def _connect(self, session: str, *, is_connected: bool) -> None:
        for name in self.machines[session]:
            if is_connected and name not in self.reached:
                self.reached[name] = session
                self.listener.connected(name, self.storages[session])
                if (standing := self.standings.get(session, Standing.GOING)) is not Standing.GOING:
                    self.listener.stands(name, standing)
            elif not is_connected and self.reached.get(name) == session:
                del self.reached[name]
                self.listener.lost(name)

    def _tell_against(self, session: str, taken: Said | None) -> None:
        """Tell that a session refuses this host, once, unless it is refused itself: of an older copy it is right."""
        if taken is None or taken.is_heard:
            self.told.pop(session, None)
            return
        is_right = self.given[session].is_heard or taken.answer is Answer.OUTDATED
        if is_right and self.told.get(session) != taken:
            self.told[session] = taken
            if taken.answer is Answer.SECOND:
                self.listener.refused(self.machines[session], run_by_two(taken.machines))
            else:
                self.listener.disowned(self.machines[session], taken.estranged)
