"""One of a few words, as a type of options and arguments: a slip of the pen is told the word that was meant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    _Choice = click.Choice[str]
else:  # a type with parameters only in the newest versions of click
    _Choice = click.Choice


class OneOf(_Choice):
    """A choice of words."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The word, if it is one of them; raises `click.BadParameter` with the word that was probably meant."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            from firable.nets.diagnostics import with_meant

            self.fail(with_meant(error.message, str(value), self.choices), param, ctx)
