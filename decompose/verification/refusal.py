"""Refusing a bundle that does not show what it claims."""

from __future__ import annotations

from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError

HINT: Final = "make the bundle anew with `firable bundle`; what is proved of one net holds of no other"


class NotShownError(Exception):
    """Something in a bundle is not what its net demands; `subject` says where."""

    def __init__(self, message: str, *subject: str) -> None:
        super().__init__(message)
        self.subject = subject

    def as_input_error(self) -> InputError:
        """The refusal that a person reads."""
        return InputError([Diagnostic("F6002", f"the bundle does not show what it claims: {self}", HINT, self.subject)])
