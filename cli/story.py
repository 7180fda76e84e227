"""The end of a counterexample in sentences: who waits for whom, and what to change.

One wording for the text, the page and the formats of code review.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from firable.nets.net import Net
    from firable.nets.verdict import Cure, Verdict, Wait


def waits_told(net: Net, waits: Sequence[Wait]) -> Iterator[str]:
    """A circle of tokens that wait for each other, a sentence for each."""
    return (wait.told(net.place(wait.place).description) for wait in waits)


def cures_told(verdict: Verdict) -> Iterator[str]:
    """The changes that cure a verdict, as alternatives, each with what the check of the changed net has shown."""
    for number, cure in enumerate(verdict.cures):
        first, *others = cure.changes
        yield f"{'or' if number else 'cure'}: {first}"
        yield from (f"  and {change}" for change in others)
        yield f"  checked: {outcome_told(cure)}"


def outcome_told(cure: Cure) -> str:
    """What checking the changed net has shown.

    >>> from firable.nets.verdict import Cure
    >>> outcome_told(Cure(("...",), ("live",), ("property.full",), 40))
    '40 markings; cures live too; property.full holds no longer'
    """
    from firable.nets.verdict import spelled

    told = [f"{spelled(cure.markings)} marking{'' if cure.markings == 1 else 's'}"]
    if cure.proves:
        told.append(f"cures {_listed(cure.proves)} too")
    if cure.loses:
        told.append(f"{_listed(cure.loses)} hold{'s' if len(cure.loses) == 1 else ''} no longer")
    return "; ".join(told)


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
