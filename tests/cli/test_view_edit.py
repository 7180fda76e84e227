"""The page edits a net: the text of the file is the truth, and what is no net is not written."""

from __future__ import annotations

import asyncio
import json
import re
import urllib.error
import urllib.request
from collections.abc import Coroutine, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Dialog, Page, Route, expect
from support.browser import PATIENCE_MS, browser, command, needs_browser, page_at
from support.waiting import until

from firable.cli.main import main
from firable.cli.options import load_net
from firable.cli.view.editing import editing_of
from firable.cli.view.playing import Playing
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import InputError

expect.set_options(timeout=PATIENCE_MS)

TEXT = """\
# the cell
firable: 1
cell: demo
controllers:
  robot:
    start: free
    inputs: [door_shut]   # a sensor
    places:
      free:     # at rest
      busy:     {send: {machine: R, command: MOVE}, until: at_home}
  mc:
transitions:
  go:   {from: robot.free, to: robot.busy}   # there
  back: {from: robot.busy, to: robot.free}   # and back
properties:
  rests: {always_possible: robot.free}
"""


def first_of(page: Page, requests: list[Route]) -> Route:
    """The first request of a page that was caught: the browser tells of it while somebody waits for the page."""

    def is_told() -> bool:
        page.wait_for_timeout(10)
        return bool(requests)

    until(is_told, "a request of the page")
    return requests[0]


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    path = tmp_path_factory.mktemp("edit") / "cell.firable.yaml"
    path.write_text(TEXT)
    with command("view", path, "--no-browser") as (address, _):
        yield address, path


@pytest.fixture
def file(served: tuple[str, Path]) -> Path:
    """The file as it was at first, and known so to the server."""
    address, path = served
    path.write_text(TEXT)
    assert asked(address, "reload", {})[0] == 200
    return path


def asked(address: str, path: str, body: object = None, *, shown: bool = True, of: str = "edit/") -> tuple[int, Any]:
    base, _, token = address.partition("#token=")
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"{base}api/{of}{path}".rstrip("/"), data)
    if shown:
        request.add_header("Authorization", f"Bearer {token}")
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def ended(answer: Coroutine[Any, Any, dict[str, Any]]) -> dict[str, Any]:
    """An answer of the server, in a thread of its own: the browser is driven from an event loop in this one."""
    with ThreadPoolExecutor() as thread:
        return thread.submit(asyncio.run, answer).result()


def begin(page: Page, text: str = TEXT) -> None:
    page.get_by_role("button", name="Edit", exact=True).click()
    expect(page.get_by_label("Text of the net file")).to_have_value(text)


def done(page: Page, words: str) -> None:
    expect(page.locator(".status")).to_have_text(f"Done: {words}.")


@needs_browser
def test_a_net_is_edited_in_the_picture_and_by_names_and_all_is_undone(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    with page_at(chromium, served[0]) as page:
        begin(page)
        adding = page.locator(".panel").filter(has=page.get_by_role("heading", name="Add"))
        adding.get_by_label("Owner").select_option("robot")
        adding.get_by_label("Name").fill("free")
        page.keyboard.press("Enter")
        expect(page.get_by_role("alert")).to_contain_text("there is a 'free' already")
        expect(adding.get_by_label("Name")).to_have_value("free")
        adding.get_by_label("Name").fill("done")
        adding.get_by_label("Owner").select_option("mc")
        page.keyboard.press("Enter")
        done(page, "place done added")
        expect(adding.get_by_label("Name")).to_have_value("")
        page.get_by_role("button", name="Arc").click()
        page.locator('[id="transition:go"] rect.hit').first.click()
        page.locator('[id="place:mc.done"] circle.place').click()
        done(page, "go to mc.done")
        page.get_by_role("group", name="Gate unless").get_by_role("combobox").select_option("robot.door_shut")
        page.get_by_role("button", name="Gate unless: add").click()
        done(page, "go unless robot.door_shut")
        page.keyboard.press("Escape")
        page.locator('[id="place:robot.busy"] circle.place').click()
        page.get_by_label("Owner").first.select_option("mc")
        page.get_by_role("button", name="Give").click()
        done(page, "robot.busy given to mc")
        page.get_by_label("Name").first.fill("moving")
        page.keyboard.press("Enter")
        done(page, "mc.busy renamed to moving")
        moved = "{send: {machine: R, command: MOVE}, until: at_home}\n"
        expected = (
            TEXT.replace(f"      busy:     {moved}", "")
            .replace("  mc:\n", f"  mc:\n    places:\n      done:\n      moving: {moved}")
            .replace("robot.busy}   # there", "[mc.moving, mc.done], unless: robot.door_shut}   # there")
            .replace("robot.busy, to: robot.free}", "mc.moving, to: robot.free}")
        )
        assert file.read_text() == expected
        page.get_by_role("button", name="← Play").click()
        expect(page.locator('[id="place:mc.moving"]')).to_be_attached()
        begin(page, expected)
        for words in (
            "mc.busy renamed to moving",
            "robot.busy given to mc",
            "go unless robot.door_shut",
            "go to mc.done",
        ):
            page.locator(".picture").focus()
            page.keyboard.press("Control+z")
            expect(page.locator(".status")).to_have_text(f"Undone: {words}.")
        page.keyboard.press("Control+z")
        expect(page.get_by_label("Text of the net file")).to_have_value(TEXT)
        assert file.read_text() == TEXT
        page.keyboard.press("Control+Shift+z")
        expect(page.locator('[id="place:mc.done"]')).to_be_attached()


@needs_browser
def test_a_cure_that_was_checked_is_written_into_the_file_and_undone(chromium: Browser, tmp_path: Path) -> None:
    late = catalogue_path("one_robot_mc_late").read_text("utf-8")
    path = tmp_path / "late.firable.yaml"
    path.write_text(late, "utf-8")
    with command("view", path, "--no-browser") as (address, _), page_at(chromium, address) as page:
        status, answer = asked(address, "", {"version": asked(address, "")[1]["version"], "do": "cure"})
        assert (status, answer["errors"][0]["code"]) == (422, "F5070")
        violated = page.locator(".verdicts > li").filter(has_text="✗ deadlock-free")
        checking = page.get_by_role("button", name="Check this net")
        writing = violated.get_by_role(
            "button", name="Write into the file: give G2 the gate `unless: system.processing`"
        )
        checking.click()
        page.get_by_role("button", name="▶ Play deadlock-free").click()
        page.get_by_role("slider").press("End")
        edit = page.get_by_role("button", name="Edit", exact=True)
        expect(edit).to_be_disabled()
        page.get_by_role("button", name="Close", exact=True).click()
        expect(edit).to_be_enabled()
        page.get_by_role("button", name="▶ Play deadlock-free").click()
        violated.get_by_text("2 cures of deadlock-free").click()
        writing.click()
        expect(page.locator(".banner")).to_contain_text("Written into the file: give G2 the gate")
        expect(page.locator(".playback")).to_have_count(0)
        assert path.read_text("utf-8") != late
        page.locator(".banner").get_by_role("button", name="Undo").click()
        expect(page.locator(".banner")).to_contain_text("Undone: what cures deadlock-free.")
        assert path.read_text("utf-8") == late
        checking.click()
        violated.get_by_text("2 cures of deadlock-free").click()
        writing.click()
        expect(page.locator(".banner")).to_contain_text("Written into the file: give G2 the gate")
        begin = late.index("to: [system.loading, robot.to_cv1, conveyor.cv1_wait]\n")
        end = late.index("\n", begin) + 1
        assert path.read_text("utf-8") == f"{late[:end]}    unless: system.processing\n{late[end:]}"
        checking.click()
        expect(page.locator(".verdicts > li").filter(has_text="✓ deadlock-free")).to_be_visible()
        expect(violated).to_have_count(0)
        page.get_by_role("button", name="Edit", exact=True).click()
        expect(page.get_by_role("button", name="Undo")).to_have_attribute(
            "title", "Undo (Ctrl+Z): what cures deadlock-free"
        )


@needs_browser
def test_what_is_no_net_is_shown_at_its_line_and_not_written(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    with page_at(chromium, served[0]) as page:
        page.get_by_role("tab", name="Top view").click()
        expect(page.get_by_role("tabpanel")).to_contain_text("There is no top view: no plant file says")
        begin(page)
        page.locator('[id="place:robot.free"]').focus()
        page.keyboard.press("Enter")
        page.get_by_role("button", name="Delete robot.free").click()
        expect(page.get_by_role("alert")).to_contain_text("nothing is written: there is no place 'robot.free'")
        text = page.get_by_label("Text of the net file")
        expect(text).to_have_attribute("aria-invalid", "true")
        expect(page.locator(".gutter .bad")).to_have_text("14")
        assert file.read_text() == TEXT
        text.fill(text.input_value().replace("always_possible: robot.free", "never: robot.busy"))
        expect(page.locator(".problems li")).to_have_count(0)
        page.keyboard.press("Control+s")
        done(page, "the text")
        expect(page.locator('[id="place:robot.free"]')).to_have_count(0)
        assert "never: robot.busy" in file.read_text()
        assert "# and back" in file.read_text()


@needs_browser
def test_a_file_that_somebody_else_has_changed_is_not_written_over(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    theirs = TEXT.replace("cell: demo", "cell: other")
    with page_at(chromium, served[0]) as page:
        begin(page)
        page.get_by_label("Chosen").select_option("transition:back")
        file.write_text(theirs)
        page.get_by_role("button", name="Delete back").click()
        expect(page.get_by_role("alert")).to_contain_text("has been changed by somebody else")
        assert file.read_text() == theirs
        page.get_by_role("button", name="Load it again").click()
        expect(page.get_by_label("Text of the net file")).to_have_value(theirs)
        expect(page.get_by_role("button", name="Undo")).to_be_disabled()
        file.write_text(TEXT)
        expect(page.locator(".banner")).to_contain_text("The file has been changed on the disk.")


@needs_browser
def test_a_file_that_is_loaded_again_while_a_run_is_played_is_played_by_hand(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    stuck = TEXT.replace("  back: {from: robot.busy, to: robot.free}   # and back\n", "")
    file.write_text(stuck)
    assert asked(served[0], "reload", {})[0] == 200
    with page_at(chromium, served[0]) as page:
        page.get_by_role("button", name="Check this net").click()
        page.get_by_role("button", name="▶ Play deadlock-free").click()
        page.get_by_role("region", name="The run deadlock-free").get_by_role("button", name="▶ Play").click()
        expect(page.get_by_role("heading", name="May fire")).to_be_hidden()
        file.write_text(TEXT)
        page.get_by_role("button", name="Load it again").click()
        expect(page.get_by_role("heading", name="May fire")).to_be_visible()
        refused = page.evaluate(
            """() => new Promise((told) => {
                const before = window.fetch;
                let asked = 0;
                window.fetch = (path, ...more) => { asked += path === "api/moment"; return before(path, ...more); };
                setTimeout(() => told(asked), 2500);
            })"""
        )
        assert refused == 0, "the clock of the run that was played goes on"


@needs_browser
def test_an_edit_in_another_window_is_told_and_can_be_undone_in_both(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    address = served[0]
    with page_at(chromium, address) as playing, page_at(chromium, address) as editing:
        begin(editing)
        version = asked(address, "")[1]["version"]
        gone = {"do": "delete", "kind": "transition", "name": "back", "version": version}
        assert asked(address, "", gone)[0] == 200
        expect(editing.locator(".banner")).to_contain_text("The net has been edited in another window.")
        expect(playing.locator(".banner")).to_contain_text("The net has been edited in another window.")
        playing.locator('button[data-transition="go"]').click()
        expect(playing.get_by_role("alert")).to_contain_text("the net has been edited in another window")
        editing.get_by_role("button", name="Load it again").click()
        expect(editing.locator('[id="transition:back"]')).to_have_count(0)
        editing.get_by_role("button", name="Undo").click()
        expect(editing.locator(".status")).to_have_text("Undone: back deleted.")
        assert file.read_text() == TEXT


@needs_browser
def test_a_file_of_which_somebody_else_has_made_no_net_is_not_played_as_if_it_were_shown(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    broken = TEXT.replace("to: robot.busy}", "to: robot.bussy}")
    with page_at(chromium, served[0]) as page:
        begin(page)
        file.write_text(broken)
        page.get_by_role("button", name="Load it again").click()
        expect(page.get_by_role("alert")).to_have_text(
            "The file is no net: there is no place 'robot.bussy'. Mend it in the text below."
        )
        expect(page.locator(".text-pane summary")).to_have_text("Text of the file no net: 1 problem")
        expect(page.get_by_role("button", name="Discard")).to_be_disabled()
        page.get_by_role("button", name="← Play").click()
        expect(page.locator(".banner")).to_contain_text("The file is no net as it stands on the disk.")
        page.get_by_role("button", name="Edit", exact=True).click()
        expect(page.get_by_role("alert")).to_contain_text("The file is no net: there is no place 'robot.bussy'.")
        text = page.get_by_label("Text of the net file")
        expect(text).to_have_value(broken)
        text.fill(TEXT)
        page.keyboard.press("Control+s")
        done(page, "the text")
        assert file.read_text() == TEXT


@needs_browser
@pytest.mark.parametrize("where", ["Play", "Edit"])
def test_a_file_that_is_gone_is_named(chromium: Browser, served: tuple[str, Path], file: Path, where: str) -> None:
    with page_at(chromium, served[0]) as page:
        if where == "Edit":
            begin(page)
        file.unlink()
        page.get_by_role("button", name="Load it again").click()
        expect(page.get_by_role("alert")).to_contain_text(f"{file}: cannot be read: No such file or directory")


@needs_browser
def test_an_edit_is_undone_from_the_field_that_made_it_and_what_is_typed_there_is_not(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    with page_at(chromium, served[0]) as page:
        begin(page)
        page.get_by_label("Chosen").select_option("place:robot.busy")
        page.get_by_label("a token at first").focus()
        page.keyboard.press("Space")
        done(page, "a token on robot.busy")
        expect(page.get_by_label("a token at first")).to_be_focused()
        page.keyboard.press("Control+z")
        expect(page.locator(".status")).to_have_text("Undone: a token on robot.busy.")
        words = page.get_by_label("Description")
        words.fill("on its way")
        page.keyboard.press("Enter")
        done(page, "robot.busy described")
        expect(words).to_be_focused()
        page.keyboard.type("!")
        page.keyboard.press("Control+z")
        expect(words).to_have_value("on its way")
        page.keyboard.press("Control+z")
        page.keyboard.press("Control+z")  # which finds nothing more to undo
        expect(page.locator(".status")).to_have_text("Undone: robot.busy described.")
        assert file.read_text() == TEXT
        page.keyboard.press("Control+Shift+z")
        expect(page.locator(".status")).to_have_text("Done: robot.busy described.")
        expect(page.locator(".banner")).to_have_count(0)


@needs_browser
def test_what_is_chosen_by_its_name_is_brought_into_sight(chromium: Browser, tmp_path: Path) -> None:
    path = tmp_path / "cell.firable.yaml"
    path.write_text(catalogue_path("one_robot").read_text())
    small = {"width": 1000, "height": 500}
    with (
        command("view", path, "--no-browser") as (address, _),
        page_at(chromium, address, viewport=small) as page,
    ):
        page.get_by_role("button", name="Edit", exact=True).click()
        for kind, name, part in (("place", "conveyor.cv2_run", "circle.place"), ("transition", "G1", "rect.hit")):
            shape = page.locator(f'[id="{kind}:{name}"] {part}').first
            expect(shape).to_be_attached()
            page.get_by_label("Chosen").select_option(f"{kind}:{name}")
            room, seen = page.locator(".picture").bounding_box(), shape.bounding_box()
            assert room is not None
            assert seen is not None
            assert room["y"] <= seen["y"] <= room["y"] + room["height"] - seen["height"]


def test_to_load_a_file_again_that_nobody_has_changed_changes_nothing(served: tuple[str, Path], file: Path) -> None:
    address = served[0]
    added = {"do": "add", "kind": "transition", "name": "more", "version": asked(address, "")[1]["version"]}
    before = asked(address, "", added)[1]
    assert asked(address, "reload", {})[1] == before
    file.write_text(TEXT)
    after = asked(address, "reload", {})[1]
    assert after["edit"]["undo"] is None
    assert after["page"]["shown"] > before["page"]["shown"]


@needs_browser
def test_a_file_with_line_ends_of_windows_is_edited_and_keeps_them(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    ends = b"# a comment\n" + TEXT.replace("\n", "\r\n").encode()  # and one of another editor
    file.write_bytes(ends)
    assert asked(served[0], "reload", {})[0] == 200
    with page_at(chromium, served[0]) as page:
        begin(page, ends.decode().replace("\r\n", "\n"))
        page.get_by_label("Chosen").select_option("transition:back")
        page.get_by_role("button", name="Delete back").click()
        done(page, "back deleted")
        gone = b"  back: {from: robot.busy, to: robot.free}   # and back\r\n"
        assert file.read_bytes() == ends.replace(gone, b"")
        page.get_by_role("button", name="Undo").click()
        expect(page.locator(".status")).to_have_text("Undone: back deleted.")
        assert file.read_bytes() == ends


@needs_browser
def test_nothing_is_typed_into_a_text_whose_place_another_takes(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    with page_at(chromium, served[0]) as page:
        begin(page)
        answers: list[Route] = []
        page.route("**/api/edit", lambda route: answers.append(route))
        page.get_by_label("Chosen").select_option("transition:back")
        page.get_by_role("button", name="Delete back").click()
        text = page.get_by_label("Text of the net file")
        expect(text).not_to_be_editable()
        first_of(page, answers).continue_()
        done(page, "back deleted")
        expect(text).to_be_editable()
        text.press("Control+End")
        page.keyboard.type("# more")
        expect(text).to_have_value(file.read_text() + "# more")


@needs_browser
def test_what_is_typed_while_a_text_is_written_is_not_lost(
    chromium: Browser, served: tuple[str, Path], file: Path
) -> None:
    with page_at(chromium, served[0]) as page:
        begin(page)
        answers: list[Route] = []
        page.route("**/api/edit/text", lambda route: answers.append(route))
        text = page.get_by_label("Text of the net file")
        text.fill(TEXT + "# one\n")
        page.keyboard.press("Control+s")
        text.fill(TEXT + "# one\n# two\n")
        first_of(page, answers).continue_()
        done(page, "the text")
        assert file.read_text() == TEXT + "# one\n"
        expect(text).to_have_value(TEXT + "# one\n# two\n")
        asked_first: list[str] = []

        def no(dialog: Dialog) -> None:
            asked_first.append(dialog.message)
            dialog.dismiss()

        page.once("dialog", no)
        file.write_text(TEXT)
        page.get_by_role("button", name="Load it again").click()
        expect(text).to_have_value(TEXT + "# one\n# two\n")
        assert "not written" in asked_first[0]


def test_what_gets_another_name_keeps_its_place_in_the_layout_file(served: tuple[str, Path], file: Path) -> None:
    address = served[0]
    layout = file.with_name("cell.layout.yaml")
    before = """\
firable_layout: 1
lanes:
- owner: mc   # on the left
- {owner: robot, tracks: [[robot.busy], [robot.free]]}
rows: [[back], [go]]   # turned round
"""
    moved = {"do": "own", "kind": "place", "name": "robot.free", "owner": "mc"}
    edits = [
        ({"do": "rename", "kind": "place", "name": "robot.busy", "new": "work"}, {"robot.busy": "robot.work"}),
        ({"do": "rename", "kind": "transition", "name": "go", "new": "start"}, {"go": "start"}),
        ({"do": "rename", "kind": "controller", "name": "robot", "new": "R1"}, {"robot": "R1"}),
        (moved | {"name": "R1.free"}, {"R1.free": "mc.free"}),
    ]

    def edited(path: str, body: Mapping[str, object]) -> None:
        status, answer = asked(address, path, {"version": asked(address, "")[1]["version"], **body})
        assert (status, answer.get("errors")) == (200, None)

    def drawn() -> dict[str, str]:
        answer = asked(address, "picture", {}, of="")[1]["picture"]
        return dict(re.findall(r'id="transition:(\w+)".*?<rect class="bar" x="[^"]*" y="([^"]*)"', answer, re.DOTALL))

    layout.write_text(before)
    try:
        asked(address, "reload", {})
        shown, texts = drawn(), [before]
        assert float(shown["back"]) < float(shown["go"])
        for edit, names in edits:
            edited("", edit)
            text = texts[-1]
            for name, new in names.items():
                text = re.sub(rf"\b{re.escape(name)}\b", new, text)
            assert layout.read_text() == text
            texts.append(text)
        assert drawn() == {"start": shown["go"], "back": shown["back"]}
        for text in texts[-2::-1]:
            edited("undo", {})
            assert layout.read_text() == text
        assert drawn() == shown
        edited("redo", {})
        assert layout.read_text() == texts[1]
        layout.write_text("- broken")
        edited("", edits[1][0])
        assert layout.read_text() == "- broken"
    finally:
        layout.unlink()


def test_nobody_edits_without_the_token_or_what_is_not_understood(served: tuple[str, Path], file: Path) -> None:
    address = served[0]
    for path in ("", "text", "try", "undo", "redo", "reload"):
        assert asked(address, path, {}, shown=False)[0] == 401
    version = asked(address, "")[1]["version"]
    for body in (
        {},
        {"do": "add"},
        {"do": "own", "kind": "transition", "name": "go", "owner": None},
        {"do": "delete", "kind": "cell", "name": "c"},
    ):
        status, answer = asked(address, "", {"version": version, **body})
        assert (status, answer["errors"][0]["code"]) == (422, "F5070")
    status, answer = asked(address, "text", {"version": "another", "text": "firable: 1\ncell: c\n"})
    assert (status, answer["errors"][0]["code"]) == (422, "F1019")
    status, answer = asked(address, "undo", {"version": version})
    assert (status, answer["errors"][0]["code"]) == (422, "F5070")
    assert file.read_text() == TEXT


@pytest.mark.parametrize(
    ("net", "read_only", "why"),
    [
        ("cell.firable.yaml", True, "--read-only"),
        ("catalogue:one_robot", False, "`firable convert catalogue:one_robot -o one_robot.firable.yaml` makes a file"),
        ("cell.pnml", False, "`firable convert cell.pnml -o cell.firable.yaml` makes a net file"),
    ],
)
def test_what_may_not_be_edited_says_why(
    net: str, read_only: bool, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cell.firable.yaml").write_text(TEXT)
    assert main(["convert", "cell.firable.yaml", "-o", "cell.pnml"]) == 0
    loaded = load_net(net)
    editing = editing_of(Playing(loaded, net), net, read_only=read_only)
    assert not editing.playing.editable
    assert why in ended(editing.state({}))["why_not"]
    with pytest.raises(InputError, match="F1020"):
        ended(editing.put({"version": None, "text": "firable: 1\ncell: c\n"}))
    assert Path("cell.firable.yaml").read_text() == TEXT
