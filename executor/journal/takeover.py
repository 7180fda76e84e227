"""Taking over: a new bundle goes on from the marking that the old one has stopped in.

A cell is changed while workpieces lie in it: a gate is added, a place commands another program. To empty it first is
often not possible, and to start the new net from its initial marking would be a lie about where the workpieces are. So
the marking is taken over by the names of its places, with what else the journals keep that concerns machines: which
commands are under way, and under which number. What concerns the protocol is not taken over: it must be over.

It is refused unless

- no round is decided and unacknowledged, and no promise is open: a decision of the old net may mean nothing in the new;
- every place with a token is a place of the new net, which sends the same command and waits for the same completion;
- a command that is under way belongs to a place that has the token still, or that gives it up by a time limit in both
  nets (after a restart it is asked after like the others, and never sent again), and its machine gets its commands from
  the same places in both nets: they are numbered by these (`drivers/channels.py`), so that a machine asked by another
  number would not know the command, and be given it again;
- the marking is *reachable* in the new net. What was proved of the new net was proved of its reachable markings, so
  this one condition carries every verdict over. It is decided by whoever asks (`firable takeover` asks the analysis),
  because the executor proves nothing.

The old net allows its own marking, since its run has led there. After a takeover every controller is held, as after any
restart: machines are asked where they are, sensors are read anew, and nothing moves until the operator says so.

Where the cell runs on several hosts each has a journal of its own. All of them are taken over together, so that the
marking is joint, and each machine stays on its host. The new journals know each other (`memory.py`): a host that is
started without its own is refused from the beginning.

Rejected: a map from old to new markings in a file. It would be one more thing to prove, and a name that changes can be
changed in a release of its own, while the cell is empty.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from firable.executor.links.link import called
from firable.executor.protocol.commands import PREFIX, Stage
from firable.executor.protocol.deciders import closed_key
from firable.executor.protocol.messages import EPOCH_BITS, Stored
from firable.executor.protocol.stored_word import pieces, stored_word
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import And, Holds, Not
from firable.nets.net import Net
from firable.nets.source import printable

Kept = Mapping[str, Stored]
"""What the journal of one machine keeps."""


@dataclass(frozen=True, slots=True)
class Takeover:
    """What the journals of the new bundle begin with, by machine, and the marking by the names of its places."""

    kept: Mapping[str, Kept]
    marking: tuple[str, ...]
    under_way: tuple[str, ...]
    """The places whose command was issued and is not known to be completed."""


def take_over(
    old: Decomposition, new: Decomposition, kept: Mapping[str, Kept], coordinators: Iterable[str]
) -> Takeover:
    """The journals of `new` that go on where those of `old`, by machine, have stopped; `coordinators` are the new ones.

    Raises `InputError` F5050 with every reason against it. That the marking is reachable in `new` is for the caller.
    """
    controllers = {subnet.name for subnet in old.subnets}
    moving = _Moving(
        old,
        new,
        {name: of for name, of in kept.items() if name in controllers},
        {name: of for name, of in kept.items() if name not in controllers},
    )
    if problems := list(moving.problems()):
        raise InputError(problems)
    return Takeover(moving.taken_over(coordinators), moving.marking, tuple(moving.commands))


def dealt_out(
    journals: Mapping[str, tuple[str, ...]], old: Iterable[str], new: Iterable[str]
) -> dict[str, tuple[str, ...]]:
    """For each journal of the old cell, with its machines, the controllers of the new cell that go on from it.

    A controller stays where it is; one that only the new cell has goes to the journal of the whole cell, if there is
    one. Raises `InputError` F5050 where a machine of the old cell is in no journal or in two, or a controller of the
    new one has no host.
    """
    problems, before, names = [], tuple(old), tuple(new)
    for name in before:
        holding = [journal for journal, machines in journals.items() if name in machines]
        if not holding:
            hint = "name the journals of all hosts: a marking is taken over whole"
            problems.append(_against(f"none of the journals is of {called(name)}", hint))
        elif len(holding) > 1:
            hint = "name one journal for each host, that of its last run"
            shown = " and ".join(map(printable, holding))
            problems.append(_against(f"{called(name)} is in {len(holding)} journals: {shown}", hint))
    if len(journals) == 1 and not problems:
        return dict.fromkeys(journals, names)
    of = {name: journal for journal, machines in journals.items() for name in machines}
    for name in names:
        if name not in of and name not in before:
            hint = "keep the controllers while the cell runs on several hosts; others can be added while it is empty"
            problems.append(_against(f"no host runs {called(name)}, which only the new net has", hint))
    if problems:
        raise InputError(problems)
    return {journal: tuple(name for name in names if of[name] == journal) for journal in journals}


def formula_of(net: Net, marking: Iterable[str]) -> And:
    """The formula that holds in one marking of a net alone, given by the places with a token.

    >>> from firable.nets.catalogue import catalogue_net
    >>> len(formula_of(catalogue_net("one_robot"), ["robot.free"]).operands)
    28
    """
    held = frozenset(marking)
    return And(tuple(Holds(place.name) if place.name in held else Not(Holds(place.name)) for place in net.places))


@dataclass(frozen=True, slots=True)
class _Command:
    """A command under way: of which place, and what is kept of it."""

    place: str
    entry: int


class _Moving:
    """One takeover."""

    def __init__(
        self, old: Decomposition, new: Decomposition, controllers: Mapping[str, Kept], coordinators: Mapping[str, Kept]
    ) -> None:
        self.old, self.new = old, new
        self.controllers, self.coordinators = controllers, coordinators
        held: list[str] = []
        self.shown: set[str] = set()
        for subnet in old.subnets:
            player, kept = TokenPlayer.of(subnet), controllers.get(subnet.name, {})
            word = stored_word(kept, subnet.initial_marking)
            held += subnet.names(player.marking(word))
            self.shown |= {signal.name for signal in subnet.signals if word & player.signal_bit(signal.name)}
        order = old.net.place_index
        self.marking = tuple(sorted(held, key=order.__getitem__))
        self.commands = {command.place: command for kept in controllers.values() for command in _under_way(kept)}
        self.epoch = max((_epoch(kept) for kept in (*controllers.values(), *coordinators.values())), default=0)

    def problems(self) -> Iterator[Diagnostic]:
        """Why the new bundle may not go on from here."""
        for name, kept in self.coordinators.items():
            if rounds := [key for key in kept if key.startswith("round/")]:
                who = f"'{name}'" if name else "the coordinator"
                yield _against(
                    f"{who} has {len(rounds)} decided rounds that not everybody has acknowledged",
                    "start the old bundle again, and stop it when all its controllers are connected",
                )
        for name, kept in self.controllers.items():
            if any(key.startswith("promise/") for key in kept):
                yield _against(
                    f"'{name}' has promised parts in a round whose decision it does not know",
                    "start the old bundle again, and stop it when all its controllers are connected",
                )
        for place in self.marking:
            yield from self._objections(place)
        for place in self.commands:
            if (machine := self._numbered_anew(place)) is not None:
                yield _against(
                    f"the command of '{place}' is under way, and '{machine}' is commanded by other places in the new "
                    "net, by which it would have another number there",
                    "let the machine end it, and stop the old bundle after that",
                )
            if place not in self.marking and not self._is_given_up(place):
                yield _against(
                    f"the command of '{place}' is under way, and its token has gone on",
                    "let the machine end it, and stop the old bundle after that; where it cannot, start the old bundle "
                    "again and resume it: its machine is asked, and what it knows nothing of is under way no more",
                )

    def taken_over(self, coordinators: Iterable[str]) -> dict[str, Kept]:
        """What each controller of the new net, and each coordinator, keeps from the beginning.

        The epochs are later than all before, so that nothing that was said under the old net is taken for new.
        """
        epoch = self.epoch + 1
        begun: dict[str, Kept] = {name: {"epoch": epoch} for name in coordinators}
        none_open: dict[str, Stored] = {closed_key(name): (epoch << EPOCH_BITS, ()) for name in begun}
        for subnet in self.new.subnets:
            player = TokenPlayer.of(subnet)
            word = sum(1 << i for i, place in enumerate(subnet.places) if place.name in self.marking)
            word |= sum(player.signal_bit(s.name) for s in subnet.signals if s.name in self.shown)
            kept: dict[str, Stored] = {
                "epoch": epoch,
                **pieces(word),
                **none_open,
            }
            for key, value in self._records(subnet):
                kept[key] = value
            begun[subnet.name] = kept
        return begun

    def _objections(self, place: str) -> Iterator[Diagnostic]:
        if place not in self.new.net.place_index:
            yield _against(
                f"'{place}' has a token, and the new net has no place of that name",
                "run the old bundle on until the token has left it, or keep the name",
            )
            return
        before, after = self.old.net.place(place), self.new.net.place(place)
        if (before.command, before.completion) != (after.command, after.completion):
            yield _against(
                f"'{place}' has a token, and sends another command in the new net, or waits for another completion",
                "run the old bundle on until the token has left it",
            )

    def _is_given_up(self, place: str) -> bool:
        """Whether a command whose token has gone on is one that both nets give up when its time is over."""
        if place not in self.new.net.place_index:
            return False
        before, after = self.old.net.place(place), self.new.net.place(place)
        alike = (before.command, before.completion) == (after.command, after.completion)
        return alike and before.within is not None and after.within is not None

    def _numbered_anew(self, place: str) -> str | None:
        """The machine of a place, where its commands have other numbers in the new net."""
        command = self.old.net.place(place).command
        if command is None or _commanding(self.old.net, command.machine) == _commanding(self.new.net, command.machine):
            return None
        return command.machine

    def _records(self, subnet: Net) -> Iterator[tuple[str, Stored]]:
        """What is kept of the commands of a new controller: those under way, and the numbers of those that are over."""
        ours = {f"{PREFIX}signal/{signal.name}" for signal in subnet.signals}
        ours |= {f"{PREFIX}place/{place.name}" for place in subnet.places}
        for kept in self.controllers.values():
            yield from ((key, value) for key, value in kept.items() if key in ours)


def _commanding(net: Net, machine: str) -> set[str]:
    """The places that command a machine."""
    return {place.name for place in net.places if place.command is not None and place.command.machine == machine}


def _under_way(kept: Kept) -> Iterator[_Command]:
    for key, value in kept.items():
        match value:
            case [str(place), int(entry), str(stage)] if key.startswith(PREFIX) and stage != Stage.OVER:
                yield _Command(place, entry)


def _epoch(kept: Kept) -> int:
    epoch = kept.get("epoch", 0)
    return epoch if isinstance(epoch, int) else 0


def _against(message: str, hint: str) -> Diagnostic:
    return Diagnostic("F5050", message, hint)
