"""Drawn nets with time limits, and time limits put on the places of a net: those of the simulation."""

from hypothesis import strategies as st

from firable.executor.simulation.drawn import drawn_timed_net, with_limits
from firable.nets.net import Net
from firable.nets.text import parse_net

__all__ = ["HANDOVER", "TWO_TIMES", "timed_nets", "waiting", "with_limits"]


def waiting(net: Net) -> list[str]:
    """The places that wait for a completion."""
    return [place.name for place in net.places if place.completion is not None]


def timed_nets() -> st.SearchStrategy[Net]:
    """The nets of `drawn_timed_net`, with every choice left to hypothesis.

    Those without a place that waits for a completion are among them.
    """
    return st.randoms(use_true_random=False).map(lambda draw: drawn_timed_net(draw, "timed"))


HANDOVER = """\
firable: 1
cell: handover
controllers:
  a: {start: free, inputs: key, places: {free: , go: {send: {machine: A, command: GO}, until: there, within: 1s}}}
  b: {start: idle, places: {idle: , has: }}
transitions:
  start: {from: a.free, to: a.go}
  hand: {from: [a.go, b.idle], to: [a.free, b.has]}
  again: {from: a.go_fault, to: a.go, if: a.key}
  use: {from: b.has, to: b.idle}
"""
"""One machine that may be late, and whose completion is waited for in a transition of two controllers."""

TWO_TIMES = parse_net("""\
firable: 1
cell: two-times
controllers:
  a:
    start: [free, rest]
    inputs: key
    places:
      free:
      go:   {send: {machine: A, command: GO}, until: there, within: 1s}
      rest:
      spin: {send: {machine: S, command: SPIN}, until: spun, within: 1500ms}
  b: {start: idle, places: {idle: , has: , lamp: }}
transitions:
  start: {from: a.free, to: a.go}
  hand:  {from: [a.go, b.idle], to: [a.free, b.has]}
  again: {from: a.go_fault, to: a.go, if: a.key}
  begin: {from: a.rest, to: a.spin}
  end:   {from: a.spin, to: a.rest}
  anew:  {from: a.spin_fault, to: a.rest}
  use:   {from: b.has, to: b.idle}
  lit:   {from: b.idle, to: b.lamp, unless: a.go_overdue}
  out:   {from: b.lamp, to: b.idle}
""")
"""Two machines of one controller that may be late at once, and a lamp elsewhere that reads the timer of one."""
