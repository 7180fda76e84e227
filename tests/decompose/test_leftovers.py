"""What the prover would not make is refused when a bundle is read or checked, also where no verdict becomes wrong."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest

from firable.analysis.check import check
from firable.analysis.evidence.document import Record, document_from_text
from firable.decompose.bundling import make_bundle
from firable.decompose.splitting import cut
from firable.decompose.splitting.cut import split
from firable.decompose.verification import documents
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.knowledge import knowledge
from firable.nets.net import Arbiter, ExternalGate, Net, Signal, SignalKind
from firable.nets.text import parse_net
from firable.nets.verdict import Expectation, Status

FILE = "check.evidence.json"
NET = parse_net(
    """
firable: 1
cell: pair
controllers:
  sys: {coordinator: true}
  a: {start: p, places: {p: , q: }}
  b: {start: x, places: {x: , y: }}
transitions:
  G: {from: [a.p, b.x], to: [a.q, b.y]}
  H: {from: [a.q, b.y], to: [a.p, b.x]}
"""
)


@cache
def bundled() -> Bundle:
    return make_bundle(check(catalogue_net("conceptual_one_robot")))


def test_a_record_at_the_end_of_a_document_that_claims_nothing_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "_ask_again", lambda *_: None)
    document = document_from_text(bundled().evidence[FILE], FILE)
    more = replace(document, records=(*document.records, Record("", True, (), "whatever one likes to say")))
    with pytest.raises(InputError, match="has a record that claims nothing"):
        check_bundle(replace(bundled(), evidence={**bundled().evidence, FILE: more.to_text()}))


def with_expectation(net: Net) -> Net:
    return replace(net, expected=(Expectation("whatever one likes to say", Status.PROVED),))


def with_negative_numbers(net: Net) -> Net:
    return replace(net, transitions=tuple(replace(t, number=i - 5) for i, t in enumerate(net.transitions)))


def with_arbiter(net: Net) -> Net:
    return replace(net, arbiters=(Arbiter("idle", ("G", "H")),))


def with_completion_of_nothing(net: Net) -> Net:
    gate, (g, h) = ExternalGate("a.s"), net.transitions
    signals = (*net.signals, Signal("a.s", "a", SignalKind.COMPLETION))
    return replace(net, signals=signals, transitions=(replace(g, external=(gate,)), h))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (with_negative_numbers, "a row has a negative number"),
        (with_arbiter, "'idle' decides of 'G', which is in no conflict"),
        (with_completion_of_nothing, "'a.s' is the completion of no command"),
    ],
)
def test_a_net_that_the_prover_does_not_split_is_not_cut_anew(
    change: Callable[[Net], Net], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_cut(split(NET))
    monkeypatch.setattr(cut, "_problems", lambda _: iter(()))
    net = change(NET)
    decomposition = replace(split(replace(net, arbiters=())), net=net)
    with pytest.raises(NotShownError, match=words):
        check_cut(decomposition)


def test_words_in_a_subnet_that_no_split_writes_are_refused() -> None:
    whole = split(NET)
    first, *others = whole.subnets
    with pytest.raises(NotShownError, match="expected differ"):
        check_cut(replace(whole, subnets=(with_expectation(first), *others)))


def test_of_a_part_that_waits_for_a_completion_that_nobody_sets_nothing_is_claimed() -> None:
    undisturbing = {one.controller: one.undisturbing for one in knowledge(split(with_completion_of_nothing(NET)))}
    part = {part.controller: part.name for part in split(NET).table[0].parts}["a"]
    assert part in {one.controller: one.undisturbing for one in knowledge(split(NET))}["a"]
    assert part not in undisturbing["a"]
