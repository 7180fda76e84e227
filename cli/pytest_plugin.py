"""A pytest plugin: each `*.firable.yaml` is a file of tests, one for each verdict that matters.

A test is what must hold of every net (`deadlock-free`), a property of the file, or what its `expect:` names; so a test
can be selected, deselected and reported as any other. All tests of a file share one check, made when the first of them
runs, so that collecting stays quick. A net that cannot be read is an error of the collection. Unknown fails.

pytest loads this module in every project where firable is installed: until it meets a net, nothing else of it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

if TYPE_CHECKING:
    from firable.nets.loading import Loaded
    from firable.nets.verdict import Verdict

_SUFFIXES = (".firable.yaml", ".firable.yml")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Tell pytest the settings of an ini file."""
    parser.addini("firable_collect", "Collect net files (*.firable.yaml) as tests.", type="bool", default=True)
    parser.addini("firable_max_seconds", "Give up on a net after so many seconds; what is unknown fails.", default="")


def pytest_configure(config: pytest.Config) -> None:
    """Refuse a setting that is none, once and before any test."""
    _seconds_max(config)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> NetFile | None:
    """Collect a net file."""
    if not file_path.name.endswith(_SUFFIXES) or not parent.config.getini("firable_collect"):
        return None
    return NetFile.from_parent(parent, path=file_path)


def _seconds_max(config: pytest.Config) -> float | None:
    """How long a net is checked; raises `pytest.UsageError` where the setting is no number of seconds."""
    given = config.getini("firable_max_seconds")
    if not given:
        return None
    try:
        seconds = float(given)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < inf:
        raise pytest.UsageError(f"firable_max_seconds: '{given}' is no number of seconds")
    return seconds


class NetFile(pytest.File):
    """The tests of one net file."""

    @cached_property
    def loaded(self) -> Loaded:
        """The net; raises `InputError` as its reader does."""
        from firable.nets.loading import load

        return load(self.path)

    @cached_property
    def verdicts(self) -> dict[str, Verdict]:
        """What `firable check` says of the net, held to what the file expects."""
        from firable.analysis.check import check
        from firable.analysis.cures.finding import explained
        from firable.analysis.spaces.reachability import Budget
        from firable.nets.verdict import held_to

        with self.loaded.placing():
            verdicts = explained(check(self.loaded.net, budget=Budget(seconds=_seconds_max(self.config))))
            return {verdict.name: verdict for verdict in held_to(self.loaded.net.expected, verdicts)}

    def collect(self) -> Iterator[NetTest]:
        """One test for each verdict that matters."""
        from firable.nets.diagnostics import InputError
        from firable.nets.right_to_run import required_of_the_net

        try:
            net = self.loaded.net
        except InputError as error:
            raise self.CollectError(str(error)) from None
        with_machines = ("loop.", "fault.")
        expected = (one.verdict for one in net.expected if not one.verdict.startswith(with_machines))
        for name in dict.fromkeys((*required_of_the_net(net), *expected)):
            yield NetTest.from_parent(self, name=name)


class NotAsItShouldBeError(AssertionError):
    """A verdict that matters and is violated, has changed, or is unknown."""

    def __init__(self, verdict: Verdict) -> None:
        super().__init__(verdict.name)
        self.verdict = verdict


class _Headline(NamedTuple):
    """What pytest calls the crash of a test: in CI its summary shows all of the message, so it is one line."""

    message: str


@dataclass(frozen=True)
class _Story:
    """The story of a verdict, in a form that pytest prints; its summary and JUnit's message have the first line."""

    lines: tuple[str, ...]

    @property
    def reprcrash(self) -> _Headline:
        return _Headline(self.lines[0])

    def toterminal(self, writer: Any) -> None:
        writer.line(str(self))

    def __str__(self) -> str:
        return "\n".join(self.lines)


class NetTest(pytest.Item):
    """One verdict on a net."""

    parent: NetFile

    def runtest(self) -> None:
        """Look how the verdict has ended."""
        from firable.nets.verdict import Status

        verdict = self.parent.verdicts[self.name]
        if verdict.outcome is not Status.PROVED:
            raise NotAsItShouldBeError(verdict)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *args: Any, **options: Any) -> Any:
        """Tell the story of the verdict, as `firable check` does; of a refused input, what is wrong with it."""
        import click

        from firable.cli.text import reasons, verdict_line
        from firable.nets.diagnostics import InputError

        match excinfo.value:
            case NotAsItShouldBeError(verdict=verdict):
                return _Story((click.unstyle(verdict_line(verdict)).strip(), *reasons(self.parent.loaded.net, verdict)))
            case InputError() as error:
                return str(error)
            case ModuleNotFoundError(name=name):
                return f"checking needs '{name}', which is not installed: pip install 'firable[prove]'"
            case _:
                return super().repr_failure(excinfo, *args, **options)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """The file, the line (from 0) of what the verdict is about, and the name of the test."""
        positions = self.parent.loaded.positions
        line = None
        if positions is not None:
            of_property = ("properties", self.name.removeprefix("property."))
            span = positions.of("expect", self.name) or positions.of(*of_property) or positions.whole
            line = span.line - 1
        return self.path, line, f"{self.path.name}: {self.name}"
