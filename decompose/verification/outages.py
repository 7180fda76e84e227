"""The verdicts on who is dead: the net that they leave is made anew, and a document must show each answer of it.

The second text of `firable.decompose.protocol.bereft` and of the division in `outages`: which transitions the dead may
hold up, which promises a dead coordinator leaves, what is asked, and what the answers come to. The answers are those of
the document of each verdict, which says what it shows as any does; which questions there are follows from them, one
after the other, and no other may be there. Whoever is dead has a verdict, where the bundle speaks of faults at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from firable.decompose.verification.checked import Examination
from firable.decompose.verification.documents import answers_in, checked_document
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers
from firable.decompose.verification.voting import UNNAMED, Part, Voting
from firable.nets.bundle import file_stem
from firable.nets.formula import And, Firable, Holds, format_formula
from firable.nets.net import Net, Place, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.temporal import Logic, parse_temporal
from firable.nets.verdict import Status, Verdict, Weight

PREFIX: Final = "faults.dead"
TITLE: Final = "while somebody is dead, what is said to go on does, whatever the crash has left"
METHOD: Final = "the central net, without what the dead may hold up"

_NOT_BEGUN: Final = "life/not-begun"
_ALIVE: Final = "life/alive"
_DYING: Final = "life/dying"
_DEAD: Final = "life/dead"
_EARLY: Final = "life/dead-at-once"

_RUNS: Final = "runs played by the reference player"
_SAYS: Final = (
    "while {} is dead, these transitions may stand still for ever, and every other that can fire goes on, whenever the "
    "crash was: where the central net could fire it again when what is under way is over, it can"
)


def check_outages(examination: Examination, cut: Cut, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on who is dead, if the bundle speaks of faults; raises `NotShownError`."""
    if not any(verdict.name.startswith("faults.") for verdict in examination.bundle.verdicts):
        return
    for wake in wakes(Voting(cut, faults=True), examination.bundle.decomposition.free):
        verdict = examination.verdict(wake.name)
        sentence = _SAYS.format(wake.told)
        if verdict.status is Status.UNKNOWN:
            undecided = Verdict(wake.name, Status.UNKNOWN, sentence, METHOD, Weight.INFORMATION, bound=verdict.bound)
            if verdict != undecided:
                raise NotShownError(
                    f"the verdict on '{wake.name}' says more than that it is open", "verdicts", wake.name
                )
            said = "undecided: the bundle itself does not say"
            examination.judge(verdict, shown=False, method="nothing", only_claimed=said)
            continue
        _judge(examination, wake, verdict, sentence, answers, timeout_ms)


def _judge(
    examination: Examination, wake: Wake, verdict: Verdict, sentence: str, answers: Answers, timeout_ms: int
) -> None:
    file = f"{file_stem(wake.name)}.evidence.json"
    said = answers_in(examination, file)
    asking = _Asking(wake, said, file)
    subjects, hint = asking.divided()
    wanted = Verdict(
        wake.name, Status.PROVED, sentence, METHOD, Weight.INFORMATION, hint=hint, subjects=subjects, evidence=(file,)
    )
    if verdict != wanted:
        raise NotShownError(f"the verdict on '{wake.name}' is not what its proof shows", "verdicts", wake.name)
    if list(said) != [f"property.{of.name}" for of in asking.asked]:
        raise NotShownError(f"'{file}' does not answer what is asked, one after the other", "evidence", file)
    net = replace(wake.net, properties=tuple(asking.asked))
    checked = checked_document(examination, file, net, answers, timeout_ms)
    late = next((one.only_claimed for one in checked if not one.shown), "")
    methods = dict.fromkeys(
        _RUNS if "firings played" in method else method for one in checked for method in one.methods
    )
    how = f"the net that is left, made anew: {'; '.join(methods)}"
    examination.judge(verdict, shown=not late, method=how, only_claimed=late)


@dataclass
class _Asking:
    """The questions in their order, each asked because of the answers before it."""

    wake: Wake
    answers: dict[str, bool]
    file: str

    def __post_init__(self) -> None:
        self.asked: list[Property | TemporalProperty] = []

    def is_so(self, of: Property | TemporalProperty) -> bool:
        self.asked.append(of)
        name = f"property.{of.name}"
        if name not in self.answers:
            raise NotShownError(f"'{self.file}' does not answer '{of.name}'", "evidence", self.file)
        return self.answers[name]

    def divided(self) -> tuple[tuple[str, ...], str]:
        """The transitions that may stand still, those at once first, and what is told of machines."""
        wake = self.wake
        fires = [t.name for t in wake.voting.transitions if self.is_so(_fires(t.name))]
        free = [t for t in fires if t not in wake.held_up and not self.is_so(_kept_from_start(t))]
        going = [t for t in free if self.is_so(_goes_on(f"transition.{t}", [t]))]
        still, running = list[str](), list[str]()
        for machine, sending in wake.sending(fires).items():
            if len(sending) == 1:
                goes = sending[0] in going
            else:
                goes = not set(free).isdisjoint(sending) and self.is_so(_goes_on(f"machine.{machine}", sending))
            (running if goes else still).append(machine)
        at_once = [t for t in fires if wake.is_at_once(t)]
        at_last = [t for t in fires if t not in going and t not in at_once]
        at_once_told, still_told, running_told = (", ".join(some) or "none" for some in (at_once, still, running))
        hint = f"at once: {at_once_told}; machines: {still_told} may stand still, {running_told} go on"
        return (*at_once, *at_last), hint


def _fires(t: str) -> Property:
    return Property(f"fires.{t}", PropertyKind.REACHABLE, Firable(t))


def _kept_from_start(t: str) -> Property:
    return Property(f"kept-from-start.{t}", PropertyKind.NEVER, And((Holds(_EARLY), Firable(t))))


def _goes_on(name: str, some: list[str]) -> TemporalProperty:
    """Wherever one of these could still fire, nobody can die in such a way that none of them ever fires again."""
    alive, dying, dead = (format_formula(Holds(place)) for place in (_ALIVE, _DYING, _DEAD))
    one = " or ".join(format_formula(Firable(t)) for t in some)
    hopeless = f"E[{dying} U {dead} and not EF ({one})]"
    text = f"AG (not EF ({alive} and ({one})) or AX (not {dying} or not {hopeless}))"
    return TemporalProperty(f"goes-on.{name}", Logic.CTL, parse_temporal(text))


@dataclass(frozen=True)
class Wake:
    """What is left when a controller is dead, or where that is empty a coordinator, by the name in the layers."""

    voting: Voting
    controller: str
    coordinator: str
    free: frozenset[tuple[str, str]] = frozenset()

    @property
    def told(self) -> str:
        """Who is dead, in words."""
        unnamed = self.coordinator == UNNAMED or len(self.voting.coordinators) == 1
        return self.controller or (UNNAMED if unnamed else f"coordinator {self.coordinator}")

    @property
    def name(self) -> str:
        """The name of the verdict."""
        if self.controller:
            return f"{PREFIX}.{self.controller}"
        return f"{PREFIX}-coordinator" + ("" if self.told == UNNAMED else f".{self.coordinator}")

    @cached_property
    def held_up(self) -> set[str]:
        """What fires no more in the worst case: for a controller, whatever is behind a round of it, or may be."""
        voting = self.voting
        if not self.controller:
            return {t for t in voting.parts if voting.cut.decided_at[t] == self.coordinator}
        waited_for = {part.whole for part in voting.all_parts if part.controller == self.controller}
        together = {t for group in voting.groups if waited_for & set(group) for t in group}
        footprints = {t.name: self._footprint(t) for t in voting.transitions}

        def near(t: str, some: set[str]) -> bool:
            moved, looked_at = footprints[t]
            return any(moved & footprints[u][1] or looked_at & footprints[u][0] for u in some)

        alone = {p.whole for p in voting.local if p.controller == self.controller or near(p.whole, together)}
        stopped = set(together)
        while behind := {u for t in voting.parts if t not in stopped and near(t, stopped) for u in voting.group_of[t]}:
            stopped |= behind
        return stopped | alone

    def _footprint(self, t: Transition) -> tuple[set[tuple[str, str]], set[tuple[str, str]]]:
        """What a transition may change, and what it may see; a signal under a promise stays as it is, so both."""
        both = {("place", p) for p in (*t.inputs, *t.outputs)} | {("signal", s) for s in self._signals(t)}
        return both, both | {("place", p) for p in (*t.permissive, *t.inhibitive)}

    def _signals(self, t: Transition) -> set[str]:
        """The signals that its gates read, and those that a token clears where it puts one."""
        entered = map(self.voting.cut.net.place, t.outputs)
        return {gate.signal for gate in t.external} | {signal for place in entered for signal in place.cleared}

    def _promises_near(self, part: Part) -> set[str]:
        """The promises that keep a part from being promised or fired, or hold a signal of it still."""
        mine, its = self._signals(part.own), self.voting.group_of.get(part.whole, ())
        found = set(self.voting.others(part))
        for other in self.voting.all_parts if mine else ():
            if other.controller == part.controller and other.whole not in its and mine & self._signals(other.own):
                found.add(other.at("promised"))
        return found

    def is_at_once(self, t: str) -> bool:
        """Whether only the dead could fire it."""
        if not self.controller:
            return t in self.held_up
        return any(part.whole == t and part.controller == self.controller for part in self.voting.local)

    def sending(self, among: list[str]) -> dict[str, list[str]]:
        """For each machine, the transitions of these that send it a command."""
        found: dict[str, list[str]] = {}
        for place in self.voting.cut.net.places:
            if place.command is not None:
                found.setdefault(place.command.machine, []).append(place.name)
        outputs = {t: set(self.voting.cut.net.transition(t).outputs) for t in among}
        senders = {machine: [t for t in among if outputs[t] & set(entered)] for machine, entered in found.items()}
        return {machine: some for machine, some in senders.items() if some}

    @cached_property
    def promises(self) -> dict[str, Part]:
        """The parts that may stay promised to the dead and are in somebody's way, by the names of places."""
        if self.controller:
            return {}
        going = (part for part in (*self.voting.local, *self.voting.all_parts) if part.whole not in self.held_up)
        in_the_way = {promise for part in going for promise in self._promises_near(part)}
        its = (part for part in self.voting.all_parts if part.whole in self.held_up)
        return {f"held/{part.whole}/{part.controller}": part for part in its if part.at("promised") in in_the_way}

    def left_by(self, part: Part) -> set[str]:
        """The promises of these that keep a part from firing."""
        return self._places_of(self._promises_near(part))

    def _places_of(self, promises: Iterable[str]) -> set[str]:
        its = {other.at("promised"): place for place, other in self.promises.items()}
        return {its[promise] for promise in promises if promise in its}

    @cached_property
    def net(self) -> Net:
        """The net that is left."""
        central = self.voting.cut.net
        places = [Place(_NOT_BEGUN, marked=True), *(Place(name) for name in (_ALIVE, _DYING, _DEAD, _EARLY))]
        places += [Place(name) for name in sorted(self.promises)]
        places += [Place(place.name, marked=place.marked) for place in central.places]
        return Net(f"bereft-{central.name}", tuple(places), tuple(self._transitions()))

    def _promised(self, part: Part) -> tuple[set[str], set[str]]:
        """What is full and what is empty in the central net, of a part that is promised and of which no order is on."""
        own, moved = part.own, set[str]()
        for other in self.voting.all_parts:
            if other.controller == part.controller and other.whole in self.voting.group_of[part.whole]:
                moved |= other.writes if other is not part else set()
        return {*own.inputs, *own.permissive} - moved, {*own.outputs, *own.inhibitive} - moved

    def _behind(self, part: Part) -> tuple[set[str], set[str]]:
        """The same of one that has been decided: the central net has moved its tokens.

        One that is free of promise has locked nothing, and its gates may be as they like by now.
        """
        own = part.own
        if self._is_free(part):
            return set(own.outputs), set(own.inputs)
        return {*own.outputs, *own.permissive}, {*own.inputs, *own.inhibitive}

    def _is_free(self, part: Part) -> bool:
        return (part.whole, part.controller) in self.free

    def _transitions(self) -> Iterator[Transition]:
        yield Transition("life/begins", (_NOT_BEGUN,), (_ALIVE,))
        yield Transition("life/dies-at-once", (_NOT_BEGUN,), (_DEAD, _EARLY))
        yield Transition("life/dies", (_ALIVE,), (_DYING,))
        yield Transition("life/is-dead", (_DYING,), (_DEAD,))
        for act in ("behind", "hold"):
            for place, part in sorted(self.promises.items()):
                full, empty = self._promised(part) if act == "hold" else self._behind(part)
                full = full | {_DYING}
                if not self._is_free(part):
                    others = self._places_of(self.voting.others(part))
                    empty = empty | {other for other in others if not self._is_free(self.promises[other])}
                name = f"{act}{place.removeprefix('held')}"
                yield Transition(name, (), (place,), tuple(sorted(full)), tuple(sorted(empty)))
        stopped: dict[str, set[str]] = {}
        for part in (*self.voting.local, *self.voting.all_parts):
            stopped[part.whole] = stopped.get(part.whole, set()) | self.left_by(part)
        for t in self.voting.transitions:
            full, empty = set(t.permissive), set(t.inhibitive)
            if t.name in self.held_up:
                full.add(_ALIVE)
            else:
                empty |= {_NOT_BEGUN, _DYING} | stopped[t.name]
            yield Transition(t.name, t.inputs, t.outputs, tuple(sorted(full)), tuple(sorted(empty)))


def wakes(voting: Voting, free: Iterable[tuple[str, str]] = ()) -> Iterator[Wake]:
    """Everybody who can be dead; `voting` is the protocol in which every part promises, `free` those that do not."""
    known = frozenset(free)
    yield from (Wake(voting, subnet.name, "", known) for subnet in voting.cut.subnets)
    yield from (Wake(voting, "", coordinator, known) for coordinator in sorted(voting.coordinators))
