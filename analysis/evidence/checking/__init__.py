"""Checking evidence: imports nothing that finds any, neither an engine nor a proof method nor what makes evidence."""
