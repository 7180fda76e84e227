"""The reader of the reference data: every net loads, every malformed one is refused with its own code."""

import pytest
from support.reference import cases, load_net, local, reference_names

from firable.nets.diagnostics import InputError
from firable.nets.net import Net

REFUSED = {
    "two tokens in M0": "F2006",
    "double arc (weight 2)": "F2007",
    "arc to an unknown place": "F2002",
    "gate sourced in a transition": "F2008",
    "gate both internal and external": "F2010",
}


@pytest.mark.parametrize("name", reference_names())
def test_every_reference_net_loads(name: str) -> None:
    assert load_net(name).name == name


def test_every_well_formed_case_loads_and_every_malformed_one_has_its_own_code() -> None:
    codes = {}
    for case in cases():
        if case.expect.get("error"):
            with pytest.raises(InputError) as refused:
                case.net()
            codes[case.label] = [diagnostic.code for diagnostic in refused.value.diagnostics]
        else:
            assert isinstance(case.net(), Net), str(case)
    assert codes == {label: [code] for label, code in REFUSED.items()}


def test_places_of_the_cell_are_named_after_their_controllers() -> None:
    net = load_net("cell1")
    assert [controller.name for controller in net.controllers] == ["c0", "c1", "c2", "c3"]
    assert net.coordinator is not None
    assert net.coordinator.name == "c0"
    assert net.place("c1.Robot").marked
    assert net.signal("c1.r.touch").owner == "c1"
    assert local("c1.Robot") == "Robot"
    assert local("Robot") == "Robot"
