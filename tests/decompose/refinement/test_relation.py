"""What is asked of the relation between a conceptual and its detailed net: which obligation each wrong net refutes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from firable.analysis import branching_bisimilar, explore
from firable.decompose.refinement.binding import bindings
from firable.decompose.refinement.naming import named
from firable.decompose.refinement.opening import open_tasks
from firable.decompose.verification.naming_anew import Named
from firable.decompose.verification.opening import Opening
from firable.decompose.verification.relating import Relation
from firable.decompose.verification.solvers import by_cvc5
from firable.nets.net import ExternalGate, Net
from firable.nets.tasks.model import Catalogue
from firable.nets.tasks.text import parse_tasks
from firable.nets.text import parse_net

TIMEOUT_MS = 10_000

NET = """\
firable: 1
cell: related
controllers:
  system:
    coordinator: true
    start: [a, b, c, d, p, u]
    places:
      one: {task: {name: fetch, arm: a, shelf: b}}
      two: {task: {name: fetch, arm: c, shelf: d}}
      a:   {opens: {to: x.a, machine: A}}
      b:   {opens: {to: y.b, machine: B, prefix: b_}}
      c:   {opens: {to: x.c, machine: C}}
      d:   {opens: {to: y.d, machine: D}}
      p:
      q:
      u:
      v:
  x:
  y: {inputs: [b_full]}
transitions:
  t1: {from: [system.p, system.a], if: system.b, to: system.one}
  t2: {from: system.one, to: [system.q, system.a]}
  t3: {from: system.q, to: system.p}
  t4: {from: system.u, if: system.b, to: system.v}
  t5: {from: system.v, to: system.u}
  t6: {from: system.c, if: system.d, to: system.two}
  t7: {from: system.two, to: system.c}
"""
TASKS = """\
firable_tasks: 1
tasks:
  fetch:
    roles:
      arm:   {steps: {go: , left: , right: , up: }}
      shelf: {inputs: {full: "{shelf.prefix}full"}, steps: {open: , shut: }}
    start: {if: shelf.full}
    moves:
      s: {from: shelf.open, to: shelf.shut}
      l: {from: arm.go, to: arm.left, if: shelf.open}
      r: {from: arm.go, to: arm.right, unless: shelf.open}
      g: {from: [arm.left, shelf.shut], to: arm.up, release: shelf}
      h: {from: [arm.right, shelf.shut], to: arm.up, release: shelf}
"""
WITHIN = """\
  work:
    roles: {robot: {steps: {home: }}, store: }
    subtasks: {fetching: {task: {name: fetch, arm: robot, shelf: store}}}
    start: {to: robot.home}
    end: {from: fetching}
    moves: {n: {from: robot.home, to: fetching, release: store}}
"""


def opened(net: Net, tasks: Catalogue) -> tuple[Named, Net]:
    """A net with its tasks opened, whatever `refine` would say of it."""
    anew = Named(Opening(net, tasks))
    detailed = named(net, open_tasks(net, bindings(net, tasks), tasks)).net
    assert not list(anew.differences(detailed))
    return anew, detailed


def place(anew: Named, words: str) -> str:
    """A place of the detailed net: `q`, or `one/arm.go` for the one within `one`."""
    return anew.places["system." + words.replace("/", "\n")]


def transition(anew: Named, words: str) -> str:
    """A transition of the detailed net: `t1`, or `one/l`."""
    return anew.transitions["system." + words.replace("/", "\n") if "/" in words else words]


def refuted(anew: Named, detailed: Net) -> list[str]:
    """The obligations that do not hold, by the words for their transitions."""
    relation = Relation(anew, detailed)
    said = by_cvc5(relation.text, TIMEOUT_MS)
    keys = {name: key.removeprefix("system.").replace("\n", "/") for key, name in anew.transitions.items()}
    found = [name for (name, _), answer in zip(relation.obligations, said[1::2], strict=True) if answer != "unsat"]
    return [".".join((kind, keys[t])) if t else kind for kind, _, t in (name.partition(".") for name in found)]


def alike(anew: Named, detailed: Net) -> bool:
    """Whether both nets are bisimilar, and neither has contact, as exploring says."""
    net, names = anew.opening.net, {t.name: anew.transitions[t.name] for t in anew.opening.net.transitions}
    graphs = explore(net), explore(detailed)
    assert not any(graphs[0].contacts()), "nothing is said of a net with contact"
    visible = {name: name for name in names.values()}
    return branching_bisimilar(*graphs, names, visible, divergence=True) and not any(graphs[1].contacts())


def changed(net: Net, of: str, **changes: Any) -> Net:
    """A net with another transition of this name."""
    return replace(net, transitions=tuple(replace(t, **changes) if t.name == of else t for t in net.transitions))


def started(net: Net, *places: str) -> Net:
    """A net with tokens on these places instead."""
    return replace(net, places=tuple(replace(p, marked=p.name.removeprefix("system.") in places) for p in net.places))


def borrowed_where_it_is_not(net: Net) -> Net:
    """The task takes a shelf that nobody has, and frees it inside."""
    net = changed(started(net, "a", "c", "d", "p", "u"), "t1", permissive=(), inhibitive=("system.b",))
    return changed(net, "t4", inputs=("system.u", "system.b"), permissive=())


def filled_out_of_nothing(net: Net) -> Net:
    """What holds the task back from being started again is idle only in what is shown."""
    gates = {"permissive": ("system.p",), "inhibitive": ("system.b",)}
    net = changed(started(net, "c", "d", "p", "u"), "t1", inputs=(), outputs=("system.one", "system.b"), **gates)
    net = changed(net, "t4", inputs=("system.u", "system.b"), permissive=(), inhibitive=("system.one",))
    return changed(changed(net, "t2", outputs=()), "t6", inputs=("system.c", "system.v"))


FULL, NOT_FULL = ExternalGate("y.b_full"), ExternalGate("y.b_full", wanted=False)


@pytest.mark.parametrize(
    ("change", "obligations"),
    [
        (lambda net: started(net, "one", "b", "c", "d", "u"), ["starts"]),  # a task that nobody started
        (borrowed_where_it_is_not, ["follows.t1", "contact.t1"]),
        (filled_out_of_nothing, ["contact.t1"]),
        (lambda net: changed(net, "t4", permissive=(), inhibitive=("system.b",)), ["follows.t4", "contact.t4"]),
        (lambda net: changed(net, "t1", external=(NOT_FULL,)), ["fires.t1"]),  # the task wants it full
    ],
)
def test_what_opened_tasks_do_otherwise_than_the_conceptual_net_is_refuted(
    change: Callable[[Net], Net], obligations: list[str]
) -> None:
    anew, detailed = opened(change(parse_net(NET)), parse_tasks(TASKS))
    assert refuted(anew, detailed) == obligations
    assert not alike(anew, detailed)


NESTED = NET.replace("{name: fetch, arm: a, shelf: b}", "{name: work, robot: a, store: b}")
NEVER = TASKS.replace("if: shelf.open", "if: [shelf.open, shelf.full], unless: shelf.full")


@pytest.mark.parametrize(
    ("change", "net", "tasks"),
    [
        (lambda net: net, NET, TASKS),
        (lambda net: changed(net, "t5", external=(FULL, NOT_FULL)), NET, TASKS),
        (lambda net: changed(net, "t5", outputs=("system.u", "system.v")), NET, TASKS),
        (lambda net: net, NET, NEVER),
        (lambda net: net, NESTED, TASKS + WITHIN),
    ],
)
def test_what_can_never_fire_and_what_ends_with_a_task_within_is_related(
    change: Callable[[Net], Net], net: str, tasks: str
) -> None:
    anew, detailed = opened(change(parse_net(net)), parse_tasks(tasks))
    assert refuted(anew, detailed) == []
    assert alike(anew, detailed)


def more(kind: str, *places: str) -> Callable[[Named, Net, str], Net]:
    """The same with further places in the inputs, outputs or gates of a transition, by their keys."""

    def make(anew: Named, detailed: Net, name: str) -> Net:
        there = (*getattr(detailed.transition(name), kind), *(place(anew, words) for words in places))
        changes: dict[str, Any] = {kind: there}
        return changed(detailed, name, **changes)

    return make


def instead(kind: str, *places: str) -> Callable[[Named, Net, str], Net]:
    """The same with other places there."""

    def make(anew: Named, detailed: Net, name: str) -> Net:
        none: dict[str, Any] = {kind: ()}
        return more(kind, *places)(anew, changed(detailed, name, **none), name)

    return make


def never(_: Named, detailed: Net, name: str) -> Net:
    """The same with gates that never open together."""
    return changed(detailed, name, external=(FULL, NOT_FULL))


@pytest.mark.parametrize(
    ("key", "change", "obligations"),
    [
        ("t3", never, ["fires"]),
        ("t3", more("outputs", "q"), ["fires"]),
        ("t3", more("outputs", "u"), ["follows", "fires", "contact"]),
        ("t3", more("outputs", "u", "v"), ["follows", "fires", "contact"]),
        ("t3", more("inhibitive", "p"), []),
        ("t3", more("inhibitive", "u"), ["fires"]),
        ("t3", instead("inputs"), ["follows", "contact"]),
        ("one/l", instead("permissive"), ["hidden"]),
        ("one/r", instead("inhibitive"), ["hidden"]),
        ("one/l", more("permissive", "p"), ["fires"]),
        ("one/l", never, ["fires"]),
        ("one/l", more("outputs", "one/arm.go"), ["fires"]),
        ("one/l", instead("outputs", "one/arm.right"), ["hidden"]),
        ("one/l", more("inputs", "q"), ["hidden", "fires"]),
        ("one/l", more("outputs", "b"), ["hidden"]),
        ("one/l", more("inputs", "two/arm.go"), ["hidden", "fires"]),
        ("one/l", instead("outputs"), ["hidden"]),
        ("one/g", instead("outputs", "one/arm.up"), ["hidden"]),
    ],
)
def test_a_transition_that_is_not_as_opened_refutes_what_is_asked_of_it(
    key: str, change: Callable[[Named, Net, str], Net], obligations: list[str]
) -> None:
    anew, detailed = opened(parse_net(NET), parse_tasks(TASKS))
    name = transition(anew, key)
    assert refuted(anew, change(anew, detailed, name)) == [f"{one}.{key}" for one in obligations]


@pytest.mark.parametrize("words", ["q", "one/arm.go", "b"])
def test_another_marking_at_the_start_is_not_that_of_the_conceptual_net(words: str) -> None:
    anew, detailed = opened(parse_net(NET), parse_tasks(TASKS))
    name = place(anew, words)
    places = (replace(p, marked=not p.marked) if p.name == name else p for p in detailed.places)
    assert refuted(anew, replace(detailed, places=tuple(places))) == ["starts"]
