"""Reports as text for a person: a symbol and a word for each verdict, and counterexamples told step by step.

A witness is told in the words of the cell: each transition by its name and description, and in the end the places that
hold a token. A sequence that several verdicts share is told once. Colours are for terminals only, and switched off by
NO_COLOR; the words say everything that the colours say.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from textwrap import wrap
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import click

from firable.cli.story import cures_told, waits_told
from firable.nets.source import one_line

if TYPE_CHECKING:
    from firable.cli.report import Report
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.net import Net
    from firable.nets.verdict import Cost, Verdict, Witness

SIGNS: Mapping[str, str] = {"proved": "✓", "violated": "✗", "unknown": "?"}
"""The sign of each status."""
_HEADINGS = {"required": "must hold", "warning": "warnings", "information": "for information"}


COLUMNS: Final = 120
"""How wide long lists are folded where the output goes to no terminal."""
SUBJECTS_SHOWN: Final = 12
"""So many of the names that a violated verdict is about are told."""
ALIKE_SHOWN: Final = 2
"""Of how many errors with one cause each is told in full; of more, the first is, and the others are counted."""
_NAMES_SHOWN: Final = 4
_QUOTED: Final = re.compile(r"'[^']*'")


def show_diagnostics(diagnostics: Iterable[Diagnostic]) -> None:
    """Print what is wrong or questionable, to standard error: what differs in names alone once, and how many more."""
    causes: dict[tuple[str, ...], list[Diagnostic]] = {}
    for diagnostic in diagnostics:
        causes.setdefault(_cause(diagnostic), []).append(diagnostic)
    for alike in causes.values():
        for diagnostic in alike if len(alike) <= ALIKE_SHOWN else alike[:1]:
            show_diagnostic(diagnostic)
        if len(alike) > ALIKE_SHOWN:
            click.echo(f"  {_further(alike)}", err=True)


def _cause(diagnostic: Diagnostic) -> tuple[str, ...]:
    """What diagnostics with the same cause share: all words but the names."""
    words = (diagnostic.message, diagnostic.hint)
    return (diagnostic.code, diagnostic.severity.value, *(_QUOTED.sub("''", text) for text in words))


def _further(alike: Sequence[Diagnostic]) -> str:
    """How many more there are of one cause, and the first names of them."""
    told = [_QUOTED.findall(diagnostic.message) for diagnostic in alike]
    at = next((i for i, names in enumerate(zip(*told, strict=False)) if len(set(names)) > 1), None)
    if at is None:  # the same words, at several places
        return f"and {counted(len(alike) - 1, 'more place')} with the same error"
    names = list(dict.fromkeys(names[at] for names in told[1:]))
    more = f", and {len(names) - _NAMES_SHOWN} others" if len(names) > _NAMES_SHOWN else ""
    return f"the same of {len(alike) - 1} more: {', '.join(names[:_NAMES_SHOWN])}{more}"


def show_diagnostic(diagnostic: Diagnostic) -> None:
    """Print one diagnostic, to standard error: its first line stands out."""
    first, _, rest = str(diagnostic).partition("\n")
    colour = "red" if diagnostic.severity.value == "error" else "yellow"
    click.echo(click.style(first, fg=colour) + (f"\n{rest}" if rest else ""), err=True)


def heading(net: Net, where: str) -> None:
    """Print which net the report is about."""
    click.echo(f"{click.style(net.name or 'the net', bold=True)}  {click.style(where, dim=True)}")
    counts = [(len(net.places), "place"), (len(net.transitions), "transition"), (len(net.controllers), "controller")]
    click.echo("  " + ", ".join(counted(n, word) for n, word in counts if n or word != "controller"))


def counted(n: int, word: str) -> str:
    """A number with its noun."""
    from firable.nets import verdict

    return verdict.counted(n, word)


def first_of(some: Sequence[str], most: int) -> str:
    """The first of some names, and how many more there are.

    >>> first_of(("a", "b", "c"), 2)
    'a, b and 1 more'
    """
    more = len(some) - most
    return ", ".join(some[:most]) + (f" and {more:,} more" if more > 0 else "")


def rule(sequence: Sequence[str], by: str) -> str:
    """How the arbiter of a group chooses, in words; without a `sequence` given it is the order of the file."""
    words = {"priority": "by priority", "order": "in a given order", "rotation": "in rotation"}
    return words[by] if sequence else "by the order of the file"


def show_verdicts(
    net: Net, verdicts: Sequence[Verdict], *, verbose: bool = False, loops: Mapping[str, Net] = MappingProxyType({})
) -> None:
    """Print all verdicts, those that must hold first, with the witnesses of what is violated.

    Method and cost, and the witnesses of warnings and of what is reachable and shall be, are told only if `verbose`.
    `loops` are the nets that the witnesses of some are of, by the names of these verdicts.
    """
    told: dict[tuple[object, ...], str] = {}
    width = max((len(verdict.name) for verdict in verdicts), default=0)
    for weight, title in _HEADINGS.items():
        some = [verdict for verdict in verdicts if verdict.told_as.value == weight]
        if some:
            click.echo(f"\n{click.style(title, bold=True)}")
        for verdict in some:
            click.echo(verdict_line(verdict, width))
            for line in reasons(loops.get(verdict.name, net), verdict, told, verbose=verbose):
                click.echo(f"      {line}")


def verdict_line(verdict: Verdict, width: int = 0, *, fold: bool = False) -> str:
    """The line of a verdict: symbol, word, name, statement; with `fold` a long statement goes on under itself."""
    symbol, word, colour = mark(verdict)
    said = one_line(verdict.statement)
    if fold:
        hang = len(f"  {symbol} {word:<8}  {verdict.name:<{width}}  ")
        lines = wrap(said, max(columns() - hang, 40), break_long_words=False, break_on_hyphens=False)
        said = f"\n{'':{hang}}".join(lines)
    return f"  {click.style(f'{symbol} {word:<8}', fg=colour)}  {verdict.name:<{width}}  {said}"


def mark(verdict: Verdict) -> tuple[str, str, str | None]:
    """How a verdict ended: a sign, a word, a colour."""
    weight, status = verdict.weight.value, verdict.status.value
    if verdict.expected is not None and status != "unknown":
        return ("=", "expected", None) if verdict.outcome.value == "proved" else ("✗", "changed", "red")
    if status == "proved":
        return "✓", "yes" if weight == "information" else "proved", "green"
    if status == "unknown":
        return "?", "unknown", "yellow"
    match weight:
        case "required":
            return "✗", "violated", "red"
        case "warning":
            return "!", "warning", "yellow"
        case _:
            return "·", "no", None


def reasons(
    net: Net, verdict: Verdict, told: dict[tuple[object, ...], str] | None = None, *, verbose: bool = False
) -> Iterator[str]:
    """What is told below the line of a verdict: how far was looked, about what, the witness, the hint with its code.

    `told` holds the sequences that were told before, by the verdict that told them. Each is one line, whatever the net
    file says in the words that it is free to choose.
    """
    return map(one_line, _reasons(net, verdict, {} if told is None else told, verbose=verbose))


def _reasons(net: Net, verdict: Verdict, told: dict[tuple[object, ...], str], *, verbose: bool) -> Iterator[str]:
    from firable.nets.rules import hints_of
    from firable.nets.verdict import NOTHING

    status = verdict.status.value
    if verdict.expected is not None and verdict.outcome.value == "proved":
        yield f"{status}, as expected"
        if not verbose:
            return
    if verbose and verdict.method != NOTHING:
        yield f"by {verdict.method}{_cost(verdict.cost)}"
    if status == "proved" and verdict.hint:
        yield verdict.hint
    if status == "unknown" and verdict.bound:
        yield f"reached: {verdict.bound}"
    if status == "violated" and verdict.subjects:
        yield f"about: {first_of(verdict.subjects, SUBJECTS_SHOWN)}"
    if verdict.witness is not None and (verbose or (status == "violated" and verdict.told_as.value == "required")):
        yield from _witness(net, verdict.name, verdict.witness, told)
    for code, hint in hints_of(verdict):
        yield f"hint: [{code}] {hint}"
    if verdict.cures and (verbose or verdict.told_as.value == "required"):
        key = tuple(cure.changes for cure in verdict.cures)
        if key in told:
            yield f"cured by the same change as {told[key]}"
        else:
            told[key] = verdict.name
            yield from cures_told(verdict)


def _cost(cost: Cost) -> str:
    """What a verdict took, as far as it is known."""
    counts = [counted(n, word) for n, word in ((cost.markings, "marking"), (cost.edges, "edge")) if n is not None]
    seconds = [] if cost.seconds is None else [f"{cost.seconds:.2g} s"]
    return "".join(f", {part}" for part in (*counts, *seconds))


def _witness(net: Net, name: str, witness: Witness, told: dict[tuple[object, ...], str]) -> Iterator[str]:
    if witness.assignment:
        yield "refuted by: " + ", ".join(f"{of} = {int(value)}" for of, value in witness.assignment)
        if witness.note:
            yield f"then {witness.note}"
        return
    key = (witness.firings, witness.cycle)
    if key in told and (witness.firings or witness.cycle):
        yield f"by the same firings as {told[key]}" + (f": {witness.note}" if witness.note else "")
        return
    told[key] = name
    if witness.firings:
        yield "from the initial marking fire:"
        yield from (f"  {line}" for line in told_steps(net, witness.firings))
    else:
        yield "already in the initial marking:"
    if witness.note:
        yield witness.note
    at_rest = _machines_at_rest(net)
    if said := [name for name in witness.marking if name not in at_rest]:
        yield f"then hold a token: {', '.join(said)}"
    if witness.waits:
        yield "in a circle, each waiting for the next:"
        yield from (f"  {line}" for line in waits_told(net, witness.waits))
    if witness.cycle:
        yield "and then for ever again:"
        yield from (f"  {line}" for line in told_steps(net, witness.cycle, len(witness.firings) + 1))


def _machines_at_rest(net: Net) -> frozenset[str]:
    """Of a cell with its machines, the places that say what was so from the beginning: that one is idle, or empty."""
    from firable.nets.machines.loop import ACCIDENT, PLANT

    if ACCIDENT not in net.place_index:
        return frozenset()
    return frozenset(place.name for place in net.places if place.owner == PLANT and place.marked)


def told_steps(net: Net, firings: Sequence[Sequence[str]], first: int = 1) -> Iterator[str]:
    """A firing sequence as numbered steps, each transition with its description."""
    width = max((len(name) for fired in firings for name in fired), default=0)
    for k, fired in enumerate(firings, start=first):
        for i, name in enumerate(fired):
            number = f"{k:>3}." if i == 0 else "   +"
            yield f"{number} {name:<{width}}  {one_line(net.transition(name).description)}".rstrip()


_OUTCOMES: Final = {"violated": "changed", "unknown": "unknown though expected", "proved": "as expected"}


def show_summary(report: Report) -> None:
    """Print the last line: how it ended, and how many verdicts there are of each kind."""
    word, colour = {0: (good_end(report.verdicts), "green"), 1: ("violated", "red")}.get(
        report.exit_code, ("not decided", "yellow")
    )
    parts = [f"{n:,} {kind}" for n, kind in endings(report.verdicts)]
    click.echo(f"\n{click.style(word, fg=colour, bold=True)}: {', '.join(parts) or 'there is nothing to hold'}")
    show_page(report)


def good_end(verdicts: Iterable[Verdict]) -> str:
    """The words for a report of which nothing fails."""
    return "all as expected" if any(one.expected and one.status.value == "violated" for one in verdicts) else "all hold"


def endings(verdicts: Sequence[Verdict]) -> Iterator[tuple[int, str]]:
    """How many verdicts ended in each way, of those that must hold or are held to an end, and how many warnings."""
    expected = [verdict for verdict in verdicts if verdict.expected]
    others = [verdict for verdict in verdicts if not verdict.expected]
    for status in ("violated", "unknown", "proved"):
        if n := sum(verdict.status.value == status and verdict.matters for verdict in others):
            yield n, status
    for outcome, word in _OUTCOMES.items():
        if n := sum(verdict.outcome.value == outcome for verdict in expected):
            yield n, word
    warned = [one.status.value for one in others if one.weight.value == "warning" and one.status.value != "proved"]
    if n := len(warned):
        unknown = f" ({warned.count('unknown'):,} unknown)" if "unknown" in warned else ""
        yield n, ("warning" if n == 1 else "warnings") + unknown


def columns() -> int:
    """How wide long lists are folded: as the terminal is, and 120 where the output goes elsewhere."""
    return shutil.get_terminal_size((COLUMNS, 24)).columns if sys.stdout.isatty() else COLUMNS


def show_page(report: Report) -> None:
    """Print where the report stands as a page, if one was written."""
    if report.page:
        click.echo(f"  the report as a page: {report.page}")
