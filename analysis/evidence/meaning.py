"""What a verdict comes down to in claims: the definitions of SEMANTICS once more, from the net alone.

A document of evidence says "this verdict is so, because these claims are", and whether they are enough is not left to
who wrote it. Here stands for each verdict what suffices, in terms of the net: which formula contact is, which pairs of
places send different commands to one machine. Verdicts that are read off the net itself want no claim; they are read
off it again.

Some verdicts have several ways. That a transition is live may be said of it alone, or by a home marking: from
everywhere one marking can be reached, and from that one a run fires the transition. What holds in every deadlock is
always possible where some deadlock can be reached from everywhere. That no marking is doomed says the same as that none
is a deadlock: a deadlock is doomed, and where there is none every run goes on.

The techniques have formulas of their own for the same things (`firable.analysis.verdicts`); tests hold the two to each
other.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import combinations, permutations

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.by_goals import said_by_goals
from firable.analysis.evidence.claims import NEVER_FALSE, TRUE, Claim, ClaimKind, marking_of, temporal_claim, tidy
from firable.analysis.evidence.read_off import eager_cycle, read_off
from firable.analysis.evidence.refusal import in_time
from firable.nets.formula import (
    And,
    Compare,
    Constant,
    Count,
    Deadlock,
    Firable,
    Formula,
    Holds,
    Not,
    Or,
    Sign,
    Start,
)
from firable.nets.net import Net, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import (
    Fires,
    ForAll,
    Globally,
    Logic,
    Next,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    format_temporal,
    parse_temporal,
)
from firable.semantics.conflict import jointly_openable, structural_conflicts
from firable.semantics.trace import Discipline


def contact(net: Net, *, openable: bool = False) -> Formula:
    """Some transition is in contact, of all or of those whose external gates can be opened."""
    of = (t for t in net.transitions if set(t.outputs) - set(t.inputs) and (t.openable or not openable))
    return tidy(Or(tuple(map(in_contact_formula, of))))


def in_contact_formula(t: Transition) -> Formula:
    """The state formula "this transition is in contact" (`firable.semantics.firing.in_contact`)."""
    satisfied: Iterator[Formula] = (Holds(place) for place in (*t.inputs, *t.permissive))
    open_: Iterator[Formula] = (Not(Holds(place)) for place in t.inhibitive)
    full = Or(tuple(Holds(place) for place in t.outputs if place not in t.inputs))
    return And((*satisfied, *open_, full))


def competing(net: Net) -> Formula | None:
    """Two transitions in structural conflict, openable together, are both firable; None for too many pairs to list."""
    by_input, by_output = structural_conflicts(net)
    if by_input.more or by_output.more:
        return None
    names = [t.name for t in net.transitions]
    pairs = (pair for pair in dict.fromkeys((*by_input.pairs, *by_output.pairs)) if jointly_openable(net, pair))
    return _some(And((Firable(names[t]), Firable(names[u]))) for t, u in pairs)


def commands_clash(net: Net, deadline: Deadline = NEVER) -> Formula:
    """Two places that send different commands to one machine hold a token."""
    sending = [(place.name, place.command) for place in net.places if place.command is not None]
    groups: dict[str, list[int]] = {}
    for i, (_, command) in enumerate(sending):
        groups.setdefault(command.machine, []).append(i)
    pairs = ((i, k) for group in groups.values() for i, k in combinations(group, 2))
    return _together(
        (sending[i][0], sending[k][0]) for i, k in in_time(pairs, deadline) if sending[i][1] != sending[k][1]
    )


def completions_clash(net: Net, deadline: Deadline = NEVER) -> Formula:
    """Two places that wait for one completion signal hold a token."""
    waiting: dict[str, list[str]] = {}
    for place in net.places:
        if place.completion is not None:
            waiting.setdefault(place.completion, []).append(place.name)
    pairs = (pair for group in waiting.values() for pair in combinations(group, 2))
    return _together(in_time(pairs, deadline))


def _together(pairs: Iterable[tuple[str, str]]) -> Formula:
    return _some(And((Holds(p), Holds(q))) for p, q in pairs)


def _some(parts: Iterable[Formula]) -> Formula:
    return tidy(Or(tuple(parts)))


def senders(net: Net) -> dict[str, dict[str, tuple[str, ...]]]:
    """For each machine and each name of a command of it, the transitions that put a token where it is sent."""
    found: dict[str, dict[str, set[int]]] = {}
    for p, place in enumerate(net.places):
        if place.command is not None:
            of = found.setdefault(place.command.machine, {}).setdefault(place.command.command, set())
            of.update(net.producers[p])
    return {
        machine: {name: tuple(net.transitions[t].name for t in sorted(of)) for name, of in names.items()}
        for machine, names in found.items()
    }


def in_each_deadlock(goal: Formula) -> Claim:
    """That a goal holds in each deadlock.

    As a formula of CTL, which a set of markings shows by itself: "never" would ask the solvers about each goal.
    """
    always = ForAll(Globally(Or((Not(Deadlock()), goal))))
    return Claim(ClaimKind.CTL, parse_temporal(format_temporal(always)))


def some_firable(names: Iterable[str]) -> Formula:
    """One of these transitions may fire."""
    return _some(Firable(name) for name in names)


def tokens_at_least(places: tuple[str, ...], bound: int) -> Formula:
    """The places hold so many tokens together, a place that stands twice counting twice."""
    return tidy(Compare(Count(places), Sign.AT_LEAST, Count(added=bound)))


class Shown:
    """The claims that are shown, asked for what they say together."""

    def __init__(self, net: Net, claims: Collection[Claim], deadline: Deadline = NEVER) -> None:
        self.net, self.deadline = net, deadline
        self.claims = frozenset(claims)
        homes = (c.state_goal for c in claims if c.kind is ClaimKind.ALWAYS_POSSIBLE)
        self.homes = {home for home in homes if marking_of(net, home) is not None}
        of_runs = [c for c in claims if c.kind in {ClaimKind.FIRES, ClaimKind.IN_ORDER}]
        from_the_start = {TRUE, *self.homes}
        self.fired = {name for claim in of_runs if claim.goal in from_the_start for name in claim.fires}
        self.fired_at_home = {name for claim in of_runs if claim.goal in self.homes for name in claim.fires}
        later = (claim for claim in claims if claim.kind is ClaimKind.LATER)
        self.met_at_home = {claim.then for claim in later if claim.goal in self.homes}

    def __contains__(self, claim: Claim) -> bool:
        return claim in self.claims or claim == NEVER_FALSE

    def live(self, name: str) -> bool:
        """Whether a transition is shown to be live."""
        possible = Claim(ClaimKind.ALWAYS_POSSIBLE, Firable(name))
        return name in self.fired_at_home or possible in self or Claim(ClaimKind.LIVE) in self

    def possible(self, goal: Formula) -> bool:
        """Whether it is shown that the goal can be reached from everywhere.

        By itself, from a home marking, or as it holds in each deadlock, and some can be reached from everywhere.
        """
        by_itself = goal in self.met_at_home or Claim(ClaimKind.ALWAYS_POSSIBLE, goal) in self
        return by_itself or (Claim(ClaimKind.ALWAYS_POSSIBLE, Deadlock()) in self and in_each_deadlock(goal) in self)

    def fires(self, name: str) -> bool:
        """Whether a transition is shown to fire in some run."""
        return name in self.fired or Claim(ClaimKind.REACHABLE, Firable(name)) in self or self.live(name)

    def dead(self, name: str) -> bool:
        """Whether a transition is shown never to fire."""
        return Claim(ClaimKind.NEVER, Firable(name)) in self

    def nonlive(self, name: str) -> bool:
        """Whether a transition is shown not to be live."""
        return self.dead(name) or Claim(ClaimKind.LOST, Firable(name)) in self

    def deadlock_free(self) -> bool:
        """Whether no deadlock is shown to be reachable."""
        return Claim(ClaimKind.NEVER, Deadlock()) in self or any(self.live(t.name) for t in self.net.transitions)

    def home(self) -> bool:
        """Whether some marking is shown to be a home marking."""
        return bool(self.homes) or Claim(ClaimKind.HOME) in self

    def homeless(self) -> bool:
        """Whether none is: from one marking something always holds, and from another it never holds again."""
        lost = {claim.goal for claim in self.claims if claim.kind is ClaimKind.LOST}
        return any(Not(goal) in lost for goal in lost if isinstance(goal, Formula))


def suffices(
    net: Net,
    discipline: Discipline,
    name: str,
    proved: bool,
    claims: Collection[Claim],
    query: Query | None,
    deadline: Deadline = NEVER,
) -> bool:
    """Whether these claims say that a verdict is proved, or that it is violated; `query` is that of a `query.NAME`.

    Raises `TimeIsOverError`.

    >>> from firable.nets.catalogue.families import family_net
    >>> net, free = family_net("token_ring-3"), Claim(ClaimKind.NEVER, Deadlock())
    >>> suffices(net, Discipline.INTERLEAVING, "deadlock-free", True, [free], None)
    True
    """
    shown, every = Shown(net, claims, deadline), [t.name for t in net.transitions]
    match name:
        case "contact-free":
            return _never(shown, contact(net), proved)
        case "deadlock-free" | "doomed-markings":
            return shown.deadlock_free() if proved else Claim(ClaimKind.REACHABLE, Deadlock()) in shown
        case "quasi-live":
            return all(map(shown.fires, every)) if proved else any(map(shown.dead, every))
        case "live":
            return all(map(shown.live, every)) if proved else any(map(shown.nonlive, every))
        case "reversible":
            return Claim(ClaimKind.ALWAYS_POSSIBLE if proved else ClaimKind.LOST, Start()) in shown
        case "home-markings":
            return shown.home() if proved else shown.homeless()
        case "conflicting-commands":
            return _never(shown, commands_clash(net, deadline), proved)
        case "shared-completions":
            return _never(shown, completions_clash(net, deadline), proved)
        case "effective-conflicts":
            goal = competing(net)
            return goal is not None and Claim(ClaimKind.NEVER, goal) in shown if proved else _compete(shown)
        case "machine-never-stopped":
            return _stopped(shown) if proved else _never_stopped(shown)
        case "starvation":
            return _served(shown, proved)
        case "self-loops" | "structural-conflicts" | "gate-races" | "output-signals-in-M0":
            return read_off(net, discipline, name, deadline) is proved
        case "steps-serialisable" if discipline is Discipline.STEP:  # no verdict of single firings
            said = Claim(ClaimKind.ORDERED if proved else ClaimKind.UNORDERED) in shown
            return said or read_off(net, discipline, name, deadline) is proved
    kind, _, of = name.partition(".")
    if kind == "property":
        return any(_property(shown, one, proved) for one in net.properties if one.name == of)
    return kind == "query" and query is not None and query.name == of and _query(shown, query, proved)


def _compete(shown: Shown) -> bool:
    """Whether two transitions that share a place, and are openable together, are shown to be firable together."""
    for claim in shown.claims:
        match claim:
            case Claim(ClaimKind.REACHABLE, And((Firable(one), Firable(other)))) if compete(shown.net, one, other):
                return True
    return False


def compete(net: Net, one: str, other: str) -> bool:
    """Whether two transitions share an input or an output place, and one valuation opens the gates of both."""
    t, u = net.transition(one), net.transition(other)
    shared = {*t.inputs} & {*u.inputs} or {*t.outputs} & {*u.outputs}
    pair = net.transition_index[one], net.transition_index[other]
    return one != other and bool(shared) and jointly_openable(net, pair)


def _never(shown: Shown, bad: Formula, proved: bool) -> bool:
    return Claim(ClaimKind.NEVER if proved else ClaimKind.REACHABLE, bad) in shown


def _stopped(shown: Shown) -> bool:
    """Each command is never sent, or some run sends it and, at another moment, another one to its machine."""
    followed = _followed(shown)
    return all(
        (machine, name) in followed or Claim(ClaimKind.NEVER, some_firable(sending)) in shown
        for machine, names in senders(shown.net).items()
        for name, sending in names.items()
    )


def _followed(shown: Shown) -> set[tuple[str, str]]:
    """The commands, by machine and name, that come before or after another one of their machine.

    What one firing sends at once, or one step, does not follow each other; so the claims must be of firings in order.
    """
    sends: dict[str, list[tuple[str, str]]] = {}
    for machine, names in senders(shown.net).items():
        for name, sending in names.items():
            for t in sending:
                sends.setdefault(t, []).append((machine, name))
    found: set[tuple[str, str]] = set()
    for claim in shown.claims:
        if claim.kind is ClaimKind.IN_ORDER:
            spans: dict[str, dict[str, tuple[int, int]]] = {}  # of each command the first moment and the last
            for moment, t in enumerate(claim.fires):
                for machine, name in sends.get(t, ()):
                    of = spans.setdefault(machine, {})
                    of[name] = of.get(name, (moment, moment))[0], moment
            for machine, of in spans.items():
                for one, other in permutations(of, 2):
                    if of[one][0] < of[other][1]:
                        found |= {(machine, one), (machine, other)}
    return found


def _never_stopped(shown: Shown) -> bool:
    """A command is sent, and its machine knows no other, or none is sent at another moment of any run."""
    return any(
        any(map(shown.fires, sending)) and (not others or Claim(ClaimKind.LTL, never_beside(sending, others)) in shown)
        for sending, others in commands(shown.net)
    )


def commands(net: Net) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """For each command who sends it, and who sends others to its machine."""
    for names in senders(net).values():
        for name, sending in names.items():
            yield sending, tuple(dict.fromkeys(t for other, of in names.items() if other != name for t in of))


def never_beside(one: tuple[str, ...], others: tuple[str, ...]) -> Temporal:
    """In LTL: after one of these fires none of those does any more, and the other way round.

    >>> format_temporal(never_beside(("t",), ("u",)))
    'G (not fires(t) or X G not fires(u)) and G (not fires(u) or X G not fires(t))'
    """

    def none(names: tuple[str, ...]) -> Temporal:
        return TemporalNot(Fires(names[0]) if len(names) == 1 else TemporalOr(tuple(map(Fires, names))))

    def after(first: tuple[str, ...], then: tuple[str, ...]) -> Temporal:
        return Globally(TemporalOr((none(first), Next(Globally(none(then))))))

    found = [after(first, then) for first, then in ((one, others), (others, one)) if first and then]
    whole = TemporalAnd(tuple(found)) if len(found) > 1 else Constant(value=True)
    return parse_temporal(format_temporal(whole))


def _served(shown: Shown, proved: bool) -> bool:
    """A transition that does not fire for ever is not live; where there is no arbitrated run, that is all of them."""
    again = eager_cycle(shown.net, shown.deadline)
    if again is None and not proved:
        return False
    waiting = [t.name for t in shown.net.transitions if t.name not in (again or ())]
    return all(map(shown.nonlive, waiting)) if proved else any(map(shown.live, waiting))


def _property(shown: Shown, of: Property | TemporalProperty, proved: bool) -> bool:
    if isinstance(of, TemporalProperty):
        return _temporal(shown, of.logic, of.formula, proved)
    claim = property_claim(of, proved=proved)
    return shown.possible(claim.state_goal) if claim.kind is ClaimKind.ALWAYS_POSSIBLE else claim in shown


def property_claim(of: Property, *, proved: bool) -> Claim:
    """The claim that a property of a net file is, or its opposite."""
    match of.kind:
        case PropertyKind.NEVER:
            return Claim(ClaimKind.NEVER if proved else ClaimKind.REACHABLE, of.formula)
        case PropertyKind.ALWAYS:
            return Claim(ClaimKind.NEVER if proved else ClaimKind.REACHABLE, Not(of.formula))
        case PropertyKind.REACHABLE:
            return Claim(ClaimKind.REACHABLE if proved else ClaimKind.NEVER, of.formula)
        case PropertyKind.ALWAYS_POSSIBLE:
            return Claim(ClaimKind.ALWAYS_POSSIBLE if proved else ClaimKind.LOST, of.formula)
        case PropertyKind.LEADS_TO:
            kind = ClaimKind.LEADS_TO if proved else ClaimKind.NOT_LEADS_TO
            return Claim(kind, of.formula, of.then or Constant(value=False), of.fairness)


def _temporal(shown: Shown, logic: Logic | QueryKind, formula: Temporal, proved: bool) -> bool:
    if temporal_claim(logic, formula, proved=proved) in shown:
        return True
    branching = logic.value == Logic.CTL.value
    return branching and said_by_goals(shown.net, formula, shown.__contains__, holds=proved)


def _query(shown: Shown, query: Query, proved: bool) -> bool:
    net, every = shown.net, [t.name for t in shown.net.transitions]
    match query.kind:
        case QueryKind.CTL | QueryKind.LTL if query.formula is not None:
            return _temporal(shown, query.kind, query.formula, proved)
        case QueryKind.LIVE:
            return all(map(shown.live, every)) if proved else any(map(shown.nonlive, every))
        case QueryKind.QUASI_LIVE:
            return all(map(shown.fires, every)) if proved else any(map(shown.dead, every))
        case QueryKind.STABLE_MARKING:
            return (any if proved else all)(_stable(shown, place.name, proved) for place in net.places)
        case QueryKind.ONE_SAFE:
            loops = any(t.self_loops for t in net.transitions)
            return not loops and _never(shown, contact(net, openable=True), proved)
        case QueryKind.BOUND:
            return proved and bound_shown(shown, query.places) is not None
    return False


def _stable(shown: Shown, place: str, proved: bool) -> bool:
    both = (Holds(place), Not(Holds(place)))
    if proved:
        return any(Claim(ClaimKind.NEVER, one) in shown for one in both)
    return all(Claim(ClaimKind.REACHABLE, one) in shown for one in both)


def bound_shown(shown: Shown, places: tuple[str, ...]) -> int | None:
    """The greatest number of tokens on places that the claims show; None where they show none."""
    for bound in in_time(range(len(places) + 1), shown.deadline):
        reached = not bound or Claim(ClaimKind.REACHABLE, tokens_at_least(places, bound)) in shown
        if reached and (bound == len(places) or Claim(ClaimKind.NEVER, tokens_at_least(places, bound + 1)) in shown):
            return bound
    return None
