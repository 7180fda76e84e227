"""Checking a bundle again: from its content alone, by another solver, and by nothing that made it.

Nothing here imports the split, the obligations or their proofs; `tests/architecture/test_imports.py` holds it to that.
"""
