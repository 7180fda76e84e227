"""A net of one machine, and a binding of it to a device with everything that a binding can say."""

import pytest

from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.nets.diagnostics import InputError
from firable.nets.text import parse_net

NET_TEXT = """
firable: 1
cell: c
controllers:
  M:
    start: idle
    inputs: there
    places: {idle: , move: {send: {machine: M, command: MOVE}, until: moved}, stop: {send: {machine: M, command: STOP}}}
transitions:
  t1: {from: M.idle, to: M.move, if: M.there}
  t2: {from: M.move, to: M.stop}
  t3: {from: M.stop, to: M.idle}
"""
NET = parse_net(NET_TEXT)

GOOD = """firable_bind: 1
cell: c
devices:
  plc:
    driver: modbus-tcp
    host: 10.0.0.1
    heartbeat: {write: holding 0, every_s: 0.2, tripped: discrete 9}
    alive: {read: input 0, within_s: 1}
    safe: {coil 1: false}
    channels:
      M: {number: holding 1, taken: input 1, done: input 2}
      N: {number: holding 5}
signals:
  M.there: {device: plc, read: discrete 0, on_loss: hold, edges: input 7, invert: true}
  M.moved: acknowledged
commands:
  M.move: {device: plc, channel: M, write: {holding 2: 7}}
  M.stop: {device: plc, channel: M, write: {holding 2: 8}}
"""


def refusal(text: str, *, fit: bool = False) -> list[tuple[str, str]]:
    """The codes of what is wrong with a binding, or with it and the net, each with its line and what stands there."""
    right = parse_binding(text, "c.bind.yaml") if fit else None
    with pytest.raises(InputError) as refused:
        bound_driver(right, NET) if right is not None else parse_binding(text, "c.bind.yaml")
    assert all(problem.hint for problem in refused.value.diagnostics)
    found = []
    for one in refused.value.diagnostics:
        assert one.span is not None
        start = one.span.column - 1
        found.append((one.code, f"{one.span.line}: {one.span.excerpt[start : start + one.span.length]}"))
    return found


def edited(old: str, new: str) -> str:
    assert GOOD.count(old) == 1
    return GOOD.replace(old, new)
