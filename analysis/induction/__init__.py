"""Proofs without enumeration: the transition relation as Boolean terms, and what a solver concludes from it."""
