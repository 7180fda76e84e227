"""The protocol proved for nets of any size: a transition system, its inductive invariant, and what follows."""
