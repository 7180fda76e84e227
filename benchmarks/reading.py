"""Reading and printing large nets, as ratios to the bare parser in the same run.

The yardsticks are expat and libyaml with handlers that do nothing: whoever reads the file pays that much. A ratio that
stays the same while the net grows tenfold says that reading is linear.
"""

from __future__ import annotations

from typing import Final
from xml.parsers import expat

import yaml
from measuring import Table, spread, timed

from firable.nets.net import Net, Place, Transition
from firable.nets.pnml import parse_pnml, write_pnml
from firable.nets.printing import format_net
from firable.nets.text import parse_net

SIZES: Final = ((1_000, 10_000), (10_000, 100_000))


def wide(n_places: int, n_transitions: int) -> Net:
    """A net in which each place has as many consumers as the sizes say, each to another place."""
    transitions = (
        Transition(f"t{t}", (f"p{t % n_places}",), (f"p{(t % n_places + 1 + t // n_places) % n_places}",))
        for t in range(n_transitions)
    )
    return Net("wide", tuple(Place(f"p{i}", marked=i == 0) for i in range(n_places)), tuple(transitions))


def bare_xml(text: str) -> None:
    """Parse XML and do nothing with it."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler = lambda _name, _attributes: None
    parser.EndElementHandler = lambda _name: None
    parser.CharacterDataHandler = lambda _text: None
    parser.Parse(text, True)  # noqa: FBT003 - expat takes no keywords


def bare_yaml(text: str) -> None:
    """Parse YAML and do nothing with it."""
    for _ in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        pass


def tables(repeat: int) -> list[Table]:
    """One row for each format and size."""
    rows = []
    for n_places, n_transitions in SIZES:
        net = wide(n_places, n_transitions)
        texts = {"PNML": write_pnml(net)[0], "net file": format_net(net)}
        work = {
            "read PNML": (lambda texts=texts: parse_pnml(texts["PNML"]), lambda texts=texts: bare_xml(texts["PNML"])),
            "read net file": (
                lambda texts=texts: parse_net(texts["net file"]),
                lambda texts=texts: bare_yaml(texts["net file"]),
            ),
            "print net file": (lambda net=net: format_net(net), lambda texts=texts: bare_yaml(texts["net file"])),
        }
        for what, (ours, bare) in work.items():
            pairs = [(timed(ours)[1], timed(bare)[1]) for _ in range(repeat)]
            seconds, yardstick = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
            rows.append(
                (
                    what, f"{n_places:,} / {n_transitions:,}", spread(seconds, scale=1),
                    f"{min(seconds) / min(yardstick):.1f}",
                )
            )  # fmt: skip
    return [
        Table(
            "Reading and printing",
            "Seconds (smallest / median / largest of the runs), and as a multiple of the bare parser on the same text. "
            "Printing reads the text back to see that it says the same.",
            ("what", "places / transitions", "seconds", "x bare parser"),
            tuple(rows),
        )
    ]
