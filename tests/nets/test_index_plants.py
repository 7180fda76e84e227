"""What a plant file may say of an index, of stations that are full at first and of what is switched, and may not."""

import pytest
from support.table_cell import NET, PLANT, tables

from firable.nets.diagnostics import InputError
from firable.nets.machines.closing import close
from firable.nets.machines.fitting import misfits, otherwise_than
from firable.nets.machines.plant_file import Index, parse_plant
from firable.nets.text import parse_net

RING = "next: {load: drill, drill: unload, unload: load}"
FULL = "full_at_first: {drill: raw, unload: machined}"


def test_an_index_names_the_next_of_each_station() -> None:
    index = tables()[1].machines["T"].commands["INDEX"]
    assert isinstance(index, Index)
    assert index.following == {"load": "drill", "drill": "unload", "unload": "load"}
    assert index.stations == ("load", "drill", "unload")


@pytest.mark.parametrize(
    ("old", "new", "where", "message", "hint"),
    [
        (
            RING,
            "next: {load: drill, unload: drill}",
            "10:56",
            "'machines.T.commands.INDEX.next.unload': workpieces from 'load' and from 'unload' would meet at 'drill'",
            "give each station a next one of its own",
        ),
        (
            RING,
            "next: {load: load}",
            "10:41",
            "'machines.T.commands.INDEX.next.load': a workpiece that is moved comes to another station",
            "leave the station out if it stays",
        ),
        (
            RING,
            "next: {load: dril}",
            "10:41",
            "'machines.T.commands.INDEX.next.load': there is no station 'dril'",
            "did you mean 'drill'? see `stations`",
        ),
        (
            RING,
            "next: {laod: drill}",
            "10:41",
            "'machines.T.commands.INDEX.next.laod': there is no station 'laod'",
            "did you mean 'load'? see `stations`",
        ),
        (
            "      BACK:",
            "      STOP:  {does: stop}\n      BACK:",
            "10:7",
            "'machines.T.commands.INDEX': 'T' has a `stop`, too, which could leave workpieces between two stations",
            "leave out the `stop`: `within` of a place tells of an `index` that is not done in time",
        ),
        (
            FULL,
            "full_at_first: {load: raw}",
            "4:23",
            "'full_at_first.load': workpieces come to 'load', and each only when it is empty",
            "leave it out: one that lies there is the first that comes",
        ),
        (
            FULL,
            "full_at_first: {out: raw}",
            "4:22",
            "'full_at_first.out': workpieces leave at 'out', and none may leave without having been machined",
            "write `machined` here, or `raw: true` of the departure",
        ),
        (
            FULL,
            "full_at_first: {unlaod: raw}",
            "4:25",
            "'full_at_first.unlaod': there is no station 'unlaod'",
            "did you mean 'unload'? see `stations`",
        ),
        (
            "      DRILL:   {does: process, station: drill, takes_s: 1}\n",
            "",
            "4:37",
            "'full_at_first.unload': no machine of the cell machines workpieces: none does `process`",
            "write `raw`",
        ),
    ],
)
def test_what_a_plant_file_says_twice_otherwise_is_told_where_it_stands(
    old: str, new: str, where: str, message: str, hint: str
) -> None:
    with pytest.raises(InputError) as refusal:
        parse_plant(PLANT.replace(old, new), "t.plant.yaml")
    problem = next(one for one in refusal.value.diagnostics if one.message.startswith(message[:30]))
    assert (problem.code, str(problem.span), problem.message) == ("F5003", f"t.plant.yaml:{where}", message)
    assert problem.hint == hint


@pytest.mark.parametrize(
    ("old", "new", "message", "hint"),
    [
        (RING, "next: [load, drill]", "a list stands as 'next' of", "which station is next to which is expected:"),
        (RING, "next: {}", "a mapping stands as 'next' of", "which station is next to which is expected:"),
        (FULL, "full_at_first: [drill]", "a list stands as 'full_at_first'", "what lies on which station is expected:"),
        (FULL, "full_at_first: {drill: full}", "'full' stands as 'drill' of", "'raw' or 'machined' is expected"),
        ("{does: switch}", "{does: switch, takes_s: 1}", "unknown key 'takes_s' in", "the keys here are does"),
    ],
)
def test_what_an_engineer_may_write_instead_is_told_with_what_is_expected(
    old: str, new: str, message: str, hint: str
) -> None:
    assert old in PLANT
    with pytest.raises(InputError) as refusal:
        parse_plant(PLANT.replace(old, new))
    (problem,) = refusal.value.diagnostics
    assert problem.message.startswith(message)
    assert problem.hint.startswith(hint)


def test_nothing_comes_back_of_what_is_switched_so_nobody_may_wait_for_it() -> None:
    net = parse_net(NET.replace("command: LIGHT}}", "command: LIGHT}, until: lit}"))
    (problem,) = misfits(parse_plant(PLANT, "t.plant.yaml"), net)
    assert (problem.code, problem.subject) == ("F5003", ("places", "c.light"))
    assert (
        problem.message == "'c.light' sends 'L LIGHT' and waits for 'c.lit', and nothing comes back of what is switched"
    )
    assert problem.hint == "leave out `until` in the net, or write `does: work` and how long it takes"
    line = PLANT[: PLANT.index("LIGHT")].count("\n") + 1
    assert str(problem.span) == f"t.plant.yaml:{line}:18"


@pytest.mark.parametrize(
    ("lacks", "hint"),
    [
        (
            "LIGHT: {does: switch}, ",
            "add it to the plant file, as `LIGHT: {does: switch}` where it concerns no workpiece",
        ),
        (
            ", TEST: {does: work, takes_s: 1}",
            "add it to the plant file, as `TEST: {does: work, takes_s: 1}` where it concerns no workpiece: a door",
        ),
    ],
)
def test_what_a_plant_lacks_is_switched_unless_somebody_waits_for_it(lacks: str, hint: str) -> None:
    (problem,) = misfits(parse_plant(PLANT.replace(lacks, "")), tables()[0])
    assert problem.hint.startswith(hint)


def test_what_lies_there_at_first_and_where_an_index_leads_is_a_matter_of_the_proof() -> None:
    sealed = tables()[1]
    for old, new, path in (
        (FULL, "full_at_first: {drill: raw}", ("full_at_first", "unload")),
        (RING, "next: {load: drill, drill: unload}", ("machines", "T", "commands", "INDEX", "next", "unload")),
    ):
        (warning,) = otherwise_than(sealed, parse_plant(PLANT.replace(old, new)))
        assert warning.subject == path
    assert otherwise_than(sealed, parse_plant(PLANT.replace("takes_s: 2", "takes_s: 3"))) == ()


# --- The loop


def test_an_index_is_done_in_steps_of_which_each_moves_one_workpiece_or_none() -> None:
    loop = close(*tables())
    takes = [name for name in loop.net.transition_index if name.startswith("T/takes/c.turn/load/")]
    assert "T/takes/c.turn/load/nothing" in takes
    assert any(name.startswith("T/takes/c.turn/load/machined") for name in takes)
    lays = loop.net.transition("W/lays/c.beam/unload/nothing")
    assert lays.inputs == ("plant.W.STEP.lays.unload",)
    assert lays.outputs == ("plant.W.steady",)
    assert "plant.W.from.unload.nothing" in lays.permissive


def test_stations_that_are_full_at_first_are_seen_so_at_first() -> None:
    loop = close(*tables())
    marked = {place.name for place in loop.net.places if place.marked}
    assert {"plant.drill.raw", "plant.unload.machined", "plant.load.empty", "plant.c.drill.told_1"} <= marked
    assert marked.isdisjoint({"plant.drill.empty", "plant.unload.empty", "plant.c.drill.told_0"})
    assert "plant.c.good.told_0" in marked, "nobody has judged it yet"


@pytest.mark.parametrize("extra", [", may_linger: true", ", may_flicker: true"])
def test_a_sensor_that_is_not_exact_sees_what_lies_there_at_first_too(extra: str) -> None:
    model = parse_plant(PLANT.replace("{occupied: drill}", f"{{occupied: drill{extra}}}"))
    assert close(tables()[0], model).net.place("c.drill").marked


def accidents(*edits: tuple[str, str]) -> set[str]:
    """What can be the last of a run of the loop of the index table, with its plant file and net edited."""
    from firable.analysis.loop.verdicts import check_loop
    from firable.nets.catalogue import catalogue_path

    path = catalogue_path("index_table")
    net, plant = path.read_text("utf-8"), path.with_name("index_table.plant.yaml").read_text("utf-8")
    for old, new in edits:
        assert old in net + plant
        net, plant = net.replace(old, new), plant.replace(old, new)
    verdict = check_loop(parse_net(net), parse_plant(plant)).verdict("loop.accidents")
    return {verdict.witness.firings[-1][0]} if verdict.witness is not None else set()


def test_the_index_table_of_the_catalogue_has_accidents_where_its_net_forgets_what_keeps_them_away() -> None:
    assert accidents() == set()
    unseen = accidents(("    unless: table.part_at_unload\n", ""))
    assert unseen == {"t2-c/clears-drill.drilled/D-again"}, "what nobody has taken away comes to the drill anew"
    loose = accidents(
        ("t2-d: {from: drill.drilling,  to: drill.releasing", "t2-d: {from: drill.drilling, to: drill.done")
    )
    assert loose == {"t1-a/clears-table.turned/T-clamped-drill"}
    beam = accidents((", unload: load}, takes_s: 1.5", "}, takes_s: 1.5"), ("    unless: table.part_at_unload\n", ""))
    assert beam == {"T/accident/table.turning/collides-unload"}
