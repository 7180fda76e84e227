"""The votes on the coordinated transitions, as far as one host knows: whose part is ready, promised, applied.

A coordinator knows what controllers have reported to it and how its open rounds stand; a controller knows its own part
and what it has promised. So the page of one controller shows that one's votes, and of the others nothing that it would
have to guess.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firable.executor import Host
from firable.executor.links.link import called
from firable.executor.protocol.coordinator import Round
from firable.executor.protocol.deciders import coordinator_at
from firable.nets.decomposition import Coordinated


def votes(host: Host) -> list[dict[str, Any]]:
    """A row for each coordinated transition with a part or its coordinator here."""
    rows = []
    for row in host.decomposition.coordinated:
        decider = host.coordinators.get(coordinator_at(row.at))
        if decider is None and not any(part.controller in host.controllers for part in row.parts):
            continue
        rounds = [] if decider is None else [one for one in decider.rounds.values() if row.name in one.transitions]
        opened = next((one for one in rounds if one.committed in (None, row.name)), None)
        parts = [{"controller": p.controller, "vote": _vote(host, row, p.controller, opened)} for p in row.parts]
        state = "" if opened is None else "applying" if opened.decided else "asking"
        decided = coordinator_at(row.at)
        rows.append({"name": row.name, "says": row.description, "parts": parts, "round": state, "decider": decided})
    return rows


def awaited(host: Host, row: Mapping[str, Any]) -> str:
    """What a row of `votes` whose part here is ready still waits for, in a sentence; empty where all are ready."""
    of: dict[str, list[str]] = {"lost": [], "no": [], "unknown": []}
    decider = row["decider"]
    if decider in host.peers.names - host.peers.connected_to:
        of["lost"].append(called(decider))
    for part in row["parts"]:
        if part["controller"] not in host.controllers and part["vote"] in of:
            of[part["vote"]].append(part["controller"])
    words = {"lost": "{} to be connected", "no": "{} to be ready", "unknown": f"{called(decider)} to ask {{}}"}
    told = "; ".join(words[vote].format(", ".join(names)) for vote, names in of.items() if names)
    return f"{row['name']} is ready here, and waits for {told}" if told else ""


def _vote(host: Host, row: Coordinated, controller: str, opened: Round | None) -> str:
    """How one participant stands to a transition: its newest word that is known here."""
    if opened is not None and opened.decided and opened.committed == row.name:
        return "applied" if controller in opened.acknowledged else "ordered"
    if opened is not None and controller in opened.votes:
        return "yes" if row.name in opened.votes[controller] else "no"
    own = host.controllers.get(controller)
    if own is not None:
        if any(row.name in promise.promised for promise in own.promises.values()):
            return "promised"
        return "ready" if own.parts[row.name].enabled(own.word) else "no"
    decider = host.coordinators.get(coordinator_at(row.at))
    if controller in host.peers.names and controller not in host.peers.connected_to:
        return "lost"
    if decider is None:
        return "unknown"
    return "ready" if row.name in decider.ready[controller] else "no"
