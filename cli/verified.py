"""What `firable verify` has shown, told: what must hold apart from what is told besides, and what holds from what not.

To show a verdict is one thing, and how it ended is another: that a violation is shown is good evidence and bad news. So
the sign says how the verdict ended, the word says that it is shown, and neither stands for both. The verdicts of the
report say only whether something is shown, for a program that asks no more; how each ended is what its claim says.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from firable.cli import text
from firable.cli.report import Report

if TYPE_CHECKING:
    from firable.nets.verdict import Verdict

_VIOLATED: Final = {"required": ("✗", "red"), "warning": ("!", "yellow"), "information": ("·", None)}
_DISCIPLINES: Final = {"interleaving": "interleaving", "step": "synchronous steps"}


@dataclass(frozen=True, slots=True)
class Answer:
    """A verdict that the evidence claims, and what became of it."""

    verdict: Verdict
    claim: Verdict

    @property
    def claims(self) -> bool:
        """Whether something is claimed; of a verdict that must hold it is, since a bundle runs by it."""
        return self.verdict.holds or self.verdict.weight.value == "required"

    @property
    def violated(self) -> bool:
        """Whether it is shown to be violated."""
        return self.verdict.holds and self.claim.status.value == "violated"

    @property
    def must_hold(self) -> bool:
        """Whether it is one of those that must hold."""
        return self.claim.weight.value == "required"

    def mark(self) -> tuple[str, str, str | None]:
        """The sign of how it ended, the word of whether that is shown, and a colour."""
        if not self.verdict.holds:
            return "?", "claimed", "yellow"
        if not self.violated:
            return "✓", "shown", "green"
        sign, colour = _VIOLATED[self.claim.weight.value]
        return sign, "shown: violated", colour


def show(report: Report, *, smt_dir: str | None) -> None:
    """Print a report of `firable verify`, and what became of the obligations that were to be written."""
    answers = [Answer(*pair) for pair in zip(report.verdicts, report.claims, strict=True)]
    text.heading(report.net, report.input)
    if report.bundle:
        _show_bundle(report, answers)
    else:
        click.echo(f"  {_DISCIPLINES[report.discipline]}, external gates free")
        _show_answers(report, answers)
    click.echo(f"\n{summary(answers)}")
    if report.files:
        click.echo(f"\n  {len(report.files)} SMT-LIB 2 files in {Path(report.files[0]).parent}")
    elif smt_dir is not None:
        click.echo("\n  no SMT-LIB 2 files: nothing here is shown by obligations")


def _show_answers(report: Report, answers: Sequence[Answer]) -> None:
    """The answers one by one, first those on what must hold."""
    told: dict[tuple[object, ...], str] = {}
    name_width = max((len(answer.verdict.name) for answer in answers), default=0)
    word_width = max((len(answer.mark()[1]) for answer in answers), default=0)
    for title, must_hold in (("must hold", True), ("told besides", False)):
        some = [answer for answer in answers if answer.must_hold is must_hold]
        if some:
            click.echo(f"\n{click.style(title, bold=True)}")
        for answer in some:
            sign, word, colour = answer.mark()
            name, said = f"{answer.verdict.name:<{name_width}}", answer.claim.statement
            click.echo(f"  {click.style(f'{sign} {word:<{word_width}}', fg=colour)}  {name}  {said}".rstrip())
            for line in text.reasons(report.net, answer.verdict, told, verbose=True):
                click.echo(f"      {line}")


def _show_bundle(report: Report, answers: Sequence[Answer]) -> None:
    from firable.decompose.verification.bereft import PREFIX as DEAD
    from firable.decompose.verification.explored import TITLES
    from firable.decompose.verification.machines import TITLES as MACHINES
    from firable.decompose.verification.outages import TITLE as WHILE_DEAD
    from firable.decompose.verification.protocol import TITLE
    from firable.decompose.verification.refinement import TITLE as REFINEMENT
    from firable.decompose.verification.restating import HEADS

    click.echo(f"  the bundle {report.bundle['digest'][:16]}…: split anew, and stated anew what it must prove")
    if signers := report.bundle.get("signed_by"):
        click.echo("  signed by " + ", ".join(f"{name[:16]}…" for name in signers.split(", ")) + ", which you trust")
    titles = {
        **HEADS,
        "protocol": TITLE,
        **TITLES,
        DEAD: WHILE_DEAD,
        **MACHINES,
        "refinement": REFINEMENT,
        "unit": "of the places of each unit one at most holds a token",
        "persistent": "of each vote it is shown whether it is persistent",
    }
    families: dict[str, list[Answer]] = {family: [] for family in titles}
    others: list[Answer] = []
    for answer in answers:
        name = answer.verdict.name
        families.get(DEAD if name.startswith(DEAD) else name.partition(".")[0], others).append(answer)
    click.echo(f"\n{click.style('obligations', bold=True)}, answered by {report.bundle['solver']}")
    for family, some in families.items():
        if some:
            shown = sum(answer.verdict.holds for answer in some)
            symbol, colour = ("✓", "green") if shown == len(some) else ("?", "yellow")
            count = f"{shown:>4} of {len(some):<4}"
            violated = sum(answer.violated for answer in some)
            ended = f": {shown - violated:,} hold, {violated:,} {_do(violated)} not" if violated else ""
            click.echo(f"  {click.style(symbol, fg=colour)} {count} {family:<16} {titles[family]}{ended}")
    told = [answer for some in families.values() for answer in some if not answer.verdict.holds] + others
    _show_answers(report, [answer for answer in told if answer.claims])
    if undecided := [answer.verdict for answer in told if not answer.claims]:
        click.echo(f"\n{click.style('left undecided by the bundle itself', bold=True)}")
        width = max(len(verdict.name) for verdict in undecided)
        for verdict in undecided:
            click.echo(f"  ? {verdict.name:<{width}}  {verdict.statement}")


def _do(n: int) -> str:
    return "does" if n == 1 else "do"


def summary(answers: Sequence[Answer]) -> str:
    """The last line: how many are shown, how many of these hold, and how many that must hold do not."""
    told = list(_counts(answers))
    return ", ".join(told) or "the document claims nothing"


def _counts(answers: Sequence[Answer]) -> Iterator[str]:
    shown = [answer for answer in answers if answer.verdict.holds]
    violated = [answer for answer in shown if answer.violated]
    if shown:
        n, must = len(violated), sum(answer.must_hold for answer in violated)
        of_these = "which need not hold" if not must else f"{must:,} of which must hold"
        yield f"{len(shown):,} shown{f' ({n:,} to be violated, {of_these})' if violated else ''}"
    if not_shown := sum(answer.claims and not answer.verdict.holds for answer in answers):
        yield f"{not_shown:,} not shown"
    if undecided := sum(not answer.claims for answer in answers):
        yield f"{undecided:,} left undecided"
