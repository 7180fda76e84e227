"""Filling the bundle: a net may be bundled only when everything that it must prove is proved.

The obligations of the decomposition are proved here; what exploring the net shows is handed in as the report of
`firable.analysis.check`, because verdicts alone do not say of which net they are: those on a good net would let any
other run. So the net that is bundled is the one in the report. What is demanded of both is what the executor will
demand when it reads the bundle: both ask `unproved`, so that no bundle is made that could not run. Which votes are
persistent goes with them, and which parts are free of promise for it: those that the bundle shows to be. The evidence
on all of it goes along, so that the bundle can be checked again without anything that made it
(`firable.decompose.verification`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.check import AGAIN, INTERRUPTED
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.producing.lacking import NO_TIME, is_of_budget, is_of_size, what_to_allow
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.analysis.report import CheckReport
from firable.decompose.proofs.closed_loops import UNDECIDED, sealed_loops
from firable.decompose.proofs.proving import TIMEOUT_MS, ProofReport, prove
from firable.decompose.protocol.outages import sealed_outages
from firable.decompose.protocol.shown import proved_without_exploring
from firable.decompose.refinement.sealing import Origin, sealed
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import persistence
from firable.decompose.splitting.votes import SECONDS as UNITS_SECONDS
from firable.decompose.splitting.votes import votes
from firable.nets.bundle import Bundle
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Net
from firable.nets.right_to_run import unproved
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.trace import Discipline

EVIDENCE: Final = "check.evidence.json"
"""The file of a bundle that shows the verdicts on its net, as `firable check --evidence` writes it."""
SECONDS: Final = 30.0
"""How long evidence for the verdicts on the net is looked for, unless somebody says otherwise."""


METHOD: Final = "shown by its evidence"
"""How each verdict on the net was found, as a bundle says it: what it tells besides is for `firable check` to say."""
_LESS: Final = "that is a limit of size, which no time moves: make it smaller, or ask for less by the property"
_MORE: Final = f"allow more time to look for evidence, with --max-seconds; without it, that is {SECONDS:g} s"
_BUDGET: Final = "F3004"


class UnbundledError(InputError):
    """Why a bundle may not be made (F4003, or F3004 for a budget that ended), with the verdicts meant for it."""

    def __init__(self, diagnostics: Iterable[Diagnostic], verdicts: tuple[Verdict, ...]) -> None:
        super().__init__(diagnostics)
        self.verdicts = verdicts


def make_bundle(
    report: CheckReport,
    limits: Limits | None = None,
    *,
    timeout_ms: int = TIMEOUT_MS,
    protocol: bool = False,
    faults: bool = False,
    plant: str = "",
    origin: Origin | None = None,
    begins: Callable[[str], object] = lambda _: None,
) -> Bundle:
    """Split the net of a report, prove the decomposition and bundle both with all verdicts and their evidence.

    `limits` are for each kind of evidence anew: what of the report cannot be shown in that time is only claimed.
    `firable verify` will say so of a warning; a verdict that is required is no reason to run without evidence. With
    `protocol` and `faults` the bundle holds the verdicts on the protocol of this very net, too, with the parts that are
    free of promise, proved by an invariant. With the text of a `plant` file it holds that file, that its machines keep
    what votes rely on (O4), that the cell does with them what it must, and what their faults lead to; with an `origin`,
    the conceptual net and the tasks of which the net is made, and that it does what that one does. `begins` is told
    what is done next. Ctrl-C ends it, and so does `begins` by raising `KeyboardInterrupt`: then nothing is made.

    Raises `InputError`: F4001 and F2011 where the net cannot be split; F4003 where the report is not that of exploring
    this net by interleaving, which is how it will be executed, and where the net is not made of its origin. For all
    that must be proved and is not, or is not shown, it is an `UnbundledError` (F4003; F3004 where a budget ended, and
    where Ctrl-C has).
    """
    if report.net != report.space.net:
        message = f"the verdicts are on another net than '{report.net.name}'"
        raise InputError([Diagnostic("F4003", message, "check the net that is to be bundled")])
    if not report.discipline is report.space.discipline is Discipline.INTERLEAVING:
        message = "the verdicts are on another discipline than interleaving, by which the net is executed"
        raise InputError([Diagnostic("F4003", message, "check the net with the discipline interleaving")])
    course = _Course(begins, [*report.verdicts])
    families = ["explored"] * (protocol or faults) + ["faults"] * faults
    try:
        return _made(report, limits, course, timeout_ms, families, plant, origin)
    except KeyboardInterrupt:
        raise course.ended() from None


@dataclass
class _Course:
    """What is being done, and the verdicts that are known by then."""

    begins: Callable[[str], object]
    known: list[Verdict]
    doing: str = ""

    def begin(self, doing: str) -> None:
        self.doing = doing
        self.begins(doing)

    def ended(self) -> UnbundledError:
        """What Ctrl-C has left."""
        bound = f"{INTERRUPTED}: {self.doing}"
        open_ = Verdict(
            "bundle", Status.UNKNOWN, "all that the bundle must hold is proved", "nothing", bound=bound, hint=AGAIN
        )
        return UnbundledError([Diagnostic(_BUDGET, bound, AGAIN)], (*self.known, open_))


def _made(
    report: CheckReport,
    limits: Limits | None,
    course: _Course,
    timeout_ms: int,
    families: list[str],
    plant: str,
    origin: Origin | None,
) -> Bundle:
    seconds = SECONDS if limits is None else limits.deadline.left_seconds
    course.begin("votes")
    decomposition = split(report.net)
    cast = votes(decomposition, Deadline.after(UNITS_SECONDS))
    proof = prove(decomposition, timeout_ms=timeout_ms, cast=cast, begins=course.begin)
    course.known += proof.verdicts
    if any(verdict.bound == INTERRUPTED for verdict in proof.verdicts):
        raise KeyboardInterrupt  # which has ended the proof alone
    course.begin("persistent votes")
    found = persistence(decomposition, report.space, cast=cast)
    voted, shown = found.with_evidence()
    voted = tuple(_as_shown(verdict, verdict.evidence, report.net) for verdict in voted)
    decomposition = replace(decomposition, free=found.free_as_shown(voted))
    course.known += voted
    course.begin("evidence on the net")
    document = evidence_of_report(report, (), _anew(limits, seconds))
    named = {record.name for record in document.records if not record.lacking}
    on_the_net = (_as_shown(v, (EVIDENCE,) if v.name in named else (), report.net) for v in report.verdicts)
    course.begin("protocol")
    run, obligations = proved_without_exploring(decomposition, families, timeout_ms)
    course.known += run
    dead, last_rites = tuple[Verdict, ...](), dict[str, str]()
    if "faults" in families:
        course.begin("what goes on without the dead")
        dead, last_rites = sealed_outages(decomposition, lambda: _anew(limits, seconds), timeout_ms)
        dead = tuple(replace(v, bound=UNDECIDED) if v.status is Status.UNKNOWN else v for v in dead)
        course.known += dead
    held, machines, unshown = tuple[Verdict, ...](), dict[str, str](), dict[str, str]()
    if plant:
        course.begin("loop with the machines")
        held, machines, unshown = sealed_loops(decomposition, plant, lambda: _anew(limits, seconds))
        course.known += held
    refined, opened = tuple[Verdict, ...](), dict[str, str]()
    if origin is not None:
        course.begin("refinement")
        refined, opened = sealed(report.net, origin, _anew(limits, seconds), timeout_ms)
    course.begin("seal")
    verdicts = (*on_the_net, *proof.verdicts, *run, *dead, *held, *voted, *refined)
    proofs = {**proof.files, **obligations, **last_rites}
    files = {EVIDENCE: document.to_text(), **proofs, **machines, **shown, **opened}
    bundle = Bundle(decomposition, verdicts, files)
    if problems := (*unproved(bundle), *_given_up(proof)):
        lacking = {record.name: record.lacking for record in document.records if record.proved and record.lacking}
        lacking |= {v.name: unshown.get(v.name, NO_TIME) for v in held if v.holds and not v.evidence}
        loops = {verdict.name: verdict for verdict in held}
        raise UnbundledError((_unbundled(problem, lacking, loops) for problem in problems), verdicts)
    return bundle


def _as_shown(verdict: Verdict, evidence: tuple[str, ...], net: Net) -> Verdict:
    """A verdict on the net as a bundle holds it: what its evidence shows, and nothing that it does not.

    One that must hold and does not is left as it is, since because of it no bundle is made.
    """
    if verdict.weight is Weight.REQUIRED and not verdict.holds:
        return verdict
    weight = verdict.weight
    if verdict.name == "effective-conflicts":
        weight = Weight.INFORMATION if verdict.holds or _arbitrated(net) else Weight.WARNING
    return Verdict(
        verdict.name,
        verdict.status,
        verdict.statement,
        METHOD,
        weight,
        bound=UNDECIDED if verdict.status is Status.UNKNOWN else "",
        evidence=evidence,
        discipline=verdict.discipline,
    )


def _arbitrated(net: Net) -> bool:
    """Whether all that takes from one place, or puts on it, is decided by one arbiter of the file."""
    some = (together for together in (*net.competitors, *net.producers) if len(together) > 1)
    named = ({net.transitions[t].name for t in together} for together in some)
    return all(any(together.issubset(arbiter.among) for arbiter in net.arbiters) for together in named)


def _anew(limits: Limits | None, seconds: float | None) -> Limits:
    """So many seconds from now on, and the memory of these limits."""
    deadline = NEVER if seconds is None else Deadline.after(seconds)
    return Limits(deadline) if limits is None else replace(limits, deadline=deadline)


def _given_up(proof: ProofReport) -> Iterator[Diagnostic]:
    """The obligations that no net requires, but what its bundle says of it does, and that were not answered in time."""
    for verdict in proof.verdicts:
        if verdict.weight is Weight.INFORMATION and not verdict.holds:
            message = f"'{verdict.name}' is {verdict.status.value}, not proved: {verdict.statement}"
            code = _BUDGET if verdict.status is Status.UNKNOWN else "F5002"
            yield Diagnostic(code, message, verdict.hint, ("verdicts", verdict.name))


def seen_by(verdict: Verdict, net: str = "NET", plant: str = "PLANT") -> str:
    """How one comes to see of a verdict on a closed loop what it is: by more time, or where the run is shown.

    Nothing where Ctrl-C has left it unknown, since the verdict says how already.
    """
    if verdict.hint == AGAIN:
        return ""
    if verdict.status is Status.UNKNOWN:
        return _MORE
    command = "prove" if verdict.name.startswith("o4.") else "check"
    return f"`firable {command} {net} --machines {plant}` shows the run"


def _unbundled(problem: Diagnostic, lacking: Mapping[str, str], loops: Mapping[str, Verdict]) -> Diagnostic:
    """What keeps a bundle from running, said to who makes it."""
    name = problem.subject[-1]
    family, _, rest = name.removeprefix("loop.").partition(".")
    if family == "property":
        problem = replace(problem, subject=("properties", rest))
    if name in lacking:
        message = f"'{name}' is proved, and there is no evidence that shows it again: {lacking[name]}"
        hint, code = _LESS if is_of_size(lacking[name]) else _MORE, "F4003"
        if is_of_budget(lacking[name]):
            code = _BUDGET
            hint = _MORE if lacking[name].endswith(NO_TIME) else f"allow {what_to_allow(lacking[name])}"
        return replace(problem, code=code, message=message, hint=hint)
    if name in loops:
        hint = "; ".join(filter(None, (problem.hint, seen_by(loops[name]))))
        return replace(problem, code="F4003", hint=hint)
    return problem if problem.code == _BUDGET else replace(problem, code="F4003")
