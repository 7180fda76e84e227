"""The explicit engine: the reachability graph of a net, explored by the Rust crate `analysis/engine`.

A marking is an index: markings are numbered in the order of a breadth-first search from M0 (index 0), level by
level, so a lower index is never farther from M0. As a value a marking is an `int` bit mask over the places. A set
of markings is given as a list of indexes or as a bitmap, `bytes` with one byte for each marking (not 0: in the
set), and is returned as a bitmap. A firing sequence is a list of fired sets, each a list of transitions (one under
interleaving).

What needs the whole graph raises `IncompleteGraph` where `complete` is false, so that nothing is concluded from a
part. The rest (markings, contacts, deadlocks, paths) holds of the part explored.

What may take long releases the interpreter and takes `max_seconds`, the time left, and `cancelled`, which is asked some
twenty times a second, at first more often, and says whether the answer is no longer needed. What they raise, and what a
signal handler raises, comes out. An exploration that is ended so is incomplete; any other work raises `BudgetExceeded`.
"""

from collections.abc import Callable, Mapping
from typing import final

from firable.nets.net import Transition

_Row = tuple[list[int], list[int], list[int], list[int], list[tuple[int, bool]]]
_Ends = tuple[bytes, bytes]
_Transitions = list[_Row] | tuple[_Ends, _Ends, _Ends, _Ends, _Ends]

class BudgetExceeded(RuntimeError):  # noqa: N818 - what happened is no error of anybody's, and so not named one
    """The answer needs more memory or time than is allowed, or is no longer needed."""

class IncompleteGraph(RuntimeError):  # noqa: N818 - likewise
    """The answer needs the whole reachability graph, and the exploration ended early."""

def flat(
    places: Mapping[str, int], signals: Mapping[str, int], transitions: tuple[Transition, ...]
) -> tuple[_Ends, _Ends, _Ends, _Ends, _Ends]:
    """The transitions of a net, end to end; `places` and `signals` have the index of each name.

    It keeps the interpreter, about a microsecond for each transition. Raises `KeyError` for a name without an index.
    """

def pairs_together(
    n_places: int,
    transitions: _Transitions,
    initial: list[int],
    bound: bytes | None,
    *,
    max_words: int,
    max_seconds: float | None,
    cancelled: Callable[[], bool] | None = None,
) -> bytes | None:
    """Which places may be marked together, by the arcs alone: the structural concurrency relation.

    A row of bits for each place, in little-endian words of 64, end to end; one that may be marked is in its own row.
    `bound` gives such rows, in which all pairs are known to be. None where more than so many words would be looked at.
    Contact and external literals are not looked at. A place may stand for a literal, with a firing that takes those
    that it makes false.
    """

def explore(
    n_places: int,
    transitions: _Transitions,
    initial: list[int],
    *,
    step: bool = False,
    max_markings: int,
    max_memory_bytes: int,
    max_seconds: float | None,
    threads: int = 1,
    second_free: Callable[[], bool] | None = None,
    cancelled: Callable[[], bool] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Graph:
    """Explore the reachability graph from the marking `initial`, external gates free.

    A transition is (inputs, outputs, permissive, inhibitive, external literals): places by index, literals as
    (signal, wanted value); all may be given end to end, as `compiled.flat` makes them. Under interleaving an edge
    fires one transition that is firable (Eq. 1) and whose literals do not contradict each other; under `step` it
    fires a maximal set F of E(v), for some valuation v of the signals, in which a place has at most one consumer and
    one producer; each F is one edge, the empty one is left out.

    Running out of a budget, and Ctrl-C, give an incomplete graph with its `reason`. `max_memory_bytes` counts all
    that the engine holds, copies while a table grows included; time is looked at every few thousand edges. `progress`
    is told the number of markings and edges found so far, some twenty times a second, at first more often, in the
    calling thread.

    Under interleaving 2 `threads` share the larger levels; where `second_free` is given, those that begin while it last
    said so. The numbering is then another than that of one thread, and as much a function of the arguments.

    Raises `ValueError` for a place out of range, a negative time or more threads, `BudgetExceeded` where not even the
    net fits.

    >>> graph = explore(2, [([0], [1], [], [], []), ([1], [0], [], [], [])], [0],
    ...                 max_markings=100, max_memory_bytes=1_000_000, max_seconds=None)
    >>> graph.n_markings, graph.n_edges, graph.complete
    (2, 2, True)
    """

@final
class Graph:
    """A reachability graph. Markings are stored, edges are computed again when they are asked for.

    Where `max_memory_bytes` has room for several times the edges they are kept, once questions that go against them
    (`backward`) have tried more than it takes to store them; under steps, from the first such question on.
    """

    @property
    def complete(self) -> bool:
        """Whether every reachable marking was found and expanded."""
    @property
    def reason(self) -> str | None:
        """Why not: "markings", "memory", "time", "interrupted" or "cancelled"; None where complete."""
    @property
    def step(self) -> bool:
        """Whether edges are synchronous steps."""
    @property
    def n_markings(self) -> int:
        """How many markings were found."""
    @property
    def n_edges(self) -> int:
        """How many edges were followed: pairs of a marking and what fires in it."""
    @property
    def n_levels(self) -> int:
        """How many levels the breadth-first search began; one more than the longest shortest path, where complete."""
    @property
    def words(self) -> int:
        """How many 64-bit words a marking takes."""
    @property
    def memory_bytes(self) -> int:
        """Bytes held by the graph: markings, hash table, statistics, the compiled net, and edges once they are kept."""
    @property
    def bytes_per_marking(self) -> float:
        """Bytes held when the exploration had ended, by `n_markings`."""
    @property
    def seconds(self) -> float:
        """How long the exploration took."""
    def __len__(self) -> int: ...
    def marking(self, index: int) -> int:
        """The marking of an index, as a mask; `IndexError` where there is none."""
    def markings_bytes(self) -> bytes:
        """All markings end to end, `n_markings * words` little-endian 64-bit words (`numpy.frombuffer(..., "<u8")`)."""
    def find(self, mask: int) -> int | None:
        """The index of a marking, None where it was not found (which means unreachable only if `complete`)."""
    def fired(self) -> list[int]:
        """For each transition, the edges on which it fires."""
    def deadlocks(self) -> list[int]:
        """The markings, ascending, where no transition is firable and openable."""
    def contacts(self) -> list[int]:
        """For each transition, the number of markings in contact.

        Inputs and internal gates are satisfied and some output place that is no input is full; external gates are
        ignored.
        """
    def contact_witness(self, t: int) -> int | None:
        """The lowest marking in contact for a transition."""
    def successors(
        self, index: int, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None
    ) -> list[tuple[list[int], int]]:
        """The edges that leave a marking: what fires and the marking after.

        In the order of the transitions (interleaving) or of the choices (step). In an incomplete graph, edges to
        markings that were not found are left out.
        """
    def path_to(
        self, index: int, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None
    ) -> list[list[int]]:
        """A shortest firing sequence from M0 to a marking; the same one every time."""
    def path_between(
        self,
        index: int,
        targets: list[int] | bytes,
        within: list[int] | bytes | None = None,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> tuple[list[list[int]], int] | None:
        """A shortest firing sequence from a marking to one of `targets`, and the target reached; None: there is none.

        Every marking before the last is in `within` (E[within U targets]). Empty where the marking is itself a
        target. That there is none needs the whole graph.
        """
    def expect(
        self,
        questions: int,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        """Get ready for so many questions that go against the edges: store these where that pays.

        Needs the whole graph.
        """
    def backward(
        self,
        targets: list[int] | bytes,
        within: list[int] | bytes | None = None,
        by: list[int] | None = None,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> bytes:
        """The bitmap of the markings from which some target can be reached, targets included (EF targets).

        With `within`, every marking before the target is in it (E[within U targets]); with `by`, by edges that fire one
        of these transitions. Needs the whole graph.
        """
    def forward(
        self,
        sources: list[int] | bytes,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> bytes:
        """The bitmap of the markings that can be reached from some source, sources included.

        Needs the whole graph. Cost: that of the exploration at most.
        """
    def before(
        self,
        targets: list[int] | bytes,
        by: list[int] | None = None,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> bytes:
        """The bitmap of the markings with an edge into the targets (EX); with `by`, an edge that fires one of these.

        Needs the whole graph. Cost: that of the exploration at most.
        """
    def endless(
        self,
        within: list[int] | bytes | None = None,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> bytes:
        """The bitmap of the markings from which a run can go on for ever within a set (EG over infinite runs).

        Needs the whole graph. Cost: twice that of the exploration at most.
        """
    def fair(
        self,
        within: list[int] | bytes,
        fairness: str,
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> bytes:
        """For each marking ("<u4") the number of the component in which a fair run can go on for ever inside a set, or
        2**32 - 1; `fairness` is "none", "weak" or "strong". Needs the whole graph.

        Cost: that of storing the edges and finding the components, and a look at each marking in one that is not a
        single marking; under strong fairness as often as markings are taken out.
        """
    def edges(
        self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None
    ) -> tuple[bytes, bytes]:
        """The edges as compressed rows: offsets (`n_markings + 1` "<u8") and targets (`n_edges` "<u4").

        The row of a marking has the order of `successors`. Needs the whole graph.
        """
    def live(self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None) -> list[bool]:
        """For each transition, whether from every marking it can fire again: it fires in every bottom component."""
    def reversible(self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None) -> bool:
        """Whether M0 can be reached from every marking. Needs the whole graph."""
    def home_markings(self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None) -> bytes:
        """The bitmap of the home markings, those of the only bottom component; none where there are several.

        Needs the whole graph.
        """
    def bottom(self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None) -> bytes:
        """The bitmap of the bottom component that has the lowest marking. Needs the whole graph."""
    def effective_conflicts(
        self,
        pairs: list[tuple[int, int]],
        *,
        max_seconds: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> list[int | None]:
        """For each pair of transitions, the lowest marking found at which both are firable by Eq. (1), or None.

        Whether the two conflict in structure, whether one valuation opens both, and whether more markings may come is
        the caller's question.
        """

def explore_compactly(
    n_places: int,
    transitions: _Transitions,
    initial: list[int],
    goals: list[list[tuple[int, list[int]]]],
    *,
    until_met: bool = False,
    max_memory_bytes: int,
    max_seconds: float | None,
    cancelled: Callable[[], bool] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Compact:
    """Search all markings under interleaving, breadth first, in 5 to 8 bytes each, and keep no graph.

    The first arguments are those of `explore`; a goal is a formula as `Stubborn.reach` takes it. With `until_met` the
    search ends when each goal was met. Running out of memory or time leaves an incomplete search.

    Raises `ValueError` for a place out of range or a negative time, `BudgetExceeded` where it takes the tokens on more
    than 60 places to tell reachable markings apart.

    >>> found = explore_compactly(2, [([0], [1], [], [], [])], [0], [[(1, [1])]], max_memory_bytes=100_000,
    ...                           max_seconds=None)
    >>> found.n_markings, found.n_edges, found.complete, found.way_to_goal(0), found.way_to_deadlock()
    (2, 1, True, [0], [0])
    """

@final
class Compact:
    """What a search found that keeps no graph.

    A way is a shortest firing sequence from M0, None where nothing is there to be reached; it is found by searching
    again, and raises `BudgetExceeded` where memory or time end.
    """

    @property
    def complete(self) -> bool:
        """Whether every reachable marking was found and tested."""
    @property
    def reason(self) -> str | None:
        """Why not: "memory", "time", "interrupted" or "cancelled"; None where complete, or where all goals were met."""
    @property
    def n_markings(self) -> int:
        """How many markings were found."""
    @property
    def n_edges(self) -> int:
        """How many edges were followed."""
    @property
    def n_levels(self) -> int:
        """How many levels the search began."""
    @property
    def n_deadlocks(self) -> int:
        """How many of the markings tested are deadlocks."""
    @property
    def memory_bytes(self) -> int:
        """Bytes that the search held when it ended."""
    @property
    def seconds(self) -> float:
        """How long the search took."""
    def fired(self) -> list[int]:
        """For each transition, the edges on which it fires."""
    def contacts(self) -> list[int]:
        """For each transition, the number of markings in contact, as `Graph.contacts` has it."""
    def goals(self) -> list[bool]:
        """For each goal, whether a marking was found in which it holds."""
    def way_to_contact(
        self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None
    ) -> list[int] | None:
        """A way to a nearest marking in contact."""
    def way_to_deadlock(
        self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None
    ) -> list[int] | None:
        """A way to a nearest deadlock."""
    def way_to_goal(
        self, goal: int, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None
    ) -> list[int] | None:
        """A way to a nearest marking in which a goal holds; `IndexError` for a goal that was not asked for."""

def find_lasso(
    n_places: int,
    transitions: _Transitions,
    initial: list[int],
    labels: list[list[tuple[int, list[int]]]],
    rows: list[list[tuple[int, bool, list[int], bool, int, list[int]]]],
    n_marks: int,
    *,
    seed: int | None = None,
    sparing: bool = False,
    max_vertices: int,
    max_memory_bytes: int,
    max_seconds: float | None,
    cancelled: Callable[[], bool] | None = None,
) -> Lasso:
    """Look, depth first and under interleaving, for a run from M0 that a generalised Büchi automaton accepts.

    The first arguments are those of `explore`; labels are formulas as `Stubborn.reach` takes them. A row holds the
    edges of a state, the first row those of the first state: (label that the marking satisfies, whether only the
    transitions listed are admitted or all but these, they, whether it may be taken in a deadlock, target, marks). A run
    is accepted if it takes edges with each mark again and again. With a `seed` firings are tried in a drawn order. A
    vertex is a marking with a state. Running out of a budget leaves the search incomplete. One that is `sparing` leaves
    out firings that can wait: finding no run, it has not shown that there is none.

    Raises `ValueError` for a place, label, state, transition or mark out of range, more than 64 marks, a negative time.

    >>> ring = [([0], [1], [], [], []), ([1], [0], [], [], [])]
    >>> found = find_lasso(2, ring, [0], [[(2, [])]], [[(0, False, [], True, 0, [0])]], 1, max_vertices=100,
    ...                    max_memory_bytes=1_000_000, max_seconds=None)
    >>> found.complete, found.run
    (True, ([], [0, 1]))
    """

@final
class Lasso:
    """What a search for a lasso found."""

    @property
    def complete(self) -> bool:
        """Whether the question is answered."""
    @property
    def reason(self) -> str | None:
        """Why not: "markings" for the vertices allowed, "memory", "time", "interrupted" or "cancelled"."""
    @property
    def run(self) -> tuple[list[int], list[int]] | None:
        """The firings from M0 and those of the cycle, which is empty where the run ends in a deadlock; None: no run."""
    @property
    def n_vertices(self) -> int:
        """How many vertices were met."""
    @property
    def n_edges(self) -> int:
        """How many edges were followed."""
    @property
    def seconds(self) -> float:
        """How long it took."""

def evaluate_locally(
    n_places: int,
    transitions: _Transitions,
    initial: list[int],
    labels: list[list[tuple[int, list[int]]]],
    nodes: list[tuple[str, list[int]]],
    *,
    first: int,
    max_markings: int,
    max_memory_bytes: int,
    max_seconds: float | None,
    cancelled: Callable[[], bool] | None = None,
) -> Local:
    """Evaluate a formula of CTL in M0, under interleaving, at the markings that its operators look at.

    The first arguments are those of `explore`; labels are formulas as `Stubborn.reach` takes them. A node is ("label",
    [number]), ("not" | "EX", [node]), ("EU" | "AU", [left, right]), or ("and" | "or", nodes), operands before what they
    are operands of; the last is the formula. In a deadlock `EX` is false and an until is its right side. A search
    inside another one may meet `first` markings in the first round, and more in those that follow. Running out of a
    budget leaves it undecided.

    Raises `ValueError` for a place, label, or operand out of range, too deep a formula, a negative time.

    >>> ring = [([0], [1], [], [], []), ([1], [0], [], [], [])]
    >>> full = [[(1, [0])], [(1, [1])]]
    >>> evaluate_locally(2, ring, [0], full, [("label", [0]), ("label", [1]), ("AU", [0, 1])], first=10,
    ...                  max_markings=100, max_memory_bytes=1_000_000, max_seconds=None).holds
    True
    """

@final
class Local:
    """What a local evaluation found."""

    @property
    def holds(self) -> bool | None:
        """Whether M0 satisfies the formula; None where that is not decided."""
    @property
    def reason(self) -> str | None:
        """Why not: "markings" for the markings allowed, "memory", "time", "interrupted" or "cancelled"."""
    @property
    def n_markings(self) -> int:
        """How many markings were met."""
    @property
    def n_edges(self) -> int:
        """How many firings were followed."""
    @property
    def seconds(self) -> float:
        """How long it took."""

def explore_symbolically(
    n_places: int,
    transitions: _Transitions,
    initial: list[int],
    *,
    max_memory_bytes: int,
    max_seconds: float | None = None,
    threads: int = 1,
    second_free: Callable[[], bool] | None = None,
    cancelled: Callable[[], bool] | None = None,
    orders: list[list[int]] | None = None,
) -> Diagram:
    """Find the markings reachable under interleaving as a zero-suppressed decision diagram, by saturation.

    The arguments are those of `explore`. Several orders of the places race each other, `orders` in the place of the
    engine's own candidates, each a permutation of the places from the lowest level to the highest. Of 2 `threads` the
    second shares the longer rounds of the race, of those that begin while `second_free`, where that is given, last said
    so; who wins is the same, if memory suffices. What ends the search ends later work in the diagram too, until
    `Diagram.limit` says otherwise.

    Raises `BudgetExceeded` where memory or time ends before all markings are found, `ValueError` for a place out of
    range, what is no order, or more threads.

    >>> diagram = explore_symbolically(2, [([0], [1], [], [], [])], [0], max_memory_bytes=1_000_000)
    >>> diagram.reach().count(), diagram.reach().edges()
    (2, 1)
    """

@final
class Diagram:
    """All reachable markings of a net, and the questions to them; a set of markings is a `MarkingSet`.

    Whatever takes long raises `BudgetExceeded` where memory or time ends.
    """

    @property
    def seconds(self) -> float:
        """How long the search took."""
    @property
    def n_nodes(self) -> int:
        """How many nodes the diagram had when the search ended, those no longer used included."""
    @property
    def memory_bytes(self) -> int:
        """Bytes held: nodes, remembered results, stacks and the compiled net."""
    @property
    def order(self) -> list[int]:
        """The places from the lowest level to the highest."""
    def limit(self, *, max_seconds: float | None = None, cancelled: Callable[[], bool] | None = None) -> None:
        """What ends work in the diagram from now on."""
    def reach(self) -> MarkingSet:
        """All reachable markings."""
    def initial(self) -> MarkingSet:
        """M0 alone."""
    def empty(self) -> MarkingSet:
        """No marking."""
    def single(self, marked: list[int]) -> MarkingSet:
        """The marking in which exactly these places hold a token, if it is reachable."""
    def having(self, markings: MarkingSet, full: list[int], empty: list[int]) -> MarkingSet:
        """The markings of a set in which some places hold a token and others do not."""
    def greatest(self, markings: MarkingSet, places: list[int]) -> list[int] | None:
        """The places that hold a token in some marking of the set with most tokens on these; None where it is empty.

        A place that stands twice counts twice.
        """
    def which(self, markings: MarkingSet, tests: list[tuple[list[int], list[int]]]) -> list[bool]:
        """For each test (`full`, `empty`), whether `having` would find a marking; all in one pass."""
    def counts(self, markings: MarkingSet, tests: list[tuple[list[int], list[int]]]) -> list[int]:
        """For each test (`full`, `empty`), how many markings `having` would find, exactly; without making the sets."""
    def firable(self, markings: MarkingSet) -> MarkingSet:
        """The markings of a set in which some transition is firable and openable."""
    def in_contact(self, markings: MarkingSet) -> MarkingSet:
        """The markings of a set in contact at some transition."""
    def before(self, targets: MarkingSet, by: list[int] | None = None) -> MarkingSet:
        """The markings with an edge into the targets (EX); with `by`, an edge that fires one of these transitions."""
    def backward(
        self, targets: MarkingSet, within: MarkingSet | None = None, by: list[int] | None = None
    ) -> MarkingSet:
        """The markings from which a target can be reached (EF), going only through `within` (E[within U targets]).

        With `by`, by firings of these transitions alone.
        """
    def forward(self, sources: MarkingSet) -> MarkingSet:
        """The markings that can be reached from a set."""
    def endless(self, within: MarkingSet) -> MarkingSet:
        """The markings from which a run can go on for ever inside a set (EG over infinite runs)."""
    def nodes(self, sets: list[MarkingSet], most: int) -> tuple[list[tuple[int, int, int]], list[int]] | None:
        """The nodes of some sets as rows (level, without, with), and the number of each set; None for more than `most`.

        Levels count from 1, the place of level k being `order[k - 1]`. Rows have numbers from 2, and the parts of a row
        stand before it: the markings in which its place is empty, and those in which it holds a token, that token left
        out; 0 holds no marking, 1 the empty one. A level that is passed over is empty.
        """
    def path_to(self, targets: MarkingSet) -> tuple[list[int], list[int], bool] | None:
        """A firing sequence from M0 into a set, the places marked in its end, and whether it is known to be shortest.

        None where the set is empty, or where the search for a way was given up.
        """

@final
class MarkingSet:
    """A set of reachable markings of one `Diagram`: immutable, and equal to whatever holds the same markings.

    `TypeError` where sets of two diagrams meet, or are to be ordered.
    """

    def __and__(self, other: MarkingSet) -> MarkingSet: ...
    def __or__(self, other: MarkingSet) -> MarkingSet: ...
    def __xor__(self, other: MarkingSet) -> MarkingSet: ...
    def __sub__(self, other: MarkingSet) -> MarkingSet: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...
    def __bool__(self) -> bool:
        """Whether there is a marking in the set."""
    def count(self) -> int:
        """How many markings, exactly."""
    def edges(self) -> int:
        """How many pairs of a marking of the set and a transition that may fire in it, exactly."""
    def contains(self, marked: list[int]) -> bool:
        """Whether the marking in which exactly these places hold a token is in the set."""
    def any(self) -> list[int] | None:
        """The places that hold a token in some marking of the set, the same one every time; None where it is empty."""

@final
class Stubborn:
    """A net that is ready for searches by stubborn sets, interleaving and external gates free.

    The arguments are those of `explore`. Raises `ValueError` for a place out of range.

    >>> net = Stubborn(2, [([0], [1], [], [], [])], [0])
    >>> found = net.deadlocks(max_markings=100, max_memory_bytes=1_000_000, max_seconds=None)
    >>> found.complete, [found.marking(i) for i in found.deadlocks()], found.path_to(1)
    (True, [2], [0])
    """

    def __new__(
        cls,
        n_places: int,
        transitions: _Transitions,
        initial: list[int],
    ) -> Stubborn: ...
    def deadlocks(
        self,
        *,
        all: bool = True,  # noqa: A002 - the engine's name
        thorough: bool = False,
        keep_sets: bool = False,
        max_markings: int,
        max_memory_bytes: int,
        max_seconds: float | None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Search:
        """Search for all deadlocks, or for the first one; `thorough` thinks longer about each marking.

        `keep_sets` keeps the stubborn set of each marking, for `Search.sets`.

        Running out of a budget, and Ctrl-C, give an incomplete search with its `reason`. Raises `BudgetExceeded` where
        not even the net fits, `ValueError` for a negative time; so do the other searches.
        """
    def reach(
        self,
        nodes: list[tuple[int, list[int]]],
        *,
        thorough: bool = False,
        keep_sets: bool = False,
        max_markings: int,
        max_memory_bytes: int,
        max_seconds: float | None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Search:
        """Search for a marking that satisfies a formula.

        The formula is its nodes, the last one the whole: (0, [place]) the place is empty, (1, [place]) it is full,
        (2, nodes) all of these earlier nodes are true, (3, nodes) some of them is. `ValueError` for anything else.
        """
    def fire(
        self,
        transitions: list[int],
        *,
        thorough: bool = False,
        max_markings: int,
        max_memory_bytes: int,
        max_seconds: float | None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Search:
        """Search for markings at which some transitions are firable and openable, until each has one or can have none.

        `IndexError` for a transition that does not exist.
        """
    def walk(
        self,
        nodes: list[tuple[int, list[int]]] | None,
        *,
        seed: int,
        max_steps: int,
        max_seconds: float | None,
        cancelled: Callable[[], bool] | None = None,
    ) -> tuple[list[int] | None, int]:
        """Walk at random, with restarts, to a marking that satisfies a formula, or with None to a deadlock.

        The firings that lead there, cut down to what it needs, and how many were made; None where the walk met no such
        marking within `max_steps` firings or the time, which says nothing about the net. The same seed gives the same
        walk.
        """
    def cover(
        self,
        transitions: list[int],
        *,
        seed: int,
        max_vain: int,
        max_seconds: float | None,
        cancelled: Callable[[], bool] | None = None,
    ) -> tuple[list[tuple[tuple[int, int] | None, list[int], list[tuple[int, int]]]], list[int] | None, int]:
        """Walk at random until each was firable, `max_vain` firings in a row met none anew, or the time is over.

        The ways to them: each goes on from an earlier one, after so many of its firings (None: from M0), and tells what
        it fires, and which of the transitions are firable after how many of these firings. Also a firing sequence from
        M0 to a deadlock, if one was met; and how many firings were made. What was not met may fire all the same.
        `IndexError` for a transition that does not exist.
        """

@final
class Search:
    """What a search found: a part of the reachability graph, its markings numbered breadth first, M0 first.

    Where it is `complete`, the goal cannot be reached unless it was found.
    """

    @property
    def complete(self) -> bool:
        """Whether the question is answered."""
    @property
    def reason(self) -> str | None:
        """Why not: "markings", "memory", "time", "interrupted" or "cancelled"; None where complete."""
    @property
    def n_markings(self) -> int:
        """How many markings were found."""
    @property
    def n_edges(self) -> int:
        """How many firings were followed."""
    @property
    def memory_bytes(self) -> int:
        """Bytes held by the search."""
    @property
    def seconds(self) -> float:
        """How long the search took."""
    @property
    def found(self) -> int | None:
        """The marking that satisfies the formula of `reach`, one nearest to M0."""
    def deadlocks(self) -> list[int]:
        """The deadlocks found, ascending; for `deadlocks` all there are, where the search is complete."""
    def firable(self) -> list[int | None]:
        """For each transition the first marking found at which it is firable and openable."""
    def sets(self) -> tuple[list[list[int]], list[int]]:
        """The stubborn sets, each once, and the number of the one of each marking; none where they were not kept."""
    def marking(self, index: int) -> int:
        """The marking of an index, as a mask; `IndexError` where there is none."""
    def path_to(self, index: int) -> list[int]:
        """A firing sequence from M0 to a marking, one transition after the other; for a goal a shortest one."""
