"""What verdicts look like in a notebook: a sign, a sentence, and of what is violated the run and what would cure it.

A notebook asks what it shows for HTML (`_repr_html_`), and puts it among what others have written. So there is no style
sheet in it, no script and no id but those of pictures; colours are those of the page around, but for the signs, which
are signs and words as well. Rejected: the report's page in a frame. It is a page, and a notebook wants a paragraph.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from typing import Final

from firable.nets.rules import hints_of
from firable.nets.verdict import Status, Verdict, Weight, Witness

_SIGNS: Final = {Status.PROVED: ("✓", "#11693a"), Status.VIOLATED: ("✗", "#b3123b"), Status.UNKNOWN: ("?", "#a25b00")}
_OF_WEIGHT: Final = {Weight.REQUIRED: "must hold", Weight.WARNING: "warning", Weight.INFORMATION: "for information"}
_STEPS_MAX: Final = 30


def verdict_html(verdict: Verdict, picture: str = "") -> str:
    """A verdict as HTML; `picture` is an SVG of its run, shown instead of the names of its steps.

    >>> verdict_html(Verdict("live", Status.PROVED, "every transition is live", "exploration")).count("✓ proved")
    1
    """
    sign, colour = _SIGNS[verdict.outcome]
    expected = f", where {verdict.expected} is expected" if verdict.expected is not None else ""
    if verdict.expected is verdict.status:
        expected = ", as expected"
    lines = [
        f'<b style="color:{colour}">{sign} {verdict.status}{expected}</b> {escape(verdict.statement)} '
        f"<small>({escape(verdict.name)}, {_OF_WEIGHT[verdict.weight]}, by {escape(verdict.method)})</small>"
    ]
    lines += [_paragraph(line) for line in _more(verdict, picture)]
    return f"<div>{''.join(lines)}{picture}</div>"


def _paragraph(text: str) -> str:
    return f'<div style="margin-left:1.5em">{escape(text)}</div>'


def _more(verdict: Verdict, picture: str) -> Iterator[str]:
    """What is to be said of a verdict that is not proved, or ends otherwise than is expected."""
    if not verdict.holds:
        yield from _story(verdict, picture)
    for code, hint in hints_of(verdict):
        yield f"[{code}] {hint}"
    for cure in verdict.cures:
        yield f"cured by: {'; and '.join(cure.changes)}"


def _story(verdict: Verdict, picture: str) -> Iterator[str]:
    """How far was looked, the run or the values, and who waits for whom where it ends."""
    if verdict.bound and verdict.status is Status.UNKNOWN:
        yield f"reached: {verdict.bound}"
    if verdict.witness is not None:
        if not picture:
            yield from _told(verdict.witness)
        if verdict.witness.note:
            yield verdict.witness.note
        yield from (wait.told() for wait in verdict.witness.waits)


def _told(witness: Witness) -> Iterator[str]:
    if witness.assignment:
        yield "values: " + ", ".join(f"{name} = {int(value)}" for name, value in witness.assignment)
    for word, firings in (("run", witness.firings), ("and then for ever", witness.cycle)):
        if firings:
            more = f" … ({len(firings):,} steps)" if len(firings) > _STEPS_MAX else ""
            yield f"{word}: {', '.join(' + '.join(fired) for fired in firings[:_STEPS_MAX])}{more}"


def verdicts_html(title: str, verdicts: Iterable[Verdict], pictures: Mapping[str, str]) -> str:
    """Verdicts as HTML, those that must hold and do not first; the proved ones as a line that unfolds.

    `pictures` holds the SVG of a run by the name of its verdict.
    """
    order = list(Weight)
    some = sorted(verdicts, key=lambda verdict: order.index(verdict.weight))
    rest = [verdict for verdict in some if not verdict.holds]
    proved = [verdict for verdict in some if verdict.holds]
    parts = [f"<p><b>{escape(title)}</b></p>"]
    parts += [verdict_html(verdict, pictures.get(verdict.name, "")) for verdict in rest]
    if proved:
        inside = "".join(map(verdict_html, proved))
        parts.append(f"<details><summary>✓ {len(proved):,} proved</summary>{inside}</details>")
    return f"<div>{''.join(parts)}</div>"


def told_apart(verdicts: Sequence[Verdict], most: int) -> Iterator[Verdict]:
    """The violated verdicts whose runs are worth a picture: those that must hold, each run once, at most so many."""
    seen: set[tuple[object, ...]] = set()
    for verdict in verdicts:
        witness = verdict.witness
        if verdict.status is not Status.VIOLATED or verdict.weight is not Weight.REQUIRED or witness is None:
            continue
        key = (witness.firings, witness.cycle)
        if witness.firings and key not in seen and len(seen) < most:
            seen.add(key)
            yield verdict
