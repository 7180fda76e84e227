"""Executing a decomposition: local controllers, their coordinator, drivers, the simulated cell.

`load` and `run` of `firable.executor.run` are the way in. The voting protocol (`coordinator`, `controller`, `messages`)
is pure: no clock, socket, task or random source. The room imports `semantics` and `nets` and nothing that proves.
"""
