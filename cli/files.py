"""The files that a command line names: what is read, what is written, and that no output is written over either.

An option says by its type which it is, and a command has nothing to remember: each file is compared with those named
before it while the command line is read, so before anything is read or written. Two names are one file where the file
system says so, over links of both kinds. What is written into a folder is named after what was found, and compared when
that is known, before any of it is written (`refuse_to_overwrite`). And no output may have the name of a net, a plant
file or a binding unless it is one: what people write is not written over by something else.

Rejected: a list in each command of what it reads. The next option is missing in it, and a net is lost.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import click

if TYPE_CHECKING:
    from firable.nets.diagnostics import InputError

CATALOGUE: Final = "catalogue:"
NET_FILES: Final = (".firable.yaml", ".firable.yml")
OTHER_FILES: Final = {
    ".plant.yaml": "a plant file",
    ".bind.yaml": "a binding",
    ".tasks.yaml": "a file of tasks",
    ".layout.yaml": "a layout file",
    ".signatures": "a file of signatures",
    ".key": "a secret key",
    ".pub": "a public key",
    ".pem": "a certificate or a key",
}
"""What else people keep, by the suffix of its name."""
BUNDLES: Final = {".bundle": "a bundle"}
"""What `firable bundle` alone writes."""
FOLDERS_MAX: Final = 20_000
"""So many folders are searched for net files, in about a second: more than projects have, and less than disks."""
_INSTALLED: Final = frozenset({"node_modules"})  # virtual environments are known by what is in them
_NAMED: Final = "firable.files"  # where the context of a command keeps the files named so far


def net_files(arguments: Sequence[str]) -> tuple[str, ...]:
    """The arguments, with every folder replaced by the net files below it, in the order of their names.

    What cannot be read stays, for who loads it to refuse: a folder without a net file, one that may not be looked into,
    one with too many folders below it.
    """
    from firable.nets.diagnostics import InputError

    found: list[str] = []
    for argument in arguments:
        try:
            below = sorted(nets_below(argument))
        except InputError:
            below = []
        found += [str(path) for path in below] or [argument]
    return tuple(found)


def nets_below(argument: str) -> list[Path]:
    """The net files of a project, and the folders that may not be looked into; none where the argument is no folder.

    There are none in hidden folders, nor in what is installed there, which has a catalogue. Raises `InputError` F1001
    where more folders are below than a project has: whoever names a whole disk did not mean all of it.
    """
    if not is_folder(argument):
        return []
    refused: list[OSError] = []
    found: list[Path] = []
    for n_folders, (here, folders, files) in enumerate(os.walk(argument, onerror=refused.append), 1):
        if n_folders > FOLDERS_MAX:
            raise _too_many_folders(argument)
        if "pyvenv.cfg" in files and here != argument:
            folders.clear()
            continue
        folders[:] = [one for one in folders if not one.startswith(".") and one not in _INSTALLED]
        found += (path for one in files if one.endswith(NET_FILES) and _is_there(path := Path(here, one)))
    return [*found, *(Path(error.filename) for error in refused)]


def _too_many_folders(argument: str) -> InputError:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    message = f"{printable(argument)}: more than {FOLDERS_MAX:,} folders are below it, and are not searched for nets"
    return InputError([Diagnostic("F1001", message, "name the folder of a project, or net files")])


def _is_there(path: Path) -> bool:
    """Whether a name in a folder stands for a file, and for no pipe and no broken link; or that cannot be told."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return False
    except OSError:
        return True


def is_folder(argument: str) -> bool:
    """Whether an argument names a folder."""
    try:
        return not argument.startswith(CATALOGUE) and Path(argument).is_dir()
    except OSError:  # a name that no file can have
        return False


def journal_files(journal: str) -> tuple[str, ...]:
    """The files of a journal, those that SQLite makes beside it among them."""
    return tuple(
        f"{journal}{suffix}" for suffix in ("", ".cell", ".generation", ".taken-over", "-wal", "-shm", "-journal")
    )


def stem(argument: str) -> str:
    """The name of a net or bundle without its suffix, by which what belongs to it is called.

    >>> stem("cells/cell.firable.yaml"), stem("cell.bundle")
    ('cells/cell', 'cell')
    """
    return argument.removesuffix(next(filter(argument.endswith, NET_FILES), Path(argument).suffix))


def _beside(argument: str) -> Iterator[str]:
    """What stands beside a net or bundle and is found there, unnamed."""
    for name in (f"{stem(argument)}.plant.yaml", f"{stem(argument)}.layout.yaml", f"{argument}.signatures"):
        with suppress(OSError, ValueError):  # a name that no file can have
            if Path(name).is_file():
                yield name


def _read(argument: str) -> Iterable[str]:
    """The files that are read where a file or `catalogue:NAME` is named, with what is found beside it."""
    if not argument.startswith(CATALOGUE):
        return (argument, *_beside(argument))
    from firable.nets.catalogue import catalogue_names, catalogue_path

    name = argument.removeprefix(CATALOGUE)
    if name not in catalogue_names():
        return ()
    return str(catalogue_path(name)), str(catalogue_path(name).with_name(f"{name}.plant.yaml"))


def _read_below(argument: str) -> Iterable[str]:
    """The same where a folder stands for the net files below it."""
    return [file for net in net_files([argument]) for file in _read(net)]


def _written(argument: str) -> Iterable[str]:
    return () if argument == "-" else (argument,)


def _later(_: str) -> Iterable[str]:
    return ()


class FileType(click.types.StringParamType):
    """The type of options and arguments that name files: which those are, and whether they are written."""

    def __init__(
        self,
        files: Callable[[str], Iterable[str]],
        *,
        is_written: bool,
        never: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.files = files
        self.is_written = is_written
        self.never = never
        """What it never is, by the suffix of its name."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name as it is.

        Raises `InputError` F1017 where an output would overwrite another file of the command, or is named like what
        people write.
        """
        argument: str = super().convert(value, param, ctx)
        if param is not None and ctx is not None:
            named = _Named(param.opts[0], argument, self)
            known: list[_Named] = ctx.meta.setdefault(_NAMED, [])
            for other in known:
                if self.is_written:
                    _compare(named.by, named.files, other)
                elif other.is_written:
                    _compare(other.by, other.files, named)
            known.append(named)
            self._refuse_what_it_never_is(argument, param.opts[0])
        return argument

    def _refuse_what_it_never_is(self, argument: str, by: str) -> None:
        from firable.nets.diagnostics import Diagnostic, InputError
        from firable.nets.source import printable

        for suffix, what in self.never.items():
            if argument.lower().endswith(suffix):
                message = f"{printable(argument)}: that is the name of {what}, which {by} does not write"
                raise InputError([Diagnostic("F1017", message, "name another file")])


READ: Final = FileType(_read, is_written=False)
"""A file that is read, or `catalogue:NAME`."""
NETS: Final = FileType(_read_below, is_written=False)
"""Such a file, or a folder, which stands for the net files below it."""
_NO_NET: Final = OTHER_FILES | dict.fromkeys(NET_FILES, "a net file")
WRITTEN: Final = FileType(_written, is_written=True, never=_NO_NET | BUNDLES)
"""A file that is written, over what stands there; - is standard output."""
WRITTEN_BUNDLE: Final = FileType(_written, is_written=True, never=_NO_NET)
"""A bundle that is written, over what stands there."""
WRITTEN_NET: Final = FileType(_written, is_written=True, never=OTHER_FILES | BUNDLES)
"""A net that is written, over what stands there."""
FOLDER: Final = FileType(_later, is_written=True)
"""A folder that files are written into, whose names are known later."""
JOURNAL: Final = FileType(journal_files, is_written=True)
"""The journal of a run, with what stands beside it."""
OLD_JOURNAL: Final = FileType(journal_files, is_written=False)
"""Such a journal that is read alone."""
MADE: Final = FileType(_later, is_written=True)
"""A file that is written only where no other stands, as whoever makes it sees to."""


def refuse_to_overwrite(files: Iterable[str]) -> None:
    """Raise `InputError` F1017 where one of these files, which no option names, is read or is another output."""
    written = tuple(files)
    for other in click.get_current_context().meta.get(_NAMED, ()):
        _compare("what is written there", written, other, "name another folder")


@dataclass(frozen=True)
class _Named:
    """What one option or argument names."""

    by: str
    argument: str
    type: FileType

    @property
    def is_written(self) -> bool:
        return self.type.is_written

    @cached_property
    def files(self) -> tuple[str, ...]:
        return tuple(self.type.files(self.argument))

    @cached_property
    def identities(self) -> frozenset[str | tuple[int, int]]:
        """By what each of the files is known."""
        return frozenset(identity for file in self.files for identity in _identities(file))


def _compare(by: str, files: Iterable[str], other: _Named, hint: str = "name another file") -> None:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    for file in files:
        if not other.identities.isdisjoint(_identities(file)):
            another = "another " if other.by == by else ""
            whom = f"{another}{other.by} writes" if other.is_written else "the command reads"
            message = f"{printable(file)}: {by} would overwrite what {whom}"
            raise InputError([Diagnostic("F1017", message, hint)])


def _identities(file: str) -> Iterator[str | tuple[int, int]]:
    """By what a file is known, over links of both kinds: where its name leads, and its place on the disk."""
    with suppress(OSError, ValueError):  # a name that no file can have, as is told of then
        yield os.path.realpath(file)
        status = Path(file).stat()
        yield status.st_dev, status.st_ino
