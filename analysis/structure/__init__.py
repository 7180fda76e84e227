"""What the arcs alone say: invariants, siphons and traps, net classes; nothing here explores a marking."""
