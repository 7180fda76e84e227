"""Each act of a machine as actions of the proof, told of what this machine and the message that it met say alone.

The actions of the parametric proof change either what one controller holds, or what the coordinator holds, and send
messages. So an act of the code is held to them by one machine before and after it: its memory is told in the relations
of the proof, with the messages that it may rely on having arrived; then `explain` must find actions that lead there,
and whatever the act sends must be in the sets of messages that these actions have filled. As the same act is met in
very many configurations and told once, all acts of an exhaustive exploration are held to the proof.

What the code does beyond the proof is said here: a coordinator that has restarted answers votes of rounds that it does
not know by an abort, which is none of the proof's where the round was committed and is over; whoever gets it has obeyed
that round. A yes that was heard may be replaced by a newer no: that is a vote which was lost. And a coordinator that
has restarted has forgotten votes and acknowledgements, which the proof only ever adds to: it hears them again.
"""

from collections import Counter
from collections.abc import Iterable, Set
from dataclasses import replace

from support.abstraction import Instance, differences, explain, net_structure, play, with_relations
from support.finite_structures import Structure, Thing
from support.told_acts import Closed, Held, decided_by, heard_in, met, newest, ordering, said

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Firing,
    Hello,
    Message,
    ToController,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.exploring import Explorer
from firable.executor.simulation.repertoire import Configuration, Step
from firable.nets.decomposition import Decomposition

Key = tuple[Thing, ...]


class LocalTie:
    """A watcher of an exploration that holds every act to the actions of the proof."""

    def __init__(self, decomposition: Decomposition) -> None:
        self.net = decomposition.net
        self.structure = net_structure(decomposition, (), signals=True)
        self.takes_part = self.structure.relations["takes-part"]
        self.free = self.structure.relations["free"]
        self.coordinators = coordinators(decomposition)
        self.actions: Counter[str] = Counter()
        self.acts: set[object] = set()
        self.steps: set[tuple[object, ...]] = set()
        """Of the present explorer, what was held to the actions already: an act has the same effects each time."""
        self.parts = {name: frozenset(t for t, c in self.takes_part if c == name) for _, name in self.takes_part}
        self.shares: dict[str, Structure] = {}
        self.decided_shares: dict[frozenset[str], Structure] = {}
        self.explorer: Explorer | None = None
        self.held: dict[int, int] = {}
        """Of each machine of the present explorer, what it holds, by its number among all that was held."""
        self.holds: dict[Held, int] = {}

    def __call__(self, explorer: Explorer, before: Configuration, step: Step, after: Configuration) -> None:
        del after
        if step.machine < 0:
            return  # a message is lost: nobody does anything
        if explorer is not self.explorer:
            self.explorer = explorer
            self.held.clear()
            self.steps.clear()
        message = step.about if isinstance(step.about, Message) else None
        asked: tuple[str, ...] = ()
        if isinstance(message, Decision):
            coordinator = explorer.machine(before.machines[explorer.names.index(message.coordinator)])
            assert isinstance(coordinator, Coordinator)
            asked = self._asked(coordinator, message)
        if (key := (step.kind, step.before, step.after, step.about, asked)) in self.steps:
            return
        self.steps.add(key)
        was, now = explorer.machine(step.before), explorer.machine(step.after)
        if isinstance(was, Coordinator) and isinstance(now, Coordinator):
            self._standing(was, now, message, is_crash=step.kind.endswith("crash"))
            act: tuple[object, ...] = (
                step.kind,
                *map(decided_by, (was, now)),
                heard_in(message),
                ordering(step.effects),
            )
            if act not in self.acts:
                self.acts.add(act)
                self._coordinator(was, now, step, message)
        elif isinstance(was, LocalController) and isinstance(now, LocalController):
            holds = self._held(explorer, step.before), self._held(explorer, step.after)
            met_ = met(message) if isinstance(message, ToController) else None
            act = (step.kind.endswith("crash"), *holds, met_, said(step.effects), asked)
            if act not in self.acts:
                self.acts.add(act)
                self._controller(Held.of(explorer, step.before), Held.of(explorer, step.after), step, message, asked)

    def _held(self, explorer: Explorer, number: int) -> int:
        if (known := self.held.get(number)) is None:
            known = self.held[number] = self.holds.setdefault(Held.of(explorer, number), len(self.holds))
        return known

    def _asked(self, coordinator: Coordinator, message: Decision) -> tuple[str, ...]:
        """What the round of a decision had asked of the controller; nothing is known of one that is over."""
        opened = coordinator.rounds.get(message.round)
        names = opened.transitions if opened is not None else ()
        return tuple(t for t in names if (t, message.controller) in self.takes_part)

    def _structure(self, name: str) -> Structure:
        """The things and relations of a decomposition as far as a controller has to do with them."""
        if (known := self.shares.get(name)) is None:
            whole = self.structure
            left_out = {t for t in whole.things["Transition"] if (t, name) not in self.takes_part}
            left_out |= {p for p in whole.things["Place"] if whole.functions["owner"][p] != name}
            known = self.shares[name] = self._without(left_out)
        return known

    def _decided_share(self, names: frozenset[str]) -> Structure:
        """The same as far as the coordinator has to do with transitions: of places it knows nothing."""
        if (known := self.decided_shares.get(names)) is None:
            things = self.structure.things
            left_out = {t for t in things["Transition"] if t not in names} | {*things["Place"]}
            known = self.decided_shares[names] = self._without(left_out)
        return known

    def _without(self, left_out: Set[Thing]) -> Structure:
        """The structure but for some things and what relates them to others."""
        whole = self.structure
        things = {sort: tuple(t for t in those if t not in left_out) for sort, those in whole.things.items()}
        relations = {
            relation: frozenset(key for key in keys if left_out.isdisjoint(key))
            for relation, keys in whole.relations.items()
        }
        return replace(whole, things=things, relations=relations)

    def _told(self, of: Structure, rounds: Iterable[int], **relations: Iterable[Key]) -> Structure:
        numbers = tuple(sorted(set(rounds)))
        things = {**of.things, "Round": numbers, "Coordinator": self.coordinators}
        whose: dict[Thing, Thing] = {number: self._whose(number) for number in numbers}
        functions = {**of.functions, "coordinator-of": whose}
        return with_relations(replace(of, things=things, functions=functions), **relations)

    def _whose(self, number: int) -> str:
        return self.coordinators[number % len(self.coordinators)]

    # --- A controller

    def _controller(self, was: Held, now: Held, step: Step, message: Message | None, asked: tuple[str, ...]) -> None:
        name, obeyed_before, obeyed_after = was.name, dict(was.obeyed), dict(now.obeyed)
        closed_before, closed_after = dict(was.closed_below), dict(now.closed_below)
        promised_before, promised_after = dict(was.promises), dict(now.promises)
        if not step.kind.endswith("crash"):
            for each, closed in closed_after.items():
                heard = message.closed_below if isinstance(message, ToController) and message.coordinator == each else 0
                assert closed == max(closed_before[each], heard), f"closed at {each}: {step}"
        below = {each: max(obeyed_before[each][0], obeyed_after[each][0]) for each in closed_before}
        rounds = {*promised_before, *promised_after}
        rounds |= {r for kept in (obeyed_before, obeyed_after) for _, numbers in kept.values() for r in numbers}
        asked_of: dict[int, set[str]] = {}
        for holds in (was, now):
            for number, promised in holds.promises:
                asked_of.setdefault(number, set()).update(promised)
        if isinstance(message, VoteRequest):
            asked_of.setdefault(message.round, set()).update(message.transitions)
        if isinstance(message, Decision):
            asked_of.setdefault(message.round, set()).update(asked)
            asked_of[message.round] |= {message.committed} if message.committed in self.parts[name] else set()
        rounds |= set(asked_of)
        # Below what is closed, a promise that still stands is of a round that a restart of the coordinator gave up.
        given_up = {number for number in promised_before if number < closed_after[self._whose(number)]}
        asked_keys = [
            (r, t, name)
            for r, names in asked_of.items()
            for t in names
            if (t, name) not in self.free
            or (isinstance(message, Decision) and (r, t) == (message.round, message.committed))
        ]
        commit = [
            k for k in asked_keys if isinstance(message, Decision) and k[:2] == (message.round, message.committed)
        ]
        abort = [k for k in asked_keys if isinstance(message, Decision) and k[0] == message.round and k not in commit]
        abort += [key for key in asked_keys if key[0] in given_up]
        request = [k for k in asked_keys if isinstance(message, VoteRequest) and k[0] == message.round]

        # The vote stands that an order finds, and whatever is told now.
        reports = [] if step.kind.endswith("crash") else [e for e in step.effects if isinstance(e, ToCoordinator)]
        last_told = newest(reports)
        voted = {
            (t, name)
            for report in reports
            if report.readiness.sequence == last_told[report.coordinator]
            for t in report.readiness.transitions
        } & self.free
        earlier = {(t, name) for report in reports for t in report.readiness.transitions} & self.free - voted
        assert earlier <= {key[1:] for key in commit}, f"a vote that does not stand: {step}"

        def told(holds: Held, kept: Closed, voted: set[Key]) -> Structure:
            found = {
                key[1:] for key in commit if key[1:] in self.free and not _is_over(key[0], kept[self._whose(key[0])])
            }
            promised = [(r, t, name) for r, names in holds.promises for t in names]
            # Obeyed is what outlives a crash. Below what is closed, each round is closed or given up: told as closed.
            over = {r for r in rounds if r < kept[self._whose(r)][0] or r in kept[self._whose(r)][1]}
            obeyed = {key for key in asked_keys if key[0] in over}
            forgotten = {r for r in rounds if r < kept[self._whose(r)][0] and r not in given_up}
            obeyed |= {(r, str(t), name) for r in forgotten for t in self.parts[name]}
            return self._told(
                self._structure(name),
                rounds,
                marked=[(each,) for each in holds.marked],
                begun=[(r,) for r in rounds],
                closed=[(r,) for r in rounds if r < below[self._whose(r)] and r not in given_up],
                committed=[key[:2] for key in commit],
                promised=promised,
                stands=found | voted,
                obeyed=obeyed,
                request=request,
                commit_order=commit,
                abort_order=abort,
            )

        first, last = told(was, obeyed_before, set()), told(now, obeyed_after, set(voted))
        first = self._sending(first, "vote", first.relations["promised"])
        first = self._sending(first, "acknowledgement", first.relations["obeyed"])
        last = self._sending(last, "vote", first.relations["vote"] | last.relations["promised"])
        fresh = last.relations["obeyed"] - first.relations["obeyed"]
        ordered = frozenset(key for key in fresh if (key[0],) not in first.relations["closed"])
        last = self._sending(last, "acknowledgement", first.relations["acknowledgement"] | ordered)
        # What has been given up is released before anything else is done.
        released: list[Instance] = [("release", (r, t, name)) for r in given_up for t in promised_before[r]]
        first = play(first, released)
        self.actions.update(action for action, _ in released)
        fired = [e.transition for e in step.effects if isinstance(e, Firing)]
        # Who is held after a restart sends no command, and clears its signals all the same.
        # An order that was obeyed before, or is lost in a crash, clears nothing: the restart does.
        moved = {*fired, *(t for r, t, whose in commit if (r, t, whose) in fresh)}
        cleared = {signal for t, signal in self.structure.relations["clears"] if t in moved}
        places = {place.name for place in self.net.places}
        changed = {key[0] for key in first.relations["marked"] ^ last.relations["marked"]} - places
        held = {key[0] for key in last.relations["marked"]}
        sensed = sorted(str(each) for each in changed if each not in cleared or each in held)
        self._explained(first, last, fired, sensed, step)
        for effect in step.effects:
            match effect:
                case Vote():
                    assert {(effect.round, t, name) for t in effect.promised} <= last.relations["vote"], step
                case Acknowledgement() if effect.round in rounds:
                    assert {k for k in asked_keys if k[0] == effect.round} <= last.relations["obeyed"], step

    # --- The coordinator

    def _coordinator(self, was: Coordinator, now: Coordinator, step: Step, message: Message | None) -> None:
        known = {**now.rounds, **was.rounds}
        rounds = set(known)
        is_crash = step.kind.endswith("crash")
        asked_keys = [(r, t, c) for r, o in known.items() for t in o.transitions for c in now.participants[t]]
        asked_of = frozenset(t for opened in known.values() for t in opened.transitions)
        commits = {r: opened.committed for r, opened in known.items()}
        stands = {key for key in self._standing(was, now, message, is_crash=is_crash) if key[0] in asked_of}
        votes: list[tuple[int, str, str]] = []
        if isinstance(message, Vote) and message.round in rounds:
            votes = [(message.round, t, message.controller) for t in message.promised]
        notes: list[tuple[int, str, str]] = []
        if isinstance(message, Acknowledgement):
            notes = [key for key in asked_keys if (key[0], key[2]) == (message.round, message.controller)]
            notes = [key for key in notes if key[1:] not in self.free or commits[key[0]] == key[1]]

        def told(machine: Coordinator) -> Structure:
            begun = {r for r in rounds if r in was.rounds or r in machine.rounds}
            over = {r for r in begun if r not in machine.rounds}
            # A round that a crash has taken from memory was given up, then or before; any other that is gone is over.
            lost = {r for r in over if is_crash and was.rounds[r].committed is None}
            of = {r: machine.rounds.get(r) or was.rounds[r] for r in begun}
            decided = over | {r for r in begun if of[r].decided}
            committed = {r: str(of[r].committed) for r in decided if of[r].committed is not None}
            heard = {
                (r, t, c) for r in begun for c, yes in of[r].votes.items() for t in yes if (t, c) in self.takes_part
            }
            if machine is now and is_crash:  # votes and acknowledgements are not kept: to hear them again is no harm
                heard |= {(r, t, c) for r, o in was.rounds.items() for c, yes in o.votes.items() for t in yes}
                heard |= set(votes)
            noted = {
                key
                for key in asked_keys
                if (key[1:] not in self.free or committed.get(key[0]) == key[1])
                and key[0] in decided
                and (key[0] in over - lost or key[2] in of[key[0]].acknowledged)
            }
            if machine is now and is_crash:
                noted |= {
                    key
                    for key in asked_keys
                    if (key[1:] not in self.free or committed.get(key[0]) == key[1])
                    and key[0] in was.rounds
                    and key[2] in was.rounds[key[0]].acknowledged
                }
                noted |= {key for key in notes if was.rounds[key[0]].decided}
            mine = [key for key in asked_keys if key[0] in begun]
            promising = [key for key in mine if key[1:] not in self.free]
            return self._told(
                self._decided_share(asked_of),
                rounds,
                begun=[(r,) for r in begun],
                asked=[key[:2] for key in mine],
                heard=heard,
                decided=[(r,) for r in decided],
                committed=list(committed.items()),
                noted=noted,
                closed=[(r,) for r in over - lost],
                request=promising,
                stands=stands,
                vote=[*heard, *votes],
                commit_order=[k for k in mine if k[0] in decided and committed.get(k[0]) == k[1]],
                abort_order=[k for k in promising if k[0] in decided and committed.get(k[0]) != k[1]],
                acknowledgement=[*noted, *notes],
            )

        first, last = told(was), told(now)
        if is_crash:
            self._keep(first, last, known)
        # A yes that a newer no has replaced is a vote that was lost.
        taken_back = first.relations["heard"] - last.relations["heard"]
        if taken_back:
            kept = first.relations["heard"] - taken_back
            first = with_relations(first, heard=kept)
        # Only what was heard before, or arrives now, may be heard.
        last = self._sending(last, "vote", first.relations["vote"])
        arrived = first.relations["acknowledgement"]
        last = self._sending(last, "acknowledgement", arrived)
        if step.kind == "crash":
            reached = play(first, [("restart", (was.name,))])
            assert not differences(reached, last), (step, differences(reached, last))
            self.actions["restart"] += 1
        else:
            self._explained(first, last, [], [], step)
        for effect in step.effects if not is_crash else ():
            match effect:
                case VoteRequest():
                    sent = {(effect.round, t, effect.controller) for t in effect.transitions}
                    assert sent <= last.relations["request"], step
                case Decision() if effect.round in rounds:
                    orders = last.relations["commit-order"] | last.relations["abort-order"]
                    sent = {k for k in asked_keys if (k[0], k[2]) == (effect.round, effect.controller)}
                    sent = {k for k in sent if k[1:] not in self.free or k[1] == effect.committed}
                    assert sent, f"an order to nobody: {step}"
                    assert sent <= orders, step
                    assert (effect.round, effect.committed) in last.relations["committed"] or not effect.committed
                case Decision():
                    assert effect.committed is None, f"{effect} of a round that is not known"
                    self.actions["(an old round is said to be over)"] += 1
            if isinstance(effect, VoteRequest | Decision | Hello):
                assert all(r >= effect.closed_below for r in now.rounds), f"{effect} while an older round is open"

    def _standing(self, was: Coordinator, now: Coordinator, message: Message | None, *, is_crash: bool) -> set[Key]:
        """The votes of free parts that count here: such as counted before, and of a report of this epoch."""

        def counted(machine: Coordinator) -> set[Key]:
            return {(t, c) for c, names in machine.ready.items() for t in names if (t, c) in self.free}

        told = message if isinstance(message, ToCoordinator) else None
        if is_crash:  # what it has counted it has forgotten, and may have decided on before
            heard = told.readiness.transitions if told is not None and told.readiness.epoch == was.epoch else ()
            return counted(was) | {(t, told.controller) for t in heard if told is not None} & self.free
        if fresh := counted(now) - counted(was):
            assert told is not None, f"nobody has told of {fresh}"
            assert told.readiness.epoch == now.epoch, f"a vote of another epoch counts: {told}"
            assert fresh <= {(t, told.controller) for t in told.readiness.transitions}, told
        return counted(now)

    def _keep(self, first: Structure, last: Structure, known: object) -> None:
        lost = first.relations["committed"] - last.relations["committed"]
        assert not lost, f"a crash has lost what was committed: {lost}, {known}"

    # --- Both

    def _sending(self, structure: Structure, relation: str, keys: Iterable[Key]) -> Structure:
        return with_relations(structure, **{relation: keys})

    def _explained(self, first: Structure, last: Structure, fired: list[str], sensed: list[str], step: Step) -> None:
        # What the central net holds is not in one machine; that it can follow is proved of these same actions.
        def compared(structure: Structure) -> Structure:
            return with_relations(structure, shadow=last.relations["shadow"])

        try:
            steps: list[Instance] = explain(first, last, fired, sensed, compared)
        except AssertionError as failed:
            raise AssertionError(f"{step.kind} at {step.machine} of {step.about}: {failed}") from failed
        self.actions.update(name for name, _ in steps)


def _is_over(number: Thing, kept: tuple[int, frozenset[int]]) -> bool:
    """Whether a round is decided, as far as a controller has kept."""
    return isinstance(number, int) and (number < kept[0] or number in kept[1])
