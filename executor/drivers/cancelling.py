"""Tasks that are cancelled until they are over, and work that no cancellation breaks off."""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Coroutine
from typing import Any, Final

_CANCELLED_AGAIN_SECONDS: Final = 0.5


async def ended(tasks: Collection[asyncio.Task[Any]]) -> None:
    """Cancel tasks until they are over, whatever they end with.

    Once is not enough: before Python 3.12, a task that waits with a time limit (`asyncio.wait_for`, in libraries as
    well) loses the cancellation that comes at the same time as what it waits for.
    """
    cancelled: asyncio.CancelledError | None = None
    while pending := [task for task in tasks if not task.done()]:
        for task in pending:
            task.cancel()
        try:
            await asyncio.wait(pending, timeout=_CANCELLED_AGAIN_SECONDS)
        except asyncio.CancelledError as error:  # ours: when they are over
            cancelled = error
    for task in tasks:
        if not task.cancelled():
            task.exception()
    if cancelled is not None:
        raise cancelled


async def uninterrupted(work: Coroutine[Any, Any, None]) -> None:
    """Do something to its end, however often this is cancelled meanwhile; then the cancellation holds."""
    task = asyncio.create_task(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.wait((task,))
        except asyncio.CancelledError as error:
            cancelled = error
    task.result()
    if cancelled is not None:
        raise cancelled
