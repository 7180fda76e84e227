"""What several commands share: the NET argument, the options for budgets and formats, and where output goes."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from firable.cli.choice import OneOf
from firable.cli.files import CATALOGUE, OTHER_FILES, READ, WRITTEN, is_folder, nets_below, refuse_to_overwrite, stem
from firable.cli.finite import FiniteRange
from firable.cli.report import Outcome, Report, document, exit_code_of, worst
from firable.cli.text import show_diagnostic

if TYPE_CHECKING:
    from firable.analysis.spaces.reachability import Budget
    from firable.executor.drivers.binding import Binding
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.loading import Loaded
    from firable.nets.net import Net

F = TypeVar("F", bound=Callable[..., Any])

_MEBIBYTE = 2**20
_NO_NETS = "name a file, or a folder with files *.firable.yaml in it or below"

net_argument = click.argument("net", metavar="NET", type=READ)
format_option = click.option(
    "--format",
    "format_",
    type=OneOf(["text", "json"]),
    default="text",
    show_default=True,
    help="How to print the report; `firable schema report` prints the schema of the JSON.",
)


_WRITTEN = "firable.written"  # where the context of a command keeps what --write names


def _remember(context: click.Context, _: click.Parameter, value: tuple[tuple[str, str], ...]) -> None:
    if any(file == "-" for _, file in value):
        raise click.UsageError("--write is for files: what goes to standard output is named by --format")
    context.meta[_WRITTEN] = value


def formats_option(command: F) -> F:
    """The options of a command that other programs read: how its report is printed, and written to files beside it."""
    for option in (
        click.option(
            "--write",
            type=(OneOf(["json", "sarif", "junit"]), WRITTEN),
            multiple=True,
            metavar="FORMAT FILE",
            expose_value=False,
            callback=_remember,
            help="Also write the report to a file: json, sarif or junit; repeatable.",
        ),
        click.option(
            "--format",
            "format_",
            type=OneOf(["text", "json", "sarif", "junit", "github"]),
            default="text",
            show_default=True,
            help="How to print the report: as text, JSON (`firable schema report`), SARIF 2.1.0, JUnit, or text with "
            "the annotations of a GitHub workflow.",
        ),
    ):
        command = option(command)
    return command


page_option = click.option(
    "--report",
    "page",
    metavar="FILE",
    type=WRITTEN,
    help="Write the report as one HTML page, to read, print and send.",
)


def with_page(make: Callable[[], Report], path: str | None) -> Callable[[], Report]:
    """What makes a report, and its page as well where a file is named."""
    if path is None:
        return make
    if path == "-":
        raise click.UsageError("the page cannot go to standard output, where the report goes: name a file")

    def make_both() -> Report:
        from firable.cli.page.page import page_of

        report = replace(make(), page=path)
        write_text(path, page_of(report))
        return report

    return make_both


def demand_bound(bind: str | None, net: Net) -> tuple[Diagnostic, ...]:
    """What is to be told of a binding, if one is named; raises `InputError` as `binding_for` does."""
    return () if bind is None else binding_for(bind, net)[1]


def binding_for(bind: str, net: Net) -> tuple[Binding, tuple[Diagnostic, ...]]:
    """The binding of a net, and what is to be told of it; raises `InputError` (F5101, F5102) where it does not fit."""
    from firable.executor.drivers.fitting import misfits
    from firable.executor.drivers.unguarded import unguarded
    from firable.nets.diagnostics import InputError

    binding = binding_of(bind)
    if problems := misfits(binding, net):
        raise InputError(problems)
    return binding, tuple(unguarded(binding))


def binding_of(bind: str) -> Binding:
    """The binding of a file, telling of what in it is no secret."""
    from firable.executor.drivers.binding import read_binding

    binding = read_binding(bind)
    for problem in binding.exposed():
        show_diagnostic(problem)
    return binding


def warn_of_open_key(path: str) -> None:
    """Tell where the key of a certificate is no secret."""
    from firable.nets.secret_files import warning_if_open

    for problem in warning_if_open(path, "key"):
        show_diagnostic(problem)


def is_given(name: str) -> bool:
    """Whether the command line gives a parameter, which has a default, a value of its own."""
    return click.get_current_context().get_parameter_source(name) is ParameterSource.COMMANDLINE


def analysis_options(command: F) -> F:
    """The options of everything that explores a net."""
    for option in (
        click.option("--max-seconds", type=FiniteRange(min=0), metavar="SECONDS", help="Give up after so much time."),
        click.option(
            "--max-memory",
            type=click.IntRange(min=1),
            default=2048,
            show_default=True,
            metavar="MIB",
            help="Give up when the markings take so many MiB.",
        ),
        click.option(
            "--max-markings",
            type=click.IntRange(min=1),
            default=20_000_000,
            show_default=True,
            metavar="N",
            help="Give up after so many markings.",
        ),
    ):
        command = option(command)
    return command


def budget(max_markings: int, max_memory: int, max_seconds: float | None) -> Budget:
    """The budget that the options name."""
    from firable.analysis.spaces.reachability import Budget

    return Budget(max_markings, max_memory * _MEBIBYTE, max_seconds)


def load_net(argument: str) -> Loaded:
    """The net that an argument names, what of its file it does not carry, and where its parts stand in the file.

    The argument is a file (net file, PNML or bundle), `catalogue:NAME`, or `catalogue:FAMILY-N` for a net that no file
    holds. Raises `InputError` as the readers do.
    """
    from firable.nets.catalogue import catalogue_names, family_net
    from firable.nets.loading import Loaded, load

    if not argument.startswith(CATALOGUE):
        return load(argument)
    name = argument.removeprefix(CATALOGUE)
    if name in catalogue_names():
        loaded = load(catalogue_file(argument, ""))
        # Where it is installed says nothing to whoever wrote the argument; lines and columns are those of its file.
        return replace(loaded, positions=loaded.positions and loaded.positions.called(argument))
    try:
        return Loaded(family_net(name))
    except KeyError:
        raise click.UsageError(_not_in_catalogue(name)) from None
    except ValueError as error:
        raise click.UsageError(str(error)) from None


def load_found(argument: str) -> Loaded:
    """The net of an argument that `net_files` has found, or has left as it is; raises `InputError` as `load_net` does.

    A folder that was left has no net file below it, or is too large to be searched.
    """
    from firable.nets.diagnostics import Diagnostic, InputError

    if is_folder(argument) and not nets_below(argument):
        raise InputError([Diagnostic("F1001", f"no net file is in {argument}", _NO_NETS)])
    return load_net(argument)


def catalogue_file(argument: str, kind: str) -> Path:
    """The file of a `catalogue:NAME` argument; with `kind` "plant", its plant file."""
    from firable.nets.catalogue import catalogue_names, catalogue_path

    name = argument.removeprefix(CATALOGUE)
    if name not in catalogue_names():
        raise click.UsageError(_not_in_catalogue(name))
    path = catalogue_path(name)
    return path.with_name(f"{name}.plant.yaml") if kind == "plant" else path


def plant_found(argument: str, net_name: str) -> str | None:
    """The plant file of a net or bundle where no option names one: beside its file, or that of the catalogue's cell."""
    from firable.nets.catalogue import catalogue_names

    if not argument.startswith(CATALOGUE) and (beside := _plant_beside(argument)).is_file():
        return str(beside)
    name = net_name.replace("-", "_")
    is_there = name in catalogue_names() and catalogue_file(f"{CATALOGUE}{name}", "plant").exists()
    return f"{CATALOGUE}{name}" if is_there else None


def plant_for(argument: str, net_name: str) -> str:
    """The same for a command that needs a plant; it is a mistake of the command line where there is none."""
    found = plant_found(argument, net_name)
    if found is None:
        beside = "" if argument.startswith(CATALOGUE) else f"there is no {_plant_beside(argument)}, and "
        message = f"name the plant file of the cell with --plant: {beside}none in the catalogue is '{net_name}'"
        raise click.UsageError(message)
    return found


def _plant_beside(argument: str) -> Path:
    return Path(f"{stem(argument)}.plant.yaml")


def refuse_a_net(file: str, wanted: str, then: str = "") -> None:
    """A net is no bundle: say what is wanted instead, and how a bundle is made of it, for the command `then`."""
    from firable.nets.loading import PNML_SUFFIXES, TEXT_SUFFIXES

    for suffix, what in OTHER_FILES.items():
        if file.lower().endswith(suffix):
            raise click.UsageError(f"'{file}' is {what}, and {wanted}")
    if file.startswith(CATALOGUE) or Path(file).suffix.lower() in PNML_SUFFIXES | TEXT_SUFFIXES:
        bundle = f"{Path(file.removeprefix(CATALOGUE)).name.partition('.')[0] or 'net'}.bundle"
        made = f"firable bundle {shlex.quote(file)} -o {shlex.quote(bundle)}"
        raise click.UsageError(
            f"'{file}' is a net, and {wanted}: make a bundle by `{made}`"
            + (f", then `{then} {shlex.quote(bundle)}`" if then else "")
        )


def _not_in_catalogue(name: str) -> str:
    from firable.nets.catalogue import FAMILIES, catalogue_names
    from firable.nets.diagnostics import did_you_mean

    families = ", ".join(f"{family}-N" for family in FAMILIES)
    cells = ", ".join(catalogue_names())
    suggestion = did_you_mean(name, [*catalogue_names(), *FAMILIES])
    return f"the catalogue has no '{name}'; {suggestion}it has: {cells}; and for numbers N the families {families}"


def write_text(path: str, text: str) -> None:
    """Write a file whole or not at all, or to standard output for `-`; raises `InputError` F1017."""
    from firable.nets.writing import write_whole

    if path == "-":
        click.echo(text, nl=False)
    else:
        write_whole(path, text)


def write_folder(folder: str, files: Mapping[str, str | bytes]) -> tuple[str, ...]:
    """Write files into a folder, made if it is missing; returns their paths.

    Raises `InputError` F1017, before anything is written where a file is one that the command reads.
    """
    from firable.nets.writing import make_folder, write_whole

    paths = {str(Path(folder) / name): data for name, data in files.items()}
    refuse_to_overwrite(paths)
    make_folder(folder)
    for path, data in paths.items():
        write_whole(path, data)
    return tuple(paths)


def answer(
    command: str,
    format_: str,
    make: Callable[[], Report],
    show: Callable[[Report], None],
) -> int:
    """Make one report, print it, and return its exit code; a refused input is reported in the same format."""
    return answer_all(command, format_, [make], show)


def answer_all(
    command: str,
    format_: str,
    makers: Sequence[Callable[[], Report]],
    show: Callable[[Report], None],
) -> int:
    """Make several reports, printing each as text as soon as it is there, or all as one document of another format.

    Where nobody reads what is printed any more (`firable check ... | head`), the files that are asked for still are.
    """
    from firable.cli.text import show_diagnostics
    from firable.nets.diagnostics import InputError

    written: Sequence[tuple[str, str]] = click.get_current_context().meta.get(_WRITTEN, ())
    reports: list[Report] = []
    errors: list[Diagnostic] = []
    as_text = format_ in {"text", "github"}
    unread: BrokenPipeError | None = None

    def tell(print_: Callable[[], None]) -> None:
        nonlocal unread
        try:
            print_()
        except BrokenPipeError as error:
            if not written:
                raise
            unread = error

    for make in makers:
        try:
            report = make()
        except InputError as error:
            errors += error.diagnostics
            if as_text:
                tell(partial(show_diagnostics, error.diagnostics))
            continue
        reports.append(report)
        if as_text and unread is None:
            tell(partial(show, report))
    code = worst([*(report.exit_code for report in reports), *map(exit_code_of, errors)])
    outcome = Outcome(command, reports, errors, code)
    for kind, file in written:
        write_text(file, _rendered(kind, outcome))
    if unread is not None:
        raise unread
    if format_ != "text":
        click.echo(_rendered(format_, outcome), nl=False)
    return code


def _rendered(format_: str, outcome: Outcome) -> str:
    """The outcome of a command in a format that programs read."""
    match format_:
        case "sarif":
            from firable.cli.formats.sarif import sarif

            return sarif(outcome)
        case "junit":
            from firable.cli.formats.junit import junit

            return junit(outcome)
        case "github":
            from firable.cli.formats.github import github

            return github(outcome)
        case _:
            import json

            data = document(outcome.command, outcome.reports, outcome.errors, outcome.exit_code)
            with _all_digits():
                text = json.dumps(data, indent=2, ensure_ascii=False) + "\n"
            # The bytes of a file's name that are no UTF-8 stand as escapes, as they would in ASCII.
            return text.encode(errors="backslashreplace").decode()


@contextmanager
def _all_digits() -> Iterator[None]:
    """Let numbers of any length be written: of the markings that a diagram holds, which no input names."""
    longest = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(0)
    try:
        yield
    finally:
        sys.set_int_max_str_digits(longest)
