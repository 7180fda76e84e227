"""Documents of evidence that name verdicts and show nothing, as far as one can be read without checking it."""

import json
from collections.abc import Iterable

from firable.nets.interchange import net_digest
from firable.nets.net import Net


def document_naming(
    net: Net,
    names: Iterable[str],
    *,
    status: str = "proved",
    lacking: str = "",
    discipline: str = "interleaving",
    version: float = 2,
) -> str:
    """A text with a record of each name, all of this status."""
    records = [{"name": name, "status": status, "query": "", "lacking": lacking, "shown": []} for name in names]
    data = {"firable_evidence": version, "digest": net_digest(net), "discipline": discipline, "verdicts": records}
    return json.dumps(data)
