"""`firable prove NET --protocol`: the protocol of the split, explored as a net of its own, with its free parts.

Three options, from the question to the details: does the protocol do what the net does (`--protocol`), what does a
fault do to the cell (`--faults`), and which of the protocols known to be wrong would go wrong on this very net
(`--wrong`), which tells what the cell lives on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from firable.cli import text

if TYPE_CHECKING:
    from firable.analysis.evidence.document import Document
    from firable.decompose.protocol.building import ProtocolNet
    from firable.decompose.protocol.outages import Outage
    from firable.decompose.protocol.refuting import Refutation
    from firable.decompose.protocol.single_faults import OneFault
    from firable.nets.decomposition import Decomposition
    from firable.nets.verdict import Verdict

EVENTS_SHOWN: Final = 12
"""How many of the last events are told of a run that nobody reads whole."""

NAMES_SHOWN: Final = 4
"""Of how many verdicts that a finding rests on the names are told; of more, the first are, and the others counted."""

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Asked:
    """Which questions about the protocol are asked."""

    protocol: bool
    faults: bool
    wrong: bool

    def __bool__(self) -> bool:
        """Whether any is."""
        return self.protocol or self.faults or self.wrong


@dataclass(frozen=True)
class Answered:
    """What was found: verdicts, the protocols that their runs are of, and what is told beside them."""

    verdicts: tuple[Verdict, ...] = ()
    protocols: Mapping[str, ProtocolNet] = field(default_factory=dict)
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    outages: tuple[Outage, ...] = ()
    faults: tuple[OneFault, ...] = ()
    refutations: tuple[Refutation, ...] = ()
    free: tuple[tuple[str, str], ...] | None = None
    """The parts that need no promise in the protocol that was explored, by transition and controller; None unasked."""


def protocol_options(command: F) -> F:
    """The options that ask about the protocol."""
    for option in (
        click.option(
            "--wrong", is_flag=True, help="Try on NET the protocols known to be wrong; tells what the cell lives on."
        ),
        click.option(
            "--faults", is_flag=True, help="Say what a lost message, a crash, a dead controller does; slower."
        ),
        click.option("--protocol", is_flag=True, help="Explore the voting protocol of the split, as a net of its own."),
    ):
        command = option(command)
    return command


def ask(
    decomposition: Decomposition,
    asked: Asked,
    seconds: float,
    *,
    evidence: bool,
    begins: Callable[[str], object] = lambda _: None,
) -> Answered:
    """Ask about the protocol; `seconds` are for each exploration, and `begins` is told what is done next.

    Ctrl-C ends the questions: what was found stays, and a verdict says that there is more.
    """
    from firable.analysis.deadline import Deadline
    from firable.analysis.goal import Limits
    from firable.decompose.protocol.dead_script import FILE as DEAD_FILE
    from firable.decompose.protocol.dead_script import prove_of_the_dead
    from firable.decompose.protocol.outages import inquests, outage_verdict
    from firable.decompose.protocol.refuting import readable, refute
    from firable.decompose.protocol.single_faults import single_faults
    from firable.decompose.protocol.verdicts import protocol_verdicts
    from firable.decompose.protocol.wrong import wrong_protocols
    from firable.decompose.splitting.persistence import persistence

    def limits() -> Limits:
        return Limits(Deadline.after(seconds))

    verdicts: tuple[Verdict, ...] = ()
    free: tuple[tuple[str, str], ...] | None = None
    protocols: dict[str, ProtocolNet] = {}
    files: dict[str, str | bytes] = {}
    dead: list[tuple[Outage, Verdict]] = []
    refutations: list[Refutation] = []
    interrupted: tuple[Verdict, ...] = ()
    try:
        timeout_ms = max(1, round(seconds * 1000))
        if asked.protocol or asked.faults:
            begins("asking which parts need no promise")
            votes = persistence(decomposition)
            voted, shown_votes = votes.with_evidence()
            verdicts, free = voted, votes.free_as_shown(voted)
            running = replace(decomposition, free=free)
            begins("exploring the protocol" + " with and without faults" * asked.faults)
            found = protocol_verdicts(running, limits, faults=asked.faults, timeout_ms=timeout_ms)
            verdicts, protocols = (*voted, *found.verdicts), found.protocols
            begins("writing the evidence of it")
            files = {**shown_votes, **found.evidence()} if evidence else {}
        if asked.faults:
            begins("asking what goes on while somebody is dead")
            tie = prove_of_the_dead(running, timeout_ms)
            for inquest in inquests(running, limits, tie):
                verdict, shown = inquest.sealed() if evidence else (outage_verdict(inquest.outage), {})
                dead.append((inquest.outage, verdict))
                files |= dict(_packed(file, document) for file, document in shown.items())
            files |= {DEAD_FILE: tie.text} if evidence else {}
        for wrong in wrong_protocols(decomposition.net) if asked.wrong else ():
            begins(f"trying the wrong protocol {wrong.name}")
            refutations.append(readable(refute(wrong, decomposition, limits())))
    except KeyboardInterrupt:
        interrupted = (_interrupted(),)
    verdicts += tuple(verdict for _, verdict in dead) + tuple(one.verdict for one in refutations) + interrupted
    protocols |= {refutation.verdict.name: refutation.protocol for refutation in refutations}
    outages = tuple(outage for outage, _ in dead)
    faults = single_faults(decomposition, verdicts) if asked.faults else ()
    return Answered(verdicts, protocols, files, outages, faults, tuple(refutations), free)


def _packed(file: str, document: Document) -> tuple[str, bytes]:
    data = document.to_bytes()
    return (file if data.startswith(b"{") else f"{file}.gz"), data


def _interrupted() -> Verdict:
    from firable.nets.verdict import NOTHING, Status, Verdict

    says, hint = "all that was asked of the protocol is answered", "--timeout bounds each exploration"
    return Verdict("explored.asked", Status.UNKNOWN, says, NOTHING, hint=hint, bound="interrupted")


def show(answered: Answered) -> None:
    """Print what was found of the protocol."""
    required = [v for v in answered.verdicts if v.name.partition(".")[0] in {"explored", "faults"}]
    shown = [verdict for verdict in required if not verdict.name.startswith("faults.dead")]
    if shown:
        click.echo(f"\n{click.style('the protocol', bold=True)}")
        width = max(len(verdict.name) for verdict in shown)
        for verdict in shown:
            click.echo(text.verdict_line(verdict, width, fold=True))
        cost = shown[0].cost
        if cost.markings is not None:
            free = len(answered.free or ())
            told = f"; {text.counted(free, 'part')} without a promise" if free else ""
            click.echo(f"  {text.counted(cost.markings, 'configuration')} of the protocol ({shown[0].method}){told}")
    if answered.faults:
        _show_faults(answered.faults)
    if answered.outages:
        from firable.decompose.protocol.outages import namesakes, outage_text

        click.echo(f"\n{click.style('what may stand still while somebody is dead', bold=True)}")
        for line in _folded(namesakes(answered.outages), 2):
            click.echo(f"  {line}")
        for line in outage_text(answered.outages, text.columns() - 2).splitlines():
            click.echo(f"  {line}")
    if answered.refutations:
        click.echo(f"\n{click.style('what this cell lives on', bold=True)}")
        for refutation in answered.refutations:
            _show_refutation(refutation)


def _show_faults(faults: Sequence[OneFault]) -> None:
    from firable.decompose.protocol.single_faults import LEAD, TITLES

    click.echo(f"\n{click.style('what one fault does', bold=True)}")
    for line in _folded(LEAD, 2):
        click.echo(f"  {line}")
    for fault in faults:
        click.echo(f"  {fault.fault}")
        for title, finding in zip(TITLES, fault.findings, strict=True):
            status = "" if finding.status is None else f"{text.SIGNS[finding.status.value]} {finding.status.value}"
            colour = {"proved": "green", "violated": "red", "unknown": "yellow"}.get(status[2:])
            by = f" ({', '.join(_some(finding.by))})" if finding.by else ""
            first, *rest = _folded(f"{title}: {finding.says}{by}", 16)
            click.echo(f"    {click.style(f'{status:<10}', fg=colour)}  {first}")
            for line in (*rest, *_folded(finding.lacking, 16)):
                click.echo(f"{'':16}{line}")


def _folded(words: str, indent: int) -> list[str]:
    return wrap(words, max(text.columns() - indent, 40), break_long_words=False, break_on_hyphens=False)


def _some(names: Sequence[str]) -> Sequence[str]:
    """The first of many names, and how many more there are."""
    return names if len(names) <= NAMES_SHOWN else (*names[:NAMES_SHOWN], f"and {len(names) - NAMES_SHOWN:,} more")


def _show_refutation(refutation: Refutation) -> None:
    wrong = refutation.wrong
    status = refutation.status.value
    click.echo(f"  {wrong.name}: {wrong.says} ({wrong.obligation})")
    click.echo(f"      {refutation.outcome}")
    _show_run(refutation)
    if status == "unknown":
        click.echo(f"      reached: {refutation.bound}")
    if (small := refutation.small) is not None:
        click.echo(f"      {small.of_example}:")
        _show_run(small)


def _show_run(refutation: Refutation) -> None:
    from firable.decompose.protocol.directed import numbered

    lines = list(numbered(refutation.lines))
    left_out = 0 if refutation.small is None else max(0, len(lines) - EVENTS_SHOWN)
    if left_out:
        click.echo(f"      ... {left_out} events, then")
    width = max((len(numbers) for numbers, _ in lines[left_out:]), default=0)
    for numbers, words in lines[left_out:]:
        click.echo(f"      {numbers:>{max(3, width)}}. {words}")
    if refutation.sentence:
        click.echo(f"      {refutation.sentence}")
