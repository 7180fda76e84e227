"""Deterministic simulation of the protocol: the machines that run the cell, on a bad network, from one seed.

Messages are delivered in any order, after any time, and if asked for lost or doubled; controllers run at any speed;
signals change whenever they like. All of it is drawn from one seeded source, so a seed is a run. Checked in every run:

- the joint trace is a trace of the central net (the caller replays it), with the marking that the controllers are in;
- no progress is lost: once the network is quiet, something fires if anything is enabled, and every sensor is read.

The machines are passed in as classes, so that a test can plant a fault in one and see that this module finds it. The
alternative, unit tests of single messages, only finds the orders of messages that somebody has thought of.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    Message,
    Report,
    Sending,
    Taken,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, SignalKind
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, SignalChanged, Trace


@dataclass(frozen=True, slots=True)
class Network:
    """How bad the network is: the probabilities that a message is lost, and that it comes once more, much later."""

    loss: float = 0.0
    duplication: float = 0.0


class ProgressLostError(AssertionError):
    """The network is quiet, and an enabled transition is not fired, or what a sensor shows is not taken in."""


class Simulation:
    """One run of the machines of a decomposition; a second run from the same seed is the same."""

    def __init__(
        self,
        decomposition: Decomposition,
        seed: int,
        network: Network = Network(),
        coordinator: Callable[[Decomposition, str], Coordinator] = Coordinator,
        controller: Callable[[Decomposition, str], LocalController] = LocalController,
    ) -> None:
        self.net = decomposition.net
        self.random = random.Random(seed)
        self.network = network
        self.coordinators = {name: coordinator(decomposition, name) for name in coordinators(decomposition)}
        self.controllers = {subnet.name: controller(decomposition, subnet.name) for subnet in decomposition.subnets}
        self.owner_of = {signal.name: subnet.name for subnet in decomposition.subnets for signal in subnet.signals}
        self.sensors = [signal.name for signal in self.net.signals if signal.kind is SignalKind.SENSOR]
        self.values = dict.fromkeys(self.sensors, False)
        self.in_flight: list[Message] = []
        self.late: list[Message] = []
        """Second copies, on a way that may take very long."""
        self.completing: list[tuple[str, int]] = []
        self.events: list[Event] = []
        self.messages = 0
        self.now_seconds = 0.0
        self.timed = [controller for controller in self.controllers.values() if controller.timers.places]

    def run(self, steps: int) -> Trace:
        """Let `steps` random things happen, then let the network fall quiet, and return the joint trace.

        Raises `ProgressLostError`, and `ProtocolError` where a machine notices that it was told something impossible.
        """
        for name in self.controllers:
            self._perform(self.controllers[name].report())
        for _ in range(steps):
            self._something()
        self.in_flight += self.late
        self.late.clear()
        self._quieten(fire=False)
        self._check_progress()
        self._quieten(fire=False)
        marking = self.net.names(self.marking)
        header = Header(self.net.name, signals=True, commands=True)
        return Trace(header, tuple(self.events), End(float(len(self.events)), marking, "simulated"))

    @property
    def marking(self) -> Marking:
        """The joint marking of the controllers."""
        return self.net.marking(
            place for controller in self.controllers.values() for place in controller.subnet.names(controller.marking)
        )

    def enabled(self) -> tuple[str, ...]:
        """The transitions of the central net that are enabled under the joint marking and process image."""
        images = (controller for controller in self.controllers.values())
        names = [s.name for c in images for s in c.subnet.signals if c.word & c.player.signal_bit(s.name)]
        player = TokenPlayer.of(self.net)
        word = self.marking | sum(player.signal_bit(name) for name in names)
        return tuple(c.name for c in player.transitions.values() if c.enabled(word))

    def _something(self) -> None:
        choice = self.random.random()
        if self.timed and self.random.random() < 0.2:
            self._pass()
        if self.late and self.random.random() < 0.03:
            self.in_flight.append(self.late.pop(self.random.randrange(len(self.late))))
        if choice < 0.55 and self.in_flight:
            self._deliver()
        elif choice < 0.80:
            self._turn(self.random.choice(list(self.controllers.values())))
        elif choice < 0.87 and self.completing:
            signal, entry = self.completing.pop(self.random.randrange(len(self.completing)))
            self._perform(self.controllers[self.owner_of[signal]].read(signal, value=True, entry=entry))
        elif choice < 0.96 and self.sensors:
            signal = self.random.choice(self.sensors)
            self.values[signal] = not self.values[signal]
            self._perform(self.controllers[self.owner_of[signal]].read(signal, self.values[signal]))
        elif choice >= 0.96:
            for coordinator in self.coordinators.values():
                self._perform(coordinator.resend())
            for controller in self.controllers.values():
                self._perform(controller.resend())

    def _pass(self) -> None:
        """Let some time pass: none, or so much that what is timed is over, or that it is not."""
        self.now_seconds += self.random.choice([0.0, 1.0, 10.0])
        controller = self.random.choice(self.timed)
        self._perform(controller.tick(self.now_seconds))

    def _turn(self, controller: LocalController) -> None:
        if self.random.random() < 0.5:
            self._perform(controller.fire())
        self._perform(controller.report())

    def _deliver(self) -> None:
        message = self.in_flight.pop(self.random.randrange(len(self.in_flight)))
        if self.random.random() < self.network.duplication:
            self.late.append(message)
        if self.random.random() >= self.network.loss:
            self._receive(message)

    def _receive(self, message: Message) -> None:
        self.messages += 1
        if isinstance(message, VoteRequest | Decision | Hello):
            self._perform(self.controllers[message.controller].receive(message))
        else:
            self._perform(self.coordinators[message.coordinator].receive(message))

    def _perform(self, effects: list[Effect]) -> None:
        at = float(len(self.events))
        for effect in effects:
            match effect:
                case Firing(transition):
                    self.events.append(Fired(at, (transition,)))
                case Taken(signal, value):
                    self.events.append(SignalChanged(at, signal, value))
                case Sending(place, entry):
                    self.events.append(CommandSent(at, place))
                    if completion := self.net.place(place).completion:
                        self.completing.append((completion, entry))
                    self._sent(place, entry)
                case VoteRequest() | Decision() | Hello() | Report() | Vote() | Acknowledgement():
                    self.in_flight.append(effect)
                case Keep():
                    pass  # nobody crashes here

    def _sent(self, place: str, entry: int) -> None:
        """The driver has the command; what the controller keeps of that is for a restart, of which there is none."""
        self.controllers[str(self.net.place(place).owner)].sent(place, entry)

    def _quieten(self, *, fire: bool) -> None:
        """Deliver everything in order and repeat what is unanswered until nothing is; with `fire`, until one fires."""
        for coordinator in self.coordinators.values():
            self._perform(coordinator.permit(None if fire else 0))
        before = self._firings()
        for _ in range(1000):
            for controller in self.controllers.values():
                self._perform([*(controller.fire() if fire else []), *controller.report(), *controller.resend()])
            for coordinator in self.coordinators.values():
                self._perform(coordinator.resend())
            while self.in_flight:
                self._receive(self.in_flight.pop(0))
                if fire and self._firings() > before:
                    return
            if all(each.idle for each in self.coordinators.values()) and not (fire and self._firings() > before):
                return

    def _firings(self) -> int:
        return sum(isinstance(event, Fired) for event in self.events)

    def _check_progress(self) -> None:
        for signal, value in self.values.items():
            controller = self.controllers[self.owner_of[signal]]
            if bool(controller.word & controller.player.signal_bit(signal)) != value:
                raise ProgressLostError(f"'{signal}' is {int(value)}, and {controller.name} has not taken it in")
        enabled, before = self.enabled(), self._firings()
        if enabled:
            self._quieten(fire=True)
            if self._firings() == before:
                raise ProgressLostError(f"{', '.join(enabled)} enabled in {', '.join(self.net.names(self.marking))}")
