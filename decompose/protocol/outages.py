"""What a fault does to the cell: blocked safely or not, which machines may stand still, what goes on, what resumes.

Two explorations answer for all faults that pass: with messages lost and doubled and everybody crashing and restarting,
again and again, the protocol stays safe (the sentences of refinement); and when faults have ceased, nothing is lost:
whatever the central net may fire next can be fired next, so what stood still resumes. One fault of each kind is a case
of that.

Whoever is *dead* never restarts. That is safe too, by the same exploration, since nobody has to restart in it. What the
others can still do is told of each controller and of each coordinator. Every configuration after the crash carries a
marking of the central net, and the dead keep back only what the central net could still fire from there: a transition
that fires once, at start-up, and has fired would not fire again anyway, nor what another choice has ruled out. A
transition

- stands still *at once*, if nothing fires it after the crash: it is local to who is dead, or nobody is left to decide
  it;
- *goes on*, if it can fire again from every configuration after the crash from where the central net could, when what
  is under way is over: whenever the crash was, and whatever was open then, or is opened later;
- *may stand still*, if that is not shown: where the crash leaves promises that nobody takes back, or a round that keeps
  others from being opened, it may never fire again. Another crash may leave none, and then it goes on all the same; and
  it may still finish what was begun, such as a firing that was decided before.

Only what goes on is claimed, and what is over at once. The same is asked of the transitions that send commands to a
machine, taken together, which is not the division of each: a machine that is switched on once and then used may stand
still if its use does, though nothing keeps back the switching on.

All of it is asked of the central net without what the dead may hold up (`bereft`), of whose markings a table or a
diagram is made. What is looked at first is M0. Whoever crashes may do so before anything has fired, and whatever can
fire at all can fire from there; so what does not fire then is kept back. Only of the others is it asked from wherever
somebody may die. Each answer is a property of that net, which a document of evidence shows (`Inquest.document`); that
the net stands for the protocol without the dead is shown by obligations of its own (`dead_script`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from textwrap import wrap
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.claims import Claim, temporal_claim
from firable.analysis.evidence.document import Document, Record
from firable.analysis.evidence.meaning import property_claim
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.goal import Limits
from firable.analysis.question import listed
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.temporal.queries import decide_temporal
from firable.analysis.verdicts.properties import decide_property
from firable.decompose.protocol.bereft import Bereft, deaths, verdict_name
from firable.decompose.protocol.dead_script import FILE as DEAD_FILE
from firable.decompose.protocol.dead_script import DeadProof, prove_of_the_dead
from firable.decompose.protocol.exploring import FIRST_MARKINGS, Exploration, explore_protocol
from firable.decompose.protocol.parts import Parts
from firable.decompose.protocol.variant import ANY_FAULTS, PROTOCOL
from firable.nets.bundle import file_stem
from firable.nets.decomposition import Decomposition
from firable.nets.net import Net, Property, TemporalProperty
from firable.nets.verdict import Status, Verdict, Weight

WHILE_FAULTS: Final = "while messages are lost and doubled, and controllers and coordinators crash and restart"
METHOD: Final = "the central net, without what the dead may hold up"
EVIDENCE_SECONDS: Final = 60.0
TIMEOUT_MS: Final = 10_000
COLUMNS: Final = 120
RESUMES: Final = "when faults have ceased, whatever the central net may fire next, the protocol can fire next"


@dataclass(frozen=True, slots=True)
class Outage:
    """What goes on while somebody is dead: `who` is a controller, or empty, and then the `coordinator` that is.

    A coordinator bears the name of a controller too, which does not die with it. `at_once`, `at_last` and `goes_on`
    divide the transitions of the central net that can fire at all, `still` and `running` the machines that these send
    commands. Those `at_last`, and the machines `still`, may stand still. What goes on is what is not kept back: it may
    have fired for the last time for other reasons. `bound` says why this is not known, where it is not.
    """

    who: str
    at_once: tuple[str, ...] = ()
    at_last: tuple[str, ...] = ()
    goes_on: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    running: tuple[str, ...] = ()
    bound: str = ""
    coordinator: str = ""

    @property
    def name(self) -> str:
        """Who is dead, in words."""
        return self.who or self.coordinator

    @property
    def told(self) -> str:
        """The same where controllers and coordinators stand beside each other, which may bear the same name."""
        return f"controller {self.who}" if self.who else self.coordinator


def fault_exploration(decomposition: Decomposition, limits: Limits) -> Exploration:
    """All runs of the protocol under any number of faults of each kind, which includes one of each."""
    return explore_protocol(decomposition, PROTOCOL, ANY_FAULTS, limits=limits)


def fault_verdicts(found: Exploration) -> tuple[Verdict, ...]:
    """The verdicts on faults that pass: safe while they last, and nothing lost when they have ceased."""
    safe = [
        replace(
            verdict,
            name=f"faults.{verdict.name.removeprefix('explored.')}",
            statement=f"{verdict.statement}, {WHILE_FAULTS}",
        )
        for verdict in found.safety
    ]
    return (*safe, replace(found.complete, name="faults.resumes", statement=RESUMES))


def outages(decomposition: Decomposition, limits: Callable[[], Limits] = Limits) -> Iterator[Outage]:
    """What may stand still and what goes on while each controller is dead, and while each coordinator is.

    The limits are made anew for each.
    """
    yield from (inquest.outage for inquest in inquests(decomposition, limits))


def inquests(
    decomposition: Decomposition, limits: Callable[[], Limits] = Limits, tie: DeadProof | None = None
) -> Iterator[Inquest]:
    """The same, each with what it rests on; `tie` shows that the nets that are left stand for the protocol.

    What a part would keep back that promises, one that is free of promise is said to keep back, too.
    """
    promising = Parts(replace(decomposition, free=()), PROTOCOL)
    for bereft in deaths(promising, decomposition.free):
        yield Inquest(bereft, limits(), "" if tie is None else tie.lacks(bereft))


def sealed_outages(
    decomposition: Decomposition, limits: Callable[[], Limits] = Limits, timeout_ms: int = TIMEOUT_MS
) -> tuple[tuple[Verdict, ...], dict[str, str]]:
    """The verdicts on all who can be dead as a bundle holds them, and the files that show them."""
    tie = prove_of_the_dead(decomposition, timeout_ms)
    found = [inquest.sealed() for inquest in inquests(decomposition, limits, tie)]
    documents = {file: document.to_text() for _, some in found for file, document in some.items()}
    return tuple(verdict for verdict, _ in found), documents | ({DEAD_FILE: tie.text} if documents else {})


@dataclass(frozen=True)
class Inquest:
    """What is asked of the net without who is dead, and the answers."""

    bereft: Bereft
    limits: Limits
    untied: str = ""
    """Why it is not known that the net stands for the protocol without who is dead."""
    answers: dict[str, tuple[Property | TemporalProperty, Verdict]] = field(default_factory=dict)

    @cached_property
    def space(self) -> StateSpace[Any]:
        """The markings of the net; raises `BudgetExceeded` where neither a table nor a diagram holds them."""
        net = self.bereft.net
        graph = explore(net, budget=Budget(FIRST_MARKINGS), deadline=self.limits.deadline)
        return graph if graph.complete else explore_symbolically(net, self.limits)

    @cached_property
    def outage(self) -> Outage:
        """Who is dead, and what that keeps back; not known where the net is too large."""
        dead = Outage(self.bereft.who, coordinator=self.bereft.coordinator)
        if self.untied:
            return replace(dead, bound=self.untied)
        try:
            return self._divided(dead)
        except (IncompleteGraph, BudgetExceeded) as error:
            return replace(dead, bound=str(error))

    def document(self, limits: Limits | None = None) -> Document:
        """What shows the answers, each a record; one that nothing shows says why."""
        limits = limits or Limits(Deadline.after(EVIDENCE_SECONDS))
        net = replace(self.bereft.net, properties=tuple(of for of, _ in self.answers.values()))
        certifier = Certifier(net, self.space.discipline, limits, self.space)
        records = []
        for name, (of, verdict) in self.answers.items():
            claim = _claim(of, proved=verdict.holds)
            record = Record(f"property.{name}", verdict.holds, ())
            try:
                records.append(replace(record, shown=certifier.shown(claim, verdict.witness)))
            except LackingError as error:
                records.append(replace(record, lacking=str(error)))
        return Document(net, self.space.discipline, tuple(records))

    def sealed(self) -> tuple[Verdict, dict[str, Document]]:
        """The verdict, and what shows it, by the name of its file; a verdict that nothing shows is not known."""
        told = outage_verdict(self.outage)
        if not told.holds:
            return told, {}
        document = self.document()
        if lacking := next((record.lacking for record in document.records if record.lacking), ""):
            return outage_verdict(replace(self.outage, bound=f"no evidence: {lacking}")), {}
        file = f"{file_stem(told.name)}.evidence.json"
        return replace(told, evidence=(file, DEAD_FILE)), {file: document}

    def _holds(self, of: Property | TemporalProperty) -> bool:
        if isinstance(of, TemporalProperty):
            verdict = decide_temporal(self.space, of)
        else:
            verdict = decide_property(self.space, of)
        if verdict.status is Status.UNKNOWN:
            raise IncompleteGraph(verdict.bound)
        self.answers[of.name] = (of, verdict)
        return verdict.holds

    def _divided(self, dead: Outage) -> Outage:
        bereft = self.bereft
        firing = tuple(t.name for t in bereft.parts.transitions if self._holds(bereft.fires(t.name)))
        free = {t for t in firing if t not in bereft.held_up and not self._holds(bereft.kept_from_start(t))}
        goes_on = tuple(t for t in firing if t in free and self._holds(bereft.goes_on(f"transition.{t}", (t,))))
        machines = commanding(bereft.parts.net, firing)
        running = []
        for machine, some in machines.items():
            if len(some) == 1:
                goes = some[0] in goes_on
            else:  # where each is kept back from the start, all of them are together
                goes = not free.isdisjoint(some) and self._holds(bereft.goes_on(f"machine.{machine}", some))
            running += [machine] * goes
        return replace(
            dead,
            at_once=tuple(t for t in firing if t in bereft.at_once),
            at_last=tuple(t for t in firing if t not in bereft.at_once and t not in goes_on),
            goes_on=goes_on,
            still=tuple(machine for machine in machines if machine not in running),
            running=tuple(running),
        )


def _claim(of: Property | TemporalProperty, *, proved: bool) -> Claim:
    if isinstance(of, TemporalProperty):
        return temporal_claim(of.logic, of.formula, proved=proved)
    return property_claim(of, proved=proved)


def commanding(net: Net, firing: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """For each machine that is sent commands, the transitions of these that send it one."""
    found: dict[str, tuple[str, ...]] = {}
    for machine in dict.fromkeys(place.command.machine for place in net.places if place.command is not None):
        entered = {place.name for place in net.places if place.command and place.command.machine == machine}
        some = tuple(t for t in firing if not entered.isdisjoint(net.transition(t).outputs))
        if some:
            found[machine] = some
    return found


def outage_verdict(outage: Outage) -> Verdict:
    """As a verdict, for information: what may stand still are its subjects, first what does so at once."""
    at_once, still, running = (", ".join(some) or "none" for some in (outage.at_once, outage.still, outage.running))
    return Verdict(
        f"faults.{verdict_name(outage.who, outage.coordinator)}",
        Status.UNKNOWN if outage.bound else Status.PROVED,
        f"while {outage.name} is dead, these transitions may stand still for ever, and every other that can fire goes "
        "on, whenever the crash was: where the central net could fire it again when what is under way is over, it can",
        METHOD,
        Weight.INFORMATION,
        hint="" if outage.bound else f"at once: {at_once}; machines: {still} may stand still, {running} go on",
        bound=outage.bound,
        subjects=(*outage.at_once, *outage.at_last),
    )


def namesakes(found: Sequence[Outage]) -> str:
    """What is to be said of those that are a controller and a coordinator by one name; empty where nobody is.

    >>> namesakes([Outage("line"), Outage("robot"), Outage("", coordinator="coordinator line")])
    "'line' is a controller and a coordinator: the one fires its parts, the other decides, and either may die alone"
    """
    controllers, coordinators = {one.who for one in found}, (one.coordinator for one in found if not one.who)
    both = [f"'{name}'" for one in coordinators if (name := one.removeprefix("coordinator ")) in controllers]
    if not both:
        return ""
    is_ = "is a controller and a coordinator" if len(both) == 1 else "are each a controller and a coordinator"
    return f"{listed(both)} {is_}: the one fires its parts, the other decides, and either may die alone"


def outage_text(found: Sequence[Outage], columns: int = COLUMNS) -> str:
    """The outages as a text: a paragraph for each, a row for each kind; `goes on` is what a person looks for.

    Rows are folded to so many columns, under their names; no name is broken.

    >>> print(outage_text([Outage("robot", ("move",), ("load",), ("mill",), ("arm",), ("mill",))]), end="")
    controller robot dead
      stands still at once     move
      may stand still          load
      goes on                  mill
      machines that may stand  arm
      machines running         mill
    """
    lines = []
    for outage in found:
        lines.append(f"{outage.told} dead")
        if outage.bound:
            lines.append(f"  not known: {outage.bound}")
            continue
        rows = (
            ("stands still at once", outage.at_once),
            ("may stand still", outage.at_last),
            ("goes on", outage.goes_on),
            ("machines that may stand", outage.still),
            ("machines running", outage.running),
        )
        for title, names in rows:
            start = f"  {title:<24} "
            lines += wrap(
                ", ".join(names) or "-",
                max(columns, 2 * len(start)),
                initial_indent=start,
                subsequent_indent=" " * len(start),
                break_long_words=False,
                break_on_hyphens=False,
            )
    return "".join(f"{line}\n" for line in lines)
