"""Firing sequences for refusals that are found in the arcs alone, and the words in which those of a task are told.

That a resource does not add up (`ledger`) is seen at one transition, without a run. Who reads the refusal asks how it
comes about: a role that is released twice was released before, by another move. So the run is looked for afterwards: a
shortest firing sequence to a marking in which that transition has all that it takes, its gates open. It decides
nothing: where the budget ends before one is found, or none leads there, the refusal stands as it is.

The texts of a task are templates, and its net, closed, has them as they are: a document of evidence is about that net,
to the letter. For a reader the name of a role stands for whoever fills it, as it does in the names of the steps:
`{source}` and `{source.machine}` are told as `source`, which `source.held` is a step of, and `{source.side}` as
`source's side`. The alternative, to tell a task in the names of a place that it was opened for, would tell one cause
once for each such place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

from firable.analysis.spaces.reachability import Budget, explore
from firable.decompose.refinement.closed import AGAIN, closed
from firable.nets.diagnostics import Diagnostic
from firable.nets.formula import And, Holds, Not
from firable.nets.net import Command, Net
from firable.nets.tasks.model import Task
from firable.nets.tasks.text import filled, names_in_template
from firable.nets.verdict import Witness

MARKINGS_MAX: Final = 10_000
"""How many markings are looked through for a run that only illustrates."""


def with_run(problems: Iterable[Diagnostic], net: Net, at: int = 1) -> Iterator[Diagnostic]:
    """The problems of transitions of a net, each with a run to where its transition has all that it takes.

    The name of the transition stands at this index of the subject.
    """
    graph = None
    for problem in problems:
        graph = graph or explore(net, budget=Budget(MARKINGS_MAX))
        t = net.transition(problem.subject[at])
        ready = And((*map(Holds, (*t.inputs, *t.permissive)), *(Not(Holds(place)) for place in t.inhibitive)))
        witness = graph.witness(graph.satisfying(ready))
        yield replace(problem, message=problem.message + told(witness)) if witness and witness.firings else problem


def with_run_of_task(problems: Iterable[Diagnostic], task: Task) -> Iterator[Diagnostic]:
    """The problems of a task, each with a run of its closed net, in the names of the task."""
    if found := list(problems):
        yield from with_run(found, closed(task), at=2)


def told(witness: Witness) -> str:
    """A firing sequence and where it leads, as the end of a sentence, with names quoted as those of a cause are."""
    fired = ", ".join(name for step in witness.firings for name in step)
    marking = f" the tokens are on '{', '.join(witness.marking)}'" if witness.marking else ""
    return f"; after '{fired}'{marking}" if fired else f"; in the initial marking{marking}"


def readable(net: Net) -> Net:
    """The net of a task, closed, with its texts in words: a role's name for whoever fills it, and no braces.

    >>> from firable.nets.catalogue import catalogue_tasks
    >>> readable(closed(catalogue_tasks()["load"])).transition("start").description
    'start of loading from source'
    """

    def words(text: str) -> str:
        return filled(text, {name: _word(name) for name in names_in_template(text)})

    def command(of: Command | None) -> Command | None:
        parameters = () if of is None else tuple((key, words(value)) for key, value in of.parameters)
        return of and Command(words(of.machine), words(of.command), parameters)

    return replace(
        net,
        places=tuple(replace(p, description=words(p.description), command=command(p.command)) for p in net.places),
        transitions=tuple(
            replace(t, description=_AGAIN if t.name == AGAIN else words(t.description)) for t in net.transitions
        ),
    )


_AGAIN: Final = "all roles are idle, and are given to the task once more"


def _word(name: str) -> str:
    role, _, key = name.partition(".")
    return role if key in {"", "machine"} else f"{role}'s {key}"
