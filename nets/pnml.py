"""PNML place/transition nets, with read and inhibitor arcs, into `Net`; the way back is in `pnml_writer`.

The field exchanges nets as PNML, so reading it well is what lets public nets be checked here. Three decisions:

- The *identifier* of a node is its name, because identifiers are unique and names are not; a `<name>` that differs is
  kept as the description. Identifiers that are no names here are mapped without collision.
- A self-loop, an arc to and one from the same place, is how an ordinary net reads a place: it becomes a permissive
  gate, as does a read arc. An inhibitor arc becomes an inhibitive gate.
- What an import cannot carry (graphics, tool-specific data, rates, ...) is said in the notes. What would change the
  behaviour (weights, two tokens, colours, time windows) is refused: an "approximate" import, the alternative, would
  give the verdicts of another net.

The ordinary firing rule lets a token pile up where the contact rule blocks; the notes say that too.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sized
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Problems, Severity, bounded, did_you_mean
from firable.nets.net import Net, Place, Transition
from firable.nets.pausing import without_cycle_search
from firable.nets.pnml_writer import write_pnml
from firable.nets.pnml_xml import PnmlRecords, Record, described, parse_xml
from firable.nets.source import Source, printable, quoted, read_bytes, xml_text
from firable.nets.verdict import counted
from firable.nets.well_formed import FORBIDDEN_IN_NAMES, is_name

__all__ = ["PnmlImport", "parse_pnml", "read_pnml", "write_pnml"]

SIZE_BYTES_MAX: Final = 256 * 1024 * 1024
KINDS_MAX: Final = 20

_NORMAL: Final = frozenset({"", "normal", "timed", "arc", "ptarc", "directed", "flow", "regular", "default"})
_READ: Final = frozenset({"read", "readarc", "test", "testarc", "activator"})
_INHIBITOR: Final = frozenset({"inhibitor", "inhibitorarc", "inhibit", "tapninhibitor"})
_UNBOUNDED_INTERVAL: Final = re.compile(r"\[\s*0\s*,\s*(?:inf|infinity|∞)\s*\)")
_PT_TYPES: Final = re.compile(r"symmetric|highlevel|high-level|hlpng|colou?red|stochastic|timed", re.IGNORECASE)


@dataclass(frozen=True)
class PnmlImport:
    """A net read from PNML, what of the file it does not carry, and the names that it has for other identifiers."""

    net: Net
    notes: tuple[Diagnostic, ...]
    renamed: Mapping[str, str] = field(default_factory=dict)


def read_pnml(path: str | Path) -> PnmlImport:
    """Read a PNML file.

    Raises `InputError` with positions: F1001-F1004 for the file, F1013 where it is not PNML, F1014 for what a net here
    cannot be (colours, time, several nets), F2001 for a double identifier, F2002, F2008 and F2017 for arcs that end
    where they cannot, F2006 for two tokens, F2007 for weights and double arcs.
    """
    return parse_pnml(read_bytes(path, SIZE_BYTES_MAX), str(path))


def parse_pnml(data: bytes | str, file: str = "<pnml>") -> PnmlImport:
    """Read PNML from memory; raises `InputError` as `read_pnml` does."""
    encoding = None
    if isinstance(data, str):
        data, encoding = data.encode("utf-8", "surrogatepass"), "utf-8"
    source = Source(file, xml_text(data))
    with without_cycle_search():
        importing = _Import(source, parse_xml(source, data, encoding))
        net = importing.net()
        return PnmlImport(net, tuple(importing.notes()), importing.renamed)


@dataclass(slots=True)
class _Arcs:
    """The arcs of one transition, by place, in the order of the file."""

    inputs: dict[str, None] = field(default_factory=dict)
    outputs: dict[str, None] = field(default_factory=dict)
    reads: dict[str, None] = field(default_factory=dict)
    inhibitors: dict[str, None] = field(default_factory=dict)


class _Import:
    """One file on its way to a `Net`."""

    def __init__(self, source: Source, records: PnmlRecords) -> None:
        self.source = source
        self.records = records
        self.problems = Problems()
        self.self_loops: list[str] = []
        self.renamed: dict[str, str] = {}
        self.capacities: list[str] = []

    def refuse(self, record: Record, code: str, message: str, hint: str) -> None:
        if not self.problems.is_full:
            span = self.source.span(record.line, record.column, len(record.tag) + 1)
            self.problems.report(Diagnostic(code, message, hint, span=span))

    def net(self) -> Net:
        records = self.records
        kind = records.net.attributes.get("type", "")
        if _PT_TYPES.search(kind):
            self.refuse(records.net, "F1014", f"a net of type {quoted(kind)}", "export it as a place/transition net")
        elif records.foreign is not None:
            what, record = records.foreign
            self.refuse(
                record,
                "F1014",
                f"<{record.tag}> belongs to a {what} net",
                "unfold the colours and export a place/transition net"
                if what == "coloured"
                else "time is not part of a net here: delete it to have the net without time",
            )
        nodes = self.unique(record for record in records.nodes if record.tag != "arc")
        resolve = self.references(nodes)
        if self.problems:  # colours, double identifiers and broken references would be reported again, arc by arc
            raise InputError(bounded(self.problems))
        names = self.names(nodes.values())
        arcs = self.arcs(nodes, resolve)
        places = tuple(self.place(record, names[record.id]) for record in nodes.values() if record.tag == "place")
        transitions = tuple(
            self.transition(record, names, arcs.get(record.id) or _Arcs())
            for record in nodes.values()
            if record.tag == "transition"
        )
        if self.problems:
            raise InputError(bounded(self.problems))
        name = records.net.labels.get("name") or records.net.id or Path(self.source.file).stem
        return Net(printable(" ".join(name.split())), places, transitions)

    def unique(self, records: Iterable[Record]) -> dict[str, Record]:
        found: dict[str, Record] = {}
        for record in records:
            if not record.id:
                self.refuse(record, "F1013", f"a <{record.tag}> without an id", "give it one")
            elif (other := found.get(record.id)) is not None:
                self.refuse(
                    record, "F2001", f"{described(record)} has the id of the <{other.tag}> on line {other.line}",
                    "identifiers are unique in a file: rename one of them",
                )  # fmt: skip
            else:
                found[record.id] = record
        return found

    def names(self, nodes: Iterable[Record]) -> dict[str, str]:
        """A name for each place and transition: its identifier, or the nearest legal and free one."""
        ids = [record.id for record in nodes if record.tag in {"place", "transition"}]
        names = {one: one for one in ids if _legal(one) == one}
        taken = set(names)
        suffix: dict[str, int] = {}
        for one in ids:
            if one in names:
                continue
            base = _legal(one)
            name = base
            while name in taken:
                suffix[base] = suffix.get(base, 1) + 1
                name = f"{base}_{suffix[base]}"
            taken.add(name)
            names[one] = name
            self.renamed[one] = name
        return names

    def references(self, nodes: dict[str, Record]) -> dict[str, str]:
        """For each identifier that an arc may name, the identifier of the place or transition that is meant."""
        resolved: dict[str, str] = {}
        for start, node in nodes.items():
            if not node.tag.startswith("reference"):
                resolved.setdefault(start, start)
                continue
            way: dict[str, None] = {}  # ordered, and quick to ask on a long chain
            one = start
            while one not in resolved and one in nodes and nodes[one].tag.startswith("reference") and one not in way:
                way[one] = None
                one = nodes[one].attributes.get("ref", "")
            target = resolved.get(one, one)
            kind = "place" if nodes[start].tag in {"place", "referencePlace"} else "transition"
            if target not in nodes or nodes[target].tag != kind:
                self.refuse(
                    nodes[start], "F1013", f"{described(nodes[start])} refers to no {kind}", "correct its `ref`"
                )
                target = start
            for passed in [*way, start]:
                resolved.setdefault(passed, target)
        return resolved

    def arcs(self, nodes: dict[str, Record], resolve: dict[str, str]) -> dict[str, _Arcs]:
        arcs: dict[str, _Arcs] = {}
        for record in self.records.nodes:
            if record.tag != "arc":
                continue
            ends = record.attributes.get("source", ""), record.attributes.get("target", "")
            if ends[0] not in nodes or ends[1] not in nodes:
                unknown = [end for end in ends if end not in nodes]
                known = [] if self.problems.is_full else list(nodes)
                hint = did_you_mean(unknown[0], known) + "an arc names two identifiers of the file"
                message = f"{described(record)}: there is no place or transition {quoted(unknown[0])}"
                self.refuse(record, "F2002", message, hint)
                continue
            source, target = nodes[resolve[ends[0]]], nodes[resolve[ends[1]]]
            if source.tag == target.tag:
                self.refuse(
                    record, "F2017", f"{described(record)} joins two {source.tag}s",
                    "an arc joins a place and a transition",
                )  # fmt: skip
                continue
            self.arc(record, source, target, arcs)
        return arcs

    def arc(self, record: Record, source: Record, target: Record, arcs: dict[str, _Arcs]) -> None:
        to_transition = target.tag == "transition"
        place, transition = (source, target) if to_transition else (target, source)
        if (of := arcs.get(transition.id)) is None:
            of = arcs[transition.id] = _Arcs()
        kind = _kind(record)
        weight = self.weight(record, kind)
        if kind in _READ:
            of.reads[place.id] = None
        elif kind in _INHIBITOR:
            if to_transition:
                of.inhibitors[place.id] = None
            else:
                self.refuse(
                    record, "F2008", f"{described(record)} is an inhibitor arc from a transition",
                    "an inhibitor arc goes from a place to a transition",
                )  # fmt: skip
        elif kind not in _NORMAL:
            self.refuse(
                record, "F1014", f"{described(record)} is of kind {quoted(kind)}",
                "only normal, read and inhibitor arcs can be carried",
            )  # fmt: skip
        else:
            ordinary = of.inputs if to_transition else of.outputs
            if place.id in ordinary or weight > 1:
                self.refuse(
                    record, "F2007",
                    f"{described(record)} has the weight {weight}" if weight > 1
                    else f"{described(record)} is a second arc between the same two nodes",
                    "arcs are sets here, without weights: a place holds one token at most",
                )  # fmt: skip
            ordinary[place.id] = None

    def weight(self, record: Record, kind: str) -> int:
        text = record.labels.get("inscription") or record.attributes.get("weight", "1")
        if text == "1" and kind in _NORMAL and kind != "timed":
            return 1
        if kind in {"timed", "tapninhibitor"} and not _UNBOUNDED_INTERVAL.fullmatch(
            record.attributes.get("inscription", "[0,inf)")
        ):
            self.refuse(record, "F1014", f"{described(record)} has a time window", "time is not part of a net here")
        weight = _integer(text)
        if weight is None or weight == 0:
            hint = _TOO_LARGE if _LONG_NUMBER.fullmatch(text) else "a weight is a number from 1"
            self.refuse(record, "F1013", f"{described(record)} has the weight {quoted(text)}", hint)
            return 1
        if weight > 1 and kind not in _NORMAL:
            self.refuse(
                record, "F2007", f"{described(record)} has the weight {weight}",
                "a place holds one token at most, so a gate asks for one",
            )  # fmt: skip
        return weight

    def place(self, record: Record, name: str) -> Place:
        text = record.labels.get("initialMarking") or record.attributes.get("initialMarking") or "0"
        tokens = _integer(text)
        if tokens is None:
            hint = _TOO_LARGE if _LONG_NUMBER.fullmatch(text) else "a marking is a number"
            self.refuse(record, "F1013", f"{described(record)} has the marking {quoted(text)}", hint)
        elif tokens > 1:
            self.refuse(
                record, "F2006", f"{tokens} tokens on {described(record)}", "a place holds one token at most here"
            )
        if record.labels.get("capacity", "0") not in {"0", "1"}:
            self.capacities.append(quoted(name))
        invariant = record.attributes.get("invariant", "< inf").replace(" ", "").replace("&lt;", "<")
        if invariant not in {"", "<inf"}:
            self.refuse(record, "F1014", f"{described(record)} has a time invariant", "time is not part of a net here")
        return Place(name, marked=bool(tokens), description=_description(record))

    def transition(self, record: Record, names: dict[str, str], arcs: _Arcs) -> Transition:
        inputs: Iterable[str] = arcs.inputs
        outputs: Iterable[str] = arcs.outputs
        reads: Iterable[str] = arcs.reads
        if not arcs.inputs.keys().isdisjoint(arcs.outputs):
            self.self_loops.append(quoted(names[record.id]))
            inputs = [place for place in arcs.inputs if place not in arcs.outputs]
            outputs = [place for place in arcs.outputs if place not in arcs.inputs]
            reads = dict.fromkeys((*(place for place in arcs.inputs if place in arcs.outputs), *arcs.reads))
        return Transition(
            names[record.id],
            tuple([names[place] for place in inputs]),
            tuple([names[place] for place in outputs]),
            tuple([names[place] for place in reads]) if reads else (),
            tuple([names[place] for place in arcs.inhibitors]) if arcs.inhibitors else (),
            description=_description(record),
        )

    def notes(self) -> Iterator[Diagnostic]:
        """What of the file the net does not carry, or carries in another form."""

        def note(message: str, hint: str, record: Record | None = None) -> Diagnostic:
            at = record or self.records.net
            span = self.source.span(at.line, at.column)
            return Diagnostic("F1016", message, hint, span=span, severity=Severity.WARNING)

        if any(record.tag == "transition" for record in self.records.nodes):
            yield note(
                "the net is read under the contact rule: a transition waits until its output places are empty",
                "the net behaves as in the file where the verdict is `contact-free`",
            )
        if self.self_loops:
            said = _counted(self.self_loops, "transition takes a token and puts", "transitions take a token and put")
            yield note(
                f"{said} it back: {_few(self.self_loops)}",
                "each such pair of arcs is read as a permissive gate",
            )
        if self.renamed:
            renamed = [f"{quoted(one)} is '{name}'" for one, name in self.renamed.items()]
            yield note(
                f"{_counted(self.renamed, 'identifier is no name', 'identifiers are no names')} here: {_few(renamed)}",
                "a name has no blanks, brackets, quotes or YAML signs",
            )
        if self.capacities:
            yield note(
                f"{_counted(self.capacities, 'place has', 'places have')} a capacity above 1: {_few(self.capacities)}",
                "every place holds one token at most here",
            )
        references = sum(record.tag.startswith("reference") for record in self.records.nodes)
        if self.records.pages > 1 or references:
            yield note(
                f"{counted(self.records.pages, 'page')} with {counted(references, 'reference')} are joined to one net",
                "pages are a matter of drawing",
            )
        kinds = sorted(self.records.left.items())
        hint = "drawing, tool data, priorities and rates are no part of a net here"
        for tag, count in kinds[:KINDS_MAX]:
            yield note(f"{count:,} <{printable_tag(tag)}> {'is' if count == 1 else 'are'} left out", hint)
        if len(kinds) > KINDS_MAX:
            yield note(f"elements of {len(kinds) - KINDS_MAX:,} other names are left out", hint)


def printable_tag(tag: str) -> str:
    """The name of an element for a message, without quotes."""
    return quoted(tag)[1:-1]


def _counted(items: Sized, one: str, more: str) -> str:
    return f"1 {one}" if len(items) == 1 else f"{len(items):,} {more}"


def _few(items: list[str]) -> str:
    return ", ".join(items[:3]) + (", ..." if len(items) > 3 else "")


def _kind(record: Record) -> str:
    """The kind of an arc in lower case, from whichever label or attribute holds it."""
    labels, attributes = record.labels, record.attributes
    for spelling in ("type", "arctype", "arcType", "kind"):
        if text := (labels and labels.get(spelling)) or attributes.get(spelling):
            return _kind_spelled(text)
    return ""


@lru_cache(maxsize=256)
def _kind_spelled(text: str) -> str:
    return re.split(r"[/#:]", text.strip())[-1].lower().replace("-", "").replace("_", "").replace(" ", "")


@lru_cache(maxsize=256)
def _integer(text: str) -> int | None:
    """The number of a marking or weight; PIPE writes pairs of a class and a number, `Default,1`."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) % 2 == 0 and parts[0] == "Default":
        others = parts[3::2]
        if any(other != "0" for other in others):
            return None
        parts = parts[1:2]
    return int(parts[0]) if len(parts) == 1 and re.fullmatch(r"[0-9]{1,9}", parts[0]) else None


_LONG_NUMBER: Final = re.compile(r"(?:Default,)?\s*[0-9]{10,}\s*")
_TOO_LARGE: Final = "it is too large: a place holds one token at most here, and arcs have no weights"


def _legal(text: str) -> str:
    """The text with an underscore for each character that may not stand in a name; itself where it is a name."""
    if is_name(text) and text not in {"and", "or", "not", "->"}:
        return text
    legal = "".join("_" if c in FORBIDDEN_IN_NAMES or not c.isprintable() else c for c in text)
    return f"_{legal}" if not legal or legal in {"and", "or", "not", "->"} else legal


def _description(record: Record) -> str:
    name = record.labels.get("name", "")
    return "" if name == record.id else name
