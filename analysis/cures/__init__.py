"""Cures: who waits for whom in a deadlock, and the smallest change of a net that makes a violated verdict proved."""
