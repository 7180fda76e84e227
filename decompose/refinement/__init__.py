"""Refining a conceptual net to a detailed one by registered tasks, and carrying over what was proved of it."""
