"""`firable run`: run a bundle on the simulated cell, on real machines, or on one host of several."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from firable.cli import text
from firable.cli.bound_run import run_bound_of, show_bound
from firable.cli.choice import OneOf
from firable.cli.files import READ, WRITTEN
from firable.cli.hosting import HostOptions, host_options, run_host_of, show_host
from firable.cli.log import log_option, log_to
from firable.cli.operate import ServeOptions, serve_options
from firable.cli.options import answer, format_option, is_given, plant_for, refuse_a_net
from firable.cli.report import Report
from firable.cli.sign import trust_option
from firable.cli.simulated_run import run_simulated_of, show_simulated

if TYPE_CHECKING:
    from firable.executor import Answer, Operator
    from firable.nets.bundle import Bundle
    from firable.nets.machines.plant_file import PlantModel
    from firable.nets.net import Net

_SPEEDS = {"max": None, "1": 1.0, "10": 10.0}


@click.command(short_help="Run a bundle on the simulated cell, or on real machines.")
@click.argument("bundle", metavar="BUNDLE", type=READ)
@click.option(
    "--plant",
    metavar="FILE",
    type=READ,
    help="The plant file of the cell, or catalogue:NAME.  [default, for a simulated cell: NAME.plant.yaml beside "
    "BUNDLE, else that of the net's name in the catalogue]",
)
@click.option(
    "--workpieces", type=click.IntRange(min=1), default=10, show_default=True, help="How many to carry through."
)
@click.option("--seed", type=int, default=0, show_default=True, help="The seed of the cell's delays.")
@click.option(
    "--speed",
    type=OneOf(list(_SPEEDS)),
    default="max",
    show_default=True,
    help="Times real time; max is virtual time, where a run is a function of bundle, plant and seed.",
)
@click.option("--trace", metavar="FILE", type=WRITTEN, help="Write what happens to a file, for `firable replay`.")
@log_option
@trust_option
@host_options
@click.option(
    "--say",
    metavar="PLACE=WHAT",
    multiple=True,
    help="Of a command whose machine cannot tell, after a restart: done, working, or not-received.",
)
@click.option(
    "--watch",
    type=OneOf(["tell", "stop", "ignore"]),
    default="tell",
    show_default=True,
    help="What to do when the machines do what their plant file excludes.",
)
@serve_options
@click.option("--step", is_flag=True, help="Fire one transition at a time, by the keys above.")
@format_option
def run(
    bundle: str,
    plant: str | None,
    workpieces: int,
    seed: int,
    speed: str,
    trace: str | None,
    log: str | None,
    trust: tuple[str, ...],
    say: tuple[str, ...],
    watch: str,
    serve: str | None,
    token_file: str | None,
    serve_tls: tuple[str, str] | None,
    operators: str | None,
    open_: bool,
    step: bool,
    format_: str,
    **host: Any,
) -> int:
    """Run BUNDLE: its coordinators and a controller for each subnet, on a simulated cell of machines and workpieces.

    A bundle that is changed or not proved is refused, and with --trust one that none of these keys has signed. Ctrl-C
    stops the machines, and the run ends in order, with its report and its trace.

    With --journal, all that the run needs is stored before anything leaves it. If it is killed, the same command takes
    it up: it says what became of each command, and moves nothing. With --resume, or by the keys, it goes on; where no
    machine can tell whether it has done a command, --say does. The simulated cell is kept beside the journal.

    With --step, Enter fires the next transition, r runs on, e stops at the end of the cycle, when the cell is empty,
    and s stops now. In real time (--speed 1 or 10) the machines end what they are at while you think, and Enter pauses
    a run that runs on.

    With --bind, all runs on the machines of a binding, in real time, until Ctrl-C; what they carry it does not count.

    While it runs, the machines are held against their plant file (with --bind, against the one that --plant names): the
    first thing that they do and cannot have done, or have not done and must have, is told, and with --watch stop it
    ends the run.

    With --log, what happens to the run is told in JSON lines as well: links and hosts that come and go, faults, what an
    operator commands, and how it ends.

    With --serve, in real time, `firable operate` pauses, steps and stops the run from elsewhere, and Prometheus reads
    its figures; everybody is asked for a token or a certificate, and beyond this host nothing goes without TLS. At the
    same address a browser is shown the run as it goes on; --open opens one, and in real time if no speed is named.

    With --controller, only these controllers run here, on machines that --bind names, and the others on hosts that are
    linked to this one by --listen and --join, or by --serial. A host that holds another bundle is refused. The run ends
    by Ctrl-C; `firable replay` joins the traces of all hosts. With --plant, the machines here are held against the
    plant file, as far as this host sees. Without machines, --dry-run tries all that.
    """
    refuse_a_net(bundle, "what runs is a bundle", "firable run")
    options = HostOptions(**host)
    served = ServeOptions(serve, token_file, serve_tls, operators, open_)
    if open_ and not is_given("speed"):
        speed = "1"
    _refuse_combinations(options, served, say=say, speed=speed, step=step, plant=plant, watch=watch)

    def make() -> Report:
        from firable.cli.loop import read_machines_of
        from firable.cli.stepping import stepping
        from firable.executor import Watch, load
        from firable.executor.operating.conduct import Conduct
        from firable.executor.operating.running import SimulatedCell

        _demand_a_file(trace)
        loaded = load(bundle, trust)
        cell = plant_for(bundle, loaded.net.name) if plant is None and options.is_simulated else plant
        model = None if cell is None else read_machines_of(cell, loaded.net)
        if model is not None:
            _warn_of_other_machines(loaded, model)
        service = served.service(bundle, model)
        pace = 1.0 if options.bind is not None else _SPEEDS[speed]
        stepped: AbstractContextManager[Operator | None] = nullcontext()
        if step:
            stepped = stepping(pace, to_stderr=format_ == "json")
        with log_to(log) as told_to, stepped as operator:
            conduct = Conduct(
                trace=trace,
                journal_path=options.journal,
                resume=options.resume,
                said=_said(loaded.net, say),
                watch=Watch(watch),
                operator=operator,
                service=service,
                log=told_to,
            )
            if options.is_one_of_several:
                report = run_host_of(bundle, loaded, options, conduct, model)
            elif options.bind is not None:
                report = run_bound_of(bundle, loaded, options.bind, conduct, model)
            else:
                assert model is not None, "a simulated cell is made of its plant"
                simulated = SimulatedCell(model, workpieces, seed, _SPEEDS[speed])
                report = run_simulated_of(bundle, loaded, simulated, conduct)
        return replace(report, files=(trace,) if trace else ())

    return answer("run", format_, make, _show)


def _warn_of_other_machines(bundle: Bundle, model: PlantModel) -> None:
    """Tell where the machines are not those with which the bundle was proved."""
    from firable.nets.machines.fitting import otherwise_than
    from firable.nets.machines.plant_file import parse_plant

    if (sealed := bundle.evidence.get("plant.yaml")) is not None:
        for problem in otherwise_than(parse_plant(sealed), model):
            text.show_diagnostic(problem)


def _refuse_combinations(
    options: HostOptions,
    served: ServeOptions,
    *,
    say: tuple[str, ...],
    speed: str,
    step: bool,
    plant: str | None,
    watch: str,
) -> None:
    """Refuse options that do not go together, before any file is read."""
    if not options.is_one_of_several:
        options.refuse_alone()
    for name, is_said in (("--say", say), ("--resume", options.resume)):
        if is_said and options.journal is None:
            raise click.UsageError(f"{name} is of a run that is taken up: name its --journal")
    if (served.serve is not None or served.open) and _SPEEDS[speed] is None and options.is_simulated:
        raise click.UsageError(
            "in virtual time a run is over before anybody acts: with --serve or --open, name --speed 1 or 10"
        )
    for name in () if options.is_simulated else ("workpieces", "seed", "speed"):
        if is_given(name):
            raise click.UsageError(f"--{name} is of the simulated cell, which this run has not (--bind, --controller)")
    if options.is_one_of_several and step:
        raise click.UsageError("--step is of a whole run: on one host of several, `firable operate` steps (--serve)")
    is_watched = watch == "stop" or (watch == "tell" and is_given("watch"))
    if options.is_one_of_several and (plant is not None or is_watched) and options.bind is None:
        raise click.UsageError("--plant and --watch are of machines: say with --bind where those of this host are")
    if is_watched and plant is None and not options.is_simulated:
        raise click.UsageError(f"--watch {watch} holds the machines against a plant file: say with --plant which")


def _said(net: Net, say: tuple[str, ...]) -> dict[str, Answer]:
    """What the operator says of commands, by place."""
    from firable.executor.protocol.commands import SAID
    from firable.nets.diagnostics import with_meant

    said: dict[str, Answer] = {}
    for option in say:
        place, _, word = option.partition("=")
        commanding = [p.name for p in net.places if p.command is not None]
        if place not in commanding:
            message = f"--say {option}: no place '{place}' sends a command"
            raise click.UsageError(with_meant(message, place, commanding))
        if word not in SAID:
            raise click.UsageError(f"--say {option}: say {', '.join(SAID)}")
        if said.get(place, SAID[word]) is not SAID[word]:
            raise click.UsageError(f"--say {option}: something else is said of '{place}' too")
        said[place] = SAID[word]
    return said


def _demand_a_file(trace: str | None) -> None:
    """Refuse (F1017) a trace on standard output, where the report goes."""
    from firable.nets.diagnostics import Diagnostic, InputError

    if trace == "-":
        message = "-: the trace cannot go to standard output, where the report goes"
        raise InputError([Diagnostic("F1017", message, "name a file; one that is called so is ./-")])


def _show(report: Report) -> None:
    if "machines" in report.run:
        show_host(report)
    elif "binding" in report.run:
        show_bound(report)
    else:
        show_simulated(report)
