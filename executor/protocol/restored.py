"""What of a controller is kept in stable storage, and a controller that is filled from it after a restart.

What is kept, and the fault that would show if it were not:

- `word`, the marking and the completion signals in the image, in pieces (`stored_word`), whenever a firing, a promise
  or a completion has changed it: a token would be back where it was, and fire its transition, and send its command, a
  second time; or a completion that was told once would be awaited for ever.
- `promise/<round>`, the parts promised in a round that is not decided: the commit may be under way, and what the part
  needs would be gone when it comes. `word` holds the values of the signals that the promise reads, which stay in the
  image until it ends. A vote that promises nothing is not kept: given again, it may be another, and an undecided round
  takes the newer one, a decided one none.
- `closed`, of each coordinator the rounds decided, and below which all are: a late copy of a request would be promised
  once more, and a late copy of its commit then applied a second time.
- `command/...`: see `commands`. A machine would be commanded twice, or never.
- `turns` of the arbiter, if there are any: a rule "twice this, once that" would begin anew and break its own order.
- `epoch`: reports would be numbered from 0 again, and ignored as old ones; then nobody asks for what is enabled here.

Not kept: *sensors*, because nobody knows what they show after an outage: their gates are closed, wanted 1 or 0, until
the driver has told them anew. *Timers*, because a time that ran while nobody looked says nothing (`timers`). *Latched*
values, for the same reason; a completion among them is told again, because its command is asked after. What the
coordinator was *told* and has *seen*, because a report of the new epoch is newer than all. Which local transition fired
*last*, because it only shares out turns where no arbiter decides. The coordinator's epoch, because a message of an
earlier one can only repeat what is true: rounds below `closed_below` are closed for ever, and what it has seen of
reports is older than those of the new epoch here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from firable.executor.protocol.above import Promise
from firable.executor.protocol.commands import Commands
from firable.executor.protocol.messages import EPOCH_BITS, Readiness, Stored
from firable.executor.protocol.stored_word import stored_word

if TYPE_CHECKING:
    from firable.executor.protocol.controller import LocalController


def restore(machine: LocalController, kept: Mapping[str, Stored]) -> None:
    """Fill a controller that is in its initial marking with what was kept of it, under a new epoch."""
    machine.epoch = _number(kept.get("epoch", 0)) + 1
    for above in machine.above.values():
        above.readiness = Readiness((machine.epoch << EPOCH_BITS) - 1, frozenset())
        above.told = above.readiness.sequence
    machine.word = machine.kept_word = stored_word(kept, machine.word)
    machine.commands = Commands(machine.subnet, kept)
    for key, value in kept.items():
        match key.partition("/"), value:
            case ("promise", _, number), [*names]:
                machine.promises[int(number)] = Promise.of(machine.parts, map(str, names))
            case ("closed", _, coordinator), [int(below), [*numbers]] if coordinator in machine.above:
                machine.above[coordinator].closed_below = machine.above[coordinator].kept_below = below
                machine.closed |= set(map(_number, numbers))
            case ("turns", _, _), [*turns]:
                machine.arbiter.turns = machine.kept_turns = tuple(map(_number, turns))


def _number(value: Stored) -> int:
    if not isinstance(value, int):
        raise TypeError(f"{value!r} was kept where a number belongs")
    return value
