"""Speed and memory of the explicit engine, as ratios to three yardsticks in the same run.

- the *limit*: the same number of look-ups and inserts at random in a table of the same number of keys, and nothing else
  (`analysis/engine/examples/random_inserts.rs`): no exploration that asks a table once for each edge can be quicker;
- `hashbrown` and `std`: the same exploration the plain way, by a mask scan into a general hash set
  (`examples/hash_sets.rs`). It shares no code with the engine, so its markings and edges are a check as well.

The nets are the families of the catalogue. Some are made wider by places that never change, to fill more words.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from measuring import Table, against, example, spread, timed

from firable.analysis import _engine
from firable.analysis.compiled import rows
from firable.nets.catalogue import FAMILIES, family_net
from firable.nets.net import Net, Place

MEMORY_BYTES_MAX: Final = 8 << 30
LIMIT_GOALS: Final = {1: 1.0, 2: 1.0, 4: 2.0, 8: 2.0}
HASHBROWN_GOAL, STD_GOAL, BYTES_GOAL = 2.0, 4.0, 16.0
EDGE_STORE_GOAL_NS, COMPONENT_GOAL = 15.0, 1.3


@dataclass(frozen=True)
class Subject:
    """A net of a family, and how many places that never change are added to it."""

    family: str
    spare: int = 0

    def net(self) -> Net:
        """The net."""
        net = family_net(self.family)
        return replace(net, places=(*net.places, *(Place(f"spare{i}") for i in range(self.spare))))

    def __str__(self) -> str:
        return f"{self.family} + {self.spare}" if self.spare else self.family


SUBJECTS: Final = (
    Subject("machines-20"),
    Subject("philosophers-16"),
    Subject("pipeline-20"),
    Subject("slotted_ring-6"),
    Subject("philosophers_either-13"),
    Subject("interlocked-13"),
    Subject("interlocked-13", spare=60),
    Subject("interlocked-13", spare=180),
)
STEP_SUBJECTS: Final = (Subject("machines-11"), Subject("grid-4"), Subject("manufacturing_cells-6"))


def text_of(net: Net) -> str:
    """The net as the plain explorer reads it."""
    n_places, transitions, marked = rows(net)
    lines = [" ".join(map(str, [n_places, *marked]))]
    lines += [";".join(" ".join(map(str, part)) for part in row[:4]) for row in transitions]
    return "\n".join(lines)


def explorer(net: Net, *, step: bool = False) -> Callable[[], _engine.Graph]:
    """What explores a net, with all that goes before it done; the graph must be complete."""
    compiled = rows(net)

    def explore() -> _engine.Graph:
        graph = _engine.explore(
            *compiled,
            step=step,
            max_markings=1 << 30,
            max_memory_bytes=MEMORY_BYTES_MAX,
            max_seconds=None,
        )
        if not graph.complete:
            raise SystemExit(f"{net.name}: incomplete for want of {graph.reason}")
        return graph

    return explore


def interleaving(repeat: int) -> list[Table]:
    """Exploration against the yardsticks, and what is asked of the graph against exploration."""
    speed, asked = [], []
    for subject in SUBJECTS:
        net = subject.net()
        explore, text = explorer(net), text_of(net)
        graph = explore()
        markings, edges = graph.n_markings, graph.n_edges
        name, _, size = subject.family.partition("-")
        formula = FAMILIES[name].markings
        if formula is not None and formula(int(size)) != markings:
            raise SystemExit(f"{subject}: {markings} markings, and {formula(int(size))} by the formula")
        times: dict[str, list[float]] = {}
        for _ in range(repeat):
            times.setdefault("engine", []).append(timed(explore)[1])
            words = str(1 << (graph.words - 1).bit_length())
            times.setdefault("limit", []).append(example("random_inserts", words, str(markings), str(edges))[1])
            for plain in ("hashbrown", "std"):
                counts, seconds = example("hash_sets", plain, text=text)
                if counts[:2] != [str(markings), str(edges)]:
                    raise SystemExit(f"{subject}: {graph}, but the plain explorer has {counts}")
                times.setdefault(plain, []).append(seconds)
            # A graph keeps its answers, so each is asked of a new one.
            fresh = explore()
            times.setdefault("reversible", []).append(timed(fresh.reversible)[1])
            times.setdefault("live", []).append(timed(fresh.live)[1])
            times.setdefault("edges", []).append(timed(explore().edges)[1])
        best = {what: min(seconds) for what, seconds in times.items()}
        speed.append(
            (
                str(subject), str(graph.words), f"{markings:,}", f"{edges:,}",
                spread(times["engine"], edges),
                against(LIMIT_GOALS.get(graph.words, 2.0), best["engine"] / best["limit"]),
                against(HASHBROWN_GOAL, best["hashbrown"] / best["engine"], at_least=True),
                against(STD_GOAL, best["std"] / best["engine"], at_least=True),
                against(BYTES_GOAL, graph.bytes_per_marking) if graph.words == 1 else f"{graph.bytes_per_marking:.1f}",
            )
        )  # fmt: skip
        asked.append(
            (
                str(subject),
                against(COMPONENT_GOAL, best["reversible"] / best["engine"]),
                f"{best['live'] / best['engine']:.2f}",
                against(EDGE_STORE_GOAL_NS, best["edges"] / edges * 1e9),
                spread(times["edges"], edges),
            )
        )
    return [
        Table(
            "Exploration, one thread",
            "Nanoseconds an edge (smallest / median / largest of the runs); the time as a multiple of the limit; how "
            "many times quicker than the plain way with `hashbrown` and with the standard set; bytes a marking.",
            ("net", "words", "markings", "edges", "ns/edge", "x limit", "x hashbrown", "x std", "bytes/marking"),
            tuple(speed),
        ),
        Table(
            "Questions to an explored graph",
            "Reversibility (one strongly connected component?) and, after it, liveness, each as a multiple of the time "
            "of exploration; nanoseconds an edge to store all edges.",
            ("net", "reversible / explore", "live / explore", "edge store, ns/edge", "ns/edge, all runs"),
            tuple(asked),
        ),
    ]


def synchronous(repeat: int) -> Table:
    """Exploration under synchronous steps, where one valuation of the signals opens many sets."""
    rows = []
    for subject in STEP_SUBJECTS:
        explore = explorer(subject.net(), step=True)
        graph = explore()
        seconds = [timed(explore)[1] for _ in range(repeat)]
        rows.append((str(subject), f"{graph.n_markings:,}", f"{graph.n_edges:,}", spread(seconds, graph.n_edges)))
    return Table(
        "Synchronous steps, one thread",
        "Nanoseconds an edge: each edge is a maximal set of transitions.",
        ("net", "markings", "edges", "ns/edge"),
        tuple(rows),
    )


def tables(repeat: int) -> list[Table]:
    """All tables of this benchmark."""
    return [*interleaving(repeat), synchronous(repeat)]
