"""The command `firable`, and what every ending of it means.

Exit codes: 0 all hold, 1 a property is violated, 2 usage or input error, 3 unknown or out of budget, 4 internal error.
Unknown never passes. Whatever an input does, the answer is one clear error; a traceback is our own fault and shown only
to who asks for it (`--traceback`).

A command is loaded when it is named, and imports what it needs when it runs: `firable --help` loads neither pydantic
nor a solver.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Sequence
from copy import copy
from importlib import import_module
from typing import TextIO

import click

from firable import __version__
from firable.cli.report import ExitCode, exit_code_of, worst
from firable.cli.text import show_diagnostics

EXTRAS = {
    **dict.fromkeys(
        ("z3", "networkx", "numpy", "highspy", "platformdirs", "junitparser"),
        ("prove", "all that checking and proving need"),
    ),
    "mtkahypar": ("split", "what looks for owners of large nets"),
    **dict.fromkeys(
        ("aiohttp", "prometheus_client"),
        ("serve", "what lets an operator act from elsewhere, and what serves the page"),
    ),
    **dict.fromkeys(("pygls", "lsprotocol"), ("lsp", "what serves net files to an editor")),
    "zenoh": ("zenoh", "the link between hosts over a network"),
    "serial": ("serial", "what serial lines need"),
    "pymodbus": ("modbus", "what Modbus devices need"),
    "asyncua": ("opcua", "what OPC UA servers need"),
    "aiomqtt": ("mqtt", "what devices behind an MQTT broker need"),
    "cryptography": ("sign", "what signs bundles and checks signatures"),
    "cvc5": ("verify", "the second solver; or ask the first one: --solver z3"),
}

COMMANDS = {
    "bundle": "bundle.bundle",
    "check": "check.check",
    "ci": "ci.ci",
    "convert": "convert.convert",
    "draw": "draw.draw",
    "explain": "explain.explain",
    "io": "live_io.live_io",
    "lsp": "lsp.command.lsp",
    "operate": "operate.operate",
    "prove": "prove.prove",
    "refine": "refine.refine",
    "rehearse": "rehearse.rehearse",
    "replay": "replay.replay",
    "run": "run.run",
    "schema": "schema.schema",
    "sign": "sign.sign",
    "sim": "sim.sim",
    "split": "split.split",
    "takeover": "takeover.takeover",
    "timeline": "timeline.command.timeline",
    "verify": "verify.verify",
    "view": "view.command.view",
}
"""The commands, each with its function in `firable.cli`."""

MAY_BE_EMPTY = frozenset({"marking"})
"""The arguments that name no thing: the marking without a token is one."""


class _Commands(click.Group):
    """Commands that are loaded when they are named: all of them take longer to load than a small net to check."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - as click calls it
        """The names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - as click calls it
        """The command of a name, if there is one."""
        if cmd_name not in COMMANDS:
            return None
        module, _, function = COMMANDS[cmd_name].rpartition(".")
        command: click.Command = getattr(import_module(f"firable.cli.{module}"), function)
        return _demanding(command)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that is named; raises `click.UsageError` with the one that was probably meant."""
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            from firable.nets.diagnostics import with_meant

            ctx.fail(with_meant(f"No such command '{args[0]}'.", args[0], list(COMMANDS)))
        return super().resolve_command(ctx, args)


def _demanding(command: click.Command) -> click.Command:
    """A command, or a group of them, that demands what `_Demanding` does."""
    if not isinstance(command, click.Group):
        return _Demanding(command)
    demanding = copy(command)
    demanding.commands = {name: _demanding(one) for name, one in command.commands.items()}
    return demanding


class _Demanding(click.Command):
    """A command that refuses an empty argument, as a path that would be the folder in which the command runs, and an
    option that is given twice and has one value, of which click takes the last."""

    def __init__(self, command: click.Command) -> None:
        super().__init__(command.name)
        vars(self).update(vars(command))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read what the command is given; raises `click.UsageError`."""
        _, _, given = self.make_parser(ctx).parse_args(list(args))
        rest = super().parse_args(ctx, args)
        if ctx.resilient_parsing:  # a line that a shell is about to complete
            return rest
        for parameter in self.params:
            if isinstance(parameter, click.Option) and _has_one_value(parameter) and given.count(parameter) > 1:
                raise click.BadParameter("it is given more than once, and has one value", ctx, parameter)
            value = ctx.params.get(parameter.name or "")
            if _is_empty(value) and value != parameter.default and parameter.name not in MAY_BE_EMPTY:
                raise click.BadParameter("it is empty", ctx, parameter)
        return rest


def _has_one_value(option: click.Option) -> bool:
    """Whether an option says one thing of several: neither a list nor a flag that is up however often it is given."""
    return not option.multiple and not (option.is_flag and not option.secondary_opts)


def _is_empty(value: object) -> bool:
    return value == "" or (isinstance(value, tuple) and any(map(_is_empty, value)))


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, message="%(prog)s %(version)s")
@click.option("--traceback", is_flag=True, help="Show the traceback of an internal error.")
@click.pass_context
def firable(context: click.Context, traceback: bool) -> None:  # noqa: ARG001 - read from the context by `main`
    """Check, prove, split and run the control of robotic cells, written as extended Petri nets.

    A NET is a net file (*.firable.yaml), PNML, a bundle, or catalogue:NAME for an example, such as catalogue:one_robot.
    catalogue:FAMILY-N is the net of size N of a family, such as catalogue:philosophers-5; a wrong name lists them all.

    Exit codes: 0 all hold, 1 a property is violated, 2 usage or input error, 3 unknown or out of budget, 4 internal
    error.
    """
    if os.environ.get("NO_COLOR"):
        context.color = False


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by who started us, and wants nothing of it
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no '✓' shows '?' instead of failing
    try:
        return _run(arguments)
    except OSError:  # standard error cannot be written either: nothing is told, and the exit code is not success
        _to_nowhere(sys.stderr)
        return ExitCode.INPUT_ERROR


def _run(arguments: Sequence[str]) -> int:
    streams = sys.stdout, sys.stderr
    try:
        code = firable.main(arguments, prog_name="firable", standalone_mode=False)
        sys.stdout.flush()
    except BrokenPipeError:
        return _unread()
    except SystemExit:
        if sys.stdout is streams[0]:  # it has told a shell how to complete a line
            raise
        sys.stdout, sys.stderr = streams  # click ends so on a broken pipe, by the code of what is violated
        return _unread()
    except Exception as error:  # the edge of the program: every ending becomes an exit code and a message
        return _ended_by(error, arguments)
    return int(code or 0)


def _is_hung_up(stream: TextIO) -> bool:
    """Whether a stream is a terminal that was closed at its other side, as another device, /dev/null, never is."""
    import termios

    try:
        termios.tcgetattr(stream.fileno())
    except termios.error as error:
        return bool(error.args[0] == errno.EIO)
    except (OSError, ValueError):
        return False
    return False


def _unread() -> int:
    """Whoever read our output has gone (`firable ... | head`). What is still buffered has no reader."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            if error.errno not in {errno.EPIPE, errno.EIO}:
                raise
            _to_nowhere(stream)
    return ExitCode.UNKNOWN


def _to_nowhere(stream: TextIO) -> None:
    """Let what a stream still holds, which its other side does not take, go nowhere when the process ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _ended_by(error: Exception, arguments: Sequence[str]) -> int:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.writing import FULL

    match error:
        case click.exceptions.NoArgsIsHelpError():
            error.show()
            return ExitCode.INPUT_ERROR
        case click.Abort() | RuntimeError(__cause__=KeyboardInterrupt()):  # Python 3.11 wraps what a class body raises
            click.echo("interrupted: nothing is known yet", err=True)
            return ExitCode.UNKNOWN
        case click.ClickException():
            error.show()
            return ExitCode.INPUT_ERROR
        case InputError():
            show_diagnostics(error.diagnostics)
            return worst(map(exit_code_of, error.diagnostics))
        case ModuleNotFoundError() if error.name and error.name.partition(".")[0] in EXTRAS:
            extra, what = EXTRAS[error.name.partition(".")[0]]
            click.echo(
                f"error: this command needs '{error.name}', which is not installed\n"
                f"  hint: pip install 'firable[{extra}]' installs {what}",
                err=True,
            )
            return ExitCode.INPUT_ERROR
        case OSError(errno=errno.EIO, filename=None) if _is_hung_up(sys.stdout):
            _to_nowhere(sys.stdout)
            return _unread()
        case OSError() if error.filename is None and error.errno in FULL:
            # Whoever writes a file has said which: this is what is printed.
            _to_nowhere(sys.stdout)
            message = f"standard output cannot be written: {error.strerror}"
            show_diagnostics([Diagnostic("F1017", message, "make room where it goes, or send it elsewhere")])
            return ExitCode.INPUT_ERROR
        case MemoryError():
            click.echo("unknown: the memory of this machine is used up\n  hint: --max-memory sets a bound", err=True)
            return ExitCode.UNKNOWN
    if "--traceback" in arguments:
        import traceback

        traceback.print_exception(error)
    click.echo(
        f"error[F9001]: internal error: {type(error).__name__}: {error}\n"
        "  hint: this is our fault, not yours; please report it with the output of `firable --traceback ...`",
        err=True,
    )
    return ExitCode.INTERNAL_ERROR


if __name__ == "__main__":
    sys.exit(main())
