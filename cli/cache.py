"""What `check` found before: reports kept by the content of the net, so that a net that has not changed is not checked.

The key is a hash over the net without its descriptions, over all that the caller asked for, over the program itself
(the size and time of each of its files), and over the versions of the libraries that take part in an answer, so that
an answer never outlives the code that gave it. Comments, layout and the bindings to hardware are in none of these:
changing them keeps the answer. Only decided reports are kept: an unknown may be known with another budget, or on a
faster day; and none that Ctrl-C ended, of which figures or cures may be missing.

What is read back carries a checksum, and what does not fit it is no answer: it is computed anew. The cache is for the
one who runs `check` again and again; a bundle is never made from it.

Rejected: keeping the state space itself. It is a thousand times larger, and quicker to compute than to read.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from firable.nets.net import Net
    from firable.nets.verdict import Verdict

VARIABLE: Final = "FIRABLE_CACHE"
"""Names the folder of the cache; empty switches it off."""
LIBRARIES: Final = ("numpy", "networkx", "highspy", "z3-solver")
"""What takes part in answers, as it is called where it comes from."""
_ENTRIES_MAX: Final = 1000
_INTERRUPTED: Final = "interrupted"  # so the course of a report tells of Ctrl-C


@dataclass(frozen=True, slots=True)
class Kept:
    """What a report is made from."""

    verdicts: tuple[Verdict, ...]
    figures: Mapping[str, Any]
    course: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Cache:
    """A folder of reports; every failure to read or write it is as if there were none."""

    folder: Path

    def read(self, key: str) -> Kept | None:
        """What is kept under a key; None where there is nothing, or nothing whole."""
        from pydantic import ValidationError

        from firable.cli.kept_records import KeptRecord

        try:
            checksum, _, text = (self.folder / key).read_text(encoding="utf-8").partition("\n")
            if checksum != _sha256(text):
                return None
            kept = KeptRecord.model_validate_json(text)
            verdicts = tuple(record.verdict() for record in kept.verdicts)
            return Kept(verdicts, json.loads(text)["figures"], tuple(kept.course))
        except (OSError, ValueError, RecursionError, ValidationError):
            return None

    def write(self, key: str, found: Kept) -> None:
        """Keep what was found, unless some of it is unknown or was interrupted; the oldest of a thousand makes room."""
        from firable.nets.diagnostics import InputError
        from firable.nets.verdict import Status
        from firable.nets.writing import make_folder, write_whole

        cut_short = found.figures.get("structure", {}).get("ended_early") or _INTERRUPTED in found.course
        if cut_short or any(verdict.status is Status.UNKNOWN for verdict in found.verdicts):
            return
        data = {
            "verdicts": [verdict.to_json() for verdict in found.verdicts],
            "figures": found.figures,
            "course": list(found.course),
        }
        try:
            text = json.dumps(data, ensure_ascii=False)
            make_folder(self.folder)
            write_whole(self.folder / key, f"{_sha256(text)}\n{text}")
            entries = sorted(self.folder.iterdir(), key=lambda entry: entry.stat().st_mtime)
            for entry in entries[:-_ENTRIES_MAX]:
                entry.unlink(missing_ok=True)
        except (InputError, OSError, ValueError):
            # A full disk, a folder of somebody else's, a number of too many digits: no reason to fail a check.
            return


def opened_cache() -> Cache | None:
    """The cache of this user, or the one that `FIRABLE_CACHE` names; None where that is empty."""
    named = os.environ.get(VARIABLE)
    if named is not None:
        return Cache(Path(named)) if named else None
    from platformdirs import user_cache_path

    return Cache(user_cache_path("firable"))


def key_of(net: Net, asked: Mapping[str, Any]) -> str:
    """The key of a net and of what is asked about it (JSON values).

    >>> from firable.nets.net import Net, Place
    >>> key_of(Net("n", (Place("p", description="a place"),)), {}) == key_of(Net("n", (Place("p"),)), {})
    True
    """
    from firable.nets.interchange import net_digest

    content = [net_digest(net), dict(asked), _program(), _libraries()]
    return _sha256(json.dumps(content, sort_keys=True))


def _libraries() -> list[str]:
    """The libraries, each with its version; without one where it came otherwise than as a package."""
    from importlib.metadata import PackageNotFoundError, version

    found = []
    for name in LIBRARIES:
        with suppress(PackageNotFoundError):
            found.append(f"{name} {version(name)}")
    return found


def _program() -> list[list[Any]]:
    """The files of the program, each with its size and time of change."""
    import firable

    root = Path(firable.__file__).parent
    files = sorted(file for name in ("nets", "semantics", "analysis", "cli") for file in _modules(root / name))
    return [[str(file.relative_to(root)), file.stat().st_size, file.stat().st_mtime_ns] for file in files]


def _modules(package: Path) -> Iterator[Path]:
    """The modules of a package; a folder that is none, such as that of the engine's source, is not looked into."""
    if (package / "__init__.py").is_file():
        for path in package.iterdir():
            if path.suffix in {".py", ".so", ".pyd"}:
                yield path
            elif path.is_dir():
                yield from _modules(path)


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
