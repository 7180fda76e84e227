"""A number of an option, in a range, that is a number: what Python reads as one besides, `nan` and `inf`, is a mistake.

No bound of a range refuses `nan`, which is neither less nor more; as a time it is over at once, or never.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import click


class FiniteRange(click.FloatRange):
    """A range of finite numbers."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number; raises `click.BadParameter` where it is none."""
        number: float = super().convert(value, param, ctx)
        if not isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number
