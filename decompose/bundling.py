"""Filling the bundle: a net may be bundled only when everything that it must prove is proved.

The obligations of the decomposition are proved here; the verdicts of `firable check` are handed in by whoever explored
the net, for this room does not explore. What is demanded is what the executor will demand when it reads the bundle:
both ask `unproved`, so that no bundle is made that could not run.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from firable.decompose.prove import TIMEOUT_MS, prove
from firable.decompose.split import split
from firable.nets.bundle import Bundle, unproved
from firable.nets.diagnostics import InputError
from firable.nets.net import Net
from firable.nets.verdict import Verdict


def make_bundle(
    net: Net,
    verdicts: Iterable[Verdict],
    evidence: Mapping[str, str] | None = None,
    *,
    timeout_ms: int = TIMEOUT_MS,
) -> Bundle:
    """Split a net, prove the decomposition and bundle both with the verdicts on the net and their evidence.

    `evidence` holds the text of each file that the verdicts name. Raises `InputError`: F4001 and F2011 where the net
    cannot be split, F4003 for everything that must be proved and is not.
    """
    decomposition = split(net)
    report = prove(decomposition, timeout_ms=timeout_ms)
    bundle = Bundle(decomposition, (*verdicts, *report.verdicts), {**(evidence or {}), **report.files})
    if problems := unproved(bundle):
        raise InputError(replace(problem, code="F4003") for problem in problems)
    return bundle
