"""Deterministic simulation: the executor with everything around it that can fail, from one seed."""
