"""Verdicts on commands: what the net tells its machines, and what it forgets to tell them.

A place with an output signal sends its command when the token enters. While the token stays, the machine works under
that command. Four things can be wrong that no verdict on tokens alone shows:

*Conflicting commands*: two places that send different commands to one machine hold a token at one reachable marking.
The same command twice is no contradiction and is not reported.

*A completion awaited twice*: two places that wait for the same completion signal hold a token at one reachable marking.
The signal is one bit: sending the second command clears it for the first, and the end of either opens the gate of both,
so a transition would fire while its machine is still at work. Places that take turns may share a signal.

*A machine that is never stopped* (a warning). What a command means is the machine's matter, and a list of words such
as STOP or OFF would know only English. What the net does know is the order in which commands follow each other. A
command ends another of the same machine if it has another name and is sent after it in some run: STOP ends RUN,
UNCLAMP ends CLAMP, GRASP ends MOVE. A command is reported when it is sent in some run, and in no run a command of
another name is sent to that machine before or after it: then it starts the machine and nothing in the net ever stops
it. That a command of another name comes *before* is enough because then this one may be the stop, as at the end of a
net that stops for good. Parameters do not count (RUN fast does not stop RUN slow), and a completion signal does not
either: it says that the machine has arrived, and whether it then stands still is an assumption about the machine
which an engineer should confirm. So a conveyor that is only ever told RUN is reported, though it may stop at its exit
sensor by itself.

*An output signal in M0* (a warning): the token is already there, nothing enters, no command is sent.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

from firable.analysis.question import Answer, Question, listed, no, yes
from firable.analysis.spaces.space import S, StateSpace, WitnessError
from firable.nets.net import Marking, Net
from firable.nets.verdict import Verdict, Weight
from firable.semantics.player import Player


def machines(net: Net) -> dict[str, dict[str, tuple[int, ...]]]:
    """For each machine the names of its commands, and for each of them the places that send it, by index."""
    found: dict[str, dict[str, tuple[int, ...]]] = {}
    for p, place in enumerate(net.places):
        if place.command is not None:
            names = found.setdefault(place.command.machine, {})
            names[place.command.command] = (*names.get(place.command.command, ()), p)
    return found


def entries(net: Net, firings: Iterable[Iterable[str]], place: str) -> tuple[str, ...]:
    """The transitions by which a token enters a place in a firing sequence: each entry sends the place's command once.

    Raises `firable.semantics.player.NotFirableError` where the sequence is none of the net.
    """
    player, marking, p, found = Player(net), net.initial_marking, net.place_index[place], []
    for fired in firings:
        chosen = [net.transition_index[name] for name in fired]
        after = player.fire(marking, chosen)
        if after & ~marking & 1 << p:
            found += [net.transitions[t].name for t in chosen if place in net.transitions[t].outputs]
        marking = after
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Clash:
    """Two places, by index, that must not hold a token at one reachable marking, and what happens if they do."""

    p: int
    q: int
    note: str


COMMANDS_AGREE: Final = Question(
    "conflicting-commands",
    "no machine is under two different commands at once",
    code="F3003",
    hint="let the two places exclude each other, by a place that stands for the machine being free",
)
COMPLETIONS_APART: Final = Question(
    "shared-completions",
    "no completion signal is awaited by two commands at once",
    code="F3005",
    hint="give each of the two commands a completion signal of its own",
)


def command_clashes(net: Net) -> tuple[Clash, ...]:
    """The pairs of places that send different commands to one machine."""
    found = []
    for machine, names in machines(net).items():
        for p, q in combinations(sorted(p for sent in names.values() for p in sent), 2):
            one, other = net.places[p].command, net.places[q].command
            if one != other:
                found.append(Clash(p, q, f"{machine} is under '{one}' and '{other}'"))
    return tuple(found)


def completion_clashes(net: Net) -> tuple[Clash, ...]:
    """The pairs of places that wait for the same completion signal."""
    waiting: dict[str, list[int]] = {}
    for p, place in enumerate(net.places):
        if place.completion is not None:
            waiting.setdefault(place.completion, []).append(p)
    return tuple(
        Clash(p, q, f"both '{net.places[p].command}' and '{net.places[q].command}' wait for {signal}")
        for signal, places in waiting.items()
        for p, q in combinations(places, 2)
    )


def commands_agree(space: StateSpace[Any]) -> Verdict:
    """No two places that send different commands to one machine hold a token at one reachable marking."""
    return _kept_apart(space, COMMANDS_AGREE, command_clashes(space.net))


def completions_apart(space: StateSpace[Any]) -> Verdict:
    """No two places that wait for the same completion signal hold a token at one reachable marking."""
    return _kept_apart(space, COMPLETIONS_APART, completion_clashes(space.net))


def _kept_apart(space: StateSpace[S], question: Question, clashes: Sequence[Clash]) -> Verdict:
    """No two clashing places hold a token at one reachable marking; violated by the nearest that do."""

    def find() -> Answer:
        met = space.marked_together([(clash.p, clash.q) for clash in clashes])
        found = [clash for clash, is_met in zip(clashes, met, strict=True) if is_met]
        if not found:
            if clashes:
                space.require_complete()
            return yes()
        algebra = space.algebra
        both = (algebra.conjunction([space.marked(clash.p), space.marked(clash.q)]) for clash in found)
        witness = space.witness(algebra.disjunction(both))
        if witness is None:
            raise WitnessError("places hold a token together, and no marking shows it")
        note = clashing(found, space.net.marking(witness.marking))[0].note
        return no(clash_subjects(space.net, found), replace(witness, note=note))

    return question.ask(space, find)


def clashing(clashes: Iterable[Clash], marking: Marking) -> tuple[Clash, ...]:
    """The clashes that happen in a marking."""
    return tuple(clash for clash in clashes if marking >> clash.p & marking >> clash.q & 1)


def clash_subjects(net: Net, clashes: Iterable[Clash]) -> tuple[str, ...]:
    """The names of the places that clash, each once."""
    return tuple(dict.fromkeys(net.places[p].name for clash in clashes for p in (clash.p, clash.q)))


def machines_stopped(space: StateSpace[Any]) -> Verdict:
    """Every command that is sent follows or is followed by a command of another name to its machine.

    Cost: next to none where M0 can be reached from everywhere; otherwise, at worst, one backward closure for each
    name of a command.
    """
    question = Question(
        "machine-never-stopped",
        "every machine that is started can be stopped by another command",
        Weight.WARNING,
        "F3001",
    )

    def find() -> Answer:
        net, found = space.net, []
        fired = space.fired() if machines(net) else ()
        # Machines with one command first: their violation needs no more than the marking that shows it.
        for machine, names in sorted(machines(net).items(), key=lambda item: len(item[1])):
            if len(names) > 1 and not space.complete:
                break
            sent = {name: sending for name, sending in names.items() if any(fired[t] for t in _senders(net, sending))}
            found += [(machine, name, names[name]) for name in _unanswered(space, sent)]
        if not found:
            if machines(net):
                space.require_complete()
            return yes()
        machine, name, sending = found[0]
        others = listed(f"{machine} {name}" for machine, name, _ in found)
        hint = (
            f"after {others} no other command is ever sent, and what it has begun does not end with the token: "
            "send one that ends it, a stop or the off of a lamp, or make sure that it ends by itself"
        )
        subjects = tuple(net.places[p].name for _, _, sending in found for p in sending)
        witness = space.witness(_sources(space, sending), f"the next firing can send {machine} {name}")
        return no(subjects, witness, hint)

    return question.ask(space, find)


def _unanswered(space: StateSpace[S], sent: dict[str, tuple[int, ...]]) -> Iterator[str]:
    """The commands of one machine, all of them sent, that no other one follows or precedes."""
    if len(sent) > 1 and space.reversible():
        return  # from every marking every other one can be reached, so each command follows each
    closing: dict[str, S] = {}

    def follows(after: str, before: str) -> bool:
        if after not in closing:
            closing[after] = space.backward(_sources(space, sent[after]))
        return space.count(space.before(closing[after], _senders(space.net, sent[before]))) > 0

    for name in sent:
        if not any(follows(name, other) or follows(other, name) for other in sent if other != name):
            yield name


def _senders(net: Net, places: tuple[int, ...]) -> tuple[int, ...]:
    """The transitions that put a token on one of the places; where one fires the place was empty, so it sends."""
    return tuple(sorted({t for p in places for t in net.producers[p]}))


def _sources(space: StateSpace[S], places: tuple[int, ...]) -> S:
    """The markings in which a transition may fire that puts a token on one of the places."""
    return space.some_may_fire(_senders(space.net, places))


def no_command_in_initial_marking(space: StateSpace[Any]) -> Verdict:
    """No place with an output signal is marked in M0."""
    question = Question(
        "output-signals-in-M0",
        "no place that sends a command holds a token in the initial marking",
        Weight.WARNING,
        "F3002",
        "no command is sent for a token that is there from the start: begin in a place without `send`",
    )
    names = tuple(place.name for place in space.net.places if place.marked and place.command is not None)
    return question.ask(space, lambda: Answer(not names, names))
