"""One example of evidence for each kind of certificate, to be damaged, edited and weakened."""

from collections.abc import Callable
from dataclasses import replace

from support.evidence import certified, evidence_of_finding

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Certificate, FiringSequence, Theorem
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind, as_ctl
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.labels import drawn, labelling
from firable.analysis.evidence.producing.nevers import Nevers
from firable.analysis.evidence.producing.spaces import Spaces
from firable.analysis.evidence.producing.stubborn import stubborn_sets
from firable.analysis.goal import Limits
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.formula import And, Deadlock, Formula, Holds, Start, parse_formula
from firable.nets.net import Fairness, Net, Place, Transition
from firable.nets.temporal import parse_temporal
from firable.semantics.trace import Discipline

BOTH_EAT = And((Holds("p1.eating"), Holds("p2.eating")))


def net(name: str, marked: str, *moves: tuple[str, str]) -> Net:
    """Places of one letter each, and transitions t0, t1, ... from some to others."""
    letters = sorted(set(marked).union(*(x + y for x, y in moves), "z"))
    places = tuple(Place(letter, marked=letter in marked) for letter in letters)
    return Net(name, places, tuple(Transition(f"t{i}", tuple(x), tuple(y)) for i, (x, y) in enumerate(moves)))


LOOP = net("loop", "a", ("a", "b"), ("b", "a"))  # z is never marked
TRAPPED = Net(  # no sum of tokens stays the same, and yet somewhere there is always a token
    "trapped",
    (Place("a", marked=True), Place("b"), Place("c")),
    (Transition("fork", ("a",), ("b", "c")), Transition("up", ("c",), ("a",)), Transition("over", ("c",), ("b",))),
)
# Two things wait for their turn: `go` stays enabled, `now` only now and then.
TURNS = Net(
    "turns",
    (Place("a", marked=True), Place("b"), Place("asked", marked=True), Place("done")),
    (
        Transition("tick", ("a",), ("b",)),
        Transition("tock", ("b",), ("a",)),
        Transition("go", ("asked",), ("done",)),
        Transition("again", ("done",), ("asked",)),
    ),
)
SOMETIMES = Net(
    "sometimes",
    TURNS.places,
    (
        Transition("tick", ("a",), ("b",)),
        Transition("tock", ("b",), ("a",)),
        Transition("now", ("asked",), ("done",), permissive=("b",)),
        Transition("again", ("done",), ("asked",)),
    ),
)
CHOICE = Net(  # free choice: a token goes one way or the other and comes back
    "choice",
    (Place("a", marked=True), Place("b"), Place("c")),
    (
        Transition("left", ("a",), ("b",)),
        Transition("right", ("a",), ("c",)),
        Transition("back", ("b",), ("a",)),
        Transition("home", ("c",), ("a",)),
    ),
)
CIRCUIT = Net(  # a marked graph of two circuits
    "circuit",
    (Place("a", marked=True), Place("b"), Place("c", marked=True), Place("d")),
    (
        Transition("go", ("a", "c"), ("b", "d")),
        Transition("one", ("b",), ("a",)),
        Transition("two", ("d",), ("c",)),
    ),
)
RACING = Net(  # each closes the other's gate, and both fire in one step
    "racing",
    (Place("a", marked=True), Place("b", marked=True)),
    (Transition("t", ("a",), permissive=("b",)), Transition("u", ("b",), permissive=("a",))),
)
ENDING = Net("ending", (Place("a", marked=True), Place("b")), (Transition("end", ("a",), ("b",)),))


def widened(net: Net) -> Net:
    """The same with a word of places before the others, every other one of them marked."""
    places = tuple(Place(f"beside{i}", marked=i % 2 == 0) for i in range(64))
    return replace(net, places=(*places, *net.places))


def induced(net: Net, goal: Formula, discipline: Discipline = Discipline.INTERLEAVING) -> Evidence | None:
    """What k-induction finds of a goal."""
    found = decide_by_k_induction(net, goal, Limits(Deadline.after(20)), discipline=discipline, depth_max=3)
    return evidence_of_finding(net, goal, found, discipline)


def on_diagram(net: Net, claim: Claim) -> Evidence | None:
    """The labels of a claim on the decision diagram of a net; None where it does not hold."""
    space, formula = explore_symbolically(net), as_ctl(claim)
    assert formula is not None
    labels = labelling(space, drawn(space), formula)
    return None if labels is None else Evidence(net, Discipline.INTERLEAVING, claim, labels)


def _ctl(text: str) -> Claim:
    return Claim(ClaimKind.CTL, parse_temporal(text))


def _leads(fairness: Fairness, kind: ClaimKind = ClaimKind.LEADS_TO) -> Claim:
    return Claim(kind, Holds("asked"), Holds("done"), fairness)


def _of(net: Net, claim: Claim, certificate: Certificate) -> Evidence:
    return Evidence(net, Discipline.INTERLEAVING, claim, certificate)


def _theorem(net: Net, claim: Claim) -> Evidence:
    return _of(net, claim, Certifier(net, Discipline.INTERLEAVING, Limits()).theorem(claim))


def _stubborn(net: Net, goal: Formula) -> Evidence | None:
    found = stubborn_sets(net, goal, Limits())
    return None if found is None else _of(net, Claim(ClaimKind.NEVER, goal), found)


def by_ranks(evidence: Evidence) -> Evidence:
    """A theorem without its traps, which the checker then looks for itself."""
    assert isinstance(evidence.certificate, Theorem)
    return replace(evidence, certificate=replace(evidence.certificate, traps=()))


def reduced(net: Net, goal: Formula) -> Evidence | None:
    """The steps of a reduction, and what shows the goal of what they leave."""
    found = Nevers(Spaces(net, Discipline.INTERLEAVING, Limits())).reduced(goal)
    return None if found is None else _of(net, Claim(ClaimKind.NEVER, goal), found)


def _invented(net: Net, claim: Claim, firings: str, cycle: str = "") -> Evidence:
    prefix, around = (tuple((name,) for name in names.split()) for names in (firings, cycle))
    return _of(net, claim, FiringSequence(prefix, around))


def fires(goal: Formula, *names: str) -> Claim:
    return Claim(ClaimKind.FIRES, goal, fires=names)


def in_order(goal: Formula, *names: str) -> Claim:
    return Claim(ClaimKind.IN_ORDER, goal, fires=names)


_END = "deadlock or p1.eating or p2.eating"
_ROBOT = "conceptual_one_robot"
EXAMPLES: dict[str, Callable[[], Evidence | None]] = {
    "invariant": lambda: induced(family_net("philosophers-3"), BOTH_EAT),
    "traps": lambda: induced(TRAPPED, parse_formula("not a and not b and not c")),
    "markings": lambda: certified(catalogue_net(_ROBOT), Claim(ClaimKind.NEVER, Deadlock())),
    "distances": lambda: certified(catalogue_net(_ROBOT), Claim(ClaimKind.ALWAYS_POSSIBLE, Start())),
    "sequence": lambda: induced(family_net("philosophers-3"), Deadlock()),
    "labels": lambda: certified(family_net("philosophers-2"), _ctl(f"AG EF deadlock and AF ({_END})")),
    "wide": lambda: certified(widened(family_net("philosophers-2")), _ctl(f"EF EG not deadlock and AF ({_END})")),
    "diagram": lambda: on_diagram(family_net("philosophers-3"), Claim(ClaimKind.NEVER, BOTH_EAT)),
    "back": lambda: on_diagram(family_net("token_ring-3"), Claim(ClaimKind.ALWAYS_POSSIBLE, Start())),
    "rounds": lambda: on_diagram(ENDING, _ctl("AF b")),
    "root": lambda: on_diagram(CHOICE, _ctl("EG not c")),
    "stubborn sets": lambda: _stubborn(family_net("manufacturing_cells-3"), Deadlock()),
    "reduction": lambda: reduced(family_net("workshop-2"), Deadlock()),
    "reduced to nothing": lambda: reduced(family_net("manufacturing_cells-2"), Deadlock()),
    "reduced to a part": lambda: reduced(family_net("philosophers-3"), BOTH_EAT),
    "continuation": lambda: certified(family_net("philosophers-3"), Claim(ClaimKind.LOST, Start())),
    "fires": lambda: _invented(
        TURNS, Claim(ClaimKind.FIRES, Holds("b"), fires=("tock", "go")), "tick tock tick go tock"
    ),
    "in order": lambda: _invented(
        TURNS, Claim(ClaimKind.IN_ORDER, Holds("b"), fires=("tock", "go", "tock")), "tick tock go tick tock"
    ),
    "later": lambda: _invented(TURNS, Claim(ClaimKind.LATER, Holds("b"), then=Holds("done")), "tick tock tick go tock"),
    "weak": lambda: certified(TURNS, _leads(Fairness.WEAK)),
    "strong": lambda: certified(SOMETIMES, _leads(Fairness.STRONG)),
    "unanswered": lambda: _invented(
        SOMETIMES, _leads(Fairness.WEAK, ClaimKind.NOT_LEADS_TO), "tick now again", "tock tick"
    ),
    "unfolded": lambda: certified(TURNS, Claim(ClaimKind.LTL, parse_temporal("G (fires(go) -> X done)"))),
    "lasso": lambda: _invented(TURNS, Claim(ClaimKind.NOT_LTL, parse_temporal("G F done")), "tick", "tock tick"),
    "unordered": lambda: replace(
        _invented(RACING, Claim(ClaimKind.UNORDERED), ""),
        discipline=Discipline.STEP,
        certificate=FiringSequence((("t", "u"),)),
    ),
    "ordered": lambda: certified(CIRCUIT, Claim(ClaimKind.ORDERED), Discipline.STEP),
    "marked graph": lambda: _theorem(CIRCUIT, Claim(ClaimKind.LIVE)),
    "free choice": lambda: _theorem(CHOICE, Claim(ClaimKind.ALWAYS_POSSIBLE, Start())),
    "free choice by ranks": lambda: by_ranks(_theorem(CHOICE, Claim(ClaimKind.LIVE))),
}
"""The evidence of each kind, true and shown."""
