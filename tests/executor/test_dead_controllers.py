"""While a controller is dead the machines that run do what is said to go on, and may keep back the rest for ever."""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace

import pytest
from support.explored_deaths import could_fire
from support.layered_nets import cells_in_a_line
from support.looping_nets import looping_net

from firable.decompose.protocol.outages import Outage, outages
from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Report,
    Sending,
    Vote,
    VoteRequest,
)
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.semantics.player import Player

A, B, C = Controller("a"), Controller("b"), Controller("c")
PLACES = (
    Place("a.p", "a", marked=True),
    Place("a.q", "a"),
    Place("b.g", "b", marked=True),
    Place("b.h", "b", command=Command("mill", "RUN")),
)
READING = (Transition("G", ("a.p",), ("a.q",), ("b.g",)), Transition("back", ("a.q",), ("a.p",)))


def promised() -> Net:
    """`G` moves a token of `a` and reads a place of `b`, which `b` would empty by itself."""
    own = (Transition("off", ("b.g",), ("b.h",)), Transition("on", ("b.h",), ("b.g",)))
    return Net("promised", PLACES, (*READING, *own), controllers=(A, B))


def kept_waiting() -> Net:
    """The same, but `b` empties the place together with `c`: the coordinator would have to ask."""
    places = (*PLACES, Place("c.x", "c", marked=True), Place("c.y", "c"))
    shared = (
        Transition("off", ("b.g", "c.x"), ("b.h", "c.y")),
        Transition("on", ("b.h", "c.y"), ("b.g", "c.x")),
    )
    return Net("kept-waiting", places, (*READING, *shared), controllers=(A, B, C))


def seen_still() -> Net:
    """`G` reads a sensor of `b`, which `b` waits for to change: while that is promised, it is not read anew."""
    sensor = Signal("b.light", "b", SignalKind.SENSOR)
    reading = replace(READING[0], external=(ExternalGate("b.light", wanted=False),))
    own = (
        Transition("off", ("b.u",), ("b.v",), external=(ExternalGate("b.light"),)),
        Transition("on", ("b.v",), ("b.u",)),
    )
    places = (*PLACES, Place("b.u", "b", marked=True), Place("b.v", "b"))
    return Net("seen-still", places, (reading, READING[1], *own), (sensor,), (A, B))


@dataclass
class Cell:
    """The machines of a net, and messages that come in any order; one may be dead, and hears nothing."""

    net: Net
    draw: random.Random
    dead: str = ""
    fired: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        cut = split(self.net)
        self.above = {name: Coordinator(cut, name) for name in coordinators(cut)}
        self.controllers = {subnet.name: LocalController(cut, subnet.name) for subnet in cut.subnets}
        self.under_way: list[Effect] = []
        self.player = Player(self.net)
        self.marking = self.net.initial_marking
        for controller in self.controllers.values():
            self.send(controller.start())
        for coordinator in self.above.values():
            self.send(coordinator.start())

    def send(self, effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Sending):  # the driver takes each command at once
                self.send(self.controllers[self.net.place(effect.place).owner or ""].sent(effect.place, effect.entry))
            elif isinstance(effect, Firing):
                self.fired.append(effect.transition)
                self.marking = self.player.fire(self.marking, [self.net.transition_index[effect.transition]])
            elif isinstance(effect, (Report, Vote, Acknowledgement, VoteRequest, Decision, Hello)):
                self.under_way.append(effect)

    def step(self) -> None:
        """One message arrives, or somebody does what it does by itself."""
        alive = [one for name, one in self.controllers.items() if name != self.dead]
        if self.under_way and self.draw.random() < 0.7:
            self.arrive(self.under_way.pop(self.draw.randrange(len(self.under_way))))
        elif self.draw.random() < 0.8:
            one = self.draw.choice(alive)
            self.send(self.draw.choice([one.fire, one.report])())
        elif not self.under_way:
            again = [*(one.resend for one in alive), *(one.resend for one in self.above.values())]
            self.send(self.draw.choice(again)())

    def arrive(self, message: Effect) -> None:
        if isinstance(message, (Report, Vote, Acknowledgement)):
            self.send(self.above[message.coordinator].receive(message))
        elif isinstance(message, (VoteRequest, Decision, Hello)) and message.controller != self.dead:
            self.send(self.controllers[message.controller].receive(message))


def told(net: Net, who: str) -> Outage:
    return next(outage for outage in outages(split(net)) if outage.who == who)


def dies_when_asked(net: Net, who: str) -> Cell:
    """The first time that it is asked for a promise, the controller is dead; and much happens afterwards."""
    cell = Cell(net, random.Random(1))
    for _ in range(2000):
        asked = any(isinstance(m, VoteRequest) and m.controller == who for m in cell.under_way)
        cell.dead = cell.dead or who * asked
        if not cell.dead or not cell.under_way:
            for one in cell.controllers.values():
                if one.name != cell.dead:
                    cell.send(one.report())
        if cell.under_way:
            cell.arrive(cell.under_way.pop(0))
        elif cell.dead:
            cell.step()
    assert cell.dead
    return cell


@pytest.mark.parametrize("net", [promised(), kept_waiting()])
def test_a_round_of_the_dead_keeps_back_for_ever_what_disturbs_it(net: Net) -> None:
    cell = dies_when_asked(net, "a")
    assert cell.fired == []
    assert could_fire(net)(cell.marking) >= {"off", "on"}
    outage = told(net, "a")
    assert (outage.at_once, outage.at_last, outage.goes_on) == (("back",), ("G", "off", "on"), ())
    assert outage.running == ()


def test_a_promise_to_a_round_of_the_dead_keeps_a_signal_from_being_read() -> None:
    net = seen_still()
    cell = dies_when_asked(net, "a")
    b = cell.controllers["b"]
    b.read("b.light", value=True)
    assert b.promises
    assert b.fire() == []
    assert told(net, "a").at_last == ("G", "off", "on")
    coordinator = next(outage for outage in outages(split(net)) if not outage.who)
    assert coordinator.at_last == ("back", "off", "on")


@pytest.mark.parametrize("seed", range(30))
def test_what_is_said_to_go_on_while_a_controller_is_dead_goes_on(seed: int) -> None:
    draw = random.Random(seed)
    net = [promised, kept_waiting, cells_in_a_line][seed]() if seed < 3 else looping_net(seed)
    for outage in outages(split(net)):
        if not outage.who:
            continue
        cell = Cell(net, draw)
        for _ in range(draw.randrange(200)):
            cell.step()
        cell.dead, before = outage.who, len(cell.fired)
        for _ in range(300):
            cell.step()
        settled = len(cell.fired)
        assert not set(outage.at_once) & set(cell.fired[before:])
        wanted, ahead = set(outage.goes_on), could_fire(net)
        for _ in range(20):
            if not (wanted & ahead(cell.marking)) - set(cell.fired[settled:]):
                break
            for _ in range(200):
                cell.step()
        assert not (wanted & ahead(cell.marking)) - set(cell.fired[settled:]), outage
