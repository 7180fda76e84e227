"""A damaged file is read or refused with spans, and never ends in a traceback."""

from collections.abc import Callable

from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.net import Net
from firable.nets.pnml import parse_pnml, write_pnml
from firable.nets.printing import format_net
from firable.nets.text import parse_net

TEXT = catalogue_path("one_robot_mc_late").read_text("utf-8")
PNML = write_pnml(catalogue_net("one_robot_mc_late"))[0]
SHORT = """firable: 1
cell: c
controllers: {r: {start: p, inputs: x, places: {p: {send: {machine: M, command: C, to: A}, until: d}, q: }}}
transitions: {t: {number: 1, from: r.p, to: [r.q], if: r.x, unless: r.q}, u: {from: r.q, to: r.p}}
arbiters: {a: {among: [t, u], by: order}}
properties: {p: {never: r.p and not r.q}, l: {leads_to: [r.p, firable(t)]}}
"""
SPLINTERS = st.one_of(
    st.sampled_from(
        [
            ":",
            ": ",
            "\n",
            "  ",
            "{",
            "}",
            "[",
            "]",
            ",",
            "-",
            "- ",
            "&",
            "*",
            "!",
            "|",
            ">",
            "'",
            '"',
            "#",
            "%",
            "@",
            "<",
            "/>",
        ]
    ),
    st.sampled_from(
        ["on", "true", "~", "places:", "t", "r.p", "0", "and", "(", "\t", "\0", "\r", "\x85", "é", "\ud800"]
    ),
    st.text(max_size=3),
)


@st.composite
def damaged(draw: st.DrawFn, text: str) -> str:
    """The text with a few pieces cut, doubled, moved or replaced."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        piece = draw(st.one_of(SPLINTERS, st.just(text[start:end] * 2)))
        text = text[:start] + piece + text[end:]
    return text


@st.composite
def shuffled_lines(draw: st.DrawFn, text: str) -> str:
    """The text with a few lines cut, doubled, indented or exchanged."""
    lines = text.splitlines()
    for _ in range(draw(st.integers(1, 4))):
        i, j = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        match draw(st.sampled_from(["cut", "double", "indent", "outdent", "exchange"])):
            case "cut" if len(lines) > 2:
                del lines[i]
            case "double":
                lines.insert(j, lines[i])
            case "indent":
                lines[i] = "  " + lines[i]
            case "outdent":
                lines[i] = lines[i].removeprefix("  ")
            case _:
                lines[i], lines[j] = lines[j], lines[i]
    return "\n".join(lines)


def well_told(refusal: InputError, text: str) -> None:
    assert 0 < len(refusal.diagnostics) <= 20
    for problem in refusal.diagnostics:
        assert problem.span is not None
        assert problem.hint
        assert problem.span.line <= text.count("\n") + text.count("\r") + 1
        assert all(len(line) < 2000 for line in str(problem).splitlines())


def read_or_refused(read: Callable[[str], Net], text: str) -> None:
    try:
        net = read(text)
    except InputError as error:
        well_told(error, text)
    else:
        assert parse_net(format_net(net)).places == net.places


@given(st.one_of(damaged(SHORT), damaged(TEXT), shuffled_lines(TEXT)))
@examples(200)
def test_a_damaged_net_file_is_read_or_refused(text: str) -> None:
    read_or_refused(parse_net, text)


@given(st.one_of(damaged(PNML), shuffled_lines(PNML)))
@examples(100)
def test_damaged_pnml_is_read_or_refused(text: str) -> None:
    read_or_refused(lambda data: parse_pnml(data).net, text)


@given(st.text(max_size=200))
@examples(100)
def test_noise_is_refused(text: str) -> None:
    read_or_refused(parse_net, f"firable: 1\ncell: c\n{text}")
