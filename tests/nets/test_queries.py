"""Files of queries: one a line, and the property XML of the model checking contest."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firable.analysis.check import check
from firable.nets.diagnostics import InputError
from firable.nets.formula import FormulaError
from firable.nets.net import Net, Place, Transition
from firable.nets.pnml import parse_pnml
from firable.nets.property_xml import parse_property_xml
from firable.nets.queries import Query, QueryKind, format_query, parse_queries, parse_query, query_named, read_queries
from firable.nets.source import Source

NET = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)), Transition("u")))


def xml(formula: str, name: str = "x") -> str:
    return f"<property><id>{name}</id><description/><formula>{formula}</formula></property>"


def of_xml(*properties: str) -> tuple[Query, ...]:
    text = f'<?xml version="1.0"?>\n<property-set xmlns="http://mcc.lip6.fr/">{"".join(properties)}</property-set>'
    return parse_property_xml(text.encode(), NET, {}, "q.xml")


def codes(text: str) -> list[tuple[str, int, int]]:
    with pytest.raises(InputError) as refused:
        parse_queries(text, NET, "q.txt") if "<" not in text else parse_property_xml(text.encode(), NET, {}, "q.xml")
    for problem in refused.value.diagnostics:
        assert problem.hint
    return [(d.code, d.span.line, d.span.column) for d in refused.value.diagnostics if d.span]


def test_a_file_is_one_query_a_line() -> None:
    text = "# tokens\n\nback: AG EF start\nonce:ltl G (p -> F q)\n one : one_safe\nmost: bound tokens(p, q)\nl: live\n"
    back, once, one, most, live = parse_queries(text, NET)
    assert (back.name, back.kind, format_query(back)) == ("back", QueryKind.CTL, "ctl AG EF start")
    assert (once.kind, format_query(once)) == (QueryKind.LTL, "ltl G (not p or F q)")
    assert one == Query("one", QueryKind.ONE_SAFE)
    assert most == Query("most", QueryKind.BOUND, places=("p", "q"))
    assert live.kind is QueryKind.LIVE


@pytest.mark.parametrize(
    "text", ["ctl EF p", "ltl F p", "ctl p", "bound tokens(p, q)", "live", "quasi_live", "stable_marking", "one_safe"]
)
def test_a_query_is_read_back_as_printed(text: str) -> None:
    assert format_query(parse_query(text)) == text


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("ltl EF p", 4),
        ("ctl F p", 4),
        ("live p", 5),
        ("bound p", 6),
        ("bound tokens(p) + 1", 6),
        ("bound tokens(p", 6),
        ("bound tokens(p) <= 1", 6),
        ("ltl F (p", 8),
    ],
)
def test_what_is_no_query_is_refused_at_its_column(text: str, column: int) -> None:
    with pytest.raises(FormulaError) as caught:
        parse_query(text)
    assert caught.value.column == column


def test_the_problems_of_a_file_are_reported_together_with_their_positions() -> None:
    text = "a: EF p and\nno colon\na: EF p2\nb: F fires(v)\n: p\nc[: p\n"
    assert codes(text) == [
        ("F1012", 1, 12),
        ("F1018", 2, 1),
        ("F2001", 3, 1),
        ("F2002", 3, 7),
        ("F2004", 4, 12),
        ("F1018", 5, 1),
        ("F1018", 6, 1),
    ]


def test_a_file_without_queries_is_refused() -> None:
    assert codes("# nothing\n") == [("F1002", 1, 1)]


def test_a_single_query_is_checked_like_a_file() -> None:
    assert query_named("AG EF p", NET).kind is QueryKind.CTL
    for text, code, column in (
        ("AG EF", "F1012", 6),
        ("EF r", "F2002", 4),
        (" EF (p and r)", "F2002", 12),
        ("bound tokens(p, r)", "F2002", 17),
        ("EF firable(r)", "F2004", 12),
    ):
        with pytest.raises(InputError, match=code) as caught:
            query_named(text, NET)
        span = caught.value.diagnostics[0].span
        assert span is not None
        assert (span.line, span.column) == (1, column)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("AG EF strat", "did you mean 'start'? a query names the places of the net"),
        ("EF daedlock", "did you mean 'deadlock'? a query names the places of the net"),
        ("liv", "did you mean 'live'? a query names the places of the net"),
        ("EF liv", "a query names the places of the net"),
        ('EF "start"', "a query names the places of the net"),
        ("EF start;", "a query has no semicolon: write `start`"),
        ("EF p;", "a query has no semicolon: write `p`"),
        ("live;", "a query has no semicolon: write `live`"),
        ("EF (p);", "a query has no semicolon: leave it out"),
        ("EF p and", "`firable explain F1012` shows how queries are written"),
    ],
)
def test_the_hint_on_what_is_no_query_knows_the_words_of_queries(text: str, hint: str) -> None:
    for read in (lambda: query_named(text, NET), lambda: parse_queries(f"a: {text}\n", NET)):
        with pytest.raises(InputError) as refused:
            read()
        (problem,) = refused.value.diagnostics
        assert problem.hint == hint


@pytest.mark.parametrize(
    ("text", "code", "line", "column"),
    [
        ("AG (p\n  and q\n  or)", "F1012", 3, 5),
        ("\n\n AG EF", "F1012", 3, 7),
        ("AG (p\r\n  and r)", "F2002", 2, 7),
        ("bound\n  tokens(p,\n  r)", "F2002", 3, 3),
        ("ctl\tAG (p\nand firable(r))", "F2004", 2, 13),
    ],
)
def test_a_query_of_several_lines_is_refused_at_its_line_and_column(
    text: str, code: str, line: int, column: int
) -> None:
    with pytest.raises(InputError, match=code) as caught:
        query_named(text, NET)
    span = caught.value.diagnostics[0].span
    assert span is not None
    assert (span.line, span.column, span.excerpt) == (line, column, Source("", text).span(line, 1).excerpt)


def test_the_word_before_a_query_ends_at_any_blank() -> None:
    assert parse_query("bound\ntokens(p)") == parse_query("bound\ttokens(p)") == parse_query("bound tokens(p)")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("F fires(p)", "'p' is a place, and no transition"),
        ("F fires(q)", "name a transition, such as 't', which puts a token on it"),
        ("EF t", "'t' is a transition, and no place"),
        ("EF \x1bc", "there is no place '·c'"),
    ],
)
def test_a_name_of_the_other_kind_is_told_as_what_it_is(text: str, told: str) -> None:
    with pytest.raises(InputError) as caught:
        query_named(text, NET)
    assert told in str(caught.value)


def test_a_file_without_a_query_is_refused() -> None:
    assert codes("# to be written\n") == codes("<property-set></property-set>") == [("F1002", 1, 1)]


def test_files_are_told_apart_by_their_first_character(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfa: EF p\n")
    (tmp_path / "b").write_text(f"\n<property-set>{xml('<deadlock/>')}</property-set>", "utf-8")
    (tmp_path / "c").write_bytes(b"a: \xff")
    assert read_queries(tmp_path / "a", NET)[0].name == "a"
    assert read_queries(tmp_path / "b", NET)[0].name == "x"
    with pytest.raises(InputError, match="F1004"):
        read_queries(tmp_path / "c", NET)
    with pytest.raises(InputError, match="F1001"):
        read_queries(tmp_path / "d", NET)


P, Q, T = "<place>p</place>", "<place>q</place>", "<is-fireable><transition>t</transition></is-fireable>"
F = "firable(t)"
EF, END = "<exists-path><finally>", "</finally></exists-path>"
AG = "<all-paths><globally>{}</globally></all-paths>"
ONE = "<integer-constant>1</integer-constant>"
COUNT = f"<tokens-count>{P}{Q}</tokens-count>"


@pytest.mark.parametrize(
    ("formula", "text"),
    [
        (f"{EF}{T}{END}", "ctl EF firable(t)"),
        (f"{EF}<deadlock/>{END}", "ctl EF deadlock"),
        (AG.format(f"<integer-le>{COUNT}{ONE}</integer-le>"), "ctl AG tokens(p, q) <= 1"),
        (f"<all-paths><until><before>{T}</before><reach>{T}</reach></until></all-paths>", f"ctl A[{F} U {F}]"),
        (f"<all-paths><globally><finally>{T}</finally></globally></all-paths>", "ltl G F firable(t)"),
        (f"<all-paths><next><next>{T}</next></next></all-paths>", "ltl X X firable(t)"),
        (f"{T[:-14]}<transition>u</transition></is-fireable>", "ctl firable(t) or firable(u)"),
        (f"<negation><conjunction>{T}<false/></conjunction></negation>", "ctl not (firable(t) and false)"),
        (f"<disjunction>{T}{T}{T}</disjunction>", "ctl firable(t) or firable(t) or firable(t)"),
        (f"<implication>{T}<false/></implication>", "ctl not firable(t) or false"),
        (f"<equivalence>{T}<true/></equivalence>", "ctl (firable(t) and true) or (not firable(t) and not true)"),
        (f"<invariant>{T}</invariant>", "ctl AG firable(t)"),
        (f"<impossibility>{T}</impossibility>", "ctl AG not firable(t)"),
        (f"<possibility>{T}</possibility>", "ctl EF firable(t)"),
        (f"<integer-gt><integer-sum>{COUNT}{ONE}</integer-sum>{ONE}</integer-gt>", "ctl tokens(p, q) + 1 > 1"),
        (f"<place-bound>{P}{Q}</place-bound>", "bound tokens(p, q)"),
        ("<liveness/>", "live"),
        ("<quasi-liveness/>", "quasi_live"),
        ("<stable-marking/>", "stable_marking"),
        (f"<k-safe>{ONE}</k-safe>", "one_safe"),
    ],
)  # fmt: skip
def test_the_elements_of_the_property_xml_are_read(formula: str, text: str) -> None:
    assert format_query(of_xml(xml(formula))[0]) == text


NEXT = f"<all-paths><next>{T}</next></all-paths>"
STATE = f"<all-paths><finally>{T}</finally></all-paths>"
ONLY_LTL = f"<all-paths><globally><finally>{T}</finally></globally></all-paths>"
ONLY_CTL = f"<all-paths><globally>{EF}{T}{END}</globally></all-paths>"


@pytest.mark.parametrize(
    ("name", "file", "others", "text"),
    [
        ("x", "q.xml", [], f"ctl AX {F}"),
        ("x", "q.xml", [STATE], f"ctl AX {F}"),
        ("x", "q.xml", [STATE, ONLY_LTL], f"ltl X {F}"),
        ("x", "q.xml", [ONLY_CTL, ONLY_LTL], f"ctl AX {F}"),
        ("x", "LTLFireability.xml", [ONLY_CTL], f"ltl X {F}"),
        ("x", "CTLFireability.xml", [ONLY_LTL], f"ctl AX {F}"),
        ("N-PT-1-LTLCardinality-00", "CTLFireability.xml", [ONLY_CTL], f"ltl X {F}"),
        ("N-PT-1-CTLFireability-2024-15", "LTLFireability.xml", [ONLY_LTL], f"ctl AX {F}"),
    ],
)
def test_next_is_of_the_logic_of_its_file(name: str, file: str, others: list[str], text: str) -> None:
    properties = [xml(formula, f"y{i}") for i, formula in enumerate(others)]
    data = f"<property-set>{''.join(properties)}{xml(NEXT, name)}</property-set>".encode()
    *rest, query = parse_property_xml(data, NET, {}, f"some/LTLCardinality/{file}")
    assert format_query(query) == text
    assert all(format_query(other) == f"ctl AF {F}" for other, of in zip(rest, others, strict=True) if of == STATE)


def test_next_of_a_deadlock_is_what_the_logic_of_the_file_says() -> None:
    stuck = Net("stuck", (Place("p"),), (Transition("t", ("p",)),))
    for name, holds in (("N-LTLFireability-0", False), ("N-CTLFireability-0", True)):
        data = f"<property-set>{xml(NEXT, name)}</property-set>".encode()
        queries = parse_property_xml(data, stuck, {})
        assert check(stuck, queries=queries).verdict(f"query.{name}").holds is holds


def test_an_exclusive_disjunction_is_one() -> None:
    formula = f"<exclusive-disjunction>{T}<true/></exclusive-disjunction>"
    text = "ctl (firable(t) and not true) or (not firable(t) and not not true)"
    assert format_query(of_xml(xml(formula))[0]) == text


@pytest.mark.parametrize(
    ("formula", "code"),
    [
        ("<unknown/>", "F1018"),
        ("<negation/>", "F1018"),
        (f"<negation>{T}{T}</negation>", "F1018"),
        ("<conjunction/>", "F1018"),
        (f"<exists-path><until>{T}{T}</until></exists-path>", "F1018"),
        ("<is-fireable/>", "F1018"),
        (f"<is-fireable>{P}</is-fireable>", "F1018"),
        (f"<integer-le>{COUNT}</integer-le>", "F1018"),
        (f"<integer-le>{COUNT}<integer-constant>-1</integer-constant></integer-le>", "F1018"),
        (f"<integer-le>{COUNT}<tokens-count/></integer-le>", "F1018"),
        ("<k-safe><integer-constant>2</integer-constant></k-safe>", "F1018"),
        ("<is-fireable><transition>v</transition></is-fireable>", "F2004"),
        ("<place-bound><place>r</place></place-bound>", "F2002"),
        (f"<exists-path><globally><finally>{T}</finally></globally></exists-path>", "F1012"),
        (f"<all-paths><finally><exists-path>{T}</exists-path></finally></all-paths>", "F1012"),
        (f"<all-paths>{'<next>' * 300}{T}{'</next>' * 300}</all-paths>", "F1018"),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_refused(formula: str, code: str) -> None:
    with pytest.raises(InputError, match=code):
        of_xml(xml(formula))


@pytest.mark.parametrize(
    ("text", "codes_found"),
    [
        ("<property-set><property>", ["F1018"]),
        ("<pnml/>", ["F1018"]),
        ("<property-set><formula/></property-set>", ["F1018"]),
        ("<property-set><property><id>x</id></property></property-set>", ["F1018"]),
        (f"<property-set>{xml('<true/>', 'x  shown')}</property-set>", ["F1018"]),
        (f"<property-set>{xml('<true/>')}\n{xml('<true/>')}</property-set>", ["F2001"]),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><property-set/>", ["F1018"]),
        ('<?xml version="1.0" encoding="nonsense"?><property-set/>', ["F1018"]),
        (f"<property-set>{xml('<a/>')}{xml('<b/>', 'y')}</property-set>", ["F1018", "F1018"]),
    ],
)
def test_a_file_that_is_no_property_xml_is_refused_with_all_its_problems(text: str, codes_found: list[str]) -> None:
    assert [code for code, _, _ in codes(text)] == codes_found


def test_identifiers_that_the_import_changed_are_found() -> None:
    head = '<pnml><net id="n" type="http://www.pnml.org/version-2009/grammar/ptnet"><page id="g">'
    imported = parse_pnml(f'{head}<place id="a b"/><place id="a_b"/><transition id="t"/></page></net></pnml>')
    assert imported.renamed == {"a b": "a_b_2"}
    bound = "<place-bound><place>a b</place><place>a_b</place></place-bound>"
    text = f"<property-set>{xml(bound)}</property-set>"
    assert parse_property_xml(text.encode(), imported.net, imported.renamed)[0].places == ("a_b_2", "a_b")


@given(st.text(max_size=40))
def test_any_line_is_a_query_or_refused(text: str) -> None:
    try:
        queries = parse_queries(f"a: {text}", NET)
    except InputError:
        return
    for query in queries:
        assert parse_query(format_query(query), query.name) == query
