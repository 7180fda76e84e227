"""Proofs and runs found on a few places of a net."""
