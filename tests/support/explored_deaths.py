"""The machines of the protocol explored to the end while one of them dies and never restarts: the oracle of `outages`.

Nothing here knows the net that the prover asks (`bereft`), nor the protocol's net: it is the executor's own code that
runs, in every order, and somebody is killed at every point of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

from firable.decompose.protocol.outages import commanding
from firable.executor.protocol.deciders import controller_of, coordinators
from firable.executor.protocol.messages import Effect, Firing, Message
from firable.executor.simulation.exploring import Explorer, explore
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, Net
from firable.semantics.player import Player

ALIVE, DEAD = Budget(crashes=1), Budget()


class Bereaved(Explorer):
    """The explored machines, of which `doomed` is killed once, and is not restored; sensors show what they show."""

    def __init__(self, decomposition: Decomposition, doomed: int) -> None:
        super().__init__(decomposition)
        self.doomed = doomed

    def steps(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """What those do who are alive; a message to the dead is heard by nobody."""
        dead = at.budget == DEAD
        for step, after in super().steps(at):
            if step.machine != self.doomed:
                if not step.kind.endswith("crash"):
                    yield step, after
            elif not dead:
                yield step, after
            elif isinstance(step.about, Message):
                unheard = Step("unheard", step.machine, step.about, (), step.before, step.before)
                yield unheard, self.counted(replace(at, under_way=at.under_way - {step.about}))

    def restored(self, number: int, which: int) -> tuple[int, tuple[Effect, ...]]:
        """Nobody is: the machine stays as it was when it was killed, and says nothing."""
        del which
        return number, ()


@dataclass(frozen=True, slots=True)
class Bereavement:
    """What the machines still do when one of them is dead: of each transition, and of each group of commands."""

    configurations: int
    complete: bool
    fired: frozenset[str]
    """The transitions that fire after the death in some run."""
    kept_back: frozenset[tuple[str, ...]]
    """The groups of which none may fire again, though the central net could fire one."""


def bereavements(decomposition: Decomposition, most: int) -> Iterator[Bereavement]:
    """What goes on without each controller, then each coordinator that decides; of so many configurations at most."""
    above, deciding = coordinators(decomposition), {row.at for row in decomposition.coordinated}
    controllers = range(len(above), len(above) + len(decomposition.subnets))
    deciders = (i for i, name in enumerate(above) if controller_of(name) in deciding)
    yield from (bereavement(decomposition, doomed, most) for doomed in (*controllers, *deciders))


def bereavement(decomposition: Decomposition, doomed: int, most: int) -> Bereavement:
    """What goes on without the machine of this number, of so many configurations at most."""
    explorer = Bereaved(decomposition, doomed)
    space = explore(explorer, ALIVE, max_configurations=most, edges=True)
    after = {at: out for at, out in space.edges.items() if at.budget == DEAD}
    fires = {at: {t for step, _ in out for t in _fired(step)} for at, out in after.items()}
    net = decomposition.net
    firing = tuple(t.name for t in net.transitions)
    groups = dict.fromkeys([*((t,) for t in firing), *commanding(net, firing).values()])
    could = could_fire(net)
    kept_back = set[tuple[str, ...]]()
    if space.complete:
        before = _backwards(after)
        for group in groups:
            again = _closed({at for at, some in fires.items() if not some.isdisjoint(group)}, before)
            markings = {explorer.central.marking(at.central) for at in after.keys() - again}
            if any(not could(marking).isdisjoint(group) for marking in markings):
                kept_back.add(group)
    fired = frozenset(t for some in fires.values() for t in some)
    return Bereavement(len(space.edges), space.complete, fired, frozenset(kept_back))


def _fired(step: Step) -> Iterator[str]:
    return (effect.transition for effect in step.effects if isinstance(effect, Firing))


def _backwards(
    edges: dict[Configuration, list[tuple[Step, Configuration]]],
) -> dict[Configuration, list[Configuration]]:
    before: dict[Configuration, list[Configuration]] = {}
    for at, out in edges.items():
        for _, after in out:
            before.setdefault(after, []).append(at)
    return before


def _closed(found: set[Configuration], before: dict[Configuration, list[Configuration]]) -> set[Configuration]:
    new = list(found)
    while new:
        for at in before.get(new.pop(), ()):
            if at not in found:
                found.add(at)
                new.append(at)
    return found


def could_fire(net: Net) -> Callable[[Marking], frozenset[str]]:
    """Of a marking, what the central net may fire from there, now or later."""
    player = Player(net)

    @cache
    def ahead(marking: Marking) -> frozenset[str]:
        found, seen, new = set[str](), {marking}, [marking]
        while new:
            at = new.pop()
            for t in player.may_fire(at):
                found.add(net.transitions[t].name)
                if (after := player.fire(at, [t])) not in seen:
                    seen.add(after)
                    new.append(after)
        return frozenset(found)

    return ahead
