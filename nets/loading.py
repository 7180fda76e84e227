"""Reading a net from whatever file it is in.

A bundle is known by its first bytes, which no text begins with. Of the text formats the extension tells which it is;
where it does not, the first character does, because XML begins with `<` and a net file does not. Guessing from the
content alone would let a broken PNML file be reported as broken YAML. A reader is loaded for who has such a file: the
document that net files are checked by takes as long to load as a small net to check.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from firable.nets.diagnostics import Diagnostic, InputError

if TYPE_CHECKING:
    from firable.nets.decomposition import Decomposition
    from firable.nets.net import Net
    from firable.nets.text_positions import Positions

PNML_SUFFIXES: Final = frozenset({".pnml", ".xml", ".tapn"})
TEXT_SUFFIXES: Final = frozenset({".yaml", ".yml"})


@dataclass(frozen=True)
class Loaded:
    """A net, what of its file it does not carry (nothing, for a net file), and where its parts stand in the file.

    `renamed` holds the names that the net has for identifiers of a PNML file that are no names here; `decomposition` is
    what a bundle says of it.
    """

    net: Net
    notes: tuple[Diagnostic, ...] = ()
    positions: Positions | None = None
    renamed: Mapping[str, str] = field(default_factory=dict)
    decomposition: Decomposition | None = None

    @contextmanager
    def placing(self) -> Generator[None]:
        """Give the problems that are found with the net in this block their positions in its file."""
        try:
            yield
        except InputError as error:
            raise InputError(self.placed(error.diagnostics)) from None

    def placed(self, diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
        """What was found with the net, with the positions in its file."""
        return tuple(diagnostics if self.positions is None else self.positions.place(diagnostics))


def load(path: str | Path) -> Loaded:
    """Read a net file, PNML, or the net of a bundle.

    Raises `InputError` as `read_net`, `read_pnml` and `read_bundle` do.
    """
    from firable.nets.archive import SIGNATURE

    head = _head(path)
    if head.startswith(SIGNATURE):
        from firable.nets.bundle import read_bundle

        bundle = read_bundle(path)
        return Loaded(bundle.net, decomposition=bundle.decomposition)
    suffix = Path(path).suffix.lower()
    if suffix in PNML_SUFFIXES or (suffix not in TEXT_SUFFIXES and _looks_like_xml(head)):
        from firable.nets.pnml import read_pnml

        imported = read_pnml(path)
        return Loaded(imported.net, imported.notes, renamed=imported.renamed)
    from firable.nets.text import read_positioned

    net, positions = read_positioned(path)
    return Loaded(net, positions=positions)


def is_bundle(path: str | Path) -> bool:
    """Whether a file begins as bundles do, and no text does."""
    from firable.nets.archive import SIGNATURE

    return _head(path).startswith(SIGNATURE)


def _head(path: str | Path) -> bytes:
    """The first bytes of a file; none where it cannot be read, which the reader finds again and says well."""
    try:
        # A pipe would wait here for its other side.
        if not Path(path).is_file():
            return b""
        with Path(path).open("rb") as stream:
            return stream.read(512)
    except (OSError, ValueError):
        return b""


def _looks_like_xml(head: bytes) -> bool:
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
