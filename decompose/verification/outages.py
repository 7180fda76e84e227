"""The verdicts on who is dead: the net that they leave is made anew, and a document must show each answer of it.

The second text of the division in `firable.decompose.protocol.outages`: what is asked of the net that is left
(`bereft`), and what the answers come to. The answers are those of the document of each verdict, which says what it
shows as any does; which questions there are follows from them, one after the other, and no other may be there. That
this net stands for the protocol without the dead is shown by `dead.smt2`, which is stated anew, too
(`outage_obligations`). Whoever is dead has a verdict, where the bundle speaks of faults at all. It may say that it is
not known; then the file may hold obligations on the same one that the solver refutes, and those on others stand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from firable.decompose.verification.bereft import ALIVE, DEAD, DYING, EARLY, Wake
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.documents import UNDECIDED, answers_in, checked_document
from firable.decompose.verification.explored import Found, answered, refuted
from firable.decompose.verification.outage_obligations import FILE, OF_ONE, OutageObligations
from firable.decompose.verification.recut import Cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers
from firable.decompose.verification.voting import Voting
from firable.nets.bundle import file_stem
from firable.nets.formula import And, Firable, Holds, format_formula
from firable.nets.net import Property, PropertyKind, TemporalProperty
from firable.nets.temporal import Logic, parse_temporal
from firable.nets.verdict import NOTHING, Status, Verdict, Weight

TITLE: Final = "while somebody is dead, what is said to go on does, whatever the crash has left"
METHOD: Final = "the central net, without what the dead may hold up"

_RUNS: Final = "runs played by the reference player"
_SAYS: Final = (
    "while {} is dead, these transitions may stand still for ever, and every other that can fire goes on, whenever the "
    "crash was: where the central net could fire it again when what is under way is over, it can"
)


def check_outages(examination: Examination, cut: Cut, answers: Answers, timeout_ms: int) -> None:
    """Judge the verdicts on who is dead, if the bundle speaks of faults; raises `NotShownError`."""
    if not any(verdict.name.startswith("faults.") for verdict in examination.bundle.verdicts):
        return
    stated = OutageObligations(Voting(cut, faults=True, free=frozenset(examination.bundle.decomposition.free)))
    found: Found | None = None
    for wake in stated.wakes:
        verdict = examination.verdict(wake.name)
        sentence = _SAYS.format(wake.told)
        if verdict.status is Status.UNKNOWN:
            undecided = Verdict(wake.name, Status.UNKNOWN, sentence, METHOD, Weight.INFORMATION, bound=UNDECIDED)
            if verdict != undecided:
                raise NotShownError(
                    f"the verdict on '{wake.name}' says more than that it is open", "verdicts", wake.name
                )
            said = "undecided: the bundle itself does not say"
            examination.judge(verdict, shown=False, method=NOTHING, only_claimed=said)
            continue
        if found is None:  # a file that nothing rests on is none of ours
            found = answered(examination, stated, answers, timeout_ms)
        for name, answer in found.refuted:
            if _rests_on(wake, name):
                raise refuted(FILE, name, answer)
        late = next((f"the solver gave up '{name}' of '{FILE}'" for name in found.open_ if _rests_on(wake, name)), "")
        _judge(examination, wake, verdict, sentence, late, answers, timeout_ms)


def _rests_on(wake: Wake, name: str) -> bool:
    """Whether that the net that is left stands for the protocol rests on an obligation.

    On those on another one who is dead it does not: of that one the bundle may say that it does not know.
    """
    who, (kind, _, of) = wake.name.removeprefix("faults."), name.partition(".")
    return kind not in OF_ONE or of == who or (kind == "promised" and of.startswith(f"{who}."))


def _judge(
    examination: Examination,
    wake: Wake,
    verdict: Verdict,
    sentence: str,
    late: str,
    answers: Answers,
    timeout_ms: int,
) -> None:
    file = f"{file_stem(wake.name)}.evidence.json"
    said = answers_in(examination, file)
    asking = _Asking(wake, said, file)
    subjects, hint = asking.divided()
    files = (file, FILE)
    wanted = Verdict(
        wake.name, Status.PROVED, sentence, METHOD, Weight.INFORMATION, hint=hint, subjects=subjects, evidence=files
    )
    if verdict != wanted:
        raise NotShownError(f"the verdict on '{wake.name}' is not what its proof shows", "verdicts", wake.name)
    if list(said) != [f"property.{of.name}" for of in asking.asked]:
        raise NotShownError(f"'{file}' does not answer what is asked, one after the other", "evidence", file)
    net = replace(wake.net, properties=tuple(asking.asked))
    checked = checked_document(examination, file, net, answers, timeout_ms)
    late = next((one.only_claimed for one in checked if not one.shown), late)
    methods = dict.fromkeys(
        _RUNS if "firings played" in method else method for one in checked for method in one.methods
    )
    how = f"the net that is left, made anew, and tied to the protocol: {'; '.join(methods)}"
    examination.judge(verdict, shown=not late and all(one.shown for one in checked), method=how, only_claimed=late)


@dataclass
class _Asking:
    """The questions in their order, each asked because of the answers before it."""

    wake: Wake
    answers: dict[str, bool]
    file: str

    def __post_init__(self) -> None:
        self.asked: list[Property | TemporalProperty] = []

    def is_so(self, of: Property | TemporalProperty) -> bool:
        self.asked.append(of)
        name = f"property.{of.name}"
        if name not in self.answers:
            raise NotShownError(f"'{self.file}' does not answer '{of.name}'", "evidence", self.file)
        return self.answers[name]

    def divided(self) -> tuple[tuple[str, ...], str]:
        """The transitions that may stand still, those at once first, and what is told of machines."""
        wake = self.wake
        fires = [t.name for t in wake.voting.transitions if self.is_so(_fires(t.name))]
        free = [t for t in fires if t not in wake.held_up and not self.is_so(_kept_from_start(t))]
        going = [t for t in free if self.is_so(_goes_on(f"transition.{t}", [t]))]
        still, running = list[str](), list[str]()
        for machine, sending in wake.sending(fires).items():
            if len(sending) == 1:
                goes = sending[0] in going
            else:
                goes = not set(free).isdisjoint(sending) and self.is_so(_goes_on(f"machine.{machine}", sending))
            (running if goes else still).append(machine)
        at_once = [t for t in fires if wake.is_at_once(t)]
        at_last = [t for t in fires if t not in going and t not in at_once]
        at_once_told, still_told, running_told = (", ".join(some) or "none" for some in (at_once, still, running))
        hint = f"at once: {at_once_told}; machines: {still_told} may stand still, {running_told} go on"
        return (*at_once, *at_last), hint


def _fires(t: str) -> Property:
    return Property(f"fires.{t}", PropertyKind.REACHABLE, Firable(t))


def _kept_from_start(t: str) -> Property:
    return Property(f"kept-from-start.{t}", PropertyKind.NEVER, And((Holds(EARLY), Firable(t))))


def _goes_on(name: str, some: list[str]) -> TemporalProperty:
    """Wherever one of these could still fire, nobody can die in such a way that none of them ever fires again."""
    alive, dying, dead = (format_formula(Holds(place)) for place in (ALIVE, DYING, DEAD))
    one = " or ".join(format_formula(Firable(t)) for t in some)
    hopeless = f"E[{dying} U {dead} and not EF ({one})]"
    text = f"AG (not EF ({alive} and ({one})) or AX (not {dying} or not {hopeless}))"
    return TemporalProperty(f"goes-on.{name}", Logic.CTL, parse_temporal(text))
