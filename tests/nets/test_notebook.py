"""What notebooks show: nets and decompositions as pictures, verdicts as sentences, reports with the runs drawn."""

import xml.etree.ElementTree as ET
from dataclasses import replace

from firable.analysis import explore, report_on
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.drawing import draw_coordinator, draw_net, draw_overview
from firable.nets.verdict import Status, Verdict, Witness


def test_a_net_and_its_split_show_their_pictures_unless_they_are_too_large() -> None:
    net = catalogue_net("one_robot")
    assert net._repr_svg_() == draw_net(net)
    assert split(net)._repr_svg_() == draw_coordinator(split(net))
    several = family_net("manufacturing_cells-150")
    assert several._repr_svg_() == draw_overview(several)
    large = family_net("manufacturing_cells-400")
    assert large._repr_svg_() is None
    assert split(large)._repr_svg_() is None


def test_a_verdict_shows_how_it_ended_and_its_run_with_every_name_escaped() -> None:
    witness = Witness((("a<b",), ("c", "d")), note="nothing fires")
    verdict = Verdict("live", Status.VIOLATED, "each & every one", "exploration", code="F3001", witness=witness)
    shown = verdict._repr_html_()
    assert "✗ violated" in shown
    assert "each &amp; every one" in shown
    assert "run: a&lt;b, c + d" in shown
    assert "nothing fires" in shown
    unknown = Verdict("live", Status.UNKNOWN, "s", "walk", bound="9 markings")._repr_html_()
    assert "? unknown" in unknown
    assert "reached: 9 markings" in unknown


def test_a_verdict_shows_whether_it_ended_as_expected() -> None:
    known = Verdict("live", Status.VIOLATED, "s", "m", expected=Status.VIOLATED)
    assert "✓ violated, as expected</b>" in known._repr_html_()
    mended = replace(known, status=Status.PROVED)._repr_html_()
    assert "✗ proved, where violated is expected</b>" in mended
    assert "[F3024] the file expects violated, and it is proved" in mended


def test_a_report_shows_what_is_violated_first_with_its_run_as_a_strip() -> None:
    shown = report_on(explore(catalogue_net("one_robot_mc_late")))._repr_html_()
    strips = shown.split('<svg xmlns="http://www.w3.org/2000/svg" class="strip"')[1:]
    assert strips
    first = ET.fromstring('<svg xmlns="http://www.w3.org/2000/svg"' + strips[0].partition("</svg>")[0] + "</svg>")
    assert {one.get("id") for one in first.iter() if one.get("id")} >= {"step:0", "fired:1:G1"}
    assert float(first.attrib["width"]) <= 900, "as wide as the cell of a notebook"
    circle = "robot.put_mc waits in G4 for mc.free, which comes from mc.release by G6 and G7"
    assert shown.index("1 marking of the net is a deadlock") < shown.index(circle) < shown.index("[F3011]")
    assert shown.index("✗ violated") < shown.index("<details>") < shown.index("✓ proved")
    quiet = report_on(explore(catalogue_net("one_robot")))._repr_html_()
    assert "<svg" not in quiet
