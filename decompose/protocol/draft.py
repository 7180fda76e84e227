"""The net of a protocol while it is being built: places and steps with names that can be read.

Each transition of a protocol net is one *step*, something that happens at one place; beside the net stands what step
it is, of which transition and controller, and which transition of the central net it fires. Names are made of words
and of the net's own names: the place `vote/G2/robot` holds a token while the yes of the robot on G2 is on its way,
`central/robot.Idle` is the place of the central net, `robot.Idle` what the controller holds.

Three things are written here once for all skeletons. *Firing a transition of the central net*: where it is not firable
there, the step happens all the same and the place `astray` gets a token, one transition of the protocol net for each
place that could be the reason; so that the central net cannot follow is a marking that is reached, and the last event
of its firing sequence says why. *Obeying blindly*: what a controller does that changes its places without looking.
*Being down*: a controller that is down takes no step.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Final

from firable.decompose.protocol.parts import Part
from firable.nets.layers import COORDINATOR
from firable.nets.net import Net, Place, Transition

ASTRAY: Final = "astray"
"""Something has fired that the central net could not fire."""

CHANNELS: Final = ("request", "vote", "commit-order", "abort-order", "acknowledgement")
"""The messages of a part, each with a place that holds a token while it is on its way."""
_OF_FREE: Final = ("vote", "commit-order", "acknowledgement")


def channels_of(part: Part) -> tuple[str, ...]:
    """The messages of this part: one that is free of promise is not asked, and has nothing to give up."""
    return _OF_FREE if part.free else CHANNELS


def central(place: str) -> str:
    """The place of the protocol net that holds what the central net has there after the same firings."""
    return f"central/{place}"


def at(kind: str, part: Part) -> str:
    """The place of a kind for a part: a message, a promise, what the coordinator has heard of it."""
    return f"{kind}/{part.whole}/{part.controller}"


def down(controller: str) -> str:
    """The place that holds a token while a controller is down."""
    return f"down/{controller}"


def coordinator_down(coordinator: str) -> str:
    """The place that holds a token while a coordinator is down, which is named as `Parts.decider` does."""
    return "/".join(["coordinator-down", *([] if coordinator == COORDINATOR else [coordinator.partition(" ")[2]])])


def late(channel: str) -> str:
    """The place of a copy of a message that comes late."""
    return f"late/{channel}"


@dataclass(frozen=True, slots=True)
class Step:
    """What one transition of a protocol net is: an event, in the words of a person who watches.

    `kind` is that of the protocol (`promise`, `decide`), `fires` the transition of the central net that fires by it,
    `why` the reason for which the central net cannot follow. Who takes the step is a controller or a `coordinator`, in
    the words of `Parts.decider`; nobody takes what just happens, as the loss of a message.
    """

    kind: str
    text: str
    controller: str = ""
    fires: str = ""
    why: str = ""
    coordinator: str = ""

    def __str__(self) -> str:
        return f"{self.text}, {self.why}" if self.why else self.text


@dataclass(slots=True)
class Draft:
    """Places and steps so far; both keep the order in which they are added."""

    central_net: Net
    onward: bool = False
    places: dict[str, bool] = field(default_factory=dict)
    transitions: list[Transition] = field(default_factory=list)
    steps: dict[str, Step] = field(default_factory=dict)

    def place(self, name: str, *, marked: bool = False) -> str:
        """Add a place, if it is not there."""
        self.places.setdefault(name, marked)
        return name

    def step(
        self,
        name: str,
        step: Step,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        full: Sequence[str] = (),
        empty: Sequence[str] = (),
    ) -> None:
        """Add a step; one of a controller or of the coordinator does not happen while they are down."""

        def once(places: Iterable[str]) -> tuple[str, ...]:
            return tuple(dict.fromkeys(places))

        self.steps[name] = step
        closed = once((*empty, *self._up(step)))
        self.transitions.append(
            Transition(name, once(inputs), once(outputs), once(full), closed, description=str(step))
        )

    def fire(
        self,
        name: str,
        step: Step,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        full: Sequence[str] = (),
        empty: Sequence[str] = (),
    ) -> None:
        """Add a step that fires `step.fires` in the central net too, or leaves it behind."""
        t = self.central_net.transition(step.fires)
        takes, puts, holds, lacks = (
            [central(place) for place in places] for places in (t.inputs, t.outputs, t.permissive, t.inhibitive)
        )
        guard = [ASTRAY] if self.onward else []
        self.step(name, step, [*inputs, *takes], [*outputs, *puts], [*full, *holds], [*empty, *lacks, *guard])
        for places, wanted in (((*t.inputs, *t.permissive), True), ((*t.outputs, *t.inhibitive), False)):
            for place in dict.fromkeys(places):
                why = f"though in the central net {place} is {'empty' if wanted else 'full'}"
                astray = replace(step, why=why)
                known = ([], [central(place)]) if wanted else ([central(place)], [])
                self.step(
                    f"{name}/astray/{place}",
                    astray,
                    inputs,
                    [*outputs, ASTRAY],
                    [*full, *known[0]],
                    [*empty, *known[1]],
                )
        if self.onward:
            self.step(f"{name}/onward", step, inputs, outputs, [*full, ASTRAY], empty)

    def net(self, name: str) -> Net:
        """The net as it stands."""
        places = tuple(Place(place, marked=marked) for place, marked in self.places.items())
        return Net(name, places, tuple(self.transitions))

    def down_places(self, controller: str) -> list[str]:
        """What holds a token while a controller is down, where it can be."""
        return [place] if (place := down(controller)) in self.places else []

    def _up(self, step: Step) -> list[str]:
        if step.kind in OUTSIDE:
            return []
        if step.controller:
            return self.down_places(step.controller)
        return [place] if (place := coordinator_down(step.coordinator)) in self.places else []


OUTSIDE: Final = frozenset({"lose", "double", "late", "crash", "restart", "forget", "cease"})
"""The kinds of steps that nobody takes: they happen, or belong to a crash."""


@dataclass(frozen=True, slots=True)
class Effect:
    """One case of obeying: what is taken, put, and must be found full or empty for the case to be this one."""

    suffix: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    full: tuple[str, ...]
    empty: tuple[str, ...]


def guarded(part: Part) -> Effect:
    """A part is applied where its inputs are full and its outputs empty."""
    return Effect("", part.inputs, part.outputs, (), ())


def blind(part: Part) -> Iterator[Effect]:
    """A part is applied whatever its places hold: its inputs are empty after it, and its outputs full.

    One case for each of what its places may hold: two to the power of their number.
    """
    for present in product((True, False), repeat=len(part.inputs)):
        for free in product((True, False), repeat=len(part.outputs)):
            inputs = list(zip(part.inputs, present, strict=True))
            outputs = list(zip(part.outputs, free, strict=True))
            missing = tuple(place for place, here in inputs if not here)
            full = tuple(place for place, here in outputs if not here)
            suffix = "".join([*(f"/without/{place}" for place in missing), *(f"/onto/{place}" for place in full)])
            yield Effect(
                suffix,
                tuple(place for place, here in inputs if here),
                tuple(place for place, here in outputs if here),
                full,
                missing,
            )


def checked(part: Part) -> Iterator[Effect]:
    """A part is applied if it is firable, gates and all; else nothing is changed."""
    yield Effect("", part.inputs, part.outputs, part.permissive, part.inhibitive)
    for place in dict.fromkeys((*part.inputs, *part.permissive)):
        yield Effect(f"/not/{place}", (), (), (), (place,))
    for place in dict.fromkeys((*part.outputs, *part.inhibitive)):
        yield Effect(f"/not/{place}", (), (), (place,), ())
