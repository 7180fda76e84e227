"""Stable storage: what the machines of a process keep, so that a crash at any moment loses and doubles nothing."""
