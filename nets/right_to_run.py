"""The right to run: which verdicts a net needs, and what keeps a bundle from running.

What must be proved is derived from the net and its decomposition, never read from the verdicts that a bundle brings:
a list of its own demands could be shortened by whoever writes the bundle. Whatever else a verdict says that it is
required adds to the demands, and nothing takes from them. Who makes a bundle and who runs one ask the same function,
so that no bundle is made that could not run. Nothing is imported here that reads or proves: this is the policy alone.

To require a further verdict: its name in `required_verdicts`, and a test that the prover really gives it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from firable.nets.deciding import deciders, groups, owners
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.evidence_names import named_as_proved
from firable.nets.free_parts import unfounded
from firable.nets.joining import join
from firable.nets.layers import Layers
from firable.nets.net import Net
from firable.nets.verdict import Verdict, Weight

if TYPE_CHECKING:
    from firable.nets.bundle import Bundle
    from firable.nets.decomposition import Decomposition

_REMEDY: Final = "make the bundle anew with `firable bundle`"

EXECUTED_BY: Final = "interleaving"
"""The discipline of the executor."""

CHECKED: Final = ("contact-free", "deadlock-free", "quasi-live", "conflicting-commands", "shared-completions")
"""The verdicts on every net, whatever its file states, without which it may not run."""

_VOTING: Final = ("promise", "stand", "hear")
_AFTER: Final = ("give-up", "restart", "apply", "apply-free", "release", "note", "close", "forget")
_ADVANCES: Final = (*_VOTING, *_AFTER)
PROTOCOL: Final = (
    "protocol.starts",
    *(f"protocol.keeps.{action}" for action in ("ask", *_VOTING, "decide", *_AFTER, "fire", "sense", "sense-late")),
    *("protocol.waits.enabled", "protocol.waits.promised", "protocol.persists.decide", "protocol.persists.fire"),
    *("protocol.follows.decide", "protocol.follows.fire", "protocol.rest", "protocol.once", "protocol.expected"),
    *(f"protocol.home.{step}" for step in ("some", "give-up", "apply", "apply-free", "release", "note", "close")),
    *(f"protocol.complete.{step}" for step in ("ask", *_VOTING, "decide", "fire", "sense")),
    *(f"protocol.advances.{action}" for action in _ADVANCES),
)
"""The theorem on the protocol by which every net is executed (docs/protocol-invariant.md)."""


def required_verdicts(decomposition: Decomposition) -> Iterator[str]:
    """The names of the verdicts that must be PROVED before a net may run: derived from the net, not from what is there.

    Of the net what `CHECKED` names and every property of the file; of the decomposition Eq. (7), (8) and O3 for every
    transition, Eq. (9)-(10) for every place, O2 for every global transition and wherever transitions compete,
    O8 where there are layers, ownership, M0, commands, and arbitration; and the theorem on the protocol.
    """
    net = decomposition.net
    yield from required_of_the_net(net)
    yield from (f"{equation}.{t.name}" for t in net.transitions for equation in ("eq7", "eq8", "o3"))
    yield from (f"eq9-10.{place.name}" for place in net.places)
    yield from (f"o2.{t.name}" for t in net.transitions if len(owners(net, t)) > 1)
    yield from (
        f"o2.{place.name}"
        for p, place in enumerate(net.places)
        if len(net.competitors[p]) > 1 or len(net.producers[p]) > 1 or p in net.fault_transitions
    )
    if Layers(net).several:
        yield "o8"
        yield from (f"o8.{t.name}" for t in net.transitions if len(owners(net, t)) > 1)
        yield "o8-apart"
    yield from ("ownership", "initial-marking", "commands", "arbitration")
    yield from (f"arbitration.{group.name}" for group in decomposition.groups)
    yield from PROTOCOL


def required_of_the_net(net: Net) -> Iterator[str]:
    """The names of the verdicts of `firable check` that must hold of a net, by which transitions fire one at a time."""
    yield from CHECKED
    yield from (f"property.{prop.name}" for prop in net.properties)


def unproved(bundle: Bundle) -> tuple[Diagnostic, ...]:
    """What keeps a bundle from running (F5002): nothing where every required verdict is PROVED, with its evidence.

    Required is what the net requires, and whatever else a verdict of the bundle says that it does. Verdicts on the net
    must be on interleaving, by which it is executed, and a document of evidence must have a record on each; obligations
    must bring what another solver can check; the subnets must join into the very net, and the table decide what that
    net makes of it (`firable.nets.deciding`). Parts free of promise must disturb nobody, and their votes be proved
    persistent (`firable.nets.free_parts`).
    """
    problems = []
    on_the_net = set(required_of_the_net(bundle.net))
    by_name: dict[str, list[Verdict]] = {}
    for verdict in bundle.verdicts:
        by_name.setdefault(verdict.name, []).append(verdict)
    shown = _documents(bundle, {file for verdict in bundle.verdicts if verdict.holds for file in verdict.evidence})
    stated = (verdict.name for verdict in bundle.verdicts if verdict.weight is Weight.REQUIRED)
    for name in dict.fromkeys((*required_verdicts(bundle.decomposition), *stated)):
        if name not in by_name:
            message = f"there is no verdict on '{name}'"
            problems.append(Diagnostic("F5002", message, _REMEDY, ("verdicts", name)))
        for verdict in by_name.get(name, ()):
            subject = ("verdicts", name)
            if not verdict.holds:
                message = f"'{name}' is {verdict.status.value}, not proved: {verdict.statement}"
                hint = verdict.hint or "`firable check` and `firable prove` show why"
                problems.append(Diagnostic("F5002", message, hint, subject))
            elif name in on_the_net and verdict.discipline != EXECUTED_BY:
                proved_of = f"'{name}' is proved of the discipline '{verdict.discipline}'"
                message = f"{proved_of}, and the net is executed by {EXECUTED_BY}"
                problems.append(Diagnostic("F5002", message, _REMEDY, subject))
            elif not verdict.evidence:
                message = f"'{name}' is said to be proved, without evidence"
                problems.append(Diagnostic("F5002", message, _REMEDY, subject))
            elif name in on_the_net and not any(name in shown.get(file, (name,)) for file in verdict.evidence):
                message = f"the evidence that '{name}' names has no record of its being proved of this net"
                problems.append(Diagnostic("F5002", message, _REMEDY, subject))
            for file in verdict.evidence:
                if file not in bundle.evidence:
                    message = f"the evidence '{file}' for '{name}' is missing"
                    problems.append(Diagnostic("F5002", message, _REMEDY, subject))
    for name in bundle.decomposition.doubled:
        message = f"'{name}' names two parts, so that no verdict on it is known to be on either"
        problems.append(Diagnostic("F5002", message, _REMEDY, ("transitions", name)))
    joins = _joins(bundle.decomposition)
    for transition, message in unfounded(bundle.decomposition, by_name) if joins else ():
        problems.append(Diagnostic("F5002", message, _REMEDY, ("transitions", transition)))
    if not joins:
        message = "the subnets do not make the net together, of which the verdicts are"
        problems.append(Diagnostic("F5002", message, _REMEDY, ("subnets",)))
    else:
        problems += list(_undecided_conflicts(bundle.decomposition)) or _decided_otherwise(bundle.decomposition)
    return tuple(problems)


def _documents(bundle: Bundle, files: set[str]) -> dict[str, frozenset[str]]:
    """The verdicts that each document of evidence speaks of as proved; obligations are no such document."""
    return {
        file: frozenset() if file.endswith(".smt2") else named_as_proved(bundle.evidence[file], bundle.net, EXECUTED_BY)
        for file in sorted(files & set(bundle.evidence))
    }


def _joins(decomposition: Decomposition) -> bool:
    """Whether the subnets and the table make the central net, but for numbers that the split gave, and words."""
    try:
        joined = join(decomposition)
    except (KeyError, InputError):  # a part without its subnet, or subnets that make no net
        return False
    return _bare(joined) == _bare(decomposition.net)


def _bare(net: Net) -> Net:
    return replace(
        net, transitions=tuple(replace(transition, number=None, description="") for transition in net.transitions)
    )


def _undecided_conflicts(decomposition: Decomposition) -> Iterator[Diagnostic]:
    """Conflicts that no group of the table decides: then nothing was proved about them either."""
    net = decomposition.net
    group_of = {name: group.name for group in decomposition.groups for name in (*group.sequence, *group.rest)}
    for p, place in enumerate(net.places):
        for together in (net.competitors[p], net.producers[p]):
            deciders = {group_of.get(net.transitions[t].name) for t in together}
            if len(together) > 1 and (None in deciders or len(deciders) > 1):
                message = f"the conflict at '{place.name}' is not decided by one arbitration group"
                yield Diagnostic("F5002", message, _REMEDY, ("places", place.name))


def _decided_otherwise(decomposition: Decomposition) -> Iterator[Diagnostic]:
    """What the table decides otherwise than the net makes it: by another coordinator, or in another order."""
    net = decomposition.net
    at = deciders(net)
    rows = [(row.name, row.at, sorted(part.controller for part in row.parts)) for row in decomposition.coordinated]
    if rows != [(name, at[name], sorted(map(str, owners(net, net.transition(name))))) for name in at]:
        message = "the rows of the table, with their coordinators and who takes part, are not those of the net"
        yield Diagnostic("F5002", message, _REMEDY, ("table",))
    elif decomposition.groups != tuple(groups(net, at)):
        message = "the arbitration groups of the table do not decide as those of the net"
        yield Diagnostic("F5002", message, _REMEDY, ("table",))
