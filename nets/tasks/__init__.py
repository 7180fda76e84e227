"""Registered tasks: what the places of a conceptual net open to, as records and as `*.tasks.yaml` files."""
