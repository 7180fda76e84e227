"""Golden diagnostics: each kind of malformed net file, with its code, its place and the start of its hint."""

from codecs import BOM_UTF8
from dataclasses import dataclass
from pathlib import Path

import pytest

from firable.nets.diagnostics import CODES, InputError
from firable.nets.document_errors import version_problem
from firable.nets.source import Source
from firable.nets.text import SIZE_BYTES_MAX, parse_net, read_net

HEAD = "firable: 1\ncell: c\n"


@dataclass(frozen=True)
class Refusal:
    """A text and what must be said about it: `code line:column` for each diagnostic, and words of the first hint."""

    name: str
    text: str
    found: tuple[str, ...]
    hint: str

    def __str__(self) -> str:
        return self.name


def of(name: str, text: str, found: str | tuple[str, ...], hint: str) -> Refusal:
    return Refusal(name, text, (found,) if isinstance(found, str) else found, hint)


def net(name: str, body: str, found: str | tuple[str, ...], hint: str) -> Refusal:
    return of(name, HEAD + body, found, hint)


ROBOT = """controllers:
  robot:
    start: free
    inputs: door_shut
    places:
      free:
      busy: {send: {machine: R, command: MOVE}, until: at_home}
"""  # lines 3 to 9
T = "transitions:\n"  # line 10

TABLE = (
    # the text
    of("empty file", "", "F1002 1:1", "a net file begins with `firable: 1`"),
    of("only a comment", "# nothing\n", "F1002 1:1", "a net file begins with"),
    of("noise", "lorem ipsum\n", "F1010 1:1", "a net file begins with"),
    of("a list", "- a\n- b\n", "F1010 1:1", "a net file begins with"),
    of("no version", "cell: c\n", "F1009 1:1", "a net file begins with `firable: 1`"),
    of("version misspelt", "cell: c\nfirabel: 1\n", "F1009 2:1", "a net file begins with"),
    of("another version", "firable: 2\ncell: c\n", "F1011 1:10", "write `firable: 1`"),
    of("no cell", "firable: 1\n", "F1009 1:1", "add `cell:`"),
    net("tab", "places:\n\tp:\n", "F1005 4:1", "indent with spaces"),
    net("bracket left open", "transitions: {t: {from: [p, q}}\n", "F1005 3:30", "check the"),
    net("missing colon", "places:\n  p\n  q:\n", "F1005 5:4", "check the indentation and the colons"),
    net("key without a colon", "places: {p: }\nstart\n", "F1005 4:1", "check the"),
    net("colon in a text", "description: mind: hot\n", "F1005 3:18", "in double quotes"),
    net("colon in a text in braces", T + "  t: {description: mind: hot, from: p}\n", "F1005 4:24", "in double quotes"),
    net("nesting without end", "places: " + "[" * 10_000, "F1005 3:40", "a net needs no such nesting"),
    net("control character", "description: a\x07b\n", "F1005 3:15", "delete it"),
    net("byte order mark inside", "description: a\ufeffb\n", "F1005 3:15", "delete it"),
    net("line separator", "description: a\u2028b\n", "F1007 3:15", "delete it"),
    net("duplicate key", "places: {p: }\nplaces: {q: }\n", "F1006 4:1", "rename one of them"),
    net("duplicate place", "places:\n  p:\n  q:\n  p:\n", "F1006 6:3", "rename one of them"),
    net("key `on`", "places:\n  on:\n", "F1007 4:3", 'write "on" in double quotes'),
    net("value `off`", "places: {p: {send: {machine: M, command: OFF}}}\n", "F1007 3:42", 'write "OFF" in double'),
    net("key `no` and value `yes`", "places: {no: }\nstart: yes\n", ("F1007 3:10", "F1007 4:8"), 'write "no"'),
    net("null", "places: {p: ~}\n", "F1007 3:13", "or leave the value empty, or the key out"),
    net("key `true`", "places: {true: }\n", "F1007 3:10", 'write "true" in double quotes'),
    net("empty key", "places: {: x}\n", "F1005 3:10", "check the indentation"),
    net("empty key with a question mark", "places:\n  ?\n  : x\n", "F1007 4:4", "write a name before the colon"),
    net("anchor", "places: &all {p: }\n", "F1007 3:9", "delete it"),
    net("alias", "start: *all\n", "F1007 3:8", "write the part out"),
    net("merge key", "places: {<<: {p: }}\n", "F1007 3:10", "write the keys out"),
    net("tag", "start: !!str p\n", "F1007 3:8", "delete it"),
    net("two documents", "---\nfirable: 1\n", "F1007 3:1", "one file holds one net"),
    net("key that is a list", "? [a]\n: b\n", "F1010 3:3", "write `name: value`"),
    # the document
    net("unknown key", "contollers: {}\n", "F1008 3:1", "did you mean 'controllers'?"),
    net("unknown key in a place", "places: {p: {sned: x}}\n", "F1008 3:14", "did you mean 'send'?"),
    net("unknown key in a transition", T + "  t: {form: p}\n", "F1008 4:7", "did you mean 'from'?"),
    net("unknown key in a transition that has the name of a key", T + "  start: {form: p, to: q}\n", "F1008 4:11",
        "did you mean 'from'?"),
    net("required key misspelt", "arbiters: {a: {amnog: [t, u]}}\n", "F1008 3:16", "did you mean 'among'?"),
    net("names without brackets", T + "  t: {from: p, if: q, r, s, to: s}\n", "F1008 4:23",
        "a gate is one name, and no condition: write `if: [q, r, s]`"),
    net("places without brackets", T + "  t: {if: q, from: p, r}\n", "F1008 4:23",
        "a list stands in brackets: write `from: [p, r]`"),
    net("sensors without brackets", "controllers: {c: {inputs: s, t, start: p}}\n", "F1008 3:30",
        "a list stands in brackets: write `inputs: [s, t]`"),
    net("a name behind what is no list", T + "  t: {number: 1, q}\n", "F1008 4:18", "the keys here are number"),
    net("a name behind a list", T + "  t: {if: [p], q}\n", "F1008 4:16", "the keys here are number"),
    net("a name in a time limit", "places: {p: {within: {time: 5s, to: q, r}}}\n", "F1008 3:40",
        "the keys here are time"),
    net("a name in a property", "properties: {p: {leads_to: {from: p, q, to: r}}}\n", "F1008 3:38",
        "the keys here are from"),
    net("comma without quotes", "places: {p: {description: a, b}}\n", "F1008 3:30", "the keys here are send"),
    net("places beside the controllers", "controllers:\n  robot:\n  places:\n    p:\n    q:\n", "F1008 5:3",
        "'places' is a key of the format: check the indentation"),
    net("transitions below the controllers", "controllers:\n  r: {}\n  transitions:\n    t: {from: p}\n    u: {}\n",
        "F1008 5:3", "'transitions' is a key of the format: check the indentation"),
    net("key of a transition beside it", T + "  t:\n  from: p\n  to: q\n", "F1008 5:3",
        "'from' is a key of the format: check the indentation"),
    net("transitions without their line", "controllers:\n  r: {places: {p: , q: }}\n  t: {from: r.p, to: r.q}\n"
        "  u: {description: back, from: r.q, to: r.p}\n", "F1008 5:3", "write `transitions:` in a line of its own"),
    net("properties among the arbiters", "arbiters:\n  safe: {never: p}\n  served: {reachable: p}\n", "F1008 4:3",
        "write `properties:` in a line of its own"),
    net("send without a command", "places: {p: {send: {machine: R}}}\n", "F1009 3:14", "add `command:`"),
    net("command misspelt", "places: {p: {send: {machine: R, comand: M}}}\n", "F1009 3:33", "write `command:`"),
    net("send without structure", "places: {p: {send: MOVE}}\n", "F1010 3:20", "a mapping, lines of `name: value`"),
    net("parameter that is a list", "places: {p: {send: {machine: R, command: M, to: [a]}}}\n", "F1010 3:49",
        "a name or text is expected"),
    net("places as a list", "places: [p, q]\n", "F1010 3:9", "a mapping, lines of `name: value`"),
    net("from as a mapping", T + "  t: {from: {p: q}}\n", "F1010 4:13", "a name or a list of names"),
    net("from with a comma and no name", T + "  t: {from: , to: q}\n", "F1010 4:7",
        "leave `from` out where there is none"),
    net("to with nothing", T + "  t:\n    from: q\n    to:\n", "F1010 6:5", "leave `to` out where there is none"),
    net("list with an empty item", T + "  t:\n    from:\n      - p\n      -\n", "F1010 7:8", "a name or text"),
    net("number that is none", T + "  t: {number: one}\n", "F1010 4:15", "a whole number from 0"),
    net("negative number", T + "  t: {number: -1}\n", "F1010 4:15", "a whole number from 0"),
    net("number that is too long", T + "  t: {number: 9999999999999999999}\n", "F1010 4:15",
        "a whole number of 18 digits at most"),
    net("time as a list", "places: {p: {within: [5s]}}\n", "F1010 3:22", "a time is expected, such as `5s`"),
    net("coordinator that is neither true nor false", "controllers: {s: {coordinator: maybe}}\n", "F1010 3:32",
        "true or false"),
    net("true where a name is expected", "start: true\n", "F1010 3:8", "a name or a list of names"),
    net("unknown arbitration", "arbiters: {a: {among: [t, u], by: luck}}\n", "F1010 3:35", "'priority', 'order' or"),
    net("arbiter without transitions", "arbiters: {a: {by: order}}\n", "F1009 3:12", "add `among:`"),
    net("property without a pattern", "properties: {p: {}}\n", "F1010 3:14", "write one pattern for each property"),
    net("property with two patterns", "properties: {p: {never: a, always: b}}\n", "F1010 3:14", "write one pattern"),
    net("property with an unknown pattern", "properties: {p: {nevr: a}}\n", "F1008 3:18", "did you mean 'never'?"),
    net("leads_to with one formula", "properties: {p: {leads_to: [a]}}\n", "F1010 3:28", "two formulas"),
    net("leads_to without a target", "properties: {p: {leads_to: {from: a}}}\n", "F1009 3:18", "add `to:`"),
    net("key of leads_to beside its pair", "properties: {p: {leads_to: [a, b], fairness: strong}}\n", "F1008 3:36",
        "'fairness' is a key of `leads_to`: write `leads_to: {from: a, to: b, fairness: strong}`"),
    net("keys of leads_to without it", "properties: {p: {from: a, to: b, fairness: weak}}\n",
        ("F1008 3:18", "F1008 3:27", "F1008 3:34"), "'from' is a key of `leads_to`: write `leads_to: {from: a"),
    net("key of within beside it", "places: {p: {within: 5s, timer: late}}\n", "F1008 3:26",
        "'timer' is a key of `within`: write `within: {time: 5s, to: late, timer: overdue}`"),
    net("machine beside the command", "places: {p: {send: {machine: R, command: MOVE}, machine: R}}\n", "F1008 3:49",
        "'machine' is a key of `send`: write `send: {machine: R, command: MOVE}`"),
    net("machine beside the resource", "places: {p: {opens: {to: r.idle, machine: R}, machine: R}}\n", "F1008 3:47",
        "'machine' is a key of `opens`: write `opens: {to: CONTROLLER.PLACE, machine: R}`"),
    net("leads_to with three formulas", "properties: {p: {leads_to: [a, b, c]}}\n", "F1010 3:28",
        "two formulas are expected: `[a, b]`, or `{from: a, to: b, fairness: strong}`"),
    net("leads_to of a list with a key", "properties: {p: {leads_to: [a, b, {fairness: strong}]}}\n", "F1010 3:28",
        "two formulas are expected: `[a, b]`, or `{from: a, to: b, fairness: strong}`"),
    net("unknown fairness", "properties: {p: {leads_to: {from: a, to: b, fairness: very}}}\n", "F1010 3:55",
        "'none', 'weak'"),
    # formulas
    net("formula that ends too early", "places: {a: }\nproperties: {p: {never: a and}}\n", "F1012 4:30",
        "write places joined"),
    net("CTL in LTL", "places: {a: }\nproperties: {p: {ltl: AG a}}\n", "F1012 4:23", "LTL has X, F, G"),
    net("half a formula of CTL", "places: {a: }\nproperties: {p: {ctl: AG EF}}\n", "F1012 4:28", "CTL has EX"),
    net("unknown event", "places: {a: }\nproperties: {p: {ltl: G fires(t)}}\n", "F2004 4:31", "declare it first"),
    net("formula in quotes", "places: {a: }\nproperties: {p: {never: 'a or )'}}\n", "F1012 4:31",
        "write places joined"),
    net("formula in leads_to", "places: {a: }\nproperties: {p: {leads_to: [a, not]}}\n", "F1012 4:35",
        "write places joined"),
    net("formula without end", "properties: {p: {never: " + "not " * 5000 + "a}}\n", "F1012 3:429",
        "write places joined"),
    net("unknown place in a formula", "places: {a: }\nproperties: {p: {never: a and (not b)}}\n", "F2002 4:36",
        "declare it"),
    net("firing of a place", "places: {a: }\ntransitions: {t: {to: a}}\nproperties: {p: {ltl: G fires(a)}}\n",
        "F2004 5:31", "write `a` for a token on it, or name a transition, such as 't', which puts"),
    net("token on a transition", "transitions: {t: {}}\nproperties: {p: {never: t}}\n", "F2002 4:25",
        "write `firable(t)` where it may fire"),
    net("word of formulas misspelt", "places: {a: }\nproperties: {p: {always_possible: strat}}\n", "F2002 4:35",
        "did you mean 'start'?"),
    net("unknown transition in a formula", "properties: {p: {never: firable(go)}}\n", "F2004 3:33", "declare it"),
    net("place with the name of an atom", "places: {start: }\nproperties: {p: {never: start}}\n", "F2012 3:10",
        "rename the place"),
    # the net
    net("start that is no place", "places: {p: }\nstart: q\n", "F2002 4:8", "`start` names places"),
    net("start with a full name", ROBOT.replace("start: free", "start: robot.free"), "F2002 5:12",
        "inside 'robot' names are local: write 'free'"),
    net("sensor declared with its full name", ROBOT.replace("inputs: door", "inputs: robot.door")
        + T + "  t: {from: robot.free, if: robot.door_shut}\n", "F2021 11:29",
        "inside 'robot' names are local, so write 'door_shut' there"),
    net("completion with no name", ROBOT.replace("until: at_home}", "until: }"), "F1010 9:49",
        "leave `until` out for what holds without it"),
    net("command of nothing", ROBOT.replace("at_home}", "at_home}\n      late: {send: }"), "F1010 10:14",
        "leave `send` out for what holds without it"),
    net("time limit without a time", ROBOT.replace("at_home}", "at_home, within: }"), "F1010 9:65",
        "leave `within` out for what holds without it"),
    net("task and resource of nothing", "places: {p: {task: }, q: {opens: }}\n", ("F1010 3:14", "F1010 3:27"),
        "leave `task` out for what holds without it"),
    net("transition of nothing", "places: {p: }\n" + T + "  t:\n  u: {to: p}\n", "F1010 5:3",
        "write what it takes and puts, `{from: p, to: q}`, or `{}` for a transition that waits for nothing"),
    net("transition of nothing in braces", "transitions: {t: }\n", "F1010 3:15", "write what it takes and puts"),
    net("number of nothing", "transitions: {t: {number: }}\n", "F1010 3:19", "leave `number` out"),
    net("fault place with no name", ROBOT.replace("at_home}", "at_home, within: {time: 5s, to: }}"), "F1010 9:84",
        "leave `to` out for what holds without it"),
    net("fault place with a full name", ROBOT.replace("at_home}", "at_home, within: {time: 5s, to: robot.free}}"),
        "F2002 9:88", "inside 'robot' names are local: write 'free'"),
    net("two tokens", "places: {p: }\nstart: [p, p]\n", "F2006 4:12", "a place holds one token at most"),
    net("wrong name", ROBOT + T + "  t: {from: robot.fre}\n", "F2002 11:13", "did you mean 'robot.free'?"),
    net("missing owner", ROBOT + T + "  t: {from: free}\n", "F2002 11:13", "did you mean 'robot.free'?"),
    net("one wrong name in three places", ROBOT + T + "  t: {from: busy}\n  u: {from: busy}\n  v: {to: busy}\n",
        "F2002 11:13", "did you mean 'robot.busy'?"),
    net("place that is like no other", ROBOT + T + "  t: {from: robot.reset}\n", "F2002 11:13", "declare it first"),
    net("place that is declared as a signal elsewhere", "inputs: reset\n" + ROBOT + T + "  t: {from: robot.reset}\n",
        "F2002 12:13", "'reset' is a signal, which can be a gate: write it under `if` or `unless`"),
    net("unknown gate", ROBOT + T + "  t: {from: robot.free, if: robot.door_shot}\n", "F2021 11:29",
        "did you mean 'robot.door_shut'?"),
    net("gate sourced in a transition", ROBOT + T + "  t: {from: robot.free}\n  u: {unless: t}\n", "F2008 12:15",
        "the source of a gate is a place or a signal"),
    net("arc to a transition", ROBOT + T + "  t: {from: robot.free, to: t}\n", "F2017 11:29", "an arc joins"),
    net("arc from a signal", ROBOT + T + "  t: {from: robot.door_shut}\n", "F2017 11:13", "write it under `if`"),
    net("double arc", ROBOT + T + "  t: {from: [robot.free, robot.free]}\n", "F2007 11:26", "arcs and gates are sets"),
    net("double gate", ROBOT + T + "  t: {if: [robot.door_shut, robot.door_shut]}\n", "F2022 11:29", "write it once"),
    net("self-loop", ROBOT + T + "  t: {from: robot.free, to: robot.free}\n", "F2009 11:29",
        "write `if: robot.free` to read the place"),
    net("until without a command", "places: {p: {until: done}}\n", "F2014 3:21", "add `send`"),
    net("until on a sensor", "inputs: done\nplaces: {p: {send: {machine: M, command: C}, until: done}}\n", "F2018 4:53",
        "a completion is a bit that the driver forms"),
    net("signal with the name of a place", "inputs: [p]\nplaces: {p: }\n", "F2001 3:10", "rename one of them"),
    net("transition with the name of a place", "places: {p: }\ntransitions: {p: {}}\n", "F2001 4:15",
        "rename one of them"),
    net("signal twice", "inputs: [a, a]\n", "F2001 3:13", "rename one of them"),
    of("net of two lines", 'firable: 1\ncell: "c\\n  shown"\n', "F2012 2:7", "write it on one line"),
    net("not a name", "places: {'a b': }\n", "F2012 3:10", "use letters, digits"),
    net("opens to no place", ROBOT + "places: {r: {opens: {to: robot, machine: R}}}\n", "F2012 10:26", "write `to:"),
    net("opened twice", ROBOT + "places:\n  r: {opens: {to: robot.a, machine: R}}\n"
        "  s: {opens: {to: robot.a, machine: S}}\n", "F2001 12:19", "give each resource an idle place of its own"),
    net("task and command", ROBOT + "places: {p: {task: {name: load}, send: {machine: R, command: M}}}\n",
        "F2024 10:10", "a place stands for a task, or for a resource"),
    net("task without a name", "places: {p: {task: {robot: r}}}\n", "F1009 3:14", "add `name:`"),
    net("resource without a machine", "places: {p: {opens: {to: r.free}}}\n", "F1009 3:14", "add `machine:`"),
    net("invisible name", 'places: {"a\\u200bb": }\n', "F2012 3:10", "use letters, digits"),
    net("empty name", 'places: {"": }\n', "F2012 3:10", "write a name before the colon"),
    net("two coordinators", "controllers: {a: {coordinator: true}, b: {coordinator: true}}\n", "F2015 3:39",
        "leave `coordinator: true` at one"),
    net("number twice", T + "  t: {number: 1}\n  u: {number: 1}\n", "F2016 5:15", "numbers name the parts"),
    net("arbiter of an unknown transition", T + "  t: {}\narbiters: {a: {among: [t, u]}}\n", "F2004 5:27",
        "declare it"),
    net("arbiter with nothing to decide", T + "  t: {}\narbiters: {a: {among: t}}\n", "F2013 5:23",
        "name at least two"),
    net("arbiter over a list without brackets", T + "  t: {}\n  u: {}\narbiters:\n  a:\n    among: t, u\n",
        "F2004 8:12", "write `among: [t, u]`"),
    net("two arbiters for one transition", T + "  t: {}\n  u: {}\n"
        "arbiters: {a: {among: [t, u]}, b: {among: [u, t]}}\n",
        ("F2013 6:44", "F2013 6:47"), "a conflict component has one arbiter"),
    net("arbiter that names a transition twice", T + "  t: {}\n  u: {}\narbiters: {a: {among: [t, u, t]}}\n",
        "F2013 6:23", "only `by: order`"),
)  # fmt: skip


@pytest.mark.parametrize("refusal", TABLE, ids=str)
def test_a_malformed_net_is_refused_with_its_code_place_and_hint(refusal: Refusal) -> None:
    with pytest.raises(InputError) as refused:
        parse_net(refusal.text, "net.yaml")
    problems = refused.value.diagnostics
    assert tuple(f"{p.code} {p.span.line}:{p.span.column}" for p in problems if p.span) == refusal.found
    assert refusal.hint in problems[0].hint
    for problem in problems:
        assert problem.code in CODES
        assert problem.span is not None
        assert str(problem).startswith(f"net.yaml:{problem.span.line}:{problem.span.column}: error[{problem.code}]: ")
        assert all(len(line) < 200 for line in str(problem).splitlines()[:3])


def refused_file(path: Path) -> tuple[str, str]:
    with pytest.raises(InputError) as refused:
        read_net(path)
    (problem,) = refused.value.diagnostics
    assert problem.hint
    assert problem.span is not None
    assert problem.span.file == str(path)
    return problem.code, problem.message


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    code, message = refused_file(tmp_path / "none.yaml")
    assert (code, "No such file" in message) == ("F1001", True)


def test_a_directory_is_refused(tmp_path: Path) -> None:
    code, message = refused_file(tmp_path)
    assert (code, "directory" in message) == ("F1001", True)


def test_a_device_is_refused() -> None:
    code, message = refused_file(Path("/dev/zero"))
    assert (code, "regular file" in message) == ("F1001", True)


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cell.firable.yaml"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    assert refused_file(path)[0] == "F1004"
    path.write_bytes(b"firable: 1\0")
    assert refused_file(path)[0] == "F1004"


def test_the_first_byte_that_is_no_text_is_told_with_its_line_and_column(tmp_path: Path) -> None:
    path = tmp_path / "cell.firable.yaml"
    for mark in (b"", BOM_UTF8):
        path.write_bytes(mark + "firable: 1\r\ncell: é".encode() + b"\xdf\n")
        with pytest.raises(InputError) as refused:
            read_net(path)
        (problem,) = refused.value.diagnostics
        assert problem.span is not None
        assert problem.message == f"not UTF-8 text: byte {20 + len(mark)} is 0xdf"
        assert (problem.span.line, problem.span.column) == (2, 8)
        assert problem.span.excerpt == "cell: é\N{REPLACEMENT CHARACTER}"


def test_noise_of_100_megabytes_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "noise.yaml"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)  # sparse: reading it would find NUL and give F1004
    code, message = refused_file(path)
    assert (code, "100,000,000" in message) == ("F1003", True)


def test_a_text_above_the_limit_is_refused() -> None:
    with pytest.raises(InputError) as refused:
        parse_net("#" * (SIZE_BYTES_MAX + 1))
    assert refused.value.diagnostics[0].code == "F1003"


def test_a_byte_order_mark_before_the_text_is_accepted(tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    path.write_bytes(b"\xef\xbb\xbffirable: 1\r\ncell: c\r\n")
    assert read_net(path).name == "c"


def test_many_problems_are_bounded_and_counted() -> None:
    text = HEAD + T + "".join(f"  t{i}: {{from: p{i}}}\n" for i in range(1000))
    with pytest.raises(InputError) as refused:
        parse_net(text)
    problems = refused.value.diagnostics
    assert len(problems) == 80
    assert "20 more problems are not shown" in problems[-1].hint


def test_repeated_use_of_one_wrong_name_tells_the_lines() -> None:
    with pytest.raises(InputError) as refused:
        parse_net(HEAD + T + "".join(f"  t{i}: {{from: p}}\n" for i in range(4)))
    (problem,) = refused.value.diagnostics
    assert problem.message == "there is no place 'p' (also on lines 5, 6, 7)"


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("  password: hunter2", "  password: *******"),
        ("  d: {user: ann, password: hunter, 2}", "  d: {user: ann, password: **********"),
        ('  "password" : "hun,t\\"r2", user: ann', '  "password" : ***********, user: ann'),
        ("  password: 'hunter, 2' # his", "  password: *********** # his"),
        ("  password: a, b}c # his", "  password: ************"),
        ("  user: ann, passwords: 2", "  user: ann, passwords: 2"),
    ],
)
def test_an_excerpt_shows_no_password_and_leaves_the_rest_in_its_place(line: str, shown: str) -> None:
    span = Source("cell.bind.yaml", f"devices:\n{line}\n").span(2, 3)
    assert span.excerpt == shown


def test_the_excerpt_of_a_very_long_line_is_a_window_with_the_caret_in_place() -> None:
    with pytest.raises(InputError) as refused:
        parse_net(HEAD + "places: {" + "".join(f"p{i}: , " for i in range(5000)) + "'b d': }\n")
    first, excerpt, caret, _ = str(refused.value).splitlines()
    assert len(excerpt) < 120
    at = caret.index("^")
    assert excerpt[at : at + caret.count("^")] == "'b d'"
    assert "F2012" in first


def test_terminal_controls_in_the_text_do_not_reach_the_message() -> None:
    with pytest.raises(InputError) as refused:
        parse_net(HEAD + "places: {'a\x9b31m': }\n\x1b[2J\n")
    assert all(line.isprintable() for line in str(refused.value).splitlines())


def test_a_quoted_word_is_a_name() -> None:
    net = parse_net(HEAD + 'places: {"on": , \'no\': }\nstart: "on"\n')
    assert [place.name for place in net.places] == ["on", "no"]


def test_a_net_file_is_told_by_its_version() -> None:
    from firable.nets.yaml_tree import parse_tree

    source = Source("f", HEAD)
    assert version_problem(source, parse_tree(source)) is None


@pytest.mark.parametrize(
    ("text", "what", "how"),
    [
        ("firable_plant: 1\n", "a plant file", "`--machines` of `check`, and `--plant` of `run` and `sim`"),
        ("# b\nfirable_bind: 1\n", "a binding", "`firable io`, and `--bind` of `run`"),
        ("firable_tasks: 1\n", "a file of tasks", "`--tasks` of `refine`"),
        ("firable_layout: 1\n", "a layout file", "`draw` and `view`, where it stands beside its net"),
        ('{"firable_evidence": 2}\n', "evidence", "`firable verify`"),
        ('{"firable_report": 1}\n', "a report", "other programs"),
        ('{"firable_signatures": 1}\n', "signatures", "`firable sign` and `firable run`, beside their bundle"),
    ],
)
def test_a_file_of_another_kind_is_told_by_what_it_is_and_what_reads_it(text: str, what: str, how: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_net(text)
    (problem,) = refused.value.diagnostics
    assert (problem.code, problem.message) == (
        "F1009",
        f"the key 'firable' is missing: this is {what}, and no net file",
    )
    assert problem.hint == f"{what} is for {how}; a net file begins with `firable: 1`"
    assert problem.span is not None
    assert (problem.span.line, problem.span.column) == (text.count("\n"), 1 if text[0] != "{" else 2)


def test_a_net_file_is_no_plant_file() -> None:
    from firable.nets.machines.plant_file import parse_plant

    with pytest.raises(InputError) as refused:
        parse_plant(HEAD)
    (problem,) = refused.value.diagnostics
    assert problem.message == "the key 'firable_plant' is missing: this is a net file, and no plant file"


def test_a_bundle_where_text_is_read_is_told_as_one(tmp_path: Path) -> None:
    (tmp_path / "cell.bundle").write_bytes(b"PK\x03\x04\x14\x00\xff")
    with pytest.raises(InputError, match=r"F1004.*byte 6 is 0xff") as refused:
        read_net(tmp_path / "cell.bundle")
    assert refused.value.diagnostics[0].hint == "this is a bundle, or another archive: `firable run` reads a bundle"
