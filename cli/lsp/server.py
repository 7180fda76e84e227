"""A language server for net files, over standard input and output (Language Server Protocol 3.17, by pygls).

What it tells is what the other commands tell: the diagnostics of the reader as one types, and the verdicts of `firable
check` that matter, for a moment's budget, when a file is opened or saved; a change that cures a violated one is offered
as a code action. Names are found in the text as it stands, so going to a definition works in a net that is not well
formed yet; hovering needs the net, and takes the last one that was, and where a bracket is not closed yet, the names
that are offered are those of the last text that was YAML. A rename or a cure is offered only where the text after it is
a net again, and changes no line but its own.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import unquote, urlparse

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer

from firable import __version__
from firable.cli.formats.alerts import alerts, ending, place_of
from firable.cli.lsp.hover import hover
from firable.cli.report import Report
from firable.cli.text import reasons
from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.drawing.layout_file import SIZE_BYTES_MAX as LAYOUT_BYTES_MAX
from firable.nets.drawing.layout_file import layout_path, renamed_layout
from firable.nets.editing import edits
from firable.nets.net import Net
from firable.nets.occurrences import Kind, Names, Occurrence
from firable.nets.rules import rule_of
from firable.nets.source import Source, read_source
from firable.nets.text import parse_positioned
from firable.nets.text_positions import Positions
from firable.nets.verdict import Cure, Verdict

if TYPE_CHECKING:
    from firable.analysis.report import CheckReport

SECONDS: Final = 5.0
"""How long a net that was opened or saved is checked."""

CHANGE_SECONDS: Final = 0.05
"""How long it is waited after a change whether another follows."""

_SYMBOLS: Final = {
    Kind.CONTROLLER: lsp.SymbolKind.Class,
    Kind.PLACE: lsp.SymbolKind.Field,
    Kind.SIGNAL: lsp.SymbolKind.Boolean,
    Kind.TRANSITION: lsp.SymbolKind.Method,
    Kind.ARBITER: lsp.SymbolKind.Operator,
    Kind.PROPERTY: lsp.SymbolKind.Property,
}
_ITEMS: Final = {
    Kind.CONTROLLER: lsp.CompletionItemKind.Class,
    Kind.PLACE: lsp.CompletionItemKind.Field,
    Kind.SIGNAL: lsp.CompletionItemKind.Value,
    Kind.TRANSITION: lsp.CompletionItemKind.Method,
}

_TYPED: Final = re.compile(r"[\w.-]*$")
_NOTHING: Final = re.compile("^")
"""What stands of a name before the cursor, and after it nothing."""

_MARK: Final = "\ufeff"
"""What some editors write before a text, and some leave in what they tell of it: it counts in the columns there."""

_Told = tuple[lsp.Diagnostic, tuple[Cure, ...]]
"""What is told of a verdict, and the changes that cure it."""


@dataclass
class _Opened:
    """A file in the editor: its text as it was read last, the last one that was a net, the names of the last one that
    was YAML, and what cures the verdicts on the text that was checked.
    """

    text: str | None = None
    net: Net | None = None
    names: Names | None = None
    checked: str = ""
    cures: list[tuple[lsp.Diagnostic, Cure]] = field(default_factory=list)


class NetServer(LanguageServer):
    """The server; `opened` holds the files of the editor by their URIs."""

    def __init__(self) -> None:
        super().__init__("firable", __version__)
        self.opened: dict[str, _Opened] = {}
        self.divided: tuple[str, Sequence[str]] | None = None

    def source(self, uri: str) -> Source:
        """The text of a file as it stands in the editor, behind its mark if it has one."""
        text = self.workspace.get_text_document(uri).source.removeprefix(_MARK)
        return Source(unquote(urlparse(uri).path) or uri, text)

    def mark(self, uri: str, line: int = 1) -> str:
        """The mark that stands before a line (from 1) of the text; empty where none does."""
        return _MARK if line == 1 and self.workspace.get_text_document(uri).source.startswith(_MARK) else ""

    def names(self, uri: str) -> Names | None:
        """The names in a file; None while it is not YAML."""
        try:
            return Names(self.source(uri))
        except InputError:
            return None

    def range(self, uri: str, line: int, column: int, length: int) -> lsp.Range:
        """A part of a line (from 1) in the units of the client."""
        document = self.workspace.get_text_document(uri)
        column += len(self.mark(uri, line))
        start, end = lsp.Position(line - 1, column - 1), lsp.Position(line - 1, column - 1 + length)
        return document.position_codec.range_to_client_units(self.lines(uri), lsp.Range(start, end))

    def lines(self, uri: str) -> Sequence[str]:
        """The lines of a file, kept while its text stays: a document divides it anew each time."""
        document = self.workspace.get_text_document(uri)
        text = document.source
        if self.divided is None or self.divided[0] is not text:
            self.divided = text, document.lines
        return self.divided[1]

    def of_span(self, uri: str, span: Span | None) -> lsp.Range:
        """The range of a span; the first character where there is none."""
        return self.range(uri, span.line, span.column, max(1, span.length)) if span else self.range(uri, 1, 1, 1)

    def of(self, uri: str, one: Occurrence) -> lsp.Range:
        """The range of a name."""
        return self.range(uri, one.line, one.column, one.length)

    def name_at(self, uri: str, position: lsp.Position) -> tuple[Names, Occurrence] | None:
        """The name at a position of the client, and all names of the file."""
        names = self.names(uri)
        if names is None:
            return None
        document = self.workspace.get_text_document(uri)
        here = document.position_codec.position_from_client_units(self.lines(uri), position)
        line = here.line + 1
        one = names.at(line, here.character + 1 - len(self.mark(uri, line)))
        return None if one is None else (names, one)

    def publish(self, uri: str, found: list[lsp.Diagnostic]) -> None:
        """Show what was found in a file."""
        version = self.workspace.get_text_document(uri).version
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, found, version))

    def read(self, uri: str) -> list[lsp.Diagnostic]:
        """Read a file as it stands; what refuses it, or nothing, and then it is the net that is hovered over."""
        opened = self.opened.setdefault(uri, _Opened())
        source = self.source(uri)
        opened.text = source.text
        opened.names = self.names(uri) or opened.names
        try:
            opened.net = parse_positioned(source.text, source.file)[0]
        except InputError as error:
            return [self.diagnostic(uri, one) for one in error.diagnostics]
        return []

    def diagnostic(self, uri: str, one: Diagnostic) -> lsp.Diagnostic:
        """A diagnostic of a reader, with its hint."""
        told = f"{one.message}\nhint: {one.hint}" if one.hint else one.message
        severity = lsp.DiagnosticSeverity.Error if one.severity.value == "error" else lsp.DiagnosticSeverity.Warning
        return lsp.Diagnostic(self.of_span(uri, one.span), told, severity, one.code, source="firable")

    def told(self, uri: str, found: CheckReport, verdicts: tuple[Verdict, ...], positions: Positions) -> list[_Told]:
        """The verdicts on a net that matter and do not hold, each with the changes that cure it."""
        from firable.nets.oversights import oversights
        from firable.nets.verdict import Status, held_to

        net = found.net
        report = Report("check", uri, net, held_to(net.expected, verdicts), positions=positions)
        told: list[_Told] = [(self.diagnostic(uri, one), ()) for one in positions.place(oversights(net))]
        for alert in alerts(report):
            verdict = alert.verdict
            if verdict.status is Status.UNKNOWN:
                continue  # of a budget that nobody has asked for
            severity = lsp.DiagnosticSeverity.Error if alert.is_error else lsp.DiagnosticSeverity.Warning
            words = "\n".join((f"{verdict.name} {ending(verdict)}: {verdict.statement}", *reasons(net, verdict)))
            at = self.of_span(uri, place_of(report, verdict))
            told.append((lsp.Diagnostic(at, words, severity, rule_of(verdict), source="firable check"), verdict.cures))
        return told

    def edit(self, uri: str, text: str, old_text: str) -> lsp.WorkspaceEdit:
        """Another text in a file, by the lines that are others: the cursor and what is folded stay as they were."""
        old, new = (_lines(self.mark(uri) + one) for one in (old_text, text))
        changes = [
            lsp.TextEdit(lsp.Range(lsp.Position(begin, 0), lsp.Position(end, 0)), "".join(new[start:stop]))
            for begin, end, start, stop in _changed(old, new)
        ]
        return lsp.WorkspaceEdit(changes={uri: changes})

    def with_layout(self, edit: lsp.WorkspaceEdit, uri: str, names: Mapping[str, str]) -> lsp.WorkspaceEdit:
        """An edit of a net file, with the new names in the layout file beside it where there is one that is YAML."""
        beside = layout_path(Path(unquote(urlparse(uri).path)))
        if edit.changes is None or not beside.is_file():
            return edit
        there = beside.as_uri()
        try:
            is_open = there in self.workspace.text_documents
            source = self.source(there) if is_open else read_source(beside, LAYOUT_BYTES_MAX)
            text = renamed_layout(source, names)
        except InputError:
            return edit
        more = self.edit(there, text, source.text).changes or {} if text != source.text else {}
        return lsp.WorkspaceEdit(changes={**edit.changes, **more})


def _lines(text: str) -> list[str]:
    """The lines of the protocol, with their ends; `str.splitlines` knows more ends than it does."""
    return StringIO(text, newline="").readlines()


def _changed(old: list[str], new: list[str]) -> Iterator[tuple[int, int, int, int]]:
    """The lines that are others, from and to which in both texts."""
    if len(old) == len(new):  # as after nearly every rename; to look for the shortest way takes long in a long file
        yield from ((i, i + 1, i, i + 1) for i in range(len(old)) if old[i] != new[i])
        return
    for what, begin, end, start, stop in SequenceMatcher(None, old, new).get_opcodes():
        if what != "equal":
            yield begin, end, start, stop


class _RefusedError(JsonRpcInvalidParams):
    """What a request asks for is not done, and the editor is told why."""


def _is_failure(record: logging.LogRecord) -> bool:
    """Whether what pygls would log is a failure; it logs all that a request raises, with the traceback."""
    return record.exc_info is None or not isinstance(record.exc_info[1], _RefusedError)


logging.getLogger("pygls.protocol.json_rpc").addFilter(_is_failure)
server = NetServer()


async def _look(uri: str) -> None:
    """Tell at once what the reader says, soon what checking says, and then what cures it, unless the text has changed
    meanwhile.
    """
    from firable.analysis.cures.finding import explained

    refused = server.read(uri)
    server.publish(uri, refused)
    if refused:
        return
    source = server.source(uri)
    net, positions = parse_positioned(source.text, source.file)
    try:
        found = await asyncio.to_thread(_checked, net)
        if not _show(uri, source, lambda: server.told(uri, found, found.verdicts, positions)):
            return
        verdicts = await asyncio.to_thread(explained, found)
        if verdicts != found.verdicts:
            _show(uri, source, lambda: server.told(uri, found, verdicts, positions))
    except InputError as error:  # such as of an `expect:` that names no verdict
        problems = error.diagnostics
        _show(uri, source, lambda: [(server.diagnostic(uri, one), ()) for one in problems])


def _checked(net: Net) -> CheckReport:
    from firable.analysis.check import check
    from firable.analysis.spaces.reachability import Budget

    return check(net, budget=Budget(seconds=SECONDS))


def _show(uri: str, source: Source, tell: Callable[[], list[_Told]]) -> bool:
    """Publish what was found of a text, if it is still the one in the editor; whether it did.

    Of a file that is closed nothing is asked: it may be nowhere on the disk.
    """
    opened = server.opened.get(uri)
    if opened is None or server.source(uri).text != source.text:
        return False
    told = tell()
    opened.checked, opened.cures = source.text, [(one, cure) for one, cures in told for cure in cures]
    server.publish(uri, [one for one, _ in told])
    return True


@server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
async def did_open(params: lsp.DidOpenTextDocumentParams) -> None:
    """Read and check a file that was opened."""
    await _look(params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
async def did_save(params: lsp.DidSaveTextDocumentParams) -> None:
    """Read and check a file that was saved."""
    await _look(params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
async def did_change(params: lsp.DidChangeTextDocumentParams) -> None:
    """Read a file that is being changed; verdicts are of the text as it was saved, and told anew then.

    Of changes that come faster than a large file is read, the last is; and none that was read meanwhile, for it was
    saved, and its verdicts may stand there.
    """
    uri = params.text_document.uri
    await asyncio.sleep(CHANGE_SECONDS)
    if server.workspace.get_text_document(uri).version != params.text_document.version:
        return
    opened = server.opened.get(uri)
    if opened is None or opened.text != server.source(uri).text:
        server.publish(uri, server.read(uri))


@server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
def did_close(params: lsp.DidCloseTextDocumentParams) -> None:
    """Forget a file, and take back what was told of it: its text may never have been written."""
    server.opened.pop(params.text_document.uri, None)
    server.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(params.text_document.uri, []))


@server.feature(lsp.TEXT_DOCUMENT_HOVER)
def hovered(params: lsp.HoverParams) -> lsp.Hover | None:
    """Tell what the name is: of a transition, what it waits for."""
    uri = params.text_document.uri
    found, opened = server.name_at(uri, params.position), server.opened.get(uri)
    if found is None or opened is None or opened.net is None or not (told := hover(opened.net, found[1])):
        return None
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, told), server.of(uri, found[1]))


@server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
def definition(params: lsp.DefinitionParams) -> lsp.Location | None:
    """Go where a name is declared."""
    uri = params.text_document.uri
    found = server.name_at(uri, params.position)
    return None if found is None else lsp.Location(uri, server.of(uri, found[0].definition(found[1])))


@server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
def references(params: lsp.ReferenceParams) -> list[lsp.Location]:
    """Show every place of a name."""
    uri = params.text_document.uri
    found = server.name_at(uri, params.position)
    if found is None:
        return []
    wanted = [one for one in found[0].of(found[1]) if params.context.include_declaration or not one.defines]
    return [lsp.Location(uri, server.of(uri, one)) for one in wanted]


@server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
def prepare_rename(params: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder | None:
    """Say which name a rename would change, by its short form."""
    uri = params.text_document.uri
    found = server.name_at(uri, params.position)
    if found is None:
        return None
    short = found[1].name.rpartition(".")[2] if found[1].kind in {Kind.PLACE, Kind.SIGNAL} else found[1].name
    return lsp.PrepareRenamePlaceholder(server.of(uri, found[1]), short)


@server.feature(lsp.TEXT_DOCUMENT_RENAME, lsp.RenameOptions(prepare_provider=True))
def rename(params: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
    """Change a name wherever it stands, where the text is a net before and after."""
    uri = params.text_document.uri
    found = server.name_at(uri, params.position)
    if found is None:
        return None
    try:
        source = server.source(uri)
        parse_positioned(source.text, source.file)
        text, names = found[0].renamed(found[1], params.new_name), found[0].renames(found[1], params.new_name)
        parse_positioned(text, source.file)
    except InputError as error:
        raise _RefusedError(error.diagnostics[0].message) from None
    return server.with_layout(server.edit(uri, text, source.text), uri, names)


@server.feature(lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions([lsp.CodeActionKind.QuickFix]))
def cures(params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    """Offer the changes that cure what is violated here, while the text is the one that was checked."""
    uri = params.text_document.uri
    opened, source, wanted = server.opened.get(uri), server.source(uri), params.context.only
    if opened is None or opened.checked != source.text:
        return []
    if wanted is not None and not {lsp.CodeActionKind.QuickFix, lsp.CodeActionKind.Empty} & set(wanted):
        return []
    found: dict[tuple[str, ...], lsp.CodeAction] = {}
    for told, cure in opened.cures:
        if not told.range.start.line <= params.range.end.line or not params.range.start.line <= told.range.end.line:
            continue
        if (action := found.get(cure.changes)) is not None:
            action.diagnostics = [*(action.diagnostics or ()), told]
            continue
        try:
            text = edits.change(source, cure.parts).text
            parse_positioned(text, source.file)
        except InputError:
            continue  # it is told in words; where it would stand in the text is no form that is edited by itself
        title = "; and ".join(cure.changes)
        found[cure.changes] = lsp.CodeAction(
            title, lsp.CodeActionKind.QuickFix, [told], edit=server.edit(uri, text, source.text)
        )
    return list(found.values())


@server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=["."]))
def completion(params: lsp.CompletionParams) -> list[lsp.CompletionItem]:
    """Offer the names of the net for what is typed of one; keys are offered by what knows the JSON Schema."""
    uri = params.text_document.uri
    opened, document = server.opened.get(uri), server.workspace.get_text_document(uri)
    names = opened.names if opened else None
    defined = {one.name: one for one in names.occurrences if one.defines} if names else {}
    typed = document.word_at_position(params.position, re_start_word=_TYPED, re_end_word=_NOTHING)
    units = document.position_codec.client_num_units(typed)
    start = lsp.Position(params.position.line, params.position.character - units)
    # By itself an editor would take the dot for the end of a word, and write the controller twice.
    return [
        lsp.CompletionItem(
            name,
            kind=_ITEMS[one.kind],
            detail=one.kind.value,
            text_edit=lsp.TextEdit(lsp.Range(start, params.position), name),
        )
        for name, one in defined.items()
        if one.kind in _ITEMS
    ]


@server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
def symbols(params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """List what the file declares."""
    uri = params.text_document.uri
    names = server.names(uri)
    return [
        lsp.DocumentSymbol(one.name, _SYMBOLS[one.kind], server.of(uri, one), server.of(uri, one))
        for one in (names.occurrences if names else ())
        if one.defines
    ]
