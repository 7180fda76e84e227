"""The machines of a cell: the plant file, the net it stands for, and the loop that this net closes."""
