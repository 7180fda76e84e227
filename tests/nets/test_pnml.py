"""PNML in and out: what is carried, what is said, what is refused."""

import csv
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from support.examples import examples
from support.reference import load_net, reference_names
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.diagnostics import InputError, Severity
from firable.nets.net import Net, Place, Transition
from firable.nets.pnml import PnmlImport, parse_pnml, read_pnml, write_pnml
from firable.nets.text import parse_net

CONTACT = "contact rule"


def pnml(body: str, head: str = '<net id="n" type="http://www.pnml.org/version-2009/grammar/ptnet">') -> str:
    return f'<pnml xmlns="http://www.pnml.org/version-2009/grammar/pnml">{head}<page id="g">{body}</page></net></pnml>'


P = '<place id="p"><initialMarking><text>1</text></initialMarking></place>'
Q = '<place id="q"/>'
T = '<transition id="t"/>'


def arc(source: str, target: str, inside: str = "", attributes: str = "") -> str:
    return f'<arc id="{source}-{target}" source="{source}" target="{target}" {attributes}>{inside}</arc>'


def messages(imported: PnmlImport) -> list[str]:
    assert all(note.code == "F1016" and note.severity is Severity.WARNING for note in imported.notes)
    return [note.message for note in imported.notes if CONTACT not in note.message]


def codes(data: str | bytes) -> list[str]:
    with pytest.raises(InputError) as refused:
        parse_pnml(data, "n.pnml")
    for problem in refused.value.diagnostics:
        assert problem.span is not None
        assert problem.hint
    return [problem.code for problem in refused.value.diagnostics]


# What is carried


def test_a_plain_net_is_carried_without_notes() -> None:
    imported = parse_pnml(pnml(P + Q + T + arc("p", "t") + arc("t", "q")))
    assert imported.net == Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    assert messages(imported) == []


def test_the_contact_rule_is_always_noted() -> None:
    assert any(CONTACT in note.message for note in parse_pnml(pnml(T)).notes)
    assert parse_pnml(pnml(P)).notes == ()


READ = (
    '<type value="read"/>',
    '<type value="test"/>',
    "<type><text>read</text></type>",
    "<arctype><text>readArc</text></arctype>",
    '<type value="http://www.example.org/arcs#test"/>',
)
INHIBITOR = (
    '<type value="inhibitor"/>',
    "<type><text>Inhibitor</text></type>",
    "<arctype><text>inhibitor-arc</text></arctype>",
)


@pytest.mark.parametrize("kind", READ)
@pytest.mark.parametrize("ends", [("p", "t"), ("t", "p")])
def test_a_read_arc_is_a_permissive_gate(kind: str, ends: tuple[str, str]) -> None:
    net = parse_pnml(pnml(P + T + arc(*ends, kind))).net
    assert net.transitions == (Transition("t", permissive=("p",)),)


@pytest.mark.parametrize("kind", INHIBITOR)
def test_an_inhibitor_arc_is_an_inhibitive_gate(kind: str) -> None:
    net = parse_pnml(pnml(P + T + arc("p", "t", kind))).net
    assert net.transitions == (Transition("t", inhibitive=("p",)),)


@pytest.mark.parametrize(
    ("attributes", "expected"),
    [
        ('type="read"', Transition("t", permissive=("p",))),
        ('type="inhibitor"', Transition("t", inhibitive=("p",))),
        ('type="tapnInhibitor" weight="1"', Transition("t", inhibitive=("p",))),
        ('kind="test"', Transition("t", permissive=("p",))),
        ('type="normal" weight="1"', Transition("t", ("p",))),
        ('type="timed" inscription="[0,inf)"', Transition("t", ("p",))),
    ],
)
def test_the_kind_of_an_arc_may_be_an_attribute(attributes: str, expected: Transition) -> None:
    assert parse_pnml(pnml(P + T + arc("p", "t", attributes=attributes))).net.transitions == (expected,)


def test_a_self_loop_is_a_permissive_gate_and_noted() -> None:
    imported = parse_pnml(pnml(P + Q + T + arc("p", "t") + arc("t", "p") + arc("t", "q")))
    assert imported.net.transitions == (Transition("t", outputs=("q",), permissive=("p",)),)
    assert messages(imported) == ["1 transition takes a token and puts it back: 't'"]


def test_markings_and_weights_are_read_in_each_spelling() -> None:
    body = (
        '<place id="a"><initialMarking><value>1</value></initialMarking></place>'
        '<place id="b"><initialMarking><text> 0 </text></initialMarking></place>'
        '<place id="c"><initialMarking><value>Default,1</value></initialMarking></place>'
        '<place id="d" initialMarking="1"/>'
        '<place id="e"><initialMarking><text/></initialMarking></place>'
    )
    weights = arc("a", "t", "<inscription><text>1</text></inscription>") + arc(
        "c", "t", "<inscription><value>Default,1</value></inscription>"
    )
    net = parse_pnml(pnml(body + T + weights)).net
    assert [place.marked for place in net.places] == [True, False, True, True, False]
    assert net.transitions[0].inputs == ("a", "c")


def test_a_name_that_differs_from_the_identifier_is_the_description() -> None:
    body = (
        '<place id="p"><name><text>Robot free</text></name></place>'
        '<transition id="t"><name><text>t</text></name></transition>'
    )
    net = parse_pnml(pnml(body)).net
    assert (net.places[0].description, net.transitions[0].description) == ("Robot free", "")


def test_identifiers_that_are_no_names_are_mapped_without_collision() -> None:
    body = '<place id="a b"/><place id="a_b"/><place id="a:b"/><place id="and"/><transition id="a#b"/>'
    imported = parse_pnml(pnml(body))
    assert [place.name for place in imported.net.places] == ["a_b_2", "a_b", "a_b_3", "_and"]
    assert imported.net.transitions[0].name == "a_b_4"
    assert messages(imported) == [
        "4 identifiers are no names here: 'a b' is 'a_b_2', 'a:b' is 'a_b_3', 'and' is '_and', ..."
    ]


def test_one_of_a_kind_is_told_as_one() -> None:
    assert messages(parse_pnml(pnml('<place id="a b"/>'))) == ["1 identifier is no name here: 'a b' is 'a_b'"]
    body = '<page id="1"/><page id="2"><referencePlace id="r" ref="p"/></page>'
    assert messages(parse_pnml(f'<pnml><net id="n" type="ptnet">{P}{body}</net></pnml>')) == [
        "2 pages with 1 reference are joined to one net"
    ]


def test_pages_and_references_are_joined() -> None:
    text = (
        '<pnml><net id="n" type="ptnet"><page id="1">' + P + "</page>"
        '<page id="2"><page id="3"><referencePlace id="r" ref="s"/><referencePlace id="s" ref="p"/>'
        + T
        + arc("r", "t")
        + "</page></page></net></pnml>"
    )
    imported = parse_pnml(text)
    assert imported.net.transitions == (Transition("t", ("p",)),)
    assert messages(imported) == ["3 pages with 2 references are joined to one net"]


def test_what_is_left_out_is_counted_by_its_name() -> None:
    body = (
        '<place id="p"><name><text>p</text><graphics><offset x="1" y="2"/></graphics></name><graphics/>'
        '<toolspecific tool="x" version="1"><place id="trap"/></toolspecific></place>'
        "<transition id='t'><rate><value>1.0</value></rate></transition><labels/>"
        '<place id="q"><capacity><value>3</value></capacity></place>'
    )
    imported = parse_pnml(pnml(body))
    assert [place.name for place in imported.net.places] == ["p", "q"]
    assert messages(imported) == [
        "1 place has a capacity above 1: 'q'",
        "2 <graphics> are left out",
        "1 <labels> is left out",
        "1 <rate> is left out",
        "1 <toolspecific> is left out",
    ]


def test_other_encodings_and_prefixes_are_read() -> None:
    text = (
        '<?xml version="1.0" encoding="ISO-8859-1"?>'
        '<x:pnml xmlns:x="u"><x:net id="n"><x:place id="Förderer"/></x:net></x:pnml>'
    )
    assert parse_pnml(text.encode("latin-1")).net.places == (Place("Förderer"),)


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "windows-1252", "UTF-16", "UTF-8"])
def test_the_line_of_a_mistake_is_shown_in_the_encoding_of_the_file(encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n<pnml><net id="Förderer" type="symmetricnet"/></pnml>'
    with pytest.raises(InputError) as refused:
        parse_pnml(text.encode(encoding))
    (found,) = refused.value.diagnostics
    assert found.span is not None
    assert (found.span.line, found.span.column) == (2, 7)
    assert found.span.excerpt == '<pnml><net id="Förderer" type="symmetricnet"/></pnml>'


def test_the_name_of_the_net_is_its_name_or_identifier_or_file() -> None:
    assert parse_pnml("<pnml><net id='a'><name><text>b</text></name></net></pnml>").net.name == "b"
    assert parse_pnml("<pnml><net id='a'><name><text>b\n  c\u200b</text></name></net></pnml>").net.name == "b c·"
    assert parse_pnml("<pnml><net id='a'/></pnml>").net.name == "a"
    assert parse_pnml("<pnml><net/></pnml>", "dir/c.pnml").net.name == "c"


def test_text_in_memory_is_read_whatever_encoding_it_names() -> None:
    text = '<?xml version="1.0" encoding="ISO-8859-1"?><pnml><net><place id="Förderer"/></net></pnml>'
    assert parse_pnml(text).net.places == (Place("Förderer"),)


def test_many_kinds_of_unknown_elements_are_bounded() -> None:
    imported = parse_pnml(pnml("".join(f"<x{i}/>" for i in range(30))))
    assert len(imported.notes) == 21
    assert imported.notes[-1].message == "elements of 10 other names are left out"


# What is refused

BOMB = '<!DOCTYPE x [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><pnml><net id="n"><place id="&b;"/></net></pnml>'


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "F1002"),
        ("  \n", "F1002"),
        ("not XML", "F1013"),
        ("<pnml><net>", "F1013"),
        ("<html/>", "F1013"),
        ("<pnml/>", "F1013"),
        ("<pnml><u:net/></pnml>", "F1013"),
        (BOMB, "F1013"),
        ('<!DOCTYPE pnml SYSTEM "file:///etc/passwd"><pnml/>', "F1013"),
        ('<?xml version="1.0" encoding="no-such"?><pnml/>', "F1013"),
        ("<pnml><net id='a'/><net id='b'/></pnml>", "F1014"),
        (pnml(P, '<net id="n" type="http://www.pnml.org/version-2009/grammar/symmetricnet">'), "F1014"),
        (pnml('<place id="p"><hlinitialMarking/></place>'), "F1014"),
        (pnml('<place id="p"><type><text>dot</text></type></place>'), "F1014"),
        ("<pnml><net id='n'><declaration><structure/></declaration></net></pnml>", "F1014"),
        (pnml('<transition id="t"><condition/></transition>'), "F1014"),
        (pnml('<transition id="t"><delay><interval/></delay></transition>'), "F1014"),
        (pnml('<place id="p" invariant="&lt;= 5"/>'), "F1014"),
        (pnml(P + T + arc("p", "t", attributes='type="timed" inscription="[2,3]"')), "F1014"),
        (pnml(P + T + arc("p", "t", '<type value="reset"/>')), "F1014"),
        (pnml(P + T + arc("p", "t", attributes='type="transport"')), "F1014"),
        (pnml(P + P), "F2001"),
        (pnml(P + '<transition id="p"/>'), "F2001"),
        (pnml("<place/>"), "F1013"),
        (pnml(P + T + arc("p", "x")), "F2002"),
        (pnml(P + T + '<arc id="a" source="p"/>'), "F2002"),
        (pnml(P + Q + arc("p", "q")), "F2017"),
        (pnml(T + '<transition id="u"/>' + arc("t", "u")), "F2017"),
        (pnml(P + T + arc("t", "p", '<type value="inhibitor"/>')), "F2008"),
        (pnml(P + T + arc("p", "t") + arc("p", "t")), "F2007"),
        (pnml(P + T + arc("t", "p", "<inscription><text>2</text></inscription>")), "F2007"),
        (pnml(P + T + arc("p", "t", '<type value="inhibitor"/><inscription><text>2</text></inscription>')), "F2007"),
        (pnml(P + T + arc("p", "t", "<inscription><text>0</text></inscription>")), "F1013"),
        (pnml(P + T + arc("p", "t", "<inscription><text>x+y</text></inscription>")), "F1013"),
        (pnml('<place id="p"><initialMarking><text>2</text></initialMarking></place>'), "F2006"),
        (pnml('<place id="p"><initialMarking><text>-1</text></initialMarking></place>'), "F1013"),
        (pnml('<place id="p"><initialMarking><value>Default,1,red,1</value></initialMarking></place>'), "F1013"),
        (pnml('<place id="p"><initialMarking><value>red,1</value></initialMarking></place>'), "F1013"),
        (pnml('<referencePlace id="r" ref="s"/><referencePlace id="s" ref="r"/>' + T + arc("r", "t")), "F1013"),
        (pnml('<referencePlace id="r" ref="t"/>' + T), "F1013"),
    ],
)
def test_what_is_not_a_net_here_is_refused(text: str, code: str) -> None:
    assert set(codes(text)) == {code}


@pytest.mark.parametrize("digits", ["9" * 10, "1" * 5000, "Default," + "9" * 12])
def test_a_marking_or_weight_of_too_many_digits_is_told_to_be_too_large(digits: str) -> None:
    marked = f'<place id="p"><initialMarking><text>{digits}</text></initialMarking></place>'
    weighed = P + T + arc("p", "t", f"<inscription><text>{digits}</text></inscription>")
    for body in (marked, weighed):
        with pytest.raises(InputError) as refused:
            parse_pnml(pnml(body))
        (problem,) = refused.value.diagnostics
        assert problem.code == "F1013"
        assert problem.hint == "it is too large: a place holds one token at most here, and arcs have no weights"


def test_a_refusal_points_at_the_element() -> None:
    with pytest.raises(InputError) as refused:
        parse_pnml("<pnml>\n <net id='n'>\n  <place id='p'/>\n  <place id='p'/>\n </net>\n</pnml>", "n.pnml")
    assert str(refused.value).startswith("n.pnml:4:3: error[F2001]: ")


def test_colours_are_reported_once_and_not_arc_by_arc() -> None:
    coloured = '<place id="p"><type/><hlinitialMarking/></place>' + T + arc("p", "t", "<hlinscription/>")
    assert codes(pnml(coloured)) == ["F1014"]


def test_deep_nesting_is_no_recursion() -> None:
    depth = 100_000
    assert parse_pnml("<pnml><net id='n'>" + "<x>" * depth + "</x>" * depth + "</net></pnml>").net == Net("n")


def test_a_file_that_is_too_large_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "big.pnml"
    with path.open("wb") as stream:
        stream.truncate(1 << 30)
    with pytest.raises(InputError) as refused:
        read_pnml(path)
    assert [problem.code for problem in refused.value.diagnostics] == ["F1003"]


# Out and in again


def carried(net: Net) -> Net:
    """What PNML carries of a net."""
    return Net(
        net.name,
        tuple(Place(place.name, marked=place.marked) for place in net.places),
        tuple(replace(t, external=(), number=None, description="") for t in net.transitions),
    )


def undescribed(net: Net) -> Net:
    return replace(
        net,
        places=tuple(replace(place, description="") for place in net.places),
        transitions=tuple(replace(transition, description="") for transition in net.transitions),
    )


@pytest.mark.parametrize("name", [*reference_names(), *catalogue_names()])
def test_a_net_of_the_field_survives_pnml(name: str) -> None:
    net = load_net(name) if name in reference_names() else catalogue_net(name)
    text, _ = write_pnml(net)
    assert undescribed(parse_pnml(text).net) == carried(net)


@given(whole_nets())
@examples(38)
def test_any_net_survives_pnml_up_to_its_names(net: Net) -> None:
    text, notes = write_pnml(net)
    back = parse_pnml(text).net
    places = {new.name: old.name for new, old in zip(back.places, net.places, strict=True)}
    assert [place.marked for place in back.places] == [place.marked for place in net.places]
    for new, old in zip(back.transitions, net.transitions, strict=True):
        ours = (new.inputs, new.outputs, new.permissive, new.inhibitive)
        theirs = (old.inputs, old.outputs, old.permissive, old.inhibitive)
        assert [[places[name] for name in names] for names in ours] == [list(names) for names in theirs]
    if any(re.fullmatch(r"[A-Za-z_][\w.-]*", name, re.ASCII) is None for name in places.values()):
        assert any("no XML identifier" in note.message for note in notes)


def test_a_net_that_pnml_carries_whole_is_written_with_the_contact_note_only() -> None:
    net = Net("n", (Place("p", marked=True),), (Transition("t", ("p",)),))
    text, notes = write_pnml(net)
    assert parse_pnml(text).net == net
    assert [CONTACT in note.message for note in notes] == [True]


def test_all_that_is_lost_is_said() -> None:
    _, notes = write_pnml(catalogue_net("one_robot_mc_late"))
    said = " ".join(note.message for note in notes)
    lost = ("external gates", "signals", "owner", "command", "number", "arbiter", "properties", "description")
    assert [word for word in lost if word not in said] == []


def test_one_that_is_lost_is_one_and_not_several() -> None:
    text = """\
firable: 1
cell: one
controllers:
  robot:
    start: free
    inputs: key
    places: {free: , busy: {send: {machine: R, command: GO}}}
transitions:
  go:   {number: 1, from: robot.free, to: robot.busy, if: robot.key, description: gone}
  stay: {from: robot.busy, to: robot.free}
arbiters:
  only: {among: [go, stay], by: order}
properties:
  back: {always_possible: start}
"""
    told = [note.message for note in write_pnml(parse_net(text))[1]]
    assert {line for line in told if line.startswith("1 ")} == {
        "1 transition loses its external gates",
        "1 signal is left out",
        "1 place loses its command",
        "1 transition loses its number",
        "1 arbiter is left out",
        "1 property is left out",
        "1 description stands in the place of names",
    }
    assert "3 places and signals lose their owner" in told


def test_a_self_loop_is_not_written() -> None:
    with pytest.raises(InputError) as refused:
        write_pnml(Net("n", (Place("p"),), (Transition("t", ("p",), ("p",)),)))
    assert [problem.code for problem in refused.value.diagnostics] == ["F2009"]


# Reading whichever it is


# Public nets, where they are at hand

NETS = os.environ.get("FIRABLE_NETS")


@pytest.mark.skipif(NETS is None, reason="FIRABLE_NETS does not name a folder of public nets with expected.tsv")
def test_every_public_net_has_its_places_transitions_and_self_loops() -> None:
    folder = Path(str(NETS))
    with (folder / "expected.tsv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream, delimiter="\t"))
    assert rows
    wrong = {}
    for row in rows:
        imported = read_pnml(folder / row["file"])
        loops = any(" it back" in note.message for note in imported.notes)
        found = (len(imported.net.places), len(imported.net.transitions), loops)
        if found != (int(row["places"]), int(row["transitions"]), row["self_loops"] == "yes"):
            wrong[row["file"]] = found
    assert wrong == {}
