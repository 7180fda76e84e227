"""Checking what a bundle says of its votes: from its net, subnets and table, and its document of evidence.

What must hold is derived anew: for each part the places that its yes needs and the transitions that could take it back,
by the arcs alone. Where there are none the verdict is read off. A verdict that is PROVED otherwise rests on a claim of
the document, which must be the very one that is derived here, and on its certificate, which the checker of evidence
accepts or not. One that is VIOLATED is played. UNKNOWN says nothing. No search, invariant or diagram is made here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import Final

from firable.analysis.evidence.checking.checker import TIMEOUT_MS, check_document
from firable.analysis.evidence.claims import Claim
from firable.analysis.evidence.document import Document, document_from_text
from firable.decompose.splitting.persistence import EVIDENCE, PREFIX, claim_of
from firable.decompose.splitting.votes import Vote, accused
from firable.nets.bundle import Bundle
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Net
from firable.nets.verdict import Status, Verdict
from firable.semantics.player import NotFirableError, Player

_HINT: Final = "make the bundle anew with `firable bundle`"


def vote_problems(bundle: Bundle, *, timeout_ms: int = TIMEOUT_MS) -> tuple[Diagnostic, ...]:
    """Why a bundle does not show what it says of its votes (F6002); nothing where it does.

    `timeout_ms` is for each obligation; one that is not decided in time is not shown.
    """
    verdicts = [verdict for verdict in bundle.verdicts if verdict.name.startswith(PREFIX)]
    return tuple(
        Diagnostic("F6002", message, _HINT, ("verdicts", name))
        for name, message in _problems(bundle, verdicts, timeout_ms)
    )


def _problems(bundle: Bundle, verdicts: Collection[Verdict], timeout_ms: int) -> Iterator[tuple[str, str]]:
    votes = {f"{PREFIX}{vote.part}": vote for vote in accused(bundle.decomposition)}
    count = Counter(verdict.name for verdict in verdicts)
    for name in votes.keys() | count.keys():
        if count[name] != 1 or name not in votes:
            yield name, f"there are {count[name]} verdicts on '{name}', and should be {int(name in votes)}"
    try:
        shown = _shown(bundle, timeout_ms)
    except InputError as error:
        yield EVIDENCE, f"'{EVIDENCE}' does not show what it claims: {error.diagnostics[0].message}"
        return
    for verdict in verdicts:
        if (vote := votes.get(verdict.name)) is not None and (problem := _problem(bundle.net, vote, verdict, shown)):
            yield verdict.name, f"'{verdict.name}' is {verdict.status.value}, and {problem}"


def _shown(bundle: Bundle, timeout_ms: int) -> set[Claim]:
    """The claims of the document that it shows."""
    if EVIDENCE not in bundle.evidence:
        return set()
    document: Document = document_from_text(bundle.evidence[EVIDENCE], EVIDENCE)
    if document.net != bundle.net:
        raise InputError([Diagnostic("F6002", "it is about another net", _HINT)])
    checked = check_document(document, timeout_ms=timeout_ms)
    return {claim for one in checked if one.shown for claim, _ in one.record.shown}


def _problem(net: Net, vote: Vote, verdict: Verdict, shown: set[Claim]) -> str:
    """What is wrong with a verdict; nothing where it is shown."""
    if verdict.status is Status.UNKNOWN:
        return ""
    if verdict.status is Status.VIOLATED:
        return "" if _is_taken_back(net, vote, verdict) else "its firing sequence does not take the yes back"
    if vote.others:
        return "more transitions touch its places than were looked at"
    if vote.accused and claim_of(vote, persistent=True) not in shown:
        return "nothing shows that no other transition takes the yes back"
    return ""


def _is_taken_back(net: Net, vote: Vote, verdict: Verdict) -> bool:
    """Whether the firings end with one of another transition, named by the verdict, that makes the yes a no."""
    if verdict.witness is None or not verdict.witness.firings:
        return False
    player, marking, before = Player(net), net.initial_marking, 0
    try:
        for fired in verdict.witness.firings:
            before, marking = marking, player.fire(marking, [net.transition_index[name] for name in fired])
    except (NotFirableError, KeyError):
        return False
    last = verdict.witness.firings[-1]
    full, empty = net.marking(vote.full), net.marking(vote.empty)
    yes = [m & full == full and not m & empty for m in (before, marking)]
    named = {vote.transition, *verdict.subjects} - {vote.transition}
    openable = all(net.transition(name).openable for fired in verdict.witness.firings for name in fired)
    return yes == [True, False] and len(last) == 1 and last[0] in named and named <= set(vote.accused) and openable
