"""Firing: Eq. (1)-(4) once, the two disciplines, arbitration, conflicts, traces, complement of a place."""
