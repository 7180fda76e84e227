"""The legend of a picture of a net: the signs that it uses, and no others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from firable.nets.drawing.colours import colours
from firable.nets.drawing.sheet import MARGIN
from firable.nets.drawing.text import NOTE, width_of
from firable.nets.drawing.xml import esc, px
from firable.nets.net import Net

ROW_HEIGHT: Final = 26.0


def legend_items(
    net: Net, is_global: Sequence[bool], *, macros: bool, fired: bool, stubs: bool = True
) -> Iterator[tuple[str, str]]:
    """The signs of a net, each as (sign, words); `is_global` says of each transition whether it is.

    With `stubs` external gates and commands are drawn as such, else they stand in words beside what they belong to.
    """
    if net.places:
        yield "place", "place, with its token"
    if macros:
        yield "macro", "task, folded: the places of one piece of work"
    if not all(is_global):
        yield "local", "transition"
    if any(is_global):
        yield "global", "global transition: one part in each controller"
    if any(transition.permissive for transition in net.transitions):
        yield "permissive", "permissive gate"
    if any(transition.inhibitive for transition in net.transitions):
        yield "inhibitive", "inhibitive gate"
    if any(gate.wanted for transition in net.transitions for gate in transition.external):
        yield "external" if stubs else "if", "external gate: opens with the signal"
    if any(not gate.wanted for transition in net.transitions for gate in transition.external):
        yield "external-inhibitive" if stubs else "unless", "external gate: closes with the signal"
    if any(place.command for place in net.places):
        yield "command" if stubs else "sent", "command sent on entry"
    if fired:
        yield "fired", "fired, in these steps"


def legend_rows(items: Sequence[tuple[str, str]], width: float) -> list[list[tuple[float, str, str]]]:
    """The signs in rows as wide as the picture, each with its left edge."""
    rows: list[list[tuple[float, str, str]]] = [[]]
    x = MARGIN
    for sign, words in items:
        needed = 46 + width_of(words, NOTE) + 8
        if rows[-1] and x + needed > width - 10:
            rows.append([])
            x = MARGIN
        rows[-1].append((x, sign, words))
        x += needed
    return rows


def legend(rows: Sequence[Sequence[tuple[float, str, str]]], top: float) -> Iterator[str]:
    """The legend, below what is drawn."""
    for i, row in enumerate(rows):
        y = top + 26 + ROW_HEIGHT * i
        for x, sign, words in row:
            yield from _sign(sign, x, y)
            yield f'<text class="note" x="{px(x + 46)}" y="{px(y + 3.5)}">{esc(words)}</text>'


def _sign(sign: str, x: float, y: float) -> Iterator[str]:
    """A sign of the legend in a field of 40 pixels."""
    middle = x + 20
    match sign:
        case _ if sign.startswith("owner:"):
            fill, stroke = colours(int(sign.removeprefix("owner:")), sign)
            look = f'rx="5" fill="{fill}" stroke="{stroke}"'
            yield f'<rect x="{px(x + 6)}" y="{px(y - 9)}" width="28" height="18" {look}/>'
        case "place":
            yield f'<circle class="place" cx="{px(middle)}" cy="{px(y)}" r="9"/>'
            yield f'<circle class="token" cx="{px(middle)}" cy="{px(y)}" r="3.5"/>'
        case "macro":
            yield f'<circle class="macro" cx="{px(middle)}" cy="{px(y)}" r="9"/>'
            yield f'<circle class="macro" cx="{px(middle)}" cy="{px(y)}" r="6"/>'
        case "local" | "fired":
            css = "bar" if sign == "local" else "fired"
            yield f'<rect class="{css}" x="{px(x + 6)}" y="{px(y - 3)}" width="28" height="6" rx="1.5"/>'
        case "global":
            yield f'<path class="tie" d="M{px(x)} {px(y)}H{px(x + 40)}"/>'
            for start in (x, x + 26):
                yield f'<rect class="bar" x="{px(start)}" y="{px(y - 3)}" width="14" height="6" rx="1.5"/>'
        case "permissive" | "inhibitive":
            yield f'<path class="gate" d="M{px(x + 2)} {px(y)}H{px(x + 33)}"/>'
            yield gate_end(x + 34, y, permissive=sign == "permissive")
        case "external" | "external-inhibitive":
            yield f'<path class="stub" d="M{px(x + 36)} {px(y - 6)}L{px(x + 20)} {px(y + 2)}"/>'
            yield gate_end(x + 20, y + 2, permissive=sign == "external")
        case "if" | "unless":
            yield f'<text class="signal" x="{px(x + 38)}" y="{px(y + 3.5)}" text-anchor="end">{sign}</text>'
        case "command" | "sent":
            if sign == "command":
                yield f'<path class="send" d="M{px(x + 12)} {px(y)}H{px(x + 28)}"/>'
            yield f'<path class="sendhead" d="M{px(x + 34)} {px(y)}l-7 -3.2v6.4z"/>'


def gate_end(x: float, y: float, *, permissive: bool) -> str:
    """The end of a gate at the transition: a black dot or a hollow circle."""
    css, radius = ("dot", "3.2") if permissive else ("hollow", "3.6")
    return f'<circle class="{css}" cx="{px(x)}" cy="{px(y)}" r="{radius}"/>'
