"""`firable split`: who owns what, what the coordinator decides and why, and what each controller must know."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import indent
from typing import TYPE_CHECKING, Any

import click

from firable.cli import text
from firable.cli.files import FOLDER, READ, WRITTEN_NET
from firable.cli.finite import FiniteRange
from firable.cli.net_files import demand_a_net_file, write_net, write_nets
from firable.cli.options import (
    answer,
    formats_option,
    is_given,
    load_net,
    net_argument,
    page_option,
    with_page,
)
from firable.cli.report import Report
from firable.cli.votes import Votes, votes_told

if TYPE_CHECKING:
    from firable.decompose.splitting.persistence import Persistence
    from firable.decompose.splitting.rules import Rules
    from firable.decompose.splitting.suggesting import Suggestion
    from firable.nets.decomposition import Decomposition
    from firable.nets.net import Net

_NAMES_MAX = 10  # in one line of text
_CONTROLLERS_MAX = 30  # told of in text; the JSON has them all


@click.command(short_help="Split a net over its controllers: table, arbitration, votes, what each must know.")
@net_argument
@click.option(
    "--own",
    "own",
    metavar="CONTROLLER=PATTERNS",
    multiple=True,
    help="Give a controller the places and signals so named, such as robot='r_*,free'; repeatable.",
)
@click.option("--rules", metavar="FILE", type=READ, help="Such rules in a file: a mapping of controllers to patterns.")
@click.option(
    "--suggest",
    type=click.IntRange(min=1),
    metavar="N",
    help="Propose owners: N controllers with few global transitions between them.",
)
@click.option(
    "--slack",
    type=FiniteRange(min=0),
    default=0.6,
    show_default=True,
    metavar="SHARE",
    help="By how much the sizes proposed may differ from their average.",
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=WRITTEN_NET,
    help="Write the net with its new owners as a net file (*.firable.yaml).",
)
@click.option(
    "--subnets", "subnet_dir", metavar="DIR", type=FOLDER, help="Write the subnet of each controller as a net file."
)
@click.option(
    "--max-seconds",
    type=FiniteRange(min=0),
    default=20.0,
    show_default=True,
    metavar="SECONDS",
    help="Give up so late which votes are persistent.",
)
@page_option
@formats_option
def split(
    net: str,
    own: tuple[str, ...],
    rules: str | None,
    suggest: int | None,
    slack: float,
    output: str | None,
    subnet_dir: str | None,
    max_seconds: float,
    page: str | None,
    format_: str,
) -> int:
    """Split NET by ownership and tell what follows from it.

    The coordinator table; what became coordinated because of a gate or a conflict; the arbitration groups, and who
    decides each; which parts are persistent, that is, whose yes no other transition takes back, and which may leave
    out the promise; of each controller what it fires alone, votes on, locks for others, and whom it talks to.

    Owners stand in the file, or are given by rules (--own, --rules), or proposed (--suggest N): machines stay whole,
    and as few transitions as possible become global. -o writes the net with them, ready for `firable prove`.
    """
    by_rule = bool(own) or rules is not None
    if by_rule and suggest is not None:
        raise click.UsageError("--suggest proposes owners, and --own and --rules give them: leave one out")
    if is_given("slack") and suggest is None:
        raise click.UsageError("--slack is of owners that are proposed: add --suggest N")
    if output is not None and not by_rule and suggest is None:
        raise click.UsageError("-o writes the net with new owners: give them by --own or --rules, or --suggest them")
    demand_a_net_file(output)
    asked = _Asked(own, rules, suggest, slack, max_seconds)
    return answer("split", format_, with_page(lambda: _report(net, asked, output, subnet_dir), page), _show)


@dataclass(frozen=True, slots=True)
class _Asked:
    """Whose owners are asked for, and how long may be thought of it."""

    own: tuple[str, ...]
    rules: str | None
    suggest: int | None
    slack: float
    max_seconds: float


def _report(argument: str, asked: _Asked, output: str | None, subnet_dir: str | None) -> Report:
    from firable.analysis.deadline import Deadline
    from firable.analysis.goal import Limits
    from firable.decompose.splitting.cut import split as split_net
    from firable.decompose.splitting.persistence import persistence
    from firable.nets.blocked_timeouts import blocked_timeouts

    loaded, rules = load_net(argument), _rules(asked)
    with loaded.placing():
        net, suggestion = _owned(loaded.net, asked, rules)
        decomposition = split_net(net)
    found = persistence(decomposition, limits=Limits(Deadline.after(asked.max_seconds)))
    files = () if output is None else write_net(output, net)
    if subnet_dir is not None:
        files += write_nets(subnet_dir, _subnets(decomposition))
    split_json = _split_json(found)
    if suggestion is not None:
        split_json["suggestion"] = suggestion.to_json()
    return Report(
        "split",
        argument,
        net,
        found.verdicts,
        notes=(*loaded.notes, *loaded.placed(blocked_timeouts(decomposition))),
        table=decomposition.table,
        decomposition=replace(decomposition, free=found.free),
        files=files,
        split=split_json,
    )


def _rules(asked: _Asked) -> Rules:
    """The rules of ownership that the options give, whose mistakes are nowhere in the file of the net."""
    from firable.decompose.splitting.rules import read_rules, rules_of_options

    rules = {} if asked.rules is None else read_rules(asked.rules)
    for controller, patterns in rules_of_options(asked.own).items():
        rules.setdefault(controller, []).extend(patterns)
    return rules


def _owned(net: Net, asked: _Asked, rules: Rules) -> tuple[Net, Suggestion | None]:
    """The net with the owners that were asked for."""
    from firable.analysis.deadline import Deadline
    from firable.decompose.splitting.rules import owned_by_rules
    from firable.decompose.splitting.suggesting import suggest

    if asked.suggest is not None:
        found = suggest(net, asked.suggest, slack=asked.slack, deadline=Deadline.after(asked.max_seconds))
        return found.net, found
    return (owned_by_rules(net, rules) if rules else net), None


def _subnets(decomposition: Decomposition) -> dict[str, Net]:
    from firable.nets.bundle import file_stem

    return {f"{file_stem(subnet.name)}.firable.yaml": subnet for subnet in decomposition.subnets}


def _split_json(found: Persistence) -> dict[str, Any]:
    """What `split.json` of a bundle holds, with the groups, and the parts that may leave out the promise."""
    from firable.nets.bundle_records import table_to_json
    from firable.nets.knowledge import split_to_json

    free = set(found.free_of_promise)
    facts = split_to_json(found.decomposition)
    for one in facts["controllers"]:
        del one["undisturbing"]
        one["promises"] = [part for _, part in one["votes"] if part not in free]
    return {**facts, "groups": table_to_json(found.decomposition)["groups"]}


def _show(report: Report) -> None:
    from firable.decompose.splitting.table import table_text

    for note in report.notes:
        text.show_diagnostic(note)
    text.heading(report.net, report.input)
    click.echo(f"\n{click.style('coordinator table', bold=True)}")
    click.echo(indent(table_text(report.table), "  "), nl=False)
    if not report.table:
        click.echo("  no transition has more than one participant")
    for title, lines in (
        ("proposed owners", _proposed(report.split.get("suggestion"), written=bool(report.files))),
        ("coordinated, or decided higher up, because of a gate or a conflict", _because(report.split["coordinated"])),
        ("arbitration", _groups(report)),
        ("votes", _votes(report)),
        ("controllers", _controllers(report)),
    ):
        if told := list(lines):
            click.echo(f"\n{click.style(title, bold=True)}")
            for line in told:
                click.echo(f"  {line}")
    if report.files:
        click.echo("")
    for file in report.files[:_NAMES_MAX]:
        click.echo(f"  written: {file}")
    if len(report.files) > _NAMES_MAX:
        click.echo(f"  and {len(report.files) - _NAMES_MAX} more beside it")
    text.show_page(report)


def _proposed(suggestion: Mapping[str, Any] | None, *, written: bool) -> Iterator[str]:
    """What was proposed, what it cuts, and what that compares with."""
    if suggestion is None:
        return
    low, high = suggestion["smallest_allowed"], suggestion["largest_allowed"]
    best = "no ownership within these sizes has fewer global ones" if suggestion["optimal"] else "fewer may be possible"
    yield f"by {suggestion['method']}: {best}"
    for title, key in (("proposed", "proposed"), ("in the file", "given")):
        if (of := suggestion[key]) is not None:
            sizes = [f"{name} {size}" for name, size in of["sizes"].items()]
            yield f"{title:<12} {of['cut']:>4} global, {of['votes']:>4} votes; places and signals: {_listed(sizes)}"
    n, least, most = len(suggestion["proposed"]["sizes"]), suggestion["fewest"], suggestion["most"]
    pieces = "for one controller owns all" if n == 1 else "for the net is in as many pieces as controllers, or more"
    why = "as the net hangs together" if least else pieces
    yield f"{'at least':<12} {least:>4} global, {why}; at most {most}, with an owner for each block"
    yield f"sizes from {low} to {high} were allowed (--slack); machines stay whole, and completions with their places"
    cut = suggestion["cut"]
    for one in cut[:_CONTROLLERS_MAX]:
        yield f"{one['transition']} joins {_listed(one['controllers'])}"
    if len(cut) > _CONTROLLERS_MAX:
        yield f"and {len(cut) - _CONTROLLERS_MAX} more are cut; --format json has them all"
    if not written:
        yield "-o FILE writes the net with these owners, each place and signal under its controller"


def _because(reasons: Sequence[dict[str, Any]]) -> Iterator[str]:
    for reason in reasons:
        if reason["because"] == "gate":
            yield f"{reason['transition']}: would be local but for {_listed(reason['gates'])}"
        elif reason["because"] == "conflict":
            yield f"{reason['transition']}: local, in conflict with {reason['rival']} at {reason['place']}"
        if lower := reason["lifted_from"]:
            rival = f"{reason['rival']} at {reason['place']}"
            yield f"{reason['transition']}: would be decided by {lower}, but competes with {rival}, which is not"


def _groups(report: Report) -> Iterator[str]:
    for group in report.split["groups"]:
        members = list(dict.fromkeys((*group["sequence"], *group["rest"])))
        decider = group["controller"] or group["at"] or _top(report)
        yield f"{group['name']}: {_listed(members)}; decided by {decider} {text.rule(group['sequence'], group['by'])}"


def _top(report: Report) -> str:
    from firable.nets.layers import Layers

    return Layers(report.net).root


def _votes(report: Report) -> Iterator[str]:
    """How many votes are persistent, and may leave out the promise; of the others each, with what takes it back."""
    assert report.decomposition is not None
    return votes_told(Votes.of(report), len(report.decomposition.free))


def _controllers(report: Report) -> Iterator[str]:
    known = report.split["controllers"]
    for one in known[:_CONTROLLERS_MAX]:
        counts = ((len(one[key]), word) for key, word in (("places", "place"), ("signals", "signal")))
        owned = ", ".join(text.counted(n, w) for n, w in counts if n)
        yield click.style(one["controller"], bold=True) + (f"  {owned}" if owned else "")
        told = (
            ("fires alone", one["fires"]),
            ("decides", one["decides"]),
            ("votes on", [f"{name} ({part})" if name != part else name for name, part in one["votes"]]),
            ("must promise", one["promises"]),
            ("coordinates", one["coordinates"]),
            ("decided above", one["relays"]),
            ("locks for others", [f"{place} ({name})" for place, name in one["locks"]]),
            ("answers for", list(dict.fromkeys(signal for signal, _ in one["answers"]))),
            ("talks to", one["talks_to"]),
        )
        yield from (f"  {title:<17}{_listed(names)}" for title, names in told if names)
    if len(known) > _CONTROLLERS_MAX:
        yield f"and {len(known) - _CONTROLLERS_MAX} more; --format json has them all"


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_NAMES_MAX])
    return f"{shown} and {len(names) - _NAMES_MAX} more" if len(names) > _NAMES_MAX else shown
