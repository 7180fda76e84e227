"""What is never there together in a net, and what that excludes while a machine is at a command."""

from __future__ import annotations

import random

import pytest
from support.examples import seeds
from support.lively_nets import lively_net

from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines import excluding
from firable.nets.machines.closing import close
from firable.nets.machines.excluding import Excluding, with_one_token
from firable.nets.machines.laws import Laws
from firable.nets.machines.plant_file import parse_plant
from firable.nets.text import parse_net
from firable.semantics.player import Player

TEXT = """firable: 1
cell: press
controllers:
  press:
    start: ready
    inputs: [door, part]
    places:
      ready:
      working: {send: {machine: P, command: WORK}, until: worked}
      done:
  lamp:
    start: dark
    inputs: door
    places: {dark: , lit: }
transitions:
  start: {from: press.ready, to: press.working, if: press.part}
  end:   {from: press.working, to: press.done, OTHER}
  again: {from: press.done, to: press.ready, unless: press.door}
  glow:  {from: lamp.dark, to: lamp.lit, if: lamp.door}
"""
PLANT = """firable_plant: 1
plant: press
stations: [die]
arrivals:   {station: die, every_s: 5}
departures: {station: die, raw: true}
machines:
  P: {commands: {WORK: {does: work, takes_s: 1}}}
  Q: {commands: {WORK: {does: work, takes_s: 1}}}
sensors:
  press.door: {set_by: operator}
  lamp.door:  {set_by: operator}
  press.part: {occupied: die}
"""


def excluding_of(text: str = TEXT, other: str = "unless: press.door") -> Excluding:
    return Excluding(Laws(parse_plant(PLANT), parse_net(text.replace("OTHER", other))))


def excluded(found: Excluding, signal: str, *, value: bool) -> bool:
    return found.excludes(found.laws.net.place("press.working"), signal, value=value)


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(40))
def test_places_with_one_token_have_one_in_every_reachable_marking(seed: int) -> None:
    net = lively_net(random.Random(seed))
    markings = Player(net).reachable()
    names = [place.name for place in net.places]
    for one in names:
        for other in names:
            found = with_one_token(net, one, other) if one != other else None
            assert found is None or {one, other} <= found
            assert found is None or {(m & net.marking(found)).bit_count() for m in markings} == {1}


def test_each_controller_of_the_catalogue_that_has_one_token_is_found_to_have_it() -> None:
    net = catalogue_net("one_robot")
    robot = [place.name for place in net.places if place.owner == "robot"]
    assert all(with_one_token(net, one, other) for one in robot for other in robot)
    assert with_one_token(net, "robot.free", "mc.free") is None, "both are there at first"
    assert with_one_token(net, "robot.to_cv1", "mc.free") is not None, "the machine is reserved before"


def test_places_that_no_token_reaches_have_none_and_not_one() -> None:
    ring = "firable: 1\ncell: ring\nplaces: {a: , b: }\ntransitions: {go: {from: a, to: b}, back: {from: b, to: a}}\n"
    assert with_one_token(parse_net(ring), "a", "b") is None
    assert with_one_token(parse_net(f"{ring}start: a\n"), "a", "b") == frozenset("ab")


def test_a_search_that_is_too_long_finds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    net = catalogue_net("one_robot")
    monkeypatch.setattr(excluding, "STEPS_MAX", 2)
    assert with_one_token(net, "robot.free", "robot.to_cv1") is None


def test_who_needs_another_token_of_the_same_controller_is_excluded() -> None:
    found = excluding_of()
    assert excluded(found, "press.part", value=True), "start needs press.ready"
    assert excluded(found, "press.door", value=False), "end waits for the completion, again needs press.done"
    assert not excluded(found, "lamp.door", value=True), "the lamp may be dark"
    assert excluded(found, "press.worked", value=True)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("until: worked}", "until: worked, within: 5s}"),
        ("until: worked}\n", "until: worked}\n      other: {send: {machine: Q, command: WORK}, until: worked}\n"),
    ],
    ids=["the token may go when the time is over", "another machine sets the completion"],
)
def test_nobody_is_excluded_where_the_token_may_go_before_the_completion_is_told(old: str, new: str) -> None:
    found = excluding_of(TEXT.replace(old, new))
    assert not found.announced
    assert not excluded(found, "press.part", value=True)


@pytest.mark.parametrize("puts", ["press.done", "press.working"])
def test_a_part_is_excluded_by_what_its_own_controller_lacks_as_it_may_vote_before_the_others(puts: str) -> None:
    both = TEXT.replace("glow:  {from: lamp.dark", "glow:  {from: [lamp.dark, press.ready]")
    assert not excluded(excluding_of(both.replace("to: lamp.lit", f"to: [lamp.lit, {puts}]")), "lamp.door", value=True)


def test_who_reads_the_place_and_waits_for_no_completion_is_not_excluded() -> None:
    reading = TEXT.replace("again: {from: press.done", "again: {if: press.working, from: press.done")
    one = reading.replace("from: press.done, to: press.ready", "to: press.ready")
    found = excluding_of(
        one.replace("start: ready", "start: [ready, spare]").replace("      done:", "      done:\n      spare:")
    )
    assert not excluded(found, "press.door", value=False)


@pytest.mark.parametrize(
    ("arcs", "expected"),
    [
        ("if: press.working, from: press.spare, to: press.seen, unless: press.door", False),
        ("if: [press.working, press.worked], from: press.spare, to: press.seen, unless: press.door", True),
        ("from: press.spare, to: press.seen, unless: [press.working, press.door]", True),
        ("from: press.spare, to: press.working, unless: press.door", True),
        ("from: press.spare, to: press.seen, unless: press.door", False),
        ("if: press.ready, from: press.spare, to: press.seen, unless: press.door", True),
        ("if: press.door, from: press.spare, to: press.seen", True),
    ],
)
def test_who_goes_by_a_signal_beside_a_command_is_excluded_by_what_it_wants_of_the_place(
    arcs: str, expected: bool
) -> None:
    text = TEXT.replace("start: ready", "start: [ready, spare]").replace(
        "done:\n", "done:\n      spare:\n      seen:\n"
    )
    text = text.replace("again: {from: press.done, to: press.ready, unless: press.door}", f"again: {{{arcs}}}")
    found = excluding_of(f"{text}  back: {{from: press.done, to: press.ready}}\n", "if: press.part")
    assert excluded(found, "press.door", value=False) == expected


def test_every_command_of_the_untimed_cell_of_the_catalogue_is_announced_and_nothing_told_late() -> None:
    laws = Laws(catalogue_plant("one_robot"), net := catalogue_net("one_robot"))
    assert Excluding(laws).announced == {p.name for p in net.places if p.completion is not None}
    assert close(net, catalogue_plant("one_robot")).news == {}
