"""Links between the hosts of a cell: in one process, over Zenoh, over a serial line, behind one small interface."""
