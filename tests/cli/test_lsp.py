"""The language server as an editor meets it: over pipes, with the messages of the protocol."""

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException
from pygls.lsp.client import LanguageClient

from firable.cli.lsp.hover import hover
from firable.cli.lsp.server import _changed, _show
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.net import Controller, Net, Place
from firable.nets.occurrences import Kind, Occurrence
from firable.nets.source import Source

LATE = catalogue_path("one_robot_mc_late").read_text("utf-8")


class Editor:
    """An editor with one file, which remembers what was published of it."""

    def __init__(self, client: LanguageClient, path: Path) -> None:
        self.client = client
        self.uri = path.as_uri()
        self.published: asyncio.Queue[lsp.PublishDiagnosticsParams] = asyncio.Queue()
        self.document = lsp.TextDocumentIdentifier(self.uri)
        self.version = 1

    def open(self, text: str) -> None:
        item = lsp.TextDocumentItem(self.uri, "yaml", self.version, text)
        self.client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))

    def change(self, text: str) -> None:
        self.version += 1
        document = lsp.VersionedTextDocumentIdentifier(self.version, self.uri)
        whole: list[Any] = [lsp.TextDocumentContentChangeWholeDocument(text)]
        self.client.text_document_did_change(lsp.DidChangeTextDocumentParams(document, whole))

    def save(self) -> None:
        self.client.text_document_did_save(lsp.DidSaveTextDocumentParams(self.document))

    async def told(self, wanted: Callable[[list[lsp.Diagnostic]], bool]) -> list[lsp.Diagnostic]:
        """The first list of diagnostics that is as wanted."""
        while True:
            found = list((await asyncio.wait_for(self.published.get(), 60)).diagnostics)
            if wanted(found):
                return found

    def at(self, text: str, word: str, after: str = "") -> lsp.TextDocumentPositionParams:
        """The position within a word, the first one after some text."""
        offset = text.index(word, text.index(after)) + 1
        line = text.count("\n", 0, offset)
        return lsp.TextDocumentPositionParams(
            self.document, lsp.Position(line, offset - text.rfind("\n", 0, offset) - 1)
        )


def applied(text: str, edits: Sequence[Any]) -> str:
    """A text after edits of the protocol."""
    starts = [0, *(place + 1 for place, sign in enumerate(text) if sign == "\n"), len(text)]

    def offset(at: lsp.Position) -> int:
        return min(starts[min(at.line, len(starts) - 1)] + at.character, len(text))

    for edit in sorted(edits, key=lambda edit: offset(edit.range.start), reverse=True):
        text = text[: offset(edit.range.start)] + edit.new_text + text[offset(edit.range.end) :]
    return text


def on_line(range_: lsp.Range, line: int) -> lsp.Range:
    """The same part of another line."""
    start, end = range_.start.character, range_.end.character
    return lsp.Range(lsp.Position(line, start), lsp.Position(line, end))


@asynccontextmanager
async def served() -> AsyncIterator[tuple[LanguageClient, dict[str, Editor]]]:
    """A server, and the editors of files that hear of it."""
    client = LanguageClient("test", "1")
    editors: dict[str, Editor] = {}

    listen: Callable[[Callable[[lsp.PublishDiagnosticsParams], None]], object]
    listen = client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)

    def published(params: lsp.PublishDiagnosticsParams) -> None:
        editors[params.uri].published.put_nowait(params)

    listen(published)
    stop: Callable[[], Awaitable[None]] = client.stop
    await client.start_io(sys.executable, "-m", "firable.cli", "lsp")
    await client.initialize_async(lsp.InitializeParams(lsp.ClientCapabilities()))
    client.initialized(lsp.InitializedParams())
    try:
        yield client, editors
    finally:
        await asyncio.wait_for(client.shutdown_async(None), 60)
        client.exit(None)
        await stop()


Act = Callable[[Editor], Awaitable[None]]
Within = Callable[[Path, Act], None]


@pytest.fixture(scope="module")
def within() -> Iterator[Within]:
    """Do something in an editor with one file; one server serves all of them, each as long as it is open."""

    async def enter() -> tuple[LanguageClient, dict[str, Editor]]:
        return await stack.enter_async_context(served())

    async def whole(path: Path, act: Act) -> None:
        one = editors[path.as_uri()] = Editor(client, path)
        await act(one)
        client.text_document_did_close(lsp.DidCloseTextDocumentParams(one.document))

    stack = AsyncExitStack()
    with asyncio.Runner() as runner:
        client, editors = runner.run(enter())
        yield lambda path, act: runner.run(whole(path, act))
        runner.run(stack.aclose())


def test_diagnostics_follow_the_text_and_verdicts_the_file(tmp_path: Path, within: Within) -> None:
    async def act(one: Editor) -> None:
        one.open(LATE)
        verdicts = await one.told(bool)
        by_code = {str(found.code): found for found in verdicts}
        assert {"F3011", "F3012", "F3022"} <= set(by_code)
        assert "15. t1-b" in by_code["F3011"].message
        assert by_code["F3011"].severity is lsp.DiagnosticSeverity.Error
        assert by_code["F3012"].severity is lsp.DiagnosticSeverity.Warning
        one.change(LATE.replace("robot.put_mc, mc.free", "robot.putmc, mc.free"))
        (wrong,) = await one.told(lambda found: len(found) == 1)
        assert wrong.code == "F2002"
        assert "did you mean 'robot.put_mc'?" in wrong.message
        line = LATE.splitlines()[wrong.range.start.line]
        assert line[wrong.range.start.character :].startswith("robot.put_mc")
        one.change(LATE)
        assert await one.told(lambda found: not found) == []

    within(tmp_path / "cell.firable.yaml", act)


def test_a_transition_tells_what_it_waits_for_and_names_lead_to_their_definition(
    tmp_path: Path, within: Within
) -> None:
    async def act(one: Editor) -> None:
        one.open(LATE)
        await one.told(bool)
        here = one.at(LATE, "G3")
        hovered = await one.client.text_document_hover_async(lsp.HoverParams(here.text_document, here.position))
        assert hovered is not None
        assert isinstance(hovered.contents, lsp.MarkupContent)
        assert "- `robot.grasp_cv1` holds a token, which it takes" in hovered.contents.value
        assert "- `robot.touch` is 1: the completion of R GRASP" in hovered.contents.value
        assert "- `conveyor.cv1` is empty, which it fills" in hovered.contents.value
        assert "It is global: conveyor, robot take part." in hovered.contents.value
        there = one.at(LATE, "robot.grasp_cv1", "transitions:")
        found = await one.client.text_document_definition_async(lsp.DefinitionParams(one.document, there.position))
        assert isinstance(found, lsp.Location)
        assert LATE.splitlines()[found.range.start.line].strip().startswith("grasp_cv1:")
        context = lsp.ReferenceContext(include_declaration=True)
        uses = await one.client.text_document_references_async(
            lsp.ReferenceParams(context, one.document, there.position)
        )
        assert len(uses or ()) == LATE.count("grasp_cv1")

    within(tmp_path / "cell.firable.yaml", act)


@pytest.mark.parametrize(
    ("kind", "name", "told"),
    [
        (Kind.PLACE, "robot.back", "`R MOVE to=HOME` is sent, and waits until `robot.at_home` (within 5s)."),
        (Kind.TRANSITION, "G5", "- `robot.at_home` is 1: the completion of R MOVE to=HOME (within 5s)"),
        (
            Kind.TRANSITION,
            "robot.back_timeout",
            "- `robot.back_overdue` is 1: the time limit of `robot.back` (within 5s)",
        ),
        (
            Kind.SIGNAL,
            "robot.back_overdue",
            "- set when `robot.back` has waited too long for `robot.at_home` (within 5s)",
        ),
        (Kind.SIGNAL, "robot.at_home", "cleared by `R MOVE to=HOME` in `robot.back`, which waits for it (within 5s)"),
        (Kind.TRANSITION, "G3", "- `robot.touch` is 1: the completion of R GRASP at=CV1 and R GRASP at=MC\n"),
    ],
)
def test_a_time_limit_is_told_wherever_it_counts(kind: Kind, name: str, told: str) -> None:
    assert told in hover(catalogue_net("one_robot_timed"), Occurrence(kind, name, 0, 0, 0))


def test_a_rename_changes_the_text_or_says_why_not(tmp_path: Path, within: Within) -> None:
    async def act(one: Editor) -> None:
        one.open(LATE)
        await one.told(bool)
        here = one.at(LATE, "robot.grasp_cv1", "transitions:").position
        ready = await one.client.text_document_prepare_rename_async(lsp.PrepareRenameParams(one.document, here))
        assert isinstance(ready, lsp.PrepareRenamePlaceholder)
        assert ready.placeholder == "grasp_cv1"
        edit = await one.client.text_document_rename_async(lsp.RenameParams(one.document, here, "take"))
        assert edit is not None
        assert edit.changes is not None
        assert applied(LATE, edit.changes[one.uri]) == LATE.replace("grasp_cv1", "take")
        own = sum(each.range.end.line - each.range.start.line for each in edit.changes[one.uri])
        assert own == sum("grasp_cv1" in line for line in LATE.splitlines()), "no other line is written anew"
        beside = tmp_path / "cell.layout.yaml"
        beside.write_text("firable_layout: 1\nrows: [[G3]]   # kept\nlanes: [{tracks: [[robot.grasp_cv1]]}]\n")
        edit = await one.client.text_document_rename_async(lsp.RenameParams(one.document, here, "take"))
        assert edit is not None
        assert edit.changes is not None
        layout = beside.read_text()
        assert applied(layout, edit.changes[beside.as_uri()]) == layout.replace("grasp_cv1", "take")
        with pytest.raises(JsonRpcException, match=r"there is a 'robot\.free' already"):
            await one.client.text_document_rename_async(lsp.RenameParams(one.document, here, "free"))
        with pytest.raises(JsonRpcException, match="'on' is text for some YAML parsers"):
            await one.client.text_document_rename_async(lsp.RenameParams(one.document, here, "on"))

    within(tmp_path / "cell.firable.yaml", act)


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf", b"# no text: \xff\n"])
def test_a_rename_keeps_the_line_ends_of_a_layout_file_and_passes_one_over_that_is_no_text(
    tmp_path: Path, within: Within, mark: bytes
) -> None:
    layout = "firable_layout: 1\r\nrows: [[G3]]\r\n"
    beside = tmp_path / "cell.layout.yaml"
    beside.write_bytes(mark + layout.encode())

    async def act(one: Editor) -> None:
        one.open(LATE)
        here = one.at(LATE, "G3", "transitions:").position
        edit = await one.client.text_document_rename_async(lsp.RenameParams(one.document, here, "take"))
        assert edit is not None
        assert edit.changes is not None
        if b"#" in mark:
            assert list(edit.changes) == [one.uri]
        else:
            assert applied(layout, edit.changes[beside.as_uri()]) == layout.replace("G3", "take")

    within(tmp_path / "cell.firable.yaml", act)


def test_a_long_file_is_renamed_in_and_its_names_are_listed_at_once(tmp_path: Path, within: Within) -> None:
    """Of 20,000 lines; both took a quarter of a minute, for lines that repeat and lines that are counted anew."""
    places = "".join(f"  p{i}:\n    description: a place\n\n" for i in range(2000))
    arcs = "".join(
        f"  t{i}:\n    from:\n      - p{i}\n    to:\n      - p{i - 1}\n    description: further\n\n"
        for i in range(1, 2000)
    )
    text = f"cell: c\nplaces:\n{places}start: p1\ntransitions:\n{arcs}"

    async def act(one: Editor) -> None:
        one.open(text)  # of no version yet, so that nothing is checked meanwhile
        assert len(await one.told(bool)) == 1
        found = await asyncio.wait_for(
            one.client.text_document_document_symbol_async(lsp.DocumentSymbolParams(one.document)), 10
        )
        assert found is not None
        assert len(found) == 3999
        one.change(f"firable: 1\n{text}")
        await one.told(lambda found: not found)
        params = lsp.RenameParams(one.document, one.at(f"firable: 1\n{text}", "p7").position, "seven")
        edit = await asyncio.wait_for(one.client.text_document_rename_async(params), 10)
        assert edit is not None
        assert edit.changes is not None
        assert sorted(each.new_text.strip() for each in edit.changes[one.uri]) == ["- seven", "- seven", "seven:"]

    within(tmp_path / "cell.firable.yaml", act)


def test_what_checking_says_is_not_taken_back_by_the_change_before_the_save(tmp_path: Path, within: Within) -> None:
    small = "firable: 1\ncell: c\nplaces:\n  a: {}\n  b: {}\nstart: a\ntransitions:\n  t: {from: a, to: b}\n"

    async def act(one: Editor) -> None:
        one.open(small)
        await one.told(bool)
        one.change(f"{small}# saved at once, as editors do that save by themselves\n")
        one.save()
        last = list[lsp.Diagnostic]()
        with suppress(TimeoutError):
            while True:
                last = list((await asyncio.wait_for(one.published.get(), 1)).diagnostics)
        assert last

    within(tmp_path / "cell.firable.yaml", act)


@pytest.mark.parametrize("new", ["a\nB\nc\nD\n", "a\nb\nnew\nc\nd\n", "", "a\nb\nc\nd"])
def test_the_lines_that_are_others_are_found(new: str) -> None:
    old = ["a\n", "b\n", "c\n", "d\n"]
    made, at = list[str](), 0
    lines = new.splitlines(keepends=True)
    for begin, end, start, stop in _changed(old, lines):
        assert old[begin:end] != lines[start:stop]
        made += [*old[at:begin], *lines[start:stop]]
        at = end
    assert [*made, *old[at:]] == lines


def test_a_file_that_is_closed_has_no_diagnostics_any_more_and_is_not_asked_for(tmp_path: Path, within: Within) -> None:
    async def act(one: Editor) -> None:
        one.open(LATE.replace("firable: 1", "firable: 2"))
        await one.told(bool)
        one.client.text_document_did_close(lsp.DidCloseTextDocumentParams(one.document))
        await one.told(lambda found: not found)

    within(tmp_path / "never_written.firable.yaml", act)
    source = Source("closed", LATE)
    assert not _show("untitled:closed", source, lambda: pytest.fail("it is nowhere on the disk"))


def test_a_cure_is_offered_as_an_action_while_the_text_is_the_checked_one(tmp_path: Path, within: Within) -> None:
    def actions(one: Editor, line: int) -> Awaitable[Any]:
        here = lsp.Range(lsp.Position(line, 0), lsp.Position(line, 1))
        params = lsp.CodeActionParams(one.document, here, lsp.CodeActionContext([]))
        return one.client.text_document_code_action_async(params)

    async def act(one: Editor) -> None:
        one.open(LATE)
        found = await one.told(lambda found: any("cure: " in each.message for each in found))
        (deadlock,) = (each for each in found if each.code == "F3011")
        assert "robot.put_mc (putting on MC) waits in G4 for mc.free" in deadlock.message
        gate, capacity = await actions(one, deadlock.range.start.line)
        assert gate.title == "give G2 the gate `unless: system.processing`"
        assert gate.kind == lsp.CodeActionKind.QuickFix
        assert [each.code for each in gate.diagnostics] == ["F3011"]
        assert "`system.capacity`" in capacity.title
        cured = applied(LATE, gate.edit.changes[one.uri])
        lines, after = LATE.splitlines(), cured.splitlines()
        (added,) = (line for line in after if line not in lines)
        assert added.strip() == "unless: system.processing"
        assert not await actions(one, 0)
        one.change(cured)
        assert not await actions(one, deadlock.range.start.line)
        one.save()
        assert "F3011" not in {each.code for each in await one.told(bool)}

    within(tmp_path / "cell.firable.yaml", act)


def test_what_the_file_expects_of_no_verdict_is_told_at_its_place(tmp_path: Path, within: Within) -> None:
    async def act(one: Editor) -> None:
        one.open(LATE + "expect: {deadlock-fre: violated}\n")
        (wrong,) = await one.told(bool)
        assert "deadlock-fre" in wrong.message

    within(tmp_path / "cell.firable.yaml", act)


def test_a_place_that_nothing_fills_is_told_at_its_place(tmp_path: Path, within: Within) -> None:
    head = "firable: 1\ncell: c\nplaces: {a: , b: , lost: }\nstart: a\n"
    text = f"{head}transitions:\n  t: {{from: a, to: b}}\n  u: {{from: b, to: a}}\n"

    async def act(one: Editor) -> None:
        one.open(text)
        (told,) = await one.told(bool)
        assert (told.code, told.severity) == ("F2031", lsp.DiagnosticSeverity.Warning)
        assert (told.range.start.line, told.range.start.character) == (2, 19)

    within(tmp_path / "cell.firable.yaml", act)


def test_a_controller_tells_how_many_places_and_signals_it_has() -> None:
    net = Net("n", (Place("c.p", owner="c"),), (), controllers=(Controller("c"),))
    assert "A controller with 1 place and 0 signals." in hover(net, Occurrence(Kind.CONTROLLER, "c", 1, 1, 1))


def test_names_are_offered_while_a_bracket_is_open_and_take_the_place_of_what_is_typed(
    tmp_path: Path, within: Within
) -> None:
    async def act(one: Editor) -> None:
        one.open(LATE)
        await one.told(bool)
        begin, typed = "  t3-a: {from: [mc.free, ", "robot.fr"
        line = LATE[: LATE.index("\narbiters:")].count("\n")
        lines = LATE.splitlines()
        one.change("\n".join([*lines[:line], begin + typed, *lines[line:]]))
        here = lsp.CompletionParams(one.document, lsp.Position(line, len(begin + typed)))
        items = await one.client.text_document_completion_async(here)
        assert isinstance(items, list)
        (free,) = (item for item in items if item.label == "robot.free")
        assert isinstance(free.text_edit, lsp.TextEdit)
        assert applied(begin + typed, [lsp.TextEdit(on_line(free.text_edit.range, 0), free.text_edit.new_text)]) == (
            begin + "robot.free"
        )

    within(tmp_path / "cell.firable.yaml", act)


def test_names_and_symbols_are_offered_and_columns_are_those_of_the_client(tmp_path: Path, within: Within) -> None:
    text = 'firable: 1\ncell: "\U0001f916"\nplaces: {p: {description: "\U0001f916"}, q: }\nstart: p\n'

    async def act(one: Editor) -> None:
        one.open(text)
        items = await one.client.text_document_completion_async(lsp.CompletionParams(one.document, lsp.Position(3, 7)))
        assert isinstance(items, list)
        assert {item.label for item in items} == {"p", "q"}
        symbols = await one.client.text_document_document_symbol_async(lsp.DocumentSymbolParams(one.document))
        (q,) = (symbol for symbol in symbols or () if isinstance(symbol, lsp.DocumentSymbol) and symbol.name == "q")
        before = text.splitlines()[2].index("q:")
        assert q.range.start.character == before + 1  # the robot is two units of UTF-16

    within(tmp_path / "cell.firable.yaml", act)


def test_a_buffer_that_begins_with_a_mark_is_read_and_keeps_it(tmp_path: Path, within: Within) -> None:
    text = "\ufeff{firable: 1, cell: c, places: {p: , q: }, start: p}\n"

    async def act(one: Editor) -> None:
        one.open(text)
        assert not await one.told(lambda _: True)
        here = one.at(text, "q").position
        edit = await one.client.text_document_rename_async(lsp.RenameParams(one.document, here, "r"))
        assert edit is not None
        assert edit.changes is not None
        assert applied(text, edit.changes[one.uri]) == text.replace("q", "r")
        symbols = await one.client.text_document_document_symbol_async(lsp.DocumentSymbolParams(one.document))
        (q,) = (symbol for symbol in symbols or () if isinstance(symbol, lsp.DocumentSymbol) and symbol.name == "q")
        assert q.range.start.character == text.index("q")

    within(tmp_path / "cell.firable.yaml", act)


def told_to_end(*before: dict[str, Any]) -> bytes:
    asked: list[dict[str, Any]] = [
        {"id": 1, "method": "initialize", "params": {"processId": None, "rootUri": None, "capabilities": {}}},
        *before,
        {"id": 2, "method": "shutdown"},
        {"method": "exit"},
    ]
    texts = [json.dumps({"jsonrpc": "2.0", **one}).encode() for one in asked]
    return b"".join(b"Content-Length: %d\r\n\r\n%s" % (len(text), text) for text in texts)


def test_a_server_that_is_told_to_end_ends_well_and_says_nothing_more() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "firable.cli", "lsp"], input=told_to_end(), capture_output=True, timeout=60, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert b'"id": 2' in ended.stdout or b'"id":2' in ended.stdout


def test_a_rename_that_is_refused_is_told_to_the_editor_alone(tmp_path: Path) -> None:
    document = {"uri": (tmp_path / "cell.firable.yaml").as_uri()}
    text = "firable: 1\ncell: c\nplaces: {p: , q: }\n"
    opened = {"textDocument": {**document, "languageId": "yaml", "version": 1, "text": text}}
    asked = {"textDocument": document, "position": {"line": 2, "character": 9}, "newName": "q"}
    sent = told_to_end(
        {"method": "textDocument/didOpen", "params": opened},
        {"id": 3, "method": "textDocument/rename", "params": asked},
    )
    ended = subprocess.run(
        [sys.executable, "-m", "firable.cli", "lsp"], input=sent, capture_output=True, timeout=60, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert b"there is a 'q' already" in ended.stdout


def test_a_server_whose_editor_is_gone_ends_and_complains_to_nobody() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run(
        [sys.executable, "-m", "firable.cli", "lsp"],
        input=told_to_end(),
        stdout=writing,
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, b"")
