"""Writing a net as a PNML place/transition net.

Permissive gates become read arcs and inhibitive gates inhibitor arcs, in the commonest spelling
(`<type value="read"/>`, `<type value="inhibitor"/>`). PNML has no words for owners, commands, external gates,
arbiters and properties; the notes say which of them the file lacks. An external gate left out means "gates free", as
in analysis.

Two things make the file another net for other tools, and both are said: the contact rule (a note), and a self-loop,
which is dead here and a read everywhere else (refused). Rejected: hiding the rest in `<toolspecific>`, where a tool
that rewrites the file would keep it beside a net that it no longer describes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from firable.nets.diagnostics import Diagnostic, InputError, Severity
from firable.nets.net import Net, Place, Transition

_NAMESPACE: Final = "http://www.pnml.org/version-2009/grammar/pnml"
_TYPE: Final = "http://www.pnml.org/version-2009/grammar/ptnet"
_XML_ID: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
_NOT_XML: Final = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_pnml(net: Net) -> tuple[str, tuple[Diagnostic, ...]]:
    """The net as PNML, and notes on what the file does not carry.

    Raises `InputError` F2009 for self-loops.

    >>> text, notes = write_pnml(Net("empty"))
    >>> "<net id=" in text, notes
    (True, ())
    """
    loops = [t.name for t in net.transitions if t.self_loops]
    if loops:
        raise InputError(
            Diagnostic(
                "F2009",
                f"'{name}' has a self-loop: it is dead here, and PNML means a read by it",
                "write a permissive gate if it is meant to read, or delete the transition",
                ("transitions", name),
            )
            for name in loops[:20]
        )
    ids = _identifiers([*(place.name for place in net.places), *(transition.name for transition in net.transitions)])
    return "\n".join(_lines(net, ids)) + "\n", tuple(_notes(net, ids))


def _identifiers(names: list[str]) -> dict[str, str]:
    """An XML identifier for each name: the name itself where it is one."""
    taken = {name for name in names if _XML_ID.fullmatch(name)}
    ids: dict[str, str] = {}
    count = 0
    for name in names:
        if name in taken:
            ids[name] = name
            continue
        count += 1
        while f"n{count}" in taken:
            count += 1
        ids[name] = f"n{count}"
    return ids


def _lines(net: Net, ids: dict[str, str]) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield f"<pnml xmlns={quoteattr(_NAMESPACE)}>"
    yield f" <net id={quoteattr(net.name if _XML_ID.fullmatch(net.name) else 'net')} type={quoteattr(_TYPE)}>"
    yield f"  {_name(net.name)}"
    yield '  <page id="page">'
    for place in net.places:
        marking = "<initialMarking><text>1</text></initialMarking>" if place.marked else ""
        label = _label(place, ids)
        yield f'   <place id="{ids[place.name]}">{label}{marking}</place>'
    for transition in net.transitions:
        yield f'   <transition id="{ids[transition.name]}">{_label(transition, ids)}</transition>'
    count = 0
    for transition in net.transitions:
        here = transition.name
        ends = (
            *((place, here, "") for place in transition.inputs),
            *((here, place, "") for place in transition.outputs),
            *((place, here, "read") for place in transition.permissive),
            *((place, here, "inhibitor") for place in transition.inhibitive),
        )
        for source, target, kind in ends:
            head = f'   <arc id="arc-{count}" source="{ids[source]}" target="{ids[target]}"'
            yield f'{head}><type value="{kind}"/></arc>' if kind else f"{head}/>"
            count += 1
    yield "  </page>"
    yield " </net>"
    yield "</pnml>"


def _label(node: Place | Transition, ids: dict[str, str]) -> str:
    """The description, where the identifier already tells the name."""
    return _name(node.description if node.description and ids[node.name] == node.name else node.name)


def _name(text: str) -> str:
    return f"<name><text>{escape(_NOT_XML.sub('�', text))}</text></name>"


def _notes(net: Net, ids: dict[str, str]) -> Iterator[Diagnostic]:
    def note(message: str, hint: str) -> Diagnostic:
        return Diagnostic("F1016", message, hint, severity=Severity.WARNING)

    if net.transitions:
        yield note(
            "PNML has no contact rule: other tools let a transition fire onto a full output place",
            "the file behaves as the net where the verdict is `contact-free`",
        )
    gated = sum(bool(transition.external) for transition in net.transitions)
    owners = [*(place.owner for place in net.places), *(signal.owner for signal in net.signals)]
    owned = sum(owner is not None for owner in owners)
    descriptions = [*(place.description for place in net.places), *(t.description for t in net.transitions)]
    lost = (
        (gated, "transition loses its", "transitions lose their", "external gates", "the file has its gates free"),
        (len(net.signals), "signal is", "signals are", "left out", "keep the net file"),
        (
            owned,
            "place or signal loses its",
            "places and signals lose their",
            "owner",
            "keep the net file: only it can be split",
        ),
        (
            sum(place.command is not None for place in net.places),
            "place loses its",
            "places lose their",
            "command",
            "keep the net file",
        ),
        (
            sum(place.within is not None for place in net.places),
            "place loses its",
            "places lose their",
            "time limit",
            "in the file a fault transition may fire at any time",
        ),
        (
            sum((p.task or p.resource) is not None for p in net.places),
            "place loses what it opens",
            "places lose what they open",
            "to",
            "keep the net file",
        ),
        (
            sum(t.number is not None for t in net.transitions),
            "transition loses its",
            "transitions lose their",
            "number",
            "keep the net file",
        ),
        (len(net.arbiters), "arbiter is", "arbiters are", "left out", "the file leaves conflicts open"),
        (len(net.properties), "property is", "properties are", "left out", "keep the net file"),
        (int(bool(net.description)), "description of the net is", "", "left out", "keep the net file"),
        (
            sum(map(bool, descriptions)),
            "description stands",
            "descriptions stand",
            "in the place of names",
            "names are the identifiers of the file",
        ),
    )
    for count, one, many, what, hint in lost:
        if count:
            yield note(f"{count:,} {one if count == 1 else many} {what}", hint)
    renamed = [f"'{name}' is '{new}'" for name, new in ids.items() if name != new]
    if renamed:
        some = ", ".join(renamed[:3]) + (", ..." if len(renamed) > 3 else "")
        told = "name is no XML identifier" if len(renamed) == 1 else "names are no XML identifiers"
        yield note(f"{len(renamed):,} {told}: {some}", "the names stand as <name> in the file")
