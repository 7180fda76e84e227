"""The report as a page: whole by itself, escaped, the same bytes every time, and true to the report."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from firable.cli.main import main
from firable.cli.page.listed import LISTED_MAX
from firable.cli.page.markup import Markup, raw, tag, together
from firable.cli.page.page import page_of
from firable.cli.page.runs import STEPS_SHOWN_MAX, strip
from firable.cli.page.sections import SECTIONS
from firable.cli.report import Report
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.net import Controller, Net, Place, Transition
from firable.nets.printing import format_net
from firable.nets.verdict import Status, Verdict, Weight, Witness

VOID = {"br", "meta", "rect", "circle", "path", "line"}
EVIL = "<script>alert('x')</script>&\"'"


class Reading(HTMLParser):
    """What a browser sees: the elements, whether each is closed where it should be, and the text."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(page)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text.append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


@pytest.fixture(scope="module")
def proof(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page on the one-robot cell with a sensor that flickers."""
    folder = tmp_path_factory.mktemp("page")
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    plant, page = folder / "p.plant.yaml", folder / "page.html"
    plant.write_text(text.replace("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}"), "utf-8")
    assert main(["prove", "catalogue:one_robot", "--machines", str(plant), "--report", str(page)]) == 1
    return page.read_text("utf-8")


def report_with(*verdicts: Verdict, net: Net | None = None) -> Report:
    return Report("check", "some.firable.yaml", net or catalogue_net("conceptual_one_robot"), verdicts)


# --- Markup


def test_text_is_escaped_and_markup_is_kept() -> None:
    assert tag("p", EVIL) == "<p>&lt;script&gt;alert('x')&lt;/script&gt;&amp;\"'</p>"
    assert tag("p", tag("b", "x"), ["a<", raw("<i>")], None) == "<p><b>x</b>a&lt;<i></p>"
    assert isinstance(together("a"), Markup)


def test_attributes_are_escaped_in_their_quotes() -> None:
    assert tag("a", title='"><script>', cls="x") == '<a title="&quot;&gt;&lt;script&gt;" class="x"></a>'
    assert tag("a", title=None, open=False) == "<a></a>"


# --- The page


def test_the_page_is_well_formed_and_loads_nothing(proof: str) -> None:
    page = Reading(proof)
    assert not {"script", "link", "img", "iframe", "object", "use"} & {name for name, _ in page.tags}
    for _, attributes in page.tags:
        assert not {"src", "srcset", "onclick", "onload"} & attributes.keys()
        assert (attributes.get("href") or "#").startswith("#")
    assert "url(" not in proof
    assert "@import" not in proof
    assert set(re.findall(r"https?://[^\"' <]*", proof)) == {"http://www.w3.org/2000/svg"}


def test_every_link_of_the_page_leads_somewhere_and_every_anchor_is_one(proof: str) -> None:
    page = Reading(proof)
    anchors = [str(attributes["id"]) for _, attributes in page.tags if "id" in attributes]
    assert len(set(anchors)) == len(anchors)
    assert {attributes["href"] for _, attributes in page.tags if "href" in attributes} <= {f"#{one}" for one in anchors}


def test_the_page_says_what_the_report_says(proof: str) -> None:
    words = Reading(proof).words
    for said in ("✗ violated", "1 violated", "150 proved", "Eq. (7)", "15 of 15", "O9", "conflict-1", "G2, G6"):
        assert said in words
    assert words.count("t1-21") >= 2, "in the table, and in what the robot's controller must know"
    assert "'t2-82' had voted yes, and the last firing makes 'mc.part_present' 0" in words


def test_the_steps_of_a_counterexample_stand_in_the_lanes_of_its_controllers(proof: str) -> None:
    table = proof[proof.index('<table class="strip') :]
    table = table[: table.index("</table>")]
    rows = re.findall(r"<tr>.*?</tr>", table)
    told = [Reading(row).words for row in rows]
    assert told[0] == "step system robot mc conveyor plant"
    (loading,) = [row for row in told if " G2 " in row]
    assert "G2 start of loading from CV1 t0-2" in loading
    for said in ("leaves free", "comes to to_cv1", "t2-22", "R MOVE to=CV1 is still to be sent"):
        assert said in loading
    assert "the sensor of mc.part_present drops" in told[-3]
    assert "the controller is told of mc.part_present" in told[-2]
    assert told[-1].startswith("● at the end loading put_mc")


def test_a_command_stands_where_its_place_is_entered() -> None:
    net = catalogue_net("one_robot")
    words = Reading(strip(net, Witness((("G1",), ("G2",))), net)).words
    assert "comes to to_cv1 sends R MOVE to=CV1" in words


def test_the_same_report_gives_the_same_bytes(tmp_path: Path) -> None:
    pages = []
    for name in ("a.html", "b.html"):
        assert main(["check", "catalogue:one_robot_mc_late", "--no-cache", "--report", str(tmp_path / name)]) == 1
        pages.append((tmp_path / name).read_bytes())
    assert pages[0] == pages[1]


def test_whatever_a_net_is_called_is_text() -> None:
    net = Net(
        "x<script>",
        (Place("p", marked=True, description=EVIL), Place("q", description=EVIL)),
        (Transition("t<i", ("p",), ("q",), description=EVIL),),
        description=EVIL,
    )
    verdict = Verdict(
        "a.<b>", Status.VIOLATED, EVIL, EVIL, hint=EVIL, subjects=(EVIL,), witness=Witness((("t<i>",),), note=EVIL)
    )
    page = Reading(page_of(report_with(verdict, net=net)))
    assert "script" not in {name for name, _ in page.tags}
    assert page.words.count("alert('x')") >= 6


def test_the_page_names_the_binding_that_fits() -> None:
    report = report_with(Verdict("deadlock", Status.PROVED, "it never stands still", "explored"))
    assert "binds each signal" not in Reading(page_of(report)).words
    page = page_of(replace(report, binding="cell.bind.yaml"))
    assert "cell.bind.yaml binds each signal and command" in Reading(page).words


def test_a_verdict_of_a_kind_that_nobody_knows_appears_with_its_run() -> None:
    foreign = Witness((("ask G1",), ("yes t0-1", "yes t3-13")), (("ask G2",),), note="G1 is lost")
    verdict = Verdict("new-kind.of.thing", Status.VIOLATED, "nothing is lost", "by some method", witness=foreign)
    unknown = Verdict("other", Status.UNKNOWN, "it ends", "by search", bound="12 markings", hint="more time")
    words = Reading(page_of(report_with(verdict, unknown))).words
    for said in ("nothing is lost", "ask G1 yes t0-1, yes t3-13", "and then for ever again", "G1 is lost"):
        assert said in words
    for said in ("? unknown", "reached: 12 markings", "more time", "1 violated 1 unknown"):
        assert said in words


def test_values_that_refute_are_a_table() -> None:
    net = catalogue_net("conceptual_one_robot")
    witness = Witness(assignment=(("system.mc", True), ("fires(t1)", False)), note="eq7 differs")
    words = Reading(strip(net, witness, net)).words
    assert words == "These values of the net's own names refute it: name value system.mc 1 fires(t1) 0 eq7 differs"


def test_a_run_that_goes_on_for_ever_shows_its_cycle() -> None:
    net = catalogue_net("conceptual_one_robot")
    witness = Witness((("t1",),), (("t2",), ("t3",), ("t4",), ("t5",), ("t6",), ("t1",)))
    words = Reading(strip(net, witness, net)).words
    assert re.search(r"1 t1 start of carrying in .* and then for ever again 2 t2", words)


def test_of_a_very_long_run_the_middle_is_left_out_and_said_to_be() -> None:
    net = Net(
        "long",
        (Place("c.a", "c", marked=True), Place("c.b", "c")),
        (Transition("t", ("c.a",), ("c.b",)), Transition("u", ("c.b",), ("c.a",))),
        controllers=(Controller("c"),),
    )
    written = strip(net, Witness((("t",), ("u",)) * 500), net)
    assert written.count("<tr>") == STEPS_SHOWN_MAX + 3
    assert "760 steps are left out here" in written


def test_of_many_verdicts_the_first_are_listed_and_the_rest_counted() -> None:
    many = [Verdict(f"v{i}", Status.PROVED, "it holds", "m") for i in range(LISTED_MAX + 5)]
    words = Reading(page_of(report_with(*many))).words
    assert words.count("it holds") == LISTED_MAX
    assert "and 5 more" in words
    assert f"{LISTED_MAX + 5} proved" in words


def test_two_verdicts_with_one_run_share_it() -> None:
    witness = Witness((("t1",),), note="here")
    some = [Verdict(name, Status.VIOLATED, name, "m", witness=replace(witness, note=name)) for name in ("one", "two")]
    page = page_of(report_with(*some))
    assert page.count('<table class="strip') == 1
    assert "By the same run as" in page


def test_a_warning_is_no_failure_of_the_whole() -> None:
    witness = Witness((("t1",),))
    warning = Verdict("w", Status.VIOLATED, "it warns", "m", Weight.WARNING, witness=witness)
    proved = Verdict("p", Status.PROVED, "it holds", "m")
    words = Reading(page_of(report_with(warning, proved))).words
    assert "✓ all hold 1 proved 1 warning" in words
    assert "! warning it warns" in words


def test_warnings_that_are_not_decided_are_counted_apart() -> None:
    warnings = [Verdict(f"w{i}", Status.UNKNOWN, "it warns", "m", Weight.WARNING, bound="b") for i in range(2)]
    found = Verdict("w", Status.VIOLATED, "it warns", "m", Weight.WARNING)
    proved = Verdict("p", Status.PROVED, "it holds", "m")
    words = Reading(page_of(report_with(proved, found, *warnings))).words
    assert "✓ all hold 1 proved 3 warnings (2 unknown)" in words


def test_sections_without_content_are_left_out() -> None:
    page = Reading(page_of(report_with(Verdict("p", Status.PROVED, "it holds", "m"))))
    ids = [attributes["id"] for name, attributes in page.tags if name == "section"]
    assert ids == ["verdicts", "cell"]
    assert len({section.anchor for section in SECTIONS}) == len(SECTIONS)


def test_the_loop_stands_beside_the_open_net(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    late = "catalogue:one_robot_mc_late"
    assert main(["check", late, "--machines", late, "--report", str(path)]) == 1
    words = Reading(path.read_text("utf-8")).words
    assert "deadlock-free ✗ violated ✗ violated" in words
    assert "1,838 markings and 5,670 edges" in words
    assert "from here no transition of the cell ever fires again" in words


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["refine", "catalogue:conceptual_one_robot"], ("Refinement of the net", "How it was found")),
        (["split", "catalogue:one_robot"], ("Split over its controllers", "What each controller must know")),
        (["bundle", "catalogue:one_robot", "-o", "cell.bundle"], ("Bundle", "Obligations", "40 markings, 70 edges")),
    ],
)
def test_every_command_that_answers_on_a_net_can_write_its_page(
    arguments: list[str], said: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*arguments, "--report", "page.html"]) == 0
    words = Reading(Path("page.html").read_text("utf-8")).words
    assert all(one in words for one in said)


# --- The command


def test_the_json_names_the_page_among_the_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "page.html"
    assert main(["prove", "catalogue:one_robot", "--report", str(path), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["reports"][0]["files"] == [str(path)]
    assert main(["prove", "catalogue:one_robot", "--report", str(path)]) == 0
    assert f"the report as a page: {path}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "catalogue:one_robot", "--report", "-"], "cannot go to standard output"),
        (["check", "catalogue:one_robot", "catalogue:one_robot", "--report", "x"], "--report is a page on one net"),
        (["prove", "catalogue:one_robot", "--report", "no-such-folder/x.html"], "F1017"),
    ],
)
def test_a_page_that_has_no_place_is_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert message in captured.err + captured.out


def test_a_net_of_many_controllers_has_a_page_that_a_browser_can_hold(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    assert main(["prove", "catalogue:workshop-40", "--report", str(path)]) == 0
    page = path.read_text("utf-8")
    assert len(page) < 2_000_000
    words = Reading(page).words
    assert "transition parts global because of" in words, "no column for each controller"
    assert "Overview: " not in words, "the net has a description"
    assert 'id="controller:' in page
    assert "are too many for a picture that can be read" not in words


def test_a_large_net_without_controllers_has_no_picture_on_its_page(tmp_path: Path) -> None:
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(81))
    around = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{(i + 1) % 81}",)) for i in range(81))
    path = tmp_path / "ring.firable.yaml"
    path.write_text(format_net(Net("ring", places, around)), "utf-8")
    words = page_written(tmp_path, "check", str(path)).words
    assert "81 transitions are too many for a picture that can be read" in words


def test_the_page_of_a_split_tells_first_who_decides_what(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    assert main(["split", "catalogue:one_robot", "--report", str(path)]) == 0
    page = Reading(path.read_text("utf-8"))
    ids = [attributes["id"] for name, attributes in page.tags if name == "section"]
    assert ids == ["coordinator", "table", "groups", "votes", "controllers", "cell"]
    assert "by the order of the file system" in page.words, "as the terminal says it"


def page_written(tmp_path: Path, *command: str) -> Reading:
    path = tmp_path / "page.html"
    assert main([*command, "--report", str(path)]) == 0
    return Reading(path.read_text("utf-8"))


def test_the_page_of_a_layered_net_says_of_each_row_who_decides_it(tmp_path: Path) -> None:
    words = page_written(tmp_path, "split", "catalogue:two_cells").words
    assert "t1-11 t2-12 t3-13 t4-14 line its arcs" in words
    assert "t2-32 t3-33 t4-34 cell_a its arcs" in words
    assert "t2-42 t3-43 t4-44 line its arcs; decided above cell_a, as it competes with load_a at robot_a.free" in words
    assert "· for information: nothing has to hold" in words
    assert "all hold" not in words


def test_verdicts_that_are_alike_are_one_line_that_unfolds(tmp_path: Path) -> None:
    votes = page_written(tmp_path, "split", "catalogue:one_robot").words
    assert "persistent 22 of 24 votes of which no other transition takes the yes back" in votes
    tasks = page_written(tmp_path, "refine", "catalogue:conceptual_one_robot").words
    assert "load 4 of 4 ends, ends-clean, contact-free, complete" in tasks
    assert "opens 5 of 5" in tasks


def test_the_head_says_that_the_protocol_that_runs_holds_and_wrong_ones_do_not(tmp_path: Path) -> None:
    path = tmp_path / "n.firable.yaml"
    path.write_text(
        "firable: 1\ncell: n\ncontrollers:\n  a: {start: [p], places: {p: {}, q: {}}}\n"
        "  b: {start: [r], places: {r: {}, s: {}}}\n"
        "transitions:\n  g: {from: [a.p, b.r], to: [a.q, b.s]}\n  back: {from: [a.q, b.s], to: [a.p, b.r]}\n"
    )
    words = page_written(tmp_path, "prove", str(path), "--wrong").words
    assert re.search(
        r"all hold \d+ proved this is of the protocol that runs; of the \d+ known to be wrong, \d+ go wrong", words
    )


def test_what_the_file_expects_is_no_failure_and_a_change_is_told() -> None:
    witness = Witness((("t1",),))
    known = Verdict("k", Status.VIOLATED, "it is known to fail", "m", witness=witness, expected=Status.VIOLATED)
    held = Verdict("h", Status.PROVED, "it is known to hold", "m", Weight.INFORMATION, expected=Status.PROVED)
    words = Reading(page_of(report_with(known, held))).words
    assert "✓ all as expected 2 as expected" in words
    assert "✗" not in words
    mended = replace(known, status=Status.PROVED, witness=None)
    other = Verdict("o", Status.VIOLATED, "it fails", "m", witness=Witness((("t2",),)))
    words = Reading(page_of(report_with(held, mended, known, other))).words
    assert "✗ violated 1 violated 1 changed 2 as expected" in words
    assert "✗ it is known to fail : proved, where the file expects violated" in words
    assert words.index("✗ violated it fails") < words.index("= expected it is known to fail")  # the runs
    assert "[F3024] the file expects violated, and it is proved; where that is right, write k: proved" in words


def test_the_head_names_what_fails_without_a_run_too() -> None:
    dead = Verdict("quasi-live", Status.VIOLATED, "no transition is dead", "m", subjects=("t1", "t2"))
    run = Verdict("d", Status.VIOLATED, "it goes on", "m", subjects=("t3",), witness=Witness((("t1",),)))
    many = replace(dead, name="many", statement="all are good", subjects=tuple(f"t{i}" for i in range(10)))
    words = Reading(page_of(report_with(dead, run, many))).words.partition("Counterexamples")[0]
    assert "✗ no transition is dead about: t1, t2 ✗ it goes on ✗ all are good about: t0, t1," in words
    assert "t6, t7 and 2 more" in words


def test_what_is_typed_stands_as_code_in_a_hint() -> None:
    known = Verdict("k", Status.PROVED, "it fails", "m", expected=Status.VIOLATED)
    page = page_of(report_with(known))
    assert 'write <span class="code">k: proved</span> under <span class="code">expect</span>' in page
    assert "`" not in page


def test_a_deadlock_tells_who_waits_for_whom_and_what_would_cure_it(tmp_path: Path) -> None:
    path = tmp_path / "late.html"
    assert main(["check", "catalogue:one_robot_mc_late", "--no-cache", "--report", str(path)]) == 1
    words = Reading(path.read_text("utf-8")).words
    first = "robot.put_mc (putting on MC) waits in G4 for mc.free, which comes from mc.release by G6 and G7"
    second = "waits in G6 for robot.free, which comes from robot.put_mc by G4 and G5"
    cure = "give G2 the gate unless: system.processing checked: 40 markings; cures doomed-markings, live"
    at = [words.index(said) for said in ("in a circle, each for the next", first, second, "What would cure it", cure)]
    assert at == sorted(at)
    assert "Cured by the same change as deadlock-free" in words
