"""A net survives JSON, and its digest covers all that has a meaning."""

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from support.examples import examples
from support.reference import load_net, reference_names
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.interchange import canonical_json, net_digest, net_from_json, net_to_json
from firable.nets.net import Net, Place


@given(whole_nets())
@examples(38)
def test_any_net_survives_json(net: Net) -> None:
    back = net_from_json(json.loads(canonical_json(net_to_json(net))))
    assert back == net
    assert back.description == net.description
    assert net_digest(back) == net_digest(net)


@pytest.mark.parametrize("name", reference_names())
def test_a_reference_net_survives_json(name: str) -> None:
    assert net_from_json(net_to_json(load_net(name))) == load_net(name)


def test_the_digests_of_the_catalogue_differ() -> None:
    assert len({net_digest(catalogue_net(name)) for name in catalogue_names()}) == len(catalogue_names())


def test_a_description_does_not_count_in_the_digest() -> None:
    net = catalogue_net("one_robot")
    silent = replace(
        net,
        description="",
        places=tuple(replace(place, description="") for place in net.places),
        transitions=tuple(replace(transition, description="") for transition in net.transitions),
        controllers=tuple(replace(controller, description="") for controller in net.controllers),
    )
    assert silent != net
    assert net_digest(silent) == net_digest(net)


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    if isinstance(value, dict):
        return [leaf for key, item in value.items() for leaf in leaves(item, (*path, key))]
    if isinstance(value, list) and value:
        return [leaf for i, item in enumerate(value) for leaf in leaves(item, (*path, i))]
    return [path]


def changed(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    copy = data.copy()
    copy[path[0]] = changed(data[path[0]], path[1:], value)
    return copy


DATA = net_to_json(catalogue_net("one_robot_mc_late"))


def test_every_value_but_descriptions_counts_in_the_digest() -> None:
    """Each leaf of the JSON is replaced; where a net still results, its digest differs unless it is a description."""
    original = net_digest(net_from_json(DATA))
    accepted = 0
    for path in leaves(DATA):
        old: Any = DATA
        for step in path:
            old = old[step]
        new = (not old) if isinstance(old, bool) else old + 100 if isinstance(old, int) else "other"
        try:
            digest = net_digest(net_from_json(changed(DATA, path, new)))
        except InputError:
            continue
        accepted += 1
        assert (digest == original) == (path[-1] == "description"), path
    assert accepted > 100


@pytest.mark.parametrize("path", [path for path in leaves(DATA) if isinstance(path[-1], str)][::7])
def test_a_missing_or_unknown_key_is_refused(path: tuple[Any, ...]) -> None:
    parent: Any = DATA
    for step in path[:-1]:
        parent = parent[step]
    without = {key: value for key, value in parent.items() if key != path[-1]}
    for wrong in (without, {**parent, "extra": 1}):
        with pytest.raises(InputError) as refused:
            net_from_json(changed(DATA, path[:-1], wrong))
        assert {problem.code for problem in refused.value.diagnostics} == {"F1015"}


TEMPORAL = {"name": "x", "kind": "ctl", "formula": "EF start", "then": None, "fairness": "none"}


@pytest.mark.parametrize(
    ("path", "value", "code"),
    [
        (("format",), "firable-net/4", "F1015"),
        (("places", 0, "marked"), 1, "F1015"),
        (("transitions", 0, "number"), True, "F1015"),
        (("properties", 0, "formula"), "a and", "F1012"),
        (("properties", 0, "kind"), "leads_to", "F1015"),
        (("properties", 0, "kind"), "ctl", "F1015"),
        (("properties", 0), {**TEMPORAL, "formula": "AG"}, "F1012"),
        (("properties", 0), {**TEMPORAL, "kind": "ltl"}, "F1012"),
        (("properties", 0), {**TEMPORAL, "formula": "EF nowhere"}, "F2002"),
        (("properties", 0, "kind"), "sometimes", "F1015"),
        (("transitions", 0, "inputs"), ["nowhere"], "F2002"),
        (("transitions", 1, "external"), [], "F1015"),
        (("transitions", 0, "permissive"), ["robot.touch"], "F1015"),
    ],
)
def test_what_is_no_net_is_refused(path: tuple[Any, ...], value: Any, code: str) -> None:
    with pytest.raises(InputError) as refused:
        net_from_json(changed(DATA, path, value))
    assert code in {problem.code for problem in refused.value.diagnostics}
    assert all(problem.hint for problem in refused.value.diagnostics)


def test_equal_nets_have_equal_text() -> None:
    one, other = Net("n", (Place("p"),)), Net("n", (Place("p"),))
    assert canonical_json(net_to_json(one)) == canonical_json(net_to_json(other))
