"""The machines of a decomposition on an unreliable line, each with a trace of its own and a wrong clock."""

import random
from dataclasses import replace

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Message,
    Report,
    Sending,
    Taken,
    ToController,
    Vote,
)
from firable.nets.decomposition import Decomposition
from firable.nets.interchange import net_digest
from firable.nets.net import SignalKind
from firable.semantics.joining import APPLIED, COORDINATOR, STANDS, VOTED
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, Noted, SignalChanged, Trace


class Hosts:
    """One run from a seed; `traces` are those of its hosts."""

    def __init__(self, decomposition: Decomposition, seed: int) -> None:
        self.net = decomposition.net
        self.dice = random.Random(seed)
        self.coordinator = Coordinator(decomposition)
        self.controllers = {s.name: LocalController(decomposition, s.name) for s in decomposition.subnets}
        self.owner_of = {signal.name: subnet.name for subnet in decomposition.subnets for signal in subnet.signals}
        self.sensors = [signal.name for signal in self.net.signals if signal.kind is SignalKind.SENSOR]
        self.lines: dict[str, list[Event]] = {name: [] for name in (COORDINATOR, *self.controllers)}
        self.began = {name: 1000 + self.dice.uniform(-3, 3) for name in self.lines}
        self.under_way: list[Message] = []
        self.completing: list[tuple[str, int]] = []
        self.steps = 0
        self.standing: dict[str, set[str]] = {name: set() for name in self.controllers}
        for name, controller in self.controllers.items():
            self._perform(name, controller.report())

    def run(self, steps: int) -> list[Trace]:
        """So many things happen, then all that is under way arrives."""
        for _ in range(steps):
            self._something()
        self._perform(COORDINATOR, self.coordinator.permit(0))
        while self.under_way or not self.coordinator.idle:
            self._perform(COORDINATOR, self.coordinator.resend())
            while self.under_way:
                self._receive(self.under_way.pop(0))
        digest, net = net_digest(self.net), self.net
        header = {
            name: Header(net.name, digest, signals=True, commands=True, machines=(name,), began=began)
            for name, began in self.began.items()
        }
        marked = {n: c.subnet.names(c.marking) for n, c in self.controllers.items()}
        return [
            Trace(header[name], tuple(lines), End(float(self.steps), marked.get(name, ()), "stopped"), f"{name}.trace")
            for name, lines in self.lines.items()
        ]

    def _something(self) -> None:
        self.steps += 1
        choice = self.dice.random()
        if choice < 0.6 and self.under_way:
            message = self.under_way.pop(self.dice.randrange(len(self.under_way)))
            if self.dice.random() < 0.1:
                self.under_way.append(message)
            if self.dice.random() > 0.1:
                self._receive(message)
        elif choice < 0.8:
            name = self.dice.choice(list(self.controllers))
            self._perform(name, [*self.controllers[name].fire(), *self.controllers[name].report()])
        elif choice < 0.9 and self.completing:
            signal, entry = self.completing.pop(self.dice.randrange(len(self.completing)))
            name = self.owner_of[signal]
            self._perform(name, self.controllers[name].read(signal, value=True, entry=entry))
        elif choice < 0.95 and self.sensors:
            signal = self.dice.choice(self.sensors)
            name = self.owner_of[signal]
            self._perform(name, self.controllers[name].read(signal, value=self.dice.random() < 0.5))
        else:
            self._perform(COORDINATOR, self.coordinator.resend())
            for name, controller in self.controllers.items():
                self._perform(name, controller.resend())

    def _receive(self, message: Message) -> None:
        if not isinstance(message, ToController):
            self._perform(COORDINATOR, self.coordinator.receive(message))
            return
        controller = self.controllers[message.controller]
        applied = str(message.committed) if isinstance(message, Decision) and controller.applies(message) else None
        effects = controller.receive(message)
        if isinstance(message, Decision) and applied is not None:
            self.standing[message.controller].discard(applied)
            self._write(message.controller, Noted(0, APPLIED, {"controller": controller.name, "round": message.round}))
        self._perform(message.controller, effects)

    def _perform(self, name: str, effects: list[Effect]) -> None:
        decided = {e.committed: e.round for e in effects if isinstance(e, Decision)}
        for effect in effects:
            match effect:
                case Firing(transition):
                    self._write(name, Fired(0, (transition,), decided.get(transition)))
                case Taken(signal, value):
                    self._write(name, SignalChanged(0, signal, value))
                case Sending(place, entry):
                    self._write(name, CommandSent(0, place))
                    if completion := self.net.place(place).completion:
                        self.completing.append((completion, entry))
                    self.controllers[name].sent(place, entry)
                case Report() | Acknowledgement():
                    self._tell_standing(name, effect)
                    self.under_way.append(effect)
                case Vote():
                    data = {"controller": name, "round": effect.round, "promised": sorted(effect.promised)}
                    self._write(name, Noted(0, VOTED, data))
                    self._tell_standing(name, effect)
                    self.under_way.append(effect)
                case _ if isinstance(effect, Message):
                    self.under_way.append(effect)

    def _tell_standing(self, name: str, told: Report | Vote | Acknowledgement) -> None:
        if new := (told.readiness.transitions & self.controllers[name].free) - self.standing[name]:
            self.standing[name] |= new
            self._write(name, Noted(0, STANDS, {"controller": name, "transitions": sorted(new)}))

    def _write(self, name: str, event: Event) -> None:
        self.lines[name].append(replace(event, at_seconds=float(self.steps)))
