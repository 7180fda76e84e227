"""The steps of the protocol with rounds: ask, promise, hear, decide, order, apply, acknowledge, close.

Each step is a few transitions of the protocol net; `docs/protocol.md` tells the protocol itself. What the net merges,
and why nothing is lost by it:

- *To send again is to send.* The coordinator may send a request or an order whenever the answer has not come, so the
  first message and all repetitions are one transition. A channel holds one copy of each message: a second one waits to
  be sent until the first has arrived, or has been lost; what it would have said, the first has said.
- *A request that cannot be answered yes waits.* A controller that answers "no" says nothing that the coordinator may
  rely on, and it may be asked again; so a no is a request that is still on its way.
- *Whoever ignores a message may do so at once.* A round closes when all its messages have arrived. A message of the
  round that arrives after the close is ignored, because it carries the number of an older round; and in the net it is
  ignored just before the close, which is always possible and changes nothing else. So round numbers need no places:
  there is one round for each group, and what it leaves behind is empty. Where votes or orders carry no number, this is
  not so, and their channels stay as they are.
- *A close takes its parts one after the other*, transition by transition of the group, while the group is decided and
  nothing can be asked.
- *A part that is free of promise* votes when it is firable and no promise at its controller is disturbed. The yes
  stands until an order is applied, whatever rounds come between, and so it may arrive, and be heard, at any time until
  its transition is committed. From then on it is used up: what is still on its way, or is said again before the order
  comes, is older than the acknowledgement, and known for that by its number. A transition without any part that
  promises is not asked for; it is decided when the votes are heard.
"""

from __future__ import annotations

from collections.abc import Sequence

from firable.decompose.protocol.draft import Draft, Effect, Step, at, blind, channels_of, guarded
from firable.decompose.protocol.parts import Part, Parts


def add_rounds(draft: Draft, parts: Parts) -> None:
    """Add every step of the rounds; the places are there."""
    for g, group in enumerate(parts.groups):
        for t in group:
            _coordinator(draft, parts, t, group, decided(parts, t))
            for part in parts.coordinated[t]:
                if part.free:
                    _standing(draft, parts, part)
                else:
                    _promising(draft, parts, part, decided(parts, t))
                _ordering(draft, parts, part, decided(parts, t))
                _obeying(draft, parts, part)
        if len(group) > 1:
            close = Step("close", f"the round of {_listed(group)} is closed", coordinator=parts.decider(group[0]))
            draft.step(
                f"close-round/{g}", close, [decided(parts, group[0])], (), (), [is_open(parts, t) for t in group]
            )


def asked(t: str) -> str:
    """The coordinator asks for a transition in the present round of its group."""
    return f"asked/{t}"


def committed(t: str) -> str:
    """The present round of the group of a transition was decided for it."""
    return f"committed/{t}"


def is_open(parts: Parts, t: str) -> str:
    """The place that keeps the round of a transition open: asked for, or committed where nobody has to be asked."""
    return asked(t) if parts.promising(t) else committed(t)


def decided(parts: Parts, t: str) -> str:
    """The present round of the group of a transition is decided, one way or the other."""
    return f"decided/{'+'.join(parts.groups[parts.group_of[t]])}"


def _coordinator(draft: Draft, parts: Parts, t: str, group: Sequence[str], over: str) -> None:
    its, promising = parts.coordinated[t], parts.promising(t)
    heard = [at("heard", part) for part in its]
    others = [is_open(parts, u) for u in parts.coordinated if u != t] if parts.variant.one_round else []
    who, by = parts.decider(t), _by(parts, t)
    asks = [asked(t)] if promising else []
    if promising:
        ask = Step("ask", f"{who} asks for {t}", coordinator=who)
        draft.step(f"ask/{t}", ask, (), asks, (), [*asks, over, *others])
        given_up = Step("give-up", f"the round of {_listed(group)} is given up{by}", coordinator=who)
        draft.step(f"give-up/{t}", given_up, (), [over], asks, [over])
    decide = Step("decide", f"{t} is decided{by}", fires=t, coordinator=who)
    draft.fire(f"decide/{t}", decide, heard, [committed(t), over], asks, [over])
    if not parts.variant.unanimous and len(its) > 1:
        for part in its:
            words = f"{t} is decided{by} without the vote of {part.controller}"
            without = Step("decide", words, fires=t, coordinator=who)
            votes = [at("heard", other) for other in its if other is not part]
            draft.fire(
                f"decide/{t}/without/{part.controller}",
                without,
                votes,
                [committed(t), over],
                asks,
                [over, at("heard", part)],
            )

    def left(some: Sequence[Part]) -> list[str]:
        return [at(channel, part) for part in some for channel in _cleared(parts, part)]

    def answered(some: Sequence[Part]) -> list[str]:
        return [at(kind, part) for part in some for kind in ("noted", "obeyed")]

    words = f"the round of {t} is closed" if len(group) == 1 else f"{t} is settled in its round"
    close = Step("close", words, coordinator=who)
    ends, needs = ([over], []) if len(group) == 1 else ([], [over])
    draft.step(f"close/{t}", close, [*asks, *answered(its), *ends, committed(t)], (), needs, left(its))
    if promising:
        empty = [*left(promising), committed(t)]
        draft.step(f"close/{t}/aborted", close, [*asks, *answered(promising), *ends], (), needs, empty)


def _cleared(parts: Parts, part: Part) -> list[str]:
    """The channels of a part that are empty when a round closes: what comes later is known to be of an older round."""
    kept = set() if parts.votes_numbered(part) else {"request", "vote"}
    kept |= set() if parts.orders_numbered(part) else {"commit-order"}
    return [channel for channel in channels_of(part) if channel not in kept]


def _promising(draft: Draft, parts: Parts, part: Part, over: str) -> None:
    """How a part is asked for a promise, and votes."""
    t, c = part.whole, part.controller
    request, vote, heard, promised, obeyed = (
        at(kind, part) for kind in ("request", "vote", "heard", "promised", "obeyed")
    )
    who = parts.decider(t)
    sent = Step("request", f"{who} requests the vote of {c} on {t}", coordinator=who)
    draft.step(f"send-request/{t}/{c}", sent, (), [request], [asked(t)], [over, heard, request])
    draft.step(
        f"promise/{t}/{c}",
        Step("promise", f"{c} votes yes on {t}", c),
        [request],
        [promised, vote],
        [*part.inputs, *part.permissive, *(copy(c, place) for place in part.copied_full)],
        [
            *part.outputs,
            *part.inhibitive,
            *(copy(c, place) for place in part.copied_empty),
            *(at("promised", other) for other in parts.excluding(part)),
            *(promised, vote, obeyed),
        ],
    )
    again = Step("promise", f"{c} repeats its yes on {t}", c)
    draft.step(f"promise/{t}/{c}/again", again, [request], [vote], [promised], [vote])
    old = Step("ignore", f"{c} ignores a late request for {t}", c)
    draft.step(f"ignore-request/{t}/{c}", old, [request], (), [obeyed])
    heard_of = Step("hear", f"the yes of {c} on {t} arrives", coordinator=who)
    draft.step(f"hear/{t}/{c}", heard_of, [vote], [heard], (), [heard, over])
    known = Step("hear", f"the yes of {c} on {t} arrives again", coordinator=who)
    draft.step(f"hear/{t}/{c}/again", known, [vote], (), [heard])
    if parts.votes_numbered(part):
        late = Step("ignore", f"the yes of {c} on {t} arrives too late", coordinator=who)
        draft.step(f"ignore-vote/{t}/{c}", late, [vote], (), [over])


def _standing(draft: Draft, parts: Parts, part: Part) -> None:
    """How a part that is free of promise votes."""
    t, c, who = part.whole, part.controller, parts.decider(part.whole)
    vote, heard, stands = (at(kind, part) for kind in ("vote", "heard", "stands"))
    promised = [at("promised", other) for other in parts.excluding(part)]
    draft.step(
        f"stand/{t}/{c}",
        Step("stand", f"{c} votes yes on {t}, and promises nothing", c),
        (),
        [stands, vote],
        [*part.inputs, *part.permissive, *(copy(c, place) for place in part.copied_full)],
        [*part.outputs, *part.inhibitive, *(copy(c, place) for place in part.copied_empty), *promised, stands, vote],
    )
    again = Step("repeat", f"{c} repeats its yes on {t}", c)
    draft.step(f"stand/{t}/{c}/again", again, (), [vote], [stands], [vote])
    heard_of = Step("hear", f"the yes of {c} on {t} arrives", coordinator=who)
    draft.step(f"hear/{t}/{c}", heard_of, [vote], [heard], (), [heard, committed(t)])
    known = Step("hear", f"the yes of {c} on {t} arrives again", coordinator=who)
    draft.step(f"hear/{t}/{c}/again", known, [vote], (), [heard])
    if parts.votes_numbered(part):
        old = Step("ignore", f"the yes of {c} on {t} from before the order arrives", coordinator=who)
        draft.step(f"ignore-vote/{t}/{c}", old, [vote], (), [committed(t)])


def _ordering(draft: Draft, parts: Parts, part: Part, over: str) -> None:
    t, c, who = part.whole, part.controller, parts.decider(part.whole)
    commit, abort, heard, noted = (at(kind, part) for kind in ("commit-order", "abort-order", "heard", "noted"))
    order = Step("order", f"{who} orders {c} to fire its part of {t}", coordinator=who)
    draft.step(f"order-commit/{t}/{c}", order, (), [commit], [committed(t)], [commit, noted])
    if not part.free:
        order = Step("order", f"{who} orders {c} to give up its part of {t}", coordinator=who)
        given_up, not_sent = [asked(t), over], [abort, committed(t), noted]
        draft.step(f"order-abort/{t}/{c}", order, (), [abort], given_up, [*not_sent, heard])
        # Its vote was heard, and is of no use any more.
        draft.step(f"order-abort/{t}/{c}/voted", order, [heard], [abort], given_up, not_sent)
    acknowledgement = at("acknowledgement", part)
    note = Step("note", f"{c} is known to have obeyed on {t}", coordinator=who)
    draft.step(f"note/{t}/{c}", note, [acknowledgement], [noted], (), [noted])
    draft.step(f"note/{t}/{c}/again", note, [acknowledgement], (), [noted])


def _obeying(draft: Draft, parts: Parts, part: Part) -> None:
    t, c = part.whole, part.controller
    commit, abort, obeyed, acknowledgement = (
        at(kind, part) for kind in ("commit-order", "abort-order", "obeyed", "acknowledgement")
    )
    promised = at("stands" if part.free else "promised", part)
    apply = Step("apply", f"the order for {t} arrives at {c}, which fires its part", c)
    for effect in effects(parts, part):
        inputs, outputs = [commit, *effect.inputs], [acknowledgement, *effect.outputs]
        empty = [*effect.empty, *([obeyed] if part.free else [])]  # it may stand anew before the round is closed
        draft.step(f"apply/{t}/{c}{effect.suffix}", apply, [*inputs, promised], [*outputs, obeyed], effect.full, empty)
        if not parts.orders_numbered(part):
            twice = Step("apply", f"the order for {t} arrives at {c} once more, which fires its part again", c)
            draft.step(
                f"apply-again/{t}/{c}{effect.suffix}", twice, inputs, outputs, effect.full, [*effect.empty, promised]
            )
    why = "has obeyed it before" if part.free else "has nothing promised"
    known = Step("apply", f"the order for {t} arrives at {c}, which {why} and acknowledges it", c)
    if parts.orders_numbered(part):
        draft.step(f"acknowledge-commit/{t}/{c}", known, [commit], [acknowledgement], [obeyed], [acknowledgement])
    if part.free:
        return
    if parts.orders_numbered(part):
        draft.step(
            f"acknowledge-commit/{t}/{c}/unpromised", known, [commit], [acknowledgement, obeyed], (), [promised, obeyed]
        )
    release = Step("release", f"the order to give up {t} arrives at {c}", c)
    draft.step(f"release/{t}/{c}", release, [abort, promised], [obeyed, acknowledgement])
    draft.step(f"release/{t}/{c}/unpromised", release, [abort], [obeyed, acknowledgement], (), [promised, obeyed])
    draft.step(f"acknowledge-abort/{t}/{c}", release, [abort], [acknowledgement], [obeyed], [acknowledgement])


def effects(parts: Parts, part: Part) -> list[Effect]:
    """How a part is applied: where it is firable, which under the true protocol it is, and else blindly."""
    return [guarded(part)] if parts.variant.is_true else list(blind(part))


def copy(reader: str, place: str) -> str:
    """The place that holds what a controller last heard of a place of another."""
    return f"copy/{reader}/{place}"


def _listed(group: Sequence[str]) -> str:
    return " and ".join(group)


def _by(parts: Parts, t: str) -> str:
    """Who decides, where there are several that might."""
    return f" by {parts.decider(t)}" if len(parts.deciders) > 1 else ""
