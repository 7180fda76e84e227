"""A serial line without wires: two pseudo-terminals, with bytes carried between them by the event loop.

The ends are named by paths, as serial ports are, so that the code under test opens them as it would open a port. The
system chooses the names; where a binding has chosen one, a symbolic link leads from there to the near end. What goes in
while the line is cut is lost.
"""

from __future__ import annotations

import asyncio
import os
import tty
from contextlib import suppress
from pathlib import Path

from firable.executor.reasons import reason


class PseudoLine:
    """A line with the ports `near` and `far`, once it is open; a `link` leads to `near` then."""

    def __init__(self, link: str = "") -> None:
        self.link = link
        self.near = ""
        self.far = ""
        self.passes = True
        self.masters: tuple[int, ...] = ()
        self.slaves: tuple[int, ...] = ()
        """Held open, so that a port that is closed and opened again finds the line as it was."""

    def open(self) -> None:
        """Make the line, if it is not there yet; must be called while the event loop runs that carries the bytes.

        Raises `OSError` where the link cannot be made, as something stands there.
        """
        if self.masters:
            return
        near_master, near_slave = os.openpty()
        far_master, far_slave = os.openpty()
        self.masters, self.slaves = (near_master, far_master), (near_slave, far_slave)
        for descriptor in self.slaves:
            tty.setraw(descriptor)
        self.near, self.far = os.ttyname(near_slave), os.ttyname(far_slave)
        loop = asyncio.get_running_loop()
        for source, target in ((near_master, far_master), (far_master, near_master)):
            os.set_blocking(source, False)
            loop.add_reader(source, self._carry, source, target)
        if self.link:
            link = Path(self.link)
            try:
                if link.is_symlink() and _is_left_behind(link.readlink(), self.near):
                    link.unlink()
                link.symlink_to(self.near)
            except OSError as error:
                self.close()
                raise OSError(f"{self.link} cannot be made to lead to a line: {reason(error)}") from error

    def close(self) -> None:
        """Take the line away, and the link that leads to it."""
        link = Path(self.link)
        if self.masters and link.is_symlink() and link.readlink() == Path(self.near):
            link.unlink()
        for descriptor in self.masters:
            asyncio.get_running_loop().remove_reader(descriptor)
        for descriptor in (*self.masters, *self.slaves):
            os.close(descriptor)
        self.masters = self.slaves = ()

    def _carry(self, source: int, target: int) -> None:
        with suppress(BlockingIOError):
            some = os.read(source, 4096)
            if self.passes:
                os.write(target, some)


class LineEnd:
    """What stands at the far end of a line, which is silent where it is cut."""

    line: PseudoLine

    async def cut(self) -> None:
        """Let nothing pass."""
        self.line.passes = False

    async def mend(self) -> None:
        """Let bytes pass again."""
        self.line.passes = True


def _is_left_behind(target: Path, near: str) -> bool:
    """Whether a link is that of a line that went with its process: its terminal is gone, or the new line's now."""
    return target.parent == Path(near).parent and (not target.exists() or target == Path(near))
