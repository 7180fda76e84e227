"""What the surroundings of a controller alone rely on besides the proof: a vote that stands, stands on taken commands.

The proof knows no commands. But an order to a free part may only arrive where the commands of its inputs are taken
(`executor/simulation/surroundings.py`), so whoever explores a controller alone has to see that none is voted for
before. It is a watcher of its own kind, as it needs the machine itself, which `local_tie` tells in relations.
"""

from __future__ import annotations

from support.local_tie import LocalTie

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import ToCoordinator
from firable.executor.simulation.exploring import Explorer
from firable.executor.simulation.repertoire import Configuration, Step


class AloneTie(LocalTie):
    """Holds each act to the proof, and each vote that stands to what an order relies on besides."""

    def __call__(self, explorer: Explorer, before: Configuration, step: Step, after: Configuration) -> None:
        super().__call__(explorer, before, step, after)
        machine = explorer.machine(step.after)
        reports = [] if step.kind.endswith("crash") else [e for e in step.effects if isinstance(e, ToCoordinator)]
        if isinstance(machine, LocalController) and reports:
            for t in reports[-1].readiness.transitions & machine.free:
                assert not machine.parts[t].takes & machine.unsent, f"'{t}' is voted for before a command is taken"
