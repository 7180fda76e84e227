"""Nets of which parts are free of promise, and machines with a planted fault in what that rests on."""

from collections.abc import Iterator
from dataclasses import replace

from support.planted import without

from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import persistence
from firable.executor.protocol.above import Above
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator, Round
from firable.executor.protocol.messages import Acknowledgement, Decision, Effect, Readiness, Report, ToController
from firable.nets.decomposition import Decomposition
from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition


def _net(marked: str, *transitions: Transition) -> Net:
    names = sorted({n for t in transitions for n in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)})
    places = tuple(Place(name, name[0], marked=name in marked.split()) for name in names)
    return Net("n", places, transitions, controllers=(Controller("a"), Controller("b")))


GATE_CLOSED = _net("a.g b.p", Transition("G", ("b.p",), ("b.q",), ("a.g",)), Transition("l", ("a.g",), ("a.h",)))
"""The yes of `t1-11` is not persistent: `l` closes the gate that it reads."""
OUTPUT_READ = _net("b.p a.m", Transition("G", ("b.p",), ("a.x",)), Transition("l", ("a.m",), ("a.n",), (), ("a.x",)))
"""The yes of `t1-11` is persistent, and `l` reads its output as it is before the order."""
GATE_PROMISED = _net(
    "a.g b.p b.s",
    Transition("G", ("b.p",), ("b.q",), ("a.g",)),
    Transition("H", ("a.g", "b.s"), ("b.t",)),
)
"""The yes of `t1-11` is not persistent: `H` takes what it reads, and is promised before it fires."""


_SLOW = _net(
    "a.p b.p",
    Transition("G", ("a.p", "b.p"), ("a.q", "b.q")),
    Transition("la", ("a.q",), ("a.p",)),
    Transition("lb", ("b.q",), ("b.p",)),
)
SLOWLY_BACK = replace(
    _SLOW,
    signals=(Signal("a.s", "a"),),
    transitions=tuple(
        replace(t, external=(ExternalGate("a.s", wanted=True),)) if t.name == "la" else t for t in _SLOW.transitions
    ),
)
"""Both votes on `G` stand; `a` waits for a sensor before it votes again, and a vote of before comes late."""
CLOSED_AGAIN = _net(
    "a.g b.p",
    Transition("G", ("b.p",), ("b.q",), ("a.g",)),
    Transition("l", ("a.g",), ("a.h",)),
    Transition("l-back", ("a.h",), ("a.g",)),
    Transition("b-back", ("b.q",), ("b.p",)),
)
"""The yes of `t1-11` is not persistent: `l` closes the gate that it reads, again and again."""


BY_A_UNIT = _net(
    "a.i a.g b.p",
    Transition("G", ("a.i", "b.p"), ("a.j", "b.q"), ("a.g",)),
    Transition("m", ("a.j",), ("a.x",)),
    Transition("l", ("a.x", "a.g"), ("a.w", "a.h")),
    Transition("k", ("a.w",), ("a.i",)),
    Transition("n", ("a.h",), ("a.g",)),
    Transition("back", ("b.q",), ("b.p",)),
)
"""`l` takes the gate of `G` when the token is on `a.x`, and then it is not on `a.i`, as `G` needs it."""


def parts_of(decomposition: Decomposition, *names: str) -> Decomposition:
    """The decomposition with the parts of these names free of promise, whether they may be or not."""
    free = [(row.name, p.controller) for row in decomposition.coordinated for p in row.parts if p.name in names]
    return replace(decomposition, free=tuple(free))


def freed(decomposition: Decomposition) -> Decomposition:
    """The decomposition with all parts free of promise that may be."""
    return parts_of(decomposition, *persistence(decomposition).free_of_promise)


def with_free_parts(net: Net) -> Decomposition:
    """The split of a net, with what can be shown to be free of promise free."""
    return freed(split(net))


class CountsEarlierEpochs(Coordinator):
    """A vote that was given before the coordinator restarted counts."""

    def _hear(self, controller: str, readiness: Readiness) -> None:
        super()._hear(controller, replace(readiness, epoch=self.epoch))


class CountsUsedVotes(Coordinator):
    """A round is closed when its orders are sent, and the votes that it has used count again."""

    def _decide(self, decided: Round, committed: str | None) -> Iterator[Effect]:
        yield from super()._decide(decided, committed)
        if committed is not None and not decided.participants:
            self.rounds.pop(decided.number, None)
            self.waiting.setdefault(decided.group)


class CountsOlderReports(Coordinator):
    """A report that was overtaken by a newer one counts."""

    def _hear(self, controller: str, readiness: Readiness) -> None:
        self.seen[controller] = min(self.seen[controller], readiness.sequence - 1)
        super()._hear(controller, readiness)


class VotesOnWhatIsNotKept(LocalController):
    """A local firing is told of and not kept: after a restart the vote stands, and what it rests on is gone."""

    def fire(self) -> list[Effect]:
        return without(super().fire(), "word")


class AppliesFreePartsTwice(LocalController):
    """An order to a free part that comes again is carried out again."""

    def _decided(self, decision: Decision) -> Iterator[Effect]:
        if decision.committed in self.free and decision.round in self.closed:
            yield from self._fire(self.parts[decision.committed])
        yield from super()._decided(decision)


class VotesInSpiteOfPromises(LocalController):
    """A free part is voted on though what is promised will disturb it."""

    def _readiness(self, above: Above) -> Readiness:
        promises, self.promises = self.promises, {}
        readiness = super()._readiness(above)
        self.promises = promises
        return readiness


class AcknowledgesBeforeItObeys(LocalController):
    """The acknowledgement of an order brings the report from before it along."""

    def _decided(self, decision: Decision) -> Iterator[Effect]:
        before = {name: self._told(above) for name, above in self.above.items()}
        for effect in super()._decided(decision):
            if isinstance(effect, Acknowledgement):
                old = before[effect.coordinator].transitions
                yield replace(effect, readiness=replace(effect.readiness, transitions=old))
            else:
                yield effect


# --- Hosts that end


class DismissesAtOnce(Coordinator):
    """Who takes its votes back is told that no order is open, whatever is."""

    def needs(self, controller: str) -> bool:
        del controller
        return False


class NeverDismisses(Coordinator):
    """Nobody is ever told that no order is open."""

    def needs(self, controller: str) -> bool:
        del controller
        return True


class EndsWithoutAsking(LocalController):
    """Whose votes are taken back ends at once, with an order on its way."""

    @property
    def awaited(self) -> tuple[str, ...]:
        return ()


class TakesAnyWord(LocalController):
    """Whatever comes after the votes were taken back is believed to be the last."""

    def receive(self, message: ToController) -> list[Effect]:
        effects = super().receive(message)
        for above in self.above.values() if self.leaving else ():
            above.dismissed = max(above.dismissed, above.seen)
        return effects


class LeavesItsVotes(LocalController):
    """The end is announced, and the votes still stand."""

    def _report(self, above: Above) -> Report:
        self.leaving, leaving = False, self.leaving
        report = super()._report(above)
        self.leaving = leaving
        return replace(report, last=leaving)

    def _is_unanswered(self, above: Above) -> bool:
        return self.leaving and above.dismissed < above.readiness.sequence
