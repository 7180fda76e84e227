"""What holds of a cell together with its machines: the loop, its faults, and what gates free was too hopeful about."""
